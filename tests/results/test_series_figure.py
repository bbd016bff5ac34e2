"""Results over a number: which belong together, what bounds their mean, and the figure."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import chi2

from dsa_des.cli import main
from dsa_des.results import curves
from dsa_des.results.curves import draw_numbered_results
from dsa_des.results.record import NUMBER, Result
from dsa_des.results.statistics import Estimate
from dsa_des.results.summary import Line, numbers_by_series_result
from dsa_des.results.tables import Tables


def test_a_series_is_what_bears_a_number_in_its_order():
    names = ["a.t.10", "a.t.9", "a.t.x", "b.t.1", "a.t", "a.tt.3"]
    assert list(numbers_by_series_result("a.t", names).items()) == [
        ("a.t.9", 9.0),
        ("a.t.10", 10.0),
    ]


class Axes:
    """Notes what is drawn between."""

    def fill_between(self, x, low, high, **style):
        self.low, self.high = low, high

    def axhline(self, y, **style):
        self.middle = y


def test_bounds_are_those_of_the_mean_of_as_many_runs():
    """Of one run and of 60: quantiles of chi-square with 6 and with 360 degrees."""
    lines = [Line((), None, Estimate(6.0, 5.0, 7.0, n, False), 0, None) for n in (1, 60, 0)]
    axes = Axes()
    curves._draw_chi_square_bounds(axes, [1.0, 2.0, 3.0], lines, 6.0, 0.95)
    for k, n in enumerate((1, 60)):
        np.testing.assert_allclose([axes.low[k], axes.high[k]], chi2.ppf([0.025, 0.975], 6 * n) / n)
    assert np.isnan(axes.low[2]) and axes.middle == 6.0


def test_it_is_drawn_to_the_same_bytes(tmp_path: Path):
    found = Result("track_nees", NUMBER, "an error squared")
    lines = [Line((), found, Estimate(v, v - 1.0, v + 1.0, 5, False), 0, None) for v in (5.0, 7.0)]
    drawn = []
    for name in ("a.png", "b.png"):
        place = tmp_path / name
        draw_numbered_results(place, [("", [1.0, 2.0], lines)], "nees.time_s", "T", 0.95, 6.0)
        drawn.append(place.read_bytes())
    assert drawn[0] == drawn[1] and drawn[0].startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("figure", "said"),
    [
        ('metric = "first_detection_range_m"', "no such results with a number behind them"),
        ('metric = "x.y"\nfreedom = 0', "freedom = 0: must be greater than 0"),
        ('freedom = 6', "needs a metric"),
    ],
)  # fmt: skip
def test_what_is_no_series_is_said(small: Path, figure: str, said: str) -> None:
    study = 'scene = "small.toml"\nreplicas = 2\nmetrics = ["first_detection"]\n'
    Path("study.toml").write_text(f'{study}[[figures]]\nkind = "series"\n{figure}\n')
    result = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "out"])
    assert result.exit_code == 2 and said in " ".join(result.output.split())


def test_a_study_that_draws_a_series_prints_it():
    names = ("a.t.1", "a.t.2", "a.t", "b")
    lines = [SimpleNamespace(result=SimpleNamespace(name=name)) for name in names]
    record = SimpleNamespace(figures=[SimpleNamespace(kind="series", metric="a.t")], stop_when=None)
    tables = SimpleNamespace(record=record, lines=lines)
    assert [line.result.name for line in Tables.shown_lines(tables)] == ["a.t.1", "a.t.2", "a.t"]
    assert [line.result.name for line in Tables.shown_lines(tables, ["b"])] == ["b"]
