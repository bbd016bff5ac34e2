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
from components.alerting.levels import due_levels, violation_times_s
from components.benchmark.scenes import SCENES, replicas_of, scene_of, select_cases
from components.benchmark.time_shares import shares_by_block
from components.benchmark.track_updates import LOOKS, plain_updates, stone_soup_updates, updates
from components.examples import folder
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


def other_flights(count: int) -> list[Replica]:
    """Return replicas in which both intruders and the ownship fly otherwise."""
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


def _runs_of(scene: Scene, wanted: dict[str, Any]) -> Callable[[int], Callable[[], object]]:
    def prepare(count: int) -> Callable[[], object]:
        replicas = other_flights(count)
        run_replicas(scene, replicas[:2], wanted=wanted)

        def run_once() -> None:
            result = run_replicas(scene, replicas, wanted=wanted)
            failed = [one.error for one in result if isinstance(one, Failed)]
            if failed:
                raise ValueError(failed[0])

        return run_once

    return prepare


def flights(count: int) -> Callable[[], object]:
    """Return a function that runs open-loop encounters, each with other flights."""
    sets = ("blocks.radar.scan_rate_hz=1", "blocks.eo.scan_rate_hz=1", "blocks.ir.scan_rate_hz=1",
            "blocks.eo.offset_s=0.05", "blocks.ir.offset_s=0.1", _TWO)  # fmt: skip
    scene = load_scene(SCENES / "monte_carlo.toml", sets=sets, duration_s=_DURATION_S)
    wanted = {"detections": ("tick", "target", "range_m"), "tracks": ("tick", "age_s")}
    return _runs_of(scene, wanted)(count)


def loop(count: int) -> Callable[[], object]:
    """Return a function that runs such encounters in a closed loop, with alerts and a pilot."""
    path = folder() / "avoidance" / "crossing_pilot.toml"
    scene = load_scene(path, sets=(_TWO,), duration_s=_DURATION_S)
    return _runs_of(scene, {"alerts": ("tick", "level"), "manoeuvres": ("tick",)})(count)


def replicas(count: int) -> Callable[[], object]:
    """Return a function that runs a chunk of a study: one encounter, other clock phases.

    Its metrics are those of first detections and of the age of information, with what they need of
    the tables `scans`, `detections` and `fused` recorded to memory.
    """
    scan_s = {"radar": 0.2, "eo": 0.05, "ir": 0.5}
    tables = {
        "replicas": 100_000,
        "metrics": ["first_detection", "age_of_information"],
        "draws": {"blocks": {n: {"offset_s": {"uniform": [0, s]}} for n, s in scan_s.items()}},
    }
    return _chunks("monte_carlo.toml", tables, count)


def replicas_all(count: int) -> Callable[[], object]:
    """Return a function that runs the replicas with all columns and the truth recorded."""
    (case,) = select_cases(["monte_carlo"])
    scenes = replicas_of(scene_of(case, quick=False, sets=("record.truth=true",)), count)

    def run_once() -> None:
        for start in range(0, count, _ALL_AT_ONCE):  # what a study would hold at a time
            part = scenes[start : start + _ALL_AT_ONCE]
            make_lockstep_simulation(part, recorder=Recorder([ColumnSink()])).run()

    return run_once


def risk(count: int) -> Callable[[], object]:
    """Return a function that runs a chunk of a risk-ratio study, nominal and mitigated."""
    tables = {
        "replicas": 100_000,
        "metrics": ["risk_ratio"],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }
    return _chunks("closed_loop_risk.toml", tables, count)


def risk_tracked(count: int) -> Callable[[], object]:
    """Return a function that runs a chunk of the shipped study `radar_and_camera_risk`."""
    volume = {"horizontal_m": 670.56, "vertical_m": 137.16, "by": [], "needless": True}
    tables = {
        "replicas": 100_000,
        "metrics": [{"metric": "risk_ratio", **volume}],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }
    return _chunks("../avoidance/radar_and_camera.toml", tables, count)


def _chunks(scene: str, tables: dict[str, Any], count: int) -> Callable[[], object]:
    """Return a function that runs another chunk of a study at each call."""
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
    """Something done many times."""

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


def states(count: int, within_m: float, apart_m: float, seed: int) -> tuple[State, State]:
    """Return ownships at the origin, and an intruder of each, in flight in all directions."""
    random = np.random.default_rng(seed)

    def flown(position: list[Any]) -> State:
        track, speed = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(25.0, 130.0, count)
        climb = random.normal(0.0, 3.0, count)
        east_mps, north_mps = speed * np.sin(track), speed * np.cos(track)
        return State(position[0], position[1], position[2], east_mps, north_mps, climb)

    up, zero = random.uniform(500.0, 3000.0, count), np.zeros(count)
    east, north = random.uniform(-within_m, within_m, (2, count))
    return flown([zero, zero, up]), flown([east, north, up + random.normal(0.0, apart_m, count)])


def _levels(count: int) -> Callable[[], object]:
    configuration = read_conf(folder() / "alerting" / "do365b.conf")
    levels, lookahead_s = configuration.alerters[0].levels, configuration["lookahead_time"]
    own, intruder = states(count, 10_000.0, 200.0, 1)
    relative = own.relative_to(intruder)
    return lambda: due_levels(levels, violation_times_s(levels, relative, lookahead_s, None))


def _bands(count: int) -> Callable[[], object]:
    configuration = read_conf(folder() / "alerting" / "do365b.conf")
    own, intruder = states(count, 6_000.0, 150.0, 2)
    level = np.zeros(count, dtype=np.int64)
    intruders = [GuidedIntruders(intruder, configuration.alerters[0], level)]
    return lambda: [guidance_of_many(kind, configuration, own, intruders) for kind in KINDS]


def _tracks_in_lock_step(count: int) -> Callable[[], object]:
    return updates(count // (4 * LOOKS), 4)


def _tracks_of_one_run(count: int) -> Callable[[], object]:
    return updates(1, count // LOOKS)


RATES = (
    Rate("pair_alerts", "levels of pairs of aircraft, three volumes each", 1e6, 200_000, _levels),
    Rate("bands", "states of an ownship and an intruder, four kinds of bands", 1e3, 1000, _bands),
    Rate(
        "track_updates",
        "updates of tracks, EKF and global nearest neighbour, 4 targets and three "
        "sensors in 1000 replicas in lock step",
        5e5,
        4000 * LOOKS,
        _tracks_in_lock_step,
        {
            "a plain loop": lambda quick: plain_updates(4),
            "Stone Soup": lambda quick: stone_soup_updates(4),
        },
    ),
    Rate(
        "track_updates_alone",
        "the same of 100 targets in a single run",
        2e4,
        100 * LOOKS,
        _tracks_of_one_run,
        {"a plain loop": lambda quick: plain_updates(10 if quick else 100)},
    ),
    Rate(
        "replicas",
        "runs of 120 s, an intruder, 5, 20 and 2 Hz, other phases, first detections and ages",
        1000,
        500,
        replicas,
    ),
    Rate(
        "replicas_all",
        "the same, every column and the truth recorded to memory",
        1000,
        500,
        replicas_all,
    ),
    Rate(
        "flights",
        "encounters of 120 s with other flights, two intruders, three sensors at 1 Hz, open loop",
        1000,
        1000,
        flights,
    ),
    Rate(
        "loop",
        "the same in a closed loop of tracker, alerting and pilot, lookahead 0.5 s",
        333,
        1000,
        loop,
    ),
    Rate(
        "risk",
        "encounters of 180 s of a model, radar, tracker and alerting, nominal and mitigated",
        167,
        512,
        risk,
    ),
    Rate(
        "risk_tracked",
        "the same with radar and camera of stated errors, EKF, DO-365 alerting and a pilot",
        200,
        4000,
        risk_tracked,
        quick=64,
        by_block=True,
    ),
)


def measure_rate(name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return how many are done in a second of CPU, the median of some repetitions."""
    (rate,) = (rate for rate in RATES if rate.name == name)
    count = (rate.quick or rate.count // 10) if quick else rate.count
    beside = {}
    for name, prepare in rate.beside.items():
        other = prepare(quick)
        if other is not None:
            beside[name] = _per_s(*other, 1 if quick else min(repeats, 2))
    run_once = rate.prepare(count)
    per_s = _per_s(count, run_once, repeats)
    shares = shares_by_block(run_once) if rate.by_block else {}
    return {
        "scene": rate.name, "per_s": per_s, "wanted": rate.wanted, "beside": beside,
        "shares": shares,
    }  # fmt: skip


def _per_s(count: int, run_once: Callable[[], object], repeats: int) -> float:
    run_once()
    result = []
    for _ in range(repeats):
        started = time.process_time()
        run_once()
        result.append(count / (time.process_time() - started))
    return median(result)
