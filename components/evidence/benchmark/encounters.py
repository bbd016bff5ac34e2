"""Many encounters of a study, run together: how many in a second of CPU.

What a study does for each of them counts: its drawn values, its flights, the run with the columns
that metrics ask for, and for the risk ratio the metrics themselves. The scene is loaded before.
"""

from collections.abc import Callable
from typing import Any

from components.evidence.benchmark.cases import SCENES, replicas_of, scene_of
from components.evidence.benchmark.cases import chosen as chosen_cases
from components.examples import folder
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.lockstep import lock_step
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
    found = []
    for number in range(count):
        changes: dict[str, Any] = {}
        for place in range(2):
            for draw, (key, (low, high)) in enumerate(_DRAWN.items()):
                part = float(stream.uniform(place, number, draw))
                changes[f"blocks.traffic.intruders[{place}].{key}"] = low + (high - low) * part
        speed = 30.0 + 40.0 * float(stream.uniform(2, number))
        changes["blocks.traffic.ownship.speed_mps"] = speed
        found.append(Replica(number, changes))
    return found


def _runs_of(scene: Scene, wanted: dict[str, Any]) -> Callable[[int], Callable[[], object]]:
    def prepare(count: int) -> Callable[[], object]:
        replicas = other_flights(count)
        run_replicas(scene, replicas[:2], wanted=wanted)

        def do() -> None:
            found = run_replicas(scene, replicas, wanted=wanted)
            failed = [one.error for one in found if isinstance(one, Failed)]
            if failed:
                raise ValueError(failed[0])

        return do

    return prepare


def flights(count: int) -> Callable[[], object]:
    """Return what runs open-loop encounters with other flights each."""
    sets = ("blocks.radar.scan_rate_hz=1", "blocks.eo.scan_rate_hz=1", "blocks.ir.scan_rate_hz=1",
            "blocks.eo.offset_s=0.05", "blocks.ir.offset_s=0.1", _TWO)  # fmt: skip
    scene = load_scene(SCENES / "monte_carlo.toml", sets=sets, duration_s=_DURATION_S)
    wanted = {"detections": ("tick", "target", "range_m"), "tracks": ("tick", "age_s")}
    return _runs_of(scene, wanted)(count)


def loop(count: int) -> Callable[[], object]:
    """Return what runs the same in a closed loop, with alerts and a pilot."""
    path = folder() / "avoidance" / "crossing_pilot.toml"
    scene = load_scene(path, sets=(_TWO,), duration_s=_DURATION_S)
    return _runs_of(scene, {"alerts": ("tick", "level"), "manoeuvres": ("tick",)})(count)


def replicas(count: int) -> Callable[[], object]:
    """Return what runs a chunk of a study: one encounter with other phases of the clocks.

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
    """Return what runs the same replicas with every column, and the truth, recorded to memory."""
    (case,) = chosen_cases(["monte_carlo"])
    scenes = replicas_of(scene_of(case, quick=False, sets=("record.truth=true",)), count)

    def do() -> None:
        for start in range(0, count, _ALL_AT_ONCE):  # what a study would hold at a time
            part = scenes[start : start + _ALL_AT_ONCE]
            lock_step(part, recorder=Recorder([ColumnSink()])).run()

    return do


def risk(count: int) -> Callable[[], object]:
    """Return what runs a chunk of a study of a risk ratio, nominal and mitigated."""
    tables = {
        "replicas": 100_000,
        "metrics": ["risk_ratio"],
        "draws": {"blocks": {"traffic": {"encounter": {"sequence": [0, 1]}}}},
    }
    return _chunks("closed_loop_risk.toml", tables, count)


def _chunks(scene: str, tables: dict[str, Any], count: int) -> Callable[[], object]:
    """Return what runs chunks of a study, each time one of other runs."""
    study = study_of_tables(tables, read_scene_file(SCENES / scene), (), ())
    starts = iter(range(0, 100_000 - count, count))  # each time other encounters

    def do() -> None:
        start = next(starts)
        done = run_chunk(study, Chunk("part", ((0, start, start + count),)))
        if done.failed:
            raise ValueError(f"{done.failed} runs failed")

    return do
