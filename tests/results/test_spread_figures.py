"""Histograms and cumulative shares in studies: drawn alike each time, refused with reasons."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dsa_des.cli import main
from dsa_des.record.drawing import draw_to_png, fit_axes_to_texts
from dsa_des.results.curves import _bin_edges, _shift_series, draw_cdf, draw_polar
from dsa_des.results.record import NUMBER, Result
from dsa_des.results.statistics import Estimate
from dsa_des.results.summary import Line

STUDY = """
scene = "small.toml"
replicas = 4
metrics = ["first_detection"]
[axes]
blocks.ir.reach_km = [0.1, 4.8, 9]
"""


def study(figure: str, *words: str, code: int = 0) -> str:
    Path("study.toml").write_text(f"{STUDY}\n[[figures]]\n{figure}\n")
    result = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", *words])
    assert result.exit_code == code, result.output
    return " ".join(result.output.split())


@pytest.mark.parametrize("kind", ["histogram", "cdf"])
def test_a_spread_is_drawn_to_the_same_bytes(small: Path, kind: str) -> None:
    drawn = []
    for out in ("a", "b"):
        study(f'kind = "{kind}"\nmetric = "first_detection_range_m.ir"', "--out", out)
        drawn.append(Path(out, f"figure-01-{kind}.png").read_bytes())
    assert drawn[0] == drawn[1] and drawn[0].startswith(b"\x89PNG")


def figure_of(draw, *arguments):
    """The figure that is drawn, before it is a picture."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            FigureCanvasAgg, "print_png", lambda self, *_, **__: found.append(self.figure)
        )
        draw(io.BytesIO(), *arguments)
    return found[0]


def test_of_curves_that_are_alike_all_are_seen():
    alike = [(name, np.array([1.0, 2.0, 4.0])) for name in "abc"]
    (axes,) = figure_of(draw_cdf, alike, "range_m", "t", None).axes
    widths = [line.get_linewidth() for line in axes.lines]
    assert widths == sorted(widths, reverse=True) and np.diff(widths).max() <= -1.0


def test_a_polar_figure_says_what_is_shaded():
    result = Result("range_m", NUMBER, "a distance")

    def lines(low):
        found = Estimate(2.0, low, 3.0, 4, False)
        return [Line((angle,), result, found, 0, None) for angle in (0.0, 90.0, 180.0)]

    for low, said in ((1.0, True), (float("nan"), False)):
        figure = figure_of(
            draw_polar, ["bearing_deg"], lines(low), "range_m", "bearing_deg", "t", 0.9
        )
        assert ("shaded: 90 % interval" in figure.axes[0].get_title(loc="left")) == said


@pytest.mark.parametrize(
    ("figure", "said"),
    [
        ('kind = "histogramm"\nmetric = "detected.ir"', "did you mean 'histogram'?"),
        ('kind = "cdf"\nmetric = "detected.ir"', "is an event, 0 or 1: a cdf shows how numbers"),
        ('kind = "cdf"\nmetric = "first_detection_range_m.irr"',
         "did you mean 'first_detection_range_m.ir'?"),
        ('kind = "histogram"', "needs a metric"),
        ('kind = "histogram"\nmetric = "first_detection_range_m.ir"\nbins = 4',
         "unknown key of a histogram figure"),
        ('kind = "cdf"\nmetric = "first_detection_range_m.ir"\naxis = "ir.reach"',
         "the study has no such axis"),
    ],
)  # fmt: skip
def test_what_a_spread_cannot_show_is_said_before_anything_runs(
    small: Path, figure: str, said: str
) -> None:
    assert said in study(figure, "--out", "out", code=2)
    assert not Path("out").exists()


def test_bins_cover_every_value() -> None:
    values = np.array([3.0, -1.0, 8.0, 8.0])
    edges = _bin_edges(values, 4)
    assert np.histogram(values, edges)[0].sum() == 4
    assert np.histogram(np.full(3, 7.0), _bin_edges(np.full(3, 7.0), 3))[0].sum() == 3
    assert len(_bin_edges(np.empty(0), 0)) == 2
    assert len(_bin_edges(np.linspace(0, 1, 10**6), 10**6)) == 41


def test_without_figures_nothing_of_matplotlib_is_imported(small: Path) -> None:
    """A run and a study say so; both leave the same tables."""
    Path("study.toml").write_text(STUDY + '[[figures]]\nmetric = "detected.ir"\n')
    code = """
import sys
from dsa_des.cli import main
for words in sys.argv[1:]:
    try:
        main([*words.split(), "--no-figures"])
    except SystemExit as end:
        assert end.code in (0, None), (words, end.code)
sys.exit(any(name.partition(".")[0] == "matplotlib" for name in sys.modules))
"""
    words = "run small.toml --out r", "study study.toml --workers 1 --out s", "study show s"
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True)
    assert done.returncode == 0, (done.stdout, done.stderr)
    assert not [*Path("r").glob("*.png"), *Path("s").glob("*.png")]
    assert Path("r/detections.parquet").exists() and Path("s/summary.parquet").exists()


def test_no_tick_has_an_offset_and_intervals_of_two_series_stand_side_by_side(tmp_path):
    drawn = io.BytesIO()
    with draw_to_png(4.0, 3.0, drawn) as figure:
        axes = figure.subplots()
        first, second = (axes.errorbar([1, 2], [0.02499, 0.025], yerr=1e-5) for _ in range(2))
        _shift_series(axes, first.get_children(), 0, 2)
        _shift_series(axes, second.get_children(), 1, 2)
        figure.canvas.draw()
        assert axes.yaxis.get_offset_text().get_text() == ""
        assert any(one.get_text().startswith("0.02499") for one in axes.get_yticklabels())
        low, high = axes.get_ylim()
        assert low < 0.02498 and high > 0.02501
        apart_px = 5.0 / 72 * figure.dpi
        for part in range(len(first.get_children())):  # the line, its caps and its bars
            places = [
                bars.get_children()[part].get_transform().transform((1.0, 0.025))
                for bars in (first, second)
            ]
            assert places[1] - places[0] == pytest.approx(np.array([apart_px, 0.0]), abs=0.01)


def test_ticks_of_a_logarithmic_axis_are_plain_numbers_and_of_another_are_left_alone():
    figure = Figure()
    axes = figure.add_subplot()
    axes.plot([2.0, 8.0], [1.0, 2.0])
    axes.set_xscale("log")
    plain = axes.yaxis.get_major_formatter(), axes.yaxis.get_minor_formatter()
    fit_axes_to_texts(figure)
    shown = [text.get_text() for text in axes.get_xticklabels(which="both")]
    assert {"2", "3", "6"} <= set(shown) and not any("$" in text for text in shown)
    assert plain == (axes.yaxis.get_major_formatter(), axes.yaxis.get_minor_formatter())
