"""Digests of all that shipped scenes and studies record, to compare two states of the code.

    python tests/shipped_digests.py AFTER.json [BEFORE.json] [--only TEXT]

They go to AFTER.json and, with BEFORE.json, are compared: exit code 1 if any differ. Scenes run
for at most 40 s of theirs and studies with two runs a point, through the command line of this
environment. A table is kept by column, so that a column that moved is told apart from one whose
values changed. `--only` takes the files whose path holds a text.
"""

import hashlib
import io
import json
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv

import dsa_des

CONFIGS = Path(__file__).parents[1] / "configs"
LONGEST_S = 40.0


def command(path: Path, out: Path) -> list[str]:
    """Return how a file is run, in short form; nothing where it is neither scene nor study."""
    start = [sys.executable, "-m", "dsa_des"]
    end = [str(path), "--out", str(out), "--quiet"]
    if path.parent.name == "studies":
        return [*start, "study", *end, "--workers", "1", "--set", "replicas=2"]
    if not {"blocks", "extends"} & tomllib.loads(path.read_text(encoding="utf-8")).keys():
        return []
    try:
        duration_s = dsa_des.load_scene(path).duration_s
    except dsa_des.SceneError:
        return []
    short = duration_s is not None and duration_s > LONGEST_S
    return [*start, "run", *end, "--no-figures",
            *(["--set", f"duration_s={LONGEST_S}"] if short else [])]  # fmt: skip


def digests(folder: Path) -> dict[str, str]:
    """Return the digest of every column of every Parquet file below a folder."""
    found = {}
    for file in sorted(folder.rglob("*.parquet")):
        table = pq.read_table(file)
        for name in table.column_names:
            frame = pa.table({name: table[name].combine_chunks()})
            sink = io.BytesIO()
            csv.write_csv(frame, sink)
            text = f"{table[name].type} ".encode() + sink.getvalue()
            found[f"{file.relative_to(folder)}:{name}"] = hashlib.sha256(text).hexdigest()[:16]
    return found


def main(after: Path, before: Path | None, only: str) -> int:
    """Write the digests, compare them, and return the exit code."""
    found: dict[str, dict[str, str]] = {}
    for path in sorted(CONFIGS.rglob("*.toml")):
        name = path.relative_to(CONFIGS).as_posix()
        out = Path(tempfile.mkdtemp()) / "out"
        call = command(path, out) if only in name else []
        if not call:
            continue
        started = time.perf_counter()
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        found[name] = digests(out) | {"exit code": str(done.returncode)}
        print(
            f"{name}: {len(found[name])} columns, {time.perf_counter() - started:.1f} s", flush=True
        )
        shutil.rmtree(out.parent)
    after.write_text(json.dumps(found, indent=1), encoding="utf-8")
    if before is None:
        return 0
    known = json.loads(before.read_text(encoding="utf-8"))
    known = {name: columns for name, columns in known.items() if only in name}
    wrong = 0
    for scene in sorted(known.keys() | found.keys()):
        old, new = known.get(scene, {}), found.get(scene, {})
        for key in sorted(old.keys() | new.keys()):
            if old.get(key) != new.get(key):
                wrong += 1
                print(f"{scene}: {key}: {old.get(key, 'new')} -> {new.get(key, 'gone')}")
    print(f"{wrong} columns differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("after", type=Path)
    parser.add_argument("before", type=Path, nargs="?")
    parser.add_argument("--only", default="")
    sys.exit(main(**vars(parser.parse_args())))
