"""Marks by which the page tells sensors apart, also those of one kind."""

from collections.abc import Mapping
from dataclasses import replace

from components.sensor.marks import EO, IR, RADAR
from dsa_des.block.mark import Mark, told_apart

#: How far the second and the third of a kind are from its colour towards white, or black if minus;
#: of a light colour the other way round.
_SHADES = (0.0, 0.4, -0.35)
_LIGHT = 0.25
_KINDS = (("radar", RADAR), ("optical.ir", IR), ("optical", EO))


def sensor_marks(types: Mapping[str, str]) -> dict[str, Mark]:
    """Return the marks of sensors.

    Markers are those of figures. Lines of sight and scans have none: colours differ too, in shades
    of that of the kind.

    Parameters
    ----------
    types : mapping
        Name to type of a sensor's block.
    """
    kinds = {
        name: next((mark for start, mark in _KINDS if kind.startswith(start)), None)
        for name, kind in types.items()
    }
    found = told_apart(kinds)
    before: dict[Mark, int] = {}
    for name, kind in sorted(kinds.items()):
        if kind is not None:
            again = before.get(kind, 0)
            before[kind] = again + 1
            found[name] = replace(found[name], colour=_shade(kind.colour, again))
    return found


def _shade(colour: str, again: int) -> str:
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    share = _SHADES[again % len(_SHADES)] * (1 if _luminance(parts) < _LIGHT else -1)
    towards = 255 if share > 0 else 0
    mixed = [round(part + abs(share) * (towards - part)) for part in parts]
    return "#" + "".join(f"{part:02X}" for part in mixed)


def _luminance(parts: list[int]) -> float:
    """Return the relative luminance of sRGB (WCAG 2.2)."""
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4
              for p in (part / 255 for part in parts)]  # fmt: skip
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
