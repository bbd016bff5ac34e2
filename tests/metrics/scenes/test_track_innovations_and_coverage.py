"""Innovations of tracks, and when targets enter the coverage, through crooked scenes."""

import math
from itertools import pairwise

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from wired import chain, measured, rows, run

from components.metrics.true_states import Coverage
from dsa_des import load_scene

STATED = {"errors": "stated", "quantised": False, "azimuth_error_deg": 0.1,
          "elevation_error_deg": 0.15}  # fmt: skip
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 20.0, "range_error_m": 3.0,
         **STATED}  # fmt: skip
INTENSITY = 0.01


def scene(sensors, duration_s=3, targets=(crooked.ROLLING,), **tracker):
    return chain(
        sensors, targets=targets, duration_s=duration_s, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf", "acceleration_intensity_m2_s3": INTENSITY, **tracker},
    )  # fmt: skip


def state_of(row):
    names = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
    spread = np.zeros((6, 6))
    for key, value in row.items():
        if key.startswith("covariance_"):
            i, j = int(key[11]), int(key[12])
            spread[i, j] = spread[j, i] = value
    return np.array([row[name] for name in names]), spread


@pytest.mark.parametrize("sensors", [("radar",), ("other", "radar")])
def test_innovations_are_those_of_the_textbook(sensors):
    """From the state told before: predicted, seen by pymap3d and matrices, derived by steps.

    Those of two radars at one instant add up to that of all they measure together, but for what
    the second derivatives make of it.
    """
    one = run(scene(dict.fromkeys(sensors, RADAR)))
    told, found = rows(one, "state_tracks"), {r["tick"]: r for r in rows(one)}
    every = {tick: [r for r in rows(one) if r["tick"] == tick] for tick in found}
    checked = 0
    for before, after in pairwise(told):
        look, dt = found[after["tick"]], after["state_s"] - before["state_s"]
        origin = [before[f"origin_{c}"] for c in ("lat_deg", "lon_deg", "alt_m")]
        here = [look[f"own_{c}"] for c in ("lat_deg", "lon_deg", "alt_m")]
        attitude = np.degrees([look[f"own_{c}_rad"] for c in ("heading", "pitch", "roll")])

        def seen(state, origin=origin, here=here, attitude=attitude):
            away = pymap3d.ecef2ned(*pymap3d.ned2ecef(*state[:3], *origin), *here)
            body = crooked.rotation(*attitude) @ np.array(away)
            return np.array([*crooked.angles(body), np.linalg.norm(body)])

        step = np.eye(6) + dt * np.eye(6, k=3)
        noise = INTENSITY * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        state, spread = state_of(before)
        state, spread = step @ state, step @ spread @ step.T + noise
        slope = np.array([(seen(state + e) - seen(state - e)) / 2.0 for e in np.eye(6)]).T
        many = len(sensors)
        apart = np.concatenate([
            [r[k] for k in ("azimuth_rad", "elevation_rad", "range_m")] - seen(state)
            for r in every[after["tick"]]
        ])  # fmt: skip
        variances = [look[k] for k in ("azimuth_variance_rad2", "elevation_variance_rad2",
                                       "range_variance_m2")] * many  # fmt: skip
        slope = np.tile(slope, (many, 1))
        known = apart @ np.linalg.solve(slope @ spread @ slope.T + np.diag(variances), apart)
        assert after["nis"] == pytest.approx(known, rel=1e-4 if many == 1 else 0.02)
        assert after["nis_freedom"] == 3 * many
        checked += 1
    assert checked >= 10
    if len(sensors) == 1:
        assert told[0]["nis"] is None and told[0]["nis_freedom"] == 0


def test_a_look_that_updates_nothing_has_no_innovation():
    """A radar does not reach one target; the joint tracker weighs detections, so says nothing."""
    camera = {"type": "optical.range_boundary", "scan_rate_hz": 5, "range_km": 20.0, **STATED}
    short = {**RADAR, "range_km": 2.3}
    both = run(scene({"radar": short, "camera": camera}, 2, crooked.TARGETS))
    told = rows(both, "state_tracks")
    assert {row["nis_freedom"] for row in told} == {0, 2, 3, 5}  # 5: both at once
    assert all((row["nis"] is None) == (row["nis_freedom"] == 0) for row in told)
    joint = rows(run(scene({"radar": RADAR}, association="jpda")), "state_tracks")
    assert {row["nis"] for row in joint} == {None}
    mixed = rows(run(scene({"radar": RADAR}, type="tracking.imm")), "state_tracks")
    assert {row["nis_freedom"] for row in mixed} == {0, 3}
    assert 0.0 < max(row["nis"] or 0.0 for row in mixed) < 30.0


def test_honest_trackers_have_honest_innovations():
    """40 looks of three quantities: one deviation of the mean is 0.13."""
    found = measured(scene({"radar": RADAR}, 12), {"metric": "tracking", "from_s": 2.0})
    assert found["track_nis_per_freedom"] == pytest.approx(1.0, abs=0.4)
    assert found["track_nis_inside"] > 0.85
    modest = scene({"radar": RADAR}, 12, acceleration_intensity_m2_s3=1e5)
    found = measured(modest, {"metric": "tracking", "from_s": 2.0})
    assert found["track_nis_per_freedom"] < 0.5


def entered(limit_m, azimuth_deg):
    """When the diving target is within range and sector, by pymap3d and matrices."""
    low, high = np.radians(azimuth_deg)

    def inside(time_s):
        body = crooked.body(crooked.DIVING, time_s)
        return np.linalg.norm(body) <= limit_m and low <= crooked.angles(body)[0] <= high

    after = next(k for k in range(60) if inside(0.1 * k)) * 0.1
    before = after - 0.1
    while after - before > 1e-5:
        middle = 0.5 * (before + after)
        before, after = (before, middle) if inside(middle) else (middle, after)
    return after


def test_coverage_is_entered_where_range_and_field_say():
    first = np.linalg.norm(crooked.body(crooked.DIVING, 0.0))
    later = np.linalg.norm(crooked.body(crooked.DIVING, 3.0))
    azimuth = math.degrees(crooked.angles(crooked.body(crooked.DIVING, 2.1))[0])
    limit = float(0.5 * (first + later))
    radar = {**RADAR, "range_km": limit / 1e3}
    ways = {"range": (radar, (-180.0, 180.0))}
    other = math.degrees(crooked.angles(crooked.body(crooked.DIVING, 4.0))[0])
    sector = sorted([azimuth, other + math.copysign(5.0, other - azimuth)])
    ways["sector"] = ({**RADAR, "azimuth_deg": sector}, sector)
    for name, (sensor, degrees) in ways.items():
        loaded = load_scene(scene({"radar": sensor}, 6, (crooked.DIVING,)))
        reach = limit if name == "range" else 20e3
        known = entered(reach, degrees)
        assert 0.5 < known < 5.0, name
        found = Coverage(loaded).first_covered_s(0.5)["diving"]
        assert found == pytest.approx(known, abs=2e-3), name
        assert Coverage(loaded).first_covered_s(0.5, known - 0.1) == {}  # the run ended before
        result = measured(scene({"radar": sensor}, 6, (crooked.DIVING,)),
                          {"metric": "tracking", "step_s": 0.25})  # fmt: skip
        # Four scans a second: the third one after the entry confirms.
        third = math.ceil(known * 4) / 4 + 0.5
        assert result["track_confirmation_from_coverage_s"] == pytest.approx(
            third - known, abs=2e-3
        ), name
        assert result["track_confirmed_share"] == 1.0
    never = load_scene(scene({"radar": {**RADAR, "range_km": 0.5}}, 3, (crooked.DIVING,)))
    assert Coverage(never).first_covered_s(0.5) == {}


@covers("series_s", of=("[metric tracking]",))
def test_a_series_has_the_last_comparison_of_each_stretch():
    """Against a run of as many comparisons as stretches, whose mean is of that one."""
    keys = {"metric": "tracking", "step_s": 0.5}
    found = measured(scene({"radar": RADAR}, 4), {**keys, "series_s": 2.0})
    ends = [name for name in found if name.startswith("track_nees.time_s.")]
    assert ends == ["track_nees.time_s.2", "track_nees.time_s.4"]
    last = measured(scene({"radar": RADAR}, 4), {**keys, "from_s": 4.0})
    assert found["track_nees.time_s.4"] == pytest.approx(last["track_nees_mean"])
    named = measured(scene({"radar": RADAR}, 4), {**keys, "series_s": 4.0, "block": "tracker"})
    assert named["track_nees.time_s.tracker.4"] == found["track_nees.time_s.4"]
    with pytest.raises(Exception, match="is shorter than step_s"):
        measured(scene({"radar": RADAR}), {**keys, "series_s": 0.1})
    with pytest.raises(Exception, match="makes 0 stretches of the run"):
        measured(scene({"radar": RADAR}), {**keys, "series_s": 9.0})
