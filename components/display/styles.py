"""The marks of each sensor in every figure: colour, marker and size."""

from collections.abc import Sequence
from typing import Any

#: Okabe and Ito's colours, told apart with any kind of colour vision, each with its marker and
#: its size in points. Sensors see the same target in the same place: big open marks first and
#: small ones on top keep all of them visible.
STYLES = (
    ("#0072B2", "o", 7.5),
    ("#E69F00", "^", 6.0),
    ("#D55E00", "s", 4.0),
    ("#009E73", "D", 5.0),
    ("#CC79A7", "v", 5.5),
    ("#56B4E9", "P", 5.0),
)


def style_of(sensors: Sequence[str], name: str) -> tuple[str, str, float]:
    """Return a sensor's colour, marker and marker size in points."""
    return STYLES[sensors.index(name) % len(STYLES)]


def mark_of(style: tuple[str, str, float]) -> dict[str, Any]:
    """Return how a sensor's detections are marked: big ones open, small ones filled."""
    colour, marker, size = style
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": size,
        "markeredgecolor": colour,
        "markerfacecolor": "none" if size > 7 else colour,
        "markeredgewidth": 1.2 if size > 7 else 0.4,
    }
