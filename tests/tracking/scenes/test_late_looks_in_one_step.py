"""A look that comes late, of an instant at which another sensor looked in time."""

import crooked
import pytest
from wired import chain, rows, run

ERRORS = {"range_km": 20.0, "errors": "stated", "quantised": False, "scan_rate_hz": 2}
RADAR = {**ERRORS, "type": "radar.range_boundary", "azimuth_error_deg": 0.5,
         "elevation_error_deg": 0.4, "range_error_m": 15.0}  # fmt: skip
#: What it saw at 4.5 s comes at 5.2 s, after the radar's look of 5 s.
EYE = {**ERRORS, "type": "optical.range_boundary", "azimuth_error_deg": 0.05,
       "elevation_error_deg": 0.07, "latency_s": "0.7"}  # fmt: skip
TURNING = {
    key: value for key, value in crooked.ROLLING.items()
    if key not in ("yaw_deg", "pitch_deg", "roll_deg", "climb_mps")
}  # fmt: skip
TURNING["legs"] = [{"kind": "straight", "duration_s": 3}, {"kind": "turn", "rate_deg_s": 12}]
#: Two models that hardly err by themselves: which one it is shows at once. Of those by default the
#: third, which accelerates, is as likely as the turn.
STEADY = {
    "type": "tracking.imm", "models": ["velocity", "turn"],
    "transition_rates_per_s": [[0.0, 1 / 60], [0.01, 0.0]],
    "acceleration_intensity_m2_s3": 0.1, "turn_acceleration_intensity_m2_s3": 0.1,
}  # fmt: skip


def last_rows(tracker):
    """The last row up to some times, of each way to treat what is late."""
    found = {}
    for late in ("drop", "one_step", "rerun"):
        scene = chain(
            {"radar": RADAR, "eye": EYE}, targets=[TURNING], duration_s=5.3,
            fusion={"type": "fusion.pass_through"}, tracker={**tracker, "late": late},
        )  # fmt: skip
        states = rows(run(scene), "state_tracks")
        for time_s in (5.0, 5.2):
            found[late, time_s] = [row for row in states if row["time_s"] <= time_s][-1]
    return found


@pytest.fixture(scope="module")
def told():
    """Those of two steady models."""
    return last_rows(STEADY)


def test_a_late_look_counts_beside_one_of_its_own_instant(told):
    """Across the line of sight the camera knows ten times as well as the radar."""
    exact, near, without = (told[late, 5.2] for late in ("rerun", "one_step", "drop"))
    assert near["contributors"] == exact["contributors"] == "radar+eye"
    for name in ("covariance_00_m2", "covariance_22_m2"):
        assert near[name] == pytest.approx(exact[name], rel=0.05)
        assert without[name] > 9.0 * exact[name]


def test_so_it_does_with_the_models_that_imm_has_by_default():
    found = last_rows({"type": "tracking.imm"})
    exact, near, without = (found[late, 5.2] for late in ("rerun", "one_step", "drop"))
    for name in ("covariance_00_m2", "covariance_22_m2"):
        assert near[name] == pytest.approx(exact[name], rel=0.1)
        assert without[name] > 7.0 * exact[name]
    for model in ("velocity", "turn", "acceleration"):
        name = f"probability_{model}"
        assert near[name] == pytest.approx(exact[name], abs=0.1)


def test_a_late_look_says_which_model_it_is(told):
    """By then the target turns, which the radar has hardly noticed and the camera sees."""
    name = "probability_turn"
    exact, near, without = (told[late, 5.2][name] for late in ("rerun", "one_step", "drop"))
    assert without < 0.6 < 0.9 < exact
    assert near == pytest.approx(exact, abs=0.02)
    assert told["one_step", 5.0][name] < 0.6
