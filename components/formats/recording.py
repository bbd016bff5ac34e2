"""What is recorded in a file, whatever its kind: samples of aircraft, and flights made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from components.flights.sampled_flight import SampledTrajectory
from components.formats.text_rows import Problems, TrafficFile
from dsa_des.arrays.types import FloatArray

#: No aircraft, and no spacecraft, flies so far from one sample to the next, m/s.
_FASTEST_MPS = 1e6
#: An aircraft is away where it is silent for longer than this, s, and than so many times its
#: usual step.
_SILENT_S, _SILENT_STEPS = 30.0, 10.0

#: Columns of one aircraft: time (s), lat, lon (deg), alt (m), ve, vn, vu (m/s), yaw, ... (deg).
Samples = dict[str, FloatArray]


class Notes:
    """What was assumed, reordered or left out: what is harmless, and what changes the flights."""

    def __init__(self) -> None:
        self.harmless: list[str] = []
        self.warnings: list[str] = []
        self._of_aircraft: dict[tuple[str, bool], list[str]] = {}

    def of_one(self, name: str, kind: str, text: str, *, harmless: bool = False) -> None:
        """Note what holds of one aircraft; of those of a kind the first is told, and how many."""
        cases = self._of_aircraft.setdefault((kind, harmless), [])
        if f"{name}: {text}" not in cases[-1:]:
            cases.append(f"{name}: {text}")

    def settle(self) -> None:
        """Put what was noted of single aircraft behind what holds of all."""
        for (_, harmless), cases in self._of_aircraft.items():
            more = f" (and {len(cases) - 1} more aircraft)" if len(cases) > 1 else ""
            (self.harmless if harmless else self.warnings).append(cases[0] + more)
        self._of_aircraft.clear()

    def add(self, other: Notes, file: str) -> None:
        """Add those of another file, by its name."""
        other.settle()
        self.settle()
        self.harmless += [f"{file}: {text}" for text in other.harmless]
        self.warnings += [f"{file}: {text}" for text in other.warnings]


@dataclass
class Recording:
    """The aircraft of a file, before they are flights.

    Parameters
    ----------
    problems : Problems
        Of its file.
    samples : dict
        Columns by aircraft, the ownship's first; times are the file's own.
    notes : Notes
    kind, units, height : str
        What the file is, in which units it says things, and which height is read.
    callsigns : mapping
        By the names of aircraft, which are addresses.
    """

    problems: Problems
    samples: dict[str, Samples]
    notes: Notes
    kind: str = ""
    units: str = ""
    height: str = ""
    callsigns: Mapping[str, str] = field(default_factory=dict)

    def flights(
        self, longest_gap_s: float | None = math.inf, start_s: float | None = None
    ) -> TrafficFile:
        """Return the flights; the first aircraft is the ownship.

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
            columns["time"] = elapsed_times(columns["time"], start)
            made.append(self._flight(name, columns, longest_gap_s))
            if (speed_mps := made[-1].max_speed_mps) > _FASTEST_MPS:
                self.problems.add(
                    f"{name} flies at up to {speed_mps:.3g} m/s from one sample to the next: at "
                    f"most {_FASTEST_MPS:g} m/s can be meant"
                )
        self.problems.raise_if_any()
        self.notes.settle()
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
            f"{key}_rad": np.radians(columns[key])
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
            self.notes.of_one(
                name, "velocity",
                "its velocities do not fit its positions (another unit, or airspeed?) and were "
                "ignored", harmless=True,
            )  # fmt: skip
        if not len(steps):
            single = "has one sample only and is there at that instant only"
            self.notes.of_one(name, "single", single, harmless=True)
        elif steps.max() > min(silent_s, limit_s):
            at = float(columns["time"][int(np.argmax(steps))])
            gaps = int(np.count_nonzero(steps > limit_s))
            then = "positions there are interpolated"
            if gaps:
                then = "it is not there" + (f", nor in {gaps - 1} more gaps" if gaps > 1 else "")
            self.notes.of_one(
                name, "silence", f"no sample for {steps.max():.0f} s after {at:.1f} s; {then}"
            )
        return trajectory


def elapsed_times(time_s: FloatArray, start_s: float) -> FloatArray:
    """Subtract the start, and with it the rounding that a large clock reading carries.

    325374.3 - 325374.2 is 0.0999999999767 in doubles. The difference is rounded to the digits
    that the readings can hold (at most nanoseconds), so that a tenth of a second is the double
    0.1 and a scan at 0.1 s meets the sample itself.
    """
    elapsed = time_s - start_s
    resolution = float(np.spacing(max(abs(start_s), float(np.abs(time_s).max()))))
    decimals = min(9, math.floor(-math.log10(4.0 * resolution)))
    rounded = np.round(elapsed, decimals)
    return rounded if np.all(np.diff(rounded) > 0.0) else elapsed
