# ruff: noqa: E501
"""Command lines: ``--set``, ``--swap``, ``--seed``, ``--duration`` and names of all sorts."""

import random

import fuzz_values
from fuzz_cases import Case
from fuzz_scenes import base_scene, command, set_parameter

from dsa_des.block.entry_points import entry_points_of
from dsa_des.files.toml_files import to_toml

KEYS = (
    "", ".", "..", "a.b", "blocks", "blocks.", "blocks.radar", "blocks..radar", "blocks.radar.",
    "blocks.radar.type", "blocks.traffic.intruders", "blocks.traffic.intruders[0]",
    "blocks.traffic.intruders[99]", "blocks.traffic.intruders[-1]", "blocks.traffic.intruders.0",
    "blocks.traffic.intruders[]", "blocks.traffic.intruders[0][0]", "blocks.traffic.intruders[0",
    "blocks.traffic.intruders[999999999999999999999999]", "blocks.traffic.intruders[٣].east_m",
    'blocks."radar".range_km', "blocks.'radar'.range_km", '"', '""', "'", "[", "]", "[0]", "wires",
    "wires[0]", "wires[0].delay_s", "wires[1].delay", "wires[1].holds", "wires[1].jitter_s",
    "wires[1].drop_probability", "wires[1].from", "wires[9].from", "seed", "duration_s", "title",
    "description", "processors", "processors.x", "processors.x.service_s", "weather", "weather.gas",
    "weather.visibility_km", "navigation.position_bias_m", "navigation.position_bias_m[0]",
    "terrain.height_m", "accuracy", "accuracy.angle_deg", "extends", "blocks.radar.extends",
    "x" * 5000, "a." * 2000 + "b", "blocks.radar." + "a." * 100 + "b", "é", "漢字.字", "\x1b[2J", "\0",
    "a\nb", "sections", "__class__", "blocks.__init__", "blocks.radar.__class__",
)  # fmt: skip
DURATIONS = (
    "0", "-1", "", " ", "nan", "inf", "-inf", "1e400", "1e-400", "1e99999999", "1e-99999999", "1/0",
    "1/3", "abc", "1 s", "0x10", "1e9", "4.6e9", "4.7e9", "1e18", "1e30", "1" * 5000, "1e-9",
    "1e-10", "1e-320", "½", "٣", "1_0", "2", "+2", "--", "\x1b[2J", "\0",
)  # fmt: skip
SEEDS = (
    "0", "-1", "1.5", "nan", "", "x", "9" * 20, "9" * 5000, str(2**63), str(2**63 - 1), "٣", "1_0",
    "0x10", " 1", "1e3", "\x1b[2J",
)  # fmt: skip


def override_case(rng: random.Random, case: Case) -> Case:
    """Return a sound scene with one to three odd options."""
    scene = base_scene(rng)
    case.files["scene.toml"] = to_toml(scene).encode()
    if rng.random() < 0.04:
        name = rng.choice((*fuzz_values.TEXTS, "pipe", "folder", "binary", "empty"))
        case.files |= {"|pipe": b"", "folder/x": b"", "binary": bytes(range(256)), "empty": b""}
        case.argv = [rng.choice(("check", "run", "graph", "explain")), _word(name)]
        return case
    case.argv = command(rng, "scene.toml")
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.random()
        if kind < 0.45:
            known = set_parameter(rng, base_scene(rng), 0) or "seed"
            case.argv += ["--set", _word(f"{known}={fuzz_values.raw(rng)}")]
        elif kind < 0.65:
            case.argv += ["--set", _word(f"{rng.choice(KEYS)}={fuzz_values.raw(rng)}")]
        elif kind < 0.7:
            case.argv += ["--set", _word(rng.choice((*KEYS, "=", "a=", "=1", "a==b", "a=b=c")))]
        elif kind < 0.85:
            block = rng.choice((*scene["blocks"], "", "nobody", "x" * 300, "\x1b[2J", "weather"))
            types = (*entry_points_of(), *fuzz_values.TEXTS)
            case.argv += ["--swap", _word(f"{block}={rng.choice(types)}")]
        elif kind < 0.93:
            case.argv += ["--duration", _word(rng.choice(DURATIONS))]
        else:
            case.argv += ["--seed", _word(rng.choice(SEEDS))]
    return case


def _word(text: str) -> str:
    """Return a text that an operating system can hand over: without NUL, encodable."""
    return text.replace("\0", "").encode("utf-8", "replace").decode()
