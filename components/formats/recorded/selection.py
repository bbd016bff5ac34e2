"""What is taken of recordings: several as one, a window of time and space, an own flight."""

import re
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from components.formats.recording import Recording, Samples
from components.formats.text_rows import MOST_PROBLEMS, Problems
from components.geometry import enu_to_geodetic, line_of_sight_ned
from dsa_des.arrays.types import BoolArray
from dsa_des.text.safe_text import shorten

#: Reports of one aircraft from another receiver within this time say nothing new, s.
_SAME_S = 1.0
#: An address of ICAO, which is one aircraft's whoever heard it.
_ADDRESS = re.compile(r"~?[0-9a-fA-F]{6}")
AWAY = "away"


def join_recordings(recordings: Iterable[tuple[str, Recording]]) -> Recording:
    """Return one recording of several files' aircraft; the first file's first stays first.

    An aircraft that several receivers heard is one by its address: later files fill in where those
    before heard nothing of it for a second. Others of one name are told apart by their files.
    """
    each = iter(recordings)
    first_file, whole = next(each)
    samples = dict(whole.samples)
    by_address = {name.lower(): name for name in samples if _ADDRESS.fullmatch(name)}
    names = dict.fromkeys(samples, first_file)
    heights, callsigns = {whole.height}, dict(whole.callsigns)
    both = 0
    for file, one in each:
        whole.notes.add(one.notes, file)
        heights.add(one.height)
        for name, columns in one.samples.items():
            known = by_address.get(name.lower()) if _ADDRESS.fullmatch(name) else None
            if known is not None:
                samples[known], both = _join_samples(samples[known], columns), both + 1
                continue
            called = name if name not in samples else f"{name} ({file})"
            while called in samples:
                called += "'"
            samples[called], names[called] = columns, file
            if _ADDRESS.fullmatch(name):
                by_address[name.lower()] = called
        callsigns |= one.callsigns
    if both:
        said = f"{both} aircraft are in more than one file and count once, by their addresses"
        whole.notes.harmless.append(said)
    if len(heights) > 1:
        said = ", ".join(sorted(heights))
        whole.notes.warnings.append(f"heights of several kinds are flown together: {said}")
    return replace(whole, samples=samples, callsigns=callsigns, height=", ".join(sorted(heights)))


def _join_samples(first: Samples, other: Samples) -> Samples:
    """Return an aircraft's samples with another file's at times when it has none close by."""
    times = first["time"]
    after = np.searchsorted(times, other["time"])
    gap = np.full(len(other["time"]), np.inf)
    for near in (np.clip(after - 1, 0, None), np.minimum(after, len(times) - 1)):
        gap = np.minimum(gap, np.abs(other["time"] - times[near]))
    new = gap >= _SAME_S
    if not new.any():
        return first
    keys = [key for key in first if key in other]
    merged = {key: np.concatenate([first[key], other[key][new]]) for key in keys}
    order = np.argsort(merged["time"], kind="stable")
    return {key: values[order] for key, values in merged.items()}


def find_aircraft(problems: Problems, recording: Recording, name: str) -> str:
    """Return an aircraft's name by name or callsign, in any case; error if none or several fit."""
    if name in recording.samples:
        return name
    low = name.strip().lower()
    found = [one for one in recording.samples if one.lower() == low]
    found += [
        one
        for one, callsign in recording.callsigns.items()
        if callsign.lower() == low and one in recording.samples
    ]
    if len(found) == 1:
        return found[0]
    known = [shorten(one) for one in recording.samples]
    more = ", …" if len(known) > MOST_PROBLEMS else ""
    what = f"several are called {name!r}" if found else f"there is no aircraft {name!r}"
    problems.fail(f"{what}: it must be one of {', '.join(known[:MOST_PROBLEMS])}{more}")


def drop_aircraft(recording: Recording, names: Collection[str]) -> Recording:
    """Return the recording without the aircraft that have the given names or callsigns."""
    gone = {find_aircraft(recording.problems, recording, name) for name in names}
    return replace(recording, samples={n: c for n, c in recording.samples.items() if n not in gone})


def choose_ownship(recording: Recording, own: str) -> Recording:
    """Return the recording with the named aircraft as the first one, which is the ownship."""
    first = {own: recording.samples[own]}
    return replace(recording, samples=first | recording.samples)


def move_flight(
    columns: Samples, later_s: float, north_m: float, east_m: float, up_m: float
) -> Samples:
    """Return a flight's samples ``later_s`` later and moved north, east and up (m)."""
    lat, lon, alt = (columns[key] for key in ("lat", "lon", "alt"))
    if north_m or east_m or up_m:
        start = (lat[0], lon[0], alt[0])
        own = [np.full(len(lat), part) for part in start]
        north, east, down = line_of_sight_ned(own[0], own[1], own[2], lat, lon, alt)
        at = [float(np.asarray(part)) for part in enu_to_geodetic(
            east_m, north_m, 0.0, reference_lat_deg=start[0], reference_lon_deg=start[1],
            reference_alt_m=start[2],
        )]  # fmt: skip
        lat, lon, alt = enu_to_geodetic(
            east, north, -down, reference_lat_deg=at[0], reference_lon_deg=at[1],
            reference_alt_m=start[2] + up_m,
        )  # fmt: skip
    return {**columns, "time": columns["time"] + later_s, "lat": lat, "lon": lon, "alt": alt}


def cut_to_time(columns: Samples, from_s: float, to_s: float) -> Samples | None:
    """Return samples from ``from_s`` to ``to_s`` and one beyond each; None if all lie outside."""
    times = columns["time"]
    if times[-1] < from_s or times[0] > to_s:
        return None
    first = max(int(np.searchsorted(times, from_s, side="right")) - 1, 0)
    end = min(int(np.searchsorted(times, to_s, side="left")) + 1, len(times))
    return {key: values[first:end] for key, values in columns.items()}


def cut_to_space(
    columns: Samples, box: tuple[float, float, float, float], heights: tuple[float, float]
) -> Samples | None:
    """Return samples in a box (south, north, west, east; deg) and height range (m), or None.

    Where an aircraft was outside it is away. None where it never is inside.
    """
    south, north, west, east = box
    lat, lon, alt = (columns[key] for key in ("lat", "lon", "alt"))
    inside: BoolArray = (lat >= south) & (lat <= north) & ((lon - west) % 360.0 <= (east - west))
    inside &= (alt >= heights[0]) & (alt <= heights[1])
    if inside.all():
        return columns
    kept = np.flatnonzero(inside)
    if not len(kept):
        return None
    left = np.diff(kept, append=kept[-1] + 1) > 1
    away = columns.get(AWAY, np.zeros(len(lat)))
    return {key: values[kept] for key, values in columns.items()} | {
        AWAY: np.maximum(away[kept], left)
    }
