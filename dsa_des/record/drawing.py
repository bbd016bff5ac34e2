"""Figures: how they are drawn, and what they are as values that notebooks show."""

import io
import math
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from dsa_des.errors import UsageError
from dsa_des.files.output_file import write_file
from dsa_des.text.safe_text import escape_unprintable, shorten

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PictureFile:
    """A figure that was drawn earlier, read back from its file.

    Parameters
    ----------
    name : str
        For example ``plan``.
    png : bytes
    """

    name: str
    png: bytes = field(repr=False)

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the figure as a PNG file.

        Raises
        ------
        UsageError
            If the name asks for something else.
        OSError
            If it cannot be written.
        """
        _save_picture(self.name, self.png, path)


def _save_picture(
    name: str,
    png: bytes,
    path: str | os.PathLike[str],
    other: Callable[[str], bytes] | None = None,
) -> None:
    """Write a picture in the format that the ending of the file's name says."""
    kind = Path(path).suffix.lower().removeprefix(".")
    allowed = ["png", *(("svg", "pdf") if other is not None else ())]
    if kind not in allowed:
        also = "" if other is not None else " (a figure of a run in memory is written as .svg too)"
        endings = ", ".join(f".{ending}" for ending in allowed)
        raise UsageError(f"figure {name}: {path}: a name that ends in {endings} is needed{also}")
    write_file(Path(path), png if other is None or kind == "png" else other(kind))


@cache
def _drawn_figure_class() -> Any:
    """Return a subclass of matplotlib's figure that knows its name and, once drawn, its PNG."""
    import matplotlib
    from matplotlib.figure import Figure

    class DrawnFigure(Figure):
        """A matplotlib figure that a notebook shows and `save` writes as .png, .svg or .pdf."""

        name, png = "", b""

        def _repr_png_(self) -> bytes:
            return self.png

        def save(self, path: str | os.PathLike[str]) -> None:
            """Write the figure in the format that the name asks for; see `PictureFile.save`."""
            _save_picture(self.name, self.png, path, self._bytes_in_format)

        def _bytes_in_format(self, kind: str) -> bytes:
            content = io.BytesIO()
            date = {"Date": None} if kind == "svg" else {"CreationDate": None}
            with matplotlib.rc_context({"svg.hashsalt": self.name}):
                self.savefig(content, format=kind, metadata=date)
            return content.getvalue()

    return DrawnFigure


_kept: ContextVar[dict[str, Any] | None] = ContextVar("kept figures", default=None)


@contextmanager
def collect_drawn_figures() -> Iterator[dict[str, Any]]:
    """Collect figures drawn to files in the context: yields file stem → matplotlib figure."""
    figures: dict[str, Any] = {}
    token = _kept.set(figures)
    try:
        yield figures
    finally:
        _kept.reset(token)


def pictures_in(folder: Path) -> dict[str, PictureFile]:
    """Return the PNG figures in a folder by name, sorted by name."""
    files = sorted(folder.glob("*.png"))
    return {file.stem: PictureFile(file.stem, file.read_bytes()) for file in files}


DPI = 110
#: Longest name and longest line in a figure.
MOST_OF_A_LABEL = 32
_MOST_OF_A_LINE = 200
_MOST_LINES = 60


@contextmanager
def draw_to_png(
    width_in: float, height_in: float, path: Path | BinaryIO, dpi: int = DPI
) -> Iterator[Any]:
    """Yield an empty figure, and write it as PNG to a file or stream when the context ends.

    The file is there as a whole or not at all. Neither the user's matplotlibrc nor the date goes
    into it.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with matplotlib.rc_context(), warnings.catch_warnings():
        # Names may hold letters that the font lacks, and be too long for their space.
        warnings.filterwarnings("ignore", message="(?s)Glyph .* missing from")
        warnings.filterwarnings("ignore", message=".* layout not applied")
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {
                "font.size": 9,
                "axes.titlesize": 10,
                # A tick says its value: no offset to add, no power of ten to multiply by.
                "axes.formatter.useoffset": False,
                "axes.formatter.limits": (-7, 9),
                "axes.spines.top": False,
                "axes.spines.right": False,
                "legend.fontsize": 8,
                "legend.framealpha": 0.9,
                "text.parse_math": False,  # a dollar sign in a name is a dollar sign
            }
        )
        figure = _drawn_figure_class()(figsize=(width_in, height_in), dpi=dpi)
        canvas = FigureCanvasAgg(figure)
        yield figure
        _shorten_and_escape_texts(figure)
        content = io.BytesIO()
        canvas.print_png(content, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
        if isinstance(path, Path):
            write_file(path, content.getvalue())
        else:
            path.write(content.getvalue())
        if (kept := _kept.get()) is not None and (name := Path(getattr(path, "name", "")).stem):
            figure.name, figure.png = name, content.getvalue()
            kept[name] = figure


def figure_text(name: object, most: int = MOST_OF_A_LABEL) -> str:
    """Return a name as text for a figure: printable, short, and not hidden by legends.

    Matplotlib leaves legend entries out that begin with ``_``; a blank before it helps.
    """
    text = shorten(name, most)
    return f" {text}" if text.startswith("_") else text


def set_plain_log_ticks(axis: Any) -> None:
    """Set a log axis's ticks to plain numbers, such as 1, 2, 5 per decade, not powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = axis.get_view_interval()
    decades = math.log10(high / low)
    steps: tuple[float, ...] = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    if decades < 0.7:
        steps = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    axis.set_major_locator(LogLocator(subs=steps, numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _plain_number(value)))
    axis.set_minor_locator(NullLocator())


def _plain_number(value: float) -> str:
    return f"{value:.0f}" if 1000 <= value < 1e6 else f"{value:.4g}"


def fit_axes_to_texts(figure: "Figure") -> None:
    """Shorten and escape all texts of a figure, then fit its axes to them."""
    _shorten_and_escape_texts(figure)
    figure.tight_layout()


def _shorten_and_escape_texts(figure: "Figure") -> None:
    """Shorten and escape all texts in a figure; show log axes' numbers without math notation."""
    from matplotlib.text import Text
    from matplotlib.ticker import LogFormatter, LogFormatterMathtext

    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
                axis.set_major_formatter(LogFormatter())
            if isinstance(axis.get_minor_formatter(), LogFormatterMathtext):
                axis.set_minor_formatter(LogFormatter(minor_thresholds=(1, 0.4)))
    for text in figure.findobj(Text):
        text.set_parse_math(False)
        shown = text.get_text()
        if not shown.isprintable() or len(shown) > _MOST_OF_A_LINE:
            text.set_text(_shorten(shown))


def _shorten(text: str) -> str:
    lines = [shorten(line, _MOST_OF_A_LINE) for line in text.split("\n")]
    if len(lines) > _MOST_LINES:
        lines = [*lines[: _MOST_LINES - 1], "…"]
    return escape_unprintable("\n".join(lines), lines=True)
