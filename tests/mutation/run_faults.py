"""Puts the listed faults in a copy of the project, one by one, and says which no test notices.

    python tests/mutation/run_faults.py [--only TEXT ...] [--workers N] [--json FILE] [--page FILE]

A development tool that needs `os.fork`; all of them take half an hour. The suite only checks that
every fault still fits what it is in, and that copying and running work. With `--json` outcomes are
added to those of earlier runs, for the page to be made of all of them.
"""

import json
import sys
import tempfile
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import fault_page
from fault import FAULTS, Fault
from faulty_copy import CAUGHT, SURVIVED, Outcome, copies_in, from_a_copy, tried


def main() -> int:
    """Run what the command line asks for; 1 if a fault survived or does not fit any more."""
    asked = _arguments()
    faults = [fault for fault in FAULTS if asked.only is None or _is_one(fault, asked.only)]
    if asked.left:
        settled = {each.name for each in _earlier(asked.json) if each.result == CAUGHT}
        faults = [fault for fault in faults if fault.name not in settled]
    if not faults:
        print("there is no such fault")
        return 2
    try:
        tests = {test for fault in faults for test in fault.tests}
    except ValueError as error:
        print(error)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        outcomes = _run_all(faults, tests, asked, Path(folder))
    if not outcomes:
        return 1
    known = {outcome.name: outcome for outcome in [*_earlier(asked.json), *outcomes]}
    if asked.page is not None:
        text = fault_page.page(FAULTS, known) + fault_page.random_part(asked.page)
        asked.page.write_text(text, encoding="utf-8")
    return _summary(faults, outcomes)


def _earlier(file: Path | None) -> list[Outcome]:
    """Return what became in earlier runs of faults that are the same, by tests they still have."""
    if file is None or not file.exists():
        return []
    faults = {fault.digest: fault for fault in FAULTS}
    found = [Outcome(**row) for row in json.loads(file.read_text(encoding="utf-8"))]
    return [
        outcome
        for outcome in found
        if outcome.digest in faults
        and (outcome.result != CAUGHT or _has(faults[outcome.digest], outcome.by))
    ]


def _has(fault: Fault, test: str) -> bool:
    """Whether what noticed a fault is among its tests (or is none, but the time limit)."""
    file, _, inner = test.partition("::")
    named = f"{Path(file).stem}::{inner}"
    near = [each.rpartition("/")[2] for each in fault.near]
    return not inner or any(named.startswith(t if "::" in t else f"{t}::") for t in near)


def _keep(outcome: Outcome, file: Path | None) -> None:
    """Put an outcome in the place of an earlier one; a run that is stopped loses none."""
    if file is not None:
        known = {each.name: each for each in [*_earlier(file), outcome]}
        rows = [vars(each) for each in known.values()]
        file.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def _arguments() -> Namespace:
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only",
        nargs="+",
        metavar="TEXT",
        help="groups, files or parts of names (of a fault, or of what it is in)",
    )
    parser.add_argument("--workers", type=int, default=1, help="faults tried at once")
    parser.add_argument("--json", type=Path, metavar="FILE", help="add the outcomes to a file")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the page of the docs")
    parser.add_argument(
        "--left", action="store_true", help="only faults that were not noticed in the --json file"
    )
    parser.add_argument(
        "--unchecked", action="store_true", help="do not run the tests without a fault first"
    )
    return parser.parse_args()


def _is_one(fault: Fault, only: Sequence[str]) -> bool:
    groups = {known.group for known in FAULTS}
    return any(
        text == fault.group
        if text in groups
        else text in fault.name
        or text in fault.where
        or (text.endswith(".py") and _is_in(fault, text))
        for text in only
    )


def _is_in(fault: Fault, file: str) -> bool:
    try:
        return fault.file == file
    except ValueError:  # its definition is not found, which is told where it is tried
        return False


def _run_all(
    faults: Sequence[Fault], tests: Iterable[str], asked: Namespace, folder: Path
) -> list[Outcome]:
    """Return outcomes in the order of the faults; none if the tests fail without a fault."""
    copies = copies_in(folder, asked.workers)
    if not asked.unchecked:
        said = copies[0].clean(tests)
        if said:
            print(said, "\nthe tests fail without any fault", sep="")
            return []
    found: dict[str, Outcome] = {}
    for fault, outcome in tried(faults, copies):
        found[outcome.name] = outcome
        _keep(outcome, asked.json)
        print(
            f"{outcome.seconds:5.1f} s  {outcome.result:9} {fault.group}: {outcome.name}  "
            f"{outcome.by}",
            flush=True,
        )
    return [found[fault.name] for fault in faults]


def _summary(faults: Sequence[Fault], outcomes: Sequence[Outcome]) -> int:
    known = {fault.name for fault in faults if fault.equivalent}
    counts = Counter(outcome.result for outcome in outcomes)
    print(", ".join(f"{count} {result}" for result, count in sorted(counts.items())))
    wrong = 0
    for outcome in outcomes:
        said = ""
        if outcome.name in known and outcome.result == CAUGHT:
            said = f"is called equivalent, but {outcome.by} tells it apart"
        elif outcome.name not in known and outcome.result == SURVIVED:
            said = "survived"
        elif outcome.result not in (CAUGHT, SURVIVED):
            said = outcome.by
        if said:
            print(f"{outcome.name}: {said}")
        wrong += bool(said)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(from_a_copy(main))
