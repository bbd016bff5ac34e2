"""What is recorded in a file, whatever its kind: samples of aircraft, and flights made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.flights.fleet import CELLS_AT_ONCE
from components.flights.sampled_flight import SampledTrajectory
from components.formats.text_rows import Problems, TrafficFile
from components.geometry import SEMI_MAJOR_AXIS_M, unit_vectors
from dsa_des.arrays.types import FloatArray, IntArray

#: No aircraft, and no spacecraft, flies so far from one sample to the next, m/s.
_FASTEST_MPS = 1e6
#: An aircraft is away where it is silent for longer than this, s, and than so many times its
#: usual step.
_SILENT_S, _SILENT_STEPS = 30.0, 10.0

#: Columns of one aircraft: time (s), lat, lon (deg), alt (m), ve, vn, vu (m/s), yaw, ... (deg).
Samples = dict[str, FloatArray]


class ReadingNotes:
    """Notes on reading: what was assumed, reordered, left out; and warnings of changed flights."""

    def __init__(self) -> None:
        self.harmless: list[str] = []
        self.warnings: list[str] = []
        self._of_aircraft: dict[tuple[str, bool], list[str]] = {}

    def note_aircraft(self, name: str, kind: str, text: str, *, harmless: bool = False) -> None:
        """Add a note on one aircraft; a kind's notes are reported as the first and a count."""
        cases = self._of_aircraft.setdefault((kind, harmless), [])
        if f"{name}: {text}" not in cases[-1:]:
            cases.append(f"{name}: {text}")

    def summarize_aircraft_notes(self) -> None:
        """Append aircraft notes, summed up by kind, to the file's harmless notes or warnings."""
        for (_, harmless), cases in self._of_aircraft.items():
            more = f" (and {len(cases) - 1} more aircraft)" if len(cases) > 1 else ""
            (self.harmless if harmless else self.warnings).append(cases[0] + more)
        self._of_aircraft.clear()

    def add(self, other: ReadingNotes, file: str) -> None:
        """Add the notes of another file, each behind that file's name."""
        other.summarize_aircraft_notes()
        self.summarize_aircraft_notes()
        self.harmless += [f"{file}: {text}" for text in other.harmless]
        self.warnings += [f"{file}: {text}" for text in other.warnings]


@dataclass
class Recording:
    """The aircraft of a file as columns of samples, before they become flights.

    Parameters
    ----------
    problems : Problems
        Of its file.
    samples : dict
        Columns by aircraft, the ownship's first; times are the file's own.
    notes : ReadingNotes
    kind, units, height : str
        What the file is, in which units it says things, and which height is read.
    callsigns : mapping
        By the names of aircraft, which are addresses.
    above_sea : sequence of str
        Whose heights are above mean sea level, as the file says.
    """

    problems: Problems
    samples: dict[str, Samples]
    notes: ReadingNotes
    kind: str = ""
    units: str = ""
    height: str = ""
    callsigns: Mapping[str, str] = field(default_factory=dict)
    above_sea: Sequence[str] = ()

    def flights(
        self, longest_gap_s: float | None = math.inf, start_s: float | None = None
    ) -> TrafficFile:
        """Return the aircraft as flights, the first one as the ownship, and empty the recording.

        Their times count from `start_s`, by default from the earliest sample.
        Where samples are further apart than `longest_gap_s`, an aircraft is not there in between;
        None takes 30 s, or ten times the aircraft's usual step where that is longer.
        TrafficFileError says all that is wrong.
        """
        start = start_s
        if start is None:
            start = min(float(columns["time"][0]) for columns in self.samples.values())
        made = []
        for name in list(self.samples):
            columns = self.samples.pop(name)  # columns of many rows are not held twice
            columns["time"] = subtract_start(columns["time"], start)
            for values in columns.values():
                values.flags.writeable = False  # its flight has them as they are
            made.append(self._flight(name, columns, longest_gap_s))
            if (speed_mps := made[-1].max_speed_mps) > _FASTEST_MPS:
                self.problems.add(
                    f"{name} flies at up to {speed_mps:.3g} m/s from one sample to the next: at "
                    f"most {_FASTEST_MPS:g} m/s can be meant"
                )
        self.problems.raise_if_any()
        self.notes.summarize_aircraft_notes()
        notes = [*self.notes.harmless, *self.notes.warnings]
        return TrafficFile(
            made[0], made[1:], start, notes, self.notes.warnings, None, self.kind, self.units,
            self.height,
        )  # fmt: skip

    def _flight(
        self, name: str, columns: Samples, longest_gap_s: float | None
    ) -> SampledTrajectory:
        velocity = None
        if {"ve", "vn", "vu"} <= columns.keys():
            velocity = (columns["ve"], columns["vn"], columns["vu"])
        angles: dict[str, Any] = {
            f"{key}_rad": np.radians(columns.pop(key))
            for key in ("yaw", "pitch", "roll")
            if key in columns
        }
        steps = np.diff(columns["time"])
        usual_s = float(np.median(steps)) if len(steps) else 0.0
        silent_s = max(_SILENT_S, _SILENT_STEPS * usual_s)
        limit_s = silent_s if longest_gap_s is None else longest_gap_s
        away = np.append(steps > limit_s, False)
        if "away" in columns:
            away |= columns["away"] > 0.0
        trajectory = SampledTrajectory(
            name, columns["time"], columns["lat"], columns["lon"], columns["alt"],
            velocity_enu_mps=velocity, away=away, **angles,
        )  # fmt: skip
        if trajectory.velocity_was_ignored:
            self.notes.note_aircraft(
                name, "velocity",
                "its velocities do not fit its positions (another unit, or airspeed?) and were "
                "ignored", harmless=True,
            )  # fmt: skip
        if not len(steps):
            single = "has one sample only and is there at that instant only"
            self.notes.note_aircraft(name, "single", single, harmless=True)
        elif steps.max() > min(silent_s, limit_s):
            at = float(columns["time"][int(np.argmax(steps))])
            gaps = int(np.count_nonzero(steps > limit_s))
            then = "positions there are interpolated"
            if gaps:
                then = "it is not there" + (f", nor in {gaps - 1} more gaps" if gaps > 1 else "")
            self.notes.note_aircraft(
                name, "silence", f"no sample for {steps.max():.0f} s after {at:.1f} s; {then}"
            )
        return trajectory


def subtract_start(time_s: FloatArray, start_s: float) -> FloatArray:
    """Return times less the start, rounded so that large readings' rounding errors vanish.

    325374.3 - 325374.2 is 0.0999999999767 in doubles. The difference is rounded to the digits
    that the readings can hold (at most nanoseconds), so that a tenth of a second is the double
    0.1 and a scan at 0.1 s meets the sample itself.
    """
    elapsed = time_s - start_s
    largest = max(abs(start_s), -float(time_s.min()), float(time_s.max()))
    resolution = float(np.spacing(largest))
    decimals = min(9, math.floor(-math.log10(4.0 * resolution)))
    rounded = np.round(elapsed, decimals)
    return rounded if np.all(np.diff(rounded) > 0.0) else elapsed


# Faster than any aircraft, m/s; and how far a position may be off besides, where times are rounded.
_FASTEST_AIRCRAFT_MPS, _SLACK_M = 1000.0, 5000.0
# Fewer samples are positions gone wrong, and no aircraft.
_LEAST_SAMPLES = 3


def aircraft_number_of_samples(
    time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray
) -> IntArray:
    """Return each sample's aircraft number (names may be shared), from 0 by first samples.

    Samples are in the order of time. Each belongs to the aircraft whose last place is nearest if
    one could fly from there, else to another. Samples of none that has enough are the first one's.
    """
    number = np.zeros(len(time_s), dtype=np.int64)

    def places(rows: slice) -> FloatArray:
        return SEMI_MAJOR_AXIS_M * unit_vectors(
            np.radians(lon_deg[rows]), np.radians(lat_deg[rows])
        )

    def is_of_several(rows: slice) -> bool:
        steps_m = np.linalg.norm(np.diff(places(rows), axis=0), axis=1)
        return bool((steps_m > _FASTEST_AIRCRAFT_MPS * np.diff(time_s[rows]) + _SLACK_M).any())

    blocks = range(0, len(time_s), CELLS_AT_ONCE)
    if not any(is_of_several(slice(first, first + CELLS_AT_ONCE + 1)) for first in blocks):
        return number
    place = places(slice(None))
    last: list[tuple[float, list[float]]] = []
    for row, (now_s, here) in enumerate(zip(time_s.tolist(), place.tolist(), strict=True)):
        reached = [
            (away_m, k)
            for k, (then_s, there) in enumerate(last)
            if (away_m := math.dist(there, here))
            <= _FASTEST_AIRCRAFT_MPS * (now_s - then_s) + _SLACK_M
        ]
        mine = min(reached)[1] if reached else len(last)
        last[mine : mine + 1] = [(now_s, here)]
        number[row] = mine
    kept = np.flatnonzero(np.bincount(number) >= _LEAST_SAMPLES)
    renamed = np.zeros(len(last), dtype=np.int64)
    renamed[kept] = np.arange(len(kept))
    return renamed[number]


#: Lines and columns of each aircraft's samples, by name.
WithLines = dict[str, tuple[IntArray, Samples]]


def rename_duplicates(samples: WithLines, notes: ReadingNotes) -> WithLines:
    """Return samples with a new name for each aircraft that shares one, and note each.

    The first keeps its name, others are numbered from 2: ``"X (2)"``.
    """
    result: WithLines = {}
    for name, (lines, columns) in samples.items():
        order = np.argsort(columns["time"], kind="stable")
        of = np.empty(len(lines), dtype=np.int64)
        of[order] = aircraft_number_of_samples(
            *(columns[key][order] for key in ("time", "lat", "lon"))
        )
        if not of.any():
            result[name] = lines, columns
            continue
        names = [name]
        while len(names) <= of.max():
            free = (f"{name} ({k})" for k in range(len(names) + 1, len(samples) + 10**6))
            names.append(next(one for one in free if one not in samples and one not in names))
        for number, one in enumerate(names):
            mine = of == number
            result[one] = lines[mine], {key: values[mine] for key, values in columns.items()}
        counts = [f"{one!r} with {np.count_nonzero(of == k)}" for k, one in enumerate(names)]
        said = "aircraft, for none flies so far from one sample to the next"
        notes.note_aircraft(name, "shared", f"is {len(names)} {said}: {', '.join(counts)} samples")
    return result
