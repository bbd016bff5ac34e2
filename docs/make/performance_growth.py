"""The growth of cost: ``python -m docs.make.performance_growth DIR`` draws it.

One thing grows at a time: intruders, scan rate, simulated time, replicas. A point is the best of
three runs in a fresh process; what is drawn is CPU time of the whole run with recording, per
target-scan, and for simulated time and replicas the peak memory while writing Parquet.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from components.benchmark.measure import pin_to_one_processor
from components.benchmark.scenes import (
    CASES,
    load_case_scene,
    peak_memory_mb,
    random_phase_replicas,
    time_build_and_run,
)
from dsa_des.record.sinks import MemorySink
from dsa_des.scene.scene import Scene
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say, say_json

#: What grows, its values, and the overrides of the scene that a value stands for.
AXES: dict[str, tuple[float, ...]] = {
    "intruders": (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000),
    "scan rate, Hz": (0.5, 1, 2, 5, 10, 20, 50, 100),
    "simulated time, s": (60, 300, 1200, 4800, 19_200, 86_400),
    "replicas": (1, 3, 10, 30, 100, 300, 1000),
}
_REPEATS = 3
_ROOT = Path(__file__).parents[2]


def main(arguments: list[str] | None = None) -> int:
    """Measure all points, or one of them, and draw the figure."""
    parser = argparse.ArgumentParser(prog="python -m docs.make.performance_growth")
    parser.add_argument("folder", type=Path, help="where performance_growth.png goes")
    parser.add_argument("--point", nargs=2, metavar=("AXIS", "VALUE"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.point:
        say_json(point(options.point[0], float(options.point[1])))
        return 0
    options.folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for axis, values in AXES.items():
        for value in values:
            command = [sys.executable, "-m", "docs.make.performance_growth", str(options.folder)]
            command += ["--point", axis, str(value)]
            done = subprocess.run(command, cwd=_ROOT, capture_output=True, text=True, check=True)
            rows.append(json.loads(done.stdout))
            say(f"{axis} {value:g}: {rows[-1]['ns_per_target_scan']:.0f} ns, "
                f"{rows[-1]['peak_memory_mb']:.0f} MB")  # fmt: skip
    draw(rows, options.folder / "performance_growth.png")
    return 0


def point(axis: str, value: float) -> dict[str, Any]:
    """Measure one point in this process."""
    pin_to_one_processor()
    scene, scenes = _scenes(axis, value)
    to_disk = axis in ("simulated time, s", "replicas")
    runs = [
        time_build_and_run(scene, scenes, None if to_disk else MemorySink())
        for _ in range(_REPEATS)
    ]
    cpu_s, units = min((run_s, units) for _, run_s, units in runs)
    return {
        "axis": axis,
        "value": value,
        "cpu_s": cpu_s,
        "ns_per_target_scan": 1e9 * cpu_s / units,
        "peak_memory_mb": peak_memory_mb(),
    }


def _scenes(axis: str, value: float) -> tuple[Scene, list[Scene]]:
    cases = {case.name: case for case in CASES}
    if axis == "replicas":
        scene = load_case_scene(cases["monte_carlo"], quick=False)
        return scene, random_phase_replicas(scene, int(value)) if value > 1 else []
    rates = [f"blocks.{name}.scan_rate_hz={value:g}" for name in ("radar", "eo", "ir")]
    sets = {
        "intruders": ["duration_s=60", f"blocks.traffic.intruders={value:g}"],
        "scan rate, Hz": ["duration_s=120", *rates],
        "simulated time, s": [f"duration_s={value:g}", "blocks.traffic.intruders=4"],
    }[axis]
    return load_case_scene(cases["hundred"], quick=False, sets=tuple(sets)), []


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw cost against what grows, and memory against simulated time."""
    from matplotlib.ticker import NullFormatter, StrMethodFormatter

    from dsa_des.record.drawing import draw_to_png

    with draw_to_png(8.5, 6.0, path) as figure:
        panels = figure.subplots(2, 2)
        for panel, axis in zip(panels.flat, AXES, strict=True):
            chosen = [row for row in rows if row["axis"] == axis]
            values = [row["value"] for row in chosen]
            cost = [row["ns_per_target_scan"] for row in chosen]
            panel.loglog(values, cost, "o-", color="tab:blue", label="CPU time per target-scan")
            panel.set_xlabel(axis)
            panel.set_ylabel("ns per target-scan")
            panel.grid(True, which="major", alpha=0.3)
            if axis in ("simulated time, s", "replicas"):
                other = panel.twinx()
                memory = [row["peak_memory_mb"] for row in chosen]
                other.plot(values, memory, "s--", color="tab:red", label="peak memory")
                other.set_ylim(0, 1.6 * max(memory))
                other.set_ylabel("peak memory, MB (writing Parquet)")
                lines = [*panel.get_lines(), *other.get_lines()]
                panel.legend(lines, [line.get_label() for line in lines], loc="upper right")
            else:
                panel.legend(loc="upper right")
            panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            panel.xaxis.set_minor_formatter(NullFormatter())
            panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
            # Where the axis holds no power of ten, its other marks must say where it is.
            some = max(cost) > 10.0 * min(cost)
            panel.yaxis.set_minor_formatter(
                NullFormatter() if some else StrMethodFormatter("{x:g}")
            )
        figure.suptitle("What a run costs as one thing grows")
        figure.tight_layout()


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
