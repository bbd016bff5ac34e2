"""Analytic answers of timing metrics: against simulation, against brute force, and as axes."""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from components.metrics.fused_share import mean_coincidence_share
from components.metrics.track_quality import age_quantile_s, mean_age_s, mean_interval_s
from dsa_des.cli import main
from dsa_des.scene.scene import load_scene
from dsa_des.studies.chunk import run_chunk
from dsa_des.studies.runner import result_tables_of_study
from dsa_des.studies.study import Study
from dsa_des.studies.study_digest import record_of
from dsa_des.studies.study_file import read_study
from dsa_des.time.clock import ClockSpec

READY = Path(__file__).parents[2] / "configs" / "studies"
TICKS = 10**9


class Finished:
    """A study's folder in memory: every part is run when it is made."""

    def __init__(self, study: Study) -> None:
        self.study, self.record = study, record_of(study)
        chunks = study.chunks(0, range(len(study.cells)))
        self.parts = [run_chunk(study, chunk).content for chunk in chunks]

    def each_part(
        self, before_round: int | None = None, columns: Sequence[str] | None = None
    ) -> Iterator[object]:
        import io

        import pyarrow.parquet as pq

        for part in self.parts:
            yield pq.read_table(io.BytesIO(part), columns=columns)


def lines_of(name: str, *sets: str) -> dict[tuple[str, tuple[object, ...]], object]:
    study = read_study(READY / name, sets=("runs_per_chunk=100", *sets))
    tables = result_tables_of_study(study, Finished(study))  # type: ignore[arg-type]
    assert tables.rows.failed == 0
    return {(line.result.name, line.at): line for line in tables.lines}


def test_jitter_and_drift_of_the_ready_study_agree_with_their_expectation() -> None:
    lines = lines_of(
        "jitter_and_drift.toml",
        "replicas=12",
        "axes.blocks.ir.jitter_s=[0, 0.01, 0.04]",
        "axes.blocks.ir.rate_error_ppm=[0, 300]",
    )
    for jitter_s in (0.0, 0.01, 0.04):
        for ppm in (0.0, 300.0):
            line = lines["fused_share.ir_with_radar", (jitter_s, ppm)]
            if jitter_s == 0.0:  # nothing is random: drift is counted scan by scan
                assert line.estimate.value == pytest.approx(line.expected, abs=1e-12)
            else:
                trials = 12 * 240
                deviation = math.sqrt(line.expected * (1 - line.expected) / trials)
                assert abs(line.estimate.value - line.expected) < 4 * deviation
    assert lines["fused_share.ir_with_radar", (0.0, 0.0)].expected == 0.5
    assert lines["fused_share.ir_with_radar", (0.0, 300.0)].expected < 0.3


def test_latency_and_loss_of_the_ready_study_agree_with_their_expectation() -> None:
    lines = lines_of(
        "latency_and_loss.toml",
        "replicas=6",
        "set.duration_s=200",
        "axes.blocks.radar.latency_s=[0, 0.25]",
    )
    for latency_s in (0.0, 0.25):
        for name, exact in (
            ("age_of_information_mean_s", latency_s + 0.1),
            ("age_of_information_p95_s", latency_s + 0.19),
            ("track_update_interval_s", 0.2),
            ("declaration_delay_s.radar", 0.4),
        ):
            line = lines[name, (latency_s, 0.0)]
            assert line.expected == pytest.approx(exact, abs=1e-12)
            assert line.estimate.value == pytest.approx(exact, abs=1e-9)
        for name, wide in (
            ("age_of_information_mean_s", 0.012),
            ("age_of_information_p95_s", 0.08),
            ("track_update_interval_s", 0.01),
        ):
            line = lines[name, (latency_s, 0.4)]
            assert line.estimate.value == pytest.approx(line.expected, abs=wide)
        # The radar declares before the link that loses messages.
        assert lines["declaration_delay_s.radar", (latency_s, 0.4)].estimate.value == (
            pytest.approx(0.4, abs=1e-9)
        )


@pytest.mark.parametrize("through", [1.0, 0.8, 0.3])
@pytest.mark.parametrize("jitter_s", [0.0, 0.02])
def test_ages_of_lossy_scans_against_a_long_random_sequence(
    through: float, jitter_s: float
) -> None:
    draws = np.random.default_rng(5)
    scans = np.flatnonzero(draws.random(400_000) < through)
    times = scans * 0.2 + jitter_s * draws.standard_normal(len(scans))
    gaps = np.diff(times)
    assert mean_interval_s(0.2, through) == pytest.approx(gaps.mean(), rel=0.01)
    age = (gaps**2).sum() / 2 / gaps.sum()
    assert mean_age_s(0.2, through, jitter_s) == pytest.approx(age, rel=0.01)
    if jitter_s == 0.0:
        for share in (0.3, 0.5, 0.95):
            x = age_quantile_s(0.2, through, share)
            assert np.minimum(gaps, x).sum() / gaps.sum() == pytest.approx(share, abs=0.005)


@pytest.mark.parametrize(
    ("rate", "ppm", "jitter_s", "gate_s", "delay_s"),
    [
        (2, 0, 0.01, 0.02, 0.0),
        (2, 500, 0.03, 0.02, 0.013),
        (3, -2000, 0.0, 0.03, 0.05),
        (5, 40, 0.005, 0.0, 0.0),
    ],
)
def test_jittered_shares_against_random_clocks(
    rate: int, ppm: int, jitter_s: float, gate_s: float, delay_s: float
) -> None:
    own = ClockSpec(Fraction(rate), Fraction(1, 20), Fraction(ppm), jitter_s)
    other = ClockSpec(Fraction(5), jitter_s=jitter_s / 2)
    found = mean_coincidence_share(
        own, other, ticks_per_s=TICKS, end_tick=100 * TICKS,
        gate_ticks=int(gate_s * TICKS), delay_ticks=round(delay_s * TICKS),
    )  # fmt: skip
    draws = np.random.default_rng(3)
    shares = []
    for _ in range(60):
        mine = np.arange(0.05, 100, 1 / (rate * (1 + ppm * 1e-6)))
        theirs = np.arange(0, 100, 0.2)
        mine = mine + delay_s + jitter_s * draws.standard_normal(len(mine))
        theirs = theirs + jitter_s / 2 * draws.standard_normal(len(theirs))
        apart = np.abs(mine[:, np.newaxis] - theirs).min(axis=1)
        shares.append(np.mean(apart <= gate_s + 1e-12))
    assert found == pytest.approx(np.mean(shares), abs=0.01)


def test_no_answer_is_given_where_a_gate_holds_two_scans() -> None:
    clock, jittered = ClockSpec(Fraction(5)), ClockSpec(Fraction(5), jitter_s=0.03)
    for own, other, gate in ((clock, clock, TICKS // 10), (clock, jittered, TICKS // 50)):
        times = {"ticks_per_s": TICKS, "end_tick": 10 * TICKS, "gate_ticks": gate}
        assert mean_coincidence_share(own, other, **times) is None
        assert mean_coincidence_share(other, own, **times) is None


def test_the_options_of_a_wire_written_as_text_can_be_set(small: Path) -> None:
    scene = load_scene("small.toml", sets=["wires[3].drop_probability=0.25", "wires[3].delay_s=1"])
    (wire,) = [w for w in scene.wires if (w.source, w.target) == ("radar", "fusion")]
    assert (wire.drop_probability, wire.delay_s) == (0.25, 1)
    chain = CliRunner().invoke(main, ["run", "small.toml", "--set", "wires[0].delay_s=1"])
    assert chain.exit_code == 2 and "wires" in chain.output


def test_a_study_with_an_axis_on_a_wire_is_shown_again(small: Path) -> None:
    text = Path("study.toml").read_text().replace("replicas = 24", "replicas = 2")
    text = text.replace("blocks.radar.scan_rate_hz = [1, 5]", '"wires[3].delay_s" = [0, 1]')
    text += 'axis = "wires[3].delay_s"\n'
    Path("study.toml").write_text(text)
    ran = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "out"])
    assert ran.exit_code == 0, ran.output
    again = CliRunner().invoke(main, ["study", "show", "out"])
    assert again.exit_code == 0, again.output
    assert "one by one" not in again.output
    Path("study.toml").write_text(text.replace("delay_s", "jitter_s"))
    ran = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "late"])
    assert ran.exit_code == 0, ran.output
    assert "one by one" not in ran.output


def test_a_changed_encounter_file_is_another_study(tmp_path: Path) -> None:
    file = tmp_path / "one.daa"
    original = (READY.parent / "encounters" / "crossing.daa").read_text()
    file.write_text(original)

    def digest() -> str:
        sets = [f'axes.blocks.traffic.file.files="{tmp_path}/*.daa"', "replicas=1"]
        study = read_study(READY / "folder_by_scan_rate.toml", sets=sets)
        return str(record_of(study).study_sha256)

    first = digest()
    assert digest() == first
    file.write_text(original + "\n")
    assert digest() != first
    file.write_text(original)
    assert digest() == first


def test_pairs_narrow_the_swap_of_fusion_three_times() -> None:
    study = read_study(READY / "fusion_gate.toml", sets=["replicas=12", "runs_per_chunk=100"])
    tables = result_tables_of_study(study, Finished(study))  # type: ignore[arg-type]
    drawn = {str(figure.metric) for figure in study.figures}
    narrower = {c.result.name: c.difference.narrowing_factor for c in tables.compared}
    assert max(narrower[name] for name in drawn) >= 3
