"""Recorded traffic: flights read from files (``traffic.daa_file``, ``traffic.csv``)."""

from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from components.aircraft.aircraft import Aircraft
from components.traffic.attitude_from_path import MEDIAN_AZIMUTH_ERROR_DEG
from components.traffic.csv_file import read_csv
from components.traffic.daa_file import read_daa
from components.traffic.fleet import SampledFleet
from components.traffic.flight_protocols import Trajectory
from components.traffic.sample_times import OwnTimes, SampleTimes, SharedTimes
from components.traffic.source import SourceParameters, TrafficSource, roster_of
from components.traffic.suspicious import suspicions
from components.traffic.traffic_file import TrafficFile
from components.traffic.wind import scene_wind
from components.traffic.wind_effect import CrabAngles
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import ScenePath


def derived_attitude(content: TrafficFile) -> dict[str, Any]:
    """Say whose attitude was derived from the path, and how wrong that is known to be.

    Parameters
    ----------
    content : TrafficFile

    Returns
    -------
    dict
        ``yaw``, ``pitch`` and ``roll``, each the names of aircraft without it in the file, and
        ``median_azimuth_error_deg`` where yaw is among them; empty where all was measured.
    """
    names: dict[str, Any] = {}
    for angle in ("yaw", "pitch", "roll"):
        of = [craft.name for craft in content.aircraft if angle in craft.derived_attitude]
        if of:
            names[angle] = of
    if "yaw" in names:
        names["median_azimuth_error_deg"] = MEDIAN_AZIMUTH_ERROR_DEG
    return names


class FileParameters(SourceParameters):
    """Parameters of recorded traffic."""

    file: ScenePath = Field(description="The traffic file.")
    intruder: Aircraft = Field(
        default=Aircraft(), description="What every intruder is, unless `aircraft` names it."
    )
    aircraft: dict[str, Aircraft] = Field(
        default={}, description="What single intruders are, by their names in the file."
    )


class DaaFileParameters(FileParameters):
    """Parameters of a DAIDALUS traffic file."""

    reference_lat_deg: float = Field(
        default=0.0, ge=-90, le=90, description="Reference point of an .xyz file: latitude, deg."
    )
    reference_lon_deg: float = Field(default=0.0, description="Its longitude, deg.")
    reference_alt_m: float = Field(default=0.0, description="Its altitude, m.")


class CsvParameters(FileParameters):
    """Parameters of a CSV traffic file."""

    ownship: str | None = Field(
        default=None, description="Name of the ownship; by default the first aircraft named."
    )


class RecordedTraffic(TrafficSource):
    """Traffic from a file: positions between samples are interpolated, none are extrapolated.

    Time 0 is the file's earliest sample.
    """

    Parameters = FileParameters
    effects = (CrabAngles(),)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.content = self._in_wind(self.read())
        self.own = self.content.ownship
        self.targets = self.content.intruders
        self.fleet = SampledFleet(self.content.intruders)
        self.roster = roster_of(
            [target.name for target in self.content.intruders],
            parameters.intruder,
            parameters.aircraft,
            str(parameters.file),
        )

    def _in_wind(self, content: TrafficFile) -> TrafficFile:
        """Return the flights with noses turned into the scene's wind, where there is one."""
        wind = scene_wind(self.context.sections.get("weather"))
        if wind is None:
            return content
        own, *intruders = (
            craft.in_wind(wind.east_mps, wind.north_mps) for craft in content.aircraft
        )
        return TrafficFile(own, intruders, content.start_time_s, content.notes)

    def read(self) -> TrafficFile:
        """Return the content of the file."""
        raise TypeError(f"{type(self).__name__} reads no file")

    def natural_duration_s(self) -> Fraction:
        """Return the time from the file's first sample to its last."""
        last = max(craft.interval_present()[1] for craft in self.content.aircraft)
        # Zero-length recordings still have their one instant.
        return max(Fraction(repr(float(last))), Fraction(1, 10**9))

    def sample_times_s(self, target: Trajectory) -> FloatArray:
        """Return the file's own sample times of the target and the ownship."""
        own: FloatArray = self.content.ownship.sample_times_s
        other: FloatArray = target.sample_times_s  # type: ignore[attr-defined]
        return np.union1d(own, other)

    def sample_times(self) -> list[SampleTimes]:
        """Return the sample times of the ownship, and those of each target."""
        if not self.targets:
            return [SharedTimes(self.content.ownship.sample_times_s)]
        each = OwnTimes([target.sample_times_s for target in self.content.intruders])
        return [SharedTimes(self.content.ownship.sample_times_s), each]

    def warnings(self) -> list[str]:
        """Say what no aircraft does, and which error of units it looks like."""
        lines = suspicions(self.content, float(self.context.duration_s))
        return [f"file {self.p.file}: {line}" for line in lines]

    def report(self) -> dict[str, Any]:
        """Return closest approaches, and what the file's own clock said at time 0."""
        source: dict[str, Any] = {
            "start_time_s": self.content.start_time_s,
            "notes": self.content.notes,
        }
        if derived := derived_attitude(self.content):
            source["derived_attitude"] = derived
        return {**super().report(), "traffic": source}


class DaaFile(RecordedTraffic):
    """Traffic from a DAIDALUS .daa or .xyz file; the first aircraft named is the ownship."""

    Parameters = DaaFileParameters
    lockstep = True

    def read(self) -> TrafficFile:
        """Return the content of the file."""
        reference = (self.p.reference_lat_deg, self.p.reference_lon_deg, self.p.reference_alt_m)
        try:
            state = self.p.file.stat()
        except (OSError, ValueError):  # the reader says what is wrong with it
            return _read_daa(self.p.file, None, reference)
        return _read_daa(self.p.file, (state.st_mtime_ns, state.st_size), reference)


@lru_cache(maxsize=4)
def _read_daa(path: Path, state: Any, reference: tuple[float, float, float]) -> TrafficFile:
    """Read a file; the replicas of a study read the same one over and over."""
    lat_deg, lon_deg, alt_m = reference
    return read_daa(
        path, reference_lat_deg=lat_deg, reference_lon_deg=lon_deg, reference_alt_m=alt_m
    )


class CsvFile(RecordedTraffic):
    """Traffic from a CSV file with time, id, latitude, longitude and altitude (ADS-B-like)."""

    Parameters = CsvParameters
    lockstep = True

    def read(self) -> TrafficFile:
        """Return the content of the file."""
        return read_csv(self.p.file, self.p.ownship)
