"""docs/published.md says what its makers give, and its verdicts follow from the numbers."""

import pytest

from docs.make.published import __main__ as maker
from docs.make.published import degas
from docs.make.published.rows import PublishedRow, table

PAGE = maker.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("row", "verdict"),
    [
        (PublishedRow("r", 1.0, 1.04, within=0.05), "equal"),
        (PublishedRow("r", 1.0, 1.06, within=0.05), "outside"),
        (PublishedRow("r", 1.0, 1.2, interval=(0.9, 1.5)), "inside"),
        (PublishedRow("r", 1.0, 1.2, interval=(1.1, 1.5)), "outside"),
        (PublishedRow("r", 1.0, 1.2, interval=(1.1, 1.5), within=0.2), "equal"),
        (PublishedRow("r", 1.0, float("nan"), within=0.2), "outside"),
    ],
)
def test_verdicts(row, verdict):
    assert row.verdict == verdict
    assert f"| {verdict}" in row.line()


def test_a_row_shows_what_it_is_made_of():
    row = PublishedRow("least range", 100.0, 101.25, "ft", interval=(99.0, 103.0), digits=1)
    assert row.line() == ("| least range | 100.0 ft | 101.2 ft (99.0 to 103.0) | +1.2 | inside |")
    assert table([row]).count("\n") == 2


def test_sections_that_are_not_made_again_stay(tmp_path, monkeypatch):
    page = tmp_path / "published.md"
    page.write_text(PAGE, encoding="utf-8")
    monkeypatch.setattr(degas, "section", lambda images: "Made again.")
    maker.main(["--page", str(page), "degas"])
    before, after = maker.kept(PAGE), maker.kept(page.read_text(encoding="utf-8"))
    assert after.pop("degas").startswith(f"## {degas.TITLE}\n\nMade again.\n\n*Made at `")
    assert "degas" in before and {**before, **after} == before


def test_the_committed_page_has_every_section_in_order():
    places = [PAGE.index(f"## {module.TITLE}\n") for module in maker.sections().values()]
    assert places == sorted(places)
    assert set(maker.kept(PAGE)) == set(maker.sections())


def test_rows_of_degas_are_those_of_the_page():
    rows = degas.unmitigated()
    assert [row.verdict for row in rows] == ["equal"] * 4
    for row in rows:
        assert row.line() in PAGE.splitlines()
