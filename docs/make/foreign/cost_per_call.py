"""What a foreign part's seam costs: ``python -m docs.make.foreign.cost_per_call [FMU]`` prints it.

Blocks that do next to nothing are called at every look of a camera; a call costs what a run takes
longer with them, the best of twelve. Doors whose package or compiler is missing are left out, and
FMUs where none is named.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

import dsa_des
from components.benchmark.measure import pin_to_one_processor
from components.messages.detections import Detections
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.wake import Wake
from dsa_des.embed import Simulator
from dsa_des.running.simulation import Simulation
from dsa_des.terminal.terminal import say

_PAGE = Path(__file__).parents[2] / "foreign.md"
_CALLS, _REPEATS = 400, 12
_RATE_HZ = 20
_TARGET = {"name": "near", "east_m": 300.0, "north_m": 900.0, "heading_deg": 217.0,
           "speed_mps": 1.0}  # fmt: skip
_OWNSHIP = {"lat_deg": -41.3, "lon_deg": 3.0, "alt_m": 900.0, "heading_deg": 217.0,
            "speed_mps": 1.0}  # fmt: skip


class Listens(Component):
    """Takes detections and answers nothing."""

    inputs = {"received": Input(Detections, "trigger", "Detections.")}
    outputs = {"detections": Output(Detections, "None.")}

    def run(self, wake: Wake) -> None:
        """Read what came."""
        wake["received"].range_m.min(initial=np.inf)


class ListensInWindows(Listens):
    """The same, a window at a time."""

    windowed = True


def scene(part: dict[str, Any] | None, eye: dict[str, Any] | None = None) -> Any:
    """Return a camera that sees one target, and a part that is sent its detections."""
    blocks: dict[str, Any] = {
        "traffic": {"type": "traffic.scripted", "ownship": _OWNSHIP, "intruders": [_TARGET]},
        "transform": {"type": "geometry.ellipsoid"},
        "eye": eye or {"type": "optical.range_boundary", "range_km": 9, "scan_rate_hz": _RATE_HZ},
        "fusion": {"type": "fusion.pick_best"},
    }
    wires: list[Any] = ["traffic -> transform -> eye -> fusion"]
    if part is not None:
        blocks["part"] = part
        if part["type"] == "foreign.fmu":
            wires += ["eye -> part"]
        else:
            blocks["other"] = {"type": "fusion.pick_best"}
            wires += ["eye -> part -> other"]
    tables = {"duration_s": _CALLS // _RATE_HZ, "seed": 1, "wires": wires, "blocks": blocks}
    return dsa_des.load_scene(tables)


def best_s(work: Callable[[], Callable[[], Any]]) -> float:
    """Return the shortest wall time of what is prepared anew each time."""
    took = []
    for _ in range(_REPEATS):
        run = work()
        begin = time.perf_counter()
        run()
        took.append(time.perf_counter() - begin)
    return min(took)


def of_run(loaded: Any, window: int | None = None) -> float:
    """Return the wall time of a run without building and recording; programs have started."""

    def prepared() -> Callable[[], Any]:
        simulation = Simulation(loaded, window=window)
        part: Any = simulation.components.get("part")
        if hasattr(part, "start"):
            part.start()
        return simulation.run

    return best_s(prepared)


def of_host() -> float:
    """Return the wall time of all calls by a host program."""

    def prepared() -> Callable[[], Any]:
        simulator = Simulator(scene(None))
        simulator.add_plane("near")
        simulator.start()
        own, near = (-0.72, 0.05, 900.0), [(-0.72, 0.0501, 900.0)]
        level = (0.0, 0.0, 0.0)

        def run() -> None:
            for step in range(_CALLS):
                simulator.simulate(own, level, near, [level], step / _RATE_HZ)

        return run

    return best_s(prepared)


def of_mosaik() -> float:
    """Return the wall time of all steps that mosaik takes, with a simulator that flies."""
    import mosaik
    import mosaik_api_v3
    from loguru import logger

    logger.remove()
    place = {"lat_deg": -41.3, "lon_deg": 3.0, "alt_m": 900.0}

    class Hovering(mosaik_api_v3.Simulator):
        def __init__(self) -> None:
            models = {"Aircraft": {"public": True, "params": [], "attrs": [*place]}}
            super().__init__({"type": "time-based", "models": models})

        def create(self, num: int, model: Any, **params: Any) -> Any:
            return [{"eid": f"a{k}", "type": model} for k in range(num)]

        def step(self, time: int, inputs: Any, max_advance: int) -> int:
            return time + 1

        def get_data(self, outputs: Any) -> Any:
            return {eid: {**place, "lat_deg": -41.3 + 0.01 * (eid == "a1")} for eid in outputs}

    Hovering.__module__, globals()["Hovering"] = __name__, Hovering

    def prepared() -> Callable[[], Any]:
        chain = "components.foreign.mosaik_simulator:ChainOfMosaik"
        simulators: Any = {
            "flights": {"python": f"{__name__}:Hovering"}, "chain": {"python": chain}
        }  # fmt: skip
        world = mosaik.World(simulators, time_resolution=1 / _RATE_HZ, skip_greetings=True)
        flights, ours = world.start("flights"), world.start("chain", scene=scene(None))
        for one, seer in zip(
            flights.Aircraft.create(2), (ours.Ownship(), ours.Plane(name="near")), strict=True
        ):
            world.connect(one, seer, *place)
        return lambda: world.run(until=_CALLS, print_progress=False)

    return best_s(prepared)


def programs(folder: Path) -> dict[str, list[str]]:
    """Write the programs of the page, and return their commands."""
    text = _PAGE.read_text(encoding="utf-8")
    found = {}
    for language, name in (("python", "avoid.py"), ("cpp", "avoid.cpp")):
        (code, *_) = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
        (folder / name).write_text(code)
    found["in Python"] = ["python", str(folder / "avoid.py")]
    if shutil.which("g++"):
        library = next(Path(pa.get_library_dirs()[0]).glob("libarrow.so.*"))
        subprocess.run(
            ["g++", "-std=c++20", "-O2", "avoid.cpp", f"-I{pa.get_include()}", str(library),
             f"-Wl,-rpath,{library.parent}", "-o", "avoid"],
            cwd=folder, check=True,
        )  # fmt: skip
        found["in C++"] = [str(folder / "avoid")]
    return found


def main() -> None:
    """Measure every door, and print the rows of the table."""
    pin_to_one_processor()
    fmu = next(iter(sys.argv[1:]), None)
    here = __name__ if __name__ != "__main__" else "docs.make.foreign.cost_per_call"
    alone = of_run(scene(None))
    rows = {
        "Python block, in windows": of_run(scene({"type": f"{here}:ListensInWindows"})) - alone,
        "Python block, scan by scan": of_run(scene({"type": f"{here}:Listens"})) - alone,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for language, command in programs(folder).items():
            part = {"type": "foreign.process", "command": command}
            rows[f"program {language}"] = of_run(scene(part)) - alone
        dsa_des.run(scene(None), out=folder / "run")
        recorded = {"type": "sensor.recorded", "file": str(folder / "run"), "block": "eye"}
        recorded["scan_rate_hz"] = _RATE_HZ  # type: ignore[assignment]
        rows["file (`sensor.recorded`)"] = of_run(scene(None, recorded))
    if fmu is not None:
        loaded = scene({"type": "foreign.fmu", "file": fmu, "scan_rate_hz": _RATE_HZ})
        rows["FMU, in windows"] = of_run(loaded) - alone
        rows["FMU, scan by scan"] = of_run(loaded, 1) - of_run(scene(None), 1)
    rows["the scene itself, each look of a run whole"] = alone
    rows["host program, a call with all of the chain"] = of_host()
    if find_spec("mosaik") is not None:
        rows["mosaik, a step of two simulators"] = of_mosaik()
    for door, took_s in rows.items():
        say(f"| {door} | {1e6 * took_s / _CALLS:.3g} |")


if __name__ == "__main__":
    main()
