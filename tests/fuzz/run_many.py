"""Fuzz scenes, files, studies and overrides by the thousand.

``python tests/fuzz/run_many.py --count 10000 --seed 1 --workers 2`` prints what went wrong and the
totals, and keeps every case that did in a folder: its files, and its command in ``argv.json``.
``--only scene-1-17`` runs one case again and shows its command.
"""

import argparse
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from fuzz_cases import KINDS, make_case
from fuzz_judge import LIMIT_S, import_everything, judge

Result = tuple[str, int | None, list[str], float]


def one(kind: str, seed: int, number: int, limit_s: float) -> Result:
    """Return a case's name, its exit code, what is wrong with it, and how long it took, s."""
    started = time.monotonic()
    case = make_case(kind, seed, number)
    return case.name, *judge(case, limit_s), time.monotonic() - started


def kind_of(name: str) -> str:
    """Return the kind of a case from its name."""
    return name.split("-", 1)[0]


def keep(name: str, faults: list[str], folder: Path) -> None:
    """Write a case's files and command where somebody can look at them."""
    kind, seed, number = name.rsplit("-", 2)
    case = make_case(kind, int(seed), int(number))
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    if not any(place.iterdir()):
        case.put(place)
    (place / "argv.json").write_text(json.dumps({"argv": case.argv, "faults": faults}, indent=1))


def main() -> int:
    """Run the cases; the exit code is 1 when something was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="processor time of a case, s")
    parser.add_argument("--out", type=Path, default=Path("fuzz-faults"))
    parser.add_argument("--only", help="one case, by its name")
    options = parser.parse_args()
    import_everything()
    if options.only:
        kind, seed, number = options.only.rsplit("-", 2)
        print(json.dumps(make_case(kind, int(seed), int(number)).argv))
        print(one(kind, int(seed), int(number), options.limit))
        return 0
    kinds = options.kinds.split(",")
    numbers = range(options.first, options.first + options.count)
    context = get_context("fork")
    totals: Counter[str] = Counter()
    slowest = (0.0, "")
    with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
        jobs = ((kinds[n % len(kinds)], options.seed, n, options.limit) for n in numbers)
        for name, code, faults, took_s in pool.map(one, *zip(*jobs, strict=True), chunksize=4):
            totals["cases"] += 1
            totals[f"{kind_of(name)} exit {code}"] += 1
            slowest = max(slowest, (took_s, name))
            if faults:
                totals["faults"] += 1
                keep(name, faults, options.out)
                for fault in faults:
                    totals[fault.split(":")[0]] += 1
                    print(f"{name}: {fault}", flush=True)
    print(", ".join(f"{what}: {count}" for what, count in sorted(totals.items())))
    print(f"slowest: {slowest[1]}, {slowest[0]:.1f} s")
    return 1 if totals["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
