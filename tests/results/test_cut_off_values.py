"""Values that the start or the end of a run cuts off are counted, and said beside the mean."""

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from dsa_des import load_scene, run
from dsa_des import study as run_study
from dsa_des.cli import main


def parts(folder: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(f"{folder}/parts").to_pylist()
    return sorted(rows, key=lambda row: (row["cell"], row["replica"]))


def lone(metrics: list[Any], **sets: Any) -> dict[str, Any]:
    """Results of one run of the small scene; ``__`` in a key is a dot."""
    keys = {key.replace("__", "."): value for key, value in sets.items()}
    found = run_study(
        load_scene("small.toml", sets=[f"{key}={value}" for key, value in keys.items()]),
        metrics=metrics, replicas=1, workers=1,
    )  # fmt: skip
    row: dict[str, Any] = found.runs.to_pylist()[0]
    return row


def test_first_detections_are_cut_off_where_the_run_says_so(small: Path) -> None:
    """The radar sees 4.8 km and the intruder begins at 5 km; the IR sees it at once."""
    row = lone(["first_detection"])
    summary = run(load_scene("small.toml")).summary["sensors"]
    for name in ("radar", "ir"):
        at = summary[name]["first_detection"].get("at")
        assert row[f"first_detection_cut_off.{name}"] == (at and f"at {at}"), name
    assert row["first_detection_cut_off.radar"] is None
    assert row["first_detection_cut_off.ir"] == "at the start"
    assert row["first_detection_cut_off.fused"] == "at the start"


def test_what_never_happens_is_said(small: Path) -> None:
    row = lone(["first_detection", "declaration", "well_clear"], blocks__radar__reach_km=1)
    assert row["first_detection_range_m.radar"] is None
    assert row["first_detection_cut_off.radar"] == "never"
    assert row["declaration_cut_off.radar"] == "never"
    assert row["declared.radar"] == 0 and row["declaration_time_s.radar"] is None
    assert row["declared.ir"] == row["declared.any"] == 1
    assert row["declaration_time_s.any"] == row["declaration_time_s.ir"]
    # A run without a loss of well clear is as it should be.
    assert row["well_clear_loss_cut_off"] is None


def test_a_late_message_of_the_first_scan_is_still_of_the_start(small: Path) -> None:
    row = lone(["first_detection"], blocks__ir__latency_s=0.25)
    assert row["first_detection_time_s.fused"] == pytest.approx(0.25)
    assert row["first_detection_cut_off.fused"] == "at the start"


def test_a_fusion_that_waits_for_the_radar_is_not_cut_off(small: Path) -> None:
    row = lone(["first_detection"], blocks__ir__reach_km=1)
    assert row["first_detection_cut_off.fused"] is None


@pytest.mark.parametrize(("reach_km", "said"), [(9, "at the start"), (4.8, None)])
def test_a_declaration_is_cut_off_if_the_first_scans_all_detect(
    small: Path, reach_km: float, said: str | None
) -> None:
    metric = {"metric": "declaration", "m": 2, "n": 4, "sensors": ["ir"]}
    row = lone([metric], blocks__ir__reach_km=reach_km)
    assert row["declaration_cut_off.ir"] == said
    assert row["declaration_cut_off.any"] == said


def test_closest_approaches_are_cut_off_by_the_end_before_the_aircraft_meet(small: Path) -> None:
    early = lone(["closest_approach"])
    assert early["closest_approach_time_s"] == pytest.approx(6)
    assert early["closest_approach_cut_off"] == "at the end of the run"
    assert early["detection_to_closest_cut_off.radar"] == "at the end of the run"
    assert early["detection_to_closest_cut_off.ir"] == "at the start"
    late = lone(["closest_approach"], duration_s=60)
    assert late["closest_approach_cut_off"] is None
    assert late["detection_to_closest_cut_off.radar"] is None
    scene = load_scene("small.toml")
    (met,) = run(scene).summary["targets"].values()
    assert met["closest_approach"]["at"] == "the end of the run"


def test_a_lone_step_that_misses_the_end_is_cut_off_all_the_same(small: Path) -> None:
    row = lone([{"metric": "closest_approach", "step_s": 4}], duration_s=5.9)
    assert row["closest_approach_cut_off"] == "at the end of the run"


def test_a_study_counts_them_per_cell_and_prints_them(small: Path) -> None:
    text = """
scene = "small.toml"
replicas = 5
metrics = ["first_detection"]
[axes]
blocks.ir.reach_km = [0.1, 4.8, 9]
"""
    Path("study.toml").write_text(text)
    result = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "out"])
    assert result.exit_code == 0, result.output
    rows = parts("out")
    summary = pq.read_table("out/summary.parquet").to_pylist()
    name = "first_detection_range_m.ir"
    for line in (line for line in summary if line["result"] == name):
        said = [r["first_detection_cut_off.ir"] for r in rows
                if r["ir.reach_km"] == line["ir.reach_km"]]  # fmt: skip
        count = len([item for item in said if item is not None])
        assert line["cut_off"] == count
        assert line["cut_off_where"].startswith(f"{count} of 5 " if count == 5 else "")
    by_reach = {x["ir.reach_km"]: x for x in summary if x["result"] == name}
    assert by_reach[0.1]["cut_off_where"] == "5 of 5 never"
    assert by_reach[4.8]["cut_off"] == 0
    assert "at the start" in by_reach[9.0]["cut_off_where"]
    shown = " ".join(result.output.split())
    assert "(5 of 5 never)" in shown
    assert f"({by_reach[9.0]['cut_off_where']})" in shown
    again = CliRunner().invoke(main, ["study", "show", "out"])
    assert "(5 of 5 never)" in again.output
