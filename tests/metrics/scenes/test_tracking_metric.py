"""The metric of estimated tracks, through scenes whose sensors are exact but for stated errors."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, measured, rows, run

import dsa_des

RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 20.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.1, "elevation_error_deg": 0.1, "range_error_m": 3.0,
}  # fmt: skip
TRACKER = {"type": "tracking.ekf", "acceleration_intensity_m2_s3": 0.01}


def scene(targets=(crooked.ROLLING,), duration_s=6, **radar):
    return chain(
        {"radar": {**RADAR, **radar}}, targets=targets, duration_s=duration_s,
        fusion={"type": "fusion.pass_through"}, tracker=TRACKER,
    )  # fmt: skip


FINE = {"azimuth_error_deg": 0.001, "elevation_error_deg": 0.001, "range_error_m": 0.05,
        "biases": "fixed", "range_bias_m": 100.0}  # fmt: skip


def test_errors_are_those_of_the_tracks_told():
    """Against positions by pymap3d at the instants of the rows, in a run of another seed."""
    import pymap3d

    found = measured(scene(**FINE), {"metric": "tracking", "step_s": 0.25})
    errors = []
    for row in rows(run(scene(**FINE)), "state_tracks"):
        if row["track_status"] != "confirmed":
            continue
        origin = row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"]
        true = pymap3d.ecef2ned(*crooked.position(crooked.ROLLING, row["state_s"]), *origin)
        errors.append(np.array([row["north_m"], row["east_m"], row["down_m"]]) - true)
    known = math.sqrt(np.mean(np.sum(np.square(errors), axis=1)))
    assert found["track_position_error_m"] == pytest.approx(known, rel=0.2)
    assert found["track_completeness"] == pytest.approx(1.0, abs=0.15)
    assert found["track_false_per_hour"] == found["track_swapped"] == 0.0
    assert found["track_confirmation_s"] == pytest.approx(0.5)


@covers("from_s", "step_s", of=("[metric tracking]",))
def test_instants_count_as_said():
    """Before its third look no track is confirmed; afterwards there always is one."""
    early = measured(scene(), {"metric": "tracking", "step_s": 0.25})
    late = measured(scene(), {"metric": "tracking", "step_s": 0.25, "from_s": 2.0})
    seldom = measured(scene(), {"metric": "tracking", "step_s": 3.0})
    assert early["track_completeness"] < late["track_completeness"] == 1.0
    assert seldom["track_completeness"] == 1.0
    none = measured(scene(), {"metric": "tracking", "from_s": 5.9})
    assert early["track_nis_per_freedom"] > 0.0 and math.isnan(none["track_nis_per_freedom"])


@covers("within_m", "order", of=("[metric tracking]",))
def test_what_is_far_away_is_missed_and_false():
    """A radar whose ranges are 100 m too long."""
    wrong = scene(**FINE)
    keys = {"metric": "tracking", "from_s": 2.0}
    near = measured(wrong, {**keys, "within_m": 60.0})
    far = measured(wrong, {**keys, "within_m": 160.0})
    assert near["track_spuriousness"] == 1.0 and near["track_completeness"] == 0.0
    assert far["track_spuriousness"] == 0.0 and far["track_completeness"] == 1.0
    assert near["track_gospa_missed_m"] == pytest.approx(60.0 / math.sqrt(2.0))
    one = measured(wrong, {**keys, "within_m": 60.0, "order": 1.0})
    assert one["track_gospa_missed_m"] == pytest.approx(60.0 / 2.0)
    assert far["track_ospa_m"] == pytest.approx(100.0, rel=0.2)


@covers("block", of=("[metric tracking]",))
def test_one_block_s_tracks_count():
    """Of a chain of trackers the last one's count, or those of the block that is named."""
    both = scene()
    both["blocks"]["fused"] = {"type": "fusion.covariance_intersection", "tentative": True}
    both["wires"].append("tracker -> fused")
    told = measured(both, {"metric": "tracking", "step_s": 0.25})
    mine = measured(both, {"metric": "tracking", "step_s": 0.25, "block": "tracker"})
    last = measured(both, {"metric": "tracking", "step_s": 0.25, "block": "fused"})
    assert told["track_ambiguity"] == last["track_ambiguity.fused"] == 1.0
    assert told["track_position_error_m"] == last["track_position_error_m.fused"]
    alone = measured(scene(), {"metric": "tracking", "step_s": 0.25})
    assert mine["track_nees_mean.tracker"] == alone["track_nees_mean"]
    with pytest.raises(Exception, match="'fusd' tells no tracks; did you mean 'fused'"):
        measured(both, {"metric": "tracking", "block": "fusd"})


def test_tracks_are_of_the_instant_that_their_states_speak_of():
    """Told 1.3 s after they were measured, of targets that fly 60 m/s."""
    found = measured(scene(**{**FINE, "range_bias_m": 0.0}, latency_s=1.3), {"metric": "tracking"})
    assert found["track_position_error_m"] < 5.0


def test_targets_count_while_they_are_there():
    """One that has gone and one that came later: at 5 s there is one, which has a track."""
    gone = {**crooked.DIVING, "end_time_s": 1.4}
    came = {**crooked.ROLLING, "start_time_s": 2.6}
    both = scene((gone, came), duration_s=6)
    late = measured(both, {"metric": "tracking", "from_s": 5.0})
    assert late["track_completeness"] == 1.0
    assert late["track_gospa_missed_m"] == 0.0
    early = measured(both, {"metric": "tracking", "step_s": 0.25})
    # There for 5 and 13 of what is told, and tracked from the third look on, of 0.5 and 3.25 s.
    assert early["track_completeness"] == pytest.approx((4 + 11) / 18)


def test_every_replica_has_its_own_tracks_and_first_detections():
    """A radar that misses: who is first detected, and how well tracked, differs by replica."""
    given = scene()
    given["blocks"]["radar"] = {
        "type": "radar.swerling", "swerling": 2, "scan_rate_hz": 4, "power_w": 60.0,
        "antenna_gain_db": 30.0, "frequency_hz": 35e9, "bandwidth_hz": 1e6,
        "false_alarm_probability": 1e-3, "azimuth_resolution_deg": 1.0,
        "elevation_resolution_deg": 1.0, "range_resolution_m": 30.0,
    }  # fmt: skip
    study = dsa_des.study(given, metrics=["tracking"], replicas=3, runs_per_chunk=3)
    delays = []
    for replica in study.runs.to_pylist():
        alone = run({**given, "seed": replica["seed"]})
        first_s = min(row["time_s"] for row in rows(alone))
        told = [
            r["time_s"] for r in rows(alone, "state_tracks") if r["track_status"] == "confirmed"
        ]
        delays.append(min(told, default=math.nan) - first_s)
        assert replica["track_confirmation_s"] == pytest.approx(delays[-1], nan_ok=True)
    assert len(set(delays)) > 1
