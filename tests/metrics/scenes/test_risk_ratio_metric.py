"""Ratios of one run of a closed loop, and the class of its geometry by hand."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from test_mitigated_metric import SIZES, scene
from wired import measured

import dsa_des
from components.encounters.risk_metric import bearing_sector

KIND = ("[metric risk_ratio]",)
NMAC, LOSS = "nmac_risk_ratio", "well_clear_lost_risk_ratio"


def ratios(scene, **keys) -> dict[str, float]:
    return measured(scene, {"metric": "risk_ratio", **SIZES, **keys})


@covers("horizontal_m", "vertical_m", "nmac_horizontal_m", "nmac_vertical_m", of=KIND)
def test_ratios_are_those_of_the_events_in_their_sizes():
    # It passes between 200 m and 590 m, where it would have flown right under, 50 m below.
    found = ratios(scene())
    assert (found[NMAC], found[LOSS]) == (0, 1)
    assert ratios(scene(), nmac_horizontal_m=600.0, nmac_vertical_m=100.0)[NMAC] == 1
    assert ratios(scene(), horizontal_m=150.0)[LOSS] == 0
    assert math.isnan(ratios(scene(), nmac_vertical_m=45.0)[NMAC])
    assert math.isnan(ratios(scene(), vertical_m=45.0)[LOSS])


@covers("tau_s", of=KIND)
def test_time_counts_in_the_ratio():
    assert [ratios(scene(), horizontal_m=100.0, tau_s=s)[LOSS] for s in (0.0, 60.0)] == [0, 1]


@covers("step_s", of=KIND)
def test_a_coarse_step_steps_over_what_is_short():
    sparse = scene()
    sparse["blocks"]["traffic"]["sample_interval_s"] = 100.0
    keys = {"nmac_horizontal_m": 20.0}
    found = [ratios(sparse, **keys, step_s=s)[NMAC] for s in (0.1, 10.0)]
    assert found[0] == 0 and math.isnan(found[1])


@covers("by", of=KIND)
@pytest.mark.parametrize(
    ("bearing_deg", "course_deg", "kind", "side"),
    [
        # The ownship flies 70 m/s at 217 degrees, the intruder 200 m/s: at a course 100 degrees to
        # the left, (-35, -197) ahead and to the right, it comes from (105, 197): 62 degrees.
        (0, 217 + 180, "head-on", "ahead"),
        (180, 217, "overtaking", "behind"),
        (60, 217 - 100, "crossing from the right", "right"),
        (-60, 217 + 100, "crossing from the left", "left"),
    ],
)
def test_classes_are_those_of_the_flights(bearing_deg, course_deg, kind, side, tmp_path):
    way = math.radians(217 + bearing_deg)
    crossing = scene()
    traffic = crossing["blocks"]["traffic"]
    traffic["intruders"] = [
        {**crooked.ROLLING, "north_m": 2000 * math.cos(way), "east_m": 2000 * math.sin(way),
         "up_m": 50.0, "heading_deg": course_deg % 360, "climb_mps": 3.0, "speed_mps": 200.0},
    ]  # fmt: skip
    metric = {"metric": "risk_ratio", "by": ["geometry", "bearing"], "horizontal_m": 9e3,
              "vertical_m": 900.0}  # fmt: skip
    out = tmp_path / "out"
    result = dsa_des.study(crossing, metrics=[metric], replicas=1, workers=1, out=out)
    (row,) = result.runs.to_pylist()
    assert (row["encounter_geometry"], row["encounter_bearing"]) == (kind, side)
    found = {r["result"]: r["value"] for r in result.summary.to_pylist()}
    mine = {n for n, v in found.items() if n.startswith(LOSS) and not math.isnan(v)}
    assert mine == {LOSS, f"{LOSS}.{kind.replace(' ', '_')}", f"{LOSS}.{side}"}
    assert "encounter_geometry" not in found


def test_sides_are_quarters_about_the_ownship_s_course():
    edges = np.array([45.0, 135.0, 225.0, 315.0])
    sides = ["ahead", "right", "behind", "left"]
    for turn in (-360.0, 0.0, 360.0):
        assert bearing_sector(edges + turn - 0.1).tolist() == sides
        assert bearing_sector(edges + turn + 0.1).tolist() == [*sides[1:], "ahead"]


def test_who_meets_nobody_is_of_no_class(tmp_path):
    alone = scene()
    alone["blocks"]["traffic"]["intruders"][0]["start_time_s"] = 1e3
    metric = {"metric": "risk_ratio", "by": ["geometry", "bearing"]}
    found = dsa_des.study(alone, metrics=[metric], replicas=1, workers=1, out=tmp_path / "out")
    (row,) = found.runs.to_pylist()
    assert row["encounter_geometry"] is row["encounter_bearing"] is None


@covers("needless", of=KIND)
def test_a_manoeuvre_is_needless_where_well_clear_is_kept_without():
    """It is told to turn whatever is asked; whether that was needed hangs on what is lost."""
    names = ("well_clear_kept_nominal", "manoeuvred", "needless_manoeuvre")
    lost = ratios(scene(), needless=True)
    assert [lost[name] for name in names] == [0, 1, 0]
    assert math.isnan(lost["needless_manoeuvre_share"])
    kept = ratios(scene(), needless=True, vertical_m=45.0)
    assert [kept[name] for name in (*names, "needless_manoeuvre_share")] == [1, 1, 1, 1]
    assert not set(names) & set(ratios(scene()))
