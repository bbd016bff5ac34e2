"""Closest approach, well clear and near mid-air collision by the distances they are defined by."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, chain, measured

FOOT_M = 0.3048
#: Losses are looked for between samples too, or at a spacing only.
WAYS = ({"metric": "well_clear"}, {"metric": "well_clear", "step_s": 0.1})


def abeam(horizontal_m: float, vertical_m: float, name: str = "abeam") -> dict:
    """A target beside the ownship, on a parallel course."""
    bearing = math.radians(300.0)
    own = {key: crooked.OWNSHIP[key] for key in ("heading_deg", "speed_mps", "climb_mps")}
    # The level plane falls away from the ellipsoid by d² / 2R: 3 cm at 600 m.
    return {
        "name": name, "east_m": horizontal_m * math.sin(bearing),
        "north_m": horizontal_m * math.cos(bearing), "up_m": vertical_m, **own,
    }  # fmt: skip


def encounter(*targets: dict, duration_s: float = 2) -> dict:
    return chain({"radar": HEARS_ALL}, targets=targets, duration_s=duration_s)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("vertical_m", [74.0, -74.0])
def test_well_clear_is_lost_by_horizontal_distance(vertical_m, way):
    """606 m apart on the level the slant range is beyond 2000 ft, and well clear is lost."""
    assert math.hypot(606.0, 74.0) > 2000 * FOOT_M > 606.0
    found = measured(encounter(abeam(606.0, vertical_m)), way)
    assert (found["well_clear_lost"], found["nmac"]) == (1, 0)
    assert found["well_clear_loss_time_s"] == 0


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("vertical_m", [29.5, -29.5])
def test_a_near_collision_is_one_by_horizontal_distance(vertical_m, way):
    assert math.hypot(150.5, 29.5) > 500 * FOOT_M > 150.5
    assert measured(encounter(abeam(150.5, vertical_m)), way)["nmac"] == 1


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("horizontal_m", "vertical_m", "lost", "nmac"),
    [(612, 10, 0, 0), (300, 78, 0, 0), (300, -78, 0, 0), (154, 10, 1, 0), (100, 32, 1, 0),
     (70, -32, 1, 0), (20, 70, 1, 0), (140, 20, 1, 1)],
)  # fmt: skip
def test_each_limit_is_that_of_its_own_distance(horizontal_m, vertical_m, lost, nmac, way):
    found = measured(encounter(abeam(horizontal_m, vertical_m)), way)
    assert (found["well_clear_lost"], found["nmac"]) == (lost, nmac)


@covers(
    "horizontal_m", "vertical_m", "nmac_horizontal_m", "nmac_vertical_m",
    of=("[metric well_clear]",),
)  # fmt: skip
@pytest.mark.parametrize(
    ("sizes", "lost", "nmac"),
    [
        ({}, 0, 0),
        ({"horizontal_m": 830}, 1, 0),
        ({"horizontal_m": 810, "vertical_m": 300}, 0, 0),
        ({"horizontal_m": 830, "vertical_m": 35}, 0, 0),
        ({"nmac_horizontal_m": 830}, 0, 0),
        ({"nmac_horizontal_m": 830, "nmac_vertical_m": 45}, 0, 1),
        ({"nmac_horizontal_m": 810, "nmac_vertical_m": 45}, 0, 0),
    ],
)
def test_sizes_may_be_chosen(sizes, lost, nmac):
    """A target 820 m abeam and 40 m higher."""
    found = measured(encounter(abeam(820.0, 40.0)), {"metric": "well_clear", **sizes})
    assert (found["well_clear_lost"], found["nmac"]) == (lost, nmac)


@pytest.mark.parametrize("way", [{}, {"step_s": 0.02}])
def test_well_clear_is_lost_when_the_level_distance_says_so(way):
    """A crossing target, against the first of many dense times by pymap3d."""
    crossing = {
        "name": "crossing", "east_m": -900.0, "north_m": -700.0, "up_m": 60.0,
        "heading_deg": 75.0, "speed_mps": 55.0, "climb_mps": 3.0,
    }  # fmt: skip
    found = measured(encounter(crossing, duration_s=14), {"metric": "well_clear", **way})
    times = np.arange(0.0, 14.0, 0.05)
    apart = [crooked.ned(crossing, t) for t in times]
    level = np.array([math.hypot(north, east) for north, east, _ in apart])
    expected = times[np.argmax(level < 2000 * FOOT_M)]
    assert 1.0 < expected < 13.0
    assert found["well_clear_loss_time_s"] == pytest.approx(expected, abs=0.06)


def test_the_warning_is_from_the_declaration_to_the_loss():
    crossing = {
        "name": "crossing", "east_m": -900.0, "north_m": -700.0, "up_m": 60.0,
        "heading_deg": 75.0, "speed_mps": 55.0, "climb_mps": 3.0,
    }  # fmt: skip
    radar = {**HEARS_ALL, "scan_rate_hz": 4, "declare_m": 3, "declare_n": 4, "offset_s": 0.1}
    scene = chain({"radar": radar}, targets=[crossing], duration_s=14)
    found = measured(scene, "well_clear", "closest_approach")
    loss_s = found["well_clear_loss_time_s"]
    assert found["warning_time_s.radar"] == pytest.approx(loss_s - 0.6)
    assert found["detection_to_closest_s.radar"] == pytest.approx(
        found["closest_approach_time_s"] - 0.1
    )
    assert found["declaration_to_closest_s.radar"] == pytest.approx(
        found["closest_approach_time_s"] - 0.6
    )


def test_the_closest_approach_is_a_slant_range():
    found = measured(encounter(abeam(606.0, 74.0)), "closest_approach")
    assert found["closest_approach_m"] == pytest.approx(math.hypot(606.0, 74.0), abs=0.1)
    passing = {
        "name": "passing", "east_m": -300.0, "north_m": -420.0, "up_m": 90.0,
        "heading_deg": 60.0, "speed_mps": 65.0, "climb_mps": -2.0,
    }  # fmt: skip
    found = measured(encounter(passing, duration_s=8), "closest_approach")
    times = np.arange(0.0, 8.0, 0.1)
    slant = [float(np.linalg.norm(crooked.ned(passing, t))) for t in times]
    assert found["closest_approach_m"] == pytest.approx(min(slant), abs=0.05)
    assert found["closest_approach_time_s"] == pytest.approx(times[int(np.argmin(slant))], abs=0.11)


def test_the_closest_approach_is_not_where_the_level_distance_is_smallest():
    """A target that comes nearer on the level while it climbs away."""
    leaving = {
        "name": "leaving", "east_m": -300.0, "north_m": -200.0, "up_m": 30.0,
        "heading_deg": 100.0, "speed_mps": 30.0, "climb_mps": 90.0,
    }  # fmt: skip
    found = measured(encounter(leaving, duration_s=4), "closest_approach")
    times = np.arange(0.0, 4.05, 0.1)
    lines = np.array([crooked.ned(leaving, t) for t in times])
    slant, level = np.linalg.norm(lines, axis=1), np.hypot(lines[:, 0], lines[:, 1])
    assert abs(int(np.argmin(slant)) - int(np.argmin(level))) > 5
    assert found["closest_approach_m"] == pytest.approx(slant.min(), abs=0.05)
    assert found["closest_approach_time_s"] == pytest.approx(times[int(np.argmin(slant))])


@covers("tau_s", of=("[metric well_clear]",))
def test_well_clear_is_lost_by_modified_tau():
    """Against the definition at dense times by pymap3d; a target that turns away is not lost."""
    crossing = {
        "name": "crossing", "east_m": -2500.0, "north_m": -2300.0, "up_m": 60.0,
        "heading_deg": 60.0, "speed_mps": 55.0, "climb_mps": 3.0,
    }  # fmt: skip
    keys = {"metric": "well_clear", "horizontal_m": 400.0, "vertical_m": 110.0, "tau_s": 9.0}
    found = measured(encounter(crossing, duration_s=30), keys)
    times = np.arange(0.0, 30.0, 0.02)
    place = np.array([crooked.ned(crossing, t)[:2] for t in times])
    v = np.gradient(place, times, axis=0)
    q, p, a = (place**2).sum(1), (place * v).sum(1), (v**2).sum(1)
    cross = place[:, 0] * v[:, 1] - place[:, 1] * v[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        soon = (p < 0) & ((400.0**2 - q) / p <= 9.0) & (400.0**2 * a >= cross**2)
    expected = times[np.argmax((q <= 400.0**2) | soon)]
    assert 5.0 < expected < 28.0
    assert found["well_clear_loss_time_s"] == pytest.approx(expected, abs=0.1)
    later = measured(encounter(crossing, duration_s=30), {**keys, "tau_s": 0.0})
    assert later["well_clear_loss_time_s"] > expected + 2.0
