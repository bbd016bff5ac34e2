"""The mounting of a sensor on the ownship: its own axes, and how well they are known."""

import math
from dataclasses import dataclass
from typing import Any

from components.geometry import (
    body_angles,
    body_angles_of_sight_line,
    body_to_ned,
    rotate_variances,
    unit_vector,
)
from components.messages.reach import Reach, ReasonArray
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

Angles = tuple[FloatArray, FloatArray]
Angles3 = tuple[float, float, float]


@dataclass(frozen=True)
class SensorAxes:
    """Orientation of a sensor in body axes: true mounting angles, and those believed.

    Rotations (azimuth, elevation, roll) from body axes to the sensor's, about z, y and x in that
    order: as it is, and as the conversion of its measurements believes it to be. None is a sensor
    that looks along the nose, whose angles keep every bit.
    """

    true_rad: Angles3 | None = None
    believed_rad: Angles3 | None = None

    def reach_in_body_axes(self, reach: Reach) -> Reach:
        """Return the reach for lines of sight in body axes, turned by true mounting angles."""
        if self.true_rad is None:
            return reach
        return MountedReach(
            reach.azimuth_rad, reach.elevation_rad, reach.range_max_m, reach.enabled, axes=self
        )

    def __call__(self, body_azimuth_rad: FloatArray, body_elevation_rad: FloatArray) -> Angles:
        """Return angles in the sensor's axes by the true mounting: physics knows no beliefs."""
        return _from_body(body_azimuth_rad, body_elevation_rad, self.true_rad)

    def true_direction_in_body(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> Angles:
        """Return body-axis azimuth, elevation (rad) of sensor-axis directions (true mounting)."""
        return _to_body(azimuth_rad, elevation_rad, self.true_rad)

    def believed_direction_in_body(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray
    ) -> Angles:
        """Return azimuth, elevation in body axes (rad) from sensor axes, by believed mounting."""
        return _to_body(azimuth_rad, elevation_rad, self.believed_rad)

    def believed_direction_in_sensor(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray
    ) -> Angles:
        """Return azimuth, elevation in sensor axes (rad) from body axes, by believed mounting."""
        return _from_body(azimuth_rad, elevation_rad, self.believed_rad)

    def variances_in_body(
        self,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        azimuth_variance_rad2: FloatArray,
        elevation_variance_rad2: FloatArray,
    ) -> Angles:
        """Return azimuth and elevation variances (rad²) in body axes from those in sensor axes."""
        if self.believed_rad is None:
            return azimuth_variance_rad2, elevation_variance_rad2
        return rotate_variances(
            azimuth_rad,
            elevation_rad,
            azimuth_variance_rad2,
            elevation_variance_rad2,
            self.believed_rad,
        )


def _from_body(
    azimuth_rad: FloatArray, elevation_rad: FloatArray, mounting_rad: Angles3 | None
) -> Angles:
    if mounting_rad is None:
        return azimuth_rad, elevation_rad
    azimuth, elevation = body_angles_of_sight_line(azimuth_rad, elevation_rad, *mounting_rad)
    return azimuth, elevation


def _to_body(
    azimuth_rad: FloatArray, elevation_rad: FloatArray, mounting_rad: Angles3 | None
) -> Angles:
    if mounting_rad is None:
        return azimuth_rad, elevation_rad
    return body_angles(*body_to_ned(*unit_vector(azimuth_rad, elevation_rad), *mounting_rad))


@dataclass(frozen=True)
class MountedReach(Reach):
    """The reach of a sensor with axes of its own; its bounds are in those axes."""

    axes: SensorAxes = SensorAxes()

    @property
    def steepest_elevation_rad(self) -> float:
        """Upper bound, rad, of absolute elevation in body axes of the tilted field of view."""
        _, elevation, roll = self.axes.true_rad or (0.0, 0.0, 0.0)
        tilt = math.acos(max(-1.0, min(1.0, math.cos(elevation) * math.cos(roll))))
        return min(0.5 * math.pi, super().steepest_elevation_rad + tilt)

    def skip_reasons(
        self,
        body_azimuth_rad: FloatArray,
        body_elevation_rad: FloatArray,
        range_m: FloatArray,
        present: BoolArray,
        hidden: BoolArray | None = None,
    ) -> ReasonArray:
        """Return a code per target: evaluated, or why skipped; the angles are in body axes."""
        angles = self.axes(body_azimuth_rad, body_elevation_rad)
        return super().skip_reasons(*angles, range_m, present, hidden)


AXES = Hook("axes", SensorAxes, "the sensor's axes in the ownship's")


class Mounting(Effect[SensorAxes]):
    """Boresight and roll of the sensor, and an error of them that is not known to the ownship."""

    name = "mounting"
    acts_on = AXES
    outside_the_proof = "rotating by an angle of 0 and back rounds the last bits"

    def verdict(self, block: Any) -> Verdict:
        """Return whether mounting is simulated: ``mount_*_deg`` or ``misalignment_deg`` not 0."""
        p = block.p
        turned = [f"{key} is {getattr(p, key):g}" for key in _MOUNT_KEYS if getattr(p, key)]
        if any(p.misalignment_deg):
            turned.append(f"misalignment_deg is {[float(angle) for angle in p.misalignment_deg]}")
        if turned:
            return Verdict(True, " and ".join(turned))
        return Verdict(False, "it looks along the nose and misalignment_deg is 0")

    def build(self, block: Any) -> SensorAxes:
        """Return the sensor's axes."""
        true_deg = [getattr(block.p, key) for key in _MOUNT_KEYS]
        errors_deg = block.p.misalignment_deg
        believed_deg = [true + error for true, error in zip(true_deg, errors_deg, strict=True)]
        true_rad, believed_rad = (
            tuple(map(math.radians, angles)) for angles in (true_deg, believed_deg)
        )
        return SensorAxes(true_rad, believed_rad)  # type: ignore[arg-type]


_MOUNT_KEYS = ("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg")
