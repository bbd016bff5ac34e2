"""What ends a study early, and what makes one of its runs again."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

import dsa_des
from dsa_des.costs import models
from dsa_des.results.folder import StudyFolder
from dsa_des.results.ratio import paired_ratio
from dsa_des.studies import runner
from tests.results.test_ratios import ratio

ROOT = Path(__file__).parents[2]


class _Folder:
    """Rounds of 30 runs each, of one cell."""

    def __init__(self) -> None:
        random = np.random.default_rng(2)
        self.n = random.random(90) < 0.8
        self.m = self.n & (random.random(90) < 0.5)
        self.w = random.choice([1.0, 4.0], 90)

        schema = self._round(0).schema
        self.record = SimpleNamespace(cells=1, replicas=90, schema_of_parts=lambda: schema)

    def _round(self, number: int) -> pa.Table:
        rows = slice(30 * number, 30 * number + 30)
        return pa.table({
            "n": self.n[rows].astype(float), "m": self.m[rows].astype(float),
            "w": self.w[rows], "cell": [0] * 30, "replica": list(range(rows.start, rows.stop)),
            "error": pa.nulls(30, pa.string()), "status": ["done"] * 30,
        })  # fmt: skip

    def each_part(
        self, before_round: int | None = None, columns: Sequence[str] | None = None
    ) -> Iterator[pa.Table]:
        for number in range(3 if before_round is None else before_round):
            table = self._round(number)
            yield table if columns is None else table.select(columns)


def test_a_ratio_ends_a_study_by_its_weighted_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the study's own confidence, over the rounds before."""
    folder = _Folder()
    monkeypatch.setattr(runner, "result_columns_of_study", lambda study: [ratio("r", weight="w")])
    for confidence in (0.5, 0.95):
        by_hand = paired_ratio(folder.n[:60], folder.m[:60], folder.w[:60], confidence=confidence)
        half = 0.5 * (by_hand.interval[1] - by_hand.interval[0])
        for factor, ended in ((0.99, set()), (1.01, {0})):
            study = SimpleNamespace(
                stop_when=SimpleNamespace(metric="r", half_width=half * factor),
                confidence=confidence, interval="t",
            )  # fmt: skip
            assert runner._satisfied_cells(study, folder, 2) == ended  # type: ignore[arg-type]


def test_a_run_is_repeated_and_measured_with_all_that_was_drawn_and_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "s.toml").write_text(f"""\
scene = "{ROOT}/configs/first_light.toml"
replicas = 1
metrics = ["first_detection"]
[set]
duration_s = 2
[axes]
blocks.radar.scan_rate_hz = [4]
[draws]
blocks.radar.offset_s = {{ uniform = [0.01, 0.02] }}
blocks.eo.offset_s = {{ uniform = [0.03, 0.04] }}
""", encoding="utf-8")  # fmt: skip
    dsa_des.study(tmp_path / "s.toml", out=tmp_path / "out", workers=1)
    folder = StudyFolder(tmp_path / "out")
    (row,) = folder.results().to_pylist()
    command = folder.record.command(row)
    seen: list[object] = []
    monkeypatch.setattr(models, "model_errors_in_scene", lambda variants,
    report: seen.append(variants)
                        or ([], []))  # fmt: skip
    models.measure_and_store_errors(folder)
    (variants,) = seen
    scene = variants.scene  # type: ignore[attr-defined]
    assert scene.seed == row["seed"] and float(scene.duration_s) == 2.0
    for name, low in (("radar", 0.01), ("eo", 0.03)):
        drawn = row[_column(row, name)]
        assert low <= drawn <= low + 0.01 and f"blocks.{name}.offset_s={drawn!r}" in command
        assert float(scene.blocks[name].parameters.offset_s) == pytest.approx(drawn)
    assert float(scene.blocks["radar"].parameters.scan_rate_hz) == 4.0


def _column(row: dict[str, object], name: str) -> str:
    """The column of what was drawn for a sensor."""
    (found,) = (key for key in row if name in key and key.endswith("offset_s"))
    return found
