"""Drawing a run's figures without a window system, the same bytes on every drawing."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation


def draw(
    simulation: "Simulation", folder: Path, summary: dict[str, Any], sensors: Sequence[str]
) -> list[Path]:
    """Draw ``plan.png``, ``timeline.png`` and ``tracks.png`` into a run's folder.

    Parameters
    ----------
    simulation : Simulation
    folder : Path
        Holds the run's Parquet tables.
    summary : dict
    sensors : sequence of str
        Names of the sensor blocks.

    Returns
    -------
    list of Path
        Of what was drawn: ``tracks.png`` only where a tracker confirmed tracks with a range.
    """
    from components.display.flights import Flights
    from components.display.marks import Detected
    from components.display.plan import draw_plan
    from components.display.styles import styles_of
    from components.display.timeline import draw_timeline
    from components.display.tracks import draw_tracks

    flights = Flights.of(simulation, summary)
    detected = Detected.read(folder, sensors)
    detected.styles = styles_of(detected.sensors, simulation.components)
    paths = []
    if flights is not None:
        paths.append(draw_plan(folder / "plan.png", simulation, flights, detected, summary))
    paths.append(draw_timeline(folder / "timeline.png", simulation, flights, detected, folder))
    tracks = draw_tracks(folder / "tracks.png", simulation, folder)
    if tracks is not None:
        paths.append(tracks)
    return paths
