"""Every parameter of every block and section at the ends of what its model allows, one by one."""

import copy
import tomllib
from functools import lru_cache
from typing import Any

from fuzz_cases import Case
from fuzz_scenes import ADDITIONS, BASE, RANDOM_TRAFFIC, _merge, known_keys, place_of
from pydantic import ValidationError

from dsa_des.block.registry import find_component, section_models
from dsa_des.files.toml_files import to_toml
from dsa_des.scene.block_table import split_engine_and_own_keys

VALUES = (
    1e-30, 1e-20, 1e-12, 1e-6, 1e-3, 0, 1, 1000, 1_000_000, 1e9, 1e12, 1e15, 1e18, 1e30, -1e-30,
    -1e-6, -1, -1000, -1e6, -1e12, -1e30, 90, -90, 180, 300, -300, 360, 0.999999, 0.5, 2**62,
    10**20, 10**99,
)  # fmt: skip

#: Coprime with the number of places, so that a few thousand cases reach every block.
_STRIDE = 7919

_SENSOR = {"scan_rate_hz": 5, "range_km": 20}
_OTHERS: dict[str, dict[str, Any]] = {
    "radar.range_boundary": {"radar": {"type": "radar.range_boundary", **_SENSOR}},
    "optical.range_boundary": {"eo": {"type": "optical.range_boundary", **_SENSOR}},
    "optical.projection": {"eo": {"type": "optical.projection"}},
    "fusion.gated": {"fusion": {"type": "fusion.gated", "time_gate_s": 0.1, "angle_gate_deg": 2}},
    "geometry.flat_earth": {"transform": {"type": "geometry.flat_earth"}},
    "traffic.random": {"traffic": RANDOM_TRAFFIC},
    "avoidance.turn_away": {"avoidance": {"type": "avoidance.turn_away", "pause_s": 0.5}},
}


@lru_cache(maxsize=1)
def scenes() -> tuple[dict[str, Any], ...]:
    """Return sound scenes that have every type of block between them, plain and with effects."""
    plain = tomllib.loads(BASE)
    found = [plain]
    for chosen in (ADDITIONS[:3], ADDITIONS[4:9], ADDITIONS[9:10], ADDITIONS[10:11]):
        scene = copy.deepcopy(plain)
        for addition in chosen:
            _merge(scene, tomllib.loads(addition))
        if "calibrate" in scene["blocks"]["radar"]:
            del scene["blocks"]["radar"]["bandwidth_hz"]
        found.append(scene)
    for blocks in _OTHERS.values():
        scene = copy.deepcopy(plain)
        for name, table in blocks.items():
            same = scene["blocks"].get(name, {}) if len(table) == 1 else {}
            scene["blocks"][name] = {**same, **copy.deepcopy(table)}
        if "avoidance" in blocks:
            back = {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"}
            scene["wires"] += ["tracker -> avoidance", back]
        found.append(scene)
    return tuple(found)


@lru_cache(maxsize=1)
def places() -> tuple[tuple[int, tuple[str, ...], str], ...]:
    """Return (scene, path of the table, parameter) of everything that can be set."""
    found = []
    for number, scene in enumerate(scenes()):
        tables = [(("blocks", name), table["type"]) for name, table in scene["blocks"].items()]
        if number < 5:
            tables += [((name[1:-1],), name) for name in known_keys() if name.startswith("[")]
        else:
            tables = [item for item in tables if item[1] in _OTHERS]
        for path, known in tables:
            found += [(number, path, name) for name in known_keys()[known]]
    return tuple(found)


def sweep_case(number: int, case: Case) -> Case:
    """Return the case of one value of one parameter; neighbouring numbers are far apart."""
    which, path, name = places()[(number // len(VALUES)) * _STRIDE % len(places())]
    value = VALUES[number % len(VALUES)]
    for item in ([value] * 3, [value] * 2, value):
        scene = copy.deepcopy(scenes()[which])
        place_of(scene, path, name, item)
        if _fits(scene, path):
            break
    case.files["scene.toml"] = to_toml(scene).encode()
    case.argv = ["simulate", "scene.toml"]
    return case


def _fits(scene: dict[str, Any], path: tuple[str, ...]) -> bool:
    """Tell whether a table is what its model allows."""
    table = scene
    for part in path:
        table = table.get(part, {})
    if path[0] == "blocks":
        _, own = split_engine_and_own_keys(table, find_component(table["type"]).Parameters)
        model = find_component(table["type"]).Parameters
    else:
        own, model = table, section_models()[path[0]]
    try:
        model.model_validate(own)
    except ValidationError:
        return False
    return True
