"""Every shipped scene and study in short form: keep all values, or say what differs from kept ones.

``python tests/random_scenes/shipped_values.py --keep FOLDER`` before a change that is to change
nothing, ``--against FOLDER`` after it (and ``--only TEXT`` for some). Ends with 1 where a value, a
column or a table differs. Text is compared as text, numbers by their bits, nulls as nulls.
"""

import argparse
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from comparisons import recorded

import dsa_des
from dsa_des.errors import BlockFailure, OutputError, RunRefused, SceneError, UsageError
from dsa_des.scene.examples import examples

REPLICAS = 2


def values_of(kind: str, name: str) -> dict[str, dict[str, Any]]:
    """Return table → column → plain arrays of what a shipped scene or study gives."""
    if kind == "study":
        result = dsa_des.study(name, sets=[f"replicas={REPLICAS}"], workers=1)
        return {"runs": {c: _plain(result.runs.column(c)) for c in result.runs.column_names}}
    return recorded(dsa_des.load_scene(name))


def _plain(column: Any) -> Any:
    return np.array([repr(value) for value in column.to_pylist()], dtype=object)


def keep(path: Path, tables: Mapping[str, Mapping[str, Any]]) -> None:
    """Write all columns into one file; text as text of fixed width."""
    arrays = {
        f"{table}\t{name}": values.astype(str) if values.dtype == object else values
        for table, columns in tables.items()
        for name, values in columns.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **arrays)


def differences(path: Path, tables: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a line for each table or column that is not as kept."""
    with np.load(path) as file:
        kept = {name: file[name] for name in file.files}
    now = {
        f"{table}\t{name}": v for table, columns in tables.items() for name, v in columns.items()
    }
    lines = [f"{_name(key)}: is gone" for key in kept.keys() - now.keys()]
    lines += [f"{_name(key)}: is new" for key in now.keys() - kept.keys()]
    for key in kept.keys() & now.keys():
        old, new = kept[key], now[key]
        new = new.astype(str) if new.dtype == object else new
        if len(old) != len(new):
            lines.append(f"{_name(key)}: {len(old)} rows, now {len(new)}")
        elif (unequal := np.flatnonzero(old != new)).size:
            lines.append(f"{_name(key)}: {unequal.size} of {len(new)} rows{_size(old, new)}")
    return sorted(lines)


def _name(key: str) -> str:
    return ".".join(key.split("\t"))


def _size(old: Any, new: Any) -> str:
    """Say how far floats are apart; they were kept by their bits."""
    if old.dtype != np.int64 or abs(old).max(initial=0) < 1 << 53:
        return ""
    gap = np.abs(old.view(np.float64) - new.view(np.float64))
    return f", by {np.nanmax(gap, initial=0.0):.2g} at most"


def main() -> int:
    """Go through all scenes and studies; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    ways = parser.add_mutually_exclusive_group(required=True)
    ways.add_argument("--keep", type=Path)
    ways.add_argument("--against", type=Path)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    found = 0
    for example in examples():
        if chosen.only not in example.name:
            continue
        begun = time.process_time()
        path = (chosen.keep or chosen.against) / f"{example.name}.npz"
        try:
            tables = values_of(example.kind, example.name)
        except (SceneError, UsageError, BlockFailure, RunRefused, OutputError) as error:
            tables = {"(error)": {"message": np.array([str(error)], dtype=object)}}
        if chosen.keep:
            keep(path, tables)
            lines = []
        else:
            lines = differences(path, tables) if path.exists() else ["was not kept"]
        spent = time.process_time() - begun
        print(f"{example.kind} {example.name}: {len(lines)} differences, {spent:.1f} s", flush=True)
        for line in lines:
            print(f"  {line}", flush=True)
        found += len(lines)
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
