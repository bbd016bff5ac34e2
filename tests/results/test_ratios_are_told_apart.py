"""Ratios of a study by their own confidence, weights and units; requirements by their own end."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from dsa_des.results.ratio import paired_ratio
from dsa_des.results.record import RATIO, RatioOf, Result
from dsa_des.results.summary import compare_axis, summarise
from dsa_des.studies.study_file import read_study
from tests.results.conftest import rows_of_table
from tests.results.test_ratios import ratio, rows_of
from tests.results.test_requirements import ROOT, STUDY


def flags(count: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(17)
    n = random.random(count) < 0.7
    return n, n & (random.random(count) < 0.4), random.choice([1.0, 5.0], count)


def test_intervals_are_of_the_study_s_confidence() -> None:
    n, m, w = flags()
    for confidence in (0.8, 0.99):
        (line,) = summarise(rows_of(n, m, w), [ratio(weight="w")], confidence, "t", {})
        by_hand = paired_ratio(n, m, w, confidence=confidence)
        assert (line.estimate.low, line.estimate.high) == pytest.approx(by_hand.interval)
        assert line.other is not None
        drawn = paired_ratio(n, m, w, confidence=confidence, method="bootstrap", resamples=2000)
        assert line.other.interval == pytest.approx(drawn.interval)


def test_an_encounter_s_number_means_another_in_another_file() -> None:
    """Two files with encounters 0 and 1 each: four units, of which two rows each hang together."""
    table = pa.table({
        "n": [1.0] * 8, "m": [0.0, 0, 1, 1, 1, 1, 0, 0], "family": [0.0, 0, 1, 1] * 2,
        "file": ["a"] * 4 + ["b"] * 4, "replica": list(range(4)) * 2,
        "error": pa.nulls(8, pa.string()), "status": ["done"] * 8,
    })  # fmt: skip
    of = Result("r", RATIO, "", ratio=RatioOf("n", "m", None, "family"))
    for over, clusters in ((["file"], 4), ([], 2)):
        (line,) = summarise(
            rows_of_table(table, ["file"] if over else [], over), [of], 0.95, "t", {}
        )
        assert line.ratio is not None and line.ratio.clusters == clusters


def test_differences_of_ratios_are_weighted_and_of_families() -> None:
    """Copies of each run, of a quarter of its weight, change neither the value nor the interval."""
    n, m, w = flags()
    other = n & (np.random.default_rng(3).random(40) < 0.7)

    def compared(times: int) -> tuple[float, float, float]:
        copies = np.repeat(np.arange(40), times)
        rows = rows_of(
            np.tile(n[copies], 2), np.concatenate([m[copies], other[copies]]),
            np.tile(w[copies] / times, 2), np.tile(copies.astype(float), 2),
            axis=np.repeat([0.0, 1.0], len(copies)), replica=np.tile(np.arange(len(copies)), 2),
        )  # fmt: skip
        of = [ratio(weight="w", cluster="family")]
        found = compare_axis(rows, "x", 0.0, of, 0.95, "t")[0].difference.paired
        return found.value, found.low, found.high

    expected = (w * other).sum() / (w * n).sum() - (w * m).sum() / (w * n).sum()
    plain = (other.sum() - m.sum()) / n.sum()
    assert abs(expected - plain) > 0.01
    assert compared(1)[0] == pytest.approx(expected)
    assert compared(4) == pytest.approx(compared(1))


def test_the_cheap_end_is_the_one_that_the_file_names(tmp_path: Path) -> None:
    for said, last in (("", False), ('cheaper = "first"\n', False), ('cheaper = "last"\n', True)):
        text = STUDY.replace("SCENE", str(ROOT / "configs" / "first_light.toml")) + said
        (tmp_path / "s.toml").write_text(text, encoding="utf-8")
        (found,) = read_study(tmp_path / "s.toml").requirements
        assert (found.cheap_last, found.below) == (last, False)
