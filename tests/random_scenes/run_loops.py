"""Run hundreds of random closed loops: ``python tests/random_scenes/run_loops.py --count 300``.

Replicas of each go side by side in lock step, and each by itself; all that is recorded must be the
same to the bit. The exit code is 1 if anything differs, or if replicas that could go side by side
do not.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from comparisons import difference, plain
from dice import Dice
from random_loops import loop_of, loop_replicas

from dsa_des.errors import SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Recorded, run_replicas
from dsa_des.scene.scene import load_scene

_ROOT = Path(__file__).resolve().parents[2]


def judged(seed: int, folder: Path) -> tuple[str, set[str]]:
    """Return in what the replicas of a random loop differ, or nothing, and what it has."""
    dice = Dice(seed)
    path = folder / f"{seed}.toml"
    path.write_text(to_toml(loop_of(dice, str(_ROOT))), encoding="utf-8")
    scene, replicas = load_scene(path), loop_replicas(dice)
    scenes = [replica_scene(scene, one) for one in replicas]
    sink = ColumnSink()
    together = make_lockstep_simulation(
        scenes, recorder=Recorder([sink]), window=dice.pick(None, None, 5, 40)
    )
    together.run()
    assert len(together.runs.going) > 1
    tables = plain(sink.tables())
    features = dice.features | {f"split {name}" for name in together.timeline.split}
    if len(tables["manoeuvres"]["tick"]):
        features.add("manoeuvres")
    for number, one in enumerate(replicas):
        (alone,) = run_replicas(scene, [one], runs=len(replicas))
        assert isinstance(alone, Recorded)
        part = {
            table: {
                name: values[columns["replica"] == number]
                for name, values in columns.items()
                if name != "replica"
            }
            for table, columns in tables.items()
        }
        if found := difference(plain(alone.tables), part):
            return f"replica {number} {dict(one.changes)}: {found}", features
    return "", features


def main() -> None:
    """Judge as many loops as asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, help="how many scenes [300]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first [1]")
    options = parser.parse_args()
    kinds: Counter[str] = Counter()
    features: Counter[str] = Counter()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="random-loop-") as folder:
        for seed in range(options.seed, options.seed + options.count):
            try:
                found, has = judged(seed, Path(folder))
            except (SceneError, RuntimeError, AssertionError) as error:
                found, has = f"{type(error).__name__}: {error}", set()
            features.update(has)
            kinds["different" if found else "same"] += 1
            if found:
                print(f"{seed}: {found}", flush=True)
    for feature, count in sorted(features.items()):
        print(f"  {count:6} {feature}")
    total = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    print(f"{options.count} loops in {time.monotonic() - started:.0f} s: {total}")
    sys.exit(0 if set(kinds) <= {"same"} else 1)


if __name__ == "__main__":
    main()
