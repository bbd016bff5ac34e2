"""``python -m docs.make.performance_queues NAME``: what a shared processor costs, for the page."""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from components.benchmark.measure import pin_to_one_processor
from components.benchmark.scenes import CLOCKED
from components.examples import configs_folder
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.terminal.terminal import say_json

_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Variant:
    """First light with some of its blocks on one processor."""

    name: str
    what: str
    #: Which share it.
    blocks: tuple[str, ...] = ()
    #: Further overrides.
    more: tuple[str, ...] = ()


_SPREAD = ("processors.cpu.service_spread_s=0.002",)
_SKIP = ("processors.cpu.when_busy=skip",)
VARIANTS = (
    Variant("none", "none"),
    Variant("wait", "three sensors wait", CLOCKED),
    Variant("skip", "three sensors, `skip`", CLOCKED, _SKIP),
    Variant("skip_spread", "the same with `service_spread_s`", CLOCKED, (*_SKIP, *_SPREAD)),
    Variant("chain", "radar and fusion, a chain", ("radar", "fusion")),
    Variant("chain_spread", "the same with `service_spread_s`", ("radar", "fusion"), _SPREAD),
    Variant(
        "whole_chain",
        "sensors, fusion and tracker, all in one chain",
        (*CLOCKED, "fusion", "tracker"),
    ),
)


def measured(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return how many seconds are simulated and recorded in one of CPU, without building."""
    (variant,) = (variant for variant in VARIANTS if variant.name == name)
    sets = [f"blocks.{name}.processor=cpu" for name in variant.blocks]
    if sets:
        sets += ["processors.cpu.service_s=0.005", *variant.more]
    scene = load_scene(configs_folder() / "first_light.toml", sets=sets, duration_s="120")
    rates = []
    for _ in range(2 if quick else 2 + 2 * repeats):
        with tempfile.TemporaryDirectory() as place:
            simulation = Simulation(scene, recorder=Recorder([ParquetSink(Path(place))]))
            started = time.process_time()
            simulation.run()
            rates.append(120.0 / (time.process_time() - started))
    return {"scene": variant.name, "simulated_s_per_s": median(rates[2:] or rates)}


def measure_in_new_process(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return the row of one way to share a processor, measured in a process of its own."""
    command = [sys.executable, "-m", "docs.make.performance_queues", name, f"--repeats={repeats}"]
    command += ["--quick"] if quick else []
    done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def main(arguments: list[str] | None = None) -> int:
    """Measure one and print its row."""
    parser = argparse.ArgumentParser(prog="python -m docs.make.performance_queues")
    parser.add_argument("name", choices=[variant.name for variant in VARIANTS])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    pin_to_one_processor()
    say_json(measured(options.name, options.quick, options.repeats))
    return 0


if __name__ == "__main__":
    sys.exit(main())
