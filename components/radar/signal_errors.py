"""What a radar's errors of measurement follow from, where a scene wants them by signal."""

import math
from typing import Any

from components.radar.measurement_accuracy import (
    angle_variance,
    range_rate_variance,
    range_variance,
)
from components.radar.radar_equation import wavelength
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import Disagreements


def heard(snr: FloatArray, cnr: FloatArray | None) -> dict[str, FloatArray]:
    """Return what a look's errors follow from: a pulse's signal over noise and clutter.

    Parameters
    ----------
    snr, cnr : (cells,) arrays
        Ratios to noise, linear; `cnr` is None where there is no clutter.

    Notes
    -----
    It is the SNR that the decision rested on and that is recorded: the mean one of a fluctuating
    target, or that of its sampled cross-section. A radar knows it from the height of the echo, to
    about 1 dB where it detects. As errors are drawn by the same number, variances are honest.
    """
    return {"snr": snr if cnr is None else snr / (1.0 + cnr)}


def signal_variances(p: Any, snr: FloatArray) -> dict[str, FloatArray]:
    """Return the variances of what a radar measures, by quantity.

    Parameters
    ----------
    p : LinkBudgetParameters
    snr : (n,) array
        Of a pulse.

    Returns
    -------
    dict of (n,) arrays
        In radians, metres and m/s, squared.
    """
    ratio = p.pulses_summed * snr
    variances = {
        angle: angle_variance(math.radians(width_deg), ratio, method=p.angle_measurement)
        for angle, width_deg in (
            ("azimuth", p.azimuth_beamwidth_deg),
            ("elevation", p.elevation_beamwidth_deg),
        )
    }
    variances["range"] = range_variance(p.range_resolution_m, ratio)
    if (step := _range_rate_resolution_m_s(p)) is not None and p.measures_range_rate:
        variances["range_rate"] = range_rate_variance(step, ratio)
    return variances


def check_signal_errors(p: Any) -> None:
    """Refuse errors by signal of a radar whose beam or resolution is not known.

    Raises
    ------
    ValueError
    """
    if p.errors != "signal":
        return
    wrong = [
        f"errors is 'signal' and {key} is not given: errors of angles are a share of the beam"
        for key in ("azimuth_beamwidth_deg", "elevation_beamwidth_deg")
        if getattr(p, key) is None
    ]
    if not p.range_resolution_m:
        wrong.append(
            "errors is 'signal' and range_resolution_m is 0: errors of range are a share of it, it "
            "must be above 0"
        )
    if p.measures_range_rate and _range_rate_resolution_m_s(p) is None:
        wrong.append(
            "errors is 'signal', measures_range_rate is true and neither "
            "range_rate_resolution_m_s nor the time of a look (dwell_s, or pulses_per_dwell and "
            "prf_hz) is given: errors of range rate are a share of what Doppler resolves"
        )
    Disagreements.refuse(wrong)


def _range_rate_resolution_m_s(p: Any) -> float | None:
    """Return the range rate that Doppler resolves, of its own or by the time of a look."""
    if p.range_rate_resolution_m_s:
        return float(p.range_rate_resolution_m_s)
    look = p.look_energy
    dwell_s = p.stated_dwell_s if look is None else look.dwell_s
    if not dwell_s:
        return None
    wavelength_m = p.wavelength_m or wavelength(p.frequency_hz)
    return float(wavelength_m / (2.0 * dwell_s))
