"""What a new user comes for is at most two clicks from README."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def links(page: Path) -> set[str]:
    """The pages of ours that a page links, from the root of the project, with their anchors."""
    found = re.findall(r"\]\(([\w./-]+\.md(?:#[\w-]+)?)\)", page.read_text(encoding="utf-8"))
    return {(page.parent / link).resolve().relative_to(ROOT).as_posix() for link in found}


@pytest.mark.parametrize(
    "wanted",
    [
        "docs/real-traffic.md",
        "docs/sensors.md#from-a-data-sheet",
        "docs/encounters.md",
        "docs/how-many-encounters.md",
        "docs/platforms.md",
    ],
)
def test_it_is_at_most_two_clicks_from_readme(wanted: str) -> None:
    first = links(ROOT / "README.md")
    second = {link for page in first for link in links(ROOT / page.partition("#")[0])}
    assert wanted in first | second
    page, _, anchor = wanted.partition("#")
    heads = re.findall(r"^#+ (.+)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    assert not anchor or anchor in {head.lower().replace(" ", "-") for head in heads}
