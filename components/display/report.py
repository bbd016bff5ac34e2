"""The report of a detect-and-sense run: summary, terminal tables, changes between runs, figures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from components.display.outcomes import (
    PlatformSummary,
    blocks_sending,
    outcome_observers,
    platform_by_block,
)
from components.display.summary import FusedSummary, SensorSummary
from components.messages.detections import Detections
from dsa_des.record.sinks import Observer
from dsa_des.running.reports import Change, Difference
from dsa_des.running.simulation import Simulation


def changed_detections_ratio(changes: Mapping[str, Any]) -> float:
    """Return detections gained plus lost between two runs, divided by the reference run's."""
    changed = changes.get("detections_gained", 0) + changes.get("detections_lost", 0)
    return float(changed / max(changes.get("detections_reference", 0), 1))


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
        "detections that differ", "share of detections gained or lost", changed_detections_ratio
    )

    def observers(self, simulation: Simulation) -> list[Observer]:
        """Return running summaries with the sections ``sensors`` and ``fused``, and of outcomes.

        Every block that sends `Detections` is a sensor, ours or not.
        """
        sensors = sensor_names(simulation)
        off = [n for n in sensors if getattr(simulation.components[n].p, "enabled", True) is False]
        each = [PlatformSummary(simulation)] if simulation.platforms else []
        return [SensorSummary(sensors, off), FusedSummary(), *outcome_observers(simulation), *each]

    def show(self, console: Any, summary: dict[str, Any]) -> None:
        """Print a run's summary on a ``rich.console.Console``, leaving out missing sections."""
        from components.display.terminal import print_run_summary

        print_run_summary(console, summary)

    def compare(self, reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
        """Return the differences between two runs' recorded tables."""
        return compare_runs(reference, other)

    def describe_changes(self, changes: Mapping[str, Any]) -> list[str]:
        """Return a text on sensors and targets that are no longer detected; empty if none."""
        missed = changes.get("never_detected")
        return [f"never sees {', '.join(missed)}"] if missed else []

    def draw(self, simulation: Simulation, folder: Path, summary: dict[str, Any]) -> list[Path]:
        """Draw the figures of a run into its folder, the same bytes on every drawing.

        ``plan.png`` where a block of the scene knows the flights, ``timeline.png``, both with
        alerts and manoeuvres, and ``tracks.png`` and ``consistency.png`` where a tracker confirmed
        tracks with a range.
        """
        from components.display.alerted import Alerted
        from components.display.consistency import draw_consistency
        from components.display.flights import Flights
        from components.display.plan import draw_plan
        from components.display.recorded_rows import Detected
        from components.display.symbols import sensor_marks
        from components.display.timeline import draw_timeline
        from components.display.tracks import DrawnTracks, draw_tracks

        flights = Flights.from_simulation(simulation, summary)
        detected = Detected.read(folder, sensor_names(simulation))
        carrying = platform_by_block(simulation)
        detected.styles = sensor_marks(detected.sensors, simulation.components, carrying)
        alerted = Alerted.read(folder)
        paths = []
        if flights is not None:
            plan = folder / "plan.png"
            paths.append(draw_plan(plan, simulation, flights, detected, summary, alerted))
        timeline = folder / "timeline.png"
        paths.append(draw_timeline(timeline, simulation, flights, detected, folder, alerted))
        tracks = DrawnTracks.read(simulation, folder)
        if tracks is not None:
            paths.append(draw_tracks(folder / "tracks.png", tracks))
            consistency = draw_consistency(folder / "consistency.png", tracks)
            paths += [] if consistency is None else [consistency]
        return paths


def sensor_names(simulation: Simulation) -> list[str]:
    """Return the names of all blocks that send `Detections`, sorted."""
    return blocks_sending(simulation, Detections)


def compare_runs(reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return differences of two runs' tables in detections and fusion: numbers and lists, by name.

    Tables are ``pyarrow.Table`` by name: ``detections`` and ``fused``. ``detections_gained`` and
    ``detections_lost`` count (sensor, target, instant) that only one of the runs has, of
    ``detections_reference``. ``first_detection_range_change_m`` and
    ``first_detection_time_change_s`` are those of the sensor and target, named in
    ``first_detection_of``, whose first detection moved farthest in range; None where no sensor saw
    one target in both runs. ``never_detected`` and ``newly_detected`` list ``sensor/target`` that
    only one run detects. ``fused_share`` is the share of fused rows with two sensors or more,
    ``fused_share_change`` its change. False alarms are left out.
    """
    before, after = _times_and_true_ranges(reference), _times_and_true_ranges(other)
    common = before.keys() & after.keys()
    moved: tuple[float, float] | tuple[None, None] = (None, None)
    of = None
    firsts, others = _first_by_sensor_and_target(before), _first_by_sensor_and_target(after)
    for name in sorted(firsts.keys() & others.keys()):
        change = (others[name][1] - firsts[name][1], others[name][0] - firsts[name][0])
        if moved[0] is None or abs(change[0]) > abs(moved[0]):
            moved, of = change, name
    share, changed = _multi_sensor_fused_share(reference), _multi_sensor_fused_share(other)
    return {
        "first_detection_of": of,
        "first_detection_range_change_m": moved[0],
        "first_detection_time_change_s": moved[1],
        "never_detected": sorted(firsts.keys() - others.keys()),
        "newly_detected": sorted(others.keys() - firsts.keys()),
        "detections_reference": len(before),
        "detections_gained": len(after) - len(common),
        "detections_lost": len(before) - len(common),
        "fused_share": changed,
        "fused_share_change": None if share is None or changed is None else changed - share,
    }


def _times_and_true_ranges(tables: Mapping[str, Any]) -> dict[tuple[str, int], tuple[float, float]]:
    """Return time (s) and true range (m) of each detection, by sensor/target and tick."""
    table = tables.get("detections")
    if table is None:
        return {}
    columns = [table[name].to_pylist() for name in ("block", "target", "tick", "time_s",
                                                    "true_range_m")]  # fmt: skip
    return {
        (f"{block}/{target}", tick): (time_s, range_m)
        for block, target, tick, time_s, range_m in zip(*columns, strict=True)
        if target is not None
    }


def _first_by_sensor_and_target(
    detections: Mapping[tuple[str, int], tuple[float, float]],
) -> dict[str, tuple[float, float]]:
    result: dict[str, tuple[float, float]] = {}
    for (name, _), seen in detections.items():
        if name not in result or seen[0] < result[name][0]:
            result[name] = seen
    return result


def _multi_sensor_fused_share(tables: Mapping[str, Any]) -> float | None:
    table = tables.get("fused")
    if table is None or table.num_rows == 0:
        return None
    return float(np.mean(["+" in sensors for sensors in table["sensors"].to_pylist()]))
