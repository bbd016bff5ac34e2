"""Draws small mistakes from the lines that the tests execute, and says which no test notices.

    python tests/mutation/random_faults.py [--only ROOM ...] [--count N] [--seed N] [--workers N]
                                           [--json FILE] [--survivors] [--page FILE]

A line is drawn first, all alike, of all rooms of `dsa_des` and `components`; then a kind of mistake
that this line allows (a constant, a comparison, a sign, swapped arguments, a dropped term, one off,
and for or, ...), then one of these. It is put into a copy of the project. The tests of its room run
first, then those of rooms that import it, then all others that execute the line, the cheapest files
first (`tests/run_nearest.py` knows the order), until one fails or their processor time
(`--budget-s`) is used up; what does not end counts as noticed.

Which tests execute a line is known from a map that `coverage_map.py` makes once (half an hour; of
the fast tier, with -m "not slow", a few minutes; a map of an older state still serves, as do the
tests that it does not know). Without a map all tests may, and any line may be drawn.

While you strengthen the tests of a room:

    python tests/mutation/random_faults.py --only components/view --count 40 --json /tmp/view.json
    python tests/mutation/random_faults.py --only components/view --json /tmp/view.json --survivors

What no test can notice goes into `equivalent.json`, with its name and change as they are printed,
and the reason. All is read from a copy of the working tree as it was at the start: the tree itself
is never touched, and may change meanwhile.
"""

import json
import random
import re
import sys
import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path

import fault_page
import pytest
from coverage_map import KEPT, Map
from drawn_fault import DrawnFault, faults_of
from faulty_copy import CAUGHT, ROOT, SURVIVED, TestRun, copies_in, from_a_copy, tried

sys.path.append(str(ROOT / "tests"))
from run_nearest import REST, order_tests

_EQUIVALENT = Path(__file__).with_name("equivalent.json")


class Chosen:
    """Pytest's plugin that keeps the tests that were chosen, and those that the map does not know.

    Files keep their order, and are not mixed, for what their tests share; the cheapest of each come
    first.
    """

    def __init__(
        self, files: Sequence[str], wanted: Iterable[str], known: dict[str, float]
    ) -> None:
        self._place = {file: place for place, file in enumerate(files)}
        self._wanted, self._known = set(wanted), known

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Choose and sort."""
        items[:] = [
            item for item in items if item.nodeid in self._wanted or item.nodeid not in self._known
        ]
        items.sort(
            key=lambda item: (self._place[_file(item.nodeid)], self._known.get(item.nodeid, 1.0))
        )


class Tests:
    """Which tests are to notice a fault: its room's, those of rooms above it, and the rest."""

    def __init__(self, known: Map, budget_s: float, tier: str) -> None:
        self._known, self._budget_s, self._tier = known, budget_s, tier
        self._functions = {test.partition("[")[0] for test in known.seconds}
        lists = ("slow.txt", "exhaustive.txt") if tier else ()
        lines = [(ROOT / "tests" / name).read_text(encoding="utf-8").splitlines() for name in lists]
        self._left_out = {line for each in lines for line in each}
        self._lines = cache(lambda file, text: known.executed(file, text))

    def reaches(self, fault: DrawnFault) -> bool:
        """Whether the line is executed; without a map all may be."""
        return not self._known.seconds or fault.line in self._lines(fault.file, fault.text)

    def rounds(self, fault: DrawnFault) -> list[Callable[[Path], TestRun]]:
        """Return what starts each round."""
        lines = self._lines(fault.file, fault.text)
        # What is executed where the module is imported concerns all that execute the rest of it.
        tests = lines.get(fault.line) or {test for each in lines.values() for test in each}
        near = order_tests([fault.file])
        of_file = defaultdict(list)
        for test in tests:
            of_file[_file(test)].append(test)
        cost = {file: sum(map(self._seconds, of_file.get(file, ()))) for file in near}
        rounds: list[list[str]] = [[], [], []]
        spent_s = 0.0
        for file in sorted(near, key=lambda file: (near[file][0], cost[file], near[file][1])):
            # Of what the map does not know only those run that are likely to notice it.
            likely = near[file][0] < REST or not self._known.seconds
            wanted = file in of_file or (likely and self._is_new(file))
            if wanted and (spent_s + cost[file] <= self._budget_s or not spent_s):
                rounds[near[file][0]].append(file)
                spent_s += cost[file]
        return [
            partial(self._start, files=some, tests=[t for file in some for t in of_file[file]])
            for some in rounds
            if some
        ]

    def _is_new(self, file: str) -> bool:
        """Whether a file holds tests that the map does not know; of the tier that is tried."""
        names = re.findall(r"^def (test_\w+)", (ROOT / file).read_text(encoding="utf-8"), re.M)
        found = {f"{file}::{name}" for name in names} - self._functions
        return bool(found - self._left_out) and file not in self._left_out

    def _seconds(self, test: str) -> float:
        """Return the processor time of a test: how busy the machine was counts for nothing."""
        return self._known.cpu_s.get(test, self._known.seconds[test])

    def _start(self, folder: Path, files: Sequence[str], tests: Sequence[str]) -> TestRun:
        there = [file for file in files if (folder / file).exists()]
        limit_s = 120.0 + 5.0 * sum(self._known.seconds[test] for test in tests)
        chosen = Chosen(files, tests, {test: self._seconds(test) for test in self._known.seconds})
        options = ["-x", *(["-m", self._tier] if self._tier else [])]
        return TestRun(folder, there, *options, limit_s=limit_s, plugins=[chosen])


def _file(test: str) -> str:
    return test.partition("::")[0]


def drawn(seed: int, count: int, only: Sequence[str], tests: Tests) -> list[DrawnFault]:
    """Draw faults, at most one a line."""
    lines: dict[tuple[str, int], list[DrawnFault]] = defaultdict(list)
    for fault in _all(only):
        if tests.reaches(fault):
            lines[fault.file, fault.line].append(fault)
    dice = random.Random(seed)
    places = sorted(lines)
    dice.shuffle(places)
    found = []
    for place in places:
        if len(found) == count:
            break
        mine = lines[place]
        while mine:
            operator = dice.choice(sorted({fault.operator for fault in mine}))
            fault = dice.choice([fault for fault in mine if fault.operator == operator])
            try:
                fault.applied()
            except ValueError:
                mine.remove(fault)
                continue
            found.append(fault)
            break
    return found


def _all(only: Sequence[str]) -> Iterator[DrawnFault]:
    for part in ("dsa_des", "components"):
        for path in sorted((ROOT / part).rglob("*.py")):
            file = path.relative_to(ROOT).as_posix()
            if not only or any(f"{file}/".startswith(f"{each.rstrip('/')}/") for each in only):
                yield from faults_of(file, path.read_text(encoding="utf-8"))


def equivalents(marked: Sequence[dict] | None = None) -> dict[str, str]:
    """Return the reason of each fault that no test can notice, by its digest."""
    if marked is None:
        marked = json.loads(_EQUIVALENT.read_text(encoding="utf-8"))
    return {DrawnFault.digest_of(each["name"], each["change"]): each["reason"] for each in marked}


def main() -> int:
    """Draw, try and tell; 1 if a fault that is not called equivalent survived."""
    asked = _arguments()
    tests = Tests(Map(asked.map), asked.budget_s, "not slow" if asked.fast else "")
    rows = _earlier(asked.json)
    if asked.survivors:
        wanted = {row["digest"] for row in rows if row["result"] == SURVIVED}
        faults = [fault for fault in _all(asked.only) if fault.digest in wanted]
    else:
        faults = drawn(asked.seed, asked.count, asked.only, tests)
        print(f"seed {asked.seed}: {len(faults)} faults", flush=True)
    same = equivalents()
    with tempfile.TemporaryDirectory() as folder:
        copies = copies_in(Path(folder), asked.workers)
        for fault, outcome in tried(faults, copies, tests.rounds):
            row = {
                **vars(outcome), "room": fault.room, "place": f"{fault.file}:{fault.line}",
                "operator": fault.operator, "change": fault.change, "seed": asked.seed,
                "equivalent": same.get(fault.digest, ""),
            }  # fmt: skip
            rows = [each for each in rows if each["digest"] != row["digest"]] + [row]
            _keep(rows, asked.json)
            _tell(fault, row)
        mine = {fault.digest for fault in faults}
        # Of a test's cases the names may hold blanks, where what pytest said of them was cut.
        told = [row["by"] for row in rows if row["digest"] in mine]
        by = {name.partition("[")[0] for name in told if "::" in name}
        said = copies[0].clean(by) if by and not asked.unchecked else ""
    if said:
        print(said, "\nthese tests fail without any fault: what they noticed counts for nothing")
        return 1
    rows = [row | {"equivalent": same.get(row["digest"], "")} for row in rows]
    _keep(rows, asked.json)
    print(fault_page.table_of_rooms(rows))
    if asked.page is not None:
        asked.page.write_text(fault_page.with_random(asked.page, rows), encoding="utf-8")
    left = [row for row in rows if row["result"] == SURVIVED and not row["equivalent"]]
    return 1 if left else 0


def _earlier(file: Path | None) -> list[dict]:
    if file is None or not file.exists():
        return []
    return json.loads(file.read_text(encoding="utf-8"))


def _keep(rows: Sequence[dict], file: Path | None) -> None:
    if file is not None:
        file.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _tell(fault: DrawnFault, row: dict) -> None:
    result = "equivalent" if row["equivalent"] else row["result"]
    print(f"{row['seconds']:6.1f} s  {result:10} {row['place']}  {row['operator']}  {row['by']}")
    if row["result"] == SURVIVED:
        print(f"    name: {fault.name}\n    change: {fault.change}")
        print("\n".join(f"    {line}" for line in fault.difference().splitlines()))
    if row["result"] == CAUGHT and row["equivalent"]:
        print(f"    is called equivalent: {row['equivalent']}")
    sys.stdout.flush()


def _arguments() -> Namespace:
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--only", nargs="+", default=[], metavar="ROOM", help="rooms or files, e.g. dsa_des/text")
    add("--count", type=int, default=300, help="how many faults; default: 300")
    now = int(f"{datetime.now(UTC):%Y%m%d%H%M%S}")
    add("--seed", type=int, default=now, help="default: drawn from the clock, and printed")
    add("--workers", type=int, default=1, help="faults tried at once")
    add("--json", type=Path, metavar="FILE", help="add the outcomes to a file")
    add("--survivors", action="store_true", help="only those that survived in the --json file")
    add("--map", type=Path, default=KEPT, metavar="FILE", help=f"of coverage_map; default: {KEPT}")
    add("--fast", action="store_true", help="try the fast tier of tests alone")
    add("--budget-s", type=float, default=90.0, help="of tests for one fault; default: 90")
    add("--page", type=Path, metavar="FILE", help="renew the table in this page of the docs")
    add("--unchecked", action="store_true", help="believe tests that noticed something")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(from_a_copy(main))
