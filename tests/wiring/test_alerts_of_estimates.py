"""Alert levels of tracks with states: from a filter's estimate and its covariance."""

import math

import crooked
import numpy as np
import pytest
from test_alerting_keys import CONF, TARGET, entry_s, truth
from wired import HEARS_ALL, chain, rows, run

from components.alerting.daidalus import DaidalusAlerting
from components.alerting.estimated_flights import EstimatedFlights
from components.alerting.track_slots import TrackSlots
from components.messages.columns import COVARIANCE
from components.messages.state_tracks import CONFIRMED, TENTATIVE, StateTracks

SIGMA_M = 25.0
#: A short lookahead, over which an error of a vertical speed does not grow far.
PLAIN = "lookahead_time = 25 [s]\n" + CONF.format(m=0)
RADAR = {
    **HEARS_ALL, "scan_rate_hz": 4, "errors": "stated", "quantised": False,
    "azimuth_error_deg": 0.02, "elevation_error_deg": 0.02, "range_error_m": 0.5,
}  # fmt: skip


def scene(tmp_path, conf=PLAIN, radar=None, duration_s=6, kind="tracking.ekf", **keys):
    path = tmp_path / "two.conf"
    path.write_text(conf, encoding="utf-8")
    found = chain(
        {"radar": {**RADAR, **(radar or {})}}, targets=[TARGET], duration_s=duration_s,
        fusion={"type": "fusion.pass_through"},
        tracker={"type": kind, "acceleration_intensity_m2_s3": 1e-3},
    )  # fmt: skip
    found["blocks"]["alerting"] = {
        "type": "alerting.daidalus", "scan_rate_hz": 2, "conf": str(path), "alerter": 2, **keys,
    }  # fmt: skip
    found["wires"] += ["traffic -> alerting", "tracker -> alerting"]
    return found


@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
def test_times_are_those_of_the_true_flight(tmp_path, kind):
    """Good measurements in body axes of a banked ownship lead to the true times."""
    found = rows(run(scene(tmp_path, kind=kind)), "alerts")
    assert {row["target"] for row in found} == {"meets"}
    assert {row["track"] for row in found} == {1}
    late = [row for row in found if row["time_s"] >= 3.0]
    assert len(late) == 6
    for row in late:
        wanted = entry_s(truth(row["time_s"]), 900.0)
        assert row["time_to_level_1_s"] == pytest.approx(wanted, rel=0.05)
        assert row["closest_vertical_m"] == pytest.approx(120.0, abs=6.0)
        assert row["level"] == 1


def test_a_margin_makes_alerts_earlier(tmp_path):
    """By a larger radius at least, where the detector heeds uncertainty; and not otherwise."""
    scores = "h_pos_z_score = 3\nv_pos_z_score = 3\n"
    plain = PLAIN.replace("WCV_TCPA", "WCV_TAUMOD")
    times = {}
    for name, conf in {
        "plain": plain, "scores only": scores + plain,
        "heeded": scores + plain.replace("WCV_TAUMOD", "WCV_TAUMOD_SUM"),
    }.items():  # fmt: skip
        found = rows(run(scene(tmp_path, conf, {"range_error_m": SIGMA_M})), "alerts")
        times[name] = np.array([row["time_to_level_1_s"] for row in found])
    assert times["plain"].tolist() == times["scores only"].tolist()
    gained = times["plain"] - times["heeded"]
    assert (gained > 0.0).all()
    # Three sigma of a range after some looks, at the rate at which the two close in.
    closing = np.linalg.norm(truth(3.0)[3:5])
    assert 0.2 * SIGMA_M / closing < gained[-1] < 9.0 * SIGMA_M / closing


def test_windows_change_no_byte(tmp_path, monkeypatch):
    """Of targets that come and go: where one is remembered, another was some time before."""
    one = scene(
        tmp_path, PLAIN.replace("hysteresis_time = 5", "hysteresis_time = 1"), duration_s=10
    )
    others = [
        {**TARGET, "name": f"other {k}", "east_m": TARGET["east_m"] + 300.0 * k,
         "start_time_s": begin, "end_time_s": end}
        for k, (begin, end) in enumerate([(0.0, 2.0), (0.9, 10.0), (5.4, 9.0), (5.7, 10.0)], 1)
    ]  # fmt: skip
    one["blocks"]["traffic"]["intruders"] += others
    at_once = rows(run(one), "alerts")
    monkeypatch.setattr(DaidalusAlerting, "windowed", False)
    assert rows(run(one), "alerts") == at_once
    assert len({row["track"] for row in at_once}) >= 5
    assert len({row["target"] for row in at_once}) >= 4


def test_tracks_and_sights_at_once_are_refused(tmp_path):
    both = scene(tmp_path)
    both["wires"].append("fusion -> alerting")
    with pytest.raises(Exception, match="both fused and estimates are wired"):
        run(both)


def tracks(number, status=CONFIRMED, **values):
    """One row with one track, 1 km north of a frame at the crooked ownship's start."""
    made = StateTracks.initial({})
    made.offsets = np.array([0, 1])
    own = crooked.OWNSHIP
    fields = {
        "north_m": 1000.0, "east_m": -400.0, "down_m": 50.0, "north_m_s": 20.0, "east_m_s": 30.0,
        "down_m_s": -2.0, "origin_lat_deg": own["lat_deg"], "origin_lon_deg": own["lon_deg"],
        "origin_alt_m": own["alt_m"], "state_s": 3.0, **values,
    }  # fmt: skip
    for name, value in fields.items():
        setattr(made, name, np.array([value]))
    made.track, made.track_status = np.array([number]), np.array([status])
    made.has_range = np.array([True])
    matrix = np.diag([9.0, 25.0, 4.0, 1.0, 2.25, 0.25])
    matrix[0, 3] = matrix[3, 0] = 0.5
    made.covariance = {name: np.array([matrix[pair]]) for pair, name in COVARIANCE.items()}
    return made


def test_an_estimate_is_carried_on_with_its_covariance():
    flights = EstimatedFlights()
    flights.add(np.array([40]), tracks(7))
    flights.add(np.array([41]), tracks(8, TENTATIVE))
    own = crooked.OWNSHIP
    place = np.array([*np.radians([own["lat_deg"], own["lon_deg"]]), own["alt_m"]])
    numbers = np.array([7, 9])
    known, state, wrong = flights.states(40, 5.0, numbers, place)
    assert known.tolist() == [True, False]
    # 2 s later; the sphere's plane is up to half a percent off, and the frame's down 0.1 m.
    wanted = [-400.0 + 60.0, 1000.0 + 40.0, -50.0 + 4.0, 30.0, 20.0, 2.0]
    assert state[:, 0] == pytest.approx(wanted, rel=0.006, abs=0.11)
    variance = 9.0 + 2 * 2 * 0.5 + 4 * 1.0, 25.0 + 4 * 2.25
    assert wrong.position_m[0] == pytest.approx(math.sqrt(max(variance)))
    assert wrong.height_m[0] == pytest.approx(math.sqrt(4.0 + 4 * 0.25))
    assert (wrong.velocity_mps[0], wrong.climb_mps[0]) == pytest.approx((1.5, 0.5))
    later, _, _ = flights.states(41, 5.0, numbers, place)
    assert not later.any()  # a tentative track counts for nothing
    assert not flights.states(39, 5.0, numbers, place)[0].any()


def test_places_of_tracks_that_are_gone_are_given_again():
    slots = TrackSlots()
    assert [part.tolist() for part in slots.of(np.array([3, 5]), [0.0], 4.0)] == [[3, 5], [0, 1]]
    assert [part.tolist() for part in slots.of(np.array([5]), [1.0, 3.0], 4.0)] == [[3, 5], []]
    assert slots.of(np.array([5, 8]), [4.0], 4.0)[0].tolist() == [3, 5, 8]
    number, new = slots.of(np.array([8, 9]), [4.5], 4.0)
    assert (number.tolist(), new.tolist()) == ([9, 5, 8], [0])
