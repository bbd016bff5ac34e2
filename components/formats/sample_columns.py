"""Columns of a table of samples: the names they go by, their units, and cells that say nothing."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from components.formats.text_rows import MOST_OF_A_CELL, NO_UNIT, UNIT_KINDS, Problems, clean_token
from dsa_des.arrays.types import FloatArray
from dsa_des.text.safe_text import shortened

#: Which altitude is read where there is more than one.
Altitude = Literal["geometric", "barometric"]
VELOCITIES = (("vx", "vy", "vz"), ("trk", "gs", "vs"))


@dataclass(frozen=True)
class ColumnSpec:
    """A quantity: the names its column may have, earlier ones first, and its unit by default."""

    names: tuple[str, ...]
    unit: str = ""
    required: bool = False

    @property
    def units(self) -> Mapping[str, float]:
        """What the units are worth that its column may have: those of the kind of its own."""
        return next(kind for kind in UNIT_KINDS if self.unit in kind)


def indices_of(columns: Mapping[str, ColumnSpec], names: Sequence[str]) -> dict[str, int]:
    """Return in which column of a file each quantity stands that is there."""
    name_of = {q: next((n for n in spec.names if n in names), None) for q, spec in columns.items()}
    return {quantity: names.index(name) for quantity, name in name_of.items() if name is not None}


def complete_velocity(there: Collection[str]) -> tuple[str, ...]:
    """Return the quantities of the first velocity that is complete: half of one is no use."""
    return next((parts for parts in VELOCITIES if all(q in there for q in parts)), ())


@dataclass(frozen=True)
class SampleColumn:
    """A column that is read: its index in the row, its header and its factor to s, m, m/s, deg."""

    index: int
    header: str
    factor: float


def unit_factor(
    problems: Problems, spec: ColumnSpec, token: str, *, line: int | None, header: str
) -> float:
    """Look up what a unit token is worth; an unknown one is noted and taken as 1."""
    known = spec.units
    plain = clean_token(token)
    if plain in known:
        return known[plain]
    what = (
        "has no unit"
        if plain in NO_UNIT
        else f"unit {shortened(token, MOST_OF_A_CELL)!r} is unknown here"
    )
    problems.add(f"{what}: it must be one of {', '.join(known)}", line=line, column=header)
    return 1.0


#: What stands in a cell of which nothing is known; "ground" in place of an altitude.
_MISSING = frozenset(
    {"", "na", "n/a", "nan", "none", "null", "nil", "\\n", "-", "--", "ground", "grnd"}
)


def is_missing(cell: str) -> bool:
    """Tell whether a cell says that nothing is known."""
    return cell.strip().lower() in _MISSING


def enu_velocity(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Give east, north, up velocity from vx vy vz or trk gs vs; nothing if neither is complete."""
    if {"vx", "vy", "vz"} <= columns.keys():
        return {"ve": columns["vx"], "vn": columns["vy"], "vu": columns["vz"]}
    if {"trk", "gs", "vs"} <= columns.keys():
        track = np.radians(columns["trk"])
        return {
            "ve": columns["gs"] * np.sin(track),
            "vn": columns["gs"] * np.cos(track),
            "vu": columns["vs"],
        }
    return {}
