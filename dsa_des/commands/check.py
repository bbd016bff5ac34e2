"""``dsa-des check``: everything that can be known of a scene without running it."""

import click

from dsa_des.commands.loading import load, say_if_long
from dsa_des.simulation import Simulation


def check_scene_file(
    scene: str,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
) -> None:
    """Load a scene, prepare its blocks (files are read), and say what was found."""
    loaded = load(scene, sets, swaps, seed, duration)
    simulation = Simulation(loaded)
    say_if_long(simulation)
    clocks = [node for node in simulation.nodes.values() if node.clock is not None]
    click.echo(
        f"{scene}: ok. {len(loaded.blocks)} blocks, {len(loaded.wires)} wires, "
        f"{float(simulation.duration_s):g} s at {loaded.ticks_per_s:,} ticks per second."
    )
    for node in clocks:
        assert node.clock is not None
        spec = node.clock.spec
        click.echo(
            f"  {node.name}: {float(spec.rate_hz):g} Hz from {float(spec.offset_s):g} s, "
            f"a scan every {float(node.clock.period):,.10g} ticks"
        )
