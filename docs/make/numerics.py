"""``python -m docs.make.numerics``: print docs/numerics.md, or check it."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from docs.make.numerical_cases import NumericalCase, clock_cases, geometry_cases, rounding_cases
from docs.make.sensor_cases import detection_cases, optical_cases
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say, say_lines

PAGE = Path(__file__).parents[1] / "numerics.md"

SECTIONS: list[tuple[str, Callable[[], list[NumericalCase]]]] = [
    ("Geometry", geometry_cases),
    ("Detection", detection_cases),
    ("Signature", optical_cases),
    ("Rounding", rounding_cases),
    ("Clocks", clock_cases),
]

_HEAD = """# Hard cases

Where do straightforward formulas fail, and what comes out here?

Results of the straightforward formula and of dsa_des, and the true value. Printed by
`python -m docs.make.numerics` (needs the extra `test`); `--check` compares this page with the
results of your machine. The naive column may differ in its last digits.
"""

_COLUMNS = ("hard case", "naive formula", "naive result", "ours", "reference", "from")


def _cells(case: NumericalCase) -> tuple[str, ...]:
    return (
        case.what,
        case.formula,
        case.text(case.naive),
        case.text(case.ours),
        case.text(case.reference),
        case.source,
    )


def markdown() -> str:
    """Return the page."""
    lines = [_HEAD]
    for title, cases in SECTIONS:
        lines += [f"## {title}", "", _row(_COLUMNS), _row(["---"] * len(_COLUMNS))]
        lines += [_row(_cells(case)) for case in cases()]
        lines.append("")
    return "\n".join(lines)


def differences(page: str) -> list[str]:
    """Return a line for each case whose result of ours, or reference, the page does not have."""
    written = {cells[0]: cells for cells in map(_split, page.splitlines()) if len(cells) == 6}
    found = []
    computed = set()
    for _, cases in SECTIONS:
        for case in cases():
            cells = _cells(case)
            computed.add(cells[0])
            old = written.get(cells[0])
            if old is None:
                found.append(f"{cells[0]}: is not on the page")
            elif old[3:5] != cells[3:5]:
                found.append(
                    f"{cells[0]}: the page has {old[3]} (reference {old[4]}), "
                    f"computed is {cells[3]} (reference {cells[4]})"
                )
    gone = set(written) - computed - {_COLUMNS[0], "---"}
    return found + [f"{what}: is on the page only" for what in sorted(gone)]


def _row(cells: tuple[str, ...] | list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _split(line: str) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in line.strip().strip("|").split("|"))


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code: 1 when the page differs, 2 when it cannot run."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.numerics",
        description="Compute the hard cases of docs/numerics.md and print the page.",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="print nothing but what differs between the page and our results; exit code 1 then",
    )
    parser.add_argument("--page", type=Path, default=PAGE, help="the page to check")
    options = parser.parse_args(arguments)
    try:
        if not options.check:
            say_lines(markdown().removesuffix("\n"))
            return 0
        found = differences(options.page.read_text(encoding="utf-8"))
    except (ImportError, OSError) as error:
        say(error, err=True)
        return 2
    for line in found:
        say(line)
    return 1 if found else 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
