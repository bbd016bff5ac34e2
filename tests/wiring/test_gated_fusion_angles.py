"""Gates of the gated fusion are angles between directions, ages and ranges."""

import math

import crooked
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, rows, run

LEVEL = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400, "heading_deg": 217}


def high(elevation_deg: float) -> dict:
    """A hovering target ahead of a hovering ownship at an elevation."""
    up, level = math.sin(math.radians(elevation_deg)), math.cos(math.radians(elevation_deg))
    heading = math.radians(217.0)
    east, north = math.sin(heading), math.cos(heading)
    return {
        "name": "high", "east_m": 1500 * level * east, "north_m": 1500 * level * north,
        "up_m": 1500 * up,
    }  # fmt: skip


def fused(target: dict, *, gate_deg: float, off_deg: float) -> list[str]:
    """Fused sensors where the radar's azimuth is off."""
    radar = {**HEARS_ALL, "misalignment_deg": [off_deg, 0, 0]}
    fusion = {"type": "fusion.gated", "angle_gate_deg": gate_deg}
    scene = chain({"radar": radar, "eye": SEES_ALL}, ownship=LEVEL, targets=[target], fusion=fusion)
    return sorted(row["sensors"] for row in rows(run(scene), "fused"))


@pytest.mark.parametrize("elevation_deg", [-60, 60])
@pytest.mark.parametrize(("gate_deg", "together"), [(2.05, True), (1.95, False)])
def test_high_up_an_azimuth_counts_with_the_cosine_of_the_elevation(
    elevation_deg, gate_deg, together
):
    """At 60 deg of elevation 4 deg of azimuth are 2 deg of direction."""
    names = fused(high(elevation_deg), gate_deg=gate_deg, off_deg=4.0)
    assert names == (["radar+eye"] if together else ["eye", "radar"])


@pytest.mark.parametrize(("gate_deg", "together"), [(4.05, True), (3.9, False)])
def test_on_the_level_an_azimuth_counts_whole(gate_deg, together):
    names = fused(high(0.0), gate_deg=gate_deg, off_deg=4.0)
    assert names == (["radar+eye"] if together else ["eye", "radar"])


@pytest.mark.parametrize("gate_deg", [2.9, 3.1])
def test_an_elevation_counts_whole_however_high(gate_deg):
    radar = {**HEARS_ALL, "misalignment_deg": [0, 3.0, 0]}
    fusion = {"type": "fusion.gated", "angle_gate_deg": gate_deg}
    sensors = {"radar": radar, "eye": SEES_ALL}
    scene = chain(sensors, ownship=LEVEL, targets=[high(60.0)], fusion=fusion)
    names = sorted(row["sensors"] for row in rows(run(scene), "fused"))
    assert names == (["radar+eye"] if gate_deg > 3 else ["eye", "radar"])


@pytest.mark.parametrize(("gate_m", "together"), [(60.0, True), (40.0, False)])
def test_ranges_count_where_both_sensors_have_them(gate_m, together):
    """A radar with a grid of 100 m reports 1550 m as 1500 or 1600 m, another as it is."""
    target = high(10.0)
    target = {**target, **{k: target[k] * 1549.0 / 1500.0 for k in ("east_m", "north_m", "up_m")}}
    coarse = {**HEARS_ALL, "range_resolution_m": 100.0}
    fusion = {"type": "fusion.gated", "angle_gate_deg": 1.0, "range_gate_m": gate_m}
    sensors = {"coarse": coarse, "fine": HEARS_ALL}
    scene = chain(sensors, ownship=LEVEL, targets=[target], fusion=fusion)
    names = sorted(row["sensors"] for row in rows(run(scene), "fused"))
    assert names == (["coarse+fine"] if together else ["coarse", "fine"])


@pytest.mark.parametrize(("gate_s", "together"), [("0.25", True), ("0.24", False)])
def test_a_detection_of_another_sensor_may_be_as_old_as_the_time_gate(gate_s, together):
    eye = {**SEES_ALL, "offset_s": 0.25}
    fusion = {"type": "fusion.gated", "time_gate_s": float(gate_s), "angle_gate_deg": 5.0}
    sensors = {"radar": HEARS_ALL, "eye": eye}
    scene = chain(sensors, targets=[crooked.ROLLING], fusion=fusion)
    found = {row["time_s"]: row["sensors"] for row in rows(run(scene), "fused")}
    assert found == {0.0: "radar", 0.25: "radar+eye" if together else "eye"}
