"""Pd and false alarms of a camera."""

import math

import numpy as np
import pytest

from components.optical.detection import (
    FAINTEST_PD,
    detection_probability,
    false_alarm_direction,
    false_alarm_signature,
)

FIELD = {
    "azimuth_start_rad": -1.9,
    "azimuth_width_rad": 3.8,
    "lowest_elevation_rad": -0.2,
    "highest_elevation_rad": 0.3,
}


def test_directions_fill_the_field_of_view_evenly():
    rng = np.random.Generator(np.random.PCG64(12))
    azimuth, elevation = false_alarm_direction(rng.random(20_000), rng.random(20_000), **FIELD)
    for values, low, high in ((azimuth, -1.9, 1.9), (elevation, -0.2, 0.3)):
        assert values.min() >= low and values.max() <= high
        hits = np.histogram(values, bins=20, range=(low, high))[0]
        assert np.all(np.abs(hits - 1000) < 5 * math.sqrt(1000))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: false_alarm_signature(1.0, threshold=1.0, noise=0.5), "uniform is 1"),
        (lambda: false_alarm_signature(0.5, threshold=1.0, noise=0.0), "noise is 0"),
        (lambda: detection_probability(1.0, 1.0, -0.1), "noise is -0.1"),
        (
            lambda: false_alarm_direction(0.5, 0.5, **{**FIELD, "azimuth_width_rad": 0.0}),
            "azimuth_width_rad is 0",
        ),
        (
            lambda: false_alarm_direction(0.5, 0.5, **{**FIELD, "lowest_elevation_rad": 1.0}),
            "highest_elevation_rad is 0.3",
        ),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_pd_keeps_its_digits_into_both_tails():
    """Against the complementary error function at 50 digits."""
    mpmath = pytest.importorskip("mpmath")
    signature = np.array([0.0, 0.2, 0.61, 0.99, 1.0, 1.3, 2.1, 2.4])
    pd = detection_probability(signature, 1.0, 0.2)
    with mpmath.workdps(50):
        for level, found in zip(signature.tolist(), pd.tolist(), strict=True):
            above = (mpmath.mpf(level) - 1) / mpmath.mpf(0.2)
            exact = mpmath.erfc(-above / mpmath.sqrt(2)) / 2
            if exact < FAINTEST_PD:
                assert found == 0.0
            elif exact < 0.5:
                assert abs(found / exact - 1) < 1e-12
            else:
                assert abs((1.0 - found) - (1 - exact)) < 2e-16 + 1e-12 * (1 - exact)
    assert (pd == 0.0).sum() == 1
    assert detection_probability([0.99, 1.0], 1.0, 0.0).tolist() == [0.0, 1.0]
