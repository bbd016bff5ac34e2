"""Recorded traffic in files of any known kind (``traffic.file``), with an own flight among it.

``traffic.daa_file`` reads those of DAIDALUS alone.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from components.flights.fleet import Trajectory
from components.formats.daa_file import read_daa
from components.formats.recorded.traffic_of_files import TrafficChoice, read_traffic
from components.formats.sample_columns import Altitude
from components.formats.text_rows import TrafficFile
from components.traffic.recorded import (
    FileParameters,
    RecordedTraffic,
    RecordedTrafficParameters,
)
from components.traffic.scripted import Ownship, scripted_flight
from dsa_des.block.component import Parameters, ScenePath
from dsa_des.files.input_files import cache_file_reads, is_folder


class Box(Parameters):
    """Limits of latitude and longitude within which aircraft are taken from files."""

    south_deg: float = Field(default=-90.0, ge=-90, le=90, description="Southern edge, deg.")
    north_deg: float = Field(default=90.0, ge=-90, le=90, description="Northern edge, deg.")
    west_deg: float = Field(default=-180.0, ge=-360, le=360, description="Western edge, deg.")
    east_deg: float = Field(
        default=180.0, ge=-360, le=360,
        description="Eastern edge, deg; below the western one across the antimeridian.",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_not_empty(self) -> Self:
        if self.north_deg <= self.south_deg:
            raise ValueError(
                f"north_deg is {self.north_deg:g}: it must be above south_deg, {self.south_deg:g}"
            )
        return self

    def south_north_west_east_deg(self) -> tuple[float, float, float, float]:
        """Return south, north, west and east limit, deg; the east > west, over 180 if needed."""
        east = self.east_deg
        while east <= self.west_deg:
            east += 360.0
        return self.south_deg, self.north_deg, self.west_deg, east


class Moved(Parameters):
    """Offset north, east and up by which a flight is shifted without changing its shape."""

    north_m: float = Field(default=0.0, description="To the north, m.")
    east_m: float = Field(default=0.0, description="To the east, m.")
    up_m: float = Field(default=0.0, description="Up, m.")


class Place(Parameters):
    """Geodetic position: latitude (deg), longitude (deg) and altitude (m)."""

    lat_deg: float = Field(ge=-90, le=90, description="Latitude, deg.")
    lon_deg: float = Field(ge=-360, le=360, description="Longitude, deg.")
    alt_m: float = Field(default=0.0, description="Altitude, m.")


class FileTrafficParameters(RecordedTrafficParameters):
    """Parameters of recorded traffic of any kind."""

    file: ScenePath | list[ScenePath] = Field(
        description="The file, or several as one traffic, or a folder of such."
    )
    ownship: str | None = Field(
        default=None,
        description="Name, address or callsign of the ownship; by default the first aircraft.",
    )
    altitude: Altitude | None = Field(
        default=None,
        description="Which altitude is read, of a file with both. By default of tables the column "
        "that the list of names has first, else the barometric one; aircraft that report none of "
        "that kind fly at the other, as a note says.",
    )
    place: Place | None = Field(
        default=None,
        description="Where radars are whose plots are flown and that do not say it (ASTERIX 048), "
        "and the origin of an .xyz file.",
    )
    own_file: ScenePath | None = Field(
        default=None,
        description="Another file with the ownship's flight; time 0 is its first sample.",
    )
    own_flight: Ownship | None = Field(
        default=None,
        description="The ownship's flight, as `traffic.scripted` has it, from time 0 on.",
    )
    own_starts_s: float | None = Field(
        default=None,
        description="When the ownship's recorded flight begins, after the first sample of the "
        "others, s; by default as it was recorded.",
    )
    own_moved: Moved = Field(
        default=Moved(), description="How far the ownship's recorded flight is moved."
    )
    from_s: float | None = Field(
        default=None, description="Time 0, after the earliest sample of `file`, s."
    )
    to_s: float | None = Field(
        default=None, description="When it ends, after the earliest sample of `file`, s."
    )
    box: Box | None = Field(default=None, description="Others are there only inside of it.")
    lowest_m: float | None = Field(
        default=None, description="Others are there only from this altitude on, m."
    )
    highest_m: float | None = Field(default=None, description="And up to this one, m.")
    longest_gap_s: float | None = Field(
        default=None,
        gt=0,
        description="An aircraft without a sample for longer is not there in between, s; by "
        "default 30 s, or ten times its usual step where that is longer.",
    )
    without: list[str] = Field(
        default=[], description="Names or callsigns of aircraft that are left out."
    )

    @model_validator(mode="after")
    def _check_one_ownship(self) -> Self:
        if self.own_flight is not None:
            for key in ("own_file", "ownship", "own_starts_s"):
                if getattr(self, key) is not None:
                    raise ValueError(f"own_flight and {key} are given: only one says the ownship")
        if self.to_s is not None and self.to_s <= (self.from_s or 0.0):
            raise ValueError(f"to_s is {self.to_s:g}: it must be above from_s")
        return self

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of all traffic files; a folder stands for its files, sorted by name."""
        found: list[Path] = []
        for path in self.file if isinstance(self.file, list) else [self.file]:
            if is_folder(path):
                inside = sorted(p for p in path.iterdir() if p.is_file() and p.name[0] != ".")
                if not inside:
                    raise ValueError(f"file: {path}: the folder holds no file")
                found += inside
            else:
                found.append(path)
        if not found:
            raise ValueError("file: must name at least one file")
        return tuple(found)

    def traffic_choice(self) -> TrafficChoice:
        """Return which aircraft, times, heights and area of the files to take, and the ownship."""
        lowest, highest = self.lowest_m, self.highest_m
        offset, place = self.own_moved, self.place
        return TrafficChoice(
            place=None if place is None else (place.lat_deg, place.lon_deg, place.alt_m),
            ownship=self.ownship,
            altitude=self.altitude,
            own_file=self.own_file,
            own_starts_s=self.own_starts_s,
            own_moved=(offset.north_m, offset.east_m, offset.up_m),
            scripted=self.own_flight is not None,
            from_s=self.from_s,
            to_s=self.to_s,
            box=None if self.box is None else self.box.south_north_west_east_deg(),
            heights=(
                -math.inf if lowest is None else lowest, math.inf if highest is None else highest
            ),
            longest_gap_s=self.longest_gap_s,
            without=tuple(self.without),
        )  # fmt: skip


class FileTraffic(RecordedTraffic):
    """Traffic from files of any known format; the ownship is one of the aircraft or scripted.

    Receivers' logs and services' downloads, tables, GPX, KML, IGC, logs of PX4 and MAVLink, ASTERIX
    (062, 021; also captured), DAIDALUS: which it is shows in the content.
    """

    Parameters = FileTrafficParameters
    lockstep = True

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self._set_ownship_properties(parameters.own_flight)

    def read(self) -> TrafficFile:
        """Return the selected flights of the files, with heights above the ellipsoid."""
        air = self.air if self.p.heights == "geometric" else None
        return read_selected_traffic(self.p, 0.0 if air is None else air.geoid_m)

    def own_flight(self) -> Trajectory:
        """Return the ownship's flight, recorded or scripted."""
        if (given := self.p.own_flight) is None:
            return self.content.ownship
        own = given.with_ellipsoid_heights(self.air)
        return scripted_flight(own, own.start, self.wind)

    def files_text(self) -> str:
        """Return text that names the files in messages: the first one, and how many more."""
        first, *others = self.p.paths()
        return f"{first} and {len(others)} more" if others else str(first)


class DaaFileParameters(FileParameters):
    """Parameters of a DAIDALUS traffic file."""

    reference_lat_deg: float = Field(
        default=0.0, ge=-90, le=90, description="Reference point of an .xyz file: latitude, deg."
    )
    reference_lon_deg: float = Field(default=0.0, description="Its longitude, deg.")
    reference_alt_m: float = Field(default=0.0, description="Its altitude, m.")


class DaaFile(RecordedTraffic):
    """Traffic from a DAIDALUS .daa or .xyz file; the first aircraft named is the ownship."""

    Parameters = DaaFileParameters
    lockstep = True

    def read(self) -> TrafficFile:
        """Return the aircraft in the DAIDALUS traffic file."""
        p = self.p
        return _read_daa(p.file, p.reference_lat_deg, p.reference_lon_deg, p.reference_alt_m)


def read_selected_traffic(parameters: FileTrafficParameters, geoid_m: float = 0.0) -> TrafficFile:
    """Return the aircraft selected from the files; `geoid_m`: sea level above the ellipsoid, m."""
    choice = replace(parameters.traffic_choice(), geoid_m=geoid_m)
    content: TrafficFile = _read(parameters.paths(), choice)
    return content


#: Earlier names of what reads files of any kind.
CsvFile = AsterixFile = FileTraffic

_read = cache_file_reads(4)(read_traffic)
_read_daa = cache_file_reads(4)(read_daa)
