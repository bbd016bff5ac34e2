# ruff: noqa: E501
"""Studies with something wrong in them: axes, draws, metrics, figures, texts."""

import copy
import random
from typing import Any

import fuzz_values
from fuzz_cases import Case
from fuzz_overrides import KEYS
from fuzz_scenes import any_place, base_scene, damaged, extending, set_parameter

from dsa_des.files.toml_files import to_toml

STUDY: dict[str, Any] = {
    "title": "fuzzed",
    "scene": "base.toml",
    "replicas": 2,
    "seed": 3,
    "metrics": ["first_detection", {"metric": "detection_share", "sensors": ["radar"]}],
    "set": {"duration_s": 1},
    "axes": {"blocks.radar.scan_rate_hz": [2, 5]},
}
AXES = (
    {"from": 1, "to": 3, "step": 1}, {"from": 1, "to": 3, "steps": 3},
    {"from": 1, "to": 3, "steps": 3, "log": True}, {"files": "*.daa"}, {"beat_with": "eo"},
    {"values": [1, 2]}, {"set": {"a": [1, 2], "b": [2, 3]}}, [1, 1], [], [1, "a"], ["1/3", 0.5],
    ["1/0", 2], {"from": 1, "to": 2, "step": 1e-9}, {"from": 0, "to": 1e300, "steps": 3},
    {"from": 1, "to": 2, "steps": 100000}, {"from": "1e-9999999", "to": 2, "steps": 2},
    {"files": ["~nobody/*", "x" * 3000]}, {"files": "/**/*"}, {"files": "**"}, {"files": "a\0b*"},
)  # fmt: skip
DRAWS = (
    {"uniform": [0, 1]}, {"uniform": [-1e308, 1e308]}, {"normal": [0, 1e300]}, {"choice": []},
    {"choice": [1, "a"]}, {"latin_hypercube": [0, 1]}, {"latin_hypercube": {"normal": [0, 1]}},
    {"uniform": [1, 0]}, {"uniform": [0]}, {"uniform": ["a", 1]}, {"normal": [1, 1e-320]},
    {"uniform": [1e-320, 1e-310]}, {"uniform": [0, 1], "normal": [0, 1]},
)  # fmt: skip
KEYS_OF_A_STUDY = (
    "title", "description", "scene", "set", "swap", "seed", "replicas", "axes", "draws", "metrics",
    "figures", "stop_when", "compare", "over", "confidence", "interval", "runs_per_chunk", "extends",
)  # fmt: skip


def study_case(rng: random.Random, case: Case) -> Case:
    """Return a study that is run, or one whose folder is damaged and shown."""
    scene = base_scene(rng)
    case.files["base.toml"] = to_toml(scene).encode()
    if rng.random() < 0.06:
        return _shown(rng, case)
    study = copy.deepcopy(STUDY)
    if rng.random() < 0.4:
        _vary(rng, study, scene)
    for _ in range(rng.choice((0, 0, 1, 2)) if "draws" in study else rng.choice((1, 1, 2, 3))):
        _mutate(rng, study, scene)
    if isinstance(study.get("set"), dict):
        study["set"]["duration_s"] = 1  # many long runs are no fault, and no case either
    for table in (study.get("axes"), study.get("draws")):
        if isinstance(table, dict):
            table.pop("duration_s", None)
    case.files["scene.toml"] = _bytes(rng, study)
    if rng.random() < 0.05:
        extending(rng, case)
    case.argv = ["study", "scene.toml", "--out", "out", "--workers", "1"]
    if rng.random() < 0.8:
        case.argv.append("--quiet")
    if rng.random() < 0.15:
        text = f"{rng.choice((*KEYS, *KEYS_OF_A_STUDY))}={fuzz_values.raw(rng)}"
        case.argv += ["--set", text.replace("\0", "").encode("utf-8", "replace").decode()]
    return case


def _vary(rng: random.Random, study: dict[str, Any], scene: dict[str, Any]) -> None:
    """Give an axis and a draw to parameters of the scene, with values that may be allowed."""
    for table in ("axes", "draws"):
        key = set_parameter(rng, copy.deepcopy(scene), 0) or "duration_s"
        numbers = sorted(
            fuzz_values.plausible(rng) if rng.random() < 0.7 else fuzz_values.number(rng)
            for _ in range(2)
        )
        study[table] = {key: numbers if table == "axes" else {"uniform": numbers}}


def _mutate(rng: random.Random, study: dict[str, Any], scene: dict[str, Any]) -> None:
    kind = rng.random()
    parameter = set_parameter(rng, copy.deepcopy(scene), 0) or "seed"
    item = fuzz_values.value(rng)
    if kind < 0.2:
        study[rng.choice(KEYS_OF_A_STUDY)] = item
    elif kind < 0.4:
        axis = rng.choice(AXES) if rng.random() < 0.7 else [item, fuzz_values.number(rng)]
        study["axes"] = {parameter if rng.random() < 0.7 else rng.choice(KEYS): axis}
    elif kind < 0.6:
        draw = rng.choice(DRAWS) if rng.random() < 0.7 else {
            "uniform": [fuzz_values.number(rng), fuzz_values.number(rng)]
        }  # fmt: skip
        study["draws"] = {parameter if rng.random() < 0.8 else rng.choice(KEYS): draw}
    elif kind < 0.7:
        study["set"] = {parameter: item, "duration_s": 1}
    elif kind < 0.8:
        container, key = any_place(rng, study)
        container[key] = item
    elif kind < 0.86:
        study["figures"] = [{
            "metric": rng.choice(("first_detection", "no", "")), "axis": "blocks.radar.scan_rate_hz",
            rng.choice(("lines", "kind", "x")): item,
        }]  # fmt: skip
    elif kind < 0.92:
        study["stop_when"] = {"metric": rng.choice(fuzz_values.TEXTS), "half_width": item}
    else:
        study["swap"] = {rng.choice(("radar", "", "x")): rng.choice(fuzz_values.TEXTS)}


def _bytes(rng: random.Random, study: dict[str, Any]) -> bytes:
    data = to_toml(study).encode("utf-8", "surrogatepass")
    return damaged(rng, data) if rng.random() < 0.1 else data


def _shown(rng: random.Random, case: Case) -> Case:
    whole = b'{"study": "s.toml", "scene": "base.toml", "study_sha256": "0", "tables": {}}'
    texts = (
        b"", b"[]", b"\xff\xfe", b"[" * 100000, b'{"study": 1}', b"9" * 5000, b"nan", whole,
        whole.replace(b'"s.toml"', b"5"), whole.replace(b"{}", b"[]"),
        whole.replace(b"{}", b'{"scene": "base.toml"}'), whole.replace(b"s.toml", b"a\\u0000b"),
    )  # fmt: skip
    case.files["d/study.json"] = damaged(rng, whole) if rng.random() < 0.4 else rng.choice(texts)
    case.files["d/parts/part-000-000000.parquet"] = rng.choice((b"", b"PAR1", b"PAR1" * 9))
    case.argv = ["study", "show", rng.choice(("d", "d", "d", "nowhere", "base.toml", "x" * 3000))]
    return case
