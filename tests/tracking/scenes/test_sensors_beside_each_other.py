"""Two sensors, one of which sees less, fused: what is expected of it, and whose density counts."""

import math

import crooked
import pytest
from test_tracker_keys import AWAY, RADAR
from wired import chain, rows, run

GATED = {"type": "fusion.gated", "time_gate_s": 0.1, "angle_gate_deg": 3.0, "range_gate_m": 300.0}
#: Stays where all see it, so that every look has something to tell.
BESIDE = {**AWAY, "name": "beside", "east_m": 500.0, "north_m": -400.0, "speed_mps": 70.0}


@pytest.mark.parametrize("last", [6, 7])
def test_five_looks_in_vain_and_what_a_sensor_does_not_see_is_expected_of_it_no_more(last):
    """One radar sees it each second; the other looks twice as often and loses it after a look.

    Its looks count in vain also where the other one hits in the same row.
    """
    often = {**RADAR, "scan_rate_hz": 2}
    seen = run(chain({"near": often}, targets=[AWAY, BESIDE], duration_s=5))
    levels = [row["snr_db"] for row in rows(seen, target="away")]
    near = {**often, "threshold_db": 0.5 * (levels[last] + levels[last + 1])}
    tracker = {"type": "tracking.ekf", "delete_misses": 9}
    found = run(
        chain({"far": RADAR, "near": near}, targets=[AWAY, BESIDE], duration_s=10, fusion=GATED,
              tracker=tracker)
    )  # fmt: skip
    hits = [row["scan"] for row in rows(found, block="near", target="away")]
    assert hits == list(range(last + 1)), "it is seen up to one look, and then not"
    told = rows(found, "state_tracks")
    both = {row["track"] for row in told}
    held = [(row["track"], row["time_s"]) for row in told if row["track_status"] == "coasted"]
    coasted = [[time_s for track, time_s in held if track == number] for number in both]
    # The five looks after its last hit, of which those at whole seconds hit by the other.
    in_vain = [0.5 * k for k in range(last + 1, last + 6) if k % 2]
    assert sorted(coasted) == [[], in_vain]


def test_the_density_of_false_alarms_is_that_of_the_first_sensor_of_a_row():
    """Twice as wide a field has half the density of as many alarms, and twice the gain in odds."""

    def odds(first_deg, second_deg):
        radar = {"type": "radar.range_boundary", "range_km": 20.0, "errors": "stated",
                 "quantised": False, "azimuth_error_deg": 0.3, "elevation_error_deg": 0.4,
                 "range_error_m": 15.0, "scan_rate_hz": 1}  # fmt: skip
        sensors = {name: {**radar, "azimuth_deg": [-half_deg, half_deg]}
                   for name, half_deg in (("a", first_deg), ("b", second_deg))}  # fmt: skip
        scene = chain(sensors, targets=[crooked.ROLLING], duration_s=2, fusion=GATED,
                      tracker={"type": "tracking.ekf", "start_existence": 1e-9,
                               "false_alarms_per_scan": 1e4})  # fmt: skip
        last = rows(run(scene), "state_tracks")[-1]
        assert last["contributors"] == "a+b"
        return math.log(last["existence"] / (1.0 - last["existence"]))

    assert odds(180.0, 90.0) - odds(90.0, 180.0) == pytest.approx(math.log(2.0), abs=1e-6)


def test_a_track_starts_no_nearer_than_its_range_is_known():
    """A target 4 m away, whose range errs by 50 m: nearer than that nothing has a direction."""
    close = {**AWAY, "east_m": 3.0, "north_m": 2.0, "up_m": 1.0, "speed_mps": 70.0}
    radar = {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 20.0,
             "errors": "stated", "quantised": False, "azimuth_error_deg": 0.3,
             "elevation_error_deg": 0.3, "range_error_m": 50.0}  # fmt: skip
    measured = []
    for seed in range(1, 5):
        found = run(chain({"radar": radar}, targets=[close], fusion={"type": "fusion.pass_through"},
                          tracker={"type": "tracking.ekf"}, seed=seed))  # fmt: skip
        (seen,), (track,) = rows(found), rows(found, "state_tracks")
        away_m = math.hypot(*(track[f"{axis}_m"] for axis in ("north", "east", "down")))
        assert away_m == pytest.approx(max(seen["range_m"], 50.0), abs=0.01)
        measured.append(seen["range_m"])
    assert min(measured) < 50.0 < max(measured)
