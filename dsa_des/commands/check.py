"""``dsa-des check``: everything that can be known of a scene without running it."""

from dsa_des.block.foreign import Foreign, Imports, imports
from dsa_des.commands.collection import no_collection
from dsa_des.commands.loading import load
from dsa_des.running.simulation import Simulation
from dsa_des.running.warnings import say_if_long, say_warnings, warnings_of
from dsa_des.scene.graph import in_cycles
from dsa_des.terminal.terminal import say


def check_scene_file(
    scene: str,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    no_import: bool,
) -> None:
    """Load a scene, prepare its blocks (files are read), and say what was found.

    Every foreign module is named, with its file, before it is imported: one that ends the process
    (``os._exit``) has the last line. With `no_import` none is, and what depends on it stays
    unchecked.
    """

    def announce(foreign: Foreign) -> None:
        verb = "does not import" if no_import else "imports"
        say(f"{foreign.key} = {foreign.name} {verb} the module {foreign.module}: {foreign.file}")

    with no_collection(), imports(Imports(allowed=not no_import, announce=announce)) as policy:
        loaded = load(scene, sets, swaps, seed, duration)
        if no_import and policy.seen:
            say(
                f"{scene}: nothing wrong as far as it was checked. {len(loaded.blocks)} blocks; "
                "parameters, wires and clocks of the types above, and what needs the whole scene, "
                "were not checked."
            )
            return
        simulation = Simulation(loaded)
    say_if_long(simulation)
    _say_if_slowed(simulation)
    say_warnings(warnings_of(simulation), "warning")
    clocks = [node for node in simulation.nodes.values() if node.clock is not None]
    say(
        f"{scene}: ok. {len(loaded.blocks)} blocks, {len(loaded.wires)} wires, "
        f"{float(simulation.duration_s):g} s at {loaded.ticks_per_s:,} ticks per second."
    )
    for node in clocks:
        assert node.clock is not None
        spec = node.clock.spec
        say(
            f"  {node.name}: {float(spec.rate_hz):g} Hz from {float(spec.offset_s):g} s, "
            f"a scan every {float(node.clock.period):,.10g} ticks"
        )


def _say_if_slowed(simulation: Simulation) -> None:
    """Say which blocks keep a feedback loop from looking ahead."""
    scene = simulation.scene
    looped = in_cycles(scene.graph)
    if not looped or not simulation.slow:
        return
    # A window holds all blocks, so one outside of the loop counts as well.
    say(f"note: the feedback loop of {', '.join(sorted(looped))} runs scan by scan, which is slow:")
    for name, why in simulation.slow.items():
        say(f"  {name} ({scene.classes[name].path()}) {why}")
