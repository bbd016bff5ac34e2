"""Requirements turned round: the cheapest value of an axis that keeps a result within a limit.

The values of the axis stand from cheap to dear. A value meets a limit where the *interval* of the
result lies within it, not the estimate alone; an interval of too few values (`Estimate.few`), whose
ends are not as sure as they say, meets none. Values are looked at from the dearest down, and the
first that does not meet the limit ends it: the cheapest is the last before it. Tests that are taken
in an order fixed beforehand, up to the first that fails, need no correction for their number
(Westfall & Krishen, Journal of Statistical Planning and Inference 99, 2001), so each answer is as
sure as one end of an interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dsa_des.studies.requirements import Requirement
from dsa_des.studies.summary import Line


@dataclass(frozen=True)
class Answer:
    """The cheapest value at one place of the other axes.

    Parameters
    ----------
    requirement : Requirement
    at : tuple
        Values of the other axes.
    value : object
        Cheapest value whose interval, and that of all dearer ones, meets the limit; None if none.
    estimated : object
        The same by the estimates alone, which is sure of nothing.
    line : Line
        The summary's line at `value`, or at the dearest value where none meets it.
    uneven : bool
        Whether a cheaper value meets the limit though a dearer one does not: more runs would tell.
    """

    requirement: Requirement
    at: tuple[Any, ...]
    value: Any
    estimated: Any
    line: Line
    uneven: bool


def answers(requirement: Requirement, axes: Sequence[str], lines: Sequence[Line]) -> list[Answer]:
    """Return the cheapest value at every place of the other axes.

    Parameters
    ----------
    requirement : Requirement
    axes : sequence of str
        Columns, in the order of `Line.at`.
    lines : sequence of Line
        Of a summary.
    """
    if requirement.axis not in axes:
        return []
    place = list(axes).index(requirement.axis)
    found: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        if line.result.name == requirement.metric:
            others = (*line.at[:place], *line.at[place + 1 :])
            found.setdefault(others, []).append(line)
    told = []
    for at, some in found.items():
        dearest_first = some if requirement.cheap_last else some[::-1]
        sure = [
            not line.estimate.few and requirement.met(line.estimate.low, line.estimate.high)
            for line in dearest_first
        ]
        likely = [
            requirement.met(line.estimate.value, line.estimate.value) for line in dearest_first
        ]
        last, guess = _run(sure), _run(likely)
        told.append(
            Answer(
                requirement, at,
                dearest_first[last - 1].at[place] if last else None,
                dearest_first[guess - 1].at[place] if guess else None,
                dearest_first[max(last - 1, 0)],
                any(sure[last:]),
            )
        )  # fmt: skip
    return told


def _run(good: Sequence[bool]) -> int:
    """Return how many stand before the first that is false."""
    return next((k for k, one in enumerate(good) if not one), len(good))


def one_sided(confidence: float) -> float:
    """Return how sure one end of a two-sided interval is."""
    return 0.5 + confidence / 2.0
