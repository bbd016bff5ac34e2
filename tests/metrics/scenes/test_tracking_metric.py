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
    # There at 5 and 14 instants, and tracked from the third look on, of 0.5 and 3.25 s.
    assert early["track_completeness"] == pytest.approx((4 + 12) / 19)


LEVEL = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000.0, "heading_deg": 0.0, "speed_mps": 50.0}
#: Passes the ownship at 600 m, and comes within 1,500 m for 22.9 of 60 s.
PASSING = {"name": "passing", "north_m": 3600.0, "east_m": 600.0, "up_m": 0.0,
           "heading_deg": 180.0, "speed_mps": 70.0}  # fmt: skip


def seen_for_a_while(*others, range_km=1.5, rate_hz=2):
    radar = {**RADAR, "range_km": range_km, "scan_rate_hz": rate_hz}
    return chain(
        {"radar": radar}, ownship=LEVEL, targets=(PASSING, *others), duration_s=60,
        fusion={"type": "fusion.pass_through"}, tracker=TRACKER,
    )  # fmt: skip


def test_time_without_a_track_counts():
    """In range from 18.5 to 41.5 s of 60; nothing is told before and after.

    Confirmed by the third look in range, at 20 s, and, as looks out of range say nothing of it,
    tracked on until it is deleted.
    """
    given = seen_for_a_while()
    told = [r for r in rows(run(given), "state_tracks") if r["track_status"] != "tentative"]
    gone_s = next(r["time_s"] for r in told if r["track_status"] == "deleted")
    assert told[0]["time_s"] == 20.0 and 42.0 <= gone_s < 55.0
    instants = (gone_s - 20.0) / 0.5
    found = measured(given, "tracking")
    assert found["track_completeness"] == pytest.approx(instants / 120)
    missed_m = 300.0 / math.sqrt(2.0)
    assert found["track_gospa_missed_m"] == pytest.approx(missed_m * (1 - instants / 120))
    assert found["track_ospa_m"] == pytest.approx(300.0 * (1 - instants / 120), abs=1.0)


def test_between_two_reports_a_track_goes_on_at_its_velocity():
    """Reported every 2 s, of a target that flies 140 m meanwhile."""
    keys = {"metric": "tracking", "from_s": 20.0, "within_m": 60.0}
    found = measured(seen_for_a_while(range_km=20.0, rate_hz=0.5), keys)
    assert found["track_completeness"] == 1.0 and found["track_spuriousness"] == 0.0
    assert found["track_ospa_m"] < 15.0 and found["track_positional_accuracy_m"] < 15.0


def test_a_target_that_is_never_seen_counts():
    beyond = {**PASSING, "name": "beyond", "east_m": 9000.0}
    alone = measured(seen_for_a_while(), "tracking")
    both = measured(seen_for_a_while(beyond), "tracking")
    assert both["track_completeness"] == pytest.approx(alone["track_completeness"] / 2)
    nobody = measured(seen_for_a_while(range_km=0.3), "tracking")
    assert nobody["track_completeness"] == nobody["track_false_per_hour"] == 0.0
    assert nobody["track_ospa_m"] == 300.0 and math.isnan(nobody["track_spuriousness"])


def test_trackers_side_by_side_are_each_asked_for_their_own():
    """Two that number their tracks alike and report at different instants of the same target."""
    both = seen_for_a_while()
    both["blocks"]["other"] = {**both["blocks"]["radar"], "offset_s": 0.25}
    both["blocks"]["pass"], both["blocks"]["second"] = {"type": "fusion.pass_through"}, TRACKER
    both["wires"] += ["gate -> other -> pass -> second"]
    found = measured(both, "tracking")
    alone = measured(seen_for_a_while(), "tracking")
    assert found["track_ambiguity"] == pytest.approx(2.0, abs=0.1)
    assert found["track_completeness"] == pytest.approx(alone["track_completeness"], abs=0.01)


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
