"""Time one benchmark scene, the engine and the yardstick in turn, in this process.

``python -m components.evidence.benchmark.measure SCENE ...`` prints one JSON object; the command
starts it anew for every scene, so that peak memory is that scene's own and nothing is warm from
another.
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

from components.evidence.benchmark import yardstick
from components.evidence.benchmark.cases import BenchmarkCase, chosen, replicas_of, scene_of
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink, Sink
from dsa_des.replicas.lockstep import lock_step
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.terminal.terminal import say_json

# The yardstick samples this many replicas of many.
_SAMPLED_REPLICAS = 5


def main(arguments: list[str] | None = None) -> int:
    """Measure one scene and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m components.evidence.benchmark.measure")
    parser.add_argument("scene")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    pin()
    (case,) = chosen([options.scene])
    scene = scene_of(case, quick=options.quick)
    scenes = replicas_of(scene, _replicas(case, options.quick)) if case.replicas else []
    say_json(measured(case, scene, scenes, options.repeats))
    return 0


def measured(
    case: BenchmarkCase, scene: Scene, scenes: list[Scene], repeats: int
) -> dict[str, Any]:
    """Return medians over interleaved repetitions, and the peak memory of a first run.

    What a user waits for is building and running: targets that are never in reach are found when a
    run is built. Their sum is what the ratio to the yardstick is made of.
    """
    built, engine, plain = [], [], []
    units = 0
    engine_run(scene, scenes, MemorySink())
    memory_mb = peak_mb()  # before anything but the engine has run
    yardstick_run = _yardstick(case, scene, scenes)
    for _ in range(repeats):
        build_s, run_s, units = engine_run(scene, scenes, MemorySink())
        built.append(build_s)
        engine.append(run_s)
        plain.append(yardstick_run())
    # Afterwards, as Arrow's memory slows what comes after it; its first file loads libraries.
    parquet = [engine_run(scene, scenes, None)[1] for _ in range(repeats + 1)][1:]
    whole = [build_s + run_s for build_s, run_s in zip(built, engine, strict=True)]
    seconds_per_unit = median(plain)
    simulated_s = float(Simulation(scene).duration_s) * max(1, len(scenes))
    return {
        "scene": case.name,
        "target_scans": units,
        "target_scans_per_s": units / median(whole),
        "ratio_to_yardstick": median(
            per_unit * units / own for own, per_unit in zip(whole, plain, strict=True)
        ),
        "yardstick_target_scans_per_s": 1.0 / seconds_per_unit,
        "cpu_s": median(engine),
        "cpu_s_min": min(engine),
        "cpu_s_max": max(engine),
        "build_s": median(built),
        "peak_memory_mb": memory_mb,
        "cpu_ms_per_simulated_s": 1000.0 * median(engine) / simulated_s,
        "parquet_adds": median(parquet) / median(engine) - 1.0,
    }


def pin() -> None:
    """Keep this process on one processor, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def _replicas(case: BenchmarkCase, quick: bool) -> int:
    return case.quick_replicas if quick else case.replicas


def _timed(run: Callable[[], Any]) -> float:
    started = time.process_time()
    run()
    return time.process_time() - started


def engine_run(scene: Scene, scenes: list[Scene], sink: Sink | None) -> tuple[float, float, int]:
    """Return the CPU times of building a run and of all of it with recording, and its target-scans.

    Parameters
    ----------
    scene : Scene
    scenes : list of Scene
        Replicas to run in lock step; none for a single run of `scene`.
    sink : Sink or None
        What takes the rows; None writes Parquet into a folder that is then removed.
    """
    if sink is None:
        from dsa_des.record.arrow import ParquetSink

        with tempfile.TemporaryDirectory() as folder:
            return engine_run(scene, scenes, ParquetSink(Path(folder)))
    recorder = Recorder([sink])
    started = time.process_time()
    simulation = (
        lock_step(scenes, recorder=recorder) if scenes else Simulation(scene, recorder=recorder)
    )
    build_s = time.process_time() - started
    cpu_s = _timed(simulation.run)
    scans = _scans(simulation)
    traffic: Any = simulation.components["traffic"]
    return build_s, cpu_s, scans * len(getattr(traffic, "face", traffic).roster)


def _scans(simulation: Simulation) -> int:
    """Count the scans of all sensors, one replica at a time so that it takes no memory."""
    time_of = simulation.time
    starts = [r * time_of.span_ticks for r in range(time_of.replicas)]
    clocks = [node.clock for node in simulation.nodes.values() if node.clock is not None]
    return sum(len(clock.between(s, s + time_of.run_ticks)[0]) for clock in clocks for s in starts)


def _yardstick(case: BenchmarkCase, scene: Scene, scenes: list[Scene]) -> Callable[[], float]:
    """Prepare the yardstick; return what runs it and gives its seconds per target-scan."""
    step = max(1, len(scenes) // _SAMPLED_REPLICAS)
    prepared = [yardstick.prepare(_flown(one)) for one in (scenes[::step] or [scene])]

    def seconds_per_unit() -> float:
        started = time.process_time()
        units = sum(yardstick.run(one, case.every).target_scans for one in prepared)
        return (time.process_time() - started) / max(1, units)

    return seconds_per_unit


def _flown(scene: Scene) -> Simulation:
    """Return a simulation to read the scene from; a steered ownship must have been flown."""
    simulation = Simulation(scene)
    if len(getattr(simulation.components["traffic"].own, "segments", ())) != 1:  # type: ignore[attr-defined]
        simulation.run()
    return simulation


def peak_mb() -> float:
    """Return the largest memory that this process has had, MB."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux counts in ru_maxrss what the process had before it was this program
        kept = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        return float(kept["VmHWM"].split()[0]) / 1024.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


if __name__ == "__main__":
    sys.exit(main())
