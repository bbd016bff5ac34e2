"""False alarms of a radar scan: how many, where, and how strong."""

import math

import mpmath
import numpy as np
import pytest
from scipy.special import bdtr, gammaincc

from components.messages.reach import Reach
from components.radar.detection.detector_output import (
    false_alarm_count,
    false_alarm_snr,
)
from components.radar.resolution import ResolutionCells

# The thesis's radar: ±110° by ±20° at 1°, 76.2 m cells out to 6.5 km.
OASYS = ResolutionCells.from_reach(
    Reach((math.radians(-110), math.radians(110)), (math.radians(-20), math.radians(20)), 6500.0),
    0.0,
    (math.radians(1), math.radians(1), 76.2),
)


def uniforms(count, *key):
    return np.random.Generator(np.random.PCG64([3, *key])).random(count)


def test_cells_of_the_thesis_radar():
    assert (OASYS.azimuth, OASYS.elevation, OASYS.range) == (220, 40, 86)
    assert OASYS.count == 220 * 40 * 86


@pytest.mark.parametrize(
    ("cells", "pfa"), [(1, 0.3), (40, 0.05), (1000, 1e-3), (756_800, 1e-5), (5000, 0.9)]
)
def test_counts_invert_the_binomial_distribution(cells, pfa):
    draws = uniforms(500, cells)
    count = false_alarm_count(draws, cells=cells, false_alarm_probability=pfa)
    # The smallest count whose cumulative probability exceeds the draw.
    upper = bdtr(count, cells, pfa)
    lower = np.where(count > 0, bdtr(np.maximum(count - 1, 0), cells, pfa), 0.0)
    assert np.all(draws < upper + 1e-10) and np.all(lower <= draws + 1e-10)


@pytest.mark.parametrize(
    ("cells", "pfa"), [(10**6, 1e-15), (10**15, 1e-12), (10**8, 0.01), (10**12, 1e-6), (0, 0.5)]
)
def test_mean_and_spread_from_1e_9_to_a_million(cells, pfa):
    mean, spread = cells * pfa, math.sqrt(cells * pfa * (1 - pfa))
    count = false_alarm_count(uniforms(40_000, 7), cells=cells, false_alarm_probability=pfa)
    assert np.mean(count) == pytest.approx(mean, abs=4 * spread / 200 + 1e-12)
    if mean > 1:
        assert np.std(count) == pytest.approx(spread, rel=0.03)


def test_quantiles_of_a_million_false_alarms_to_the_count():
    # Binomial(1e12, 1e-6): mean 1e6; the tails by mpmath's incomplete gamma (Poisson limit, the
    # share of the difference is 1e-6).
    for z in (-6.0, -1.0, 0.0, 3.0, 6.0):
        u = 0.5 * math.erfc(-z / math.sqrt(2))
        count = int(false_alarm_count(u, cells=10**12, false_alarm_probability=1e-6))
        with mpmath.workdps(30):
            reached = mpmath.gammainc(count + 1, 10**6, regularized=True)
        assert float(reached) == pytest.approx(u, rel=0.02)


def test_rare_false_alarms_keep_their_probability():
    # cells · Pfa = 1e-9: one alarm in the top 1e-9 of the draws, none below.
    rare = {"cells": 1000, "false_alarm_probability": 1e-12}
    none = false_alarm_count([0.0, 0.5, 1 - 1.000001e-9], **rare)
    assert none.tolist() == [0, 0, 0]
    assert false_alarm_count([1 - 0.999999e-9, 1 - 2**-53], **rare).tolist() == [1, 1]


def test_certain_and_impossible_false_alarms():
    draws = np.array([0.0, 0.3, 1 - 2**-53])
    assert false_alarm_count(draws, cells=7, false_alarm_probability=0.0).tolist() == [0] * 3
    assert false_alarm_count(draws, cells=7, false_alarm_probability=1.0).tolist() == [7] * 3
    assert false_alarm_count(draws, cells=0, false_alarm_probability=1.0).tolist() == [0] * 3


def test_long_run_agrees_with_pfa_times_cells():
    scans = 3600
    count = false_alarm_count(uniforms(scans, 1), cells=OASYS.count, false_alarm_probability=1e-6)
    expected = scans * OASYS.count * 1e-6
    assert abs(int(count.sum()) - expected) < 4 * math.sqrt(expected)


@pytest.mark.parametrize("pulses", [1, 5])
def test_a_false_alarm_lies_above_the_threshold(pulses):
    pfa = 0.01
    draws = uniforms(20_000, pulses)
    snr = false_alarm_snr(draws, false_alarm_probability=pfa, pulses=pulses)
    output = pulses * (1.0 + snr)
    # The share of noise above the output, among all that crosses, is 1 - draw.
    np.testing.assert_allclose(gammaincc(pulses, output) / pfa, 1 - draws, rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: false_alarm_count(0.5, cells=10, false_alarm_probability=1.5), "is 1.5: .*0, 1"),
        (lambda: false_alarm_count(0.5, cells=10, false_alarm_probability=[0.1]), "one number"),
        (lambda: false_alarm_count(1.0, cells=10, false_alarm_probability=0.5), "uniform is 1"),
        (lambda: false_alarm_count(0.5, cells=1.5, false_alarm_probability=0.5), "cells is 1.5"),
        (lambda: false_alarm_count(0.5, cells=10**9, false_alarm_probability=0.5), "at most 0.01"),
        (lambda: false_alarm_snr(0.5, false_alarm_probability=0.0), "strictly between 0 and 1"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_more_cells_than_can_be_counted_are_refused():
    reach = Reach((0.0, 1.0), (0.0, 0.1), 100.0)
    with pytest.raises(ValueError, match="1e15"):
        ResolutionCells.from_reach(reach, 0.0, (0.1, 0.1, 1e-14))
