"""Numbers of errata: what code, scenes and pages refer to stands in the table of the docs."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "thesis.md"
REFERENCE = re.compile(r"errat(?:a|um) (\d+[a-z]?(?:(?:, | and |-)\d+[a-z]?)*)", re.IGNORECASE)


def numbers(text: str) -> set[str]:
    """All numbers that a text refers to as errata, ranges written out."""
    found = set()
    for part in REFERENCE.findall(text):
        for item in re.split(", | and ", part):
            first, _, last = item.partition("-")
            found |= {str(n) for n in range(int(first), int(last) + 1)} if last else {first}
    return found


def listed() -> set[str]:
    rows = re.findall(r"^\| (\d+[a-z]?(?:, \d+[a-z]?)*) \|", PAGE.read_text("utf-8"), re.MULTILINE)
    return {number for row in rows for number in row.split(", ")}


def test_numbers_are_read_singly_in_rows_and_in_ranges():
    assert numbers("errata 4 and 9; Errata 10-12, erratum 23c") == {
        "4",
        "9",
        "10",
        "11",
        "12",
        "23c",
    }


def test_every_erratum_that_is_named_stands_in_the_docs():
    known = listed()
    missing = {}
    for folder in ("dsa_des", "components", "configs", "docs", "tests"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix not in (".py", ".md", ".toml", ".csv") or path == Path(__file__):
                continue
            if unknown := numbers(path.read_text(encoding="utf-8")) - known:
                missing[str(path.relative_to(ROOT))] = unknown
    assert missing == {}
