"""Every unit that a traffic file may name is what it is defined as."""

import math
from fractions import Fraction

import pytest

from components.formats.recording import ReadingNotes
from components.formats.text_rows import ANGLE_DEG, LENGTH_M, SPEED_MPS, TIME_S

FOOT, MILE, HOUR = Fraction("0.3048"), Fraction(1852), Fraction(3600)
LENGTHS = {
    "m": 1, "metre": 1, "metres": 1, "meter": 1, "meters": 1, "km": 1000, "ft": FOOT, "foot": FOOT,
    "feet": FOOT, "nmi": MILE, "nm": MILE, "cm": Fraction(1, 100), "mm": Fraction(1, 1000),
}  # fmt: skip
SPEEDS = {
    "m/s": 1, "mps": 1, "km/h": 1000 / HOUR, "kph": 1000 / HOUR, "kmh": 1000 / HOUR,
    "knot": MILE / HOUR, "knots": MILE / HOUR, "kn": MILE / HOUR, "kt": MILE / HOUR,
    "kts": MILE / HOUR, "nmi/h": MILE / HOUR, "nmi/s": MILE, "fpm": FOOT / 60, "ft/min": FOOT / 60,
    "ft/s": FOOT, "fps": FOOT, "mph": 5280 * FOOT / HOUR, "mi/h": 5280 * FOOT / HOUR,
    "cm/s": Fraction(1, 100),
}  # fmt: skip
ANGLES = {
    **dict.fromkeys(("deg", "degree", "degrees"), 1.0),
    **dict.fromkeys(("1e-7deg", "dege7"), 1e-7),
    **dict.fromkeys(("rad", "radian", "radians"), math.degrees(1.0)),
}
TIMES = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1), "min": 60,
    **dict.fromkeys(("ms", "millisecond", "milliseconds"), Fraction(1, 1000)),
    "h": HOUR, "hr": HOUR, "us": Fraction(1, 10**6), "µs": Fraction(1, 10**6),
    "ns": Fraction(1, 10**9),
}  # fmt: skip


@pytest.mark.parametrize(
    ("known", "expected"),
    [(LENGTH_M, LENGTHS), (SPEED_MPS, SPEEDS), (ANGLE_DEG, ANGLES), (TIME_S, TIMES)],
    ids=["lengths", "speeds", "angles", "times"],
)
def test_units_are_what_they_are_defined_as(known, expected):
    assert known == pytest.approx({name: float(value) for name, value in expected.items()})


def test_what_is_said_of_single_aircraft_is_said_once():
    notes, other = ReadingNotes(), ReadingNotes()
    for name in ("a", "b", "c"):
        notes.note_aircraft(name, "gap", "a gap of 9 s")
    notes.note_aircraft("c", "gap", "a gap of 9 s")
    notes.note_aircraft("d", "turn", "turns", harmless=True)
    other.note_aircraft("e", "gap", "a gap of 2 s")
    notes.summarize_aircraft_notes()
    notes.add(other, "own.csv")
    notes.summarize_aircraft_notes()
    assert notes.warnings == ["a: a gap of 9 s (and 2 more aircraft)", "own.csv: e: a gap of 2 s"]
    assert notes.harmless == ["d: turns"]
