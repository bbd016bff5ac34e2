"""The coordinate transform block: where each target is as seen from the ownship (thesis §3.3).

The rungs differ in how well they know the Earth; all of them give bearing, elevation and slant
range in the ownship's NED frame, the same line of sight in its body axes (the thesis's p, q, R),
and the target's attitude relative to that line of sight.
"""

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from components.geometry import ellipsoid, flat_earth, geodesic, local_radii
from components.geometry.angles import wrap_pi_unchecked
from components.geometry.attitude import sensor_angles
from components.navigation import NavigationErrors
from components.reach import FarthestLook, farthest_look
from components.target_messages import RelativeTargets, TrafficStates
from dsa_des.component import Component, Parameters
from dsa_des.message import Message
from dsa_des.ports import Input, Output
from dsa_des.types import FloatArray
from dsa_des.wake import Wake


class TransformParameters(Parameters):
    """Parameters of a coordinate transform."""

    attitude: Literal["exact", "small_angle"] = Field(
        default="exact",
        description="How body angles follow from the ownship's attitude: rotation of the line of "
        "sight, or angle by angle as in thesis eq. 4-5.",
    )


class Transform(Component):
    """Turns geodetic positions into lines of sight; subclasses choose the model of the Earth."""

    inputs = {"states": Input(TrafficStates, "trigger", "Where all aircraft are.")}
    outputs = {"targets": Output(RelativeTargets, "Targets as seen from the ownship.")}
    Parameters = TransformParameters
    windowed = True
    lockstep = True
    effects = (NavigationErrors(),)
    line_of_sight: ClassVar[Callable[..., tuple[Any, Any, Any]]]

    def setup(self) -> None:
        """Take what the ownship believes of itself."""
        self._beliefs: list[Callable[[TrafficStates], dict[str, FloatArray]]] = self.built(
            "ownship"
        )

    def request(self, port: str) -> FarthestLook:
        """Ask for the targets that somebody downstream may look at."""
        return farthest_look(consumer.request for consumer in self.context.consumers)

    def offer(self, port: str) -> Any:
        """Pass on what we were offered."""
        return self.context.producers[0].offer if self.context.producers else None

    def run(self, wake: Wake) -> Message | None:
        """Transform every target at every instant."""
        states = wake["states"]
        if states is None:
            return None
        own_lat, own_lon, own_alt, own_yaw, own_pitch, own_roll = _beside_targets(states)
        azimuth, elevation, range_m = type(self).line_of_sight(
            own_lat,
            own_lon,
            own_alt,
            states.lat_deg,
            states.lon_deg,
            states.alt_m,
            validate=False,
        )
        p, q = sensor_angles(
            azimuth,
            elevation,
            own_yaw,
            own_pitch,
            own_roll,
            model=self.p.attitude,
            validate=False,
        )
        heading = wrap_pi_unchecked(states.yaw_rad - azimuth)
        _require_numbers(p, heading, states.pitch_rad, states.roll_rad)
        return RelativeTargets(
            tick=states.tick,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            range_m=range_m,
            body_azimuth_rad=p,
            body_elevation_rad=q,
            relative_heading_rad=heading,
            target_pitch_rad=states.pitch_rad,
            target_roll_rad=states.roll_rad,
            own_alt_m=states.own_alt_m,
            alt_m=states.alt_m,
            present=states.present,
            roster=states.roster,
            columns=states.columns,
            believed=self._believed(states),
        )

    def _believed(self, states: TrafficStates) -> dict[str, FloatArray] | None:
        """Return what the ownship believes of itself, if that is not the truth."""
        for belief in self._beliefs:
            return belief(states)
        return None


def _beside_targets(states: TrafficStates) -> list[FloatArray]:
    """Return the ownship's position and attitude, broadcastable to the targets'."""
    own = (
        states.own_lat_deg, states.own_lon_deg, states.own_alt_m,
        states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad,
    )  # fmt: skip
    if len(states) > 1:
        return [values[:, np.newaxis] for values in own]
    # Of a single row, arrays of the targets' own shape take NumPy half as long as broadcast ones.
    wide = np.empty((6, *states.lat_deg.shape))
    for row, values in zip(wide, own, strict=True):
        row[...] = values
    return list(wide)


def _require_numbers(*angles: FloatArray) -> None:
    """Refuse what is not a finite number, here for all blocks downstream."""
    # A sum is finite only if all of it is; it stands for whatever the angles came from.
    if not math.isfinite((angles[0] + angles[1] + angles[2] + angles[3]).sum()):
        raise ValueError("a position or an attitude of the traffic is not a finite number")


class FlatEarth(Transform):
    """Line of sight over a flat Earth with 111,195 m per degree (thesis eq. 1-5, corrected)."""

    line_of_sight = staticmethod(flat_earth.line_of_sight)


class LocalRadii(Transform):
    """Line of sight over a flat Earth with the ellipsoid's radii at the ownship."""

    line_of_sight = staticmethod(local_radii.line_of_sight)


class Geodesic(Transform):
    """Bearing and distance along the geodesic (GeographicLib), elevation from the heights."""

    line_of_sight = staticmethod(geodesic.line_of_sight)


class Ellipsoid(Transform):
    """Exact line of sight on the WGS-84 ellipsoid."""

    line_of_sight = staticmethod(ellipsoid.line_of_sight)
