"""The common parts of the figures of this package: panels, colours, a grid."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from components.sensor import marks
from dsa_des.record.drawing import drawing

#: Half a page.
WIDTH_IN, HEIGHT_IN = 6.6, 3.9

#: By kind, as in every other figure.
RADAR, EO, IR, FUSION = (mark.colour for mark in (marks.RADAR, marks.EO, marks.IR, marks.FUSION))
#: For whatever is no kind of sensor.
BLUE, ORANGE, RED, GREEN, PINK, SKY = (
    "#0072B2", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#56B4E9",
)  # fmt: skip
GREY = "#777777"


def legend_below(axes: Any, columns: int = 4, *, without: str = "") -> None:
    """Put the legend of one of a figure's axes below all of them; `without` names an entry."""
    entries = zip(*axes.get_legend_handles_labels(), strict=True)
    shown = [entry for entry in entries if entry[1] != without]
    axes.figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=columns)


@contextmanager
def panels(
    path: Path,
    rows: int = 1,
    columns: int = 1,
    *,
    width_in: float = WIDTH_IN,
    height_in: float = HEIGHT_IN,
    **shared: Any,
) -> Iterator[list[Any]]:
    """Give the axes of a figure, row by row, and write it as PNG when the block is done.

    Parameters
    ----------
    path : Path
    rows, columns : int
    width_in, height_in : float
    shared
        ``sharex``, ``sharey`` and other options of ``Figure.subplots``.
    """
    with drawing(width_in, height_in, path) as figure:
        figure.set_layout_engine("constrained")
        axes = list(figure.subplots(rows, columns, squeeze=False, **shared).flat)
        for one in axes:
            one.grid(color="#DDDDDD", linewidth=0.5)
            one.set_axisbelow(True)
        yield axes
