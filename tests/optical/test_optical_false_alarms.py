"""False alarms of a camera."""

import math

import numpy as np
import pytest

from components.optical.false_alarms import (
    AFRL_HIGH_THRESHOLD,
    AFRL_LOW_THRESHOLD,
    false_alarm_direction,
    false_alarm_in_frame,
)

FIELD = {
    "azimuth_start_rad": -1.9,
    "azimuth_width_rad": 3.8,
    "lowest_elevation_rad": -0.2,
    "highest_elevation_rad": 0.3,
}


@pytest.mark.parametrize(
    ("probability", "percent"), [(AFRL_LOW_THRESHOLD, 0.045), (AFRL_HIGH_THRESHOLD, 0.01)]
)
def test_share_of_frames_is_the_published_one(probability, percent):
    frames = 1_000_000
    draws = np.random.Generator(np.random.PCG64(11)).random(frames)
    expected = frames * percent / 100
    alarms = np.count_nonzero(false_alarm_in_frame(draws, probability))
    assert abs(alarms - expected) < 4 * math.sqrt(expected)


def test_never_and_always():
    draws = np.array([0.0, 0.5, 1 - 2**-53])
    assert not false_alarm_in_frame(draws, 0.0).any()
    assert false_alarm_in_frame(draws, 1.0).all()


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
        (lambda: false_alarm_in_frame(0.5, 1.5), "false_alarm_probability is 1.5"),
        (lambda: false_alarm_in_frame(1.0, 0.5), "uniform is 1"),
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
