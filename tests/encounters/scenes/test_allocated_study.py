"""A study of a risk ratio in which only a sample of the encounters is flown."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import dsa_des
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.studies import allocation, foreseen
from dsa_des.studies.study_file import read_study
from tests.encounters.scenes.test_closed_loop_risk import SCENE
from tests.encounters.test_set_file import call

RECIPE = """\
closest_s = 40
duration_s = 60
horizontal_m = { uniform = [-900, 900] }
vertical_m = { uniform = [-60, 60] }
bearing_deg = { uniform = [-170, 170] }
own_speed_mps = 50
intruder_speed_mps = 60
own_heading_deg = 217
at = [-41.3, 174.8]
count = 60
"""
STUDY = """\
scene = "scene.toml"
replicas = 60
runs_per_chunk = 16
{allocate}
[[metrics]]
metric = "risk_ratio"
horizontal_m = 300
vertical_m = 90
by = ["bearing"]
needless = true
[draws]
blocks.traffic.encounter = {{ sequence = [0, 1] }}
{more}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Scene and set; the first 20 runs are the pilot."""
    for module in (allocation, foreseen):
        monkeypatch.setattr(module, "PILOT", 20)
    for name, text in (("made", RECIPE), ("scene", SCENE)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    made = call("generate", "--made", tmp_path / "made.toml", "--out", tmp_path / "set.parquet")
    assert made.exit_code == 0
    return tmp_path


def study(folder: Path, name: str, allocate: str, more: str = "", **keys: Any) -> Path:
    """Run a study and return its folder."""
    path = folder / f"{name}.toml"
    path.write_text(STUDY.format(allocate=allocate, more=more), encoding="utf-8")
    dsa_des.study(path, out=folder / name, **{"workers": 1, **keys})
    return folder / name


def rows(folder: Path) -> dict[str, Any]:
    """All rows, in order of cell and replica."""
    table = pq.read_table(folder / "parts")
    return table.sort_by([("cell", "ascending"), ("replica", "ascending")]).to_pydict()


def test_flown_runs_are_those_of_the_whole_study_and_the_ratio_is_that_of_their_sums(
    folder: Path,
) -> None:
    whole = rows(study(folder, "whole", ""))
    part_folder = study(folder, "part", 'allocate = "nmac_risk_ratio"')
    part = rows(part_folder)
    stands_for = np.array(part["stands_for"])
    assert part["error"] == [None] * 60
    assert (stands_for[:20] == 1.0).all() and 0 < (stands_for == 0.0).sum() < 40
    for name in whole:
        if name.endswith(("_mitigated", "manoeuvred", "needless_manoeuvre")):
            for here, there, s in zip(part[name], whole[name], stands_for, strict=True):
                assert (here is None) if s == 0.0 else here == there
        else:  # what is known before anything is flown is what flying finds, to the bit
            assert part[name] == whole[name], name
    found = {r["result"]: r for r in pq.read_table(part_folder / "ratios.parquet").to_pylist()}
    w = np.array(part["encounter_weight"])
    for event in ("nmac", "well_clear_lost"):
        n = np.array(part[f"{event}_nominal"])
        m = np.array([0.0 if x is None else x for x in part[f"{event}_mitigated"]])
        mine = found[f"{event}_risk_ratio"]
        assert mine["ratio"] == pytest.approx((w * m * stands_for).sum() / (w * n).sum())
        assert mine["flown"] == (stands_for > 0.0).sum()
    summary = {r["result"]: r for r in pq.read_table(part_folder / "summary.parquet").to_pylist()}
    m = np.array([0.0 if x is None else x for x in part["manoeuvred"]])
    assert summary["manoeuvred"]["value"] == pytest.approx((m * stands_for).sum() / 60)
    n = np.array(part["nmac_nominal"])
    assert summary["nmac_nominal"]["value"] == pytest.approx(n.mean())


def test_the_same_bytes_with_two_workers_other_chunks_and_after_a_stop(folder: Path) -> None:
    allocate = 'allocate = ["nmac_risk_ratio", "well_clear_lost_risk_ratio"]'
    one = rows(study(folder, "one", allocate))
    path = folder / "one.toml"
    sorted((folder / "one" / "parts").glob("part-001-*"))[-1].unlink()
    dsa_des.study(path, out=folder / "one", resume=True, workers=1)
    assert rows(folder / "one") == one
    path.write_text(path.read_text().replace("runs_per_chunk = 16", "runs_per_chunk = 7"))
    dsa_des.study(path, out=folder / "other", workers=1)
    assert rows(folder / "other") == one


def test_axes_share_the_draws_and_each_cell_learns_by_itself(folder: Path) -> None:
    axis = "[axes]\nblocks.radar.range_km = [0.3, 5]"
    found = study(folder, "axis", 'allocate = "well_clear_lost_risk_ratio"', axis)
    table = rows(found)
    s = np.array(table["stands_for"])
    cell = np.array(table["cell"])
    assert (s[cell == 0] != s[cell == 1]).any()
    ratios = pq.read_table(found / "ratios.parquet").to_pylist()
    both = [r["ratio"] for r in ratios if r["result"] == "well_clear_lost_risk_ratio"]
    assert both[1] < both[0]
    printed = CliRunner().invoke(main, ["study", "show", str(found), "--no-figures"])
    assert printed.exit_code == 0 and "of 60 runs were flown" in printed.stdout


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({'"auto"': '"nmac_risk"'}, "did you mean 'nmac_risk_ratio'?"),
        ({"[draws]": '[[metrics]]\nmetric = "closest_approach"\n[draws]'}, "closest_approach can"),
        (
            {
                'metric = "risk_ratio"\nhorizontal_m = 300\nvertical_m = 90\nby = ["bearing"]\n'
                "needless = true": 'metric = "encounter_weight"'
            },
            "add risk_ratio",
        ),
    ],
)
def test_what_cannot_be_sampled_is_refused(
    folder: Path, changes: dict[str, str], said: str
) -> None:
    text = STUDY.format(allocate='allocate = "auto"', more="")
    for old, new in changes.items():
        text = text.replace(old, new)
    (folder / "bad.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as error:
        read_study(folder / "bad.toml")
    assert said in str(error.value) and "allocate" in str(error.value)
