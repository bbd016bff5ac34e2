"""The line of sight from an ownship to targets: one front for all models of Earth and attitude.

What the transform block, the maps of errors and the tests ask; the models stand behind it, each
in the file of its name: `flat_earth`, `local_radii`, `daidalus_sphere`, `geodesic`, `ellipsoid`,
and `sensor_angles` for the body axes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from components.arguments.checks import FloatArray, positions, shaped
from components.geometry import daidalus_sphere, ellipsoid, flat_earth, geodesic, local_radii
from components.geometry.ellipsoid import spherical_from_enu
from components.geometry.sensor_angles import MODELS as ATTITUDE_MODELS
from components.geometry.sensor_angles import sensor_angles, sensor_angles_of_offsets

# Those that find offsets; the directions' angles in body axes then need no sines of angles.
_OFFSETS: dict[str, Callable[..., tuple[FloatArray, FloatArray, FloatArray]]] = {
    "flat_earth": flat_earth.north_east_up,
    "local_radii": local_radii.north_east_up,
    "daidalus_sphere": daidalus_sphere.north_east_up,
    "ellipsoid": ellipsoid.north_east_up,
}

EARTH_MODELS = ("flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid")
"""Models of the Earth, crude to exact."""


class SeenFromOwnship(NamedTuple):
    """Lines of sight in the ownship's NED frame and in its body axes; arrays of one shape.

    Parameters
    ----------
    azimuth_rad, elevation_rad : ndarray
        In NED: clockwise from true north in [0, 2 pi), above the horizontal.
    range_m : ndarray
        Slant range.
    body_azimuth_rad, body_elevation_rad : ndarray
        In body axes: from the nose towards the right wing in (-pi, pi], above the wings' plane.
    """

    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    range_m: FloatArray
    body_azimuth_rad: FloatArray
    body_elevation_rad: FloatArray


class LineOfSight:
    """Lines of sight by one model of the Earth and one of the ownship's attitude.

    Parameters
    ----------
    earth : {"flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid"}
    attitude : {"exact", "small_angle"}
        As for `components.geometry.sensor_angles.sensor_angles`.

    Raises
    ------
    ValueError
        An unknown model.
    """

    def __init__(self, earth: str = "ellipsoid", attitude: str = "exact") -> None:
        for name, value, models in (
            ("earth", earth, EARTH_MODELS),
            ("attitude", attitude, ATTITUDE_MODELS),
        ):
            if value not in models:
                allowed = ", ".join(map(repr, models))
                raise ValueError(f"{name} is {value!r}: it must be one of {allowed}")
        self.earth, self.attitude = earth, attitude
        self._offsets = _OFFSETS.get(earth)

    def in_ned(
        self,
        own_lat_deg: Any,
        own_lon_deg: Any,
        own_alt_m: Any,
        lat_deg: Any,
        lon_deg: Any,
        alt_m: Any,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find azimuth, elevation and slant range in the ownship's NED frame, with checks.

        Parameters
        ----------
        own_lat_deg, own_lon_deg, own_alt_m, lat_deg, lon_deg, alt_m : array_like
            As for `components.geometry.ellipsoid.line_of_sight`.

        Returns
        -------
        azimuth_rad, elevation_rad, range_m : ndarray

        Raises
        ------
        ValueError
            As for `components.geometry.ellipsoid.line_of_sight`.
        """
        places = own_lat_deg, own_lon_deg, own_alt_m, lat_deg, lon_deg, alt_m
        return self._in_ned(places, validate=True)

    def from_ownship(self, own: Any, other: Any) -> SeenFromOwnship:
        """Find where the ownship sees targets, in NED and in its body axes, without checks.

        Parameters
        ----------
        own, other
            Objects with ``lat_deg``, ``lon_deg`` and ``alt_m``, the ownship with ``yaw_rad``,
            ``pitch_rad`` and ``roll_rad`` as well: finite doubles of one axis up that broadcast,
            the targets' of the broadcast shape.

        Returns
        -------
        SeenFromOwnship
        """
        places = own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m
        attitude = own.yaw_rad, own.pitch_rad, own.roll_rad
        if self._offsets is None or self.attitude != "exact":
            seen = self._in_ned(places, validate=False)
            body = sensor_angles(*seen[:2], *attitude, model=self.attitude, validate=False)
            return SeenFromOwnship(*seen, *body)
        with np.errstate(under="ignore"):  # what is too small for a double is zero
            offsets = self._offsets(*places)
            return SeenFromOwnship(
                *spherical_from_enu(*offsets), *sensor_angles_of_offsets(*offsets, *attitude)
            )

    def _in_ned(
        self, places: tuple[Any, Any, Any, Any, Any, Any], *, validate: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        if self._offsets is None:
            return geodesic.line_of_sight(*places, validate=validate)
        arrays, shape = positions(*places, validate=validate)
        with np.errstate(under="ignore"):  # offsets below 1e-150 m square to zero
            seen = spherical_from_enu(*self._offsets(*arrays))
        azimuth, elevation, range_m = shaped(shape, *seen)
        return azimuth, elevation, range_m
