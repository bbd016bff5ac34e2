"""The products of an item: rows, data, and figures that are drawn when they are asked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from components.thesis.row import Row

Columns = Mapping[str, Sequence[Any] | Any]


@dataclass(frozen=True)
class Picture:
    """One figure.

    Parameters
    ----------
    name : str
        Of the file, without ending.
    caption : str
        What it shows.
    draw : callable
        Called with the path of the PNG to write.
    """

    name: str
    caption: str
    draw: Callable[[Path], None]


@dataclass(frozen=True)
class Made:
    """What became of one item.

    Parameters
    ----------
    rows : list of Row
    pictures : list of Picture
    data : dict
        File name without ending → columns of equal length, written as CSV.
    note : str
        What a reader of the rows should know.
    """

    rows: list[Row]
    pictures: list[Picture] = field(default_factory=list)
    data: dict[str, Columns] = field(default_factory=dict)
    note: str = ""
