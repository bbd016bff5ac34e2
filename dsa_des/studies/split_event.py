"""A rare event as a study with splitting measures it: of a repetition, and of a run on the way."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsa_des.arrays.types import AnyArray
from dsa_des.results.record import CLASS, EVENT, NUMBER, Result
from dsa_des.studies.metric import Group, Metric

#: Beside the times that `Nearness` gives, by the number of the level.
WEIGHT = "weight"


@dataclass(frozen=True)
class Splitting:
    """How the probability of an event is found by splitting.

    Levels are of the score and fall; without any a pilot finds them.
    """

    event: str
    #: By which runs that come near are told, of those that the metric has.
    score: str
    #: Of each stage of a repetition.
    runs: int
    levels: tuple[float, ...] | None = None


class Nearness(Metric):
    """When each run first reached levels of the score of an event, and how much it weighs."""

    def __init__(self, metric: Metric, event: str, score: str, levels: Sequence[float]) -> None:
        self._metric, self._asked = metric, (event, score, levels)
        self.tables = metric.tables

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return the times, s, by the number of the level; NaN for never."""
        times_s = self._metric.reached_s(group, *self._asked)
        weights = self._metric.unit_weights(group)
        return {WEIGHT: weights} | {str(k): one for k, one in enumerate(times_s)}


class SplitEvent(Metric):
    """What a repetition tells of an event, which a metric gives of a run."""

    def __init__(self, metric: Metric, event: str) -> None:
        super().__init__(metric.p, metric.scene)
        self.metric, self.event = metric, event
        self.tables = metric.tables

    def results(self) -> list[Result]:
        """Return the probability, and how a repetition came to it."""
        of = {result.name: result.meaning for result in self.metric.results()}
        name = self.event
        return [
            Result(name, NUMBER, f"probability by splitting: {of.get(name, name)}",
                   least=0.0, most=1.0, unseen=f"{name}.unseen"),
            Result(f"{name}.unseen", NUMBER, "what one run more that comes to it would add"),
            Result(f"{name}.collapsed", EVENT, "no run came to it: its P is 0, and counts"),
            Result(f"{name}.runs", NUMBER, "runs that were flown", least=0.0),
            Result(f"{name}.levels", CLASS, "levels of the score"),
        ]  # fmt: skip

    def check(self, blocks: Any) -> None:
        """Raise ValueError for what the metric itself finds wrong."""
        self.metric.check(blocks)
