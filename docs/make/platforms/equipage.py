"""Risk by who avoids, from the runs of ``dsa-des study equipage``."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from dsa_des.results.ratio import paired_ratio

_EVENTS = {"nmac": "NMACs", "well_clear_lost": "losses of well clear"}
_NOBODY, _ALONE = "none", ["ownship", "intruder"]
#: Of normal means: 95 % are within so many standard errors.
_NORMAL_95 = 1.959964


def rows(studies: Sequence[Any]) -> list[str]:
    """Return the lines of the table, and what several that turn bring about.

    Encounters count that were flown with everybody's equipage, by their weights, as shares of the
    events without anybody's manoeuvres.
    """
    runs = pd.concat(studies).drop_duplicates(["equipage", "replica"])
    flown = runs.groupby("replica")["equipage"].transform("count")
    runs = runs[flown == runs["equipage"].nunique()]
    who = list(dict.fromkeys(runs["equipage"]))
    lines = [f"{runs['replica'].nunique():,} encounters", "",
             "| who avoids |" + "".join(f" {words} | risk ratio, 95 % | induced |"
             for words in _EVENTS.values()), "|---" * (1 + 3 * len(_EVENTS)) + "|"]  # fmt: skip
    weight = runs[runs["equipage"] == _NOBODY].set_index("replica")["encounter_weight"]
    happens = {
        event: runs.pivot(index="replica", columns="equipage", values=f"{event}_mitigated")
        for event in _EVENTS
    }
    for one in who:
        cells = (_cells(happens[event], one, weight) for event in _EVENTS)
        lines.append(f"| {one} | {' | '.join(cells)} |")
    lines.append("")
    for event, words in _EVENTS.items():
        of, nominal = happens[event], float((weight * happens[event][_NOBODY]).sum())
        for one in [name for name in who if name not in (_NOBODY, *_ALONE)]:
            new = (of[one] > 0.0) & (of[_ALONE] == 0.0).all(axis=1)
            lines.append(
                f"{one}: {int(new.sum())} of {int(of[one].sum())} {words} where neither alone "
                f"has one, {float((weight * new).sum()) / nominal:.3f} of the nominal risk"
            )
        for first, second in itertools.pairwise(who[1:]):
            lines.append(_difference(of, first, second, weight, words))
    return lines


def _cells(happens: Any, one: str, weight: Any) -> str:
    found = paired_ratio(happens[_NOBODY], happens[one], weight.loc[happens.index])
    low, high = found.interval
    ratio = "1" if one == _NOBODY else f"{found.ratio:.3f} ({low:.3f} to {high:.3f})"
    return f"{found.mitigated_events} | {ratio} | {found.induced:.3f}"


def _difference(happens: Any, first: str, second: str, weight: Any, words: str) -> str:
    """Say what another equipage changes, pair by pair: a ratio of sums, as in `paired_ratio`."""
    w, nominal = weight.loc[happens.index].to_numpy(), happens[_NOBODY].to_numpy()
    change, all_of = (happens[second] - happens[first]).to_numpy(), float((w * nominal).sum())
    value = float((w * change).sum()) / all_of
    error = float(np.sqrt(((w * (change - value * nominal)) ** 2).sum())) / all_of
    more, fewer = (int((sign * change > 0).sum()) for sign in (1, -1))
    low, high = value - _NORMAL_95 * error, value + _NORMAL_95 * error
    return (
        f"{second} beside {first}: {more} more and {fewer} fewer {words}, risk ratio by "
        f"{value:+.3f} ({low:+.3f} to {high:+.3f})"
    )
