"""Drawing a run's figures without a window system, the same bytes on every drawing."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation


def draw(
    simulation: "Simulation", folder: Path, summary: dict[str, Any], sensors: Sequence[str]
) -> list[Path]:
    """Draw ``plan.png``, ``timeline.png``, ``tracks.png`` and ``consistency.png`` into a folder.

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
        Of what was drawn: the last two only where a tracker confirmed tracks with a range.
    """
    from components.display.consistency import draw_consistency
    from components.display.drawn_tracks import DrawnTracks
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
    told = DrawnTracks.read(simulation, folder)
    if told is not None:
        paths.append(draw_tracks(folder / "tracks.png", told))
        consistency = draw_consistency(folder / "consistency.png", told)
        paths += [] if consistency is None else [consistency]
    return paths
