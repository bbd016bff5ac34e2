"""Forty thousand messages and answers in scenes: within 99 % bounds of what is stated."""

from math import sqrt
from statistics import NormalDist

import numpy as np
from wired import chain, run

from components.surveillance.reception import fitted_reception_probability

#: Half widths of 99 % intervals: of one value, and of all of 25 together.
Z, Z_OF_25 = (NormalDist().inv_cdf(1.0 - 0.005 / n) for n in (1, 25))
STILL = {"speed_mps": 0.0, "heading_deg": 217.0}
OWNSHIP = {"lat_deg": -42.0, "lon_deg": 179.99, "alt_m": 9000.0, "roll_deg": 25.0, **STILL}


def seen(sensor, targets, duration_s, ownship=OWNSHIP):
    table = run(chain({"one": sensor}, ownship=ownship, targets=targets, duration_s=duration_s,
                      record={"looks": False}))["detections"]  # fmt: skip
    names = ("target", "scan", "range_m", "true_range_m", "azimuth_rad", "true_azimuth_rad")
    return {name: np.array(table[name].to_pylist()) for name in names}


def test_position_messages_are_received_as_the_law_says_at_every_range():
    """At most one is sent between two scans 0.4 s apart, so every one received is reported."""
    duration_s = 800
    targets = [
        {"name": f"a{i:02}", "north_m": 0.0, "east_m": 18_000.0 * (i + 1), "up_m": 3000.0, **STILL,
         "ads_b": {"nacp": 8}}
        for i in range(25)
    ]  # fmt: skip
    sensor = {"type": "surveillance.ads_b", "scan_rate_hz": 2.5, "position_errors": "none",
              "elevation_deg": [-90, 90]}  # fmt: skip
    got = seen(sensor, targets, duration_s)
    total, expected, spread = 0, 0.0, 0.0
    for target in targets:
        mine = got["target"] == target["name"]
        sent = 2.0 * duration_s
        p = float(fitted_reception_probability(got["true_range_m"][mine][:1])[0])
        # How many are sent varies by 0.23 of the root of them, and of each whether it comes.
        variance = sent * (p * (1.0 - p) + p * p * (0.2**2 / 12) / 0.5**2)
        assert abs(mine.sum() - sent * p) < Z_OF_25 * sqrt(variance) + 2, target
        total, expected, spread = total + mine.sum(), expected + sent * p, spread + variance
    assert abs(total - expected) < Z * sqrt(spread) + 10


def test_answers_ranges_and_bearings_of_transponders():
    count, duration_s = 50, 800
    targets = [
        {"name": f"a{i:02}", "north_m": -14_000.0, "east_m": 60.0 * i, "up_m": 500.0, **STILL,
         "mode_s": True}
        for i in range(count)
    ]  # fmt: skip
    sensor = {"type": "surveillance.active", "scan_rate_hz": 1, "far_every": 1,
              "elevation_deg": [-90, 90]}  # fmt: skip
    got = seen(sensor, targets, duration_s, {**OWNSHIP, "roll_deg": 0.0})
    n = count * duration_s
    assert abs(len(got["scan"]) / n - 0.95) < Z * sqrt(0.95 * 0.05 / n)
    # 125 ft too far, errors of 50 ft forgotten in a second; of a scan a second away 1/e is left.
    off = got["range_m"] - got["true_range_m"]
    m, e = len(off), np.exp(-1.0)
    assert abs(off.mean() - 38.1) < Z * 15.24 * sqrt((1 + e) / (1 - e) / m)
    assert abs(off.std() / 15.24 - 1.0) < Z * sqrt((1 + e**2) / (1 - e**2) / (2 * m))
    order = np.lexsort((got["scan"], got["target"]))
    name = got["target"][order]
    follows = (np.diff(got["scan"][order]) == 1) & (name[1:] == name[:-1])
    pairs = (off[order] - 38.1) / 15.24
    product = (pairs[1:] * pairs[:-1])[follows]
    assert abs(product.mean() - e) < Z * sqrt((1 + e**2) * (1 + e**2) / (1 - e**2) / len(product))
    bearing = np.degrees(got["azimuth_rad"] - got["true_azimuth_rad"])
    bearing = (bearing + 180.0) % 360.0 - 180.0
    # A normal error cut at three deviations has the variance 1 - 2 φ(3) 3 + 2 Q(3) (9 - 1).
    tail = 1.0 - NormalDist().cdf(3.0)
    cut = 1.0 - 6.0 * NormalDist().pdf(3.0) + 2.0 * tail * 8.0
    assert abs(bearing.mean()) < Z * 9.0 / sqrt(m)
    assert abs(bearing.var() / (81.0 * cut) - 1.0) < Z * sqrt(2.0 / m)
