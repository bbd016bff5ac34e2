"""What tests/slow.txt lists is there: a name that went would leave its test in the fast tier."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
LISTED = [
    line
    for line in (ROOT / "tests" / "slow.txt").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]


def test_what_is_listed_exists() -> None:
    sources = {file: (ROOT / file).read_text(encoding="utf-8")
               for file in {line.partition("::")[0] for line in LISTED}}  # fmt: skip
    for line in LISTED:
        file, _, function = line.partition("::")
        assert not function or f"def {function.rpartition('::')[2]}(" in sources[file], line


def test_the_list_is_sorted_and_has_no_doubles() -> None:
    assert sorted(set(LISTED)) == LISTED


@pytest.mark.parametrize("line", LISTED[:1])
def test_what_is_listed_is_marked(line: str, request: pytest.FixtureRequest) -> None:
    slow = {item.nodeid for item in request.session.items if item.get_closest_marker("slow")}
    there = {item.nodeid for item in request.session.items if item.nodeid.startswith(line)}
    assert there <= slow
