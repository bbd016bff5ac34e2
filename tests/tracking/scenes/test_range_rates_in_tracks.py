"""Range rates in tracks: what one look tells of a velocity, and which rates are left out."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, chain, rows, run

import dsa_des
from dsa_des.running.simulation import Simulation

TRACKERS = ("tracking.ekf", "tracking.ukf", "tracking.imm")
RADAR = {
    **HEARS_ALL, "azimuth_resolution_deg": 0.05, "elevation_resolution_deg": 0.05,
    "range_resolution_m": 2.0, "measures_range_rate": True, "range_rate_resolution_m_s": 0.5,
}  # fmt: skip


def scene(kind="tracking.ekf", *, radar=RADAR, duration_s=1, **keys):
    return chain(
        {"radar": radar}, targets=[crooked.ROLLING], duration_s=duration_s,
        fusion={"type": "fusion.pass_through"}, tracker={"type": kind, **keys},
    )  # fmt: skip


def velocity(flight):
    heading, speed = math.radians(flight["heading_deg"]), flight["speed_mps"]
    return np.array([speed * math.cos(heading), speed * math.sin(heading), -flight["climb_mps"]])


@covers("use_range_rate", of=TRACKERS)
@pytest.mark.parametrize("kind", TRACKERS)
def test_one_look_tells_the_velocity_along_the_line_of_sight(kind):
    """The frame is the ownship's own horizon at the first look, and all it knows is u · v."""
    (row,) = rows(run(scene(kind, start_speed_m_s=50.0)), "state_tracks")
    line = crooked.ned(crooked.ROLLING)
    line /= np.linalg.norm(line)
    found = np.array([row["north_m_s"], row["east_m_s"], row["down_m_s"]])
    wanted = line @ velocity(crooked.ROLLING)
    assert line @ found == pytest.approx(wanted, abs=0.6)
    np.testing.assert_allclose(found, (line @ found) * line, atol=1.0)
    assert row["covariance_33_m2_s2"] == pytest.approx(50.0**2 * (1.0 - line[0] ** 2), rel=0.01)
    (blind,) = rows(run(scene(kind, use_range_rate=False)), "state_tracks")
    assert blind["north_m_s"] == 0.0


def test_detections_tell_how_the_ownship_moves_where_a_range_rate_is_measured():
    names = ("own_velocity_north_m_s", "own_velocity_east_m_s", "own_velocity_down_m_s")
    found = rows(run(chain({"radar": RADAR, "other": HEARS_ALL})))
    told = [[row[name] for name in names] for row in found if row["block"] == "radar"]
    np.testing.assert_allclose(told, [velocity(crooked.OWNSHIP)] * 2, atol=1e-4)
    assert {row[name] for row in found for name in names if row["block"] == "other"} == {None}


@pytest.mark.parametrize("kind", TRACKERS)
def test_who_is_where_the_track_should_be_but_flies_the_other_way_is_not_in_its_gate(kind):
    """One flies away at 60 m/s and is gone after a look; one comes from where it would be."""
    away = {"name": "away", "east_m": -1500.0, "north_m": -2000.0, "up_m": 100.0,
            "heading_deg": 216.87, "speed_mps": 60.0, "end_time_s": 0.5}  # fmt: skip
    back = {**away, "name": "back", "east_m": -1500.0 - 1.3 * 36.0, "north_m": -2000.0 - 1.3 * 48.0,
            "heading_deg": 36.87, "start_time_s": 0.7, "end_time_s": 5.0}  # fmt: skip
    started = []
    for used in (True, False):
        found = chain(
            {"radar": RADAR}, targets=[away, back], duration_s=2,
            fusion={"type": "fusion.pass_through"}, tracker={"type": kind, "use_range_rate": used},
        )  # fmt: skip
        started.append({row["track"] for row in rows(run(found), "state_tracks")})
    assert started == [{1, 2}, {1}]


@pytest.mark.parametrize(
    ("keys", "tracker", "why"),
    [
        ({"range_rate_resolution_m_s": 0.0}, {}, "they are exact"),
        ({"range_rate_folds": True, "prf_hz": 20_000.0}, {}, "they fold"),
        ({}, {"use_range_rate": False}, "use_range_rate is false"),
    ],
)
def test_rates_that_cannot_be_weighed_are_left_out_and_explained(keys, tracker, why):
    given = scene(radar={**RADAR, **keys}, **tracker)
    block = Simulation(dsa_des.load_scene(given)).components["tracker"]
    assert [
        said.startswith(f"range rates of radar: {why}") for said in block.skipped_work_notes()
    ] == [True]
    (row,) = rows(run(given), "state_tracks")
    assert row["north_m_s"] == row["east_m_s"] == row["down_m_s"] == 0.0
    assert Simulation(dsa_des.load_scene(scene())).components["tracker"].skipped_work_notes() == []


def test_only_rates_of_who_may_tell_them_are_used():
    """Another radar's rates may be used, that looks later; those of this one fold."""
    given = scene()
    folds = {**RADAR, "range_rate_folds": True, "prf_hz": 20_000.0}
    given["blocks"] |= {"folds": folds, "radar": {**RADAR, "offset_s": 0.5}}
    given["wires"] += ["gate -> folds -> fusion"]
    first, second = rows(run(given), "state_tracks")
    assert first["north_m_s"] == first["east_m_s"] == first["down_m_s"] == 0.0
    assert second["north_m_s"] != 0.0
