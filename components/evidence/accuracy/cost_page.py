# ruff: noqa: E501 (the lines of a Markdown page)
"""``python -m components.evidence.accuracy.cost_page``: make docs/accuracy-and-cost.md and its figures again.

Costs are those of the machine it runs on; errors and effects are the same everywhere. Takes a few
minutes.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from components.examples import folder
from dsa_des.terminal.interruption import plain_ending

DOCS = Path(__file__).parents[3] / "docs"
#: Scene of the trackers' ladders, and what is changed in it.
TRACKERS = ("tracking/architectures.toml", "blocks.eo.latency_s=0.3")

_PAGE = """# What accuracy costs

For a 35 GHz radar (1° grid) and a camera of 0.036° pixels (2048 x 2048 each), the exact closed forms are worth their time; cruder ones save fractions of a microsecond, dearer ones bring nothing:
{head}

All numbers above are of one scene, the [flown encounter](#a-flown-encounter).

Costs are CPU times of the block per target-scan, on one core; errors are those of single
target-scans against the ladder's reference, whose own error is measured too. Scenes are run with
every rung in turn, everything else fixed, on common random numbers. Made by
`python -m components.evidence.accuracy.cost_page`, from `dsa-des cost`.

## How to read the tables

*First seen*: of all pairs of sensor and target, the largest change in the range of the first
detection, and the change of its time. The radar's reference sees from the first scan on, in the
thesis's scene (12 km) and in the flown encounter: what its rungs lose there is a lower bound.
*Gained, lost*: detections (sensor, target, instant) that only
the rung, only the reference has. *Fused*: share of fused rows with two sensors or more. **Bold**
rungs are on the front: none is both cheaper and nearer to the reference. Costs that differ by less
than 10 % come in another order in another run and are given one value.

The *union* of sphere, cylinder and plate is the reference of cameras: one hides the other, where
the thesis's model adds them up. The plate's shape is an assumption (`components/optical/convex_hull.py`),
so is the one-dimensional projection (`components/optical/projection.py`), of which the thesis says
no more than size, range and colour. A range boundary shows no area: the one that is just detected
at the boundary stands for it. The Gram-Charlier series holds for steady targets: it is run on a
sampled cross-section and compared with the exact Pd of the same sample. Fusion is compared with the
truth at each instant, which includes the sensors' grids.

## Where each model of the Earth is good enough

{error_map}

## The thesis's scene

`dsa-des cost configs/first_light.toml --all`

![Error against cost, one panel per ladder](images/cost_first_light.png)

{first_light}

### The whole chain

{chain}

![Share of detections that differ against the cost of the run](images/cost_chain.png)

## A flown encounter

`dsa-des cost configs/replay_daa.toml --set blocks.traffic.file={encounter_name}`: {encounter_says}.

![Error against cost, one panel per ladder](images/cost_encounter.png)

{encounter}

## Trackers

`dsa-des cost configs/tracking/architectures.toml --block tracker --duration 20 --set blocks.eo.latency_s=0.3`:
a radar at 1 Hz and two cameras, one of them late; two straight flights. Times are those of a tracker
alone in a single run, where a step's fixed cost counts most ([in lock step](performance.md#track-updates)
an update is far cheaper). Errors are the distance of the nearest confirmed track; the last rung of
each ladder is the reference, which is not the truth either. Two flights of 20 s tell what
rungs cost; they are too short to tell which is better. [What they mean](tracking.md#what-filters-association-and-late-looks-cost).

{trackers}
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and its figures and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m components.evidence.accuracy.cost_page", description=__doc__
    )
    parser.add_argument(
        "--encounter",
        type=Path,
        default=folder() / "encounters" / "crossing.daa",
        help="encounter for the second half; the published page was made with NRC_Intercept23.daa",
    )
    parser.add_argument("--encounter-says", default="a made-up crossing", help="what it is")
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder to write to")
    options = parser.parse_args(arguments)
    images: Path = options.docs / "images"
    images.mkdir(parents=True, exist_ok=True)

    from components.evidence.accuracy.cost_head import head_lines, radar_sees_from
    from components.evidence.accuracy.error_map_page import error_map_section
    from dsa_des.commands.cost import comparison, ladders_to_climb
    from dsa_des.costs.chain import draw_chain, run_chain
    from dsa_des.costs.climb import RungCost, climb
    from dsa_des.costs.output import draw_costs
    from dsa_des.costs.variants import Variants
    from dsa_des.files.output_file import write_file

    compare = comparison()

    def costs_of(
        scene: str, *sets: str, block: str | None = None, duration_s: object = None
    ) -> tuple[Variants, list[RungCost]]:
        variants = Variants(str(folder() / scene), sets=sets, duration_s=duration_s)
        climbs, _ = ladders_to_climb(variants, block, None)
        return variants, [
            cost
            for name, ladder in climbs
            for cost in climb(variants, name, ladder, compare=compare)
        ]

    variants, first = costs_of("first_light.toml")
    draw_costs(images / "cost_first_light.png", variants.scene.title, first)
    chain = run_chain(variants, first, compare)
    label = compare.difference.label
    draw_chain(images / "cost_chain.png", variants.scene.title, chain.rows, label)
    flown, second = costs_of("replay_daa.toml", f"blocks.traffic.file={options.encounter}")
    draw_costs(images / "cost_encounter.png", options.encounter.stem, second)
    _, third = costs_of(*TRACKERS, block="tracker", duration_s="20")
    page = _PAGE.format(
        head=head_lines(second, radar_sees_from(flown.scene)),
        error_map=error_map_section(images),
        first_light=_tables(first),
        chain=_chain(chain),
        encounter=_tables(second),
        encounter_name=options.encounter.name,
        encounter_says=options.encounter_says,
        trackers=_tables(third),
    )
    write_file(options.docs / "accuracy-and-cost.md", page.encode())
    return 0


def _tables(costs: Sequence[Any]) -> str:
    lines: list[str] = []
    for _, group in groupby(costs, key=lambda cost: (cost.block, cost.ladder.name)):
        rungs = list(group)
        quantity = rungs[0].ladder.quantities[0]
        if all(cost.unavailable or cost.error.count == 0 for cost in rungs):
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
    error = cost.error
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


def _chain(chain: Any) -> str:
    lines = [
        f"{chain.picked[0].upper()}{chain.picked[1:]}. The front:",
        "",
        "| µs/target-scan | detections that differ | rungs |",
        "|---|---|---|",
    ]
    front = [row for row in chain.rows if row["pareto"]]
    for row in sorted(front, key=lambda row: float(row["cpu_us_per_target_scan"])):
        share = f"{row['error_p95']:.2%}"
        lines.append(f"| {row['cpu_us_per_target_scan']:.2f} | {share} | {row['rung']} |")
    return "\n".join(lines)


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
