"""Splitting: the probability of a rare event, from runs that branch where they come near it.

Where a study has a table ``[splitting]``, its replicas are *repetitions*. A repetition begins with
`Splitting.runs` runs. Those that reach the first level of a score are branched there: the next
stage has as many runs again, each of which is one of these up to the instant at which it reached
the level, and draws by a seed of its own from then on (`dsa_des.time.randomness`). So it goes on
from level to level, and the last one is the event itself. With weights w of the first runs,
and those of a stage sharing the weight of all that reached its level, the estimate

    P = (weight of the runs of the last stage that come to the event) / Σ w

is unbiased for fixed levels and equal weights, wherever the levels are: bad ones cost width, never
truth. A repetition none of whose runs reaches a level has *collapsed*: its P is 0 and counts.
Repetitions are independent, and the interval is that of the mean of their P.

A branch flies again, on the same draws, what it has in common with the run that it comes from: no
block's memory is copied, so blocks of any kind can branch.

H. Kahn & T. E. Harris, "Estimation of particle transmission by random sampling", National Bureau of
Standards AMS 12, 1951; P. Glasserman, P. Heidelberger, P. Shahabuddin & T. Zajic, "Multilevel
splitting for estimating rare event probabilities", Operations Research 47, 1999. The levels are
found as by F. Cérou & A. Guyader, "Adaptive multilevel splitting for rare event analysis",
Stochastic Analysis and Applications 25, 2007, from a pilot of runs that count for nothing else.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.replicas.changed_scene import Replica
from dsa_des.scene.graph import in_cycles
from dsa_des.scene.scene import Scene
from dsa_des.studies.draws import replica_seed
from dsa_des.studies.metric import Metric
from dsa_des.studies.split_event import WEIGHT, Nearness, SplitEvent
from dsa_des.studies.study import Study
from dsa_des.time.clock import NANOSECONDS
from dsa_des.time.randomness import branch, key_of

#: A level of the pilot is reached by at least so many of its runs, where one is.
_SHARE = 0.2
#: A pilot has no more stages.
_MOST_STAGES = 60
#: When a run comes within a level is known to a millisecond: a branch draws from then on, ns.
_SURELY_NS = 2_000_000


class Flown(NamedTuple):
    """When runs first reached some levels, s, (levels, runs), and the weights of the runs."""

    reached_s: FloatArray
    weights: FloatArray
    errors: Sequence[str | None]


#: Runs replicas and returns what a metric gives of them; what went wrong is put among the errors.
Measure = Callable[[Metric, Sequence[Replica], list[str | None]], dict[str, AnyArray]]
#: Flies runs and looks when they reach some levels, which fall.
Fly = Callable[[Sequence[Replica], Sequence[float]], Flown]


class _Repetition:
    """The runs of a repetition's present stage, and what they stand for."""

    def __init__(self, seed: int, roots: Sequence[Replica]) -> None:
        self._seed, self.runs = seed, list(roots)
        self.weights, self._whole = np.ones(len(roots)), 0.0
        self.stage = self.flown = 0
        self.error: str | None = None
        #: The weight of the runs of this stage by that of all first runs.
        self.share = 1.0

    def fly(self, weights: FloatArray) -> None:
        """Take note that the runs of this stage were flown; the first ones weigh so much."""
        self.flown += len(self.runs)
        if self.stage == 0:
            self.weights, self._whole = weights, float(weights.sum())

    def reach(self, reached_s: FloatArray) -> None:
        """Branch the runs where they came within the level of the next stage, if any did."""
        some = np.flatnonzero(~np.isnan(reached_s))
        total = float(self.weights[some].sum())
        if not total > 0.0:
            self.runs = []
            return
        self.stage, count = self.stage + 1, len(self.runs)
        uniform = (key_of(self._seed, "branches", self.stage) >> 11) * 2.0**-53
        parents = some[chosen_of(self.weights[some], count, uniform)]
        self.runs = [
            Replica(
                branch(self.runs[k].seed, instant_ns(reached_s[k]), self._seed_of(number)),
                self.runs[k].changes,
            )
            for number, k in enumerate(parents.tolist())
        ]
        self.weights = np.full(count, total / count)
        self.share = total / self._whole

    def _seed_of(self, number: int) -> int:
        return key_of(self._seed, "branch", self.stage, number) >> 1

    def event_share(self, reached_s: FloatArray) -> float:
        """Return the weight of the runs that came to the event, by that of all first runs."""
        return float(self.weights[~np.isnan(reached_s)].sum()) / self._whole


def chosen_of(weights: FloatArray, count: int, uniform: float) -> IntArray:
    """Return which of some runs `count` branches come from, each as often as it weighs.

    Of every run there are as many as expected, to the whole number below or above (systematic
    resampling): no run is left out of equal ones.
    """
    ends = np.cumsum(weights)
    places = (np.arange(count) + uniform) * (ends[-1] / count)
    return np.minimum(np.searchsorted(ends, places, side="right"), len(weights) - 1)


def instant_ns(reached_s: float) -> int:
    """Return from when on a run that came within a level draws anew, ns since its start."""
    return math.ceil(reached_s * NANOSECONDS) + _SURELY_NS


def split(
    study: Study, cell: int, numbers: Sequence[int], metric: Metric, measure: Measure
) -> tuple[list[str | None], dict[str, AnyArray]]:
    """Return the error of each of some repetitions of a cell, or None, and result → values.

    `metric` is that of the study, a `SplitEvent`; `measure` runs replicas and returns what another
    gives of them, and puts what went wrong among errors.
    """
    assert study.splitting is not None and isinstance(metric, SplitEvent)
    of_run, by = metric.metric, (study.splitting.event, study.splitting.score)

    def fly(runs: Sequence[Replica], levels: Sequence[float]) -> Flown:
        errors: list[str | None] = [None] * len(runs)
        nothing = np.full(len(runs), np.nan)
        values = measure(Nearness(of_run, *by, levels), runs, errors)
        times_s = [values.get(str(k), nothing) for k in range(len(levels))]
        return Flown(np.array(times_s), values.get(WEIGHT, nothing), errors)

    said = _repeated(study, cell, numbers, of_run.scores[by[1]], fly)
    names = list(dict.fromkeys(name for one in said for name in one if name != "error"))
    columns = {
        name: np.array([one.get(name) for one in said],
                       dtype=object if name.endswith(".levels") else np.float64)
        for name in names
    }  # fmt: skip
    return [one.get("error") for one in said], columns


def _repeated(
    study: Study, cell: int, numbers: Sequence[int], candidates: FloatArray, fly: Fly
) -> list[dict[str, Any]]:
    """Return the values of some repetitions of a cell, or the error of each."""
    assert study.splitting is not None
    event, count = study.splitting.event, study.splitting.runs
    seed = study.member_seed(cell)
    try:
        levels = study.splitting.levels or _known_levels(study, cell, candidates, fly)
    except ValueError as error:
        return [{"error": str(error)} for _ in numbers]
    repetitions = [
        _Repetition(
            key_of(seed, "study splitting", number),
            [study.replica(number * count + k, cell) for k in range(count)],
        )
        for number in numbers
    ]
    shares = dict.fromkeys(range(len(numbers)), 0.0)
    for level in (*levels, float(candidates[-1])):
        going = [k for k, one in enumerate(repetitions) if one.runs and not one.error]
        if not going:
            break
        flown = fly([run for k in going for run in repetitions[k].runs], [level])
        for place, k in enumerate(going):
            mine, one = slice(place * count, (place + 1) * count), repetitions[k]
            one.error = next((text for text in flown.errors[mine] if text), None)
            if one.error:
                continue
            one.fly(flown.weights[mine])
            if level > candidates[-1]:
                one.reach(flown.reached_s[0, mine])
            else:
                shares[k] = one.event_share(flown.reached_s[0, mine])
    return [
        {"error": one.error}
        if one.error
        else {
            event: shares[k],
            f"{event}.unseen": one.share / count,
            f"{event}.collapsed": float(shares[k] == 0.0),
            f"{event}.runs": float(one.flown),
            f"{event}.levels": ", ".join(f"{level:.4g}" for level in levels) or "none",
        }
        for k, one in enumerate(repetitions)
    ]


#: By all that fixes them, in this process: every process finds them by itself, and the same.
_levels_found: dict[str, tuple[float, ...]] = {}


def _known_levels(study: Study, cell: int, candidates: FloatArray, fly: Fly) -> tuple[float, ...]:
    key = repr((study.tables, study.base.data, study.seed, study.sets, study.swaps, cell))
    if key not in _levels_found:
        _levels_found[key] = find_levels(study, cell, candidates, fly)
    return _levels_found[key]


def find_levels(study: Study, cell: int, candidates: FloatArray, fly: Fly) -> tuple[float, ...]:
    """Return levels, among some that fall to the event, by the runs of a pilot.

    Each is the smallest that a fifth of the runs of a stage reach, or else the next one that
    any does. ValueError if no run comes nearer than a level, or a run fails.
    """
    assert study.splitting is not None
    event, count = study.splitting.event, study.splitting.runs
    seed = key_of(study.member_seed(cell), "study splitting pilot")
    roots = [
        Replica(
            replica_seed(seed, number),
            {draw.key: draw.value(seed, number, count) for draw in study.draws},
        )
        for number in range(count)
    ]
    pilot = _Repetition(seed, roots)
    levels: list[float] = []
    for _ in range(_MOST_STAGES):
        flown = fly(pilot.runs, candidates.tolist())
        if said := next((text for text in flown.errors if text), None):
            raise ValueError(f"of the pilot of splitting: {said}")
        pilot.fly(flown.weights)
        share = (~np.isnan(flown.reached_s) @ pilot.weights) / pilot.weights.sum()
        if share[-1] >= _SHARE:
            return tuple(levels)
        nearer = np.flatnonzero((share > 0.0) & (levels[-1] > candidates if levels else True))
        if not len(nearer):
            said = f"of a {study.splitting.score} of {levels[-1]:.3g}" if levels else "flown"
            break
        usual = nearer[share[nearer] >= _SHARE]
        level = int(usual[-1] if len(usual) else nearer[0])
        if level == len(candidates) - 1:
            return tuple(levels)
        levels.append(float(candidates[level]))
        pilot.reach(flown.reached_s[level])
    raise ValueError(
        f"the score never rises: of {count} runs of the pilot of splitting that were {said} none "
        f"comes nearer to {event}, whatever is drawn from then on"
    )


def why_not_split(study: Study, scene: Scene) -> tuple[str, str, Any] | None:
    """Return which key of the table, why, and which value makes splitting impossible; or None.

    Asked before the first run.
    """
    table, split_event = study.splitting, study.metrics[0].build(scene)
    assert table is not None and isinstance(split_event, SplitEvent)
    hosted = [name for name, block in sorted(scene.blocks.items()) if block.cls.needs_host]
    if hosted:
        said = f"the block {hosted[0]} waits for a host program, and cannot be flown again"
        return "", said, None
    if not in_cycles(scene.graph):
        return "", "the scene has no closed loop: nothing that is drawn changes a flight", None
    metric = split_event.metric
    events, scores = metric.scored_events(), metric.scores
    if not events:
        name = study.metrics[0].name
        return "event", f"the metric {name} does not know how near a run comes", table.event
    if table.event not in events:
        said = f"is no event that {study.metrics[0].name} has a score of"
        return "event", said + did_you_mean(table.event, events), table.event
    if table.score not in scores:
        return "score", f"is no score{did_you_mean(table.score, scores)}", table.score
    least = float(scores[table.score][-1])
    if table.levels and table.levels[-1] <= least:
        said = f"must all be above {least:g}, which is the event itself"
        return "levels", said, list(table.levels)
    return None
