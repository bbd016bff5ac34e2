"""Figures without a window system, the same bytes on every drawing."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

DPI = 110


@contextmanager
def drawing(width_in: float, height_in: float, path: Path | BinaryIO) -> Iterator[Any]:
    """Give an empty figure and write it as PNG, to a file or a stream, when the block is done.

    Neither the user's matplotlibrc nor the date goes into it.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {
                "font.size": 9,
                "axes.titlesize": 10,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "legend.fontsize": 8,
                "legend.framealpha": 0.9,
                "text.parse_math": False,  # a dollar sign in a name is a dollar sign
            }
        )
        figure = Figure(figsize=(width_in, height_in), dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        target = str(path) if isinstance(path, Path) else path
        with warnings.catch_warnings():
            # Names may hold letters that the font lacks; they are drawn as boxes. Names may be
            # longer than their place; they are cut off.
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            warnings.filterwarnings("ignore", message="Tight layout not applied")
            yield figure
            canvas.print_png(target, metadata={"Software": None}, pil_kwargs={"compress_level": 4})
