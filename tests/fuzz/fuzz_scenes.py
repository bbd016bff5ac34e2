# ruff: noqa: E501
"""Scenes with one to four things wrong with them: values, keys, wiring, text."""

import copy
import random
import tomllib
import typing
from functools import lru_cache
from pathlib import Path
from typing import Any

import fuzz_values
from fuzz_cases import Case

from dsa_des.block.component import Parameters
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.registry import section_models
from dsa_des.errors import SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.scene.scene import check_scene
from dsa_des.scene.scene_file import SceneFile

BASE = """
title = "fuzzed"
duration_s = 2
seed = 1
wires = ["traffic -> transform -> gate", "gate -> radar -> fusion", "gate -> eo -> fusion",
  "gate -> ir -> fusion", "fusion -> tracker"]
[blocks]
transform.type = "geometry.ellipsoid"
gate.type = "gate"
fusion.type = "fusion.pick_best"
tracker.type = "tracking.stub"
[blocks.radar]
type = "radar.swerling"
scan_rate_hz = 5
azimuth_deg = [-110, 110]
elevation_deg = [-25, 25]
range_km = 20
power_w = 50
antenna_gain_db = 33
wavelength_m = 0.032
noise_figure_db = 5
losses_db = 4
false_alarm_probability = 1e-6
bandwidth_hz = 1e6
[blocks.eo]
type = "optical.eo"
scan_rate_hz = 20
offset_s = 0.05
azimuth_deg = [-110, 110]
elevation_deg = [-30, 30]
azimuth_pixels = 3000
elevation_pixels = 1000
threshold = 1.5
[blocks.ir]
type = "optical.ir"
scan_rate_hz = 2
azimuth_deg = [-90, 90]
elevation_deg = [-20, 20]
azimuth_pixels = 1500
elevation_pixels = 500
threshold = 2.5
[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 50 }
[[blocks.traffic.intruders]]
name = "head_on"
east_m = 60
north_m = 3000
up_m = 30
heading_deg = 180
speed_mps = 60
[[blocks.traffic.intruders]]
name = "crossing"
lat_deg = 52.02
lon_deg = 4.42
alt_m = 1100
heading_deg = 270
speed_mps = 110
legs = [{ kind = "straight", duration_s = 1 }, { kind = "turn", rate_deg_s = -2, angle_deg = 40 },
  { kind = "climb", climb_mps = 3, duration_s = 1 }, { kind = "waypoints", points = [{ east_m = 0, north_m = 9 }]}]
"""

ADDITIONS = (
    '[weather]\ngas = true\nrain_rate_mm_h = 5\nfog_water_g_m3 = 0.05',
    '[navigation]\nposition_noise_m = [5, 5, 9]\nattitude_noise_deg = [0.5, 0.2, 0.2]',
    '[terrain]\nheight_m = 20\n[blocks.radar]\nazimuth_resolution_deg = 2\nelevation_resolution_deg = 2\nrange_resolution_m = 100',
    '[accuracy]\ndetection_probability = 0.05\nangle_deg = 0.5',
    '[blocks.radar]\nbeam_sweep = true\nfalse_alarms = true\nrange_resolution_m = 150\n'
    'azimuth_resolution_deg = 3\nelevation_resolution_deg = 3\nfluctuation = "sampled"',
    '[blocks.eo]\nfalse_alarms_per_frame = 0.1\nbackground = "sky"',
    '[processors.cpu]\nservice_s = 0.01\nservice_spread_s = 0.01\n[blocks.eo]\nprocessor = "cpu"',
    '[blocks.radar]\nlatency_s = 0.05',
    '[blocks.radar]\ndeclare_m = 2\ndeclare_n = 3\njitter_s = 0.01',
    '[blocks.radar]\ntype = "radar.threshold"\nthreshold_db = 12',
    '[blocks.radar]\npulses = 4\ncalibrate = { rcs_dbsm = 3, range_km = 10, pd = 0.9, swerling = 1 }',
    '[blocks.transform]\ntype = "geometry.flat_earth"',
    '[blocks.transform]\ntype = "geometry.geodesic"',
    '[blocks.fusion]\ntype = "fusion.gated"\ntime_gate_s = 0.1\nangle_gate_deg = 2',
    '[blocks.traffic]\nupdate_rate_hz = 2',
)  # fmt: skip

RANDOM_TRAFFIC = {
    "type": "traffic.random",
    "ownship": {"lat_deg": 0, "lon_deg": 0, "alt_m": 500, "speed_mps": 40},
    "intruders": 20,
    "radius_km": 10,
}


def base_scene(rng: random.Random) -> dict[str, Any]:
    """Return the tables of a sound scene, with none to four additions."""
    scene = tomllib.loads(BASE)
    for addition in rng.sample(ADDITIONS, rng.choice((0, 0, 1, 2, 4))):
        _merge(scene, tomllib.loads(addition))
    if "calibrate" in scene["blocks"]["radar"]:
        del scene["blocks"]["radar"]["bandwidth_hz"]
    if rng.random() < 0.15:
        scene["blocks"]["traffic"] = copy.deepcopy(RANDOM_TRAFFIC)
    if rng.random() < 0.15:
        scene["blocks"]["avoidance"] = {"type": "avoidance.turn_away"}
        back = {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"}
        scene["wires"] += ["tracker -> avoidance", back]
    return scene


def _merge(base: dict[str, Any], over: dict[str, Any]) -> None:
    for key, item in over.items():
        if isinstance(item, dict) and isinstance(base.get(key), dict):
            _merge(base[key], item)
        else:
            base[key] = item


@lru_cache(maxsize=1)
def known_keys() -> dict[str, tuple[str, ...]]:
    """Return dotted parameter names by block type, and those of each section."""
    found = {name: _names(point.load().Parameters) for name, point in entry_points_of().items()}
    return found | {f"[{name}]": _names(model) for name, model in section_models().items()}


def _names(model: Any, depth: int = 0) -> tuple[str, ...]:
    names: list[str] = []
    for name, field in model.model_fields.items():
        names.append(name)
        for nested in _models(field.annotation) if depth < 3 else ():
            names += [f"{name}.{inner}" for inner in _names(nested, depth + 1)]
    return tuple(dict.fromkeys(names))


def _models(annotation: Any) -> typing.Iterator[Any]:
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _models(argument)


def set_parameter(rng: random.Random, scene: dict[str, Any], item: Any) -> str:
    """Put a value at a parameter that some block or section of the scene knows; return its key."""
    blocks = scene["blocks"]
    places = [(name, ("blocks", name), table.get("type")) for name, table in blocks.items()]
    places += [(name, (name[1:-1],), name) for name in known_keys() if name.startswith("[")]
    _, path, known = rng.choice([place for place in places if place[2] in known_keys()])
    names = known_keys()[known]
    if not names:
        return ""
    return place_of(scene, path, rng.choice(names), item, rng.randrange(9))


def place_of(
    scene: dict[str, Any], path: tuple[str, ...], name: str, item: Any, place: int = 0
) -> str:
    """Put a value at a dotted name below a table of a scene; return its key, or nothing."""
    *inner, last = name.split(".")
    table: Any = scene
    key = ""
    for part in (*path, *inner):
        table = table.setdefault(part, {})
        key += f".{part}" if key else part
        if isinstance(table, list):
            position = place % len(table) if table else 0
            if not table:
                table.append({})
            table = table[position]
            key += f"[{position}]"
        if not isinstance(table, dict):
            return ""
    table[last] = item
    return f"{key}.{last}"


def any_place(rng: random.Random, tables: Any) -> tuple[Any, Any]:
    """Return a container of a tree of tables and lists, and a key of it."""
    places: list[tuple[Any, Any]] = []
    todo = [tables]
    while todo:
        container = todo.pop()
        keys = container if isinstance(container, dict) else range(len(container))
        for key in keys:
            places.append((container, key))
            if isinstance(container[key], dict | list):
                todo.append(container[key])
    return rng.choice(places)


def mutate(rng: random.Random, scene: dict[str, Any]) -> None:
    """Change one thing of a scene's tables."""
    kind = rng.random()
    if kind < 0.6:
        item = fuzz_values.number(rng) if rng.random() < 0.7 else fuzz_values.value(rng)
        set_parameter(rng, scene, item)
        return
    container, key = any_place(rng, scene)
    if kind < 0.75:
        container[key] = fuzz_values.value(rng)
    elif kind < 0.8:
        del container[key]
    elif kind < 0.85 and isinstance(container, dict):
        container[rng.choice(fuzz_values.TEXTS)] = container.pop(key)
    elif kind < 0.9 and isinstance(container, list):
        container += [copy.deepcopy(container[key])] * rng.choice((1, 2, 40))
    else:
        ends = [*scene["blocks"], "nobody"] if isinstance(scene.get("blocks"), dict) else ["a"]
        wire: dict[str, Any] = {"from": rng.choice(ends), "to": rng.choice(ends)}
        for name in rng.sample(("delay_s", "delay", "jitter_s", "drop_probability", "holds"), 2):
            wire[name] = fuzz_values.value(rng) if rng.random() < 0.6 else rng.choice(
                ("1 scan", "nothing", 0.1, 1)
            )  # fmt: skip
        if isinstance(scene.get("wires"), list):
            scene["wires"].append(wire)


def allowed_extremes(rng: random.Random, scene: dict[str, Any]) -> dict[str, Any]:
    """Return a scene with one to three odd values that its models allow: it has to run."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        for _ in range(12):
            changed = copy.deepcopy(scene)
            set_parameter(rng, changed, fuzz_values.number(rng))
            try:
                check_scene(SceneFile(Path("scene.toml"), changed))
            except SceneError:
                continue
            scene = changed
            break
    return scene


def scene_text(rng: random.Random, scene: dict[str, Any]) -> bytes:
    """Return a scene as the bytes of a file; sometimes they are damaged."""
    data = to_toml(scene).encode("utf-8", "surrogatepass")
    kind = rng.random()
    if kind < 0.85:
        return data
    if kind < 0.9:
        lines = data.split(b"\n")
        at = rng.randrange(len(lines))
        lines[at] = lines[at].split(b"=")[0] + b"= " + fuzz_values.raw(rng).encode(
            "utf-8", "surrogatepass"
        )  # fmt: skip
        return b"\n".join(lines)
    return damaged(rng, data)


def damaged(rng: random.Random, data: bytes) -> bytes:
    """Return bytes with something done to them that happens to files."""
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + rng.randrange(1, 60))
    noise = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 20)))
    return rng.choice((
        b"", data[:at], data[at:], data[:at] + noise + data[at:], data[:at] + noise + data[end:],
        data[:at] + b"\0" + data[at:], b"\xef\xbb\xbf" + data, b"\xff\xfe" + data,
        data.decode("utf-8", "replace").encode("utf-16"), data.replace(b"\n", b"\r\n"),
        data.replace(b"\n", b"\r"), data + data, data[:at] + data[at:end] * 50 + data[end:],
        data.decode("utf-8", "replace").encode("utf-32"), data[:at] + b"\x1b[2J" + data[at:],
        bytes([b"\x7fELF", b"PK\3\4"][at % 2]) + data, b"\n" * 2000 + data,
    ))  # fmt: skip


def extending(rng: random.Random, case: Case) -> None:
    """Make the scene extend files in a way that no project would."""
    scene = case.files.get("scene.toml", b"")
    kind = rng.randrange(9)
    if kind == 0:
        name = rng.choice((*fuzz_values.TEXTS, "scene.toml", "pipe", "folder", "loop"))
        escaped = "".join(f"\\u{ord(c):04x}" if ord(c) < 0x10000 else c for c in name)
        case.files["scene.toml"] = f'extends = "{escaped}"\n'.encode("utf-8", "replace")
    elif kind == 1:
        length = rng.choice((2, 30, 40, 200))
        for i in range(length):
            case.files[f"c{i}.toml"] = f'extends = "c{i + 1}.toml"\n'.encode()
        case.files[f"c{length}.toml"] = scene if rng.random() < 0.5 else b'extends = "c0.toml"'
        case.files["scene.toml"] = b'extends = "c0.toml"\n'
    elif kind == 2:
        depth = rng.choice((3, 8, 25))
        for i in range(depth):
            case.files[f"c{i}.toml"] = f'extends = ["c{i + 1}.toml", "d{i}.toml"]'.encode()
            case.files[f"d{i}.toml"] = f'extends = "c{i + 1}.toml"'.encode()
        case.files[f"c{depth}.toml"] = b'title = "x"'
        case.files["scene.toml"] = b'extends = "c0.toml"\n' + scene
    elif kind == 3:
        case.files["scene.toml"] = b"extends = " + fuzz_values.raw(rng).encode(
            "utf-8", "surrogatepass"
        ) + b"\n" + scene  # fmt: skip
    elif kind == 4:
        case.files["@scene.toml"] = rng.choice((b"scene.toml", b"/dev/zero", b"folder", b"nowhere"))
        case.files.pop("scene.toml", None)
        case.files["folder/x"] = b""
    elif kind == 5:
        case.files["|scene.toml"] = b""
        case.files.pop("scene.toml", None)
    elif kind == 6:
        nested = "a." * rng.choice((10, 62, 70, 2000)) + "b = 1\n"
        case.files["scene.toml"] = nested.encode() + scene
    elif kind == 7:
        part = f"[weather{'.x' * rng.choice((1, 20, 60))}]\nextends = 'c.toml'\n"
        case.files["c.toml"] = part.encode()
        case.files["scene.toml"] = scene + b"\n" + part.encode()
    else:
        many = rng.choice((100, 3000))
        extra = "".join(f'[blocks.b{i}]\ntype = "gate{i % 7}"\n' for i in range(many))
        case.files["scene.toml"] = scene + b"\n" + extra.encode()


def scene_case(rng: random.Random, case: Case) -> Case:
    """Return a scene that is checked, simulated, or run with everything that belongs to it."""
    scene = base_scene(rng)
    if rng.random() < 0.5:
        case.files["scene.toml"] = to_toml(allowed_extremes(rng, scene)).encode()
        case.argv = command(rng, "scene.toml")
        return case
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        if isinstance(scene.get("blocks"), dict) and scene["blocks"]:
            try:
                mutate(rng, scene)
            except (AttributeError, TypeError, KeyError, IndexError):
                break  # what is left of the scene has no such place any more
    case.files["scene.toml"] = scene_text(rng, scene)
    if rng.random() < 0.1:
        extending(rng, case)
    case.argv = command(rng, "scene.toml")
    return case


def command(rng: random.Random, scene: str) -> list[str]:
    """Return a command for a scene; those that take longer are rarer."""
    kind = rng.random()
    if kind < 0.5:
        return ["simulate", scene]
    if kind < 0.8:
        return ["check", scene]
    if kind < 0.87:
        return ["run", scene, "--quiet", "--out", "out"]
    if kind < 0.9:
        return ["run", scene, "--json", "--out", "out"]
    if kind < 0.93:
        return ["run", scene, "--out", "out"]
    if kind < 0.96:
        return ["graph", scene, *rng.choice(((), ("--dot",), ("--png", "--out", "out")))]
    return ["explain", scene]
