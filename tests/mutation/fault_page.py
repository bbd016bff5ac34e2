"""The page of the docs that says what became of the faults."""

import subprocess
from collections.abc import Mapping, Sequence

from fault import Fault
from faulty_copy import CAUGHT, ROOT, SURVIVED, Outcome

_HEAD = """# Do the tests notice?

A test that passes says little until it has been seen to fail. `tests/mutation/` lists faults that
could be made by hand: a key that feeds the wrong function, a quantity in the wrong frame or unit, a
clock a scan late, an effect that is planned but not called, a metric that takes one distance for
another. A command puts each of them, one at a time, into a copy of the project and runs the tests
nearest to it.

<!-- not run: takes half an hour -->
```
python tests/mutation/run_faults.py --workers 2 --json /tmp/faults.json --page docs/mutation.md
```

It first runs those tests without a fault, and ends with 1 if one of the faults is not noticed.
`--only frames` tries one group, `--only TEXT` the faults of a file or of that name; with `--json`
what was found before is kept for the page. The suite itself checks only that every fault still fits
its file.

"""


def page(faults: Sequence[Fault], outcomes: Mapping[str, Outcome]) -> str:
    """Return the page as Markdown, from the last outcome of each fault by its name."""
    days = [outcome.at for outcome in outcomes.values()]
    between = " to ".join(dict.fromkeys((min(days), max(days)))) if days else "no day"
    lines = [_HEAD + f"The last outcome of each fault, of {between}; written{_commit()}:\n"]
    lines += ["| where | faults | noticed | survived | equivalent | not tried |"]
    lines += ["|---|--:|--:|--:|--:|--:|"]
    for group in [*dict.fromkeys(fault.group for fault in faults), ""]:
        mine = [fault for fault in faults if group in (fault.group, "")]
        real = [_result(fault, outcomes) for fault in mine if not fault.equivalent]
        same = len(mine) - len(real)
        caught, survived = real.count(CAUGHT), real.count(SURVIVED)
        counts = (len(mine), caught, survived, same, len(real) - caught - survived)
        lines.append(f"| {group or '**all**'} | {' | '.join(map(str, counts))} |")
    left = [f for f in faults if not f.equivalent and _result(f, outcomes) == SURVIVED]
    if left:
        lines += ["", "Not noticed:", ""]
        lines += [f"- `{f.name}` in `{f.file}`: `{_flat(f.old)}` as `{_flat(f.new)}`" for f in left]
    same_ones = [f for f in faults if f.equivalent]
    if same_ones:
        lines += ["", "Equivalent, which no test can notice:", ""]
        lines += [f"- `{f.name}` in `{f.file}`: {f.equivalent}" for f in same_ones]
    return "\n".join(lines) + "\n"


def _result(fault: Fault, outcomes: Mapping[str, Outcome]) -> str:
    return outcomes[fault.name].result if fault.name in outcomes else ""


def _flat(text: str) -> str:
    return " ".join(text.split())


def _commit() -> str:
    found = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    )
    return f" at commit {found.stdout.strip()}" if found.returncode == 0 else ""
