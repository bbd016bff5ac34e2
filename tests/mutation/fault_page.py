"""The page of the docs that says what became of the faults."""

import math
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from fault import Fault
from faulty_copy import CAUGHT, ROOT, SURVIVED, Outcome

_HEAD = """# Mutation check

Would the tests notice a mistake? `tests/mutation/` lists plausible ones. A command puts
each of them, one at a time, into a copy of the project and runs the tests nearest to it.

<!-- not run: takes half an hour -->
```
python tests/mutation/run_faults.py --workers 2 --json /tmp/faults.json --page docs/mutation.md
```

It first runs those tests without a fault, and ends with 1 if one of the faults is not noticed.
`--only metrics` tries one group, `--only TEXT` the faults of a file, of a class or function, or
of that name; with `--json` earlier outcomes are kept for the page.

The lists are `tests/mutation/faults/*.txt`. A fault is named by the class, method, function or
constant that it is in (prefixed by the module if several have the same name), by an expression
that occurs there once and by its replacement. They are compared as syntax trees, so neither
layout nor file matters; tests are named without their folders. The suite checks only that every
fault still fits, and that its tests are there.

"""


_RANDOM = """
## Drawn at random

The list above was written together with its tests. These faults were chosen at random: a line is
drawn uniformly from all that the tests execute, then a kind of mistake that it allows (a
constant, a comparison, a sign, swapped arguments or operands, a dropped term, condition, keyword,
filter or statement, an off-by-one, `and` for `or`, swapped branches, minimum for maximum, sine
for cosine, degrees for radians). Tests that execute the line run until one fails, within a budget
of time: those of its room, of rooms that import it, and the rest, the cheapest files first.

`python tests/mutation/coverage_map.py --workers 2` makes the map of lines (it needs coverage.py),
`python tests/mutation/random_faults.py --workers 2 --count 300 --page docs/mutation.md` this table.
With `-m "not slow"` the map, and with `--fast` the draw, is of the fast tests alone.

The share noticed is of those that are not marked equivalent (`tests/mutation/equivalent.json`,
each with its reason), with its 95 % interval by Wilson. Not covered: lines that no test executes,
declarations of classes outside their methods, texts, errors raised, and mistakes in more than one
place; a test that needs more time than the budget counts as not noticing the fault.

"""


def with_random(file: Path, rows: Sequence[Mapping]) -> str:
    """Return the page in a file with its second part made anew."""
    text = file.read_text(encoding="utf-8").removesuffix(random_part(file))
    days = sorted({row["at"] for row in rows})
    seeds = ", ".join(str(seed) for seed in sorted({row["seed"] for row in rows}))
    lines = [f"Seed {seeds}, {' to '.join(dict.fromkeys((days[0], days[-1])))}{_commit()}:\n"]
    lines += [table_of_rooms(rows)]
    left = [row for row in rows if row["result"] == SURVIVED and not row["equivalent"]]
    if left:
        lines += ["", "Not noticed:", ""]
        lines += [f"- `{row['place']}`, {row['operator']}: `{row['change']}`" for row in left]
    return text + _RANDOM + "\n".join(lines) + "\n"


def random_part(file: Path) -> str:
    """Return the second part of a page as it stands, empty if it has none."""
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    return "".join(text.partition(_RANDOM[:20])[1:])


def table_of_rooms(rows: Sequence[Mapping]) -> str:
    """Return the share noticed in each room as a table in Markdown."""
    lines = ["| room | drawn | equivalent | noticed | survived | share | from | to |"]
    lines += ["|---|--:|--:|--:|--:|--:|--:|--:|"]
    for room in [*sorted({row["room"] for row in rows}), ""]:
        mine = [row for row in rows if room in (row["room"], "")]
        real = [row["result"] for row in mine if not row["equivalent"]]
        caught, survived = real.count(CAUGHT), real.count(SURVIVED)
        counts = f"{len(mine)} | {len(mine) - len(real)} | {caught} | {survived}"
        shares = [f"{100.0 * share:.0f} %" for share in _wilson(caught, caught + survived)]
        lines.append(f"| {room or '**all**'} | {counts} | {' | '.join(shares)} |")
    return "\n".join(lines)


def _wilson(found: int, of: int) -> tuple[float, float, float]:
    """Return a share and its 95 % interval."""
    if of == 0:
        return math.nan, 0.0, 1.0
    z, share = 1.959964, found / of
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + (z / (2 * of)) ** 2) / (1 + z * z / of)
    return share, middle - half, middle + half


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
        lines += [
            f"- `{f.name}` in `{f.where}`: `{_flat(f.old)}` as `{_flat(f.new)}`" for f in left
        ]
    same_ones = [f for f in faults if f.equivalent]
    if same_ones:
        lines += ["", "Equivalent, which no test can notice:", ""]
        lines += [f"- `{f.name}` in `{f.where}`: {f.equivalent}" for f in same_ones]
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
