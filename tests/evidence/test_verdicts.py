"""Verdicts by the place of an interval, what the first line says, and the counts of a rule."""

import math
from itertools import pairwise
from types import SimpleNamespace

import pytest

from dsa_des.evidence.case import CaseRequirement
from dsa_des.evidence.findings import (
    Convergence,
    Finding,
    unit_counts_and_settling_start,
    verdict_line,
)
from dsa_des.results.statistics import Estimate


def finding(name: str, low: float, high: float, moved: float = 0.0, **limit: float) -> Finding:
    asked = CaseRequirement(name=name, text="t", source="s", result="r", unit="u", **limit)
    estimate = Estimate((low + high) / 2, low, high, 9, False)
    line = SimpleNamespace(estimate=estimate, ratio=None)
    return Finding(asked, line, Convergence([5, 9], [estimate] * 2, 5, moved, 0.02))


@pytest.mark.parametrize(("limit", "low", "high", "verdict"), [
    ({"most": 0.5}, 0.1, 0.5, "met"),
    ({"most": 0.5}, 0.1, 0.51, "not shown"),
    ({"most": 0.5}, 0.51, 0.6, "not met"),
    ({"least": 0.5}, 0.5, 0.6, "met"),
    ({"least": 0.5}, 0.49, 0.6, "not shown"),
    ({"least": 0.5}, 0.1, 0.49, "not met"),
    ({"most": 0.5}, math.nan, math.nan, "not converged"),
])  # fmt: skip
def test_an_interval_decides(limit, low, high, verdict):
    assert finding("a", low, high, **limit).verdict == verdict
    assert finding("a", low, high, 0.03, **limit).verdict == "not converged"


def test_what_does_not_pass_is_said_first():
    good, bad = finding("good", 0.1, 0.2, most=0.5), finding("bad", 0.6, 0.7, most=0.5)
    open_, moving = finding("open", 0.4, 0.6, most=0.5), finding("moving", 0.1, 0.2, 1.0, most=0.5)
    line = verdict_line([good, bad, open_])
    assert line.startswith("Does not pass: bad 0.65 (0.6 to 0.7), asked at most 0.5 u; open 0.5")
    assert line.index("bad") < line.index("open") < line.index("Passes: good")
    assert verdict_line([good]).startswith("Passes: good 0.15 (0.1 to 0.2)")
    nothing = verdict_line([good, moving, bad])
    assert nothing.startswith(
        "No verdict: moving has not converged: over the encounters from 5 to 9"
    )
    assert "good" not in nothing and "bad" not in nothing


@pytest.mark.parametrize(
    ("units", "last", "start"), [(24, 0.25, 18), (10_000, 0.5, 5000), (2, 0.5, 1)]
)
def test_counts_reach_over_the_whole_last_stretch(units, last, start):
    counts, begins = unit_counts_and_settling_start(units, last)
    assert begins == start in counts and counts[-1] == units
    assert counts == sorted(set(counts)) and counts[0] >= 1
    stretch = [n for n in counts if n >= start]
    assert max(b - a for a, b in pairwise(stretch)) <= (units - start) / 24 + 1
