"""Differences of a rung from its reference, target-scan by target-scan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.ladder import Ladder, Truth, Unavailable
from dsa_des.costs.replay import RungRun

#: Target-scans at which a rung is compared with a far more precise evaluation.
SAMPLE = 100


@dataclass(frozen=True)
class Spread:
    """Mean, 95th percentile and maximum of an error, and over how many target-scans.

    Parameters
    ----------
    mean, p95, maximum : float
        NaN when there was nothing to compare.
    count : int
    """

    mean: float
    p95: float
    maximum: float
    count: int

    @classmethod
    def of(cls, errors: FloatArray) -> "Spread":
        """Return the spread of errors, leaving NaN out."""
        known = errors[~np.isnan(errors)]
        if known.size == 0:
            return cls(float("nan"), float("nan"), float("nan"), 0)
        p95 = float(np.percentile(known, 95.0))
        return cls(float(known.mean()), p95, float(known.max()), int(known.size))


#: Ticks of a rung's rows, and its values by quantity.
Values = tuple[IntArray, dict[str, AnyArray]]


def values_of(ladder: Ladder, run: RungRun, reference: RungRun) -> Values:
    """Read a ladder's quantities from a fresh block over all its wakes."""
    block, other = run.fresh(), reference.fresh()
    found = [(wake.ticks, ladder.measure(block, wake, other)) for wake in run.wakes]
    ticks = np.concatenate([ticks for ticks, _ in found])
    names = [q.name for q in ladder.quantities]
    return ticks, {name: np.concatenate([values[name] for _, values in found]) for name in names}


def errors_against(ladder: Ladder, rung: Values, reference: Values) -> dict[str, Spread]:
    """Return each quantity's error at the instants that both have."""
    ticks, values = rung
    other_ticks, others = reference
    _, here, there = np.intersect1d(ticks, other_ticks, return_indices=True)
    spreads = {}
    for quantity in ladder.quantities:
        apart = quantity.difference(values[quantity.name][here], others[quantity.name][there])
        spreads[quantity.name] = Spread.of(apart)
    return spreads


def own_errors(ladder: Ladder, run: RungRun, values: Values) -> tuple[dict[str, Spread], str]:
    """Return a rung's error against a far more precise evaluation, or why there is none.

    Returns
    -------
    dict of Spread
        Empty when it could not be measured.
    str
        Why it could not; else what was done.
    """
    if ladder.truth is None:
        return {}, "nothing more exact is known"
    try:
        parts = _sampled(ladder.truth, run, _known(ladder, values), values[0])
    except ImportError as error:
        return {}, f"not measured: {error}"
    except Unavailable as error:
        return {}, str(error)
    spreads = {name: Spread.of(np.concatenate([part[name] for part in parts])) for name in parts[0]}
    count = max(spread.count for spread in spreads.values())
    return spreads, f"measured at {count} target-scans"


def _known(ladder: Ladder, values: Values) -> IntArray:
    """Return (row, target) of a sample, evenly spread over what the first quantity knows."""
    first = values[1][ladder.quantities[0].name]
    unknown = np.isnan(first)
    pairs = np.unique(np.argwhere(~unknown)[:, :2], axis=0)
    if len(pairs) > SAMPLE:
        pairs = pairs[np.linspace(0, len(pairs) - 1, SAMPLE).astype(np.int64)]
    return pairs


def _sampled(
    truth: Truth, run: RungRun, pairs: IntArray, ticks: IntArray
) -> Sequence[Mapping[str, FloatArray]]:
    if len(pairs) == 0:
        raise Unavailable("no target-scan to measure at")
    block = run.fresh()
    parts = []
    start = 0
    for wake in run.wakes:
        inside = (pairs[:, 0] >= start) & (pairs[:, 0] < start + len(wake))
        if inside.any():
            parts.append(truth(block, wake, pairs[inside] - np.array([start, 0])))
        start += len(wake)
    return parts
