"""What a sensor promises decides what counts as missed, and how long a track lives."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pymap3d
import pytest
from wired import chain, rows, run

import dsa_des
from components.messages.detections import (
    LastingError,
    LastingPart,
    SensorOffer,
    range_and_report_interval_pairs,
)
from components.surveillance.reception import (
    certain_reception_probability,
    do_365_reception_probability,
    time_to_receive_95_percent_s,
)
from components.tracking.due_detections import Promises
from components.tracking.rules import LastingErrors
from components.tracking.scans import Scans
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 2000, "heading_deg": 0, "speed_mps": 60}
BESIDE = {"name": "beside", "up_m": 50, "heading_deg": 0, "speed_mps": 60, "mode_s": True,
          "ads_b": {"nacp": 9, "nacv": 2}}  # fmt: skip
NAUTICAL_MILE_M = 1852.0


def tracked(sensor, target, duration_s, seed=1, **tracker):
    return run(
        chain({"s": sensor}, ownship=OWN, targets=[{**BESIDE, **target}], duration_s=duration_s,
              fusion={"type": "fusion.pass_through"},
              tracker={"type": "tracking.ekf", **tracker}) | {"seed": seed},
    )  # fmt: skip


def lives(found):
    """The tracks' numbers, and from when on one is confirmed without a break, s."""
    tracks = rows(found, "state_tracks")
    unsure = {row["time_s"] for row in tracks if row["track_status"] in ("tentative", "deleted")}
    confirmed = [r["time_s"] for r in tracks if r["track_status"] in ("confirmed", "coasted")]
    since = [time_s for time_s in confirmed if time_s > max(unsure)]
    return {row["track"] for row in tracks}, min(since, default=math.inf)


@pytest.mark.parametrize("rate_hz", [1, 10, 20])
def test_scans_between_messages_are_no_misses(rate_hz):
    """Positions come every 0.4 to 0.6 s: the third has come by 1.8 s, a scan later it is seen."""
    sensor = {"type": "surveillance.ads_b", "scan_rate_hz": rate_hz, "reception": "certain"}
    found = tracked(sensor, {"north_m": 8000, "east_m": 3000}, 8)
    numbers, since = lives(found)
    assert numbers == {1} and since <= max(1.8 + 1 / rate_hz, 3.0)
    status = {row["track_status"] for row in rows(found, "state_tracks") if row["time_s"] > since}
    assert status == {"confirmed"}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_who_is_asked_in_turn_is_kept(seed):
    """Abeam at 4 km, asked every fifth scan; one reply in twenty fails."""
    sensor = {"type": "surveillance.active", "scan_rate_hz": 1}
    numbers, since = lives(tracked(sensor, {"north_m": 0, "east_m": 4000}, 90, seed))
    assert numbers == {1} and since <= 4.0


def test_who_comes_into_reach_is_new_and_confirmed_there():
    """At 15.6 nmi every scan asks: the third reply of four comes within 640 m at 160 m/s.

    Bearings of 9° leave 4.5 km of doubt there, more than `delete_above_m`.
    """
    sensor = {"type": "surveillance.active", "scan_rate_hz": 1}
    for seed in (1, 2, 3):
        target = {"north_m": 30_500, "east_m": 200, "heading_deg": 180, "speed_mps": 100}
        found = tracked(sensor, target, 40, seed)
        numbers, since = lives(found)
        (first,) = [row for row in rows(found, "state_tracks") if row["time_s"] == since]
        at = [first[f"{axis}_m"] - first[f"own_{axis}_m"] for axis in ("north", "east", "down")]
        assert numbers == {1}
        assert 15.6 * NAUTICAL_MILE_M - np.linalg.norm(at) < 160.0 * 4 + 300.0


def test_who_did_not_answer_is_asked_again_at_once():
    """Of a far one nearly every gap is 5 s; none is 10, which one reply in twenty made before."""
    gaps = []
    for seed in range(2):
        found = tracked({"type": "surveillance.active", "scan_rate_hz": 1},
                        {"north_m": 0, "east_m": 9000}, 200, seed)  # fmt: skip
        gaps += np.diff([row["scan"] for row in rows(found)]).tolist()
    assert gaps.count(5) > 50 and max(gaps) <= 7


@pytest.mark.parametrize("seed", [1, 2])
def test_a_receiver_that_hears_one_message_in_five_keeps_its_track(seed):
    """DO-365 at 15 nmi: a report in 7 s with 95 %, so that gaps of 6 s come every minute."""
    sensor = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "reception": "do_365"}
    found = tracked(sensor, {"north_m": 15 * NAUTICAL_MILE_M, "east_m": 0}, 200, seed)
    assert max(np.diff([row["time_s"] for row in rows(found)])) > 6.0
    assert lives(found)[0] == {1}


def test_one_miss_is_not_the_end_of_a_slow_radar_s_track():
    """A look every 4 s, and one of them lost: 8 s without a detection."""
    radar = {"type": "radar.range_boundary", "scan_rate_hz": "1/4", "range_km": 15,
             "errors": "stated", "quantised": False, "azimuth_error_deg": 0.2,
             "elevation_error_deg": 0.2, "range_error_m": 10.0}  # fmt: skip
    target = {"north_m": 3000, "east_m": 2000}
    scene = chain(
        {"s": radar}, ownship=OWN, targets=[{**BESIDE, **target}], duration_s=100,
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"},
    )  # fmt: skip
    scene["wires"].remove("s -> fusion")
    scene["wires"].append({"from": "s", "to": "fusion", "drop_probability": 0.15})
    tracks = rows(run(scene), "state_tracks")
    gaps = np.diff(sorted({row["time_s"] for row in tracks}))
    assert 8.0 in gaps and max(gaps) <= 12.0
    assert {row["track"] for row in tracks} == {1}


@pytest.mark.parametrize(
    ("rate_hz", "duration_s", "silent_s", "lives_s"), [("1/5", 80, 50, 15.0), (20, 20, 8, 6.0)]
)
@pytest.mark.parametrize("fusion", ["pass_through", "gated", "pick_best"])
def test_slow_and_fast_scans_with_losses_keep_who_is_heard_and_end_who_is_not(
    fusion, rate_hz, duration_s, silent_s, lives_s
):
    """Two aircraft, one of which falls silent; a fifth of all scans is lost on the wire.

    At 0.2 Hz a report is promised in 5 s, and three of these are waited for; at 20 Hz 6 s.
    """
    silent = {**BESIDE, "name": "silent", "north_m": 6000, "east_m": 4000,
              "ads_b": {"nacp": 9, "nacv": 2, "silent_after_s": silent_s}}  # fmt: skip
    scene = chain(
        {"s": {"type": "surveillance.ads_b", "scan_rate_hz": rate_hz, "reception": "certain"}},
        ownship=OWN, targets=[{**BESIDE, "north_m": 6000, "east_m": -4000}, silent],
        duration_s=duration_s, fusion={"type": f"fusion.{fusion}"},
        tracker={"type": "tracking.ekf"},
    )  # fmt: skip
    scene["wires"].remove("s -> fusion")
    scene["wires"].append({"from": "s", "to": "fusion", "drop_probability": 0.2})
    tracks = rows(run(scene), "state_tracks")
    (end,) = [row for row in tracks if row["track_status"] == "deleted"]
    assert {row["track"] for row in tracks} == {1, 2} and end["east_m"] > 0.0
    assert silent_s - 5.0 < end["updated_s"] <= silent_s
    # Within a second of a scan nothing is silent, and half a second later a tracker is awake.
    assert lives_s < end["time_s"] - end["updated_s"] <= lives_s + 1.5
    sure = [row for row in tracks if row["track_status"] in ("confirmed", "coasted")]
    since = min(row["time_s"] for row in sure)
    assert since <= (20.0 if rate_hz == "1/5" else 3.0)
    assert max(row["time_s"] for row in sure if row["track"] != end["track"]) > duration_s - 10


@pytest.mark.parametrize("seed", [1, 6])
def test_one_cessna_at_20_hz_is_one_track_though_each_scan_draws_a_fade(seed):
    """Some misses in a row, a fraction of a second of fades at 7 km, end no track.

    `check` says that fades are drawn sooner than they can be over.
    """
    radar = {"type": "radar.swerling", "swerling": 1, "scan_rate_hz": 20, "range_km": 9,
             "frequency_hz": 77e9, "calibrate": {"range_km": 3, "rcs_dbsm": 0, "pd": 0.9},
             "false_alarm_probability": 1e-6, "azimuth_deg": [-60, 60], "elevation_deg": [-15, 15],
             "azimuth_resolution_deg": 1.5, "elevation_resolution_deg": 1.5,
             "range_resolution_m": 5.0}  # fmt: skip
    cessna = {"name": "cessna", "north_m": 7000, "east_m": 300, "up_m": 60, "heading_deg": 180,
              "speed_mps": 55, "rcs_dbsm": 5.0}  # fmt: skip
    confirmed = {}
    for name, tracker in (("time", {}), ("looks", {"delete_misses": 4})):
        scene = chain(
            {"radar": radar}, ownship=OWN, targets=[cessna], duration_s=25,
            fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf", **tracker},
        ) | {"seed": seed}  # fmt: skip
        tracks = rows(run(scene), "state_tracks")
        sure = {row["track"] for row in tracks if row["track_status"] in ("confirmed", "coasted")}
        confirmed[name] = len(sure)
    assert confirmed["time"] == 1 < confirmed["looks"]
    said = Simulation(dsa_des.load_scene(scene)).components["radar"].warnings()
    assert any("each scan draws a fade of its own" in one for one in said)


def test_a_given_time_is_that_time():
    sensor = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "reception": "do_365"}
    target = {"north_m": 15 * NAUTICAL_MILE_M, "east_m": 0}
    found = tracked(sensor, target, 120, delete_after_s=4.0)
    assert len(lives(found)[0]) > 1


def test_messages_promise_what_they_do():
    """95 % within 3 s and 7 s is what DO-365 says, and what its law is made of."""
    near, far = time_to_receive_95_percent_s(
        do_365_reception_probability(np.array([9.0, 11.0]) * NAUTICAL_MILE_M)
    )
    assert (near, far) == pytest.approx((3.0 + 0.2, 7.0 + 0.2))
    assert time_to_receive_95_percent_s(
        certain_reception_probability(np.zeros(1))
    ) == pytest.approx([0.7])
    assert time_to_receive_95_percent_s(np.zeros(1)) == [60.0]


def test_promises_hold_by_range():
    table = Promises((((1000.0, 2.0), (3000.0, 7.0)), ()), 10)
    assert table.promised_ticks(0, np.array([0.0, 1000.0, 1001.0, 9e9, np.inf])).tolist() == [
        20, 20, 70, 70, 70
    ]  # fmt: skip
    assert table.promised_ticks(1, np.array([5.0])).tolist() == [0.0]


def test_who_looks_often_promises_nothing_of_its_looks():
    assert range_and_report_interval_pairs(2.0) == ()
    assert range_and_report_interval_pairs(2.5) == ((math.inf, 2.5),)
    assert range_and_report_interval_pairs(2.5, [(10.0, 1.0), (20.0, 7.0)]) == (
        (10.0, 2.5),
        (20.0, 7.0),
    )
    assert range_and_report_interval_pairs(1.0, [(10.0, 0.6)]) == ((10.0, 0.6),)


def test_a_miss_is_counted_once_in_the_time_that_is_promised():
    """Who falls silent is missed every 0.65 s at 20 Hz, where 0.7 s are promised.

    Of one or two hits three in five cannot be had any more after three misses.
    """
    sensor = {"type": "surveillance.ads_b", "scan_rate_hz": 20, "reception": "certain"}
    silent = {"nacp": 9, "nacv": 2, "silent_after_s": 0.9}
    found = tracked(sensor, {"north_m": 8000, "east_m": 3000, "ads_b": silent}, 5)
    *_, last = rows(found, "state_tracks")
    assert last["track_status"] == "deleted"
    assert last["time_s"] - last["updated_s"] == pytest.approx(3 * 0.65)


def test_velocities_of_looks_are_turned_into_the_axes_of_their_frames():
    """Two looks from one place, with one and two detections; frames elsewhere, by pymap3d."""
    place = np.array([[60.0, -30.0], [10.0, 179.5], [100.0, 900.0]])
    origin = np.array([[61.0, -31.0], [4.0, -179.0], [0.0, 0.0]])
    measured = np.arange(21.0).reshape(7, 3)
    measured[:, 1] = np.nan
    looks = _Looks(measured, np.array([0, 1, 3]), np.vstack([place, np.zeros((3, 2))]))
    turned = Scans.rotate_velocities_to_frames(looks, origin).measured
    assert turned is not measured and np.array_equal(turned[:4], measured[:4], equal_nan=True)
    for entry, look in ((0, 0), (2, 1)):
        ecef = pymap3d.enu2uvw(*measured[[5, 4], entry], -measured[6, entry], *place[:2, look])
        east, north, up = pymap3d.uvw2enu(*ecef, *origin[:2, look])
        assert turned[4:, entry] == pytest.approx([north, east, -up], abs=1e-6)
    assert np.isnan(turned[4:, 1]).all()
    silent = replace(looks, measured=np.full((7, 3), np.nan))
    assert Scans.rotate_velocities_to_frames(silent, origin) is silent


@dataclass(frozen=True)
class _Looks:
    measured: Any
    offsets: Any
    pose: Any


def test_what_errors_of_two_looks_have_in_common_is_as_by_hand():
    """Each cell of sensors and quantities by itself; of a look that was never before, nothing."""
    offers = {
        "radar": SensorOffer(True, 0.1, lasting={
            "azimuth": LastingError(parts=(LastingPart(variance=1e-6, across_m2=25.0),)),
            "elevation": LastingError(parts=(LastingPart(-0.005, share=0.25, lasts_s=5.0),
                                             LastingPart(variance=0.01, lasts_s=10.0))),
            "range": LastingError(step=2.0, parts=(LastingPart(variance=4.0, lasts_s=10.0),)),
            "range_rate": LastingError(step=1.0, parts=(LastingPart(0.1, lasts_s=10.0),
                                                        LastingPart(0.05))),
        }),
        "eye": SensorOffer(False, 0.1, lasting={"azimuth": LastingError(step=0.6)}),
        "ear": SensorOffer(False, 0.1, lasting={"velocity": LastingError(parts=(
            LastingPart(variance=9.0, lasts_s=2.0),))}),
        "nose": SensorOffer(False, 0.1),
    }  # fmt: skip
    lasting = LastingErrors.of(offers, ("eye", "radar", "nose", "ear"))
    assert LastingErrors.of(offers, ("nose",)) is None
    assert (
        lasting.is_correlated.tolist() == [True, True, False, True, False]
        and lasting.correlated_sensors_mask == 0b1011
    )

    def common(row, sensor, variance, since_s, moved=0.0, range_m=1000.0):
        one = np.ones((1, 1))
        sensors = np.array([[sensor]])
        return lasting.covariance_with_last_errors(
            [row], sensors, variance * one, moved * one, since_s * one, range_m * one
        )[0, 0]

    e = math.exp
    # Across 5 m at 1 km, and at 100 m; for ever. Nearer than 1 m counts as 1 m.
    assert common(0, 1, 1e-3, 7.0) == pytest.approx(1e-6 + 25e-6)
    assert common(0, 1, 1e-1, 7.0, range_m=100.0) == pytest.approx(1e-6 + 25e-4)
    assert common(0, 1, 40.0, 7.0, range_m=0.1) == pytest.approx(1e-6 + 25.0)
    # A quarter of what is stated but 0.005, forgotten in 5 s, and a part of its own, in 10 s.
    assert common(1, 1, 0.08, 5.0) == pytest.approx(0.015 * e(-1.0) + 0.01 * e(-0.5))
    assert common(1, 1, 0.01, 5.0) == pytest.approx(0.01 * e(-0.5))  # the first is not below 0
    # Of a range nothing of its own is left to blur the grid: a cell of 2 m, moved by half a metre.
    assert common(2, 1, 4.0 + 1.0 / 3.0, 5.0, moved=0.5) == pytest.approx(
        4.0 * e(-0.5) + e(-1.5) / 3.0
    )
    # And 0.1 m² of noise: 4 pi² 0.1 / 4 less.
    assert common(2, 1, 4.1 + 1.0 / 3.0, 5.0) == pytest.approx(
        4.0 * e(-0.5) + e(-(math.pi**2) * 0.1) / 3.0
    )
    # Two parts and 0.02 m²/s² of noise, which blurs the grid of 1 m/s.
    assert common(3, 1, 1.0 / 12.0 + 0.17, 10.0) == pytest.approx(
        0.1 * e(-1.0) + 0.05 + e(-4.0 * math.pi**2 * 0.02) / 12.0
    )
    assert common(0, 0, 0.03, 1.0) == pytest.approx(0.03)  # all of it a cell's: 0.6² / 12
    # Velocities share one quantity; the eye has none; who was not seen has nothing.
    assert common(4, 3, 10.0, 2.0) == common(6, 3, 10.0, 2.0) == pytest.approx(9.0 * e(-1.0))
    assert common(3, 0, 1.0, 1.0) == common(0, 2, 1.0, 1.0) == 0.0
    assert common(2, 1, 9.0, math.inf) == 0.0
