"""What every command that takes a scene does first."""

from collections.abc import Iterable

from dsa_des.scene import Scene, load_scene
from dsa_des.simulation import Simulation
from dsa_des.terminal import say

# Half a minute of the processor, for most scenes.
_MANY_SCANS = 1e7


def say_if_long(simulation: Simulation) -> None:
    """Say on standard error that a run will take long: nobody should wait for it unawares."""
    if simulation.scans > _MANY_SCANS:
        message = f"note: {float(simulation.duration_s):.4g} s of this scene are about "
        say(f"{message}{simulation.scans:.2g} scans", err=True)


def load(
    scene: str,
    sets: Iterable[str],
    swaps: Iterable[str],
    seed: int | None,
    duration: str | None,
) -> Scene:
    """Load and check a scene; parameters that a swap dropped are listed on standard error."""
    loaded = load_scene(scene, sets=sets, swaps=swaps, seed=seed, duration_s=duration)
    for key in loaded.dropped:
        say(f"note: the swap dropped {key}", err=True)
    return loaded
