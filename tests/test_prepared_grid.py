"""A prepared grid rounds as `round_to_grid` does, to the bit."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.grid import Grid, round_to_grid

STEPS = st.sampled_from([0.0, math.radians(1.0), 6.25e-4, 76.2, 0.1, 1e-9])
VALUES = st.lists(
    st.floats(-1e300, 1e300) | st.integers(-9, 9).map(float) | st.floats(-4, 4), max_size=9
)


@settings(derandomize=True, max_examples=200)
@given(values=VALUES, step=STEPS, half=st.booleans())
def test_rounds_like_the_function(values, step, half):
    array = np.array(values, dtype=np.float64)
    if half and step:
        array = np.concatenate([array, (np.arange(-6, 6) + 0.5) * step])
    assert np.array_equal(Grid(step).round(array), round_to_grid(array, step))
    limits = {"limit_low": -1.9198621771937625, "limit_high": 1.9198621771937625}
    if step < 1.0:
        got = Grid(step, **limits).round(array)
        assert np.array_equal(got, round_to_grid(array, step, **limits))
        assert not np.signbit(got[got == 0.0]).any()
