"""Which errors of what aircraft report a tracker carries in its states, and how large they are.

An error that an aircraft has, whoever hears it, is one state for all sensors: its altimeter speaks
through its broadcasts and through its replies.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.estimation.batched import matrix_times_vector
from components.estimation.carried_errors import BEARING, LATENCY, RANGE, Ages, ReportedErrors
from components.estimation.frame import SensorPose
from components.geometry import unit_vector_unchecked
from components.messages.columns import TOLD
from components.messages.detections import SensorOffer, ToldError
from components.tracking.scans import Scans
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_AGES = ("age_s", "velocity_age_s", "latency_deviation")
# Nearer to the vertical azimuths say nothing.
_LEAST_COS = 1e-3
# Beside precise ranges, coarser bearings than these make tracks too sure.
_COARSEST_DEG = 5.0


def sensors_by_told_error(offers: Mapping[str, Any]) -> dict[tuple[ToldError, str], list[str]]:
    """Return sensor names by stated error; an error of the aircraft itself is listed once."""
    result: dict[tuple[ToldError, str], list[str]] = {}
    for name, offer in sorted(offers.items()):
        for one in offer.told_errors if isinstance(offer, SensorOffer) else ():
            result.setdefault((one, "" if one.of_aircraft else name), []).append(name)
    return result


def latency_warnings(offers: Mapping[str, Any]) -> list[str]:
    """Return a warning for each sensor with position latency that this tracker does not model."""
    return [
        f"{name} may hear aircraft that send positions late and do not carry them on (their "
        "ads_b.latency_s is above compensated_s), an error of all reports alike along the flight "
        "that this tracker does not carry: its tracks lie behind by the speed times that"
        for name, offer in sorted(offers.items())
        if isinstance(offer, SensorOffer) and any(one.way == LATENCY for one in offer.told_errors)
    ]


def folded_range_warnings(offers: Mapping[str, Any]) -> list[str]:
    """Return a warning for each sensor whose ranges fold within its reach but are taken as true."""
    return [
        f"ranges of {name} fold at {offer.ambiguous_m / 1000.0:.4g} km, and are taken for true: a "
        "target beyond is tracked where it seems to be; other_prfs_hz would resolve it"
        for name, offer in sorted(offers.items())
        if isinstance(offer, SensorOffer)
        and offer.ambiguous_m < (math.inf if offer.reach is None else offer.reach.range_max_m)
    ]


def coarse_bearing_warnings(offers: Mapping[str, Any]) -> list[str]:
    """Return a warning per sensor making tracks overconfident: coarse azimuth, precise range."""
    return [
        f"azimuths of {name} have an error of {math.degrees(math.sqrt(variance)):.3g}°: beside a "
        "precise range they leave a target on an arc, which no Gaussian along straight axes is, "
        f"and tracks are too sure from {_COARSEST_DEG:g}° on (at 9° and 20 m, 6 km away, "
        "tracking.ekf has a mean NEES of 22, tracking.imm 15, tracking.ukf 6 with 1 % above 43)"
        for name, offer in sorted(offers.items())
        if isinstance(offer, SensorOffer) and offer.measures_range and not offer.tells
        if (variance := offer.azimuth_variance_rad2 or 0.0) > math.radians(_COARSEST_DEG) ** 2
    ]


@dataclass(frozen=True, eq=False)
class CarriedErrors:
    """Sensor errors that a track's state estimates along with position and velocity."""

    ways: tuple[int, ...]
    column: IntArray  # (errors,), of each error's deviation in `Scans.told`
    mine: BoolArray  # (errors, sensors), which sensors have which
    at_range: BoolArray  # (sensors,), whether a height leaves the range as it is

    @classmethod
    def of(cls, offers: Mapping[str, Any], sensors: tuple[str, ...]) -> "CarriedErrors":
        """Return the errors to estimate that the named sensors state in their offers."""
        errors = sensors_by_told_error(offers)
        mine = np.array([[name in whose for name in sensors] for whose in errors.values()])
        ranging = np.array([one.way in (BEARING, RANGE) for one, _ in errors])
        return cls(
            tuple(one.way for one, _ in errors),
            np.array([TOLD.index(one.deviation) for one, _ in errors]),
            mine, (mine & ranging[:, np.newaxis]).any(axis=0),
        )  # fmt: skip

    def errors_of_detections(self, scans: Scans, cells: IntArray) -> ReportedErrors:
        """Return the carried errors' deviations and ages, as reported with chosen detections."""
        assert scans.reported is not None
        source, reported = scans.source[0][cells], scans.reported[:, cells]
        deviation = np.where(self.mine[:, source], reported[self.column], 0.0)
        return ReportedErrors(
            self.ways, deviation, reported[TOLD.index("age_s")], self.at_range[source]
        )

    def ownship_velocity_m_s(self, scans: Scans, cells: IntArray) -> FloatArray:
        """Return reported ownship velocity (3, n), NED; NaN unless the bearing is coarse."""
        assert scans.reported is not None
        return scans.reported[TOLD.index("own_north") : TOLD.index("own_down") + 1, cells]

    def new_error_variances(self, scans: Scans, cells: IntArray, rows: list[int]) -> FloatArray:
        """Return variances of errors new at each look, the first three of position, equal, m²."""
        assert scans.reported is not None
        variance = scans.variance[rows][:, cells]
        variance[:3] = scans.reported[TOLD.index("white_variance"), cells]
        return np.asarray(variance)

    def position_and_velocity_ages(
        self, scans: Scans, cells: IntArray, since_s: FloatArray
    ) -> Ages:
        """Return ages of positions and velocities, times since track updates, position lags, s."""
        assert scans.reported is not None
        position, velocity, late = (scans.reported[TOLD.index(name), cells] for name in _AGES)
        return Ages(position, velocity, since_s, late)


def variances_of_azimuth_elevation_range(
    variance_m2: FloatArray, measured: FloatArray
) -> FloatArray:
    """Convert variances across, up, along sight (m²) to azimuth, elevation (rad²), range (m²)."""
    result, distance = variance_m2.copy(), np.maximum(measured[2], 1.0)
    level = np.maximum(np.cos(measured[1]), _LEAST_COS)
    result[0] /= (distance * level) ** 2
    result[1] /= distance**2
    return result


def angles_in_level_axes(angles_rad: FloatArray, pose: SensorPose) -> tuple[FloatArray, SensorPose]:
    """Return azimuths and elevations (2, n) turned from body to level axes, and the level pose.

    Bearings and heights are reported in level axes: there it is linear.
    """
    body = np.stack(unit_vector_unchecked(*angles_rad))
    x, y, z = matrix_times_vector(pose.to_body.swapaxes(0, 1), body)
    upright = np.zeros_like(pose.to_body)
    for i in range(3):
        upright[i, i] = 1.0
    turned = np.stack([np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))])
    return turned, SensorPose(pose.position_m, upright, pose.velocity_m_s)
