"""Range of the first alert by a link's latency and loss, from the runs of ``link_latency``."""

from collections.abc import Sequence
from typing import Any

import pandas as pd  # type: ignore[import-untyped]

#: Axis of the study that no other one has.
LATENCY = "wires[1].delay_s"
_LOSS, _RANGE = "wires[1].drop_probability", "first_alert_range_m.alerting"


def rows(studies: Sequence[Any]) -> list[str]:
    """Return the lines of the table of ranges at the first alert, by latency and loss.

    Beside the mean of each flight is how much nearer it is, run by run, than with a link that is at
    once and loses nothing, with a 95 % interval (normal).
    """
    runs = pd.concat(studies).drop_duplicates([LATENCY, _LOSS, "flight", "replica"])
    flights = list(dict.fromkeys(runs.flight))
    lines = [
        "| latency, s | loss |" + "".join(f" {one}, m | nearer by, m |" for one in flights),
        "|---" * (2 + 2 * len(flights)) + "|",
    ]
    range_m = runs.pivot(index="replica", columns=[LATENCY, _LOSS, "flight"], values=_RANGE)
    for latency_s, lost in sorted({(one[0], one[1]) for one in range_m.columns}):
        cells = []
        for flight in flights:
            mine = range_m[latency_s, lost, flight]
            nearer = range_m[0.0, 0.0, flight] - mine
            half = 1.96 * nearer.std() / len(nearer) ** 0.5
            ends = f"({nearer.mean() - half:,.0f} to {nearer.mean() + half:,.0f})"
            cells += [f"{mine.mean():,.0f}", f"{round(nearer.mean()):,} {ends}"]
        lines.append(f"| {latency_s:g} | {100 * lost:g} % | {' | '.join(cells)} |")
    return lines
