"""``dsa-des reproduce``: make items, write figures and data, compare with the thesis."""

import sys
import time
from pathlib import Path
from typing import Any

from components.thesis.document import markdown, short
from components.thesis.files import write_csv, write_rows
from components.thesis.made import Made
from components.thesis.registry import ITEMS, Item, chosen
from components.thesis.tally import tally
from dsa_des.errors import BlockFailure, OutputError, SceneError, UsageError
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import named
from dsa_des.record.run_folder import write_run_json
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say, say_json

Results = list[tuple[Item, Made]]

_FOLDERS = ("figures", "data")


def reproduce_items(
    items: tuple[str, ...], out: str | None, as_json: bool, page: str | None
) -> None:
    """Make the items into a folder and print their rows; exit code 1 if one cannot be computed."""
    wanted = chosen(items)
    if page is not None and len(wanted) < len(ITEMS):
        raise UsageError("--page shows all items: leave the ITEMs out")
    shown_on = None if page is None else named(page, "--page")
    if shown_on is not None:
        check_file(shown_on, "--page")
    target = OutputFolder.chosen(out, Path("runs"), "thesis")
    started = time.perf_counter()
    with target.writing() as folder:
        results, failures = make(wanted)
        write(folder, results, failures, time.perf_counter() - started)
    if shown_on is not None and not failures:
        try:
            _write_page(shown_on, results, target.path)
        except OSError as error:
            raise OutputError(f"--page {page}: cannot be written: {error.strerror}") from error
    rows = [row.as_dict(item.name) for item, made in results for row in made.rows]
    if as_json:
        say_json(rows)
    else:
        _show(results, target.path)
    for failure in failures:
        say(f"error: {failure}", err=True)
    if failures:
        sys.exit(1)


def make(wanted: list[Item]) -> tuple[Results, list[str]]:
    """Return what became of each item, and what could not be computed."""
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
            if not row.computed
        ]
    return results, failures


def write(folder: Path, results: Results, failures: list[str], wall_s: float) -> None:
    """Write figures, data, rows and the page into a folder."""
    for name in _FOLDERS:
        (folder / name).mkdir()
    for _, made in results:
        for picture in made.pictures:
            picture.draw(folder / "figures" / f"{picture.name}.png")
        for name, columns in made.data.items():
            write_csv(folder / "data" / f"{name}.csv", columns)
    rows = [row.as_dict(item.name) for item, made in results for row in made.rows]
    write_rows(folder / "rows.csv", rows)
    (folder / "thesis.md").write_text(markdown(results, "figures"), encoding="utf-8")
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
    write_file(page, markdown(results, f"images/{page.stem}").encode())


def _show(results: Results, target: Path) -> None:
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
                short(row.ours),
                "" if row.difference is None else short(row.difference, sign=True),
                row.unit,
                row.said,
            )
    console.print(shown)
    console.print()
    rows = [row for _, made in results for row in made.rows]
    console.print(tally(rows), highlight=False, soft_wrap=True)
    console.print(f"{target}: figures, data, rows.csv, thesis.md", highlight=False, soft_wrap=True)
