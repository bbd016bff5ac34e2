"""The effect of the ownship's own navigation on what its sensors report.

Sensors measure in body axes, and physics knows no navigation error: body angles, detections and
whatever follows from them stay as they are. What an error touches is the conversion to the
horizon: which way is north, which way is down, and where are we. So the coordinate transform
tells, beside the true geometry, what the ownship believes of itself, and each sensor adds to its
detections the line of sight in north-east-down that follows from that belief.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from components.geometry.attitude import body_angles, body_to_ned, unit_vector
from components.geometry.wrapping import wrap_two_pi
from components.messages.detections import Detections
from components.messages.targets import RelativeTargets, TrafficStates
from components.navigation.error_model import attitude_with_error, position_with_error
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Context
from dsa_des.block.effect import Effect, Verdict
from dsa_des.time.clock import nanosecond_of

Belief = dict[str, FloatArray]
Three = tuple[float, float, float]

_SCAN_BITS = 48


def navigation_errs(context: Context) -> bool:
    """Return whether the scene has errors of navigation."""
    return bool(_errors_of(context))


def _errors_of(context: Context) -> list[str]:
    navigation = context.sections.get("navigation")
    return [
        f"{key} is {[float(value) for value in values]}"
        for key, values in (() if navigation is None else navigation)
        if any(values)
    ]


class _Navigation(Effect):
    name = "navigation"
    neutral = False
    outside_the_proof = "it fills columns that are null without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[navigation]``."""
        found = _errors_of(block.context)
        if found:
            return Verdict(True, f"[navigation] {' and '.join(found)}")
        return Verdict(False, "[navigation] has no bias and no noise")


class NavigationErrors(_Navigation):
    """What the ownship believes of its position and attitude: biases and white noise."""

    acts_on = "ownship"
    lockstep = True

    def build(self, block: Any) -> Callable[[TrafficStates], Belief]:
        """Return what gives the belief at each instant.

        All transforms of a scene share the ownship's one navigation system: its noise is keyed by
        the instant, not by the block.
        """
        navigation = block.context.sections["navigation"]
        stream = block.context.streams.stream("[navigation]", "errors")
        attitude_bias = _radians(navigation.attitude_bias_deg)
        attitude_noise = _radians(navigation.attitude_noise_deg)

        def believed(states: TrafficStates) -> Belief:
            # An instant may take more bits than a scan number has: the rest goes to the target.
            replica, own = np.zeros_like(states.tick), states.tick
            if block.span_ticks:
                replica, own = np.divmod(states.tick, block.span_ticks)
            instant = nanosecond_of(own, block.context.ticks_per_s)
            high = (instant >> _SCAN_BITS).astype(np.uint64)
            low = instant & ((1 << _SCAN_BITS) - 1)
            drawn = stream.of_rows(replica)
            draws = [drawn.normal(high, low, draw) for draw in range(6)]
            lat, lon, alt = position_with_error(
                states.own_lat_deg,
                states.own_lon_deg,
                states.own_alt_m,
                bias_north_east_down_m=navigation.position_bias_m,
                sigma_north_east_down_m=navigation.position_noise_m,
                normals=(draws[0], draws[1], draws[2]),
            )
            yaw, pitch, roll = attitude_with_error(
                states.own_yaw_rad,
                states.own_pitch_rad,
                states.own_roll_rad,
                bias_rad=attitude_bias,
                sigma_rad=attitude_noise,
                normals=(draws[3], draws[4], draws[5]),
            )
            return {
                "lat_deg": lat, "lon_deg": lon, "alt_m": alt,
                "yaw_rad": yaw, "pitch_rad": pitch, "roll_rad": roll,
            }  # fmt: skip

        return believed


class NavigationReport(_Navigation):
    """The line of sight of every detection in the horizon's axes, as the ownship believes them."""

    acts_on = "report"
    lockstep = True

    def build(self, block: Any) -> Callable[[Detections, RelativeTargets, IntArray], Detections]:
        """Return what adds the columns to a report."""
        return in_the_horizons_axes


def in_the_horizons_axes(
    detections: Detections, targets: RelativeTargets, rows: IntArray
) -> Detections:
    """Add each detection's line of sight in NED, by what the ownship believes of its attitude.

    Parameters
    ----------
    detections : Detections
        With the ownship's believed pose; without one nothing is added.
    targets : RelativeTargets
    rows : (scans,) of int
        As every report is given them.

    Returns
    -------
    Detections
        Its extras hold ``ned_azimuth_rad`` in [0, 2 pi) and ``ned_elevation_rad``. The rotation is
        the exact one, also where the transform took the thesis's small angles.
    """
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


def _radians(angles_deg: Three) -> Three:
    first, second, third = (math.radians(angle) for angle in angles_deg)
    return first, second, third
