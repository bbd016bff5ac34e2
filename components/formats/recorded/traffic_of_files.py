"""The traffic of recorded files: which aircraft of which files, when and where, and who is own."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from components.formats.recorded.known_kinds import recording_of_file
from components.formats.recorded.selection import (
    choose_ownship,
    cut_to_space,
    cut_to_time,
    drop_aircraft,
    find_aircraft,
    join_recordings,
    move_flight,
)
from components.formats.recording import Recording, Samples
from components.formats.sample_columns import EPOCH_S, Altitude
from components.formats.text_rows import TrafficFile
from components.geometry import slant_range_m

_EVERYWHERE = (-90.0, 90.0, -180.0, 180.0)


@dataclass(frozen=True)
class TrafficChoice:
    """Which aircraft, times and places are taken from files; see ``traffic.file``'s parameters.

    Parameters
    ----------
    ownship : str, optional
        Name or callsign; by default the first aircraft.
    altitude : optional
    place : (latitude, longitude, altitude), optional
        Of radars that do not say it, and of an ``.xyz`` file's origin.
    own_file : Path, optional
        Whose `ownship` is flown among the aircraft of the other files.
    own_starts_s : float, optional
        When the ownship's first sample is flown, after the first one of the other files.
    own_moved : (north, east, up)
        How far the ownship's flight is moved, m.
    scripted : bool
        The ownship is in no file: all aircraft are others.
    from_s, to_s : float, optional
        After the earliest sample; time 0 is at `from_s`, else at the first sample of `own_file` or
        of all.
    box : (south, north, west, east)
        Degrees; the others are there inside of it only.
    heights : (lowest, highest)
    longest_gap_s : float, optional
    without : tuple of str
        Names or callsigns of aircraft that are left out.
    geoid_m : float
        How high sea level lies above the ellipsoid, where it is said.
    """

    ownship: str | None = None
    altitude: Altitude | None = None
    place: tuple[float, float, float] | None = None
    own_file: Path | None = None
    own_starts_s: float | None = None
    own_moved: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scripted: bool = False
    from_s: float | None = None
    to_s: float | None = None
    box: tuple[float, float, float, float] | None = None
    heights: tuple[float, float] = (-math.inf, math.inf)
    longest_gap_s: float | None = None
    without: tuple[str, ...] = ()
    geoid_m: float = 0.0


def read_traffic(paths: Sequence[Path], choice: TrafficChoice) -> TrafficFile:
    """Read recorded files and return the chosen flights, the ownship's first.

    TrafficFileError says all that is wrong.
    """
    names = [path.stem for path in paths]
    each = (_recording_above_ellipsoid(path, choice) for path in paths)
    whole = drop_aircraft(join_recordings(zip(names, each, strict=True)), choice.without)
    start_s = _earliest_time_s(whole)
    own = {} if choice.scripted else _ownship_samples(whole, choice, start_s)
    others = {name: columns for name, columns in whole.samples.items() if name not in own}
    begin_s, end_s = _begin_and_end_s(choice, start_s, own)
    kept = {}
    for name, columns in others.items():
        inside: Samples | None = cut_to_time(columns, begin_s, end_s)
        if inside is not None and (choice.box or choice.heights != TrafficChoice.heights):
            inside = cut_to_space(inside, choice.box or _EVERYWHERE, choice.heights)
        if inside is not None:
            kept[name] = inside
    if others and not kept:
        _refuse_absent(whole, others, begin_s, end_s)
    if len(kept) < len(others):
        gone = len(others) - len(kept)
        said = f"{gone} of {len(others)} aircraft are not there in the time and place chosen"
        whole.notes.harmless.append(said)
    for name, columns in own.items():
        own[name] = cut_to_time(columns, begin_s, end_s) or columns
    file = replace(whole, samples=own | kept).flights(choice.longest_gap_s, begin_s)
    if own:
        _warn_of_own_transponder(file)
    return file if math.isinf(end_s) else replace(file, end_s=end_s - begin_s)


def _recording_above_ellipsoid(path: Path, choice: TrafficChoice) -> Recording:
    """Return a recording, its sea-level heights made ellipsoidal if the geoid's height is given."""
    one = recording_of_file(path, choice.altitude, choice.place)
    if choice.geoid_m and one.above_sea:
        for name in one.above_sea:
            one.samples[name]["alt"] = one.samples[name]["alt"] + choice.geoid_m
        said = f"{one.height}: above sea level, flown {choice.geoid_m:+g} m above the ellipsoid"
        one.notes.harmless.append(said + " ([terrain] geoid_undulation_m)")
        one.height = re.sub(" above mean sea level|_?msl", "", one.height, flags=re.IGNORECASE)
    return one


def _earliest_time_s(recording: Recording) -> float:
    return min((float(c["time"][0]) for c in recording.samples.values()), default=0.0)


def _ownship_samples(whole: Recording, choice: TrafficChoice, start_s: float) -> dict[str, Samples]:
    """Return the ownship's samples, moved as chosen, under a name that no other aircraft has."""
    if choice.own_file is None:
        own = next(iter(whole.samples)) if choice.ownship is None else find_aircraft(
            whole.problems, whole, choice.ownship
        )  # fmt: skip
        whole.samples = choose_ownship(whole, own).samples
        called, columns = own, whole.samples[own]
    else:
        flight = _recording_above_ellipsoid(choice.own_file, choice)
        own = next(iter(flight.samples)) if choice.ownship is None else find_aircraft(
            flight.problems, flight, choice.ownship
        )  # fmt: skip
        columns, called = flight.samples[own], own
        while called in whole.samples:
            called += " (own)" if called == own else "'"
        whole.notes.add(flight.notes, choice.own_file.name)
        if flight.height != whole.height:
            said = f"heights of the ownship: {flight.height}; of the others: {whole.height}"
            whole.notes.warnings.append(said)
    later_s = 0.0
    if choice.own_starts_s is not None:
        others = replace(whole, samples={n: c for n, c in whole.samples.items() if n != called})
        first_s = _earliest_time_s(others) if others.samples else start_s
        later_s = first_s + choice.own_starts_s - float(columns["time"][0])
    return {called: move_flight(columns, later_s, *choice.own_moved)}


def _begin_and_end_s(
    choice: TrafficChoice, start_s: float, own: dict[str, Samples]
) -> tuple[float, float]:
    """Return the first and last time (s) that are flown; the last is infinite if unlimited."""
    begin_s, end_s = start_s, math.inf
    for columns in own.values():
        if choice.own_file is not None:
            begin_s, end_s = float(columns["time"][0]), float(columns["time"][-1])
        elif choice.own_starts_s is not None:
            begin_s = min(start_s, float(columns["time"][0]))
    if choice.from_s is not None:
        begin_s = start_s + choice.from_s
    if choice.to_s is not None:
        end_s = start_s + choice.to_s
    return begin_s, end_s


def _refuse_absent(
    whole: Recording, others: dict[str, Samples], begin_s: float, end_s: float
) -> None:
    first_s = min(float(c["time"][0]) for c in others.values())
    last_s = max(float(c["time"][-1]) for c in others.values())
    ends = f" to {instant_as_text(end_s)}" if math.isfinite(end_s) else " on"
    whole.problems.fail(
        f"no other aircraft is there from {instant_as_text(begin_s)}{ends}, in the box and "
        f"between the "
        f"heights that are chosen: the files hold {instant_as_text(first_s)} to "
        f"{instant_as_text(last_s)}; from_s and "
        "to_s, or own_starts_s, choose another time"
    )


#: Who stays nearer to the ownship than this, at so many of its samples, is the ownship itself. A
#: pressure altitude and a geometric one may differ by as much as the third.
_ITSELF_M, _OFTEN, _OF_ITS_HEIGHT_M = 150.0, 10, 500.0


def _warn_of_own_transponder(file: TrafficFile) -> None:
    """Warn of an intruder that stays at the ownship, as it may be its own transponder."""
    own = file.ownship
    for craft in file.intruders:
        there = craft.at(own.sample_times_s)
        here = there.present
        if np.count_nonzero(here) < _OFTEN:
            continue
        apart = slant_range_m(
            own.lat_deg[here], own.lon_deg[here], own.alt_m[here], there.lat_deg[here],
            there.lon_deg[here], own.alt_m[here],
        )  # fmt: skip
        higher = float(np.median(np.abs(own.alt_m[here] - there.alt_m[here])))
        if (median := float(np.median(apart))) < _ITSELF_M and higher < _OF_ITS_HEIGHT_M:
            file.warnings.append(
                f"{craft.name} stays within {median:.0f} m of the ownship {own.name}: if it is its "
                f"own transponder, without = [{craft.name!r}] leaves it out"
            )


def instant_as_text(time_s: float) -> str:
    """Return an instant as text for people: in UTC where the clock counts from 1970."""
    if not EPOCH_S < time_s < 4e9:
        return f"{time_s:.1f} s"
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d %H:%M:%S} UTC"
