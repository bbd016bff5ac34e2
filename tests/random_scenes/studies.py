"""The same study with one worker and with two, the same scene under other hash seeds."""

import os
import subprocess
import sys
from pathlib import Path

import random_changes
from dice import Dice
from random_scene import Case

from dsa_des.files.toml_files import to_toml
from tests import warm_process

_MAIN = "from dsa_des.cli import main; main()"
_HERE = Path(__file__).resolve().parent
_METRICS = ("detection_share", "age_of_information", "track_updates", "first_detection")


def hash_seeds_differ(scenes: list[Path], limit_s: float) -> str:
    """Return the scenes whose recordings depend on Python's hash seed, or nothing."""
    found = {}
    for seed in ("0", "1", "4242"):
        done = _python([str(_HERE / "comparisons.py"), *map(str, scenes)], limit_s, seed)
        if done.returncode:
            return f"PYTHONHASHSEED={seed}: {done.stderr.strip()[-300:]}"
        found[seed] = done.stdout.split()
    different = [
        scene.name
        for scene, *digests in zip(scenes, *found.values(), strict=True)
        if len(set(digests)) > 1
    ]
    return f"hash seeds give other bytes: {', '.join(different)}" if different else ""


def write_study(case: Case, folder: Path, dice: Dice) -> Path:
    """Write a study of a scene that draws some of its parameters, and return its path."""
    keys = random_changes.keys_of(case.tables)
    plain = {
        key: [value for value in values if not isinstance(value, list)]
        for key, values in keys.items()
    }
    drawn = dice.sample(sorted(key for key, values in plain.items() if values), 2)
    tables = {
        "scene": str(case.write(folder)),
        "replicas": dice.pick(5, 9),
        "runs_per_chunk": dice.pick(1, 2, 3),
        "seed": dice.randrange(100),
        "metrics": [dice.choice(_METRICS)],
        "draws": {key: {"choice": plain[key]} for key in drawn},
    }
    path = folder / "study.toml"
    path.write_text(to_toml(tables), encoding="utf-8")
    return path


def workers_differ(study: Path, limit_s: float) -> str:
    """Return what differs between the folders of one and of two workers, or nothing.

    A study that is refused must be refused by both.
    """
    folders = []
    codes = []
    for workers in ("1", "2"):
        folder = study.with_name(f"workers-{workers}")
        arguments = ["study", str(study), "--out", str(folder), "--workers", workers, "--quiet"]
        done = warm_process.run(["-c", _MAIN, *arguments], timeout=limit_s)
        if "Traceback" in done.stderr:
            return f"{workers} workers: {done.stderr.strip()[-300:]}"
        codes.append(done.returncode)
        folders.append(folder)
    if codes[0] != codes[1]:
        return f"exit codes {codes}"
    if codes[0] == 2:
        return "refused"
    tables = [
        {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.parquet")}
        for folder in folders
    ]
    if not tables[0] or tables[0].keys() != tables[1].keys():
        return f"files {[sorted(found) for found in tables]}"
    unequal = [name for name, content in tables[0].items() if content != tables[1][name]]
    return (
        f"{', '.join(sorted(unequal))}: other bytes with 2 workers than with 1" if unequal else ""
    )


def _python(
    arguments: list[str], limit_s: float, hash_seed: str = "0"
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        timeout=limit_s,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        check=False,
    )
