"""The radar equation and the link budget: the SNR of a target of given RCS at a given range."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.aspect_tables import dbsm_to_m2
from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_positive,
    refuse,
    unflatten,
)
from components.arguments.units import SPEED_OF_LIGHT_M_S
from components.radar.detection.probability import required_snr

BOLTZMANN_J_K = 1.380649e-23
REFERENCE_TEMPERATURE_K = 290.0

LARGEST_DB = 300.0
_LARGEST = float(np.finfo(np.float64).max)
SMALLEST_MINIMUM_RANGE_M = 1e-3


def wavelength(frequency_hz: ArrayLike) -> Any:
    """Return the wavelength in metres of a frequency in hertz."""
    return SPEED_OF_LIGHT_M_S / check_positive("frequency_hz", frequency_hz)[()]


@dataclass(frozen=True)
class LinkBudget:
    """One radar's link budget; all gains in dB, everything else in SI units.

    Exactly one of wavelength and frequency is given. Closer than `minimum_range_m` no echo is
    processed (SNR 0): unless given, the start of the antenna's far field, 2 D²/λ with D the
    diameter of a circular aperture of this gain: 2 G λ / pi², 1.5 m for the 29.5 dB antenna at 35
    GHz. A pulse radar is blind up to half its pulse length, which is usually farther: set it then.
    """

    power_w: float
    antenna_gain_db: float
    bandwidth_hz: float
    wavelength_m: float | None = None
    frequency_hz: float | None = None
    integration_gain_db: float = 0.0
    noise_figure_db: float = 0.0
    losses_db: float = 0.0
    minimum_range_m: float | None = None

    def __post_init__(self) -> None:
        if (self.wavelength_m is None) == (self.frequency_hz is None):
            raise ValueError(
                f"wavelength_m is {self.wavelength_m} and frequency_hz is {self.frequency_hz}: "
                "exactly one of them must be given"
            )
        if self.frequency_hz is not None:
            check_positive("frequency_hz", self.frequency_hz)
        if self.minimum_range_m is not None:
            nearest = float(check_positive("minimum_range_m", self.minimum_range_m))
            if nearest < SMALLEST_MINIMUM_RANGE_M:
                raise ValueError(f"minimum_range_m is {nearest:g}: it must be at least 0.001")
        check_positive("constant_m2", self.snr_constant_m2)

    @property
    def wavelength(self) -> float:
        """Wavelength in metres, given or from the frequency."""
        if self.wavelength_m is not None:
            return self.wavelength_m
        return float(wavelength(self.frequency_hz if self.frequency_hz is not None else 0.0))

    @cached_property
    def snr_constant_m2(self) -> float:
        """Factor that gives the SNR when multiplied by RCS / range⁴, m².

        Pt G² λ² G_I / ((4 pi)³ k T0 F B L) with T0 = 290 K and one antenna for both ways: thesis
        eq. 7 and 8, completed by the coherent integration gain G_I, the noise figure F and the
        losses L, which Table 2.2 lists (G_I, F) or forgets (L). Pulses that G_I counts are not to
        be counted again as `pulses`.
        """
        wavelength_m = self.wavelength
        check_positive("power_w", self.power_w)
        check_positive("wavelength_m", wavelength_m)
        check_positive("bandwidth_hz", self.bandwidth_hz)
        for name in ("antenna_gain_db", "integration_gain_db", "noise_figure_db", "losses_db"):
            value = float(check_finite(name, getattr(self, name)))
            if not abs(value) <= LARGEST_DB:
                raise ValueError(f"{name} is {value:g}: it must lie in ±{LARGEST_DB:g} dB")
        gain_db = 2.0 * self.antenna_gain_db + self.integration_gain_db
        total_db = gain_db - self.noise_figure_db - self.losses_db
        noise_w = BOLTZMANN_J_K * REFERENCE_TEMPERATURE_K * self.bandwidth_hz
        return (
            self.power_w
            * wavelength_m
            * wavelength_m
            * 10.0 ** (total_db / 10.0)
            / ((4.0 * math.pi) ** 3 * noise_w)
        )

    @cached_property
    def nearest_m(self) -> float:
        """The minimum range in use: given, or the start of the antenna's far field."""
        if self.minimum_range_m is not None:
            return self.minimum_range_m
        far_field_m = 2.0 * 10.0 ** (self.antenna_gain_db / 10.0) * self.wavelength / math.pi**2
        return max(far_field_m, SMALLEST_MINIMUM_RANGE_M)

    def snr(self, range_m: ArrayLike, rcs_m2: ArrayLike) -> Any:
        """Return the SNR per look (linear) at slant ranges for RCSs, 0 closer than `nearest_m`."""
        shape, (distance, rcs) = broadcast_flat(
            range_m=check_not_negative("range_m", range_m),
            rcs_m2=check_not_negative("rcs_m2", rcs_m2),
        )
        return unflatten(self.snr_of_cells(distance, rcs), shape)

    def snr_of_cells(self, range_m: FloatArray, rcs_m2: FloatArray) -> FloatArray:
        """Return the linear SNR for flat arrays of equal shape and valid values.

        Closer than `nearest_m` the far-field equation does not hold and the receiver is still
        blind from its own pulse.
        """
        nearest = self.nearest_m
        near = range_m < nearest
        safe = np.where(near, nearest, range_m)
        # Both factors are divided by the square: neither the fourth power of a large range nor
        # their product overflows on the way. An echo from the end of the number range is 0.
        with np.errstate(under="ignore", over="ignore"):
            square = safe * safe
            echo = (self.snr_constant_m2 / square) * (rcs_m2 / square)
        return np.where(near, 0.0, np.minimum(echo, _LARGEST))

    def range_for_snr(self, snr: ArrayLike, rcs_m2: ArrayLike) -> Any:
        """Return the slant range in metres at which the radar equation gives an SNR.

        The equation alone: where the result is below `nearest_m`, the radar processes no echo.
        """
        shape, (ratio, rcs) = broadcast_flat(
            snr=check_positive("snr", snr), rcs_m2=check_not_negative("rcs_m2", rcs_m2)
        )
        with np.errstate(under="ignore", over="ignore"):  # ends of the number range
            fourth = self.snr_constant_m2 * rcs / ratio
        return unflatten(np.sqrt(np.sqrt(fourth)), shape)


def calibrated_bandwidth(
    budget: LinkBudget,
    *,
    rcs_dbsm: float,
    range_km: float,
    pd: float,
    pulses: int = 1,
    false_alarm_probability: float,
    model: str = "swerling1",
) -> float:
    """Return the bandwidth in hertz with which the radar has Pd `pd` for a target at a range.

    The thesis gives no bandwidth; it follows from one known detection range, as SNR times bandwidth
    is a constant. The budget's own bandwidth does not matter; `with_bandwidth` puts the result in.
    """
    range_m = float(check_positive("range_km", range_km)) * 1000.0
    if range_m < budget.nearest_m:
        raise ValueError(
            f"range_km is {range_km:g}: it must be at least the budget's minimum range, "
            f"{budget.nearest_m / 1000:g} km"
        )
    needed = required_snr(
        pd, pulses=pulses, false_alarm_probability=false_alarm_probability, model=model
    )
    return float(budget.snr(range_m, dbsm_to_m2(rcs_dbsm))) * budget.bandwidth_hz / needed


def with_bandwidth(budget: LinkBudget, bandwidth_hz: float) -> LinkBudget:
    """Return the link budget with another bandwidth."""
    return replace(budget, bandwidth_hz=bandwidth_hz)


def detection_range(
    budget: LinkBudget,
    rcs_m2: ArrayLike,
    *,
    pd: float,
    pulses: int = 1,
    false_alarm_probability: float,
    model: str = "swerling1",
) -> Any:
    """Return the slant range in metres at which a target of given RCS has Pd `pd`."""
    rcs = check_positive("rcs_m2", rcs_m2)
    needed = required_snr(
        pd, pulses=pulses, false_alarm_probability=false_alarm_probability, model=model
    )
    distance = np.asarray(budget.range_for_snr(needed, rcs))
    refuse(
        "rcs_m2",
        rcs,
        distance < budget.nearest_m,
        f"be large enough to have Pd {pd:g} beyond the minimum range, {budget.nearest_m:g} m",
    )
    return distance[()]


#: Key → least and largest value of radars that were built, and the unit.
_RANGES = {
    "frequency_hz": (3e6, 3e11, "Hz"),
    "wavelength_m": (1e-3, 100.0, "m"),
    "power_w": (1e-4, 1e8, "W"),
    "antenna_gain_db": (-3.0, 75.0, "dB"),
    "noise_figure_db": (0.0, 30.0, "dB"),
    "losses_db": (0.0, 50.0, "dB"),
    "integration_gain_db": (0.0, 70.0, "dB"),
    "bandwidth_hz": (1.0, 2e10, "Hz"),
}


_PREFIXES = {1e3: "k", 1e6: "M", 1e9: "G", 1e-3: "m", 1e-6: "µ"}


def implausible_value_warnings(parameters: Any) -> list[str]:
    """Return a warning for each value of a link budget that no radar has, by its key."""
    said = []
    for key, (low, high, unit) in _RANGES.items():
        value = getattr(parameters, key)
        if value is None or low <= value <= high:
            continue
        text = f"{key} is {value:g} {unit}: implausible, radars have {low:g} to {high:g} {unit}"
        said.append(text + _plausible_unit_hint(value, low, high, unit))
    return said


def _plausible_unit_hint(value: float, low: float, high: float, unit: str) -> str:
    """Return a question naming the unit that makes the value plausible, or an empty string."""
    if unit == "dB":
        return ""
    for factor in (1e9, 1e6, 1e3, 1e-3, 1e-6):
        # Amid the range, not just inside it.
        if value > 0 and 10.0 * low <= value * factor <= high:
            return f" (is it {value:g} {_PREFIXES[factor]}{unit}, {value * factor:g} {unit}?)"
    return ""


#: Gain times beamwidths in square degrees.
GAIN_TIMES_BEAM = 30_000.0
MOST_GAIN_DISAGREEMENT_DB = 3.0


def antenna_gain_from_beam_db(azimuth_deg: float | None, elevation_deg: float | None) -> float:
    """Return the antenna gain that two beamwidths imply, dB; 0 dB if one is not known."""
    if not (azimuth_deg and elevation_deg):
        return 0.0
    return max(0.0, 10.0 * math.log10(GAIN_TIMES_BEAM / (azimuth_deg * elevation_deg)))


def beam_gain_warnings(parameters: Any) -> list[str]:
    """Return a warning where beam width and antenna gain contradict each other by over 3 dB.

    A gain of 30,000 over the product of the beamwidths in degrees is that of antennas as they are
    built (M. I. Skolnik, Introduction to Radar Systems, 3rd ed., section 9.2, has 26,000; C. A.
    Balanis, Antenna Theory, section 2.6, 30,000).
    """
    p = parameters
    widths_deg = p.azimuth_beamwidth_deg, p.elevation_beamwidth_deg
    whose = "azimuth_beamwidth_deg and elevation_beamwidth_deg are"
    if p.azimuth_beamwidth_deg is None:
        widths_deg = p.azimuth_resolution_deg, p.elevation_resolution_deg
        whose = "no beamwidths are given, and the grid that stands for the beam is"
    azimuth_deg, elevation_deg = widths_deg
    if p.antenna_gain_db is None or not (azimuth_deg and elevation_deg):
        return []
    gain_db = 10.0 * math.log10(GAIN_TIMES_BEAM / (azimuth_deg * elevation_deg))
    if abs(gain_db - p.antenna_gain_db) <= MOST_GAIN_DISAGREEMENT_DB:
        return []
    alike_deg = math.sqrt(GAIN_TIMES_BEAM / 10.0 ** (0.1 * p.antenna_gain_db))
    return [
        f"antenna_gain_db is {p.antenna_gain_db:g}, which is a beam of {alike_deg:.3g} x "
        f"{alike_deg:.3g} deg, and {whose} {azimuth_deg:g} x {elevation_deg:g} deg, which is "
        f"{gain_db:.3g} dB: clutter, false alarms and what is told apart go by the beam"
    ]
