"""What a run says of each platform: its blocks, whom it comes near, and which tracks are true."""

import numpy as np
import pymap3d
import pytest
from equipped import AVOIDANCE, scene_of

import dsa_des
from components.display.flights import Flights
from components.display.map_view import outline_of
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
B = {"name": "b", "east_m": 6200, "north_m": 6000, "up_m": 0, "heading_deg": 270, "speed_mps": 50}
C = {"name": "c", "east_m": -1500, "north_m": 5500, "up_m": 60, "heading_deg": 60, "speed_mps": 40}
SITE = {"name": "hill", "east_m": 900, "north_m": 2000, "alt_m": 50}
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 9,
         "azimuth_beamwidth_deg": 2, "elevation_beamwidth_deg": 2, "range_cell_m": 50,
         "azimuth_resolution_deg": 0.2, "elevation_resolution_deg": 0.2,
         "range_resolution_m": 20}  # fmt: skip
EKF = {"type": "tracking.ekf", "acceleration_intensity_m2_s3": 4}


@pytest.fixture(scope="module")
def run():
    tables = scene_of(
        OWN, [B, C], {"": None, "_b": "b"}, duration_s=150, radar=RADAR, tracker=EKF,
        decider=AVOIDANCE,
    ).resolved()  # fmt: skip
    tables["blocks"]["traffic"]["sites"] = [SITE]
    return dsa_des.run(dsa_des.load_scene(tables))


def test_each_platform_has_its_blocks_and_comes_near_as_the_truth_says(run):
    said = run.summary["platforms"]
    assert set(said) == {"ownship", "b"} and "targets" not in said["ownship"]
    assert said["b"]["blocks"] == [f"{name}_b" for name in (
        "alerting", "decider", "fusion", "gate", "radar", "tracker", "transform")]  # fmt: skip
    paths: dict[str, list] = {}
    for row in run.truth.to_pylist():
        place = pymap3d.geodetic2ecef(row["lat_deg"], row["lon_deg"], row["alt_m"])
        paths.setdefault(row["target"] or "ownship", []).append(np.array(place))
    for name, entry in said["b"]["targets"].items():
        apart = np.linalg.norm(np.array(paths[name]) - np.array(paths["b"]), axis=1)
        assert entry["closest_approach"]["range_m"] == pytest.approx(apart.min(), abs=5.0)
    assert set(said["b"]["targets"]) == {"ownship", "c"}


def test_tracks_are_held_against_what_their_platform_sees_as_it_flew(run):
    """Both turn, so that flights as planned are kilometres beside those that are tracked."""
    assert all(entry["count"] for entry in run.summary["manoeuvres"].values())
    for tracker, others in (("tracker", {"b", "c"}), ("tracker_b", {"ownship", "c"})):
        found = run.summary["tracks"][tracker]
        assert found["false"] == 0 and set(found["targets"]) == others
        assert found["position_error_m"] < 100.0


def test_the_terminal_has_a_block_for_each(run, capsys):
    from rich.console import Console

    from components.display.terminal import print_run_summary

    print_run_summary(Console(width=120), run.summary)
    own, theirs = capsys.readouterr().out.split("On board of b")
    assert "On board of ownship" in own
    for text, name, other in ((own, "tracker", "b"), (theirs, "tracker_b", "ownship")):
        assert f"{name}: " in text and f" {other} " in text
    assert "_b" not in own and "tracker:" not in theirs


def test_a_field_of_view_is_drawn_where_its_platform_starts():
    """One that looks 10° to both sides along its course to the west, 8 km, from 6.2 km east."""
    simulation = Simulation(dsa_des.load_scene("one_is_blind"))
    simulation.run()
    flights = Flights.from_simulation(simulation, {})
    yaw_rad, start_km = flights.start_yaw_and_position("other")
    assert np.degrees(yaw_rad) % 360.0 == pytest.approx(270.0, abs=0.1)
    assert start_km == pytest.approx((6.2, 6.0), abs=0.01)
    assert flights.start_yaw_and_position("ownship") == (pytest.approx(0.0), (0.0, 0.0))
    radar = simulation.components["radar_b"]
    corners = outline_of(yaw_rad, radar.stated_reach, radar.axes, start_km).corners_km
    angle = np.radians([260.0, 280.0])
    tips = [(6.2 + 8.0 * np.sin(one), 6.0 + 8.0 * np.cos(one)) for one in angle]
    assert corners[[0, -2]] == pytest.approx(np.array(tips), abs=0.02)
    assert corners[-1] == pytest.approx(start_km)
