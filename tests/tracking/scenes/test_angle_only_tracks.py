"""A camera's track says that it has no range, and keeps its number when a radar measures one."""

import crooked
import numpy as np
import pymap3d
import pytest
from wired import chain, rows, run

import dsa_des
from components.messages.state_tracks import COVARIANCE
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Replica, replica_scene
from dsa_des.running.simulation import Simulation

ERRORS = {"range_km": 20.0, "errors": "stated", "quantised": False}
EYE = {**ERRORS, "type": "optical.range_boundary", "scan_rate_hz": 5,
       "azimuth_error_deg": 0.05, "elevation_error_deg": 0.05}  # fmt: skip
RADAR = {**ERRORS, "type": "radar.range_boundary", "scan_rate_hz": 1, "offset_s": 6,
         "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5, "range_error_m": 15.0}  # fmt: skip


@pytest.mark.parametrize("association", ["gnn", "jpda"])
@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
def test_the_first_range_makes_an_ordinary_track_of_it(kind, association):
    scene = chain(
        {"eye": EYE, "radar": RADAR}, duration_s=8, targets=[crooked.ROLLING],
        fusion={"type": "fusion.pass_through"}, tracker={"type": kind, "association": association},
    )  # fmt: skip
    told = rows(run(scene), "state_tracks")
    assert {row["track"] for row in told} == {1}
    for row in told:
        assert row["has_range"] == (row["time_s"] >= 6.0) == (row["north_m"] is not None)
    (row,) = (row for row in told if row["time_s"] == 7.8)
    origin = row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"]
    known = pymap3d.ecef2ned(*crooked.position(crooked.ROLLING, row["state_s"]), *origin)
    found = np.array([row["north_m"], row["east_m"], row["down_m"]])
    deviation = np.sqrt([row[f"covariance_{i}{i}_m2"] for i in range(3)])
    assert (np.abs(found - known) < 4.0 * deviation).all()
    assert deviation.max() < 20.0
    line = crooked.ned(crooked.ROLLING, 5.0)
    (row,) = (row for row in told if row["time_s"] == 5.0)
    wanted = np.arctan2(line[1], line[0]) % (2.0 * np.pi)
    assert row["azimuth_rad"] == pytest.approx(
        wanted, abs=4.0 * row["azimuth_variance_rad2"] ** 0.5
    )


@pytest.mark.parametrize("association", ["gnn", "jpda"])
def test_each_track_takes_the_range_that_was_measured_of_it(association):
    """Two at one look; how well it is known along the line of sight is what the radar says."""
    scene = chain(
        {"eye": EYE, "radar": RADAR}, duration_s=6.1, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf", "association": association},
    )  # fmt: skip
    told = [r for r in rows(run(scene), "state_tracks") if r["time_s"] == 6.0 and r["has_range"]]
    away = [np.array([r[f"{n}_m"] - r[f"own_{n}_m"] for n in ("north", "east", "down")])
            for r in told]  # fmt: skip
    known = sorted(np.linalg.norm(crooked.ned(target, 6.0)) for target in crooked.TARGETS)
    assert sorted(map(np.linalg.norm, away)) == pytest.approx(known, abs=60.0)
    for row, line in zip(told, away, strict=True):
        spread = np.empty((3, 3))
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            spread[i, j] = spread[j, i] = row[f"covariance_{i}{j}_m2"]
        line = line / np.linalg.norm(line)
        assert 12.0 < np.sqrt(line @ spread @ line) < 15.5


def test_a_direction_corrects_a_track_with_a_range_as_a_plain_filter_does():
    """By an extended Kalman filter written out here, whose derivatives are differences."""
    errors = {"azimuth_error_deg": 0.3, "elevation_error_deg": 0.2}
    scene = chain(
        {"radar": {**RADAR, "scan_rate_hz": 0.1, "offset_s": 0},
         "eye": {**EYE, **errors, "scan_rate_hz": 0.1, "offset_s": 1.5}},
        targets=[crooked.ROLLING], duration_s=2, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf", "acceleration_intensity_m2_s3": 2.0},
    )  # fmt: skip
    found = run(scene)
    (seen,) = rows(found, block="eye")
    first, second = rows(found, "state_tracks")
    (state, spread), (told, told_spread) = map(estimate, (first, second))
    step_s, one = 1.5, np.eye(3)
    on = np.block([[one, step_s * one], [0.0 * one, one]])
    shaken = np.array([[step_s**3 / 3.0, step_s**2 / 2.0], [step_s**2 / 2.0, step_s]])
    state, spread = on @ state, on @ spread @ on.T + np.kron(2.0 * shaken, one)
    frame = [first[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]

    def direction(position):
        at = pymap3d.ned2ecef(*position, *frame)
        own = crooked.position(crooked.OWNSHIP, step_s)
        here = crooked.geodetic(own)
        return np.array(crooked.angles(
            crooked.attitude(crooked.OWNSHIP) @ np.array(pymap3d.ecef2ned(*at, *here))
        ))  # fmt: skip

    slope = np.zeros((2, 6))
    for i in range(3):
        off = 0.5 * np.eye(3)[i]
        slope[:, i] = direction(state[:3] + off) - direction(state[:3] - off)
    noise = np.diag([seen["azimuth_variance_rad2"], seen["elevation_variance_rad2"]])
    gain = spread @ slope.T @ np.linalg.inv(slope @ spread @ slope.T + noise)
    measured = np.array([seen["azimuth_rad"], seen["elevation_rad"]])
    change = gain @ (measured - direction(state[:3]))
    assert np.linalg.norm(change[:3]) > 5.0
    assert told - state == pytest.approx(change, abs=1e-3 * np.linalg.norm(change))
    wanted = spread - gain @ slope @ spread
    assert told_spread == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())


def estimate(row):
    """A recorded state and its covariance."""
    names = [f"{axis}_{unit}" for unit in ("m", "m_s") for axis in ("north", "east", "down")]
    spread = np.empty((6, 6))
    for (i, j), name in COVARIANCE.items():
        spread[i, j] = spread[j, i] = row[name]
    return np.array([row[name] for name in names]), spread


def test_directions_are_from_the_ownship_of_their_own_replica():
    """Two that fly at other speeds, tracked together: each as in a run of its own."""
    scene = dsa_des.load_scene(chain(
        {"eye": EYE}, duration_s=3, targets=[crooked.ROLLING],
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"},
    ))  # fmt: skip
    speeds = ({}, {"blocks.traffic.ownship.speed_mps": 190.0})
    scenes = [replica_scene(scene, Replica(3 + i, change)) for i, change in enumerate(speeds)]
    tables = []
    for kind, given in (
        (make_lockstep_simulation, scenes),
        (Simulation, scenes[0]),
        (Simulation, scenes[1]),
    ):
        sink = MemorySink()
        kind(given, recorder=Recorder([sink])).run()
        tables.append(sink.tables()["state_tracks"])
    for number, alone in enumerate(tables[1:]):
        assert alone.num_rows > 10
        mine = tables[0].filter(np.equal(tables[0]["replica"].to_numpy(), number))
        assert mine.drop_columns(["replica"]).combine_chunks().equals(alone.combine_chunks())


def test_what_is_straight_below_has_a_direction_though_its_azimuth_moves_nothing():
    """Taken for known, it left a covariance without a root, and nothing could be tracked."""
    level = {"lat_deg": 47, "lon_deg": 8, "alt_m": 1000, "heading_deg": 40, "speed_mps": 50}
    scene = chain(
        {"eye": {**EYE, "elevation_deg": [-90, 90], "quantised": True}}, ownship=level,
        targets=[{"name": "below", **level, "alt_m": 400}], duration_s=2,
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ukf"},
    )  # fmt: skip
    told = [row for row in rows(run(scene), "state_tracks") if row["track"] == 1]
    assert len(told) == 10 and np.isfinite([row["azimuth_variance_rad2"] for row in told]).all()
    assert np.pi / 2 + told[0]["elevation_rad"] < np.radians(0.2)
