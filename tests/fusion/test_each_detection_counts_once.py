"""Behind any fusion a tracker uses each detection once, at its own instant: no more than is known.

What fusions put together of two instants a tracker behind `fusion.pass_through` gets one by one, so
its tracks are the oracle; and by hand.
"""

import numpy as np
import pytest
from wired import chain, run

from components.fusion.recent_detections import whole_rows_and_new_detections

SLOW = {"name": "slow", "north_m": 5000.0, "east_m": 700.0, "up_m": 150.0, "heading_deg": 190.0,
        "speed_mps": 60.0}  # fmt: skip
FAST = {"name": "fast", "north_m": 900.0, "east_m": 6000.0, "up_m": -200.0, "heading_deg": 265.0,
        "speed_mps": 110.0}  # fmt: skip
OWN = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0, "heading_deg": 37.0,
       "speed_mps": 70.0, "roll_deg": -27.0}  # fmt: skip
STATED = {"range_km": 20.0, "errors": "stated", "quantised": False}
RADAR = {**STATED, "type": "radar.range_boundary", "scan_rate_hz": 1, "azimuth_error_deg": 1.0,
         "elevation_error_deg": 1.0, "range_error_m": 30.0}  # fmt: skip
OTHER = {**RADAR, "scan_rate_hz": 5, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5}
EYE = {**STATED, "type": "optical.range_boundary", "scan_rate_hz": 10, "azimuth_error_deg": 0.2,
       "elevation_error_deg": 0.2}  # fmt: skip
ALONE = {"type": "fusion.pass_through"}
STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s",
         "covariance_00_m2", "covariance_11_m2", "covariance_35_m2_s2")  # fmt: skip


def tracks(sensors, fusion, **keys):
    """Return states and covariances as they were reported, by instant and track."""
    scene = chain(sensors, ownship=OWN, targets=[SLOW, FAST], duration_s=6, fusion=fusion,
                  tracker={"type": "tracking.ekf", **keys})  # fmt: skip
    found = run(scene)["state_tracks"].to_pylist()
    return {(row["time_s"], row["track"]): [row[name] for name in STATE] for row in found}


@pytest.mark.parametrize(
    "fusion",
    [
        {"type": "fusion.pick_best", "coincidence_s": 0.3},
        {"type": "fusion.gated", "time_gate_s": 0.3, "angle_gate_deg": 20.0},
    ],
)
def test_a_range_beside_many_directions_is_used_once_and_at_its_own_instant(fusion):
    """A camera's looks gather the radar's last detection over and over, up to 40 m of flight on."""
    sensors = {"radar": RADAR, "eye": {**EYE, "offset_s": 0.05}}
    assert tracks(sensors, fusion) == tracks(sensors, ALONE)


def test_what_was_measured_at_two_instants_and_came_at_one_is_used_as_of_two():
    sensors = {"radar": {**RADAR, "latency_s": 0.3}, "eye": {**EYE, "scan_rate_hz": 1}}
    sensors["eye"]["offset_s"] = 0.3
    best = {"type": "fusion.pick_best"}
    assert tracks(sensors, best, late="rerun") == tracks(sensors, ALONE, late="rerun")


def test_two_detections_of_one_instant_that_are_not_put_together_are_two_looks():
    """In one look one of them would be taken for another aircraft's."""
    narrow = {"type": "fusion.gated", "angle_gate_deg": 1e-9}
    sensors = {"radar": RADAR, "eye": EYE}
    assert tracks(sensors, narrow) == tracks(sensors, ALONE)


def test_the_best_of_two_radars_is_used_once():
    """The slow one is the best, by its name: of the other one's looks those count that are alone.

    Those 0.1, 0.3 and 0.5 s after the slow one's are left out for it, and it is not used again.
    """
    best = {"type": "fusion.pick_best", "coincidence_s": 0.5}
    mixed = tracks({"a": {**RADAR, "offset_s": 0.1}, "b": OTHER}, best)
    seen = sorted({time_s for time_s, _ in mixed})
    assert seen == pytest.approx(sorted([s + t for s in range(6) for t in (0.0, 0.1, 0.8)]))


def test_rows_as_they_are_and_detections_by_themselves_by_hand():
    """Detections 0 to 2 of a camera, 3 and 4 of a radar, 5 used before."""
    row = np.array([0, 0, 1, 1])
    angles = np.array([0, 1, 2, 5])
    ranges = np.array([3, 4, 3, 4])
    made = np.array([10, 10, 12, 10, 9, 8])
    used = np.array([False] * 5 + [True])
    whole, at, alone = whole_rows_and_new_detections(row, np.stack([angles, ranges]), made, used)
    assert whole.tolist() == [0]
    # The second is of two instants; the third's range was used before, and both of the last.
    assert list(zip(at.tolist(), alone.tolist(), strict=True)) == [(0, 1), (0, 4), (1, 2)]
