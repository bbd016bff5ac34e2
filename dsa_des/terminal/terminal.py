"""The one place that prints: everything shown goes through here and is printable.

No other file prints, echoes, makes a console or writes to the standard streams; a test sees to
that. Rich is imported only when it is asked for.
"""

import io
import os
import sys
from collections.abc import Callable
from typing import Any

import click

from dsa_des.text.plain_json import json_text
from dsa_des.text.safe_text import escape_unprintable


def say(line: object = "", *, err: bool = False) -> None:
    """Print one line, on standard error with `err`, with control characters escaped."""
    _write(escape_unprintable(line), err)


def say_lines(text: str, *, err: bool = False) -> None:
    """Print text of several lines; control characters other than line breaks are escaped."""
    _write(escape_unprintable(text, lines=True), err)


def say_json(value: Any) -> None:
    """Print a value as JSON in ASCII only; NaN and infinities become null."""
    _write(json_text(value, indent=2, ensure_ascii=True), False)


def _write(text: str, err: bool) -> None:
    stream = sys.stderr if err else sys.stdout
    encoding = getattr(stream, "encoding", None) or "utf-8"
    # A stream may know fewer letters than Unicode has.
    click.echo(text.encode(encoding, "backslashreplace").decode(encoding), err=err)


def console(width: int | None = None, *, err: bool = False) -> Any:
    """Return a ``rich.console.Console`` that prints no control character and reads no markup.

    Lines have `width` letters where the stream is no terminal and ``COLUMNS`` is not set.
    """
    from dsa_des.terminal.safe_console import SafeConsole

    result = SafeConsole(stderr=err)
    known = width is None or result.is_terminal or os.environ.get("COLUMNS", "").isdecimal()
    return result if known else SafeConsole(stderr=err, width=width)


def capture_text(show: Callable[[Any], None], width: int = 110) -> str:
    """Return, as plain text, what a function prints on a console."""
    from dsa_des.terminal.safe_console import SafeConsole

    file = io.StringIO()
    show(SafeConsole(file=file, width=width, color_system=None, force_jupyter=False))
    return "\n".join(line.rstrip() for line in file.getvalue().splitlines())


def capture_html(show: Callable[[Any], None]) -> str:
    """Return, as HTML for a notebook, what a function prints on a console."""
    from dsa_des.terminal.safe_console import SafeConsole

    # In a notebook Rich would show each line by itself, beside what is returned.
    console = SafeConsole(file=io.StringIO(), record=True, width=110, force_jupyter=False)
    show(console)
    style = "font-family:monospace;line-height:1.25;white-space:pre;overflow-x:auto"
    plain: str = console.export_html(
        inline_styles=True, code_format=f'<pre style="{style}">{{code}}</pre>'
    )
    return plain


def progress_bar(text: str) -> Any:
    """Return a ``rich.progress.Progress`` on standard error, gone when it is done.

    Behind the bar stand simulated ``"seconds"``, or the task's field ``"text"``.
    """
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

    behind: dict[str, list[ProgressColumn]] = {
        "seconds": [
            TextColumn("{task.completed:.0f} of {task.total:.0f} s", markup=False),
            TimeRemainingColumn(),
        ],
        "text": [TextColumn("{task.fields[text]}", markup=False)],
    }
    columns = [TextColumn("{task.description}", markup=False), BarColumn(), *behind[text]]
    return Progress(*columns, console=console(err=True), transient=True)
