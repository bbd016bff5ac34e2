"""The section of least ranges: flights against a turn that is integrated by hand, and the count."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from docs.make.published import least_range
from docs.make.published.least_range import (
    DISC_M,
    KT_MPS,
    LeastRange,
    closing_speeds,
    least_ranges,
    risk_ratio,
)

DATA = Path(os.environ.get("REFERENCE_DATA", Path(__file__).parents[5] / "shared" / "data"))


def by_hand(azimuth_deg, closing_mps):
    """Least range of the better turn by 90 deg over a flat Earth: ψ' = g tan φ / v, φ = p t."""
    step, v = 0.01, 60.0 * KT_MPS
    time = np.arange(0.0, 60.0, step)
    bank = np.minimum(math.radians(10.0) * time, math.radians(45.0))
    turned = np.minimum(np.cumsum(9.80665 * np.tan(bank) / v) * step, 0.5 * math.pi)
    line = np.array([math.sin(math.radians(azimuth_deg)), math.cos(math.radians(azimuth_deg))])
    intruder = np.array([0.0, v]) - closing_mps * line
    best = math.inf
    for side in (-1.0, 1.0):
        own = np.cumsum([np.sin(side * turned), np.cos(turned)], axis=1) * step * v
        off = np.outer(intruder, time) - own
        # |R line + off| = D has its larger root R where the ownship must be clear of it.
        along, apart = line @ off, (off**2).sum(axis=0) - DISC_M**2
        root = along**2 - apart
        best = min(best, float((-along + np.sqrt(np.maximum(root, 0.0)))[root > 0.0].max()))
    return best


@pytest.mark.parametrize(("kt", "azimuth_deg"), [(35, 20.0), (140, 100.0)])
def test_the_least_range_is_that_of_the_turn_by_hand(kt, azimuth_deg):
    found = least_ranges(kt, [azimuth_deg])
    speeds = closing_speeds(azimuth_deg, kt * KT_MPS)
    assert [one.closing_mps for one in found] == speeds and len(speeds) == (2 if kt < 60 else 1)
    for one, speed in zip(found, speeds, strict=True):
        assert one.range_m == pytest.approx(by_hand(azimuth_deg, speed), abs=2.5)


def test_both_sides_are_alike():
    left, right = (least_ranges(105, [side * 40.0])[0].range_m for side in (-1.0, 1.0))
    assert left == pytest.approx(right, abs=1.5)


def test_the_ratio_counts_every_course_of_the_grid():
    # Of a slower intruder, who comes from within 35.69 deg: 142 azimuths of 0.25 deg, two courses.
    near = [LeastRange(a, c, 30.0, 400.0) for c in (0, 1) for a in (0.25, 35.0)]
    assert risk_ratio(near, 35, 60.0, 1000.0) == pytest.approx(1.0 - 240 / 284)
    assert risk_ratio(near, 35, 60.0, 300.0) == 1.0
    # Of a faster one from anywhere; half of the azimuths in view need more than there is.
    rising = [LeastRange(0.25, 0, 60.0, 900.0), LeastRange(30.0, 0, 60.0, 1100.0)]
    ratio = risk_ratio(rising, 105, 60.0, 1000.0)
    assert ratio == pytest.approx(1.0 - 60 / 719, abs=2 / 719)


def test_flown_ranges_are_within_steps_of_the_published_ones(monkeypatch):
    folder = DATA / "published" / "nrc_min_range"
    if not folder.exists():
        pytest.skip(f"there is no {folder}")
    monkeypatch.setattr(least_range, "DATA", folder)
    found = {35: least_ranges(35, [30.0]), 195: least_ranges(195, [90.0])}
    off = least_range.differences_s(found)
    assert len(off) == 3
    # Two of their steps of 0.1 s at most, and one more by which their bank runs ahead.
    assert all(-0.1 < one < 0.3 for one in off)
