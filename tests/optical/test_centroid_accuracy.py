"""The accuracy of a target's centre against the information in a picture's pixels."""

import numpy as np
import pytest

from components.optical.detector import centroid_variance


def bound(signal: float, spread: float) -> float:
    """Return the Cramér-Rao bound of a Gaussian spot's place, pixel by pixel, in unit noise.

    It is averaged over where the spot lies within a pixel; signal, level and both places of the
    spot are unknown together, and only the place across is asked for.
    """
    half = int(6 * spread + 6)
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    bounds = []
    for dx in np.linspace(-0.5, 0.5, 5):
        for dy in np.linspace(-0.5, 0.5, 5):
            spot = np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / (2 * spread**2)) / (
                2 * np.pi * spread**2
            )
            slopes = [signal * spot * (x - dx) / spread**2, signal * spot * (y - dy) / spread**2,
                      spot, np.ones(spot.shape)]  # fmt: skip
            flat = np.array([slope.ravel() for slope in slopes])
            bounds.append(np.linalg.inv(flat @ flat.T)[0, 0])
    return float(np.mean(bounds))


@pytest.mark.parametrize("blur", [0.5, 0.8, 2.0])
@pytest.mark.parametrize("pixels", [0.2, 1.0, 9.0, 40.0])
def test_no_picture_tells_more_and_the_formula_is_near(blur, pixels):
    spread2 = blur**2 + (pixels + 1.0) / 12.0
    signal = 60.0 * spread2
    stated = centroid_variance(np.array([pixels]), np.array([signal / pixels]), blur)[0]
    assert np.sqrt(stated / bound(signal, np.sqrt(spread2))) == pytest.approx(1.0, rel=0.05)


def test_a_faint_target_is_somewhere_on_its_pixels():
    pixels = np.array([0.0, 0.5, 4.0, 4.0])
    found = centroid_variance(pixels, np.array([3.0, 1e-6, 1e-6, 1e3]), 0.5)
    np.testing.assert_allclose(found[:3], (pixels[:3] + 1.0) / 12.0)
    assert found[3] < 1e-4


def test_bad_arguments_are_named():
    one = np.ones(1)
    for arguments, said in (
        ((-one, one, 0.5), "pixels"), ((one, -one, 0.5), "contrast"), ((one, one, 0.0), "blur"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            centroid_variance(*arguments)
