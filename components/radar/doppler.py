"""Doppler processing: what a moving-target filter leaves of a target and of the clutter.

A filter adds up successive pulses with weights w. Of an echo whose phase turns at f Hz it lets
through the power ``|H(f)|² = sum over lags m of r(m) cos(2 pi m f / PRF)``, r the autocorrelation
of the weights; of clutter whose spectrum is Gaussian with mean f and standard deviation s, each lag
loses its correlation ``exp(-2 (pi m s / PRF)²)``. Both are exact, so blind speeds, notch and the
residue of clutter follow from one formula.

- *single canceller*, weights 1, -1; *double canceller*, weights 1, -2, 1. Noise passes both, so
  powers are counted over the noise's: a target of unknown speed keeps its SNR on average.
- *filter bank*, the discrete Fourier transform of N pulses weighted by Hamming's window. Filters
  in the notch are not used; a target is looked for in the nearest that is. Powers are counted over
  those of N pulses added in phase, so the loss of the window is in them.

Sources: M. I. Skolnik, Introduction to Radar Systems, 3rd ed., sections 3.2-3.7; F. E. Nathanson,
Radar Design Principles, 2nd ed., chapter 9; M. A. Richards, Fundamentals of Radar Signal
Processing, 2nd ed., sections 5.2-5.5. The spread by the platform's motion is Skolnik's
(section 3.7), of a Gaussian beam.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_numbers,
    check_one_of,
    check_positive,
    refuse,
    unflatten,
)
from components.geometry import POSITION_FIELDS, north_east_up_offsets_m
from components.radar.ground_clutter import Echo, terrain_of
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict

FILTERS = ("single_canceller", "double_canceller", "filter_bank")
FEWEST_PULSES, MOST_PULSES = 8, 256

_WEIGHTS = {"single_canceller": (1.0, -1.0), "double_canceller": (1.0, -2.0, 1.0)}


@dataclass(frozen=True)
class MovingTargetFilter:
    """A moving-target filter of one radar, of one of the `FILTERS`.

    The filter bank has 8 to 256 pulses (the cancellers 2 and 3). Of its filters those whose centres
    are nearer to the clutter than `notch_m_s` are not used, and the one at the clutter never; by
    default two filters' spacing, the half width of the window's main lobe.
    """

    kind: str
    prf_hz: float
    wavelength_m: float
    pulses: int = 16
    notch_m_s: float | None = None

    def __post_init__(self) -> None:
        check_one_of("kind", self.kind, FILTERS)
        check_positive("prf_hz", self.prf_hz)
        check_positive("wavelength_m", self.wavelength_m)
        if self.notch_m_s is not None:
            check_not_negative("notch_m_s", self.notch_m_s)
        if not FEWEST_PULSES <= self.pulses <= MOST_PULSES:
            raise ValueError(
                f"pulses is {self.pulses}: it must be from {FEWEST_PULSES} to {MOST_PULSES}"
            )
        if self.kind == "filter_bank" and not len(self._usable_filter_centres):
            raise ValueError(
                f"notch_m_s is {self.notch_m_s:g}: it leaves no filter of the {self.pulses} "
                f"between the clutter and {self.unambiguous_range_rate_m_s:g} m/s, the "
                f"unambiguous velocity"
            )

    @property
    def blind_speed_m_s(self) -> float:
        """First blind speed λ·PRF/2: there and at its multiples a target looks like the clutter."""
        return 0.5 * self.wavelength_m * self.prf_hz

    @property
    def unambiguous_range_rate_m_s(self) -> float:
        """Largest unambiguous range rate, λ·PRF/4, m/s."""
        return 0.25 * self.wavelength_m * self.prf_hz

    @property
    def _usable_filter_centres(self) -> FloatArray:
        """The bank's used filters' centre frequencies, fractions of the PRF in [-1/2, 1/2)."""
        number = np.arange(self.pulses) - self.pulses // 2
        centre = number / self.pulses
        notch = 2.0 / self.pulses
        if self.notch_m_s is not None:
            notch = self.notch_m_s / self.blind_speed_m_s
        outside = np.abs(centre) >= notch * (1.0 - 1e-12)
        return np.asarray(centre[outside & (number != 0)])

    def target_and_clutter_gains(
        self,
        target_m_s: ArrayLike,
        clutter_m_s: ArrayLike = 0.0,
        spread_m_s: ArrayLike = 0.0,
    ) -> tuple[Any, Any]:
        """Return the filter's power gains for targets, and for clutter in the same filter.

        Factors of the power over noise. Range rates are against the velocity at which the notch
        lies, and `spread_m_s` is the standard deviation of the clutter's.
        """
        shape, (target, clutter, spread) = broadcast_flat(
            target_m_s=check_finite("target_m_s", target_m_s),
            clutter_m_s=check_finite("clutter_m_s", clutter_m_s),
            spread_m_s=check_not_negative("spread_m_s", spread_m_s),
        )
        # Cycles of the echo's phase from pulse to pulse.
        per_m_s = 1.0 / self.blind_speed_m_s
        turn, away, width = target * per_m_s, clutter * per_m_s, spread * per_m_s
        tuned: Any = 0.0
        if self.kind == "filter_bank":
            usable = self._usable_filter_centres
            # The nearest on the circle, the lower one of two as near.
            apart = np.abs(turn[:, np.newaxis] - usable)
            apart = np.abs(apart - np.rint(apart))
            tuned = usable[np.argmin(apart, axis=1)]
        lags = _weight_autocorrelation(self.kind, self.pulses)
        passed = _filter_power_gain(lags, turn - tuned, np.zeros(1))
        residue = _filter_power_gain(lags, away - tuned, width)
        return unflatten(passed, shape), unflatten(residue, shape)

    def improvement_factor(self, spread_m_s: float) -> float:
        """Return the clutter improvement factor: mean gain of targets over that of clutter, linear.

        The clutter's mean lies in the notch. For cancellers and a small spread it is 2 (PRF / 2 pi
        s)² and 2 (PRF / 2 pi s)⁴, with s = 2 spread / λ (Skolnik, section 3.7).
        """
        every = (np.arange(4096) + 0.5) / 4096 * self.blind_speed_m_s
        target, clutter = self.target_and_clutter_gains(every, 0.0, spread_m_s)
        return float(np.mean(target) / np.mean(clutter))


@lru_cache(maxsize=64)
def _weight_autocorrelation(kind: str, pulses: int) -> tuple[float, ...]:
    """Return one-sided autocorrelation of weights over the gain of noise or of a pulse train."""
    if kind in _WEIGHTS:
        weights = np.array(_WEIGHTS[kind])
        over = float(np.sum(weights**2))
    else:
        weights = np.hamming(pulses)
        over = float(pulses * np.sum(weights**2))
    one_sided = np.correlate(weights, weights, "full")[len(weights) - 1 :]
    return tuple((one_sided / over).tolist())


def _filter_power_gain(lags: tuple[float, ...], turn: FloatArray, width: FloatArray) -> FloatArray:
    """Return sum over lags of r(m) exp(-2 (pi m width)²) cos(2 pi m turn), never below 0."""
    # 1 - cos(x) = 2 sin²(x/2) and expm1 keep the digits of a small residue: all lags sum up to
    # the power at turn 0, which is known.
    total = np.full(np.broadcast_shapes(turn.shape, width.shape), lags[0] + 2.0 * sum(lags[1:]))
    if abs(total.flat[0] if total.size else 0.0) < 1e-12:
        total[...] = 0.0
    for m, lag in enumerate(lags[1:], start=1):
        lost = -np.expm1(-2.0 * (math.pi * m * width) ** 2)
        turned = 2.0 * np.sin(math.pi * m * turn) ** 2
        total -= 2.0 * lag * (turned + lost - turned * lost)
    return np.maximum(total, 0.0)


def folded_range_rate(range_rate_m_s: ArrayLike, unambiguous_m_s: ArrayLike) -> Any:
    """Return the range rate that a radar of one PRF takes a range rate for, m/s.

    In [-unambiguous, unambiguous), off by a multiple of twice that; NaN stays NaN.
    """
    limit = check_numbers("unambiguous_m_s", unambiguous_m_s)
    refuse("unambiguous_m_s", limit, ~(limit > 0.0), "be above 0")
    shape, (rate, limit) = broadcast_flat(
        range_rate_m_s=check_numbers("range_rate_m_s", range_rate_m_s), unambiguous_m_s=limit
    )
    return unflatten(np.mod(rate + limit, 2.0 * limit) - limit, shape)


# Ranges this far apart in time: at a passage of 150 m/s at 500 m the rule below errs by 1e-7 m/s,
# as much as the rounding of positions does.
STEP_S = 0.02
#: How far a look reaches beyond its instant.
LASTS_S = 4.0 * STEP_S
#: Points in steps and their weights, of rules of the fourth order: about the instant, and from it
#: on or up to it where a flight begins or ends there.
_CENTRAL = (-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0)
_AHEAD = (0.0, 1.0, 2.0, 3.0, 4.0), (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -1.0 / 4.0)
_BEHIND = tuple(-point for point in _AHEAD[0]), tuple(-weight for weight in _AHEAD[1])


class RangeRates(Protocol):
    """Function that returns the true range rates of some cells."""

    def __call__(self, cells: Cells, detected: IntArray, /) -> FloatArray:
        """Return the range rates of some cells, m/s."""


RANGE_RATE = Hook("range rate", RangeRates, "rate of some cells' slant range, m/s")


def range_rates(cells: Cells, detected: IntArray) -> FloatArray:
    """Return the true range rate of each of the given cells, m/s, positive when the range opens.

    Differences of the range itself over a few hundredths of a second, by the scene's own model of
    the Earth, whatever the two fly. Where one of them changes its velocity at once within that
    time, the rate is between the one before and the one after.
    """
    (rate,) = _rates_of_quantities(cells, detected, lambda seen, times: (seen["range_m"],))
    return rate


class RangeRate(Effect[RangeRates]):
    """Rate of the slant range between the two aircraft, as they fly."""

    name = "range rate"
    acts_on = RANGE_RATE
    flag = "measures_range_rate"
    outside_the_proof = "it fills columns that are null without it"

    def build(self, block: Any) -> RangeRates:
        """Return a function that gives the range rates of some cells."""
        return range_rates


def range_rate_and_own_velocity(
    cells: Cells,
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Return cells' range rates and the ownship's ground velocity (north, east, down), m/s.

    The rate is positive when the range opens, the velocity in the ownship's own north-east-down
    frame.
    """

    def quantities(seen: Mapping[str, Any], times: int) -> tuple[FloatArray, ...]:
        there = [seen[f"own_{name}"] for name in POSITION_FIELDS]
        # From where it is at the first of the times: so near that the frame is the same.
        first = [np.tile(values[: len(values) // times], times) for values in there]
        return (seen["range_m"], *north_east_up_offsets_m(*first, *there))

    rate, north, east, up = _rates_of_quantities(cells, np.arange(len(cells)), quantities)
    return rate, (north, east, -up)


def _rates_of_quantities(
    cells: Cells,
    detected: IntArray,
    quantities: Callable[[Mapping[str, Any], int], tuple[FloatArray, ...]],
) -> list[FloatArray]:
    """Return the time derivatives of the quantities of some cells, by finite differences."""
    rates: list[FloatArray] = []
    missing = np.arange(len(detected))
    for points, weights in (_CENTRAL, _AHEAD, _BEHIND):
        if len(missing) == 0 and rates:
            break
        each, times = detected[missing], len(points)
        ahead_s = np.repeat(np.array(points) * STEP_S, len(each))
        seen = cells.relative_target_fields_ahead(np.tile(each, times), ahead_s)
        for number, values in enumerate(quantities(seen, times)):
            if number == len(rates):
                rates.append(np.full(len(detected), np.nan))
            total = np.zeros(len(each))
            for weight, value in zip(weights, values.reshape(times, -1), strict=True):
                total += weight * value
            rates[number][missing] = total / STEP_S
        missing = missing[~seen["present"].reshape(times, -1).all(axis=0)]
    return rates


_LEAST_GAIN = 1e-30


class DopplerProcessing:
    """One radar's Doppler gains for targets and clutter; called with cells and echoes."""

    def __init__(self, block: Any) -> None:
        p = block.p
        self._filter = MovingTargetFilter(
            p.moving_target_filter, p.prf_hz, block.wavelength_m, p.filter_pulses, p.notch_m_s
        )
        self._locked: bool = p.clutter_lock
        self._limit = 10.0 ** (-0.1 * p.improvement_limit_db)
        self._terrain = terrain_of(block)

    def __call__(self, cells: Cells, echoes: Sequence[Echo]) -> tuple[FloatArray, list[FloatArray]]:
        """Return the factors on the power of each cell's target and of each echo beside it."""
        if len(cells) == 0:
            return np.empty(0), [np.empty(0)] * len(echoes)
        range_rate_m_s, velocity_m_s = range_rate_and_own_velocity(cells)
        ground_m_s = -self._speed_towards_ground(cells, velocity_m_s)
        centre_m_s = ground_m_s if self._locked else np.zeros(len(cells))
        passed, _ = self._filter.target_and_clutter_gains(range_rate_m_s - centre_m_s)
        residues = []
        for echo in echoes:
            rate_m_s, spread_m_s = echo.range_rate_mean_and_spread(cells, velocity_m_s, ground_m_s)
            _, residue = self._filter.target_and_clutter_gains(
                range_rate_m_s - centre_m_s, rate_m_s - centre_m_s, spread_m_s
            )
            residues.append(residue + self._limit)
        # In the middle of the notch there is still a look, at noise.
        return np.maximum(passed, _LEAST_GAIN), residues

    def _speed_towards_ground(
        self, cells: Cells, velocity_m_s: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return the ownship's speed towards the ground in each target's range cell, m/s."""
        elevation_rad = cells.elevation_rad
        if self._terrain is not None:
            height_m = cells.field_at_rows("own_alt_m") - self._terrain.height_m
            sine = np.minimum(height_m / np.maximum(cells.range_m, 1.0), 1.0)
            elevation_rad = -np.arcsin(sine)
        level = np.cos(elevation_rad)
        north, east, down = velocity_m_s
        along: FloatArray = (
            north * level * np.cos(cells.azimuth_rad)
            + east * level * np.sin(cells.azimuth_rad)
            - down * np.sin(elevation_rad)
        )
        return along


DOPPLER = Hook(
    "Doppler",
    DopplerProcessing,
    "factors on the power of each cell's target and of each echo beside it",
)


class DopplerFilter(Effect[DopplerProcessing]):
    """Moving-target filter: gains of target and ground by their range rates.

    The range rates are those of the two aircraft as they fly, and of the ground in the target's
    range cell as the ownship flies over it. The notch lies at the ground's (``clutter_lock``) or at
    0. The ground's echo is spread by the beam's width across the ownship's course and by its own
    motion ([terrain] ``clutter_motion_m_s``); rain is blown and falls, and what sidelobes meet lies
    all around.
    """

    name = "moving target filter"
    acts_on = DOPPLER
    builds = DopplerProcessing
    outside_the_proof = "every filter takes something from a target"

    def verdict(self, block: Any) -> Verdict:
        """Return whether Doppler filtering is simulated: needs ``moving_target_filter``."""
        kind = block.p.moving_target_filter
        return Verdict(kind != "none", f"moving_target_filter is {kind!r}")
