"""Drawing a run's figures without a window system, the same bytes on every drawing."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsa_des.drawing import DPI, drawing, figure_text

if TYPE_CHECKING:
    from dsa_des.simulation import Simulation

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


def draw(
    simulation: "Simulation", folder: Path, summary: dict[str, Any], sensors: Sequence[str]
) -> list[Path]:
    """Draw ``plan.png`` and ``timeline.png`` into a run's folder and return their paths.

    Parameters
    ----------
    simulation : Simulation
    folder : Path
        Holds the run's Parquet tables.
    summary : dict
    sensors : sequence of str
        Names of the sensor blocks.
    """
    from components.display.flights import Flights
    from components.display.marks import Detected
    from components.display.plan import draw_plan
    from components.display.timeline import draw_timeline

    flights = Flights.of(simulation, summary)
    detected = Detected.read(folder, sensors)
    paths = []
    if flights is not None:
        paths.append(draw_plan(folder / "plan.png", simulation, flights, detected, summary))
    paths.append(draw_timeline(folder / "timeline.png", simulation, flights, detected, folder))
    return paths


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


__all__ = ["DPI", "STYLES", "draw", "drawing", "figure_text", "mark_of", "style_of"]
