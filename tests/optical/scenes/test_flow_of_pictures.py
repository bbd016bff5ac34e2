"""The flow of rendered targets against their true pixels, over several seeds."""

import numpy as np
import pytest

from docs.make.pictures.flow import RADIUS_95, flow_errors


def test_targets_of_three_pixels_flow_as_they_move():
    pixels, off, deviation, moved = flow_errors(range(2), 0.02, 0.0)
    large = pixels >= 3.0
    assert large.sum() > 500 and moved[large].max() > 100.0
    told = large & np.isfinite(off)
    assert told.sum() > 0.99 * large.sum()
    assert np.quantile(off[told], 0.99) < 0.1 and off[told].max() < 0.5
    # Two axes of the stated deviation: 2 would be honest to the last digit.
    assert 0.8 < np.mean((off / deviation)[told] ** 2) < 2.6


@pytest.mark.parametrize(
    ("noise", "texture", "seeds"),
    [(0.05, 0.0, 3), (0.01, 0.05, 2), (0.02, 0.1, 2)],
)
def test_a_flow_that_is_bad_says_so(noise, texture, seeds):
    """In noise and clutter 95 % are as good as they say, of each size; and no gross misfit is told.

    Within 0.1 pixel where they say that they are.
    """
    pixels, off, deviation, _ = flow_errors(range(seeds), noise, texture)
    told = np.isfinite(off)
    assert told.sum() > 500 and np.max(off[told]) < 0.6
    sure = told & (pixels >= 3.0) & (deviation < 0.1 / RADIUS_95)
    assert sure.sum() > (50 if noise == 0.01 else 5)  # else few are that good
    assert np.quantile(off[sure], 0.95) < 0.1
    for low, high in ((3, 12), (12, 40), (40, np.inf)):
        mine = told & (pixels >= low) & (pixels < high)
        ratio = off[mine] / deviation[mine]
        assert mine.sum() > 100 and np.mean(ratio < RADIUS_95) >= 0.95 and ratio.max() < 5.0
        assert np.median(ratio) > 0.2
