"""The page docs/thesis.md: the whole table, the errata that matter, and the figures of a run."""

from pathlib import Path

from components.thesis.made import Made
from components.thesis.registry import Item
from components.thesis.row import Row
from components.thesis.tally import tally

_TEXTS = Path(__file__).parent


def short(value: float, sign: bool = False) -> str:
    """Return a number with four significant digits."""
    text = f"{value:+.4g}" if sign else f"{value:.4g}"
    if "e" in text and 1e-4 < abs(value) < 1e9:
        return f"{value:+.0f}" if sign else f"{value:.0f}"
    return text


def markdown(results: list[tuple[Item, Made]], images: str) -> str:
    """Return the page.

    Parameters
    ----------
    results : list of (Item, Made)
    images : str
        Folder of the figures, as seen from the page.
    """
    rows = [row for _, made in results for row in made.rows]
    parts = [_text("page_head.md").format(tally=tally(rows, "*")), _text("page_errata.md")]
    for item, made in results:
        parts.append(_section(item, made, images))
    return "\n".join(parts)


def _section(item: Item, made: Made, images: str) -> str:
    lines = [f"## {item.title} ({_label(item)})", ""]
    derived = any(row.derived for row in made.rows)
    extra = (" derived |", " ---: |") if derived else ("", "")
    lines += [f"| quantity | printed |{extra[0]} ours | difference | unit | verdict | from |"]
    lines += [f"| --- | ---: |{extra[1]} ---: | ---: | --- | --- | --- |"]
    lines += [line(row, derived) for row in made.rows]
    lines.append("")
    if made.note:
        lines += [made.note, ""]
    for picture in made.pictures:
        lines += [f"![{picture.caption}]({images}/{picture.name}.png)", "", picture.caption, ""]
    return "\n".join(lines)


def line(row: Row, derived: bool) -> str:
    """Return a row as a line of its table, with or without the column of derived numbers."""
    difference = "" if row.difference is None else short(row.difference, sign=True)
    cells = (row.quantity, row.printed or "", *((row.derived,) if derived else ()),
             short(row.ours), difference, row.unit, row.said, row.source)  # fmt: skip
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _label(item: Item) -> str:
    kind, _, number = item.name.partition("-")
    return {"fig": "Fig. ", "table": "Table ", "sec": "§", "eq": "eq. "}[kind] + number


def _text(name: str) -> str:
    return (_TEXTS / name).read_text(encoding="utf-8")
