"""What all recorded traffic has in common: flights of samples, and what is suspicious of them."""

import re
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from components.aircraft.aircraft import OWNSHIP, Aircraft, Roster
from components.aircraft.equipage import EquipageShares, draw_equipage
from components.flights.attitude import MEDIAN_AZIMUTH_ERROR_DEG
from components.flights.closest_approach import KnownTimes, SampleTimes
from components.flights.fleet import Trajectory
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.formats.text_rows import TrafficFile
from components.geometry import line_of_sight_ned
from components.traffic.heights import Heights
from components.traffic.scripted import Ownship
from components.traffic.source import SourceParameters, TrafficSource
from components.traffic.wind_effect import CrabAngles
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import ScenePath
from dsa_des.errors import did_you_mean

#: Beyond any aircraft: m/s along the path and upward, m/s², and metres above the ellipsoid.
FASTEST_MPS, CLIMB_MPS, ACCELERATION_MPS2, HIGHEST_M = 1000.0, 200.0, 150.0, 25_000.0
#: No aircraft in flight is slower on the whole, but for balloons and helicopters.
_SLOWEST_MPS = 3.0
#: Shares of the run that may be missing without a word.
_MISSING = 0.02
_RADIANS = ("latitude", 1.6, "longitude", 3.2)


def implausible_motion_sentences(aircraft: Sequence[SampledTrajectory]) -> list[str]:
    """Return a sentence per kind of implausible motion, with its aircraft and likely wrong unit."""
    by_hint: dict[str, list[str]] = {}
    for craft in aircraft:
        for what, hint in _implausible_motion(craft):
            by_hint.setdefault(hint, []).append(f"{craft.name}: {what}")
    return [f"{_list_few(cases)}; {hint}" for hint, cases in by_hint.items()]


def _list_few(cases: Sequence[str]) -> str:
    more = f" (and {len(cases) - 1} more aircraft)" if len(cases) > 1 else ""
    return cases[0] + more


def _implausible_motion(craft: SampledTrajectory) -> list[tuple[str, str]]:
    """Return text pairs: what is implausible in a motion, and what may be wrong with the file."""
    oddities: list[tuple[str, str]] = []
    highest = float(np.max(craft.alt_m))
    if highest > HIGHEST_M:
        oddities.append((f"it flies at {highest:,.0f} m", "are altitudes in feet read as metres?"))
    if craft.velocity_was_ignored:
        oddities.append(
            (
                "its velocities are not those of its path and are not used",
                "are knots read as m/s, or feet as metres?",
            )
        )
    time_s = craft.sample_times_s
    if len(time_s) < 2:
        return oddities
    velocity = _velocities(craft)
    speed = np.linalg.norm(velocity, axis=0)
    fastest, climb = float(speed.max()), float(np.abs(velocity[2]).max())
    if climb > CLIMB_MPS and fastest <= FASTEST_MPS:
        hint = "are altitudes in feet read as metres, or times in minutes as seconds?"
        oddities.append((f"it climbs or sinks at {climb:,.0f} m/s", hint))
    if fastest > FASTEST_MPS:
        what = f"its positions imply {fastest:,.0f} m/s"
        oddities.append((what, _hint_for_high_speed(float(np.median(speed)))))
    elif len(time_s) > 2:
        change = np.linalg.norm(np.diff(velocity, axis=1), axis=0)
        per_s2 = change / (0.5 * (time_s[2:] - time_s[:-2]))
        sharpest = float(per_s2.max())
        if sharpest > ACCELERATION_MPS2:
            hint = "are times rounded, positions of two aircraft mixed, or feet read as metres?"
            oddities.append((f"its positions imply {sharpest:,.0f} m/s²", hint))
    _, most_lat, _, most_lon = _RADIANS
    near_zero = np.abs(craft.lat_deg).max() < most_lat and np.abs(craft.lon_deg).max() < most_lon
    slow = 0.0 < float(np.median(speed)) < _SLOWEST_MPS
    if slow and near_zero:
        what = f"its positions imply {float(np.median(speed)):.2g} m/s near 0° N 0° E"
        oddities.append((what, "are latitude and longitude in radians read as degrees?"))
    return oddities


def _hint_for_high_speed(typical_mps: float) -> str:
    if typical_mps <= FASTEST_MPS:
        return "are positions of two aircraft mixed, or single ones wrong?"
    return (
        "are positions in degrees read as radians, nautical miles as metres, or times in s as ms?"
    )


def _velocities(craft: SampledTrajectory) -> FloatArray:
    """Return north, east and down velocities (3, n - 1) between samples, m/s."""
    lat, lon, alt = craft.lat_deg, craft.lon_deg, craft.alt_m
    steps = line_of_sight_ned(lat[:-1], lon[:-1], alt[:-1], lat[1:], lon[1:], alt[1:])
    return np.asarray(np.stack(steps) / np.diff(craft.sample_times_s))


def _short_presence_warnings(
    own: Trajectory, others: Sequence[SampledTrajectory], duration_s: float
) -> list[str]:
    """Return a warning if the ownship, or else others, are there for clearly less than the run."""
    lines = []
    first, last = own.interval_present()
    shared = max(0.0, min(last, duration_s) - max(first, 0.0))
    hint = "is time in ms, min or h read as s, or duration_s not that of the file?"
    if shared < (1.0 - _MISSING) * duration_s:
        lines.append(
            f"the ownship {own.name} is there for {shared:g} s of the run's "
            f"{duration_s:g} s; {hint}"
        )
        return lines
    parts = []
    for craft in others:
        first, last = craft.interval_present()
        there = max(0.0, min(last, duration_s) - max(first, 0.0))
        if there < (1.0 - _MISSING) * duration_s:
            parts.append(f"{craft.name} for {there:g} s")
    if parts:
        shown = ", ".join(parts[:3]) + (", ..." if len(parts) > 3 else "")
        lines.append(
            f"{len(parts)} of {len(others)} intruders are there for only a part of the "
            f"run's {duration_s:g} s ({shown}); where that is not so, {hint}"
        )
    return lines


def derived_attitude_report(content: TrafficFile) -> dict[str, Any]:
    """Return, for yaw, pitch and roll, the names of the aircraft whose angle was derived from the
    path, and the median azimuth error if yaw is.
    """
    names: dict[str, Any] = {}
    for angle in ("yaw", "pitch", "roll"):
        of = [craft.name for craft in content.aircraft if angle in craft.derived_attitude]
        if of:
            names[angle] = of
    if "yaw" in names:
        names["median_azimuth_error_deg"] = MEDIAN_AZIMUTH_ERROR_DEG
    return names


class RecordedTrafficParameters(SourceParameters, Heights):
    """Parameters of recorded traffic."""

    intruder: Aircraft = Field(
        default=Aircraft(), description="What every intruder is, unless `aircraft` names it."
    )
    aircraft: dict[str, Aircraft] = Field(
        default={}, description="What single intruders are, by their names in the file."
    )
    equipage_shares: EquipageShares = Field(
        default=EquipageShares(), description="Shares of intruders that carry their equipage."
    )


class FileParameters(RecordedTrafficParameters):
    """Parameters of traffic in one file."""

    file: ScenePath = Field(description="The traffic file.")


class RecordedTraffic(TrafficSource):
    """Traffic from a file: positions between samples are interpolated, none are extrapolated.

    Time 0 is the file's earliest sample.
    """

    Parameters: ClassVar[Any] = FileParameters
    effects = (CrabAngles(),)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.content = self._flights_in_scene_air(self.read())
        self.own = self.own_flight()
        others = [craft for craft in self.content.aircraft if craft is not self.own]
        self.targets = SampledFleet(others)
        self._sampled_s = [craft.sample_times_s for craft in others]
        self.roster = roster_of(
            self.own.name, [target.name for target in others], parameters.intruder,
            parameters.aircraft, self.files_text(),
        )  # fmt: skip
        if parameters.equipage_shares != EquipageShares():
            names, stream = self.roster.names, self.stream("equipage")
            shared = draw_equipage(names, self.roster.aircraft, parameters.equipage_shares, stream)
            own = self.roster.own_name, self.roster.own_aircraft[0]
            self.roster = Roster.from_pairs(list(zip(names, shared, strict=True)), own)

    def _set_ownship_properties(self, own: Ownship | None) -> None:
        """Set the ownship's name and properties in the roster to the scene's, if any."""
        if own is not None:
            self.roster = replace(self.roster, own_name=own.name, own_aircraft=(own,))

    def own_flight(self) -> Trajectory:
        """Return the ownship's flight: the file's first aircraft, unless the scene says another."""
        return self.content.ownship

    def files_text(self) -> str:
        """Return text that names the file in messages."""
        return str(self.p.file)

    def _flights_in_scene_air(self, content: TrafficFile) -> TrafficFile:
        """Return the flights, headings turned into the wind, heights above the ellipsoid.

        Noses are turned into its wind, and altitudes that are no heights are put at theirs.
        """
        wind, air = self.wind, self.air
        if wind is None and (air is None or self.p.heights == "geometric"):
            return content
        blows = (0.0, 0.0) if wind is None else (wind.east_mps, wind.north_mps)
        own, *intruders = (
            craft.with_derived_angles_in_wind(
                *blows, self.p.height_above_ellipsoid_m(air, craft.alt_m)
            )
            for craft in content.aircraft
        )
        return replace(content, ownship=own, intruders=intruders)

    def _pressure_altitude_warnings(self) -> list[str]:
        """Return a warning if pressure altitudes are flown as heights in non-standard air."""
        is_pressure = re.search("baro|pressure", self.content.height, re.IGNORECASE)
        if self.air is None or not is_pressure or self.p.heights != "geometric":
            return []
        off_m = float(self.air.pressure_altitude_m(1000.0)) - 1000.0
        return [
            f"its altitudes ({self.content.height}) are pressure altitudes and are flown as "
            f"heights, off by {off_m:+.0f} m at 1,000 m in the air of [weather]; heights = "
            "'pressure' puts them where it has these pressures"
        ]

    def read(self) -> TrafficFile:
        """Return the aircraft in the file."""
        raise TypeError(f"{type(self).__name__} reads no file")

    def natural_duration_s(self) -> Fraction:
        """Return the duration that the file suggests, s: the time up to its last sample."""
        last = self.content.end_s
        if last is None:
            last = max(craft.interval_present()[1] for craft in self.content.aircraft)
        # Zero-length recordings still have their one instant.
        return max(Fraction(repr(float(last))), Fraction(1, 10**9))

    def sample_times(self) -> list[SampleTimes]:
        """Return the file's sample times: the ownship's if recorded, and all targets'.

        They are the file's, also of who is steered.
        """
        times: list[SampleTimes] = []
        if isinstance(self.own, SampledTrajectory):
            times.append(KnownTimes(self.own.sample_times_s))
        if self._sampled_s:
            times.append(KnownTimes(*self._sampled_s))
        return times

    def warnings(self) -> list[str]:
        """Return warnings on skipped rows, pressure altitudes, implausible motion, absences."""
        duration_s = float(self.context.duration_s)
        lines = [
            *self.content.warnings, *self._pressure_altitude_warnings(),
            *implausible_motion_sentences(self.content.aircraft),
            *_short_presence_warnings(self.own, list(self.targets), duration_s),
        ]  # fmt: skip
        return [f"file {self.files_text()}: {line}" for line in lines]

    def report(self) -> dict[str, Any]:
        """Return closest approaches, clock time at time 0, notes and derived attitudes."""
        source: dict[str, Any] = {
            "start_time_s": self.content.start_time_s,
            "notes": self.content.notes,
        }
        if derived := derived_attitude_report(self.content):
            source["derived_attitude"] = derived
        return {**super().report(), "traffic": source}


def roster_of(
    own: str, names: Sequence[str], default: Aircraft, others: dict[str, Aircraft], what: str
) -> Roster:
    """Return the roster of named targets and ownship: `others` by name, `default` for the rest."""
    for name in others:
        if name not in (own, *names):
            raise ValueError(f"aircraft.{name}: {what} has no such aircraft"
                             f"{did_you_mean(name, names)}")  # fmt: skip
    targets = [(name, others.get(name, default)) for name in names]
    # An address said for intruders is theirs alone.
    own_craft = others.get(own, default.model_copy(update={"icao_address": None}))
    return Roster.from_pairs(targets, (OWNSHIP, own_craft))
