"""Tracks of what aircraft say of themselves: what lasts of it, and velocities that they tell."""

from dataclasses import replace

import numpy as np
import pytest
from wired import chain, rows, run

import components.surveillance.active as active
import dsa_des
from components.estimation.estimator import ExtendedKalmanFilter
from components.estimation.motion import ConstantVelocity
from components.tracking.tracker import Tracker
from docs.make.track_consistency import CASES, nees_of, summary
from dsa_des.running.simulation import Simulation

ADS_B = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "reception": "certain"}
KEA = {"name": "kea", "north_m": -9000, "east_m": -4000, "up_m": 200, "heading_deg": 80,
       "speed_mps": 90, "climb_mps": 8, "ads_b": {"nacp": 9, "nacv": 3}}  # fmt: skip
ERRS = {"attitude_noise_deg": [1.0, 1.0, 1.0], "position_noise_m": [20.0, 20.0, 20.0]}


# Mean of the fourth power of an altimeter's error over its variance squared, 5000 to 10,000 ft: a
# mixture of two Laplace distributions (6 each) with scales of 43 and 69 ft, 34.5 % of the first.
KURTOSIS = 6.0 * (0.345 * 43.0**4 + 0.655 * 69.0**4) / (0.345 * 43.0**2 + 0.655 * 69.0**2) ** 2


def test_covariances_are_honest_where_flights_are_as_the_filter_has_them():
    """Flights drawn from the filter's own motion, within 99 % bounds of the mean at every instant.

    What lasts is the same at all instants of a run, so that 200 tracks are 200 draws and no more;
    and the square of an altimeter's error varies by more than that of a normal one.
    """
    nees = nees_of(CASES["ads_b_drawn"], 200)
    assert np.isnan(nees).mean() < 0.01
    off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
    assert (np.abs(np.nanmean(nees, axis=0) - 6.0) < off).all()


def test_rounding_is_new_where_a_flight_is_not_steady():
    """Of who knows its velocity well whole knots are most of the error: as lasting ones, 7.9."""
    best = [{"ads_b": {"nacp": 11, "nacv": 4}}]
    nees = nees_of(replace(CASES["ads_b_drawn_compact"], aircraft=best), 100)
    assert np.isnan(nees).mean() < 0.01
    off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
    assert (np.abs(np.nanmean(nees, axis=0) - 6.0) < off).all()


def test_both_sensors_together_are_honest():
    """A track of bearings of 9° is an arc: as straight as its tangent it had 8 with a report.

    Straight flights have 5.1 (below).
    """
    nees = nees_of(CASES["both"], 110)
    assert not np.isnan(nees).any()
    off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
    assert (5.1 - off < nees.mean(axis=0)).all() and (nees.mean(axis=0) < 6.0 + off).all()


def test_straight_flights_are_told_by_as_much_too_careful_as_their_climb_is():
    """Vertical rates are known to 1 cm/s: there the noise that no straight flight has is half.

    5.1 by the recursion in `tests/estimation/test_told_ages.py`, and as much as the bend of level
    flight adds at most.
    """
    found = summary(nees_of(CASES["ads_b"], 40))
    assert found["tracks"] >= 118 and found["lost"] < 0.01
    off = 2.576 * np.sqrt((4 * 2.0 + KURTOSIS - 1.0) / found["tracks"])
    assert 5.1 - off < found["mean"] < 5.1 + off


LATE = {"nacp": 10, "nacv": 2, "latency_s": 0.5}


def late_case(says, *, turns=(), **tracker):
    """Three at 120 m/s that send where they were half a second before."""
    flights = [
        {**one, "speed_mps": 120.0, "ads_b": {**LATE, **says}, **({"legs": turns} if turns else {})}
        for one in CASES["ads_b"].targets
    ]
    case = replace(CASES["ads_b_compact"], targets=flights, within_m=600.0)
    return replace(case, tracker=tracker) if tracker else case


def test_a_position_that_is_late_is_one_deviation_off_along_the_flight():
    """Sixty metres each, of 4 m stated: 203 where nothing is said of it; with it as none.

    A latency that the aircraft compensates is none; one of 2 s, 240 m, is as honest. All reports
    are late by the same: a filter that takes better known speeds for news of it has 1 more there.
    """
    found = {}
    for name, says in (
        ("none", {"latency_s": 0.0}), ("late", {}), ("later", {"latency_s": 2.0}),
        ("compensated", {"compensated_s": 0.5}),
    ):  # fmt: skip
        nees = nees_of(late_case(says), 20)
        assert np.isnan(nees).mean() < 0.01
        found[name] = np.nanmean(nees, axis=0)
        off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
        assert (5.1 - off < found[name]).all() and (found[name] < 6.0 + off).all(), name
    assert abs((found["late"] - found["none"]).mean()) < 0.6
    assert abs((found["later"] - found["none"]).mean()) < 0.6
    assert abs(found["compensated"] - found["none"]).mean() < 0.3


@pytest.mark.parametrize("kind", ["tracking.ukf", "tracking.imm"])
def test_so_it_is_of_other_filters_and_in_a_turn_of_models_that_have_one(kind):
    turns = [{"kind": "straight", "duration_s": 10}, {"kind": "turn", "rate_deg_s": 3}]
    nees = nees_of(late_case({}, turns=turns if kind == "tracking.imm" else (), type=kind), 20)
    assert np.isnan(nees).mean() < 0.01
    off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
    assert (np.nanmean(nees, axis=0) < 6.0 + off).all()
    assert (nees > 60.0).mean() < 0.01


def test_a_radar_beside_it_pulls_nobody_off():
    """Both of one aircraft: the radar's plots are not 60 m from what the tracks are sure of."""
    radar = {"type": "radar.range_boundary", "range_km": 20, "scan_rate_hz": 1, "errors": "stated",
             "quantised": False, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.6,
             "range_error_m": 15.0}  # fmt: skip
    case = late_case({}, type="tracking.ekf")
    nees = nees_of(replace(case, sensors={**case.sensors, "radar": radar}), 20)
    assert np.isnan(nees).mean() < 0.01
    assert (nees > 30.0).mean() < 0.005 and (np.nanmean(nees, axis=0) < 7.0).all()


def test_a_tracker_that_cannot_carry_it_says_so():
    def said(kind, says):
        scene = chain(
            {"ether": ADS_B}, targets=[{**KEA, "ads_b": says}], duration_s=2,
            fusion={"type": "fusion.pass_through"}, tracker={"type": kind},
        )  # fmt: skip
        block = Simulation(dsa_des.load_scene(scene)).components["tracker"]
        return [one for one in block.warnings() if "ether may hear aircraft" in one]

    own = f"{__name__}:CarriesNothing"
    for kind in ("tracking.stub", own):
        (one,) = said(kind, LATE)
        assert "latency_s is above compensated_s" in one
        assert said(kind, {**LATE, "compensated_s": 0.5}) == []
    assert said("tracking.ekf", LATE) == []


class Plain(ExtendedKalmanFilter):
    """A filter that carries no errors."""

    def carrying(self, lasts_s):
        return self


class CarriesNothing(Tracker):
    """Its tracker."""

    def estimator(self):
        return Plain(ConstantVelocity(1.0))


def test_active_surveillance_is_honest_where_bearings_are_fine(monkeypatch):
    """What is told of ranges, delays and altimeters is right: the arc of 9 degrees is left."""
    coarse = active.bearing_deviation_rad
    monkeypatch.setattr(active, "bearing_deviation_rad", lambda angle: 0.1 * coarse(angle))
    nees = nees_of(CASES["active_ekf"], 100)
    off = 2.576 * np.sqrt((5 * 2.0 + KURTOSIS - 1.0) / len(nees))
    assert np.isnan(nees).mean() < 0.01
    assert (np.abs(np.nanmean(nees, axis=0) - 6.0) < off).all()


def test_velocities_are_used_at_every_update():
    """A turn of 3 deg/s is followed by the velocities that are told, with and without."""
    target = {**KEA, "climb_mps": 0, "legs": [{"kind": "turn", "rate_deg_s": 3.0}],
              "ads_b": {"nacp": 7, "nacv": 4}}  # fmt: skip

    def off(**keys):
        late = [row for row in tracked(target=target, duration_s=30, **keys) if row["time_s"] > 9]
        heading = np.radians(80.0 + 3.0 * np.array([row["state_s"] for row in late]))
        true = 90.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        return np.abs(np.array([velocity(row)[:2] for row in late]) - true).mean()

    assert off() < 0.3 * off(use_range_rate=False)


def tracked(target=KEA, tracker="tracking.ekf", duration_s=20, errors="gauss_markov", **keys):
    scene = chain(
        {"ether": {**ADS_B, "position_errors": errors}}, targets=[target], duration_s=duration_s,
        fusion={"type": "fusion.pass_through"}, tracker={"type": tracker, **keys},
    )  # fmt: skip
    return rows(run(scene), "state_tracks")


def velocity(row):
    return np.array([row["north_m_s"], row["east_m_s"], row["down_m_s"]])


TRUE = np.array([90.0 * np.cos(np.radians(80.0)), 90.0 * np.sin(np.radians(80.0)), -8.0])


@pytest.mark.parametrize("tracker", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
def test_a_track_is_born_with_the_velocity_that_is_told(tracker):
    told = velocity(tracked(tracker=tracker)[0])
    assert np.abs(told - TRUE).max() < 4.0
    alone = velocity(tracked(tracker=tracker, use_range_rate=False)[0])
    assert np.abs(alone - TRUE).max() > 10.0


def test_a_climb_is_told_and_kept():
    found = tracked(duration_s=30, delete_after_s=10)
    late = [velocity(row)[2] for row in found if row["time_s"] > 15.0]
    assert np.mean(late) == pytest.approx(-8.0, abs=1.0) and np.std(late) < 1.5


def test_errors_of_navigation_are_none_of_what_is_told():
    """Whose place is told is there, however the ownship believes to be turned."""
    radar = {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 30, "errors": "stated",
             "quantised": False, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5,
             "range_error_m": 10}  # fmt: skip
    active = {"type": "surveillance.active", "scan_rate_hz": 1, "far_every": 1,
              "elevation_deg": [-90, 90], "replies": "certain"}  # fmt: skip
    scene = chain({"ether": ADS_B, "radar": radar, "active": active},
                  targets=[{**KEA, "mode_s": True}], duration_s=6)  # fmt: skip
    found = {}
    for name, navigation in (("sure", {}), ("erring", ERRS)):
        seen = run({**scene, "navigation": navigation} if navigation else scene)
        for block in ("ether", "radar", "active"):
            found[name, block] = np.array([
                [row[f"{angle}_variance_rad2"] for angle in ("azimuth", "elevation")]
                for row in rows(seen, block=block) if row["scan"] > 1
            ]).mean(axis=0)  # fmt: skip
    assert found["erring", "ether"] == pytest.approx(found["sure", "ether"], rel=0.1)
    assert (found["erring", "radar"] > 3.0 * found["sure", "radar"]).all()
    # Of active surveillance the bearing is turned with the nose, the altitude with nothing.
    assert found["erring", "active"][0] > 1.005 * found["sure", "active"][0]


def test_tracks_are_where_they_are_told_to_be_whatever_the_attitude():
    def off(navigation):
        scene = chain(
            {"ether": {**ADS_B, "position_errors": "none"}}, targets=[KEA], duration_s=20,
            fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"},
            **({"navigation": navigation} if navigation else {}),
        )  # fmt: skip
        last = rows(run(scene), "state_tracks")[-1]
        return np.array([last[name] for name in ("north_m", "east_m", "down_m")])

    turned = {"attitude_noise_deg": [2.0, 2.0, 2.0]}
    assert np.abs(off(turned) - off({})).max() < 3.0
