"""What is done often, in a second: alert levels, bands, track updates, runs of encounters.

What a study does for an encounter counts: its drawn values, its flights, the run with the columns
that metrics ask for, and for the risk ratio the metrics themselves. Its scene is loaded before.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np

from components.alert_configuration.conf_file import read_conf
from components.alerting.levels import due_and_early_due_levels, violation_times_s
from components.benchmark.scenes import SCENES, load_case_scene, random_phase_replicas, select_cases
from components.benchmark.time_shares import cpu_shares_by_block
from components.benchmark.track_updates import (
    LOOKS,
    prepare_plain_updates,
    prepare_stone_soup_updates,
    prepare_tracker_updates,
)
from components.examples import configs_folder
from components.guidance.bands import guidance_of_many
from components.guidance.manoeuvre_kinds import KINDS
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Failed, run_replicas
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.chunk import run_chunk
from dsa_des.studies.study import Chunk
from dsa_des.studies.study_file import study_of_tables
from dsa_des.time.randomness import Streams

_DURATION_S = "120"
_INTRUDERS = (
    "{name='one', east_m=60, north_m=9000, up_m=30, heading_deg=180, speed_mps=60}",
    "{name='two', east_m=5000, north_m=6000, up_m=-20, heading_deg=270, speed_mps=60}",
)
_TWO = f"blocks.traffic.intruders=[{', '.join(_INTRUDERS)}]"
#: Key of each of the two intruders → lowest and highest value that is drawn.
_DRAWN = {
    "east_m": (-6000.0, 6000.0), "north_m": (2000.0, 9000.0), "heading_deg": (0.0, 360.0),
    "speed_mps": (40.0, 90.0),
}  # fmt: skip
# Replicas whose every column is held at a time.
_ALL_AT_ONCE = 128


def random_flight_replicas(count: int) -> list[Replica]:
    """Return replicas with both intruders' random parameters and the own speed drawn anew."""
    stream = Streams(1).stream("benchmark", "flights")
    result = []
    for number in range(count):
        changes: dict[str, Any] = {}
        for index in range(2):
            for draw, (key, (low, high)) in enumerate(_DRAWN.items()):
                part = float(stream.uniform(index, number, draw))
                changes[f"blocks.traffic.intruders[{index}].{key}"] = low + (high - low) * part
        speed = 30.0 + 40.0 * float(stream.uniform(2, number))
        changes["blocks.traffic.ownship.speed_mps"] = speed
        result.append(Replica(number, changes))
    return result


def _replica_run_maker(
    scene: Scene, wanted: dict[str, Any]
) -> Callable[[int], Callable[[], object]]:
    def prepare(count: int) -> Callable[[], object]:
        replicas = random_flight_replicas(count)
        run_replicas(scene, replicas[:2], wanted=wanted)

        def run_once() -> None:
            result = run_replicas(scene, replicas, wanted=wanted)
            failed = [one.error for one in result if isinstance(one, Failed)]
            if failed:
                raise ValueError(failed[0])

        return run_once

    return prepare


def prepare_open_loop_runs(count: int) -> Callable[[], object]:
    """Return a function that runs `count` open-loop encounters, each with other flights."""
    sets = ("blocks.radar.scan_rate_hz=1", "blocks.eo.scan_rate_hz=1", "blocks.ir.scan_rate_hz=1",
            "blocks.eo.offset_s=0.05", "blocks.ir.offset_s=0.1", _TWO)  # fmt: skip
    scene = load_scene(SCENES / "monte_carlo.toml", sets=sets, duration_s=_DURATION_S)
    wanted = {"detections": ("tick", "target", "range_m"), "tracks": ("tick", "age_s")}
    return _replica_run_maker(scene, wanted)(count)


def prepare_closed_loop_runs(count: int) -> Callable[[], object]:
    """Return a function that runs `count` closed-loop encounters (alerts, pilot), all different."""
    path = configs_folder() / "avoidance" / "crossing_pilot.toml"
    scene = load_scene(path, sets=(_TWO,), duration_s=_DURATION_S)
    return _replica_run_maker(scene, {"alerts": ("tick", "level"), "manoeuvres": ("tick",)})(count)


def prepare_replicas(count: int) -> Callable[[], object]:
    """Return a function that runs `count` replicas of one encounter, with random clock phases.

    Its metrics are those of first detections and of the age of information, with what they need of
    the tables `scans`, `detections` and `fused` recorded to memory.
    """
    scan_s = {"radar": 0.2, "eo": 0.05, "ir": 0.5}
    tables = {
        "replicas": 100_000,
        "metrics": ["first_detection", "age_of_information"],
        "draws": {"blocks": {n: {"offset_s": {"uniform": [0, s]}} for n, s in scan_s.items()}},
    }
    return _prepare_chunks("monte_carlo.toml", tables, count)


def prepare_fully_recorded_replicas(count: int) -> Callable[[], object]:
    """Return a function that runs `count` replicas, recording all columns and truth to memory."""
    (case,) = select_cases(["monte_carlo"])
    scenes = random_phase_replicas(
        load_case_scene(case, quick=False, sets=("record.truth=true",)), count
    )

    def run_once() -> None:
        for start in range(0, count, _ALL_AT_ONCE):  # what a study would hold at a time
            part = scenes[start : start + _ALL_AT_ONCE]
            make_lockstep_simulation(part, recorder=Recorder([ColumnSink()])).run()

    return run_once


def prepare_risk_runs(count: int) -> Callable[[], object]:
    """Return a function to run a chunk, one encounter per replica, without and with avoidance."""
    tables = {
        "replicas": 100_000,
        "metrics": ["risk_ratio"],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }
    return _prepare_chunks("closed_loop_risk.toml", tables, count)


def prepare_tracked_risk_runs(count: int) -> Callable[[], object]:
    """Return a function to run a chunk of `radar_and_camera_risk`, whose avoidance uses tracks."""
    volume = {"horizontal_m": 670.56, "vertical_m": 137.16, "by": [], "needless": True}
    tables = {
        "replicas": 100_000,
        "metrics": [{"metric": "risk_ratio", **volume}],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }
    return _prepare_chunks("../avoidance/radar_and_camera.toml", tables, count)


def _prepare_chunks(scene: str, tables: dict[str, Any], count: int) -> Callable[[], object]:
    """Return a function that at each call runs the next chunk of `count` replicas of a study."""
    study = study_of_tables(tables, read_scene_file(SCENES / scene), (), ())
    starts = iter(range(0, 100_000 - count, count))  # each time other encounters

    def run_once() -> None:
        start = next(starts)
        done = run_chunk(study, Chunk("part", ((0, start, start + count),)))
        if done.failed:
            raise ValueError(f"{done.failed} runs failed")

    return run_once


@dataclass(frozen=True)
class Rate:
    """A benchmark of something done many times: how often it is done per second of CPU time."""

    name: str
    what: str
    #: At least so many in a second of CPU.
    wanted: float
    #: How many at once.
    count: int
    #: From the count to what does them.
    prepare: Callable[[int], Callable[[], object]]
    #: mapping, optional: By name what does the same work otherwise: from whether it has to be quick
    #: to how many are done and what does them, or to None where it is not installed.
    beside: Mapping[str, Callable[[bool], tuple[int, Callable[[], object]] | None]] = field(
        default_factory=dict
    )
    #: How many at once for ``--quick``; 0 for a tenth.
    quick: int = 0
    #: Whether the shares of its blocks are measured too.
    by_block: bool = False


def random_pair_states(
    count: int, within_m: float, apart_m: float, seed: int
) -> tuple[State, State]:
    """Return `count` ownships at horizontal 0, intruders within `within_m`, random velocities."""
    random = np.random.default_rng(seed)

    def flown(position: list[Any]) -> State:
        track, speed = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(25.0, 130.0, count)
        climb = random.normal(0.0, 3.0, count)
        east_mps, north_mps = speed * np.sin(track), speed * np.cos(track)
        return State(position[0], position[1], position[2], east_mps, north_mps, climb)

    up, zero = random.uniform(500.0, 3000.0, count), np.zeros(count)
    east, north = random.uniform(-within_m, within_m, (2, count))
    return flown([zero, zero, up]), flown([east, north, up + random.normal(0.0, apart_m, count)])


def _prepare_levels(count: int) -> Callable[[], object]:
    configuration = read_conf(configs_folder() / "alerting" / "do365b.conf")
    levels, lookahead_s = configuration.alerters[0].levels, configuration["lookahead_time"]
    own, intruder = random_pair_states(count, 10_000.0, 200.0, 1)
    relative = own.relative_to(intruder)
    return lambda: due_and_early_due_levels(
        levels, violation_times_s(levels, relative, lookahead_s, None)
    )


def _prepare_bands(count: int) -> Callable[[], object]:
    configuration = read_conf(configs_folder() / "alerting" / "do365b.conf")
    own, intruder = random_pair_states(count, 6_000.0, 150.0, 2)
    level = np.zeros(count, dtype=np.int64)
    intruders = [GuidedIntruders(intruder, configuration.alerters[0], level)]
    return lambda: [guidance_of_many(kind, configuration, own, intruders) for kind in KINDS]


def _prepare_tracks_in_lock_step(count: int) -> Callable[[], object]:
    return prepare_tracker_updates(count // (4 * LOOKS), 4)


def _prepare_tracks_of_one_run(count: int) -> Callable[[], object]:
    return prepare_tracker_updates(1, count // LOOKS)


RATES = (
    Rate(
        "pair_alerts",
        "levels of pairs of aircraft, three volumes each",
        1e6,
        200_000,
        _prepare_levels,
    ),
    Rate(
        "bands",
        "states of an ownship and an intruder, four kinds of bands",
        1e3,
        1000,
        _prepare_bands,
    ),
    Rate(
        "track_updates",
        "updates of tracks, EKF and global nearest neighbour, 4 targets and three "
        "sensors in 1000 replicas in lock step",
        5e5,
        4000 * LOOKS,
        _prepare_tracks_in_lock_step,
        {
            "a plain loop": lambda quick: prepare_plain_updates(4),
            "Stone Soup": lambda quick: prepare_stone_soup_updates(4),
        },
    ),
    Rate(
        "track_updates_alone",
        "the same of 100 targets in a single run",
        2e4,
        100 * LOOKS,
        _prepare_tracks_of_one_run,
        {"a plain loop": lambda quick: prepare_plain_updates(10 if quick else 100)},
    ),
    Rate(
        "replicas",
        "runs of 120 s, an intruder, 5, 20 and 2 Hz, other phases, first detections and ages",
        1000,
        500,
        prepare_replicas,
    ),
    Rate(
        "replicas_all",
        "the same, every column and the truth recorded to memory",
        1000,
        500,
        prepare_fully_recorded_replicas,
    ),
    Rate(
        "flights",
        "encounters of 120 s with other flights, two intruders, three sensors at 1 Hz, open loop",
        1000,
        1000,
        prepare_open_loop_runs,
    ),
    Rate(
        "loop",
        "the same in a closed loop of tracker, alerting and pilot, lookahead 0.5 s",
        333,
        1000,
        prepare_closed_loop_runs,
    ),
    Rate(
        "risk",
        "encounters of 180 s of a model, radar, tracker and alerting, nominal and mitigated",
        167,
        512,
        prepare_risk_runs,
    ),
    Rate(
        "risk_tracked",
        "the same with radar and camera of stated errors, EKF, DO-365 alerting and a pilot",
        200,
        4000,
        prepare_tracked_risk_runs,
        quick=64,
        by_block=True,
    ),
)


def measure_rate(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return a row of runs or updates per second of CPU time, the median of some repetitions."""
    (rate,) = (rate for rate in RATES if rate.name == name)
    count = (rate.quick or rate.count // 10) if quick else rate.count
    beside = {}
    for name, prepare in rate.beside.items():
        other = prepare(quick)
        if other is not None:
            beside[name] = _count_per_cpu_s(*other, 1 if quick else min(repeats, 2))
    run_once = rate.prepare(count)
    per_s = _count_per_cpu_s(count, run_once, repeats)
    shares = cpu_shares_by_block(run_once) if rate.by_block else {}
    return {
        "scene": rate.name, "per_s": per_s, "wanted": rate.wanted, "beside": beside,
        "shares": shares,
    }  # fmt: skip


def _count_per_cpu_s(count: int, run_once: Callable[[], object], repeats: int) -> float:
    run_once()
    result = []
    for _ in range(repeats):
        started = time.process_time()
        run_once()
        result.append(count / (time.process_time() - started))
    return median(result)
