"""The accuracy with which a camera finds the centre of a target, by its pixels and contrast."""

import numpy as np

from components.arguments.checks import FloatArray, not_negative, positive

_PIXEL_VARIANCE = 1.0 / 12.0


def centroid_variance(
    pixels: FloatArray, contrast_to_noise: FloatArray, blur_pixels: float
) -> FloatArray:
    """Return the variance of a target's centre along one axis of the picture.

    Parameters
    ----------
    pixels : (n,) array
        Pixels that the target covers, 0 or more; less than 1 is a target smaller than a pixel.
    contrast_to_noise : (n,) array
        Signal of a pixel that it fills over the noise of a pixel, 0 or more.
    blur_pixels : float
        Standard deviation of the blur of optics and motion, above 0.

    Returns
    -------
    (n,) array, pixels²
        At most that of a centre that may be anywhere on the target: (pixels + 1) / 12.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    sigma² = 8 pi s⁴ / N², where N is the target's whole signal over the noise of a pixel and s²
    the variance of its picture: that of the blur, of a square of as many pixels, and of a pixel,
    1/12. Thompson, Larson & Webb, Precise nanometer localization analysis for individual
    fluorescent probes, Biophysical Journal 82, 2002, eq. 14, its term for background noise. It is
    the bound of Winick, Cramér-Rao lower bounds on the performance of charge-coupled-device optical
    position estimators, JOSA A 3, 1986, for a Gaussian spot. It holds where N is well above the
    noise within the spot, N > 10 s, and the blur is half a pixel or more; a sharper spot falls
    between pixels, and a target of many pixels with sharp edges is found better than this.
    """
    covered = np.asarray(not_negative("pixels", pixels))
    ratio = np.asarray(not_negative("contrast_to_noise", contrast_to_noise))
    blur = float(positive("blur_pixels", blur_pixels))
    spread = blur**2 + _PIXEL_VARIANCE * covered + _PIXEL_VARIANCE
    most = _PIXEL_VARIANCE * (covered + 1.0)
    signal2 = (covered * ratio) ** 2
    least2 = 8.0 * np.pi * spread**2 / most
    variance: FloatArray = 8.0 * np.pi * spread**2 / np.maximum(signal2, least2)
    return variance
