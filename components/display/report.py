"""The report of a detect-and-sense run: summary, terminal tables and two figures."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from components.display.change import share_that_differs
from components.display.outcomes import outcome_observers
from components.display.summary import FusedSummary, SensorSummary
from components.messages.detections import Detections
from dsa_des.record.sinks import Observer
from dsa_des.running.reports import Change, Difference

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation


class DetectAndSenseReport:
    """Summarises, prints and draws runs; registered in ``dsa_des.reports``."""

    changes = (
        Change("first seen, m", "first_detection_range_change_m", "+,.0f"),
        Change("s", "first_detection_time_change_s", "+.2f"),
        Change("gained", "detections_gained", "d"),
        Change("lost", "detections_lost", "d"),
        Change("fused", "fused_share", ".1%"),
    )
    difference = Difference(
        "detections that differ", "share of detections gained or lost", share_that_differs
    )

    def observers(self, simulation: "Simulation") -> list[Observer]:
        """Return running summaries with the sections ``sensors`` and ``fused``, and of outcomes.

        Every block that sends `Detections` is a sensor, ours or not.
        """
        sensors = sensor_names(simulation)
        off = [name for name in sensors if is_off(simulation.components[name])]
        return [SensorSummary(sensors, off), FusedSummary(), *outcome_observers(simulation)]

    def show(self, console: Any, summary: dict[str, Any]) -> None:
        """Print a run's summary.

        Parameters
        ----------
        console : rich.console.Console
        summary : dict
            Sections ``sensors``, ``fused``, ``targets`` and those of `outcome_observers`, with
            ``simulated_s``, ``cpu_s`` and ``out``; whatever is missing is left out.
        """
        from components.display.terminal import show

        show(console, summary)

    def compare(self, reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
        """Return what changed from one run's recorded tables to another's."""
        from components.display.change import compare_runs

        return compare_runs(reference, other)

    def remarks(self, changes: Mapping[str, Any]) -> list[str]:
        """Return which targets a sensor no longer sees at all."""
        missed = changes.get("never_detected")
        return [f"never sees {', '.join(missed)}"] if missed else []

    def draw(self, simulation: "Simulation", folder: Path, summary: dict[str, Any]) -> list[Path]:
        """Draw ``plan.png`` and ``timeline.png`` into a run's folder.

        Parameters
        ----------
        simulation : Simulation
            The run, for flights and fields of view.
        folder : Path
            Holds the run's Parquet tables; takes the figures.
        summary : dict
            The run's summary.

        Returns
        -------
        list of Path
            Without ``plan.png`` when no block of the scene knows the flights.
        """
        from components.display.figures import draw

        return draw(simulation, folder, summary, sensor_names(simulation))


def sensor_names(simulation: "Simulation") -> list[str]:
    """Return the names of all blocks that send `Detections`, sorted."""
    return sorted(
        name
        for name, component in simulation.components.items()
        if any(issubclass(output.message, Detections) for output in component.outputs.values())
    )


def is_off(sensor: Any) -> bool:
    """Whether a sensor has a parameter ``enabled`` that is false."""
    return getattr(sensor.p, "enabled", True) is False
