"""The ownship's lasting errors over the pole: north turns about there, and they do not."""

import numpy as np
import pymap3d
import pytest
from wired import chain, rows, run

OWN = {"lat_deg": 89.995, "lon_deg": 40.0, "alt_m": 3000.0, "heading_deg": 8.0, "speed_mps": 60.0}
TARGET = {"name": "polar", "lat_deg": 89.99, "lon_deg": -100.0, "alt_m": 3300.0,
          "heading_deg": 200.0, "speed_mps": 50.0}  # fmt: skip
RADAR = {
    "type": "radar.range_boundary", "range_km": 20.0, "scan_rate_hz": 1, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.2, "elevation_error_deg": 0.2, "range_error_m": 5.0,
}  # fmt: skip
NOISE_M = 8.0


def flown(seed=0, rates=False, **navigation):
    """60 m/s past the pole, which lies some 80 m beside the way after ten seconds."""
    radar = RADAR | ({"measures_range_rate": True, "range_rate_error_m_s": 0.3} if rates else {})
    return run(chain(
        {"radar": radar}, ownship=OWN, targets=[TARGET], duration_s=60,
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"}, seed=seed,
        navigation={"position_noise_m": [NOISE_M, NOISE_M, 0.0], **navigation},
        record={"truth": True},
    ))  # fmt: skip


def poses(done):
    """Where the ownship is and its nose points by what it believes, and truly: ECEF, at scans."""
    true = {row["time_s"]: row for row in rows(done, "truth") if row["target"] is None}
    found = []
    for row in rows(done, block="radar"):
        pair = []
        for one, prefix in ((row, "own_"), (true[row["time_s"]], "")):
            at = [one[f"{prefix}{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
            heading = one[f"{prefix}heading_rad"]
            here = np.array(pymap3d.geodetic2ecef(*at))
            ahead = pymap3d.ned2ecef(np.cos(heading), np.sin(heading), 0.0, *at)
            pair.append((here, np.array(ahead) - here))
        found.append(pair)
    return np.array(found)  # (scans, believed and true, place and nose, 3)


@pytest.mark.parametrize("lasts_s", [0.0, 300.0])
def test_errors_do_not_turn_over_and_the_nose_points_where_it_does(lasts_s):
    found = poses(flown(position_correlation_time_s=lasts_s))
    assert np.abs(found[:, 1, 0, :2]).min(axis=0).max() < 100.0  # beside the pole
    off = found[:, 0, 0] - found[:, 1, 0]
    size = np.linalg.norm(off, axis=1)
    assert size.max() < 4.0 * NOISE_M and size.min() > 0.1
    # What is believed and true of the nose differ by what the Earth bends over ten metres.
    assert np.abs(found[:, 0, 1] - found[:, 1, 1]).max() < 1e-5
    if lasts_s:
        steps = np.linalg.norm(np.diff(off, axis=0), axis=1)
        # In a second of 300: a deviation is sqrt(2 / 300) of the noise along each axis.
        assert steps.max() < 4.5 * NOISE_M * np.sqrt(2.0 / lasts_s)


@pytest.mark.parametrize("rates", [False, True])
def test_tracks_over_the_pole_are_one_and_honest(rates):
    """Four tracks of one where errors turn over, or the nose is taken from another north."""
    nees = []
    for seed in range(4):
        done = flown(seed, rates, position_correlation_time_s=300.0)
        tracks = rows(done, "state_tracks")
        assert {row["track"] for row in tracks} == {1}
        there = {r["time_s"]: r for r in rows(done, "truth") if r["target"] == "polar"}
        for row in tracks[10::5]:
            origin = [row[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
            true = there[row["time_s"]]
            place = [true[name] for name in ("lat_deg", "lon_deg", "alt_m")]
            off = [row[f"{axis}_m"] for axis in ("north", "east", "down")]
            off = np.array(off) - pymap3d.geodetic2ned(*place, *origin)
            spread = np.array([
                [row[f"covariance_{min(i, j)}{max(i, j)}_m2"] for j in range(3)] for i in range(3)
            ])  # fmt: skip
            nees.append(off @ np.linalg.solve(spread, off))
    assert np.mean(nees) < 5.0 and np.max(nees) < 25.0


def test_the_velocity_beside_range_rates_is_along_the_north_that_is_believed():
    """60 m/s of the nose's way, whatever the ownship believes: it flies where it points."""
    for row in rows(flown(rates=True), block="radar"):
        course = np.arctan2(row["own_velocity_east_m_s"], row["own_velocity_north_m_s"])
        apart = (course - row["own_heading_rad"] + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(apart) < 1e-5
        level = np.hypot(row["own_velocity_east_m_s"], row["own_velocity_north_m_s"])
        assert level == pytest.approx(60.0, abs=1e-3)
