"""The accuracy of a radar's measurements by its signal-to-noise ratio.

The relations are those of a maximum-likelihood estimate in thermal noise: the width of what is
resolved over the square root of the energy ratio, 2 E / N0 = 2 n S/N for n pulses. They hold where
the signal is well above noise, from about S/N = 10 dB on (Curry); below, an estimate is now and
then somewhere else in the cell, and the relations promise too much. An error here is never larger
than that of somewhere in the beam or cell: the variance stops at width²/12. So between some
4 dB, where an angle's relation reaches that limit, and 10 dB it is too small, by a factor that no
closed form gives.
"""

import numpy as np

from components.arguments.checks import FloatArray, not_negative, positive

#: Slope of the difference pattern over the sum pattern, in beamwidths (Barton).
MONOPULSE_SLOPE = 1.6
#: Of a beam that scans over the target, and what its pattern takes from the pulses' energy.
SCAN_SLOPE = 1.66
SCAN_BEAMSHAPE_LOSS = 1.33
#: A measurement is somewhere in its cell.
_UNIFORM = 1.0 / 12.0


def angle_variance(
    beamwidth_rad: float, energy_ratio: FloatArray, *, method: str = "monopulse"
) -> FloatArray:
    """Return the variance of an angle measured with one beam or a pair of them.

    Parameters
    ----------
    beamwidth_rad : float
        One-way half-power beamwidth, above 0.
    energy_ratio : (n,) array
        S/N of a pulse times the number of pulses, linear, 0 or more.
    method : {"monopulse", "scan"}

    Returns
    -------
    (n,) array, rad²
        At most beamwidth²/12.

    Raises
    ------
    ValueError
        If an argument is out of range or the method is unknown.

    Notes
    -----
    ``monopulse``: sigma = beamwidth / (k_m sqrt(2 n S/N)), k_m = 1.6, of a target near the axis.
    ``scan``: sigma = beamwidth / (k sqrt(2 n S/N / L_p)), k = 1.66, L_p = 1.33 the beamshape loss.
    Barton & Leonov, Radar Technology Encyclopedia, Artech House 1997, "accuracy of monopulse,
    fundamental" and "accuracy of sequential lobing, fundamental"; Curry, Radar System Performance
    Modeling, 2nd ed., Artech House 2005, section 8.2, has the former.
    """
    width = float(positive("beamwidth_rad", beamwidth_rad))
    ratio = _ratio(energy_ratio)
    if method == "monopulse":
        return _limited(width, ratio, MONOPULSE_SLOPE)
    if method == "scan":
        return _limited(width, ratio / SCAN_BEAMSHAPE_LOSS, SCAN_SLOPE)
    raise ValueError(f"method is {method!r}: it must be 'monopulse' or 'scan'")


def range_variance(range_resolution_m: float, energy_ratio: FloatArray) -> FloatArray:
    """Return the variance of a range measured with a resolution.

    Parameters
    ----------
    range_resolution_m : float
        c / 2B, above 0.
    energy_ratio : (n,) array
        As for `angle_variance`.

    Returns
    -------
    (n,) array, m²
        At most resolution²/12.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    sigma = resolution / sqrt(2 n S/N): Curry, section 8.1; Mahafza, Radar Systems Analysis and
    Design Using MATLAB, has it with the rms bandwidth. That of a flat spectrum of width B, by
    Skolnik, Theoretical accuracy of radar measurements, IRE Trans. ANE-7, 1960, would be smaller
    by sqrt(3) / pi, which a receiver with weighting does not reach.
    """
    return _limited(float(positive("range_resolution_m", range_resolution_m)), _ratio(energy_ratio))


def range_rate_variance(range_rate_resolution_m_s: float, energy_ratio: FloatArray) -> FloatArray:
    """Return the variance of a range rate measured by its Doppler shift.

    Parameters
    ----------
    range_rate_resolution_m_s : float
        Wavelength / (2 coherent time), above 0.
    energy_ratio : (n,) array
        As for `angle_variance`.

    Returns
    -------
    (n,) array, m²/s²
        At most resolution²/12.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    sigma = resolution / sqrt(2 n S/N): Curry, section 8.3.
    """
    step = float(positive("range_rate_resolution_m_s", range_rate_resolution_m_s))
    return _limited(step, _ratio(energy_ratio))


def _ratio(energy_ratio: FloatArray) -> FloatArray:
    ratio: FloatArray = np.asarray(not_negative("energy_ratio", energy_ratio))
    return ratio


def _limited(width: float, ratio: FloatArray, slope: float = 1.0) -> FloatArray:
    least = 1.0 / (2.0 * slope**2 * _UNIFORM)
    variance: FloatArray = width**2 / (2.0 * slope**2 * np.maximum(ratio, least))
    return variance
