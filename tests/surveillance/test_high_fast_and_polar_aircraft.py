"""Aircraft beyond the ordinary codes, and near a pole, are where they say, as well as they say."""

import numpy as np
import pytest
from wired import chain, rows, run

FOOT_M, KNOT_M_S = 0.3048, 1852.0 / 3600.0
RECEIVER = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "reception": "certain"}
ASKING = {"type": "surveillance.active", "scan_rate_hz": 1, "replies": "certain"}


def flown(alt_m, speed_mps=170.0, heading_deg=30.0, sensors=("ads_b",), duration_s=20, **keys):
    own = {"lat_deg": -33.0, "lon_deg": 151.0, "alt_m": alt_m - 100.0, "heading_deg": 0.0,
           "speed_mps": speed_mps}  # fmt: skip
    target = {"name": "high", "north_m": 9000.0, "east_m": 2000.0, "up_m": 100.0,
              "heading_deg": heading_deg, "speed_mps": speed_mps, "mode_s": True,
              "ads_b": {"nacp": 10, "nacv": 3}}  # fmt: skip
    blocks = {"ads_b": {**RECEIVER, **keys}, "active": ASKING}
    return run(chain(
        {name: blocks[name] for name in sensors}, ownship=own, targets=[target],
        duration_s=duration_s, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf"},
    ))  # fmt: skip


def born(done):
    """Tracks that were confirmed."""
    found = done["state_tracks"].to_pylist()
    return {row["track"] for row in found if row["track_status"] == "confirmed"}


@pytest.mark.parametrize(
    ("feet", "step"), [(60_000, 100), (50_860, 100), (40_010, 25), (-1150, 100)]
)
def test_altitudes_are_reported_in_the_step_of_their_code(feet, step):
    found = rows(flown(feet * FOOT_M, position_errors="none"), block="ads_b")
    assert len(found) > 15
    for row in found:
        reported = row["reported_alt_m"] / FOOT_M
        # A level flight follows the Earth: 8 m lower over 10 km seen from its start.
        assert abs(reported - feet) <= 0.5 * step + 330.0
        assert reported / step == pytest.approx(round(reported / step), abs=1e-6)


def test_both_sensors_place_an_aircraft_at_60_000_ft():
    done = flown(60_000 * FOOT_M, sensors=("ads_b", "active"), duration_s=40)
    for name in ("ads_b", "active"):
        for row in rows(done, block=name):
            truth = row["true_range_m"] * np.sin(row["true_elevation_rad"])
            measured = row["range_m"] * np.sin(row["elevation_rad"])
            assert abs(measured - truth) < 250.0
            hundreds = row["reported_alt_m"] / FOOT_M / 100.0
            assert hundreds == pytest.approx(round(hundreds), abs=1e-6)
    assert len(born(flown(60_000 * FOOT_M, duration_s=40))) == 1
    # No code has 130,000 ft: neither sensor places such an aircraft.
    assert not len(flown(130_000 * FOOT_M, sensors=("ads_b", "active"))["detections"])


def test_who_is_heard_and_not_placed_is_told_with_the_reason():
    """No code has -1,500 ft: the receiver hears 20 seconds of it and places nothing."""
    for feet in (-1500, -900):
        done = flown(feet * FOOT_M, sensors=("ads_b", "active"))
        said = done.summary.get("undone", {})
        for name in ("ads_b", "active"):
            lacking = [counts for why, counts in said.get(name, {}).items() if "altitude" in why]
            assert bool(len(rows(done, block=name))) == (feet == -900)
            assert bool(lacking) == (feet == -1500)
            for times, of in lacking:
                assert times == of >= 10


def test_an_aircraft_of_600_m_s_is_as_fast_as_it_is():
    done = flown(15_000.0, speed_mps=600.0, heading_deg=10.0)
    for row in rows(done)[4:]:
        assert row["reported_north_m_s"] == pytest.approx(600.0 * np.cos(np.radians(10.0)), abs=5.0)
        fours = row["reported_north_m_s"] / KNOT_M_S / 4.0
        assert fours == pytest.approx(round(fours), abs=1e-6)
    assert len(born(done)) == 1


@pytest.mark.parametrize("seed", range(3))
def test_errors_do_not_turn_over_at_a_pole(seed):
    """120 m/s past the pole at 400 m: the report errs to one side, and there is one track."""
    own = {"lat_deg": 89.95, "lon_deg": 4.0, "alt_m": 3000.0, "heading_deg": 0.0, "speed_mps": 0.0}
    target = {"name": "polar", "lat_deg": 89.96, "lon_deg": 60.0, "alt_m": 3200.0,
              "heading_deg": 5.0, "speed_mps": 120.0, "mode_s": True,
              "ads_b": {"nacp": 8, "nacv": 2}}  # fmt: skip
    done = run(chain(
        {"ads_b": RECEIVER}, ownship=own, targets=[target], duration_s=80,
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"}, seed=seed,
    ))  # fmt: skip
    found = rows(done)
    assert max(row["reported_lat_deg"] for row in found) > 89.99

    def line(row, kind):
        across, up, range_m = (
            row[f"{kind}{n}"] for n in ("azimuth_rad", "elevation_rad", "range_m")
        )
        return range_m * np.array([
            np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), -np.sin(up)
        ])  # fmt: skip

    off = np.array([line(row, "") - line(row, "true_") for row in found])[:, :2]
    # 80 s of 300: what lasts stays; a deviation is 38 m, half of its change over that 0.7.
    assert np.linalg.norm(off[-1] - off[0]) < 3.0 * 38.0 * np.sqrt(2.0 * (1.0 - np.exp(-80 / 300)))
    steps = np.linalg.norm(np.diff(off, axis=0), axis=1)
    assert steps.max() < 30.0
    assert len(born(done)) == 1
