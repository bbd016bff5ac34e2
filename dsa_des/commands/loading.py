"""The first steps of every command that takes a scene."""

from collections.abc import Iterable

from dsa_des.scene.examples import chosen_file
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.terminal.terminal import say


def load(
    scene: str,
    sets: Iterable[str],
    swaps: Iterable[str],
    seed: int | None,
    duration: str | None,
    quiet: bool = False,
) -> Scene:
    """Load and check a scene; parameters that were dropped are listed on standard error."""
    path = chosen_file(scene, "scene")
    loaded = load_scene(path, sets=sets, swaps=swaps, seed=seed, duration_s=duration)
    if not quiet:
        say_what_was_done(loaded)
    return loaded


def say_what_was_done(loaded: Scene) -> None:
    """List on standard error what was done to a scene that its files do not show."""
    for key in loaded.dropped:
        say(f"note: the swap dropped {key}", err=True)
    for note in loaded.notes:
        say(f"note: {note}", err=True)
