"""What noise brings is recorded without a truth, counted, and passed on as it was reported."""

from collections import Counter

import pytest
from wired import chain, noise_crosses, rows, run, sensor

NOISY = {
    "azimuth_deg": [-40, 60], "elevation_deg": [-30, 10], "range_km": 3.0, "minimum_range_m": 1.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 100.0,
}  # fmt: skip
SENSORS = {
    name: sensor(kind, **NOISY, **noise_crosses(kind, 3e-4), scan_rate_hz=rate_hz)
    for name, kind, rate_hz in (("first", "radar.threshold", 4), ("second", "radar.swerling", 5))
} | {
    "eye": sensor("optical.eo", false_alarms_per_frame=0.6, scan_rate_hz=10),
}
TRUTH = ("true_azimuth_rad", "true_elevation_rad", "true_range_m")


@pytest.fixture(scope="module")
def recorded():
    return run(chain(SENSORS, duration_s=3, fusion={"type": "fusion.pick_best"}))


def test_noise_has_no_truth_and_nothing_else_tells_it_from_a_target(recorded):
    for name in SENSORS:
        found = rows(recorded, block=name, target=None)
        assert len(found) > 8
        for row in found:
            assert all(row[key] is None for key in TRUTH)
    assert all(row["declared"] and row["detection_probability"] is None for row in rows(recorded))


def test_each_scan_counts_what_it_reports(recorded):
    reported = Counter((row["block"], row["scan"]) for row in rows(recorded))
    scans = {(row["block"], row["scan"]): row["detected"] for row in rows(recorded, "scans")}
    assert len(scans) == 3 * (4 + 5 + 10)
    assert scans == {key: reported.get(key, 0) for key in scans}
    assert len(set(scans.values())) > 3


def test_fused_noise_is_the_sensor_s_own_report(recorded):
    columns = ("time_s", "azimuth_rad", "elevation_rad", "range_m")
    fused = rows(recorded, "fused", target=None)
    for name in SENSORS:
        sent = Counter(
            tuple(row[key] for key in columns) for row in rows(recorded, block=name, target=None)
        )
        mine = [row for row in fused if row["sensors"] == name]
        assert Counter(tuple(row[key] for key in columns) for row in mine) == sent
        for row in mine:
            assert row["angle_source"] == name
            assert row["range_source"] == (None if name == "eye" else name)
            assert all(row[key] is None for key in TRUTH)
