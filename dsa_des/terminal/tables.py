"""Tables that keep their column names on a narrow terminal.

A table that fits is printed as it is. One that does not loses its group column first, whose values
become lines above their rows; then headings are folded where their words end, then long values;
and where not even that is enough, each row is a list of ``heading: value``.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import zip_longest
from typing import Any

from dsa_des.text.safe_text import escape_unprintable

_GAP = 2
#: Narrower than this no value is folded.
_LEAST = 8
#: What is not folded: a word with the signs behind it, a number with its point and its asterisk.
_PIECES = re.compile(r"(?:\.\d|-\d| \*|[^\s_./\]-])*(?:(?!\.\d|-\d| \*)[\s_./\]-])*")

Row = Sequence[str]
_Layout = tuple[list[int], int]


def print_table(
    console: Any,
    title: str,
    headings: Sequence[str],
    rows: Sequence[Row],
    *,
    group: int | None = None,
    below: int | None = None,
    right: Collection[int] = (),
    notes: Mapping[str, str] | None = None,
) -> None:
    """Print a table, no wider than the console; a column without any text is left out.

    Values of the column `group` may become lines above the rows that share one, with its text of
    `notes` behind. Without groups, the column `below` may stand in lines below its rows, and the
    columns `right` are flush right.
    """
    names = [escape_unprintable(heading) for heading in headings]
    cells = [[escape_unprintable(cell) for cell in row] for row in rows]
    used = [k for k in range(len(names)) if not cells or any(row[k] for row in cells)]
    names, cells = [names[k] for k in used], [[row[k] for k in used] for row in cells]
    group = used.index(group) if group in used and cells else None
    right = [used.index(k) for k in right if k in used]
    _print_folded(console, escape_unprintable(title), "italic")
    if group is None or _total_width(_natural_widths(names, cells)) <= console.width:
        notes_below = [""] * len(cells)
        if below in used and _total_width(_natural_widths(names, cells)) > console.width:
            at = used.index(below)
            notes_below = [row[at] for row in cells]
            names = [*names[:at], *names[at + 1 :]]
            cells = [[*row[:at], *row[at + 1 :]] for row in cells]
            right = [k - (k > at) for k in right if k != at]
        _print_rows(console, names, cells, right, notes_below)
        return
    kept = [k for k in range(len(names)) if k != group]
    together: dict[str, list[list[str]]] = {}
    for row in cells:
        together.setdefault(row[group], []).append([row[k] for k in kept])
    short = [names[k] for k in kept]
    for name, some in together.items():
        note = (notes or {}).get(name, "")
        _print(console)
        _print_folded(console, f"{name}: {escape_unprintable(note)}" if note else name, "bold cyan")
        used = [k for k in range(len(short)) if any(row[k] for row in some)]
        shown = [[row[k] for k in used] for row in some]
        _print_rows(console, [short[k] for k in used], shown)


def _print_rows(
    console: Any,
    names: list[str],
    cells: list[list[str]],
    right: Collection[int] = (),
    below: Sequence[str] = (),
) -> None:
    layout = _column_widths(names, cells, console.width)
    if not layout[0]:
        _print_lists(console, names, cells)
        return
    _print_line(console, names, layout, right, "bold")
    for row, note in zip_longest(cells, below, fillvalue=""):
        _print_line(console, row, layout, right)
        for line in fold(note, console.width - 4) if note else ():
            _print(console, f"    {line}")


def _print_line(
    console: Any, texts: Sequence[str], layout: _Layout, right: Collection[int], style: str = ""
) -> None:
    widths, gap = layout
    folded = [fold(text, width) for text, width in zip(texts, widths, strict=True)]
    for number in range(max(map(len, folded), default=0)):
        parts = [
            _pad(lines[number] if number < len(lines) else "", width, k in right)
            for k, (lines, width) in enumerate(zip(folded, widths, strict=True))
        ]
        _print(console, (" " * gap).join(parts).rstrip(), style)


def _print_lists(console: Any, names: list[str], cells: list[list[str]]) -> None:
    """Print each row as lines ``name: value``, without empty values."""
    for number, row in enumerate(cells):
        if number:
            _print(console)
        for name, cell in zip(names, row, strict=True):
            if cell:
                _print_folded(console, f"{name}: {cell}")


def _print_folded(console: Any, text: str, style: str = "") -> None:
    for line in fold(text, console.width):
        _print(console, line, style)


def _print(console: Any, text: str = "", style: str = "") -> None:
    from rich.text import Text

    console.print(Text(text, style=style), soft_wrap=True, highlight=False)


def fold(text: str, width: int) -> list[str]:
    """Return a text as lines of at most `width` characters, broken between words where possible."""
    if _visible_length(text) <= width:
        return [text]
    lines = [""]
    for piece in filter(None, _PIECES.findall(text)):
        if _visible_length(lines[-1] + piece.rstrip()) <= width:
            lines[-1] += piece
            continue
        if lines[-1]:
            lines.append("")
        while _visible_length(piece.rstrip()) > width:
            cut = max(1, next((k for k in range(1,
            len(piece)) if _visible_length(piece[: k + 1]) > width),
                              len(piece)))  # fmt: skip
            lines[-1] = piece[:cut]
            lines.append("")
            piece = piece[cut:]
        lines[-1] = piece
    return [line.rstrip() for line in lines if line.strip()] or [""]


def _visible_length(text: str) -> int:
    from rich.cells import cell_len

    return cell_len(text)


def _pad(text: str, width: int, right: bool) -> str:
    blanks = " " * (width - _visible_length(text))
    return blanks + text if right else text + blanks


def _total_width(widths: Sequence[int], gap: int = _GAP) -> int:
    return sum(widths) + gap * (len(widths) - 1)


def _natural_widths(names: list[str], cells: list[list[str]]) -> list[int]:
    every = [names, *cells]
    return [max(_visible_length(row[k]) for row in every) for k in range(len(names))]


def _column_widths(names: list[str], cells: list[list[str]], most: int) -> _Layout:
    """Return the widths of columns, and of their gap, that fit into `most`; none if none fit."""
    widths = _natural_widths(names, cells)
    of_cells = [
        max((_visible_length(row[k]) for row in cells), default=0) for k in range(len(names))
    ]
    of_words = [
        max((_visible_length(piece.rstrip()) for piece in _PIECES.findall(name)), default=0)
        for name in names
    ]
    least = [max(one, other) for one, other in zip(of_cells, of_words, strict=True)]
    narrow = [max(min(one, _LEAST), other) for one, other in zip(of_cells, of_words, strict=True)]
    # The first column names the row: its words are cut last, where all others are not enough.
    words = [_visible_length(word) for row in cells if row for word in row[0].split()]
    named = [max([of_words[0], *words]), *narrow[1:]] if narrow else []
    for floors, gap in ((least, _GAP), (least, 1), (named, 1), (narrow, 1)):
        while _total_width(widths, gap) > most:
            spare = [width - floor for width, floor in zip(widths, floors, strict=True)]
            if max(spare, default=0) <= 0:
                break
            # The widest of those that can give: headings get as many lines as they need.
            at = max(range(len(widths)), key=lambda k: (spare[k] > 0, widths[k]))
            widths[at] -= 1
        if _total_width(widths, gap) <= most:
            return widths, gap
    return [], 1
