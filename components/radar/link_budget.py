"""The link budget: the echo of a target of given RCS at a given range."""

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
    not_negative,
    positive,
    refuse,
    unflatten,
)
from components.radar.radar_equation import (
    SMALLEST_MINIMUM_RANGE_M,
    checked_minimum_range,
    echo_snr,
    radar_constant,
    snr,
    wavelength,
)
from components.radar.required_snr import required_snr

__all__ = [
    "LinkBudget",
    "calibrated_bandwidth",
    "detection_range",
    "radar_constant",
    "snr",
    "wavelength",
    "with_bandwidth",
]


@dataclass(frozen=True)
class LinkBudget:
    """Describe one radar's link budget; all gains in dB, everything else in SI units.

    Parameters
    ----------
    power_w, antenna_gain_db, bandwidth_hz
        As for `radar_constant`.
    wavelength_m, frequency_hz : float, optional
        Exactly one of the two.
    integration_gain_db, noise_figure_db, losses_db
        As for `radar_constant`; 0 dB each unless given.
    minimum_range_m : float, optional
        Closer than this no echo is processed (SNR 0). Unless given, the start of the antenna's
        far field, 2 D²/λ with D the diameter of a circular aperture of this gain:
        2 G λ / pi², 1.5 m for the 29.5 dB antenna at 35 GHz. A pulse radar is blind up to half
        its pulse length, which is usually farther: set it then.

    Raises
    ------
    ValueError
        If a quantity is not above 0 or not finite, or not exactly one of wavelength and frequency
        is given.
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
            positive("frequency_hz", self.frequency_hz)
        if self.minimum_range_m is not None:
            checked_minimum_range(self.minimum_range_m)
        positive("constant_m2", self.constant_m2)

    @property
    def wavelength(self) -> float:
        """Wavelength in metres, given or from the frequency."""
        if self.wavelength_m is not None:
            return self.wavelength_m
        return float(wavelength(self.frequency_hz if self.frequency_hz is not None else 0.0))

    @cached_property
    def constant_m2(self) -> float:
        """`radar_constant` of this budget, m²."""
        return radar_constant(
            power_w=self.power_w,
            antenna_gain_db=self.antenna_gain_db,
            wavelength_m=self.wavelength,
            bandwidth_hz=self.bandwidth_hz,
            integration_gain_db=self.integration_gain_db,
            noise_figure_db=self.noise_figure_db,
            losses_db=self.losses_db,
        )

    @cached_property
    def nearest_m(self) -> float:
        """The minimum range in use: given, or the start of the antenna's far field."""
        if self.minimum_range_m is not None:
            return self.minimum_range_m
        far_field_m = 2.0 * 10.0 ** (self.antenna_gain_db / 10.0) * self.wavelength / math.pi**2
        return max(far_field_m, SMALLEST_MINIMUM_RANGE_M)

    def snr(self, range_m: ArrayLike, rcs_m2: ArrayLike) -> Any:
        """Return the SNR at a slant range for an RCS; see `components.radar.radar_equation.snr`."""
        return snr(range_m, rcs_m2, constant_m2=self.constant_m2, minimum_range_m=self.nearest_m)

    def snr_of_cells(self, range_m: FloatArray, rcs_m2: FloatArray) -> FloatArray:
        """Return the same for flat arrays of one shape that are known to be 0 or more."""
        return echo_snr(range_m, rcs_m2, self.constant_m2, self.nearest_m)

    def range_for_snr(self, snr: ArrayLike, rcs_m2: ArrayLike) -> Any:
        """Return the slant range in metres at which the radar equation gives an SNR.

        The equation alone: where the result is below `nearest_m`, the radar processes no echo.

        Parameters
        ----------
        snr : array_like
            Linear power ratio, above 0.
        rcs_m2 : array_like, m²
            0 or more; broadcasts with `snr`.

        Returns
        -------
        array of the broadcast shape, m

        Raises
        ------
        ValueError
            If an argument is out of range.
        """
        shape, (ratio, rcs) = broadcast_flat(
            snr=positive("snr", snr), rcs_m2=not_negative("rcs_m2", rcs_m2)
        )
        with np.errstate(under="ignore", over="ignore"):  # ends of the number range
            fourth = self.constant_m2 * rcs / ratio
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

    The thesis gives no bandwidth; it follows from one known detection range. The budget's own
    bandwidth does not matter; `with_bandwidth` puts the result in.

    Parameters
    ----------
    budget : LinkBudget
    rcs_dbsm : float, dB above 1 m²
    range_km : float, km
        Not closer than the budget's minimum range.
    pd : float
        Above the false-alarm probability, below 1.
    pulses, false_alarm_probability, model
        As for `components.radar.detection.detection_probability`.

    Returns
    -------
    float
        Hz

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    The SNR required comes from `required_snr` (root finding); SNR times bandwidth is a constant.
    """
    range_m = float(positive("range_km", range_km)) * 1000.0
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
    """Return the same budget with another bandwidth."""
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
    """Return the slant range in metres at which a target of given RCS has Pd `pd`.

    Parameters
    ----------
    budget : LinkBudget
    rcs_m2 : array_like, m²
        Above 0.
    pd, pulses, false_alarm_probability, model
        As for `calibrated_bandwidth`.

    Returns
    -------
    array of the shape of `rcs_m2`, m

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    rcs = positive("rcs_m2", rcs_m2)
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
