"""The defaults of `tracking.imm` follow what aircraft do: turns, climbs, level-offs, speeds."""

import numpy as np

from docs.make.track_consistency.manoeuvres import MANOEUVRES, OUTSIDE, measured, summary


def test_no_manoeuvre_leaves_a_track_outside_for_long_or_loses_it():
    """One look a second, four replicas; two steady models were outside for 42 s in a climb."""
    found = summary(*measured({"type": "tracking.imm"}, 1.0, 4))
    for name, (error_m, outside_s, largest) in zip(MANOEUVRES, found, strict=True):
        assert error_m < 45.0 and outside_s <= 4.0, name
        assert largest < (25.0 if name in ("climb 12 m/s", "turn 5°/s") else 2.5 * 6.0), name


def test_a_summary_counts_what_is_lost_as_outside():
    times = np.arange(18.0, 26.0)
    square = np.full((2, 1, 8), 9.0)
    nees = np.full((2, 1, 8), 5.0)
    square[0, 0, 4], nees[0, 0, 4] = np.nan, np.nan  # lost
    square[1, 0, 5], nees[1, 0, 6] = 49.0, OUTSIDE + 5.0
    nees[:, 0, 0] = 99.0  # before it begins
    ((error_m, outside_s, largest),) = summary(times, square, nees)
    assert (error_m, outside_s) == (np.sqrt((9.0 + 49.0) / 2.0), 1.0)
    assert largest == (OUTSIDE + 10.0) / 2.0
