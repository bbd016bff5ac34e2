"""What costs little or ought to: two forms of a scene in turn."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from components.benchmark.scenes import CLOCKED, load_case_scene, select_cases, time_build_and_run
from components.examples import configs_folder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene, scene_with_changes
from dsa_des.scene.scene_file import read_scene_tables

#: A processor that the three sensors of a scene share, and that is busy a third of the time.
_SHARED = (
    "processors.shared.service_s=0.01",
    *(f"blocks.{name}.processor=shared" for name in CLOCKED),
)


@dataclass(frozen=True)
class Pair:
    """Two forms of one benchmark scene, with and without something, to compare CPU times."""

    name: str
    what: str
    #: At most so many times the CPU time of the plain form.
    wanted: float
    #: The benchmark scene.
    case: str
    #: From the case's overrides to the form in question and the plain one.
    forms: Callable[[str, bool], tuple[Scene, Scene]]


def drop_unused_effects(scene: Scene) -> Scene:
    """Return the scene with block classes that declare only the effects that it really builds."""
    used: dict[str, set[str]] = {}
    for item in Simulation(scene).plan:
        if item.built:
            used.setdefault(item.block, set()).add(item.effect.name)
    blocks = dict(scene.blocks)
    for name, block in blocks.items():
        kept = tuple(e for e in block.cls.effects if e.name in used.get(name, ()))
        cls: Any = type(block.cls.__name__, (block.cls,), {})
        cls.effects = kept  # afterwards: what makes a class of sensors adds its own
        blocks[name] = replace(block, cls=cls)
    return replace(scene, blocks=blocks)


def _with_and_without_effects(case: str, quick: bool) -> tuple[Scene, Scene]:
    scene = load_case_scene(select_cases([case])[0], quick=quick)
    return scene, drop_unused_effects(scene)


def _with_and_without_shared_processor(case: str, quick: bool) -> tuple[Scene, Scene]:
    (result,) = select_cases([case])
    return load_case_scene(result, quick=quick, sets=_SHARED), load_case_scene(result, quick=quick)


def _with_and_without_alerting(case: str, quick: bool) -> tuple[Scene, Scene]:
    duration_s = "40" if quick else None
    with_it, plain = (
        configs_folder() / "alerting" / f"{case}.toml",
        configs_folder() / f"{case}.toml",
    )
    return load_scene(with_it, duration_s=duration_s), load_scene(plain, duration_s=duration_s)


def _with_and_without_second_platform(case: str, quick: bool) -> tuple[Scene, Scene]:
    plain = load_scene(configs_folder() / f"{case}.toml", duration_s="40" if quick else None)
    tables = plain.resolved()
    copies = {name: f"{name}_b" for name in tables["blocks"] if name != "traffic"}
    wires = [f"{wire} " for wire in tables["wires"]]  # "from.port -> to.port"
    for name, copy in copies.items():
        tables["blocks"][copy] = dict(tables["blocks"][name])
        wires = [re.sub(rf"\b{name}([. ])", rf"{copy}\1", wire) for wire in wires]
    tables["blocks"]["transform_b"]["platform"] = "head_on"
    return scene_with_changes(
        read_scene_tables({**tables, "wires": [*tables["wires"], *map(str.strip, wires)]}, case), ()
    ), plain


PAIRS = (
    Pair("unused_effects",
         "effects that the scene does not call for: declared, or not there at all",
         1.03, "hundred", _with_and_without_effects),
    Pair("shared_processor", "three sensors queue for one processor, or do not",
         5.0, "clocks", _with_and_without_shared_processor),
    Pair("alerting", "first light with alert levels of its tracks at 1 Hz, or without",
         2.0, "first_light", _with_and_without_alerting),
    Pair("both_equipped", "first light with all of it on the head-on aircraft too, or without",
         2.1, "first_light", _with_and_without_second_platform),
)  # fmt: skip


def measure_pairs(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return a row with the ratio of CPU times of a scene with and without something: median and
    quartiles over alternating runs.
    """
    (pair,) = (pair for pair in PAIRS if pair.name == name)
    forms = pair.forms(pair.case, quick)
    for scene in forms:
        time_build_and_run(scene, [], MemorySink())
    ratios, times = [], []
    for number in range(4 * repeats):
        order = forms if number % 2 else forms[::-1]
        spent = {id(scene): sum(time_build_and_run(scene, [], MemorySink())[:2]) for scene in order}
        ratios.append(spent[id(forms[0])] / spent[id(forms[1])])
        times.append(spent[id(forms[0])])
    simulated_s = float(Simulation(forms[0]).duration_s)
    return {
        "scene": pair.name,
        "times": median(ratios),
        "times_quartiles": [sorted(ratios)[repeats], sorted(ratios)[3 * repeats]],
        "wanted": pair.wanted,
        "simulated_s_per_s": simulated_s / median(times),
    }
