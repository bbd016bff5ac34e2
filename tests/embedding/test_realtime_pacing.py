"""``--realtime``: a run is paced by the wall clock, reports how late it was, and stays the same."""

import json

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from dsa_des.errors import UsageError
from dsa_des.running.pacing import Pacer, parse_factor


class Clock:
    """A wall clock that only moves when somebody sleeps or works."""

    def __init__(self):
        self.time = 100.0
        self.slept = []

    def now(self):
        return self.time

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.time += seconds


def test_a_pacer_waits_and_notes_how_late_it_was():
    clock = Clock()
    pacer = Pacer(2.0, clock.now, clock.sleep)
    pacer.start()
    clock.time += 0.1
    pacer(1.0)  # due at 0.5 s of wall time
    assert clock.slept == [pytest.approx(0.4)]
    clock.time += 0.8  # a slow window: due at 1.0, done at 1.3
    pacer(2.0)
    clock.time += 0.1  # it catches up: due at 1.5
    pacer(3.0)
    assert clock.slept[1:] == [pytest.approx(0.1)]
    report = pacer.report()
    assert report["windows"] == 3
    assert report["max_lag_s"] == pytest.approx(0.3)
    assert report["mean_lag_s"] == pytest.approx(0.1)
    assert "300.0 ms" in pacer.sentence() and "100.0 ms" in pacer.sentence()


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "fast", ""])
def test_factors_that_are_none_are_refused(text):
    with pytest.raises(UsageError, match="--realtime"):
        parse_factor(text)


def _run(configs, folder, *more):
    scene = str(configs / "first_light.toml")
    command = ["run", scene, "--duration", "12", "--out", str(folder), *more]
    return CliRunner().invoke(main, command)


def test_the_command_refuses_a_bad_factor_and_writes_nothing(configs, tmp_path):
    for factor in ("0", "-3", "fast"):
        done = _run(configs, tmp_path / "out", f"--realtime={factor}")
        assert done.exit_code == 2
        assert f"--realtime {factor}" in done.output
    assert list(tmp_path.iterdir()) == []


def test_a_paced_run_leaves_the_same_bytes(configs, tmp_path):
    plain, paced = tmp_path / "plain", tmp_path / "paced"
    assert _run(configs, plain, "--quiet").exit_code == 0
    done = _run(configs, paced, "--realtime", "100")
    assert done.exit_code == 0, done.output
    assert "paced at 100 x wall clock" in done.output
    names = sorted(path.name for path in plain.iterdir())
    assert names == sorted(path.name for path in paced.iterdir())
    for name in names:
        if name != "run.json":
            assert (plain / name).read_bytes() == (paced / name).read_bytes(), name
    first, second = (json.loads((f / "run.json").read_text()) for f in (plain, paced))
    assert "realtime" not in first.pop("timings")
    timings = second.pop("timings")
    assert first == second
    # 12 s at 100 x in windows of at most 0.1 s wall time.
    assert timings["realtime"]["windows"] == 2
    assert timings["wall_s"] >= 0.12
    assert 0.0 <= timings["realtime"]["mean_lag_s"] <= timings["realtime"]["max_lag_s"]


def test_no_wait_is_longer_than_a_system_can_sleep() -> None:
    now, slept = [0.0], []

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    Pacer(1e-4, lambda: now[0], sleep)(1.0)
    assert slept == [3600.0, 3600.0, 2800.0]
