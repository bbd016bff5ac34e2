"""An alerting configuration: alerters with levels, values by key, margins of uncertain states."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.well_clear.detection import Bounds
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.arrays.types import FloatArray
from dsa_des.text.safe_text import shorten

#: Regions of guidance from mild to severe.
REGIONS = ("NONE", "FAR", "MID", "NEAR", "RECOVERY")
#: Releases whose rules are known, the default last: they differ in guidance only.
VERSIONS = ("2.0.1", "2.0.4")
#: Releases between them: taken for the last, which is said.
VERSIONS_BETWEEN = ("2.0.2", "2.0.3")


@dataclass(frozen=True)
class Level:
    """One level of an alerter."""

    volume: Volume | TcasAdvisory
    region: str  # What its bands are painted as, one of `REGIONS`
    # How long before the volume is entered the level is due; the early one holds while it is on
    alerting_time_s: float
    early_alerting_time_s: float
    # Whether the bounds on the states count (volumes of class WCV_TAUMOD_SUM)
    uncertain: bool = False
    # tuple of (kind, size): By kind of guidance (hdir, hs, vs, alt): the level is due too if
    # values so near the ownship's own lead to its volume, rad, m/s, m. Kinds without a spread
    # are left out
    spreads: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Alerter:
    """Levels 1, 2, ... for one class of intruders."""

    name: str
    levels: tuple[Level, ...]


@dataclass(frozen=True)
class Configuration:
    """A whole configuration."""

    alerters: tuple[Alerter, ...]  # The first is that of intruders whose alerter is not said
    values: Mapping[str, Any]  # Every other key of the file format, in SI units and radians
    units: Mapping[str, str]  # The unit in which the file gives each key that has one
    # Alerters that the file holds and its key `alerters` does not name
    left_out: tuple[str, ...] = ()

    def __getitem__(self, key: str) -> Any:
        """Return the value of a key, in SI units."""
        return self.values[key]

    def notes(self) -> list[str]:
        """Return a sentence for each setting of the file that is ignored or read differently."""
        said = []
        if self.left_out:
            shown = shorten(", ".join(self.left_out))
            said.append(
                f"alerters of the file that its key 'alerters' does not name are ignored: {shown}"
            )
        if (version := self["daidalus_version"]) in VERSIONS_BETWEEN:
            said.append(
                f"daidalus_version is {version}: the rules of {VERSIONS[-1]} are used, since what "
                "that release does otherwise is not known"
            )
        return said

    @property
    def most_levels(self) -> int:
        """Largest number of levels that an alerter of the configuration has."""
        return max(len(alerter.levels) for alerter in self.alerters)

    def first_corrective_level(self, alerter: Alerter) -> Level | None:
        """Return an alerter's first level whose region is at least corrective; None without one."""
        least = REGIONS.index(self["corrective_region"])
        for level in alerter.levels:
            if REGIONS.index(level.region) >= least:
                return level
        return None


class Deviations(NamedTuple):
    """Standard deviations of states, those of ownship and target added, arrays of one shape."""

    position_m: FloatArray  # Of horizontal ones along their longest axis
    height_m: FloatArray
    velocity_mps: FloatArray
    climb_mps: FloatArray


def uncertainty_bounds(
    configuration: Configuration, deviations: Deviations, range_m: FloatArray
) -> Bounds:
    """Return how far relative states may be wrong: deviations times z-scores, where the one of
    velocity falls with distance.
    """
    position = configuration["h_pos_z_score"] * deviations.position_m
    least, most = configuration["h_vel_z_score_min"], configuration["h_vel_z_score_max"]
    distance_m = configuration["h_vel_z_distance"]
    away = np.maximum(range_m - position, 0.0)
    share = np.minimum(away / distance_m, 1.0) if distance_m > 0.0 else 1.0
    return Bounds(
        position,
        configuration["v_pos_z_score"] * deviations.height_m,
        (most - (most - least) * share) * deviations.velocity_mps,
        configuration["v_vel_z_score"] * deviations.climb_mps,
    )


def longest_axis_deviation(
    east: FloatArray, north: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Return an error ellipse's largest standard deviation, from east, north and covariance."""
    mean, half = 0.5 * (east**2 + north**2), 0.5 * (east**2 - north**2)
    return np.asarray(np.sqrt(mean + np.hypot(half, covariance)))
