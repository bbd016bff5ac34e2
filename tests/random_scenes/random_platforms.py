"""Random second and third platforms: an intruder, or a place, that carries blocks of its own."""

from copy import deepcopy
from typing import Any

from dice import Dice

from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene


def equip(tables: dict[str, Any], scene: Scene, dice: Dice) -> None:
    """Let one or two more of what a traffic block moves carry what hangs behind that block.

    Parameters
    ----------
    tables : dict
        The scene, which is changed.
    scene : Scene
        The same as read, which knows how aircraft are called.
    dice : Dice
        Receives what was done as features.
    """
    blocks = tables["blocks"]
    sources = {name: [*one.platforms()] for name, one in Simulation(scene).components.items()}
    traffic = dice.choice(sorted(name for name, names in sources.items() if names))
    names = sources[traffic][1:]
    if blocks[traffic]["type"] == "traffic.scripted" and dice.chance(0.4, "site"):
        blocks[traffic]["sites"] = [{
            "name": "site", "east_m": dice.near(-2000, 2000), "north_m": dice.near(-2000, 2000),
            "alt_m": dice.pick(0, 250), "yaw_deg": dice.pick(0, 90), "pitch_deg": dice.pick(0, 20),
        }]  # fmt: skip
        names.append("site")
    chain = _behind(traffic, tables["wires"], blocks)
    for number, platform in enumerate(dice.sample(names, min(len(names), dice.pick(1, 1, 2)))):
        dice.features.add(f"{number + 2} platforms")
        # Before or behind the first one's by name, on which the order within an instant rests.
        copies = {name: f"{dice.choice('at')}{number}_{name}" for name in chain}
        for name, copy in copies.items():
            blocks[copy] = deepcopy(blocks[name])
            if "scan_rate_hz" in blocks[copy]:
                dice.maybe(blocks[copy], "offset_s", 0.5, 0, 0.1, "1/3")
                dice.maybe(blocks[copy], "enabled", 0.1, False)
        for wire in [wire for wire in tables["wires"] if wire["to"] in {*chain, traffic}]:
            ends = {end: copies.get(wire[end], wire[end]) for end in ("from", "to")}
            if ends["from"] == traffic:
                blocks[ends["to"]]["platform"] = platform
            if ends["from"] == traffic or ends["from"] != wire["from"]:
                tables["wires"].append({**wire, **ends})


def _behind(traffic: str, wires: list[dict[str, Any]], blocks: dict[str, Any]) -> list[str]:
    """Return what a traffic block feeds, but for blocks that end runs."""
    found: list[str] = []
    todo = [traffic]
    while todo:
        here = todo.pop()
        for wire in wires:
            name = wire["to"]
            ends = blocks[name]["type"].startswith(("traffic.", "encounters."))
            if wire["from"] == here and not ends and name not in found:
                found.append(name)
                todo.append(name)
    return found
