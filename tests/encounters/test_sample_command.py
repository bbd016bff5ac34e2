"""``dsa-des encounters sample``: the table, and what goes wrong."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from components.encounters import model_commands
from components.encounters.command import encounters
from components.encounters.model_file import read_model
from components.encounters.track_rules import TrackRules, conditional_distribution
from tests.alerting.reference_data import rows
from tests.encounters.model_text import small_model


def call(model: Path, out: Path, *more: object) -> Result:
    words = ["sample", "--model", model, "--out", out, "--seed", 9, *more]
    return CliRunner().invoke(encounters, [str(a) for a in words], catch_exceptions=False)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "small.txt"
    path.write_text(small_model(), encoding="utf-8")
    return path


def table(path: Path) -> dict[str, np.ndarray]:
    names, *found = rows(path.read_text(encoding="utf-8"))
    return {name: np.array([float(row[k]) for row in found]) for k, name in enumerate(names)}


def test_raw_tracks_in_the_files_own_units(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "tracks.csv"
    done = call(model, out, "--count", 300, "--duration-s", 12, "--raw")
    assert done.exit_code == 0 and "300 tracks of 12 s, 3900 rows" in done.stdout
    found = table(out)
    assert list(found) == ["track", "t_s", "A", "v", "\\dot v", "\\dot h", "\\dot \\psi", "L"]
    assert np.array_equal(found["track"], np.repeat(np.arange(300), 13))
    assert np.array_equal(found["t_s"], np.tile(np.arange(13), 300))
    assert set(found["A"]) == {1, 2}  # categories are numbered from 1
    assert found["v"].min() >= 20 and found["v"].max() < 140
    for name in ("A", "v", "L"):
        assert (np.ptp(found[name].reshape(300, 13), axis=1) == 0).all()
    assert (np.ptp(found["\\dot h"].reshape(300, 13), axis=1) > 0).any()


def test_a_track_by_its_number(model: Path, tmp_path: Path) -> None:
    call(model, tmp_path / "all.csv", "--count", 30, "--duration-s", 20, "--raw")
    call(model, tmp_path / "one.csv", "--count", 1, "--first", 17, "--duration-s", 8, "--raw")
    every, one = table(tmp_path / "all.csv"), table(tmp_path / "one.csv")
    mine = (every["track"] == 17) & (every["t_s"] <= 8)
    for name, values in one.items():
        assert np.array_equal(values, every[name][mine])


@pytest.mark.parametrize("dynamics", ["euler", "point_mass"])
def test_accepted_tracks_keep_the_rules_and_fly(model: Path, tmp_path: Path, dynamics: str) -> None:
    out = tmp_path / "tracks.csv"
    more = ("--count", 60, "--duration-s", 20, "--dynamics", dynamics)
    assert call(model, out, *more).exit_code == 0
    found = table(out)
    assert found["altitude_ft"].min() >= 500 and found["altitude_ft"].max() <= 4000
    first = found["t_s"] == 0
    assert (found["altitude_ft"][first] == found["L"][first]).all()
    assert (found["north_ft"][first] == 0).all() and (found["heading_deg"][first] == 0).all()
    speed = found["speed_ft_s"][first]
    assert speed == pytest.approx(found["v"][first] * 1852 / 3600 / 0.3048)
    if dynamics == "euler":
        track = {name: values.reshape(60, 21) for name, values in found.items()}
        climb = np.diff(track["altitude_ft"], axis=1)
        assert climb == pytest.approx(track["\\dot h"][:, :-1] / 60, abs=1e-6)
        turn = np.diff(track["heading_deg"], axis=1)
        assert turn == pytest.approx(track["\\dot \\psi"][:, :-1], abs=1e-6)
        way = np.hypot(np.diff(track["north_ft"], axis=1), np.diff(track["east_ft"], axis=1))
        assert way == pytest.approx(track["speed_ft_s"][:, :-1], rel=1e-9)


def test_limits_are_upper_edges_of_the_bins_with_the_1_and_99_percent_points(model: Path) -> None:
    read = read_model(model)
    rules = TrackRules(read)
    # By hand: P(v | A, L) from all cases that the counts stand for.
    speeds = conditional_distribution(read.initial, [0, 5], 1)
    assert speeds.shape == (4, 3) and speeds.sum(axis=1) == pytest.approx(1)
    everywhere = conditional_distribution(read.initial, [], 1)[0]
    counts = read.initial.nodes[1].counts.sum(axis=0)
    assert everywhere == pytest.approx(counts / counts.sum(), abs=2e-3)
    low, high = rules._speed_ft_s / (1852 / 3600 / 0.3048)
    assert set(low) <= {20.0, 60.0, 90.0} and set(high) <= {60.0, 90.0, 140.0}


def test_a_model_that_cannot_be_flown_says_what_is_missing(model: Path, tmp_path: Path) -> None:
    model.write_text(small_model().replace("\\dot h", "climb"), encoding="utf-8")
    done = call(model, tmp_path / "t.csv", "--count", 1, "--duration-s", 5)
    assert done.exit_code == 2
    assert "the model has no variable" in done.stderr and "--raw" in done.stderr
    assert not (tmp_path / "t.csv").exists()
    assert call(model, tmp_path / "t.csv", "--count", 1, "--duration-s", 5, "--raw").exit_code == 0


def test_errors_leave_nothing_behind(model: Path, tmp_path: Path) -> None:
    model.write_text(small_model()[:400], encoding="utf-8")
    done = call(model, tmp_path / "t.csv", "--count", 1, "--duration-s", 5, "--raw")
    assert done.exit_code == 2 and f"error: {model}: " in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["small.txt"]


def test_what_cannot_end_is_refused_and_what_takes_long_is_told(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "t.csv"
    words = ("--count", 100_000_000, "--duration-s", 86_400)
    for more in ((), ("--raw",)):
        done = call(model, out, *words, *more)
        assert done.exit_code == 2 and done.stderr.count("\n") == 1 and not out.exists()
        assert done.stderr.startswith("error: --count 100000000 --duration-s 86400: about ")
        assert "TB" in done.stderr and "at most 11.6 days and 1 TB" in done.stderr
    words = ("--model", model, "--count", 100_000_000, "--out", tmp_path / "s.parquet")
    told: list[str] = []
    monkeypatch.setattr(model_commands, "say", lambda text, err: told.append(text))
    monkeypatch.setattr(model_commands, "PairSampler", lambda *_: (_ for _ in ()).throw(OSError))
    CliRunner().invoke(encounters, ["generate", *map(str, words)])
    assert told == ["note: --count 100000000: about 1.16 days of a processor and 90 GB"]


def test_tracks_last_whole_seconds(model: Path, tmp_path: Path) -> None:
    done = call(model, tmp_path / "t.csv", "--count", 1, "--duration-s", 4.5, "--raw")
    assert done.exit_code == 2 and "--duration-s 4.5: must be a whole number" in done.stderr
