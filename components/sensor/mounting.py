"""The mounting of a sensor on the ownship: its own axes, and how well they are known."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from components.geometry import (
    body_angles,
    body_to_ned,
    sensor_angles,
    turned_variances,
    unit_vector,
)
from components.messages.reach import Reach, ReasonArray
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

Angles = tuple[FloatArray, FloatArray]


class BodyAxes:
    """The axes of a sensor that looks along the ownship's nose."""

    def reach(self, reach: Reach) -> Reach:
        """Return the sensor's reach for lines of sight in the ownship's body axes."""
        return reach

    def __call__(self, body_azimuth_rad: FloatArray, body_elevation_rad: FloatArray) -> Angles:
        """Return azimuth and elevation in the sensor's axes of directions in body axes."""
        return body_azimuth_rad, body_elevation_rad

    def to_body(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Return what the sensor reports in body axes of directions in its own axes."""
        return azimuth_rad, elevation_rad

    def from_body(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Return directions in the sensor's own axes of what it reports in body axes."""
        return azimuth_rad, elevation_rad

    def variances_in_body(
        self,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        azimuth_variance_rad2: FloatArray,
        elevation_variance_rad2: FloatArray,
    ) -> Angles:
        """Return variances in body axes of azimuths and elevations in the sensor's axes."""
        return azimuth_variance_rad2, elevation_variance_rad2

    def pointing(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Return where directions in the sensor's axes truly point, in body axes."""
        return azimuth_rad, elevation_rad


class MountedAxes(BodyAxes):
    """The axes of a sensor that is turned against the ownship's body axes.

    Rotations (azimuth, elevation, roll) from body axes to the sensor's, about z, y and x in that
    order: as it is, and as the conversion of its measurements believes it to be.
    """

    def __init__(
        self, true_rad: tuple[float, float, float], believed_rad: tuple[float, float, float]
    ) -> None:
        self.true_rad = true_rad
        self.believed_rad = believed_rad

    def __eq__(self, other: object) -> bool:
        """Tell whether two sensors are mounted alike: what they offer of it must compare."""
        return isinstance(other, MountedAxes) and self._angles == other._angles

    def __hash__(self) -> int:
        return hash(self._angles)

    @property
    def _angles(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return self.true_rad, self.believed_rad

    def reach(self, reach: Reach) -> Reach:
        """Return a reach whose field of view lies in the sensor's axes."""
        return MountedReach(
            reach.azimuth_rad, reach.elevation_rad, reach.range_max_m, reach.enabled, axes=self
        )

    def __call__(self, body_azimuth_rad: FloatArray, body_elevation_rad: FloatArray) -> Angles:
        """Rotate by the true mounting: physics does not know beliefs."""
        azimuth, elevation = sensor_angles(body_azimuth_rad, body_elevation_rad, *self.true_rad)
        return azimuth, elevation

    def to_body(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Rotate back by the believed mounting."""
        return _to_body(azimuth_rad, elevation_rad, self.believed_rad)

    def from_body(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Rotate by the believed mounting: the way back of `to_body`."""
        azimuth, elevation = sensor_angles(azimuth_rad, elevation_rad, *self.believed_rad)
        return azimuth, elevation

    def variances_in_body(
        self,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        azimuth_variance_rad2: FloatArray,
        elevation_variance_rad2: FloatArray,
    ) -> Angles:
        """Turn variances by the believed mounting, as what they are of."""
        return turned_variances(
            azimuth_rad,
            elevation_rad,
            azimuth_variance_rad2,
            elevation_variance_rad2,
            self.believed_rad,
        )

    def pointing(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Rotate back by the true mounting."""
        return _to_body(azimuth_rad, elevation_rad, self.true_rad)


def _to_body(
    azimuth_rad: FloatArray, elevation_rad: FloatArray, mounting_rad: tuple[float, float, float]
) -> Angles:
    return body_angles(*body_to_ned(*unit_vector(azimuth_rad, elevation_rad), *mounting_rad))


@dataclass(frozen=True)
class MountedReach(Reach):
    """The reach of a sensor with axes of its own; its bounds are in those axes."""

    axes: BodyAxes = BodyAxes()

    @property
    def steepest_rad(self) -> float:
        """Largest elevation in either axes: the two verticals lean by the boresight's tilt."""
        tilt = 0.0
        if isinstance(self.axes, MountedAxes):
            _, elevation, roll = self.axes.true_rad
            tilt = math.acos(max(-1.0, min(1.0, math.cos(elevation) * math.cos(roll))))
        return min(0.5 * math.pi, super().steepest_rad + tilt)

    def decide(
        self,
        body_azimuth_rad: FloatArray,
        body_elevation_rad: FloatArray,
        range_m: FloatArray,
        present: BoolArray,
        hidden: BoolArray | None = None,
    ) -> ReasonArray:
        """Return the reason why each target is skipped, from its angles in body axes."""
        angles = self.axes(body_azimuth_rad, body_elevation_rad)
        return super().decide(*angles, range_m, present, hidden)


AXES = Hook("axes", BodyAxes, "the sensor's axes in the ownship's")


class Mounting(Effect[BodyAxes]):
    """Boresight and roll of the sensor, and an error of them that is not known to the ownship."""

    lockstep = True
    name = "mounting"
    acts_on = AXES
    outside_the_proof = "rotating by an angle of 0 and back rounds the last bits"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``mount_*_deg`` and ``misalignment_deg``."""
        p = block.p
        found = [f"{key} is {angle:g}" for key, angle in _mount_deg(p).items() if angle]
        if any(p.misalignment_deg):
            found.append(f"misalignment_deg is {[float(angle) for angle in p.misalignment_deg]}")
        if found:
            return Verdict(True, " and ".join(found))
        return Verdict(False, "it looks along the nose and misalignment_deg is 0")

    def build(self, block: Any) -> MountedAxes:
        """Return the sensor's axes."""
        true_deg = tuple(_mount_deg(block.p).values())
        believed = [
            math.radians(true + error)
            for true, error in zip(true_deg, block.p.misalignment_deg, strict=True)
        ]
        azimuth, elevation, roll = (math.radians(angle) for angle in true_deg)
        return MountedAxes((azimuth, elevation, roll), (believed[0], believed[1], believed[2]))


def _mount_deg(p: Any) -> Mapping[str, float]:
    return {
        "mount_azimuth_deg": p.mount_azimuth_deg,
        "mount_elevation_deg": p.mount_elevation_deg,
        "mount_roll_deg": p.mount_roll_deg,
    }
