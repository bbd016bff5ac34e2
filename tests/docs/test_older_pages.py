"""Made pages name commit and command, from which follows what they are older than."""

import pytest

from docs.make.stamp import STAMP, stamped
from tests.docs import older_pages
from tests.docs.older_pages import files_of, main, stamps

#: Pages that take minutes to make; others are compared with their makers to the letter.
MADE = {"accuracy-and-cost.md", "clutter.md", "pictures.md", "published.md", "scan-rate.md"}


def test_every_made_page_names_commit_and_command() -> None:
    every = list(stamps())
    assert {page for page, _, _ in every} == MADE
    assert all(files_of(command) for _, _, command in every)


def test_a_stamp_is_read_as_it_is_written() -> None:
    text = stamped("# A page\n", "python -m docs.make.clutter docs/clutter.md")
    ((commit, command),) = STAMP.findall(text)
    assert commit and command == "python -m docs.make.clutter docs/clutter.md"


def test_a_page_is_made_of_what_its_maker_imports_at_any_remove() -> None:
    files = files_of("python -m docs.make.clutter docs/clutter.md")
    assert "docs/make/clutter.py" in files
    assert "dsa_des/files/output_file.py" in files
    assert "docs/make/numerics.py" not in files
    section = files_of("python -m docs.make.published degas")
    assert "docs/make/published/degas.py" in section
    assert "docs/make/published/eyes.py" not in section


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"docs/make/clutter.py", "README.md"}, "older than 1 files"),
        ({"README.md"}, "current"),
        (None, "not known here"),
    ],
)
def test_it_says_which_are_older(
    changed: set[str] | None,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    of = ("clutter.md", "abc", "python -m docs.make.clutter docs/clutter.md")
    monkeypatch.setattr(older_pages, "stamps", lambda: iter([of]))
    monkeypatch.setattr(older_pages, "changed_since", lambda commit: changed)
    assert main() == 0
    assert said in capsys.readouterr().out
