"""Time a scene whose blocks queue for one processor, in ways that are simulated differently.

``python -m components.benchmark.processors VARIANT`` prints one JSON object.
"""

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from components.benchmark.measure import pin
from components.examples import folder
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.terminal.terminal import say_json

_SENSORS = ("radar", "eo", "ir")


@dataclass(frozen=True)
class Variant:
    """First light with some of its blocks on one processor.

    Parameters
    ----------
    name, what : str
    blocks : tuple of str
        Which share it.
    more : tuple of str
        Further overrides.
    """

    name: str
    what: str
    blocks: tuple[str, ...] = ()
    more: tuple[str, ...] = ()


_SPREAD = ("processors.cpu.service_spread_s=0.002",)
_SKIP = ("processors.cpu.when_busy=skip",)
VARIANTS = (
    Variant("none", "none"),
    Variant("wait", "three sensors wait", _SENSORS),
    Variant("skip", "three sensors, `skip`", _SENSORS, _SKIP),
    Variant("skip_spread", "the same with `service_spread_s`", _SENSORS, (*_SKIP, *_SPREAD)),
    Variant("chain", "radar and fusion, a chain", ("radar", "fusion")),
    Variant("chain_spread", "the same with `service_spread_s`", ("radar", "fusion"), _SPREAD),
    Variant(
        "whole_chain",
        "sensors, fusion and tracker, all in one chain",
        (*_SENSORS, "fusion", "tracker"),
    ),
)


def measured(variant: Variant, repeats: int) -> dict[str, Any]:
    """Return how many seconds are simulated and recorded in one of CPU, without building."""
    sets = [f"blocks.{name}.processor=cpu" for name in variant.blocks]
    if sets:
        sets += ["processors.cpu.service_s=0.005", *variant.more]
    scene = load_scene(folder() / "first_light.toml", sets=sets, duration_s="120")
    rates = []
    for _ in range(2 + 2 * repeats):
        with tempfile.TemporaryDirectory() as place:
            simulation = Simulation(scene, recorder=Recorder([ParquetSink(Path(place))]))
            started = time.process_time()
            simulation.run()
            rates.append(120.0 / (time.process_time() - started))
    return {"scene": variant.name, "simulated_s_per_s": median(rates[2:] or rates)}


def main(arguments: list[str] | None = None) -> int:
    """Measure one variant and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m components.benchmark.processors")
    parser.add_argument("variant", choices=[variant.name for variant in VARIANTS])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    pin()
    (variant,) = (one for one in VARIANTS if one.name == options.variant)
    say_json(measured(variant, 0 if options.quick else options.repeats))
    return 0


if __name__ == "__main__":
    sys.exit(main())
