"""``dsa-des reproduce``: make items, and write rows, figures, data and the page about them."""

import csv
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from components.thesis.rows import DIFFERS, Columns, Made, Row, tally_sentence
from components.thesis.table import ITEMS, Item, select_items
from dsa_des.errors import BlockFailure, OutputError, SceneError, UsageError
from dsa_des.files.output_file import check_file_writable, write_file
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import user_path
from dsa_des.record.run_folder import write_run_json
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say, say_json

Results = list[tuple[Item, Made]]

_FOLDERS = ("figures", "data")
_PAGE = Path(__file__).with_name("page.md")


def reproduce_items(
    items: tuple[str, ...], out: str | None, as_json: bool, page: str | None
) -> None:
    """Make the items into a folder and print their rows; exit code 1 if one cannot be computed."""
    wanted = select_items(items)
    if page is not None and len(wanted) < len(ITEMS):
        raise UsageError("--page shows all items: leave the ITEMs out")
    shown_on = None if page is None else user_path(page, "--page")
    if shown_on is not None:
        check_file_writable(shown_on, "--page")
    target = OutputFolder.from_option(out, Path("runs"), "thesis")
    started = time.perf_counter()
    with target.write_then_rename() as folder:
        results, failures = make_items(wanted)
        write_results(folder, results, failures, time.perf_counter() - started)
    if shown_on is not None and not failures:
        try:
            _write_page(shown_on, results, target.path)
        except OSError as error:
            raise OutputError(f"--page {page}: cannot be written: {error.strerror}") from error
    rows = [row.as_dict(item.name) for item, made in results for row in made.rows]
    if as_json:
        say_json(rows)
    else:
        _print_results(results, target.path)
    for failure in failures:
        say(f"error: {failure}", err=True)
    if failures:
        sys.exit(1)


def make_items(wanted: list[Item]) -> tuple[Results, list[str]]:
    """Compute the items; return those that succeeded with results, and a sentence per failure."""
    results: Results = []
    failures = []
    for item in wanted:
        try:
            made = item.make()
        except (ArithmeticError, BlockFailure, KeyError, OSError, SceneError, ValueError) as error:
            failures.append(f"{item.name} could not be computed: {error}")
            continue
        results.append((item, made))
        failures += [
            f"{item.name} could not be computed: {row.quantity} is {row.ours}"
            for row in made.rows
            if not row.has_value
        ]
    return results, failures


def write_results(folder: Path, results: Results, failures: list[str], wall_s: float) -> None:
    """Write the figures, data files, table of rows, page and run.json of results into a folder."""
    for name in _FOLDERS:
        (folder / name).mkdir()
    for _, made in results:
        for picture in made.pictures:
            picture.draw(folder / "figures" / f"{picture.name}.png")
        for name, columns in made.data.items():
            _write_csv(folder / "data" / f"{name}.csv", columns)
    rows = [row.as_dict(item.name) for item, made in results for row in made.rows]
    _write_rows_csv(folder / "rows.csv", rows)
    (folder / "thesis.md").write_text(markdown_page(results, "figures"), encoding="utf-8")
    content: dict[str, Any] = {
        "title": "The thesis, figure by figure",
        "rows": rows,
        "failures": failures,
        "timings": {"wall_s": wall_s},
    }
    write_run_json(folder, content)


def _write_page(page: Path, results: Results, source: Path) -> None:
    """Write the page with its figures in a folder of its own beside it."""
    images = page.parent / "images" / page.stem
    images.mkdir(parents=True, exist_ok=True)
    for _, made in results:
        for picture in made.pictures:
            figure = source / "figures" / f"{picture.name}.png"
            write_file(images / figure.name, figure.read_bytes())
    write_file(page, markdown_page(results, f"images/{page.stem}").encode())


def _print_results(results: Results, target: Path) -> None:
    from rich.table import Table

    console = terminal.console(160)
    shown = Table("item", "quantity", box=None, pad_edge=False)
    for name in ("printed", "ours", "difference"):
        shown.add_column(name, justify="right", no_wrap=True)
    shown.add_column("unit", no_wrap=True)
    shown.add_column("verdict")
    for item, made in results:
        for row in made.rows:
            shown.add_row(
                item.name,
                row.quantity,
                row.printed or "",
                four_digit_text(row.ours),
                "" if row.difference is None else four_digit_text(row.difference, sign=True),
                row.unit,
                row.verdict_text,
            )
    console.print(shown)
    console.print()
    rows = [row for _, made in results for row in made.rows]
    console.print(tally_sentence(rows), highlight=False, soft_wrap=True)
    console.print(f"{target}: figures, data, rows.csv, thesis.md", highlight=False, soft_wrap=True)


def _write_csv(path: Path, columns: Columns) -> None:
    """Write columns of equal length; numbers with nine significant digits."""
    lines = [[_csv_text(value) for value in line] for line in zip(*columns.values(), strict=True)]
    _write_lines(path, [list(columns), *lines])


def _write_rows_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write compared rows as they are in JSON; what does not exist is an empty field."""
    names = list(rows[0]) if rows else []
    _write_lines(path, [names, *([_csv_text(row[name]) for name in names] for row in rows)])


def _csv_text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    return f"{float(value):.9g}"


def _write_lines(path: Path, lines: Sequence[Sequence[str]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)


def four_digit_text(value: float, sign: bool = False) -> str:
    """Return a number with four significant digits."""
    text = f"{value:+.4g}" if sign else f"{value:.4g}"
    if "e" in text and 1e-4 < abs(value) < 1e9:
        return f"{value:+.0f}" if sign else f"{value:.0f}"
    return text


def markdown_page(results: Results, images: str) -> str:
    """Return the Markdown page of all results; `images` is the figures' folder as seen from it."""
    rows = [row for _, made in results for row in made.rows]
    head = _PAGE.read_text(encoding="utf-8").format(tally=tally_sentence(rows, "*"))
    return "\n".join([head, *(_markdown_section(item, made, images) for item, made in results)])


def _markdown_section(item: Item, made: Made, images: str) -> str:
    lines = [f"## {item.title} ({_item_label(item)})", ""]
    derived = any(row.derived for row in made.rows)
    extra = (" derived |", " ---: |") if derived else ("", "")
    lines += [f"| quantity | printed |{extra[0]} ours | difference | unit | verdict | from |"]
    lines += [f"| --- | ---: |{extra[1]} ---: | ---: | --- | --- | --- |"]
    said = letters_of_repeated_texts(made.rows)
    lines += [markdown_table_row(row, derived, said) for row in made.rows]
    lines.append("")
    if said:
        lines += ["  \n".join(f"{letter} {text}" for text, letter in said.items()), ""]
    if made.note:
        lines += [made.note, ""]
    for picture in made.pictures:
        lines += [f"![{item.title}]({images}/{picture.name}.png)", "", picture.caption, ""]
    return "\n".join(lines)


def letters_of_repeated_texts(rows: Sequence[Row]) -> dict[str, str]:
    """Return footnotes' letters in brackets, by text, for texts that several rows would repeat."""
    said: Counter[str] = Counter()
    for row in rows:
        said.update([*row.source_sentences, *([row.because] if row.verdict == DIFFERS else [])])
    repeated = [text for text, number in said.items() if number > 1 and len(text.split()) > 2]
    return {text: f"({_footnote_letters(number)})" for number, text in enumerate(repeated)}


def _footnote_letters(number: int) -> str:
    before, last = divmod(number, 26)
    return (_footnote_letters(before - 1) if before else "") + chr(ord("a") + last)


def markdown_table_row(row: Row, derived: bool, said: Mapping[str, str]) -> str:
    """Return a row as a Markdown table line, with or without the column of derived numbers.

    What is among `said` is replaced by its letter.
    """
    difference = "" if row.difference is None else four_digit_text(row.difference, sign=True)
    verdict = row.verdict
    if verdict == DIFFERS:
        verdict += f" {said.get(row.because, row.because)}"
    source = " ".join(said.get(part, part) for part in row.source_sentences)
    cells = (row.quantity, row.printed or "", *((row.derived,) if derived else ()),
             four_digit_text(row.ours), difference, row.unit, verdict, source)  # fmt: skip
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _item_label(item: Item) -> str:
    kind, _, number = item.name.partition("-")
    return {"fig": "Fig. ", "table": "Table ", "sec": "§", "eq": "eq. "}[kind] + number
