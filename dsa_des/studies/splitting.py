"""Splitting in a study: its table, what it finds of an event, and whether it can be done.

What a repetition is, and why its estimate is unbiased: `dsa_des.replicas.splitting`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.block.component import Component
from dsa_des.errors import did_you_mean
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.splitting import FlownRuns, Repeated, find_levels, run_repetitions
from dsa_des.results.record import CLASS, EVENT, NUMBER, Result
from dsa_des.scene.graph import loop_number_by_block
from dsa_des.studies.metric import Group, Metric


@dataclass(frozen=True)
class Splitting:
    """Settings for estimating the probability of an event by multilevel splitting.

    Levels are of the score and fall; without any a pilot finds them.
    """

    event: str
    #: By which runs that come near are told, of those that the metric has.
    score: str
    #: Of each stage of a repetition.
    runs: int
    levels: tuple[float, ...] | None = None


class Nearness(Metric):
    """The metric of when runs first reached levels of an event's score, with the run's weight."""

    def __init__(self, metric: Metric, event: str, score: str, levels: Sequence[float]) -> None:
        self._metric, self._asked = metric, (event, score, levels)
        self.tables = metric.tables

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return level number → times of reaching it, s, NaN for never; and ``weight``."""
        times_s = self._metric.reached_s(group, *self._asked)
        weights = self._metric.unit_weights(group)
        return {"weight": weights} | {str(k): one for k, one in enumerate(times_s)}


class SplitEvent(Metric):
    """The metric of a splitting repetition instead of a run: an event's probability."""

    def __init__(self, metric: Metric, event: str) -> None:
        super().__init__(metric.p, metric.scene)
        self.metric, self.event = metric, event
        self.tables = metric.tables

    def results(self) -> list[Result]:
        """Return a repetition's result columns: event probability, and how it was obtained."""
        of = {result.name: result.meaning for result in self.metric.results()}
        name = self.event
        return [
            Result(name, NUMBER, f"probability by splitting: {of.get(name, name)}",
                   least=0.0, most=1.0, unseen=f"{name}.unseen"),
            Result(f"{name}.unseen", NUMBER, "what one run more that comes to it would add",
                   least=0.0),
            Result(f"{name}.collapsed", EVENT, "no run came to it: its P is 0, and counts"),
            Result(f"{name}.runs", NUMBER, "runs that were flown", least=0.0),
            Result(f"{name}.levels", CLASS, "levels of the score"),
        ]  # fmt: skip

    def metric_of_level_times(self, score: str, levels: Sequence[float]) -> Nearness:
        """Return the metric of when runs reach the given levels of a score."""
        return Nearness(self.metric, self.event, score, levels)

    def result_values_of_repetitions(
        self, found: Sequence[Repeated], levels: Sequence[float]
    ) -> dict[str, AnyArray]:
        """Return result → values of the repetitions; NaN or None for those that failed."""
        text = ", ".join(f"{level:.4g}" for level in levels[:-1]) or "none"
        values = {
            "": [one.probability for one in found],
            ".unseen": [one.unseen for one in found],
            ".collapsed": [float(one.probability == 0.0) for one in found],
            ".runs": [float(one.flown) for one in found],
        }
        failed = np.array([one.error is not None for one in found])
        return {
            f"{self.event}{name}": np.where(failed, np.nan, some) for name, some in values.items()
        } | {f"{self.event}.levels": np.array([None if f else text for f in failed], dtype=object)}

    def check(self, blocks: Mapping[str, Component]) -> None:
        """Raise ValueError for what the event's own metric finds wrong."""
        self.metric.check(blocks)


#: Runs replicas, each of a repetition of some number, and measures when they come near: by result,
#: and the error of each run.
Measure = Callable[
    [Nearness, Sequence[Replica], IntArray], tuple[dict[str, AnyArray], list[str | None]]
]


def run_splitting_repetitions(
    table: Splitting,
    metric: SplitEvent,
    numbers: Sequence[int],
    repetition: Callable[[int], tuple[Sequence[Replica], int]],
    measure: Measure,
    *,
    known: str,
) -> tuple[list[str | None], dict[str, AnyArray]]:
    """Run repetitions of splitting; return each one's error or None, and result → values.

    `repetition` gives the first runs of one and its seed, of the pilot those of -1, which is flown
    once for all that is `known` under one text.
    """
    candidates = metric.metric.scores[table.score]

    def measure_level_times(
        runs: Sequence[Replica], number: IntArray, levels: Sequence[float]
    ) -> FlownRuns:
        values, wrong = measure(metric.metric_of_level_times(table.score, levels), runs, number)
        nothing = np.full(len(runs), np.nan)
        times_s = [values.get(str(k), nothing) for k in range(len(levels))]
        return FlownRuns(np.array(times_s), values.get("weight", nothing), wrong)

    try:
        if table.levels is not None:
            levels = (*table.levels, float(candidates[-1]))
        elif (levels := _levels_found.get(known, ())) == ():
            levels = _levels_found[known] = find_levels(
                *repetition(-1), candidates, measure_level_times
            )
    except ValueError as error:
        return [str(error)] * len(numbers), {}
    runs, seeds = zip(*map(repetition, numbers), strict=True)
    found = run_repetitions(runs, seeds, levels, measure_level_times)
    return [one.error for one in found], metric.result_values_of_repetitions(found, levels)


#: By all that fixes them: every process finds the levels of a study by itself, and the same ones.
_levels_found: dict[str, tuple[float, ...]] = {}


def splitting_refusal(
    table: Splitting, split_event: SplitEvent, name: str
) -> tuple[str, str, Any] | None:
    """Return (key of the table, reason, value) for why splitting is impossible; else None.

    Asked before the first run.
    """
    scene, metric = split_event.scene, split_event.metric
    hosted = [one for one, block in sorted(scene.blocks.items()) if block.cls.needs_host]
    if hosted:
        said = f"the block {hosted[0]} waits for a host program, and cannot be flown again"
        return "", said, None
    if not loop_number_by_block(scene.graph):
        return "", "the scene has no closed loop: nothing that is drawn changes a flight", None
    events, scores = metric.scored_events(), metric.scores
    if not events:
        return "event", f"the metric {name} does not know how near a run comes", table.event
    if table.event not in events:
        said = f"is no event that {name} has a score of"
        return "event", said + did_you_mean(table.event, events), table.event
    if table.score not in scores:
        return "score", f"is no score{did_you_mean(table.score, scores)}", table.score
    least = float(scores[table.score][-1])
    if table.levels and table.levels[-1] <= least:
        said = f"must all be above {least:g}, which is the event itself"
        return "levels", said, list(table.levels)
    return None
