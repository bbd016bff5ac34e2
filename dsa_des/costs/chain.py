"""Combinations of rungs over all blocks: what the whole chain costs and how much it finds.

All ladders multiplied are too many, and most are pointless: a rung that another one of its own
ladder beats on both axes does not belong in a good chain. So only rungs on their ladder's front are
combined, with the scene's own.
"""

import itertools
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dsa_des.block.ladder import Unavailable
from dsa_des.block.mark import RED
from dsa_des.costs.climb import Comparison, RungCost, flag_points_on_front
from dsa_des.costs.variants import Choice, Variants
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.drawing import draw_to_png, figure_text, set_plain_log_ticks
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

MOST = 200
_REPEATS = 7

Group = list[RungCost]


def run_rung_combinations(
    variants: Variants, costs: Sequence[RungCost], comparison: Comparison
) -> tuple[list[dict[str, Any]], str]:
    """Run combinations of the blocks' rungs and return a row for each (CPU cost, error against the
    references, on the front or not), and a sentence on how they were chosen.

    The error is the comparison's `Difference`. Every combination is run seven times,
    interleaved, without recording; its cost is the shortest of them.
    """
    groups = [
        list(group) for _, group in itertools.groupby(costs, key=lambda c: (c.block, c.ladder.name))
    ]
    chosen = [
        [c for c in group if not c.unavailable and (c.pareto or c.in_scene)] for group in groups
    ]
    chosen = [group for group in chosen if group]
    whole = _count_combinations(chosen)
    while _count_combinations(chosen) > MOST:
        widest = max(chosen, key=len)
        widest.remove(_choose_rung_to_drop(widest))
    combinations = list(itertools.product(*chosen))
    best = [next(c for c in group if c.rung == c.reference) for group in groups]
    reference_scene = variants.with_rungs(_choices_of_rungs(best))
    reference = _run_and_return_tables(reference_scene)
    rows: list[dict[str, Any]] = []
    scenes: list[Scene] = []
    for combination in combinations:
        try:
            scene = variants.with_rungs(_choices_of_rungs(combination))
            effect = comparison(reference, _run_and_return_tables(scene))
        except (Unavailable, SceneError, BlockFailure):
            continue
        scenes.append(scene)
        rows.append(_chain_row(combination, comparison, effect))
    times = _shortest_cpu_times_s(scenes)
    for row, cpu_s, scene in zip(rows, times, scenes, strict=True):
        row["cpu_us_per_target_scan"] = 1e6 * cpu_s / max(_count_target_scans(scene), 1)
    points = [(row["cpu_us_per_target_scan"], row["error_p95"]) for row in rows]
    for row, front in zip(rows, flag_points_on_front(points), strict=True):
        row["pareto"] = front
    picked = (
        f"whole chain: {len(rows)} combinations of the rungs on their own ladder's front and the "
        f"scene's own, of {_count_combinations(groups)} in all"
    )
    if whole > MOST:
        picked += f"; of {whole} such combinations, ladders were thinned to at most {MOST}"
    return rows, picked


def _count_combinations(groups: Sequence[Sequence[RungCost]]) -> int:
    count = 1
    for group in groups:
        count *= len(group)
    return count


def _choose_rung_to_drop(group: Group) -> RungCost:
    """Return the rung whose cost is closest to that of another one in the group, leaving out the
    reference and preferably also the scene's own.
    """
    inner = [c for c in group if c.rung != c.reference and not c.in_scene]
    inner = inner or [c for c in group if c.rung != c.reference]
    ordered = sorted(group, key=lambda c: c.cpu_us_per_target_scan)

    def gap(cost: RungCost) -> float:
        index = ordered.index(cost)
        beside = [ordered[i] for i in (index - 1, index + 1) if 0 <= i < len(ordered)]
        mine = cost.cpu_us_per_target_scan
        return min(abs(other.cpu_us_per_target_scan / mine - 1.0) for other in beside)

    return min(inner, key=gap)


def _choices_of_rungs(combination: Sequence[RungCost]) -> list[Choice]:
    return [Choice(c.block, c.ladder, c.ladder.rung(c.rung)) for c in combination]


def _run_and_return_tables(scene: Scene) -> dict[str, Any]:
    sink = MemorySink()
    Simulation(scene, recorder=Recorder([sink])).run()
    return sink.tables()


def _shortest_cpu_times_s(scenes: Sequence[Scene]) -> list[float]:
    best = [float("inf")] * len(scenes)
    for _ in range(_REPEATS):
        for index, scene in enumerate(scenes):
            simulation = Simulation(scene)
            started = time.process_time()
            simulation.run()
            best[index] = min(best[index], time.process_time() - started)
    return best


def _count_target_scans(scene: Scene) -> int:
    """Return the scans of all clocks in a run, times the largest target number of any block."""
    simulation = Simulation(scene)
    width = max(component.width for component in simulation.components.values())
    scans = 0
    for node in simulation.nodes.values():
        if node.clock is not None:
            scans += len(node.clock.scans_between(0, simulation.end_tick)[0])
    return scans * width


def _chain_row(
    combination: Sequence[RungCost], comparison: Comparison, effect: dict[str, Any]
) -> dict[str, Any]:
    return {
        "block": "whole chain",
        "ladder": "chain",
        "rung": ", ".join(f"{c.block} {c.rung}" for c in combination),
        "reference": ", ".join(f"{c.block} {c.reference}" for c in combination),
        "in_scene": all(c.in_scene for c in combination),
        "error_quantity": comparison.difference.name,
        "error_unit": "share",
        "error_p95": comparison.difference.share(effect),
        "effect": effect,
    }


def draw_run_error_against_cost(
    path: Path, title: str, rows: Sequence[dict[str, Any]], label: str
) -> None:
    """Draw combinations of rungs by CPU time and run error, those on the Pareto front numbered."""
    best = sorted(
        (row for row in rows if row["pareto"]), key=lambda row: row["cpu_us_per_target_scan"]
    )
    key_in = 0.2 + 0.13 * len(best)
    height_in = 4.6 + key_in
    with draw_to_png(7.5, height_in, path) as figure:
        axes = figure.add_subplot()
        errors = [row["error_p95"] for row in rows]
        # A log axis has no zero: runs that are alike stand on a floor of their own.
        floor = 0.2 * min([e for e in errors if e > 0.0], default=1e-3)
        for front, colour, size in ((False, "#999999", 12), (True, RED, 36)):
            chosen = [row for row in rows if row["pareto"] is front]
            axes.scatter(
                [row["cpu_us_per_target_scan"] for row in chosen],
                [max(row["error_p95"], floor) for row in chosen],
                s=size, color=colour, zorder=3 if front else 2,
                label="front" if front else "other combinations",
            )  # fmt: skip
        for number, row in enumerate(best, start=1):
            at = (row["cpu_us_per_target_scan"], max(row["error_p95"], floor))
            axes.annotate(str(number), at, xytext=(5, 4), textcoords="offset points", fontsize=8)
        key = "\n".join(f"{number}: {row['rung']}" for number, row in enumerate(best, start=1))
        figure.text(0.02, 0.1 / height_in, key, fontsize=6.5, va="bottom")
        axes.set_xscale("log")
        axes.set_yscale("log")
        set_plain_log_ticks(axes.xaxis)
        set_plain_log_ticks(axes.yaxis)
        if min(errors, default=1.0) <= 0.0:
            low, high = axes.get_ylim()
            ticks = [t for t in axes.get_yticks() if 1.5 * floor < t <= high]
            axes.set_yticks([floor, *ticks], ["none", *(f"{t:.4g}" for t in ticks)])
            axes.set_ylim(low, high)
        axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.set_title(f"{figure_text(title, 60)}: the whole chain", loc="left")
        axes.set_xlabel("CPU time of the run (µs per target-scan)")
        axes.set_ylabel(label)
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize=8
        )
        figure.subplots_adjust(bottom=(key_in + 0.6) / height_in, left=0.11, right=0.97, top=0.93)
