"""A place on the ground as a platform: what it sees, from where, and who sees it."""

import numpy as np
import pymap3d
import pytest
from covering import covers
from equipped import SURE_RADAR, blocks_of, wires_of
from same_runs import same_as_alone, same_in_any_window, tables_of

import dsa_des
from dsa_des import SceneError
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 30, "speed_mps": 50}
B = {"name": "b", "east_m": 3000, "north_m": 3000, "up_m": 20, "heading_deg": 270, "speed_mps": 50}
SITE = {"name": "mast", "lat_deg": 52.02, "lon_deg": 4.43, "alt_m": 60.0}
KIND = ("traffic.scripted.sites",)
RADAR = SURE_RADAR | {"range_cell_m": 1e-3, "range_km": 100, "azimuth_beamwidth_deg": 0.01,
                      "elevation_beamwidth_deg": 0.01}  # fmt: skip


def watched(site, *, own=OWN, intruders=(B,), radar=RADAR, on_board=True, **more):
    """Return a scene with a radar and a tracker on a site, and on the ownship."""
    chains = {"_s": site["name"], **({"": None} if on_board else {})}
    wires, blocks = [], {}
    for suffix, platform in chains.items():
        mine = blocks_of(suffix, platform, radar)
        blocks |= {name: of for name, of in mine.items() if name[:5] not in ("alert", "decid")}
        wires.append(wires_of(suffix)[0].partition(" -> alerting")[0])
    traffic = {"type": "traffic.scripted", "ownship": own, "intruders": list(intruders),
               "sites": [site]}  # fmt: skip
    tables = {"title": "t", "duration_s": 20, "seed": 1, "wires": wires, **more}
    return dsa_des.load_scene(tables | {"blocks": {"traffic": traffic, **blocks}})


def flown(scene):
    """Return the truth by name and time, and the detections of each radar."""
    tables = tables_of(scene)[1]
    truth = {
        (row["target"] or "ownship", row["time_s"]): row for row in tables["truth"].to_pylist()
    }
    seen = {"radar": [], "radar_s": []}
    for row in tables["detections"].to_pylist():
        seen[row["block"]].append(row)
    return truth, seen


def line_of_sight(truth, one, other, time_s):
    here, there = (
        [truth[name, time_s][key] for key in ("lat_deg", "lon_deg", "alt_m")]
        for name in (one, other)
    )
    return pymap3d.geodetic2aer(*there, *here)


@covers("name", "lat_deg", "lon_deg", "alt_m", "yaw_deg", of=KIND)
def test_a_site_measures_what_the_truth_says_and_nobody_sees_it():
    scene = watched(SITE | {"yaw_deg": 40.0})
    truth, seen = flown(scene)
    assert {row["target"] for row in seen["radar_s"]} == {"ownship", "b"}
    assert {row["target"] for row in seen["radar"]} == {"b"}
    for row in seen["radar_s"]:
        azimuth, elevation, range_m = line_of_sight(truth, "mast", row["target"], row["time_s"])
        assert row["range_m"] == pytest.approx(range_m, abs=2e-3)
        turned = (azimuth - 40.0 + 180.0) % 360.0 - 180.0
        assert np.degrees(row["azimuth_rad"]) == pytest.approx(turned, abs=0.011)
        assert np.degrees(row["elevation_rad"]) == pytest.approx(elevation, abs=0.011)
    places = {tuple(row[k] for k in ("lat_deg", "lon_deg", "alt_m"))
              for (name, _), row in truth.items() if name == "mast"}  # fmt: skip
    assert places == {(52.02, 4.43, 60.0)}
    simulation, _ = tables_of(scene)
    assert set(simulation.components["traffic"].report()["targets"]) == {"b"}


@covers("pitch_deg", "roll_deg", of=KIND)
def test_its_axis_points_where_it_is_turned():
    """By rotation matrices: yaw, then pitch, then roll."""
    truth, seen = flown(watched(SITE | {"yaw_deg": 10, "pitch_deg": 20, "roll_deg": 30}))
    y, p, r = np.radians([10, 20, 30])
    about = [
        np.array([[np.cos(y), np.sin(y), 0], [-np.sin(y), np.cos(y), 0], [0, 0, 1]]),
        np.array([[np.cos(p), 0, -np.sin(p)], [0, 1, 0], [np.sin(p), 0, np.cos(p)]]),
        np.array([[1, 0, 0], [0, np.cos(r), np.sin(r)], [0, -np.sin(r), np.cos(r)]]),
    ]
    assert seen["radar_s"]
    for row in seen["radar_s"]:
        aer = line_of_sight(truth, "mast", row["target"], row["time_s"])
        azimuth, elevation = np.radians(aer[:2])
        ned = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
               -np.sin(elevation)]  # fmt: skip
        x, y_, z = about[2] @ about[1] @ about[0] @ ned
        assert row["azimuth_rad"] == pytest.approx(np.arctan2(y_, x), abs=2e-4)
        assert row["elevation_rad"] == pytest.approx(np.arcsin(-z), abs=2e-4)


@covers("east_m", "north_m", "above_ground_m", of=KIND)
def test_a_place_by_offsets_above_the_ground():
    site = {"name": "mast", "east_m": 500.0, "north_m": -800.0, "above_ground_m": 12.0}
    truth, _ = flown(watched(site, terrain={"height_m": 88.0}))
    row = truth["mast", 0.0]
    assert row["alt_m"] == pytest.approx(100.0)
    east, north, _ = pymap3d.geodetic2enu(row["lat_deg"], row["lon_deg"], 1000.0, 52.0, 4.4, 1000.0)
    assert (east, north) == pytest.approx((500.0, -800.0), abs=0.01)


def test_the_horizon_hides_from_it_too():
    """Two heights above a sphere see each other over sqrt(2 R h) of both."""
    low = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 60.0, "heading_deg": 90, "speed_mps": 340}
    site = {"name": "mast", "lat_deg": 52.0, "lon_deg": 5.1, "alt_m": 20.0}
    scene = watched(site, own=low, intruders=(), on_board=False, terrain={"horizon": True},
                    duration_s=60)  # fmt: skip
    _, seen = flown(scene)
    first_m = max(row["range_m"] for row in seen["radar_s"])
    radius_m = 6.389e6  # east of 52 N: of the prime vertical
    assert first_m == pytest.approx(
        np.sqrt(2 * radius_m * 20) + np.sqrt(2 * radius_m * 60), abs=400
    )


@pytest.mark.parametrize("radar", [RADAR, {**RADAR, "beam_sweep": True}], ids=["", "sweeping"])
def test_the_same_bytes_in_any_window_and_beside_other_runs(radar):
    scene = watched(SITE, radar=radar)
    same_in_any_window(scene)
    changes = ({}, {"blocks.traffic.intruders[0].east_m": 2500.0})
    same_as_alone(
        [replica_scene(scene, Replica(5 + k, change)) for k, change in enumerate(changes)]
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"lat_deg": None}, "site 'mast': its place must be given as lat_deg and lon_deg, or as"),
        ({"alt_m": None}, "site 'mast': its height must be given as alt_m, or as above_ground_m"),
        ({"alt_m": None, "above_ground_m": 9.0}, "[terrain] knows no ground at 52.02, 4.43"),
        ({"name": "b"}, "the name 'b' is used more than once"),
    ],
)
def test_what_is_wrong_with_a_site_is_said(wrong, said):
    site = {key: value for key, value in (SITE | wrong).items() if value is not None}
    with pytest.raises(SceneError) as refused:
        Simulation(watched(site))
    assert said in str(refused.value)
