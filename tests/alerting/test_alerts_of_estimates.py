"""Alert levels of tracks with states: from a filter's estimate and its covariance."""

import math

import crooked
import numpy as np
import pytest
from test_alerting_keys import CONF, TARGET, entry_s, truth
from wired import HEARS_ALL, chain, rows, run

from components.alerting.believed_tracks import EstimatedFlights
from components.alerting.daidalus import DaidalusAlerting
from components.alerting.memory import LevelMemory, MemoryRule
from components.messages.state_tracks import COASTED, CONFIRMED, COVARIANCE, TENTATIVE, StateTracks
from dsa_des.arrays.run_ticks import RunTicks

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


def test_a_pose_that_a_newer_one_overtook_tells_nothing(tmp_path):
    """The ownship's velocity is that of its newest two poses, however they came."""
    shaken = scene(tmp_path)
    shaken["wires"].remove("traffic -> alerting")
    shaken["wires"].append({"from": "traffic", "to": "alerting", "jitter_s": 0.9})
    times = {row["time_s"]: row["time_to_level_1_s"] for row in rows(run(shaken), "alerts")}
    assert list(times) == [row["time_s"] for row in rows(run(scene(tmp_path)), "alerts")]
    for time_s, wanted in ((t, entry_s(truth(t), 900.0)) for t in times if t >= 3.0):
        assert times[time_s] == pytest.approx(wanted, abs=0.5)


def test_tracks_and_sights_at_once_are_refused(tmp_path):
    both = scene(tmp_path)
    both["wires"].append("fusion -> alerting")
    with pytest.raises(Exception, match="both fused and estimates are wired"):
        run(both)


def tracks(number, status=CONFIRMED, **values):
    """One row with one track, 1 km north of a frame at the crooked ownship's start."""
    made = StateTracks.make_initial({})
    made.offsets = np.array([0, 1])
    own = crooked.OWNSHIP
    fields = {
        "north_m": 1000.0, "east_m": -400.0, "down_m": 50.0, "north_m_s": 20.0, "east_m_s": 30.0,
        "down_m_s": -2.0, "origin_lat_deg": own["lat_deg"], "origin_lon_deg": own["lon_deg"],
        "origin_alt_m": own["alt_m"], "state_s": 3.0, "updated_s": 2.0,
        **values,
    }  # fmt: skip
    for name, value in fields.items():
        setattr(made, name, np.array([value]))
    made.track, made.track_status = np.array([number]), np.array([status])
    made.has_range = np.array([True])
    matrix = np.diag([9.0, 25.0, 4.0, 1.0, 2.25, 0.25])
    matrix[0, 3] = matrix[3, 0] = 0.5
    made.covariance = {name: np.array([matrix[pair]]) for pair, name in COVARIANCE.items()}
    return made


def at(*ticks, run=0):
    return RunTicks.of_run(run, np.array(ticks))


def test_an_estimate_is_carried_on_with_its_covariance():
    flights = EstimatedFlights()
    flights.add(at(40), tracks(7))
    flights.add(at(41, 42), two(tracks(8, TENTATIVE), tracks(9, COASTED)))
    own = crooked.OWNSHIP
    place = np.array([*np.radians([own["lat_deg"], own["lon_deg"]]), own["alt_m"]])
    # Before it came, when it did, and when a tentative one has come, which counts for nothing; one
    # that is carried on without looks counts.
    now = at(39, 40, 41, 42)
    instant, number, state, wrong, age_s = flights.states_at(
        now, np.full(4, 5.0), np.stack([place] * 4, axis=1)
    )
    assert (instant.tolist(), number.tolist()) == ([1, 3], [7, 9])
    assert age_s.tolist() == [3.0, 3.0]
    # 2 s later; the sphere's plane is up to half a percent off, and the frame's down 0.1 m.
    wanted = [-400.0 + 60.0, 1000.0 + 40.0, -50.0 + 4.0, 30.0, 20.0, 2.0]
    assert state[:, 0] == pytest.approx(wanted, rel=0.006, abs=0.11)
    variance = 9.0 + 2 * 2 * 0.5 + 4 * 1.0, 25.0 + 4 * 2.25
    assert wrong.position_m[0] == pytest.approx(math.sqrt(max(variance)))
    assert wrong.height_m[0] == pytest.approx(math.sqrt(4.0 + 4 * 0.25))
    assert (wrong.velocity_mps[0], wrong.climb_mps[0]) == pytest.approx((1.5, 0.5))


def test_what_came_in_another_run_is_not_known():
    flights = EstimatedFlights()
    flights.add(at(0, 5, run=2), two(tracks(3), tracks(4)))
    both = two(tracks(9), tracks(2))
    both.tick, both.offsets = both.tick[:1], np.array([0, 2])
    flights.add(RunTicks(np.array([1, 2]), np.array([1, 3])), two(tracks(1), both))
    now = RunTicks(np.array([1, 1, 2, 2, 3]), np.array([0, 7, 1, 4, 9]))
    instant, number, _, _, _ = flights.states_at(now, np.full(5, 4.0), np.zeros((3, 5)))
    assert (instant.tolist(), number.tolist()) == ([1, 2, 3, 3], [1, 3, 2, 9])
    flights.keep_rows(np.array([True, False, True, True]))
    instant, number, _, _, _ = flights.states_at(now, np.full(5, 4.0), np.zeros((3, 5)))
    assert (instant.tolist(), number.tolist()) == ([1, 3, 3], [1, 2, 9])


def test_a_track_of_which_nothing_has_come_for_long_is_refused():
    """Half a minute after its last measurement, whatever is still held of it."""
    flights = EstimatedFlights()
    one = tracks(1, updated_s=10.0)
    one.offsets = np.array([0, 2])
    other = tracks(2, COASTED, updated_s=20.0)
    for name in ("track", "track_status", "has_range", "state_s", "updated_s", "north_m", "east_m",
                 "down_m", "north_m_s", "east_m_s", "down_m_s", "origin_lat_deg", "origin_lon_deg",
                 "origin_alt_m"):  # fmt: skip
        setattr(one, name, np.concatenate([getattr(one, name), getattr(other, name)]))
    one.covariance = {name: np.repeat(values, 2) for name, values in one.covariance.items()}
    flights.add(at(20), one)
    instant, number, _, _, age_s = flights.states_at(
        at(40, 41, 51), np.array([40.0, 41.0, 51.0]), np.zeros((3, 3))
    )
    assert (instant.tolist(), number.tolist()) == ([0, 0, 1], [1, 2, 2])
    assert age_s.tolist() == [30.0, 20.0, 21.0]


def two(one, other):
    """Two messages of one track each as one of two rows."""
    return StateTracks.concatenate([one, other])


def test_tracks_are_remembered_by_run_and_number():
    """Two levels, of which the second counts a while longer once it was on."""
    memory = LevelMemory(MemoryRule(hysteresis_s=4.0, persistence_s=0.0, m=0, n=0))

    def levels(runs, numbers, now_s, due, early):
        due, early = (np.array(part, dtype=bool)[:, np.newaxis] for part in (due, early))
        found = memory.update_levels(np.array(runs), np.array(numbers), np.array(now_s), due, early)
        return found.tolist()

    # Track 5 of the first run is on and stays so by its early time; a new one needs its own.
    assert levels([0, 0, 0], [5, 6, 5], [0.0, 0.0, 1.0], [1, 0, 0], [1, 1, 1]) == [1, 0, 1]
    assert levels([0, 1], [4, 5], [1.0, 1.0], [0, 0], [1, 1]) == [0, 0]
    memory.forget_absent(np.array([1]), np.array([9.0]))
    assert len(memory) == 3
    memory.forget_absent(np.array([0, 1]), np.array([4.5, 4.5]))
    assert len(memory) == 2
    assert levels([0, 1], [5, 5], [5.0, 9.0], [0, 0], [1, 1]) == [1, 0]
    assert levels([0], [5], [9.1], [0], [1]) == [0]  # it was gone for longer than anything lasts
    assert levels([0], [5], [10.0], [1], [1]) == [1]
    memory.forget_runs_before(1)
    assert levels([0], [5], [11.0], [0], [1]) == [0]
