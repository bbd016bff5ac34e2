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
from dsa_des.studies import allocation, foreseen_runs
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


CONF = (Path(__file__).parents[3] / "configs/alerting/do365b.conf").as_posix()
BREAKING = """\
from components.encounters.risk_metric import EncounterWeight
from dsa_des.studies.metric import NUMBER, Result


class Breaking(EncounterWeight):
    def results(self):
        return [Result("number", NUMBER, "of the encounter")]

    def measure(self, group):
        number = super().measure(group)["encounter"]
        if len(group.duration_s) and (number % 4 == 3).any():
            raise ValueError("broken")
        return {"number": number}

    def foresee(self, group):
        return self.measure(group)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Scene and set; the first 20 runs are the first round."""
    for module in (allocation, foreseen_runs):
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
    assert stands_for[:20].max() <= 1.0 / allocation.FIRST_LEAST
    assert 0 < (stands_for == 0.0).sum() < 60
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
    # Of a share that is large, that among those for whom the flown ones stand is the surer one.
    assert summary["manoeuvred"]["value"] == pytest.approx(
        (m * stands_for).sum() / stands_for.sum()
    )
    assert summary["manoeuvred"]["value"] == pytest.approx(np.mean(whole["manoeuvred"]), abs=0.1)
    n = np.array(part["nmac_nominal"])
    assert summary["nmac_nominal"]["value"] == pytest.approx(n.mean())


def test_who_turns_into_everybody_is_told_without_shares_above_1(folder: Path) -> None:
    """All are manoeuvred, most NMACs come where none would be: shares of few that are flown."""
    scene = SCENE.replace("turn_deg = 60", 'turn_deg = 60, direction = "towards"')
    (folder / "scene.toml").write_text(scene, encoding="utf-8")
    found: dict[str, dict[str, Any]] = {}
    for name, allocate in (("whole", ""), ("part", 'allocate = "nmac_risk_ratio"')):
        out = study(folder, name, allocate)
        for table in ("ratios", "summary"):
            rows_of = pq.read_table(out / f"{table}.parquet").to_pylist()
            found[f"{table} of {name}"] = {row["result"]: row for row in rows_of}
    whole, part = (found[f"summary of {name}"] for name in ("whole", "part"))
    assert 0 < found["ratios of part"]["nmac_risk_ratio"]["flown"] < 60
    for name in ("manoeuvred", "needless_manoeuvre", "needless_manoeuvre_share"):
        assert part[name]["low"] <= part[name]["value"] <= part[name]["high"] <= 1.0, name
    for name in ("manoeuvred", "needless_manoeuvre_share", "nmac_risk_ratio"):
        assert part[name]["low"] <= whole[name]["value"] <= part[name]["high"], name


def test_the_same_bytes_with_other_chunks_and_after_a_stop(folder: Path) -> None:
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


def test_runs_that_fail_are_stood_for_by_those_flown_like_them(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A metric that breaks for every fourth encounter that is flown, and what they stood for."""
    half = lambda self, runs: np.full(len(runs.weight), 0.5)  # noqa: E731
    monkeypatch.setattr(allocation.Allocation, "probabilities", half)
    (folder / "own.py").write_text(BREAKING, encoding="utf-8")
    more = '[[metrics]]\nmetric = "./own.py:Breaking"'
    text = STUDY.replace("[draws]", f"{more}\n[draws]")
    (folder / "failing.toml").write_text(
        text.format(allocate='allocate = "nmac_risk_ratio"', more=""), encoding="utf-8"
    )
    dsa_des.study(folder / "failing.toml", out=folder / "failing", workers=1)
    found = rows(folder / "failing")
    s, failed = np.array(found["stands_for"]), np.array([e is not None for e in found["error"]])
    flown = s > 0.0
    assert failed.sum() == (flown & (np.arange(60) % 4 == 3)).sum() > 5
    kept = ~failed
    others = np.where(kept & flown, s - 1.0, 0.0)
    lost = (s[failed & flown] - 1.0).sum()
    s = s + others * lost / others.sum()
    w, n = np.array(found["encounter_weight"])[kept], np.array(found["nmac_nominal"])[kept]
    m = np.array([0.0 if x is None else x for x in found["nmac_mitigated"]])[kept]
    (mine,) = [r for r in pq.read_table(folder / "failing" / "ratios.parquet").to_pylist()
               if r["result"] == "nmac_risk_ratio"]  # fmt: skip
    assert lost > 0.0 and mine["ratio"] == pytest.approx((w * m * s[kept]).sum() / (w * n).sum())


def test_an_early_end_is_that_of_the_rounds_before_and_of_any_number_of_workers(
    folder: Path,
) -> None:
    allocate = (
        'allocate = "well_clear_lost_risk_ratio"\n'
        'stop_when = { metric = "well_clear_lost_risk_ratio", half_width = 0.9, batch = 20 }'
    )
    one = rows(study(folder, "one", allocate))
    assert len(one["replica"]) == 40 and 0.0 in one["stands_for"][20:]
    two = rows(study(folder, "two", allocate, workers=2))
    assert two == one
    sorted((folder / "two" / "parts").glob("part-001-*"))[-1].unlink()
    dsa_des.study(folder / "two.toml", out=folder / "two", resume=True, workers=1)
    assert rows(folder / "two") == one


def test_a_chain_without_a_tracker_is_sampled_too(folder: Path) -> None:
    """The alerting is fed by the truth; it turns or climbs."""
    scene = SCENE.replace(
        '"traffic -> transform -> gate -> radar -> fusion -> tracker -> avoidance"',
        '"traffic -> alerting -> avoidance"',
    )
    head = scene[: scene.index("transform =")]
    scene = (
        f'{head}alerting = {{ type = "alerting.daidalus", scan_rate_hz = 1, conf = "{CONF}" }}\n'
        f'avoidance = {{ type = "avoidance.daidalus", conf = "{CONF}", manoeuvre = "climb" }}\n'
    )
    (folder / "scene.toml").write_text(scene, encoding="utf-8")
    found = rows(study(folder, "true", 'allocate = "well_clear_lost_risk_ratio"'))
    assert found["error"] == [None] * 60 and 0.0 in found["stands_for"]
    assert {1.0} == {m for m, s in zip(found["manoeuvred"], found["stands_for"], strict=True)
                     if s > 0.0 and m == 1.0}  # fmt: skip


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
