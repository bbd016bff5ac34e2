"""What blocks could not do: counted by what their work lacked, so that counts of runs add up."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from dsa_des.arrays.types import IntArray

#: By block and by what its work lacked: how many times, of how many.
Undone = Mapping[str, Mapping[str, tuple[int, int]]]
#: The same for each run: both counts, (2, runs).
UndoneByRun = Mapping[str, Mapping[str, IntArray]]
#: No case of any run.
NO_RUNS = np.empty(0, dtype=np.int64)
#: Smaller shares are not worth a sentence: a flight is not known at its first position.
_LEAST_SHARE = 0.1


def added(parts: Iterable[Undone]) -> dict[str, dict[str, tuple[int, int]]]:
    """Return the counts of several runs as those of all of them, sorted."""
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


def counted(known: IntArray, lacking: IntArray, every: IntArray) -> IntArray:
    """Return counts (2, runs) with more cases: the run of each that lacked something, and of all.

    The counts may end before the last run.
    """
    cases = lacking, every
    runs = max(known.shape[1], *(1 + int(run.max(initial=-1)) for run in cases))
    result = np.zeros((2, runs), dtype=np.int64)
    result[:, : known.shape[1]] = known
    result += [np.bincount(run, minlength=runs) for run in cases]
    return result


def by_run(undone: Mapping[str, IntArray | tuple[int, int]], runs: int) -> dict[str, IntArray]:
    """Return what a block says (`Component.undone`) as counts of all runs."""
    result: dict[str, IntArray] = {}
    for what, counts in undone.items():
        said = np.asarray(counts, dtype=np.int64).reshape(2, -1)
        result[what] = np.zeros((2, runs), dtype=np.int64)
        result[what][:, : said.shape[1]] = said
    return result


def of_runs(undone: UndoneByRun, runs: Collection[int] | slice) -> Undone:
    """Return the counts of some runs together."""
    some = runs if isinstance(runs, slice) else list(runs)
    result: dict[str, dict[str, tuple[int, int]]] = {}
    for block, counts in undone.items():
        for what, of_each in counts.items():
            times, of = of_each[:, some].sum(axis=1).tolist()
            if of:
                result.setdefault(block, {})[what] = times, of
    return added([result])


def undone_sentences(undone: Undone) -> list[str]:
    """Say what blocks could not do, with its share, where that is more than now and then."""
    return [
        f"{block}: {what}: {times:,} of {of:,} ({_percent(times / of)})"
        for block, counts in undone.items()
        for what, (times, of) in counts.items()
        if times > 0 and times >= _LEAST_SHARE * of
    ]


def _percent(share: float) -> str:
    return "100 %" if share == 1.0 else f"{min(99.9, 100.0 * share):.3g} %"
