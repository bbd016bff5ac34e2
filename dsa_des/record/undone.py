"""What blocks could not do: counted by what their work lacked, so that counts of runs add up."""

from collections.abc import Iterable, Mapping

#: By block and by what its work lacked: how many times, of how many.
Undone = Mapping[str, Mapping[str, tuple[int, int]]]
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
