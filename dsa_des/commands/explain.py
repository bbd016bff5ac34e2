"""``dsa-des explain``: which effects a scene calls for, which it does not, and because of what."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from dsa_des.commands.loading import load
from dsa_des.running.effects import Planned
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.terminal import terminal
from dsa_des.text.safe_text import shortened

_WIDE = 300


def explain_scene(
    scene: str,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    measure: bool,
    simulate_everything: bool,
) -> None:
    """Print a table of every block's effects; with `measure`, run the scene to time them."""
    from rich.table import Table

    loaded = load(scene, sets, swaps, seed, duration)
    simulation = Simulation(loaded, simulate_everything=simulate_everything)
    shares = measured_shares(loaded, simulate_everything) if measure else None
    console = terminal.console(_WIDE)  # no terminal: every sentence on one line
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("block", "effect", "largest influence"):
        table.add_column(heading, no_wrap=heading == "block")
    if shares is not None:
        table.add_column("share of run time", justify="right")
    planned = [*simulation.plan, *simulation.timing_plan]
    for item in planned:
        row = [shortened(item.block), item.sentence(), _bound(item)]
        if shares is not None:
            share = shares.get((item.block, item.effect.name))
            row.append("" if share is None else f"{share:.1%}")
        table.add_row(*row)
    for name, component in simulation.components.items():
        for sentence in component.left_out():
            table.add_row(shortened(name), sentence)
    if not table.row_count:
        console.print("No block of this scene declares effects.")
        return
    console.print(table)
    if outside := [item for item in planned if not item.effect.neutral and not item.built]:
        console.print()
        console.print(_outside_the_proof(outside))


def _outside_the_proof(items: list[Planned]) -> Any:
    """Return a table of the effects that --simulate-everything leaves out, and why."""
    from rich.table import Table

    table = Table(
        box=None,
        padding=(0, 2, 0, 0),
        title="not built by --simulate-everything, so not covered by its proof",
        title_justify="left",
        title_style="",
        show_header=False,
    )
    reasons: dict[tuple[str, str], list[str]] = {}
    for item in items:
        why = item.effect.outside_the_proof or "it has no neutral form"
        reasons.setdefault((item.effect.name, why), []).append(item.block)
    for (name, why), blocks in reasons.items():
        table.add_row(f"{', '.join(shortened(block) for block in blocks)}", f"{name}: {why}")
    return table


def _bound(item: Planned) -> str:
    return ", ".join(f"{q} {bound:.2g}" for q, bound in sorted(item.verdict.bound.items()))


class _Timed:
    """A built effect that adds up the time spent in it, in calls of it and of its methods."""

    def __init__(self, built: Any) -> None:
        self.built = built
        self.spent_s = 0.0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._timed(self.built, *args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.built, name)
        return partial(self._timed, value) if callable(value) else value

    def _timed(self, call: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        started = time.perf_counter()
        try:
            return call(*args, **kwargs)
        finally:
            self.spent_s += time.perf_counter() - started


def measured_shares(
    scene: Scene, simulate_everything: bool = False
) -> dict[tuple[str, str], float]:
    """Run a scene and return each built effect's share of the run time, by (block, effect).

    An effect that is a choice rather than a calculation, such as the name of a method, has none.
    """
    timed: dict[tuple[str, str], _Timed] = {}

    def wrap(item: Planned, built: Any) -> Any:
        if not callable(built):
            return built
        timed[item.block, item.effect.name] = _Timed(built)
        return timed[item.block, item.effect.name]

    simulation = Simulation(scene, simulate_everything=simulate_everything, wrap_effect=wrap)
    started = time.perf_counter()
    simulation.run()
    whole = time.perf_counter() - started
    return {key: effect.spent_s / whole for key, effect in timed.items()}
