"""The benchmark's scenes, and the time of one, engine and yardstick in turn."""

import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import Any

from components.benchmark import yardstick
from components.examples import configs_folder
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink, Sink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.time.randomness import Streams

SCENES = configs_folder() / "benchmark"
CLOCKED = ("eo", "ir", "radar")


@dataclass(frozen=True)
class BenchmarkCase:
    """One line of the benchmark."""

    #: Also the scene's file name in ``configs/benchmark``.
    name: str
    #: Said in the table.
    what: str
    #: The ratio to the yardstick that we want to reach.
    wanted: float
    #: The yardstick takes every so many instants (of a replica, for replicas).
    every: int = 1
    #: 0 for a single run.
    replicas: int = 0
    #: Overrides for ``--quick``.
    quick: tuple[str, ...] = ()
    quick_replicas: int = 0


CASES = (
    BenchmarkCase("thesis", "4 intruders, 3 sensors at 1 Hz, 1800 s", 3.0),
    BenchmarkCase("clocks", "4 intruders, 5, 20 and 2 Hz, 600 s", 2.5, every=3),
    BenchmarkCase("hundred", "100 intruders, 3 sensors at 1 Hz, 1800 s", 14.0, every=6),
    BenchmarkCase(
        "ten_thousand",
        "10,000 intruders, 3 sensors at 1 Hz, 180 s",
        20.0,
        every=30,
        quick=("duration_s=30",),
    ),
    BenchmarkCase(
        "sparse",
        "10,000 intruders, 97 % never in reach, 180 s",
        100.0,
        every=30,
        quick=("duration_s=60",),
    ),
    BenchmarkCase(
        "manoeuvres", "100 intruders, the ownship turns away every 60 s, 1800 s", 5.0, every=6
    ),
    BenchmarkCase(
        "monte_carlo",
        "1000 replicas of 120 s, 1 intruder, 5, 20 and 2 Hz",
        10.0,
        every=1,
        replicas=1000,
        quick_replicas=100,
    ),
)


def select_cases(names: Sequence[str]) -> list[BenchmarkCase]:
    """Return the cases of these names, all for none."""
    known = {case.name: case for case in CASES}
    for name in names:
        if name not in known:
            raise UsageError(f"there is no benchmark scene {name!r}{did_you_mean(name, known)}")
    return [known[name] for name in names] if names else list(CASES)


def load_case_scene(
    case: BenchmarkCase, *, quick: bool, duration_s: str | None = None, sets: tuple[str, ...] = ()
) -> Scene:
    """Return a benchmark case's loaded scene, shortened if `quick`, with the changes in `sets`."""
    sets = (*case.quick, *sets) if quick else sets
    return load_scene(SCENES / f"{case.name}.toml", sets=sets, duration_s=duration_s)


def random_phase_replicas(scene: Scene, count: int) -> list[Scene]:
    """Return copies of a scene with other seeds and random phases of the three sensors' clocks."""
    stream = Streams(scene.seed).stream("benchmark", "phase")
    result = []
    for number in range(count):
        blocks = dict(scene.blocks)
        for index, name in enumerate(CLOCKED):
            block = blocks[name]
            draw = float(stream.uniform(0, number, index))
            period_ns = int(10**9 / block.parameters.scan_rate_hz)  # type: ignore[attr-defined]
            offset_s = Fraction(int(draw * period_ns), 10**9)
            parameters = block.parameters.model_copy(update={"offset_s": offset_s})
            blocks[name] = replace(block, parameters=parameters)
        result.append(replace(scene, seed=scene.seed + 1 + number, blocks=blocks))
    return result


# The yardstick samples this many replicas of many.
_SAMPLED_REPLICAS = 5


def measure_scene(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return a scene's result row: medians over interleaved repetitions, first peak memory.

    What a user waits for is building and running: targets that are never in reach are found when a
    run is built. Their sum is what the ratio to the yardstick is made of.
    """
    (case,) = select_cases([name])
    scene = load_case_scene(case, quick=quick)
    replicas = case.quick_replicas if quick else case.replicas
    scenes = random_phase_replicas(scene, replicas) if replicas else []
    built, engine, plain = [], [], []
    units = 0
    time_build_and_run(scene, scenes, MemorySink())
    memory_mb = peak_memory_mb()  # before anything but the engine has run
    yardstick_run = _prepare_plain_loop_timing(case, scene, scenes)
    for _ in range(repeats):
        build_s, run_s, units = time_build_and_run(scene, scenes, MemorySink())
        built.append(build_s)
        engine.append(run_s)
        plain.append(yardstick_run())
    # Afterwards, as Arrow's memory slows what comes after it; its first file loads libraries.
    parquet = [time_build_and_run(scene, scenes, None)[1] for _ in range(repeats + 1)][1:]
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


def _cpu_seconds_of(run: Callable[[], Any]) -> float:
    started = time.process_time()
    run()
    return time.process_time() - started


def time_build_and_run(
    scene: Scene, scenes: list[Scene], sink: Sink | None
) -> tuple[float, float, int]:
    """Build and run a scene once; return CPU seconds of building, of running, scans times targets.

    Without replicas in `scenes` a single run of `scene`; without a sink into Parquet in passing.
    """
    if sink is None:
        from dsa_des.record.arrow import ParquetSink

        with tempfile.TemporaryDirectory() as folder:
            return time_build_and_run(scene, scenes, ParquetSink(Path(folder)))
    recorder = Recorder([sink])
    started = time.process_time()
    simulation = (
        make_lockstep_simulation(scenes, recorder=recorder)
        if scenes
        else Simulation(scene, recorder=recorder)
    )
    build_s = time.process_time() - started
    cpu_s = _cpu_seconds_of(simulation.run)
    scans = _count_scans(simulation)
    traffic: Any = simulation.components["traffic"]
    return build_s, cpu_s, scans * len(getattr(traffic, "face", traffic).roster)


def _count_scans(simulation: Simulation) -> int:
    """Return the number of scans of all sensors and replicas, counted by replica to save memory."""
    clocks = [node.clock for node in simulation.nodes.values() if node.clock is not None]
    result = 0
    for run in range(simulation.runs.count):
        simulation.runs.going = range(run, run + 1)
        result += sum(len(clock.scans_between(0, simulation.end_tick)[0]) for clock in clocks)
    return result


def _prepare_plain_loop_timing(
    case: BenchmarkCase, scene: Scene, scenes: list[Scene]
) -> Callable[[], float]:
    """Return a function that times the plain loop on the same flights, CPU s per target-scan."""
    step = max(1, len(scenes) // _SAMPLED_REPLICAS)
    prepared = [
        yardstick.prepare_plain_loop(_fly_if_steered(one)) for one in (scenes[::step] or [scene])
    ]

    def seconds_per_unit() -> float:
        started = time.process_time()
        units = sum(yardstick.run(one, case.every).target_scans for one in prepared)
        return (time.process_time() - started) / max(1, units)

    return seconds_per_unit


def _fly_if_steered(scene: Scene) -> Simulation:
    """Return the scene's simulation, already run if its ownship is steered, to know its path."""
    simulation = Simulation(scene)
    if len(getattr(simulation.components["traffic"].own, "segments", ())) != 1:  # type: ignore[attr-defined]
        simulation.run()
    return simulation


def peak_memory_mb() -> float:
    """Return the largest memory that this process has had, MB."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux counts in ru_maxrss what the process had before it was this program
        kept = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
        return float(kept["VmHWM"].split()[0]) / 1024.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)
