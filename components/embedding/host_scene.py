"""A scene with the host program in place of its traffic."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from components.embedding.host_traffic import HostTraffic, HostTrafficParameters, Plane
from components.messages.targets import TrafficStates
from dsa_des.block.component import Component, Context
from dsa_des.block.registry import UnknownType, find_component
from dsa_des.errors import Problem, SceneError, UsageError, did_you_mean
from dsa_des.scene.block_table import Block
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.platforms import platform_by_block
from dsa_des.scene.scene import Scene, scene_from_tables
from dsa_des.scene.scene_file import SceneFile, read_scene_file
from dsa_des.time.randomness import Streams

HOST = "traffic.host"
#: What the source is called in a scene that has none; its wires then name it so.
_NAME = "traffic"


def load_for_host(
    scene: Scene | Path | str,
    *,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    platform: str | None = None,
) -> Scene:
    """Return a host's scene (file or object); one without traffic gets the block a host moves.

    Of several platforms' chains only that of the one that the host's ownship is.
    """
    if isinstance(scene, Scene):
        if tuple(sets) or tuple(swaps):
            raise UsageError("sets and swaps change a scene while it is loaded: give its file")
        loaded = scene if seed is None else replace(scene, seed=seed)
    else:
        loaded = _load_scene(scene, sets=sets, swaps=swaps, seed=seed)
    return loaded if platform is None else _select_platform(loaded, platform)


def _load_scene(
    scene: Path | str, *, sets: Iterable[str], swaps: Iterable[str], seed: int | None
) -> Scene:
    scene_file = read_scene_file(find_input_file(scene, "scene"))
    blocks = scene_file.data.get("blocks", {})
    if isinstance(blocks, dict) and _NAME not in blocks and not _has_traffic(scene_file):
        blocks[_NAME] = {"type": HOST}
    return scene_from_tables(scene_file, sets=sets, swaps=swaps, seed=seed)


def _select_platform(scene: Scene, platform: str) -> Scene:
    """Return a scene with only the blocks on this platform, which becomes the ownship."""
    name = traffic_block_name(scene)
    block = scene.blocks[name]
    context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
    names = block.cls(name, block.parameters, context).platforms()
    carrying = platform_by_block(scene, {name: names}) if names else {}
    known = sorted({*carrying.values()})
    if platform not in known:
        message = f"nothing of this scene is carried by {platform!r}{did_you_mean(platform, known)}"
        raise SceneError([Problem(str(scene.path), "platform", message)])
    kept = {name, *(one for one, on in carrying.items() if on == platform)}
    blocks = {
        one: replace(of, options=of.options.model_copy(update={"platform": None}))
        for one, of in scene.blocks.items()
        if one in kept
    }
    wires = [wire for wire in scene.wires if {wire.source, wire.target} <= kept]
    return replace(scene, blocks=blocks, wires=wires, graph=scene.graph.subgraph(kept).copy())


def _has_traffic(scene_file: SceneFile) -> bool:
    for table in scene_file.data["blocks"].values():
        try:
            if isinstance(table, dict) and _is_traffic(find_component(str(table.get("type")))):
                return True
        except UnknownType:  # said when the scene is checked
            continue
    return False


def _is_traffic(cls: type[Component]) -> bool:
    sends = [output.message for output in cls.outputs.values()]
    alone = not any(port.required for port in cls.inputs.values())
    return alone and any(issubclass(message, TrafficStates) for message in sends)


#: Keys of sensors that need flights, and their values that do not.
_NEEDS_FLIGHTS: dict[str, bool | str] = {
    "beam_sweep": False, "measures_range_rate": False, "moving_target_filter": "none",
    "between_scans": "as_at_scan",
}  # fmt: skip


def refuse_keys_needing_flights(scene: Scene) -> None:
    """Raise SceneError for each sensor parameter that needs flights between a host's calls."""
    problems = [
        Problem(
            str(scene.path), f"blocks.{name}.{key}",
            "needs to know where aircraft are between the calls of a host program, which says "
            f"where they are at its calls only: set it to {_toml_value(off)}", value,
        )
        for name, block in scene.blocks.items()
        for key, off in _NEEDS_FLIGHTS.items()
        if (value := getattr(block.parameters, key, off)) != off
        and getattr(block.parameters, "enabled", True)
    ]  # fmt: skip
    if problems:
        raise SceneError(problems)


def _toml_value(value: bool | str) -> str:
    return repr(value) if isinstance(value, str) else str(value).lower()


def traffic_block_name(scene: Scene) -> str:
    """Return the only traffic block's name, which a host replaces; SceneError if not just one."""
    sources = [name for name, block in scene.blocks.items() if _is_traffic(block.cls)]
    if len(sources) != 1:
        what = (
            f"{len(sources)} blocks send traffic ({', '.join(sources)})"
            if sources
            else "no traffic"
        )
        message = f"{what}: a host takes the place of exactly one"
        raise SceneError([Problem(str(scene.path), "blocks", message)])
    return sources[0]


def planes_in_scene(scene: Scene) -> list[Plane]:
    """Return the planes in a scene's host traffic block; empty if its traffic is another kind."""
    parameters: Any = scene.blocks[traffic_block_name(scene)].parameters
    return list(parameters.planes) if isinstance(parameters, HostTrafficParameters) else []


def with_host_traffic(scene: Scene, planes: Sequence[Plane]) -> Scene:
    """Return the scene with its traffic replaced by these planes, which the host moves.

    The ticks stay those of the scene, so scans and draws are those of the whole run.
    """
    name = traffic_block_name(scene)
    parameters = HostTrafficParameters(planes=list(planes))
    block = Block(name, HOST, HostTraffic, parameters)
    return replace(scene, blocks={**scene.blocks, name: block})
