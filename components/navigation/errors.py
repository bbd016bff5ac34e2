"""The error model of the ownship's own position and attitude, as it believes them.

A constant bias, and noise that is white or lasts, on what the navigation system reports, as TECVOL
simulated it (thesis section 2.3.1). Errors of attitude are those of the reported angles, as a data
sheet states them, not of the axes; a pitch beyond ±90° means what its rotation means.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.aircraft import OWNSHIP as OWNSHIP_NAME
from components.arguments.checks import (
    HIGHEST_ALTITUDE_M,
    LOWEST_ALTITUDE_M,
    broadcast_flat,
    check_finite,
    require_between,
    unflatten,
)
from components.geometry import (
    NEAR_A_POLE_DEG,
    POSE_FIELDS,
    body_angles,
    body_to_ned,
    meridian_convergence_rad,
    ned_to_body,
    north_east_parts,
    radii_of_curvature,
    unit_vector,
    wrap_two_pi,
)
from components.messages.detections import REPORT, Detections, LastingPart, ReportTransform
from components.messages.targets import RelativeTargets, TrafficStates
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Context
from dsa_des.block.effect import Built, Effect, Hook, Verdict
from dsa_des.time.clock import ticks_to_nanoseconds
from dsa_des.time.gauss_markov import GaussMarkov

# Beyond this a displacement along the tangent plane would no longer be a small error.
LARGEST_POSITION_ERROR_M = 100_000.0


def displaced_lat_lon_alt(
    lat_deg: ArrayLike,
    lon_deg: ArrayLike,
    alt_m: ArrayLike,
    north_m: ArrayLike,
    east_m: ArrayLike,
    down_m: ArrayLike,
) -> tuple[Any, Any, Any]:
    """Return latitude, longitude, altitude displaced by own north-east-down offsets up to 100 km.

    The displacement is an arc along a sphere with the local radii of the ellipsoid, so it also
    works across a pole. Against a straight displacement in the tangent plane an error of 10 m
    comes out 0.1 µm off horizontally and, as it follows the Earth, 8 µm lower (100 m: 8 µm and
    0.8 mm), at any latitude. Where an error is 0 every bit stays.
    """
    given = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m,
             "north_m": north_m, "east_m": east_m, "down_m": down_m}  # fmt: skip
    shape, (lat, lon, alt, *errors) = broadcast_flat(
        **{name: check_finite(name, value) for name, value in given.items()}
    )
    require_between("lat_deg", lat, -90.0, 90.0, "lie in [-90, 90] degrees")
    lowest, highest = LOWEST_ALTITUDE_M, HIGHEST_ALTITUDE_M
    require_between("alt_m", alt, lowest, highest, f"lie in [{lowest:g}, {highest:g}] metres")
    most = LARGEST_POSITION_ERROR_M
    for error in errors:
        require_between("position error", error, -most, most, f"be within ±{most:g} m")
    north, east, down = errors
    new_lat, new_lon = _displace(lat, lon, alt - down, north, east)
    stays = (north == 0.0) & (east == 0.0)
    return (
        unflatten(np.where(stays, lat, new_lat), shape),
        unflatten(np.where(stays, lon, new_lon), shape),
        unflatten(_add_error(alt, -down), shape),
    )


def _add_error(value: FloatArray, error: FloatArray) -> FloatArray:
    """Return values plus errors; values with an error of 0 stay unchanged to the bit."""
    return np.where(error == 0.0, value, value + error)


def _displace(
    lat_deg: FloatArray, lon_deg: FloatArray, alt: FloatArray, north: FloatArray, east: FloatArray
) -> tuple[FloatArray, FloatArray]:
    lat = np.radians(lat_deg)
    sine, cosine = np.sin(lat), np.cos(lat)
    along, across = radii_of_curvature(lat_deg)
    a, b = north / (along + alt), east / (across + alt)
    arc = np.hypot(a, b)
    moved = arc > 0.0
    ratio = np.where(moved, np.sin(arc) / np.where(moved, arc, 1.0), 1.0)
    cos_arc = np.cos(arc)
    # The new direction in the meridian plane of the old position: axis, outwards, and east.
    up = sine * cos_arc + cosine * a * ratio
    out = cosine * cos_arc - sine * a * ratio
    side = b * ratio
    new_lat = np.degrees(np.arctan2(up, np.hypot(out, side)))
    new_lon = lon_deg + np.degrees(np.arctan2(side, out))
    return np.clip(new_lat, -90.0, 90.0), new_lon


Belief = dict[str, FloatArray]


class Believing(Protocol):
    """Function that returns the ownship's believed position and attitude."""

    def __call__(self, states: TrafficStates, /) -> Belief:
        """Return position and attitude at each instant, by name."""


OWNSHIP = Hook("ownship", Believing, "what the ownship believes of itself, by name")
Three = tuple[float, float, float]

_SCAN_BITS = 48
#: Key of the ownship's processes.
_OWNSHIP = np.uint64(0)
#: Nearer to the vertical azimuths say nothing.
_LEAST_COS = 1e-3


def has_navigation_errors(context: Context) -> bool:
    """Return whether the scene has any navigation error other than 0."""
    return bool(_nonzero_error_texts(context))


def position_and_attitude_deviations(context: Context) -> tuple[Three, Three]:
    """Return the standard deviations that the navigation states: of position (north, east, down; m)
    and attitude (yaw, pitch, roll; rad).
    """
    navigation = context.sections.get("navigation")
    if navigation is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return navigation.position_noise_m, _radians(navigation.attitude_noise_deg)


def lasting_navigation_errors(context: Context) -> dict[str, list[LastingPart]]:
    """Return the correlated parts of errors caused by navigation, by measured quantity.

    Each angle has of each turn at most its noise, each direction of the position's noise at most
    the greatest.
    """
    navigation = context.sections["navigation"]
    position_m, attitude_rad = position_and_attitude_deviations(context)
    angle: list[LastingPart] = []
    along: list[LastingPart] = []
    if lasts_s := navigation.attitude_correlation_time_s:
        angle.append(LastingPart(max(attitude_rad) ** 2, lasts_s))
    if lasts_s := navigation.position_correlation_time_s:
        angle.append(LastingPart(lasts_s=lasts_s, across_m2=max(position_m) ** 2))
        along.append(LastingPart(max(position_m) ** 2, lasts_s))
    return {"azimuth": angle, "elevation": angle, "range": along}


def _nonzero_error_texts(context: Context) -> list[str]:
    navigation = context.sections.get("navigation")
    return [
        f"{key} is {[float(value) for value in values]}"
        for key, values in (() if navigation is None else navigation)
        if isinstance(values, tuple) and any(values)
    ]


class _Navigation(Effect[Built]):
    name = "navigation"
    outside_the_proof = "it fills columns that are null without it"

    def verdict(self, block: Any) -> Verdict:
        """Return whether navigation errors are simulated: needs ``[navigation]``."""
        errors = _nonzero_error_texts(block.context)
        if errors:
            return Verdict(True, f"[navigation] {' and '.join(errors)}")
        return Verdict(False, "[navigation] has no bias and no noise")


class NavigationErrors(_Navigation[Believing]):
    """The ownship's believed pose: the true one with biases and white or correlated noise."""

    acts_on = OWNSHIP

    def build(self, block: Any) -> Believing:
        """Return a function giving the ownship's believed position and attitude for each row.

        All transforms on a platform share its one navigation system: its noise is keyed by the
        instant and the platform's name, not by the block.
        """
        navigation = block.context.sections["navigation"]
        streams, platform = block.context.streams, block.context.platform
        of_platform = "" if platform in ("", OWNSHIP_NAME) else f" of {platform}"
        stream = streams.stream("[navigation]", f"errors{of_platform}")
        bias = (*navigation.position_bias_m, *_radians(navigation.attitude_bias_deg))
        noise = (*navigation.position_noise_m, *_radians(navigation.attitude_noise_deg))
        lasting = [
            GaussMarkov(streams.stream("[navigation]", f"lasting {name}{of_platform}"), lasts_s)
            if lasts_s
            else None
            for name, lasts_s in (
                ("position", navigation.position_correlation_time_s),
                ("attitude", navigation.attitude_correlation_time_s),
            )
        ]

        def believed(states: TrafficStates) -> Belief:
            # An instant may take more bits than a scan number has: the rest goes to the target.
            instant = ticks_to_nanoseconds(states.tick, block.context.ticks_per_s)
            high = (instant >> _SCAN_BITS).astype(np.uint64)
            low = instant & ((1 << _SCAN_BITS) - 1)
            drawn = stream.of_runs(states.run, instant)
            normals: list[FloatArray] = []
            for number in range(6):
                process = lasting[number // 3]
                if process is None:
                    normals.append(drawn.normal(high, low, number))
                else:
                    normals.append(process(_OWNSHIP, instant, number % 3, states.run))
            if lasting[0] is not None:
                # Fixed to the Earth: near a pole, where north turns about, the error does not.
                outward = lasting[0](_OWNSHIP, instant, 3, states.run)
                normals[:2] = north_east_parts(
                    normals[0], normals[1], outward, states.own_lat_deg, states.own_lon_deg
                )
            errors = [bias[k] + noise[k] * normal for k, normal in enumerate(normals)]
            true = states.own_lat_deg, states.own_lon_deg
            position = displaced_lat_lon_alt(*true, states.own_alt_m, *errors[:3])
            # How it is turned it knows from where it believes north to be.
            near = np.abs(true[0]) > NEAR_A_POLE_DEG
            turned = np.where(near, meridian_convergence_rad(true, position[:2]), 0.0)
            errors[3] = errors[3] + turned
            attitude = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
            return dict(
                zip(POSE_FIELDS, (*position, *map(_add_error, attitude, errors[3:])), strict=True)
            )

        return believed


class NavigationReport(_Navigation[ReportTransform]):
    """Adds to detections their line of sight in north-east-down axes by the believed attitude."""

    acts_on = REPORT

    def build(self, block: Any) -> ReportTransform:
        """Return a function that adds horizon angles and the navigation's variances to a report."""
        none = (0.0, 0.0, 0.0)
        noise = (
            position_and_attitude_deviations(block.context)
            if block.turned_by_belief
            else (none, none)
        )

        def report(detections: Detections, targets: RelativeTargets, rows: IntArray) -> Detections:
            return add_navigation_variances(
                add_angles_in_believed_ned(detections, targets, rows), *noise
            )

        return report


def add_angles_in_believed_ned(
    detections: Detections, targets: RelativeTargets, rows: IntArray
) -> Detections:
    """Return detections with believed NED azimuth and elevation added; unchanged without a pose."""
    own = detections.pose_columns()
    if not own:
        return detections
    direction = unit_vector(detections.azimuth_rad, detections.elevation_rad)
    azimuth, elevation = body_angles(
        *body_to_ned(*direction, own["own_heading_rad"], own["own_pitch_rad"], own["own_roll_rad"])
    )
    added = {
        "ned_azimuth_rad": wrap_two_pi(azimuth),
        "ned_elevation_rad": elevation,
    }
    return replace(detections, extras={**detections.extras, **added})


def add_navigation_variances(
    detections: Detections, position_m: Three, attitude_rad: Three
) -> Detections:
    """Return detections whose angle and range variances include those of the navigation."""
    own = detections.pose_columns()
    if not own or not (any(position_m) or any(attitude_rad)) or not len(detections.target):
        return detections
    yaw, pitch, roll = (own[f"own_{name}_rad"] for name in ("heading", "pitch", "roll"))
    azimuth, elevation = detections.azimuth_rad, detections.elevation_rad
    level = np.maximum(np.cos(elevation), _LEAST_COS)
    along = np.stack(unit_vector(azimuth, elevation))
    across = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)])
    upward = np.cross(across, along, axis=0)
    zero, one = np.zeros_like(azimuth), np.ones_like(azimuth)
    # About what the ownship turns, in its body axes, when each of the three angles changes.
    axes = (
        np.stack(ned_to_body(zero, zero, one, yaw, pitch, roll)),
        np.stack([zero, np.cos(roll), -np.sin(roll)]),
        np.stack([one, zero, zero]),
    )
    added = [zero, zero, zero]
    for sigma, axis in zip(attitude_rad, axes, strict=True):
        turned = np.cross(along, axis, axis=0)
        added[0] = added[0] + (sigma * (turned * across).sum(axis=0) / level) ** 2
        added[1] = added[1] + (sigma * (turned * upward).sum(axis=0)) ** 2
    if any(position_m) and np.isfinite(detections.range_m).any():
        range_m = detections.range_m
        north_east_down = ((one, zero, zero), (zero, one, zero), (zero, zero, one))
        for sigma, (north, east, down) in zip(position_m, north_east_down, strict=True):
            shift = sigma * np.stack(ned_to_body(north, east, down, yaw, pitch, roll))
            side, rise, away = ((shift * part).sum(axis=0) for part in (across, upward, along))
            added[0] = added[0] + np.where(np.isnan(range_m), 0.0, side / (range_m * level)) ** 2
            added[1] = added[1] + np.where(np.isnan(range_m), 0.0, rise / range_m) ** 2
            added[2] = added[2] + away**2
    return replace(
        detections,
        azimuth_variance_rad2=detections.azimuth_variance_rad2 + added[0],
        elevation_variance_rad2=detections.elevation_variance_rad2 + added[1],
        range_variance_m2=detections.range_variance_m2 + added[2],
    )


def _radians(angles_deg: Three) -> Three:
    first, second, third = (math.radians(angle) for angle in angles_deg)
    return first, second, third
