"""The page of the hard cases, and the check that it says what is computed."""

from collections.abc import Callable
from pathlib import Path

from components.evidence.numerics.case import NumericalCase
from components.evidence.numerics.detection_cases import detection_cases
from components.evidence.numerics.geometry_cases import geometry_cases
from components.evidence.numerics.grid_and_clock_cases import clock_cases, rounding_cases
from components.evidence.numerics.optical_cases import optical_cases

PAGE = Path(__file__).parents[3] / "docs" / "numerics.md"

SECTIONS: list[tuple[str, Callable[[], list[NumericalCase]]]] = [
    ("Geometry", geometry_cases),
    ("Detection", detection_cases),
    ("Signature", optical_cases),
    ("Rounding", rounding_cases),
    ("Clocks", clock_cases),
]

_HEAD = """# Hard cases

What the straightforward formula gives, what dsa_des gives, and what is true. Printed by
`python -m components.evidence.numerics` (needs the extra `test`); `--check` compares this page with
what your machine computes. The naive column may differ in its last digits from machine to machine:
those digits are the noise this page is about.
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
    """Return the page.

    Raises
    ------
    ImportError
        If mpmath is not installed.
    """
    lines = [_HEAD]
    for title, cases in SECTIONS:
        lines += [f"## {title}", "", _row(_COLUMNS), _row(["---"] * len(_COLUMNS))]
        lines += [_row(_cells(case)) for case in cases()]
        lines.append("")
    return "\n".join(lines)


def differences(page: str) -> list[str]:
    """Return a line for each case whose result of ours, or reference, the page does not have.

    Raises
    ------
    ImportError
        If mpmath is not installed.
    """
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
