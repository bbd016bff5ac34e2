"""What every command that takes a scene does first."""

from collections.abc import Iterable

from dsa_des.scene.chosen_file import chosen_file
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.terminal.terminal import say


def load(
    scene: str,
    sets: Iterable[str],
    swaps: Iterable[str],
    seed: int | None,
    duration: str | None,
) -> Scene:
    """Load and check a scene; parameters that a swap dropped are listed on standard error."""
    path = chosen_file(scene, "scene")
    loaded = load_scene(path, sets=sets, swaps=swaps, seed=seed, duration_s=duration)
    for key in loaded.dropped:
        say(f"note: the swap dropped {key}", err=True)
    return loaded
