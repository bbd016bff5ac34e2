# ruff: noqa: E501 (the lines of a Markdown page)
"""``python -m docs.make.accuracy_and_cost``: docs/accuracy-and-cost.md and its figures.

Costs are those of the machine it runs on; errors, effects and answers are the same everywhere. It
takes a quarter of an hour on two idle processors.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from components.examples import configs_folder
from components.line_of_sight.error_map import (
    CAMERA_DEG,
    RADAR_DEG,
    ErrorMap,
    draw_error_map,
    error_maps_of_earth_models,
)
from docs.make.accuracy_and_cost.answers import head as answers_head
from docs.make.accuracy_and_cost.answers import reports, section
from docs.make.stamp import stamped
from dsa_des.arrays.types import AnyArray
from dsa_des.files.output_file import write_file
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.studies.executors import usable_processor_count
from dsa_des.terminal.interruption import exit_plainly_on_signal

#: A pixel of the camera, which errors of direction are compared with.
PIXEL_DEG = 0.0358

_HEAD = """1. **Geometry**: take the exact ellipsoid. Flat Earth saves {flat_saves} µs per target-scan and errs by up to {flat_max} mrad, a tenth of the radar's degree but {flat_pixels} pixels; for the radar alone it suffices. Rotate the attitude exactly: angle by angle saves {attitude_saves} µs and errs by up to {small_angle} mrad.
2. **Radar**: take the exact Pd: for one pulse the table costs {table_times} and Gram-Charlier {gram_times}. A threshold or a range boundary saves up to {boundary_saves} µs and first detects the intruder {threshold_km} to {boundary_km} km nearer{cut_off}.
3. **Camera**: take the union of the bodies ({union_us} µs). Their sum ({exact_us} µs) detects {exact_km}; a range boundary detects {boundary_eo_km}, a one-dimensional line {line_km}. A mesh costs {mesh_times} times the union and is no better.
4. **Fusion**: a window of 0.1 s is worth its {window_extra} µs: it raises the fused share from {share} to {window_share} and adds {window_range} m to the range error (95th percentile)."""


def head_lines(costs: Sequence[Any], cut_off: str) -> str:
    """Return the four sentences."""
    of = {(cost.block, cost.rung): cost for cost in costs}

    def us(block: str, rung: str) -> float:
        return float(of[block, rung].cpu_us_per_target_scan)

    def km(block: str, rung: str) -> float:
        return float(of[block, rung].effect["first_detection_range_change_m"]) / 1000.0

    def saved(block: str, one: str, other: str) -> str:
        return f"{us(block, other) - us(block, one):.2f}"

    def times(block: str, one: str, other: str) -> str:
        ratio = us(block, one) / us(block, other)
        return "as much" if 1 / 1.1 < ratio < 1.1 else f"{ratio:.2g} times as much"

    flat = of["transform", "flat_earth"].first_quantity_error.maximum
    instant, window = of["fusion", "exact_instant"], of["fusion", "window"]
    return _HEAD.format(
        flat_saves=saved("transform", "flat_earth", "ellipsoid"),
        flat_max=f"{flat:.1f}",
        flat_pixels=f"{flat / math.radians(PIXEL_DEG) / 1e3:.1f}",
        attitude_saves=saved("transform", "small_angle", "exact"),
        small_angle=f"{of['transform', 'small_angle'].first_quantity_error.maximum:.0f}",
        table_times=times("radar", "table", "exact"),
        gram_times=times("radar", "gram_charlier", "exact"),
        boundary_saves=saved("radar", "range_boundary", "exact"),
        threshold_km=f"{-km('radar', 'threshold'):.1f}",
        boundary_km=f"{-km('radar', 'range_boundary'):.1f}",
        cut_off=cut_off,
        union_us=f"{us('eo', 'union'):.2f}",
        exact_us=f"{us('eo', 'exact'):.2f}",
        exact_km=_early_or_late(km("eo", "exact")),
        boundary_eo_km=_early_or_late(km("eo", "range_boundary")),
        line_km=_early_or_late(km("eo", "projection")),
        mesh_times=f"{us('eo', 'mesh') / us('eo', 'union'):.0f}",
        window_extra=saved("fusion", "exact_instant", "window"),
        share=f"{window.effect['fused_share'] - window.effect['fused_share_change']:.0%}",
        window_share=f"{window.effect['fused_share']:.0%}",
        window_range=f"{window.first_quantity_error.p95 - instant.first_quantity_error.p95:.1f}",
    )


def radar_sees_from(scene: Scene) -> str:
    """Return what cuts off the first detection of a scene's radar, as the end of a sentence.

    A radar with a false alarm in twenty looks sees somewhere in its reach almost at once: where
    the scene begins, if that is inside the reach, else at the reach's edge. A coarser model's
    first detection then comes later by what the scene lets it, not by what the models differ.
    """
    sink = ColumnSink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    simulation.run()
    tables = sink.tables()

    def ours(table: str, column: str) -> AnyArray:
        block: Any = tables[table]["block"]
        here = np.array([*block.names, None])[block.codes] == "radar"
        return np.asarray(tables[table][column])[here]

    times_s, ranges_m = ours("detections", "time_s"), ours("detections", "true_range_m")
    scans_s = np.unique(ours("scans", "time_s"))
    first = int(np.argmin(times_s))
    reach_m = float(scene.blocks["radar"].parameters.model_dump()["range_km"]) * 1000.0
    return cut_off(float(times_s[first]), float(ranges_m[first]), scans_s, reach_m)


def cut_off(time_s: float, range_m: float, scans_s: Any, reach_m: float) -> str:
    """Return the end of the sentence for a first detection at a time and a range."""
    if time_s <= scans_s[1]:
        return f", at least: the exact radar detects it where the scene begins, at {range_m / 1000:.1f} km"
    if range_m > 0.97 * reach_m:
        return f", at least: the exact radar detects it at the edge of its reach, {reach_m / 1000:g} km"
    return ""


def _early_or_late(km: float) -> str:
    """Return by how much a change of the first detection's range is too early or too late."""
    return f"{abs(km):.1f} km too {'early' if km > 0.0 else 'late'}"


FIGURE = "error_map_angle.png"
_LATITUDES_DEG = np.array([0.0, 30.0, 52.0, 75.0])
_RANGES_M = np.geomspace(100.0, 200e3, 1200)


def error_map_section(images: Path) -> str:
    """Draw the map of errors in direction and return the Markdown around it."""
    with tempfile.TemporaryDirectory() as folder:
        drawn = {path.name: path for path in draw_error_map(Path(folder))}
        write_file(images / FIGURE, drawn[FIGURE].read_bytes())
    maps = {found.model: found for found in error_maps_of_earth_models(_LATITUDES_DEG, _RANGES_M)}
    lines = [
        "`dsa-des cost --map geometry`",
        "",
        f"![Error in direction over range and latitude, one panel per model](images/{FIGURE})",
        "",
        "Largest range, km, up to which the direction stays within a camera's pixel "
        f"({CAMERA_DEG:g}°) and a radar's degree, whatever the bearing, at four latitudes:",
        "",
        "| model | limit | " + " | ".join(f"{lat:g}°" for lat in _LATITUDES_DEG) + " |",
        "|---|---|" + "---|" * len(_LATITUDES_DEG),
    ]
    for model in ("flat_earth", "local_radii", "geodesic"):
        for limit_deg in (CAMERA_DEG, RADAR_DEG):
            cells = [_good_up_to(maps[model], row, limit_deg) for row in range(len(_LATITUDES_DEG))]
            lines.append(f"| {model} | {limit_deg:g}° | {' | '.join(cells)} |")
    scale_deg = math.degrees(maps["flat_earth"].direction_rad[:, 0].max())
    exact = math.ceil(math.log10(maps["ellipsoid"].direction_rad.max()))
    lines += [
        "",
        f"Flat Earth takes a sphere for the ellipsoid, which turns directions by up to "
        f"{scale_deg:.2f}° at any range: negligible for a radar, not for a camera except within a "
        "kilometre near 75°. Local radii remove this error. The curvature, which they neglect, "
        "grows with range, and the convergence of the meridians with range and tan(latitude): "
        "close to a pole neither model is valid at any range. Azimuths along the geodesic with "
        "straight-line elevations neglect the curvature only. The ellipsoid errs by less than "
        f"1e{exact} rad, which is the rounding of the targets' positions.",
    ]
    return "\n".join(lines)


def _good_up_to(found: ErrorMap, row: int, limit_deg: float) -> str:
    beyond = np.flatnonzero(found.direction_rad[row] > math.radians(limit_deg))
    if not len(beyond):
        return f"over {found.range_m[-1] / 1000:.0f}"
    if beyond[0] == 0:
        return "none"
    km = found.range_m[beyond[0] - 1] / 1000
    return f"{km:.0f}" if km >= 10 else f"{km:.1f}"


DOCS = Path(__file__).parents[2]
#: Scene of the trackers' ladders, and what is changed in it.
TRACKERS = ("tracking/architectures.toml", "blocks.eo.latency_s=0.3")

_PAGE = """# What accuracy costs

Which models may be crude without changing the answer?

`dsa-des cost radar_and_camera_risk --answer nmac_risk_ratio` tells it for a study, `dsa-des cost first_light --all`
for a scene's detections, in minutes.

![Share of detections that differ against the cost of the run](images/cost_chain.png)

{answers_head}

## At the answer

`dsa-des cost STUDY --answer RESULT` runs a study with each model in place of the scene's own, one at a
time, on the same seeds, draws and encounters. A model may be taken where the *whole* interval of its change
lies within the limit; not to have seen a change is no proof of none. The command says all below, and in words what
the tables show.

{answers}

## Models of one scene

For a 35 GHz radar (1° grid) and a camera of 0.036° pixels (2048 x 2048 each), the exact closed forms are worth their cost; cruder ones save fractions of a microsecond, costlier ones gain nothing:
{head}

All numbers above are of one scene, the [flown encounter](#a-flown-encounter).

Costs are CPU times of the block per target-scan, on one core; errors are those of single
target-scans against the ladder's reference. Scenes are run with every rung in turn, on common
random numbers. Made by `python -m docs.make.accuracy_and_cost`, from `dsa-des cost`.

## How to read the tables

*First seen*: of all pairs of sensor and target, the largest change in the range of the first
detection, and the change of its time. The radar's reference detects from the first scan on: the
losses of its rungs there are lower bounds. *Gained, lost*: detections (sensor, target, instant)
that only the rung, only the reference has. *Fused*: share of fused rows with two sensors or more.
**Bold** rungs are on the front: none is both cheaper and nearer to the reference. Costs that
differ by less than 10 % are given one value.

The *union* of sphere, cylinder and plate is the reference of cameras: one hides the other,
whereas the thesis's model adds them up. The plate's shape is an assumption, so is the
one-dimensional projection. Of a range boundary the area counts that is just detected there. The
Gram-Charlier series holds for steady targets: it is run on a sampled cross-section and compared
with the exact Pd of the same sample.

## Validity of the Earth models

{error_map}

## The thesis's scene

`dsa-des cost first_light --all`

![Error against cost, one panel per ladder](images/cost_first_light.png)

{first_light}

### The whole chain

{chain}

The picture [above](#what-accuracy-costs) shows them all.

## A flown encounter

`dsa-des cost replay_daa --set blocks.traffic.file={encounter_name}`: {encounter_says}.

![Error against cost, one panel per ladder](images/cost_encounter.png)

{encounter}

## Trackers

`dsa-des cost tracking/architectures --block tracker --duration 20 --set blocks.eo.latency_s=0.3`:
a radar at 1 Hz and two cameras, one of them delayed; two straight flights. Times are those of a
tracker alone in a single run; [in lock step](performance.md#track-updates) an update is far
cheaper. Errors are the distance of the nearest confirmed track; the last rung of each ladder is
the reference. [Discussion](tracking.md#cost-of-filters-association-and-late-looks).

{trackers}
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and its figures and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.accuracy_and_cost", description=__doc__
    )
    parser.add_argument(
        "--encounter",
        type=Path,
        default=configs_folder() / "encounters" / "crossing.daa",
        help="encounter for the second half; the published page was made with NRC_Intercept23.daa",
    )
    parser.add_argument("--encounter-says", default="a made-up crossing", help="what it is")
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder to write to")
    parser.add_argument(
        "--workers", type=int, default=usable_processor_count(), help="of the studies"
    )
    options = parser.parse_args(arguments)
    images: Path = options.docs / "images"
    images.mkdir(parents=True, exist_ok=True)

    from dsa_des.commands.cost import comparison_of_all_reports, ladders_to_run_and_notes
    from dsa_des.costs.chain import draw_run_error_against_cost, run_rung_combinations
    from dsa_des.costs.climb import RungCost, measure_rungs
    from dsa_des.costs.cost_report import draw_error_against_cost
    from dsa_des.costs.variants import Variants

    compare = comparison_of_all_reports()

    def costs_of(
        scene: str, *sets: str, block: str | None = None, duration_s: object = None
    ) -> tuple[Variants, list[RungCost]]:
        variants = Variants(str(configs_folder() / scene), sets=sets, duration_s=duration_s)
        climbs, _ = ladders_to_run_and_notes(variants, block, None)
        return variants, [
            cost
            for name, ladder in climbs
            for cost in measure_rungs(variants, name, ladder, compare=compare)
        ]

    variants, first = costs_of("first_light.toml")
    draw_error_against_cost(images / "cost_first_light.png", variants.scene.title, first)
    chain, picked = run_rung_combinations(variants, first, compare)
    label = compare.difference.label
    draw_run_error_against_cost(images / "cost_chain.png", variants.scene.title, chain, label)
    flown, second = costs_of("replay_daa.toml", f"blocks.traffic.file={options.encounter}")
    draw_error_against_cost(images / "cost_encounter.png", options.encounter.stem, second)
    _, third = costs_of(*TRACKERS, block="tracker", duration_s="20")
    made = reports(options.workers)
    page = _PAGE.format(
        answers_head=answers_head(made),
        answers=section(made),
        head=head_lines(second, radar_sees_from(flown.scene)),
        error_map=error_map_section(images),
        first_light=_tables(first),
        chain=_chain(chain, picked),
        encounter=_tables(second),
        encounter_name=options.encounter.name,
        encounter_says=options.encounter_says,
        trackers=_tables(third),
    )
    page = stamped(shorten_repeats(page), "python -m docs.make.accuracy_and_cost")
    write_file(options.docs / "accuracy-and-cost.md", page.encode())
    return 0


def shorten_repeats(page: str) -> str:
    """Return a page in which notes below tables that stood before are left out, or named only."""
    lines: list[str] = []
    known: set[str] = set()
    for line in page.splitlines():
        start = line.partition(" (")[0]
        if line.startswith("Not available here:") and start in known:
            line = f"{start}.  "
        elif line.startswith("The same in every run") and line in known:
            line = f"{start}: as above."
        elif line.startswith(("CPU: by", "Note:", "Own error of")) and line.rstrip() in known:
            continue
        known |= {start, line, line.rstrip()}
        lines.append(line)
    return "\n".join(lines) + "\n"


def _tables(costs: Sequence[Any]) -> str:
    lines: list[str] = []
    for _, group in groupby(costs, key=lambda cost: (cost.block, cost.ladder.name)):
        rungs = list(group)
        quantity = rungs[0].ladder.quantities[0]
        if all(cost.unavailable or cost.first_quantity_error.count == 0 for cost in rungs):
            lines += [f"**{rungs[0].block}, {rungs[0].ladder.name}**: no target was in view.", ""]
            continue
        lines += [
            f"**{rungs[0].block}, {rungs[0].ladder.name}**: {quantity.name}, {quantity.unit}, against "
            f"`{rungs[0].reference}`",
            "",
            "| rung | µs/target-scan | mean | p95 | max | first seen, m | s | gained | lost | fused |",
            "|---|---|---|---|---|---|---|---|---|---|",
            *(_line(cost) for cost in rungs if not cost.unavailable),
            "",
        ]
        lines += [
            f"Not available here: `{cost.rung}` ({cost.unavailable}).  "
            for cost in rungs
            if cost.unavailable
        ]
        lines += [
            f"Own error of `{cost.rung}`: {cost.error_note}."
            for cost in rungs
            if cost.rung == cost.reference
        ] + [""]
    return "\n".join(lines)


def _line(cost: Any) -> str:
    name = f"**{cost.rung}**" if cost.pareto else cost.rung
    error = cost.first_quantity_error
    cells = [
        name + (" (scene)" if cost.in_scene else ""),
        f"{cost.cpu_us_per_target_scan:.3g} ± {float(f'{cost.cpu_spread_us:.1g}'):g}",
        *(f"{value:.2g}" for value in (error.mean, error.p95, error.maximum)),
    ]
    for key, form in (
        ("first_detection_range_change_m", "+,.0f"),
        ("first_detection_time_change_s", "+.2f"),
        ("detections_gained", "d"),
        ("detections_lost", "d"),
        ("fused_share", ".1%"),
    ):
        value = cost.effect.get(key)
        cells.append("" if value is None else format(value, form))
    return f"| {' | '.join(cells)} |"


def _chain(chain: list[dict[str, Any]], picked: str) -> str:
    lines = [
        f"{picked[0].upper()}{picked[1:]}. The front:",
        "",
        "| µs/target-scan | detections that differ | rungs |",
        "|---|---|---|",
    ]
    front = [row for row in chain if row["pareto"]]
    for row in sorted(front, key=lambda row: float(row["cpu_us_per_target_scan"])):
        share = f"{row['error_p95']:.2%}"
        lines.append(f"| {row['cpu_us_per_target_scan']:.2f} | {share} | {row['rung']} |")
    return "\n".join(lines)


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
