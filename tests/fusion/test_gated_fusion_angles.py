"""Gates of the gated fusion are angles between directions, ages and ranges."""

import math

import crooked
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, noise_crosses, rows, run

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


def test_the_nearest_in_the_gate_belongs_together():
    """Two targets 3 deg apart in a gate of 9 deg, and a radar that is off by 1 deg."""
    bearing = {"near": 217.0, "far": 220.0}
    targets = [
        {
            "name": name,
            "east_m": range_m * math.sin(math.radians(bearing[name])),
            "north_m": range_m * math.cos(math.radians(bearing[name])),
            "up_m": 200.0,
        }
        for name, range_m in (("near", 1500.0), ("far", 1700.0))
    ]
    radar = {**HEARS_ALL, "misalignment_deg": [1.0, 0, 0]}
    fusion = {"type": "fusion.gated", "angle_gate_deg": 9.0}
    scene = chain({"radar": radar, "eye": SEES_ALL}, ownship=LEVEL, targets=targets, fusion=fusion)
    found = rows(run(scene), "fused")
    assert {row["sensors"] for row in found} == {"radar+eye"}
    for row in found:
        assert row["range_m"] == pytest.approx(row["true_range_m"], abs=1e-6)


def test_the_latest_in_the_gate_belongs_together():
    """A radar at 8 Hz and a camera at 0.6 s: of the looks in the gate that at 0.5 s counts."""
    eye = {**SEES_ALL, "offset_s": 0.6}
    radar = {**HEARS_ALL, "scan_rate_hz": 8}
    fusion = {"type": "fusion.gated", "angle_gate_deg": 9.0, "time_gate_s": 0.4}
    scene = chain({"radar": radar, "eye": eye}, targets=[crooked.ROLLING], fusion=fusion)
    found = run(scene)
    (seen,) = (row for row in rows(found, block="radar") if row["time_s"] == 0.5)
    (row,) = (row for row in rows(found, "fused") if row["time_s"] == 0.6)
    assert row["sensors"] == "radar+eye"
    assert row["range_m"] == seen["range_m"]


@pytest.mark.parametrize("kind", ["fusion.gated", "fusion.pick_best"])
def test_false_alarms_pass_through_as_they_were_reported(kind):
    """Each with its own sensor's name, a range from the radar only; no track is made of them."""
    radar = {
        **HEARS_ALL, **noise_crosses("radar.threshold", 3e-4), "range_km": 3.0,
        "azimuth_resolution_deg": 9.0, "elevation_resolution_deg": 9.0,
        "range_resolution_m": 300.0, "scan_rate_hz": 10,
    }  # fmt: skip
    eye = {**SEES_ALL, "false_alarms_per_frame": 0.5, "scan_rate_hz": 15}
    scene = chain(
        {"radar": radar, "eye": eye}, targets=[crooked.ROLLING],
        fusion={"type": kind} | ({"angle_gate_deg": 1e-3} if kind == "fusion.gated" else {}),
        tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found = run(scene)
    columns = ("azimuth_rad", "elevation_rad", "range_m")
    alone = {"radar": [], "eye": []}
    for row in rows(found, "fused", target=None):
        alone[row["sensors"]].append((row["time_s"], *(row[column] for column in columns)))
        assert row["angle_source"] == row["sensors"]
        assert row["range_source"] == ("radar" if row["sensors"] == "radar" else None)
        assert row["true_range_m"] is None
    for name, reported in alone.items():
        expected = [
            (row["time_s"], *(row[column] for column in columns))
            for row in rows(found, block=name, target=None)
        ]
        assert len(expected) > 3
        assert sorted(reported, key=str) == sorted(expected, key=str)
    assert {row["target"] for row in rows(found, "tracks")} == {"rolling"}
