"""What blocks could not do: counted by what their work lacked, so that counts of runs add up."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsa_des.arrays.run_ticks import is_shared_single_run
from dsa_des.arrays.types import BoolArray, IntArray

#: By block and by what its work lacked: how many times, of how many.
FailureCounts = Mapping[str, Mapping[str, tuple[int, int]]]
#: The same for each run: both counts, (2, runs).
FailuresByRun = Mapping[str, Mapping[str, IntArray]]
#: No case of any run, and no counts of any.
NO_RUNS: IntArray = np.empty(0, dtype=np.int64)
NO_COUNTS: IntArray = np.zeros((2, 0), dtype=np.int64)
#: What is counted of a block that fails at random. It is said however seldom.
SECONDS_FAILED = "seconds failed"
#: Smaller shares are not worth a sentence: a flight is not known at its first position.
_LEAST_SHARE = 0.1


def sum_failure_counts(parts: Iterable[FailureCounts]) -> dict[str, dict[str, tuple[int, int]]]:
    """Return the sum of runs' failure counts: block → what was missing → (failures, cases)."""
    result: dict[str, dict[str, tuple[int, int]]] = {}
    for part in parts:
        for block, counts in part.items():
            known = result.setdefault(block, {})
            for what, (times, of) in counts.items():
                before = known.get(what, (0, 0))
                known[what] = before[0] + int(times), before[1] + int(of)
    return {
        block: {what: counts[what] for what in sorted(counts)}
        for block, counts in sorted(result.items())
        if counts
    }


def counts_with_cases_added(known: IntArray, lacking: IntArray, every: IntArray) -> IntArray:
    """Return `known` (2, runs) plus a failure per run in `lacking` and a case per run in `every`.

    The counts may end before the last run.
    """
    cases = lacking, every
    if known.shape[1] < 2 and is_shared_single_run(lacking) and is_shared_single_run(every):
        return known.sum(axis=1, keepdims=True) + np.array([[len(lacking)], [len(every)]])
    runs = max(known.shape[1], *(1 + int(run.max(initial=-1)) for run in cases))
    result = np.zeros((2, runs), dtype=np.int64)
    result[:, : known.shape[1]] = known
    result += [np.bincount(run, minlength=runs) for run in cases]
    return result


def counts_by_run(
    failures: Mapping[str, IntArray | tuple[int, int]], runs: int
) -> dict[str, IntArray]:
    """Return a block's counts as what was missing → (2, runs): failures and cases by run."""
    result: dict[str, IntArray] = {}
    for what, counts in failures.items():
        said = np.asarray(counts, dtype=np.int64).reshape(2, -1)
        result[what] = np.zeros((2, runs), dtype=np.int64)
        result[what][:, : said.shape[1]] = said
    return result


def sum_counts_over_runs(failures: FailuresByRun, runs: Collection[int] | slice) -> FailureCounts:
    """Return selected runs' failure counts summed: block → what was missing → (failures, cases)."""
    some = runs if isinstance(runs, slice) else list(runs)
    result: dict[str, dict[str, tuple[int, int]]] = {}
    for block, counts in failures.items():
        for what, of_each in counts.items():
            times, of = of_each[:, some].sum(axis=1).tolist()
            if of:
                result.setdefault(block, {})[what] = times, of
    return sum_failure_counts([result])


def failure_sentences(failures: FailureCounts) -> list[str]:
    """Return a sentence per frequent failure: what a block could not do, how often, its share."""
    return [
        f"{block}: {what}: {times:,} of {of:,} ({_percent(times / of)})"
        for block, counts in failures.items()
        for what, (times, of) in counts.items()
        if times > 0 and (what == SECONDS_FAILED or times >= _LEAST_SHARE * of)
    ]


@dataclass(frozen=True, eq=False)
class Tries:
    """For each run, a block's sources (a bit mask), and whether it ever succeeded."""

    had: Any = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    did: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def add_tries(self, run: IntArray, had: Any, did: BoolArray) -> "Tries":
        """Return the tries with more cases: each one's run, bit mask of sources, and success.

        The cases of each run stand together.
        """
        if not len(run):
            return self
        known = self.had[0] if is_shared_single_run(run) and self.did.all() and len(self.did) else 0
        if known and np.bitwise_or.reduce(had) | known == known:  # as most often
            return self
        first = np.flatnonzero(np.append(True, run[1:] != run[:-1]))
        mine = run[first]
        count = max(int(mine.max()) + 1, len(self.did))
        every, done = np.zeros(count, dtype=had.dtype), np.zeros(count, dtype=bool)
        every[: len(self.had)], done[: len(self.did)] = self.had, self.did
        every[mine] |= np.bitwise_or.reduceat(had, first)
        done[mine] |= np.logical_or.reduceat(did, first)
        return Tries(every, done)

    def failure_counts(self, what: str, *, of_two: bool = False) -> dict[str, IntArray]:
        """Return `what` → counts (2, runs): 1 for each run that had a source (or two) but never
        succeeded, and 1 for each run that had them.
        """
        enough = has_two_bits(self.had) if of_two else self.had != 0
        return {what: np.array([enough & ~self.did, enough], dtype=np.int64)}


def has_two_bits(mask: Any) -> BoolArray:
    """Return for each bit mask whether it has at least two bits set."""
    return np.asarray((mask & (mask - 1)) != 0, dtype=bool)


def _percent(share: float) -> str:
    return "100 %" if share == 1.0 else f"{min(99.9, 100.0 * share):.3g} %"
