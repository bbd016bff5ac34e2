"""Signature of a target on the image, its smear by the turning line of sight included."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_angle_rad,
    check_finite,
    check_not_negative,
    check_positive,
    unflatten,
)
from components.geometry import angle_between, wrap_by_sines
from components.sensor.look import Cells, CellValues
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict


def line_of_sight_rate(
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    previous_azimuth_rad: ArrayLike,
    previous_elevation_rad: ArrayLike,
    interval_s: ArrayLike,
    *,
    seen_before: ArrayLike = True,
    model: str = "exact",
) -> Any:
    """Return the angular rate of the line of sight between two looks: the dynamic signature V.

    - ``exact``: angle between the two lines of sight / interval (errata 11). No jump where the
      azimuth wraps, none near the zenith.
    - ``thesis``: hypot(Δp, Δq) / interval (eq. 16-17) with Δp wrapped into [-pi, pi]; up to
      1/cos(elevation) too fast, so useless near the zenith.

    A target without a previous look has no rate: 0. The caller keeps the previous angles per
    target and drops them when the target leaves the field of view, so that it starts anew.

    Thesis eq. 16-17, errata 11.
    """
    if model not in ("exact", "thesis"):
        raise ValueError(f"model is {model!r}: it must be 'exact' or 'thesis'")
    seen = np.asarray(seen_before, dtype=bool)
    azimuth = check_angle_rad("azimuth_rad", azimuth_rad)
    elevation = check_angle_rad("elevation_rad", elevation_rad)
    previous_azimuth = check_angle_rad(
        "previous_azimuth_rad", np.where(seen, _floats(previous_azimuth_rad), 0.0)
    )
    previous_elevation = check_angle_rad(
        "previous_elevation_rad", np.where(seen, _floats(previous_elevation_rad), 0.0)
    )
    interval = check_positive("interval_s", np.where(seen, _floats(interval_s), 1.0))
    shape, (p, q, p_before, q_before, time, seen_flag) = broadcast_flat(
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        previous_azimuth_rad=previous_azimuth,
        previous_elevation_rad=previous_elevation,
        interval_s=interval,
        seen_before=seen.astype(np.float64),
    )
    if model == "exact":
        moved = angle_between(p_before, q_before, p, q)
    else:
        turn = p - p_before
        moved = np.hypot(wrap_by_sines(turn), q - q_before)
    return unflatten(np.where(seen_flag > 0.0, moved, 0.0) / time, shape)


def _floats(value: ArrayLike) -> Any:
    return np.asarray(value, dtype=np.float64)


__all__ = [
    "confidence",
    "detection_range",
    "line_of_sight_rate",
    "pixels_covered",
    "total_signature",
]

# Longer than any line of sight; keeps the square of a range inside a double.
_FARTHEST_M = 1e120


def pixels_covered(
    area_m2: ArrayLike,
    range_m: ArrayLike,
    *,
    pixel_azimuth_rad: ArrayLike,
    pixel_elevation_rad: ArrayLike,
    sensor_pixels: ArrayLike,
) -> Any:
    """Return how many pixels a target covers, at most the sensor's (thesis eq. 14-15).

    Q = area / (R² · pixel azimuth · pixel elevation), capped at the sensor's own pixel count
    (errata 10). At range 0 a target of any area fills the sensor.
    """
    shape, (area, distance, across, upward, most) = broadcast_flat(
        area_m2=check_not_negative("area_m2", area_m2),
        range_m=check_not_negative("range_m", range_m),
        pixel_azimuth_rad=check_positive("pixel_azimuth_rad", pixel_azimuth_rad),
        pixel_elevation_rad=check_positive("pixel_elevation_rad", pixel_elevation_rad),
        sensor_pixels=check_positive("sensor_pixels", sensor_pixels),
    )
    return unflatten(pixels_of_cells(area, distance, across, upward, most), shape)


def pixels_of_cells(
    area: FloatArray, distance: FloatArray, across: Any, upward: Any, most: Any
) -> FloatArray:
    """Return how many pixels each area covers, at most `most`, from flat, checked arrays."""
    distance = np.minimum(distance, _FARTHEST_M)
    pixel_m2 = (distance * across) * (distance * upward)
    fills = area >= pixel_m2 * most
    pixels = np.where(fills, most, area / np.where(fills, 1.0, pixel_m2))
    return np.where(area > 0.0, pixels, 0.0)


def total_signature(
    pixels: ArrayLike,
    rate_rad_s: ArrayLike = 0.0,
    *,
    contrast_gain: ArrayLike = 1.0,
    static_weight: ArrayLike = 0.3,
    dynamic_weight: ArrayLike = 0.0,
) -> Any:
    """Return the signature E = a Q P + b V from size, contrast and angular rate (thesis eq. 18).

    E = a · Q · P + b · V. The defaults a = 0.3, P = 1, b = 0 are the ones that reproduce
    Table 4.4 (errata 23).

    Parameters
    ----------
    pixels : array_like
        Static signature Q, pixels covered.
    rate_rad_s : array_like, rad/s
        Dynamic signature V.
    contrast_gain : array_like
        P, 0 or more.
    static_weight : array_like
        a, per pixel.
    dynamic_weight : array_like, s/rad
        b.

    Returns
    -------
    array of the broadcast shape
        E, dimensionless.

    Raises
    ------
    ValueError
        If an argument is negative or not finite.
    """
    return (
        check_not_negative("static_weight", static_weight)
        * check_not_negative("pixels", pixels)
        * check_not_negative("contrast_gain", contrast_gain)
    ) + check_not_negative("dynamic_weight", dynamic_weight) * check_not_negative(
        "rate_rad_s", rate_rad_s
    )


def confidence(signature: ArrayLike, threshold: ArrayLike = 1.0) -> Any:
    """Return the margin of the signature over the threshold, C = E - threshold (thesis eq. 19).

    The target is detected when C >= 0 (errata 10). C is in the units of E: weighted pixels.
    """
    return check_finite("signature", signature) - check_finite("threshold", threshold)


def detection_range(
    area_m2: ArrayLike,
    *,
    pixel_azimuth_rad: ArrayLike,
    pixel_elevation_rad: ArrayLike,
    contrast_gain: ArrayLike = 1.0,
    static_weight: ArrayLike = 0.3,
    dynamic_signature: ArrayLike = 0.0,
    threshold: ArrayLike = 1.0,
    sensor_pixels: ArrayLike | None = None,
) -> Any:
    """Return the range at which a target is just detected, in closed form.

    R = sqrt(a · area · P / (pixel azimuth · pixel elevation · (threshold - bV))). Infinity where
    the speed alone reaches the threshold. With `sensor_pixels`, 0 where not even an image that
    fills the sensor is enough.

    Thesis eq. 14, 15, 18 and 19 solved for R; errata 10 and 23.
    """
    pixels = (
        np.float64(1.0) if sensor_pixels is None else check_positive("sensor_pixels", sensor_pixels)
    )
    shape, flat = broadcast_flat(
        area_m2=check_not_negative("area_m2", area_m2),
        pixel_azimuth_rad=check_positive("pixel_azimuth_rad", pixel_azimuth_rad),
        pixel_elevation_rad=check_positive("pixel_elevation_rad", pixel_elevation_rad),
        contrast_gain=check_not_negative("contrast_gain", contrast_gain),
        static_weight=check_not_negative("static_weight", static_weight),
        dynamic_signature=check_not_negative("dynamic_signature", dynamic_signature),
        threshold=check_finite("threshold", threshold),
        sensor_pixels=np.asarray(pixels),
    )
    area, across, upward, gain, weight, dynamic, level, most = flat
    wanted = level - dynamic
    needs_image = wanted > 0.0
    wanted = np.where(needs_image, wanted, 1.0)
    distance = np.sqrt(weight * area * gain / (across * upward * wanted))
    if sensor_pixels is not None:
        distance = np.where(weight * gain * most >= wanted, distance, 0.0)
    return unflatten(np.where(needs_image, distance, np.inf), shape)


SIGNATURE = Hook("signature", CellValues, "what to add to each cell's signature")


class DynamicSignature(Effect[CellValues]):
    """The rate of the line of sight adds b·V to the signature."""

    name = "dynamic signature"
    acts_on = SIGNATURE

    def verdict(self, block: Any) -> Verdict:
        """Return whether motion adds to the signature: needs the weight b."""
        weight = block.p.dynamic_weight
        return Verdict(weight > 0, f"dynamic_weight is {weight:g}")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the dynamic term to add to each cell's signature."""
        return MovingTargets(block.p.dynamic_weight, block.p.rate, block.context.ticks_per_s)


class MovingTargets:
    """Remembers where each target was at the last scan, and weighs how fast it moves (eq. 18)."""

    #: Goes on where the sensor changes (`Component.remembers`).
    remembers = ("_tick", "_angles")

    def __init__(self, weight_s: float, model: str, ticks_per_s: int) -> None:
        self.weight_s = weight_s
        self.model = model
        self._ticks_per_s = ticks_per_s
        # Of each run, tick and NED angles of its last scan, one column per target; NaN where
        # it saw none.
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        self._angles: FloatArray = np.empty((2, 0, 0))

    def __call__(self, cells: Cells) -> FloatArray:
        """Return b·V of every cell."""
        return self.weight_s * self.line_of_sight_rate_rad_s(cells)

    def line_of_sight_rate_rad_s(self, cells: Cells) -> FloatArray:
        """Return the angular rate of each cell's line of sight since the previous scan, rad/s.

        A target's first look has none, nor has the first after a scan that did not see it.
        """
        run, targets = cells.run_of_scan, len(cells.roster)
        self._grow_memory(int(run.max(initial=0)) + 1, targets)
        begins = np.append(True, run[1:] != run[:-1])
        # Before the scans of each run stands its last one.
        place = np.arange(len(run)) + np.cumsum(begins)
        of, earlier = run[begins], place[begins] - 1
        angles = np.full((2, len(run) + len(of), targets), np.nan)
        tick = np.zeros(len(run) + len(of), dtype=np.int64)
        angles[:, earlier], tick[earlier] = self._angles[:, of], self._tick[of]
        here = place[cells.row]
        angles[:, here, cells.target] = cells.azimuth_rad, cells.elevation_rad
        tick[place] = cells.scan_ticks
        last = np.append(earlier[1:], len(tick)) - 1
        self._tick[of], self._angles[:, of] = tick[last], angles[:, last]
        azimuth, elevation = angles[:, here - 1, cells.target]
        interval = (tick[here] - tick[here - 1]) / self._ticks_per_s
        return np.asarray(
            line_of_sight_rate(
                cells.azimuth_rad,
                cells.elevation_rad,
                azimuth,
                elevation,
                np.where(np.isnan(azimuth), 1.0, interval),
                seen_before=~np.isnan(azimuth),
                model=self.model,
            )
        )

    def _grow_memory(self, runs: int, targets: int) -> None:
        """Enlarge the memory to at least the given number of runs."""
        known = len(self._tick)
        if known < runs:
            angles = np.full((2, runs, targets), np.nan)
            angles[:, :known] = self._angles.reshape(2, known, targets)
            self._angles = angles
            self._tick = np.append(self._tick, np.zeros(runs - known, dtype=np.int64))
