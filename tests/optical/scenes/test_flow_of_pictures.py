"""The flow of rendered targets against their true pixels, over several seeds."""

import numpy as np
import pytest

from docs.make.pictures.flow import flow_errors


def test_targets_of_three_pixels_flow_as_they_move():
    pixels, off, deviation, moved = flow_errors(range(4), 0.02, 0.0)
    large = pixels >= 3.0
    assert large.sum() > 500 and moved[large].max() > 100.0
    told = large & np.isfinite(off)
    assert told.sum() > 0.99 * large.sum()
    assert np.quantile(off[told], 0.99) < 0.1 and off[told].max() < 0.5
    # Two axes of the stated deviation: 2 would be honest to the last digit.
    assert 0.8 < np.mean((off / deviation)[told] ** 2) < 2.6


@pytest.mark.parametrize(("noise", "texture"), [(0.05, 0.0), (0.01, 0.02), (0.01, 0.05)])
def test_a_flow_that_is_bad_says_so(noise, texture):
    """In noise and clutter: within 0.1 pixel where it says that it is; and no misfit is told."""
    pixels, off, deviation, _ = flow_errors(range(3), noise, texture)
    told = np.isfinite(off)
    assert told.sum() > 500 and np.max(off[told]) < 1.0
    sure = told & (pixels >= 3.0) & (deviation < 0.1 / 2.45)
    assert sure.sum() > 50
    assert np.quantile(off[sure], 0.95) < 0.1
    ratio = (off / deviation)[told & (pixels >= 3.0)]
    assert np.mean(ratio**2) < 4.0 and np.median(ratio) > 0.3
