"""Which models may be taken: the limit of a change, what a model comes to, and in what words.

A model may be taken where the *whole* interval of its change lies within the limit, at every place
of the study (a test of equivalence: not to have seen a difference is none). As all intervals hold
together, so do all statements.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from dsa_des.answers.changes import FEW_EVENTS, PairedChange
from dsa_des.costs.climb import flag_points_on_front
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.results.labels import format_with_interval, unit_of
from dsa_des.results.record import FRACTION, NUMBER, Result
from dsa_des.results.statistics import FEW

_LIMIT = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(\S*)\s*")
#: A share of the scene's own answer, where no limit is given.
_BY_DEFAULT = 0.1
#: Costs nearer to each other than this factor come in another order in another run.
_APART = 1.1
#: More times as many runs are not foreseen from so few.
_MOST_TIMES = 1000.0

#: What a model comes to: it gives the same in every run (of events, in so many that this is within
#: the limit); its change is surely within the limit; it is surely beyond; so many runs cannot tell;
#: nothing can be compared.
SAME, WITHIN, BEYOND, OPEN, NOTHING = "same", "within", "beyond", "open", "nothing to compare"


@dataclass(frozen=True)
class Limit:
    """The largest change that is allowed of a result: an amount, or a share of the answer."""

    amount: float
    is_share: bool

    def absolute_limit(self, answer: float) -> float:
        """Return the largest allowed change: a share of absolute `answer`, or a fixed amount."""
        return self.amount * abs(answer) if self.is_share else self.amount


def parse_limits(texts: Iterable[str], results: Sequence[Result]) -> dict[str, Limit]:
    """Return result → limit from texts such as ``5%``, ``0.02`` or ``300m``.

    A share is of all results, an amount of those with its unit; the rest may change by a tenth.
    """
    limits = {result.name: Limit(_BY_DEFAULT, True) for result in results}
    units = {result.name: unit_of(result.name) for result in results}
    for text in texts:
        match = _LIMIT.fullmatch(text)
        try:
            value = float(match[1]) if match else 0.0
        except ValueError:
            value = 0.0
        if match is None or not 0.0 < value < math.inf:
            raise UsageError(
                f"--budget {text}: must be a number above 0 with the result's unit, or a share of "
                "the answer, for example 5%"
            )
        unit = match[2].replace("m2", "m²")
        mine = [name for name, its in units.items() if unit in ("%", its)]
        if not mine:
            known = sorted({"%", *units.values()} - {""})
            shown = ", ".join(f"{name} is in {its or 'no unit'}" for name, its in units.items())
            raise UsageError(f"--budget {text}: {shown}{did_you_mean(unit, known) if unit else ''}")
        share = unit == "%"
        limits |= dict.fromkeys(mine, Limit(value / 100.0 if share else value, share))
    return limits


@dataclass(frozen=True)
class ModelVerdict:
    """What one model comes to for one result, over all places."""

    model: str
    result: Result
    kind: str
    #: The change that decided, at the place where it weighs most; None without any run.
    change: PairedChange | None
    #: The limit there.
    limit: float
    #: The largest change left possible, by the limit; NaN where nothing is sure.
    weight: float
    #: Why nothing can be compared.
    reason: str = ""
    #: Units that would decide; infinite where that is not foreseen.
    wanted: float = math.nan
    #: Whether none of the others is as cheap and changes as little, and better in one.
    on_front: bool = False

    @property
    def is_same_or_within_limit(self) -> bool:
        """Whether its runs all equal the scene's own, or its change is surely within the limit."""
        return self.kind in (SAME, WITHIN)


def judge_by_worst_change(
    model: str, result: Result, changes: Sequence[PairedChange], limit: Limit, failed: str
) -> ModelVerdict:
    """Return a model's verdict: beyond, unknown, open, within, same; `failed`: why no changes."""
    if not changes:
        return ModelVerdict(
            model, result, NOTHING, None, math.nan, math.nan, failed or "no run of both"
        )
    limits = [limit.absolute_limit(change.own.value) for change in changes]
    judged = [_verdict_kind(change, most) for change, most in zip(changes, limits, strict=True)]
    # The worst is told: what is surely beyond, then what is not known, then what weighs most.
    order = (BEYOND, NOTHING, OPEN, WITHIN, SAME)
    sizes = [
        _change_relative_to_limit(change, most)
        for change, most in zip(changes, limits, strict=True)
    ]
    k = min(range(len(judged)), key=lambda k: (order.index(judged[k]), -sizes[k]))
    kind, change, most = judged[k], changes[k], limits[k]
    weights = [
        _relative_to_limit(one.largest_possible_change, amount)
        for one, amount in zip(changes, limits, strict=True)
    ]
    weight = max(weights) if all(w == w for w in weights) else math.nan
    wanted = _units_needed_to_decide(change, most) if kind == OPEN else math.nan
    return ModelVerdict(model, result, kind, change, most, weight, change.reason, wanted)


def _verdict_kind(change: PairedChange, limit: float) -> str:
    interval = change.difference
    if change.reason:
        return NOTHING
    if interval.few:
        return OPEN
    seen_whole = not change.cut_off  # what the run cut off may have changed by more
    if change.has_only_identical_runs and seen_whole and change.result.kind in (NUMBER, FRACTION):
        return SAME  # its interval is a point, as that of any number without a spread
    if change.has_only_identical_runs and seen_whole:
        # Of events: so many runs may still have missed the rare one.
        return SAME if -limit <= interval.low and interval.high <= limit else OPEN
    if interval.low > limit or interval.high < -limit:
        return BEYOND
    presence = change.presence
    if presence is not None and (presence.low > 0.0 or presence.high < 0.0):
        return BEYOND
    is_within = -limit <= interval.low and interval.high <= limit
    return WITHIN if is_within and seen_whole and not change.lost and not change.gained else OPEN


def _relative_to_limit(amount: float, limit: float) -> float:
    """Return an amount divided by a limit; infinite where the limit is 0 and the amount is not."""
    if amount != amount or amount == 0.0:
        return amount
    return amount / limit if limit > 0.0 else math.inf


def _change_relative_to_limit(change: PairedChange, limit: float) -> float:
    size = _relative_to_limit(abs(change.difference.value), limit)
    return size if size == size else math.inf


def _units_needed_to_decide(change: PairedChange, limit: float) -> float:
    """Return how many units would decide on a limit, if the change keeps its mean and spread."""
    if change.cut_off:
        return math.nan  # more of them are cut off as well
    lost = change.lost + change.gained > 0
    room = abs(limit - abs(change.difference.value))
    # Where no run differs an interval shrinks with their number, else with its root.
    power = 1 if change.has_only_identical_runs else 2
    more = (change.half_width / room) ** power if room > 0.0 else math.inf
    if change.events < FEW_EVENTS:
        more = max(more, FEW_EVENTS / change.events if change.events else math.inf)
    elif change.difference.few:
        more = max(more, FEW / change.difference.count)
    elif lost and more <= 1.0:
        return math.nan  # of more of them more lose their value
    if not more <= _MOST_TIMES:
        return math.inf
    wanted = change.difference.count * max(more, 1.0)
    digits = 10.0 ** max(0, math.floor(math.log10(max(wanted, 1.0))) - 1)
    return math.ceil(wanted / digits) * digits


def flag_verdicts_on_cost_front(
    verdicts: Sequence[ModelVerdict], costs: Mapping[str, float]
) -> list[bool]:
    """Return for each verdict whether its model is on the front of CPU cost against largest
    possible change: no other model is at least as good in both and better in one.

    The scene as it is, of cost 1, changes nothing, and who is its equal is not better; costs that
    differ by less than a tenth are one.
    """
    points = [(1.0, 0.0)]
    for verdict in verdicts:
        cost = costs.get(verdict.model, math.nan)
        cost = 1.0 if 1.0 / _APART < cost < _APART else cost
        known = cost == cost and verdict.kind != NOTHING
        points.append((cost, verdict.weight if known else math.nan))
    return [
        best and point != points[0]
        for point, best in zip(points, flag_points_on_front(points), strict=True)
    ][1:]


def format_change(change: PairedChange) -> str:
    """Return a change as text with its interval and unit, such as ``+1,240 ± 130 m``."""
    unit = unit_of(change.result.name)
    return f"{format_with_interval(change.difference.value, change.half_width)} {unit}".strip()
