"""How each sensor is marked in a run's figures: by its kind, alike in every figure."""

from collections.abc import Iterable, Mapping
from typing import Any

from dsa_des.block.mark import Mark, marks_of


def styles_of(names: Iterable[str], blocks: Mapping[str, Any]) -> dict[str, Mark]:
    """Return name → mark of sensors.

    Parameters
    ----------
    names : iterable of str
    blocks : mapping
        The run's blocks by name.
    """
    return marks_of({name: type(blocks[name]) if name in blocks else None for name in names})


def mark_of(style: Mark) -> dict[str, Any]:
    """Return how a sensor's detections are marked: big ones open, small ones filled."""
    big = style.size_pt > 7
    return {
        "linestyle": "none",
        "marker": style.marker,
        "markersize": style.size_pt,
        "markeredgecolor": style.colour,
        "markerfacecolor": "none" if big else style.colour,
        "markeredgewidth": 1.2 if big else 0.4,
    }
