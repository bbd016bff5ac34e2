"""``python -m docs.make.platforms FOLDER``: a table of docs/platforms.md.

The folder is that of ``dsa-des study equipage`` (risk by who avoids) or ``link_latency`` (range of
the first alert by the link's latency and loss).
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import pandas as pd  # type: ignore[import-untyped]

from dsa_des.terminal.interruption import plain_ending
from dsa_des.terminal.terminal import say

_EVENTS = {"nmac": "NMACs", "well_clear_lost": "losses of well clear"}
_LATENCY, _LOSS = "wires[1].delay_s", "wires[1].drop_probability"
_RANGE = "first_alert_range_m.alerting"
_NOBODY, _ALONE = "none", ["ownship", "intruder"]


def rows(folder: Path) -> list[str]:
    """Return the lines of the table of the study whose folder it is."""
    names = set(pd.read_parquet(folder / "parts").columns)
    return latency_rows(folder) if _LATENCY in names else equipage_rows(folder)


def latency_rows(folder: Path) -> list[str]:
    """Return the lines of the table of ranges at the first alert, by latency and loss.

    Beside the mean of each flight is how much nearer it is, run by run, than with a link that is at
    once and loses nothing, with a 95 % interval (normal).
    """
    runs = pd.read_parquet(folder / "parts")
    flights = list(dict.fromkeys(runs.flight))
    lines = [
        "| latency, s | loss |" + "".join(f" {one}, m | nearer by, m |" for one in flights),
        "|---" * (2 + 2 * len(flights)) + "|",
    ]
    range_m = runs.pivot(index="replica", columns=[_LATENCY, _LOSS, "flight"], values=_RANGE)
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


def equipage_rows(folder: Path) -> list[str]:
    """Return the lines of the table of risk by who avoids, and what several that turn bring about.

    Events count by their encounters' weights, as shares of those without anybody's manoeuvres.
    """
    ratios, runs = (pd.read_parquet(folder / name) for name in ("ratios.parquet", "parts"))
    lines = ["| who avoids |" + "".join(f" {words} | risk ratio, 95 % | induced |"
             for words in _EVENTS.values()), "|---" * (1 + 3 * len(_EVENTS)) + "|"]  # fmt: skip
    for who, mine in ratios.groupby("equipage", sort=False):
        of = mine.set_index("result").to_dict("index")
        cells = (_cells(of[f"{event}_risk_ratio"]) for event in _EVENTS)
        lines.append(f"| {who} | {' | '.join(cells)} |")
    together: list[str] = []
    for event, words in _EVENTS.items():
        happens = runs.pivot(index="replica", columns="equipage", values=f"{event}_mitigated")
        weight = runs[runs.equipage == _NOBODY].set_index("replica").encounter_weight
        nominal = float((weight * happens[_NOBODY]).sum())
        for who in happens.columns.difference([_NOBODY, *_ALONE]):
            new = (happens[who] > 0.0) & (happens[_ALONE] == 0.0).all(axis=1)
            together.append(
                f"{who}: {int(new.sum())} of {int(happens[who].sum())} {words} where neither alone "
                f"has one, {float((weight * new).sum()) / nominal:.3f} of the nominal risk"
            )
    return [*lines, "", *together]


def _cells(one: dict[str, Any]) -> str:
    between = f"{one['ratio']:.3f} ({one['gamma_low']:.3f} to {one['gamma_high']:.3f})"
    ratio = between if one["induced_events"] or one["ratio"] != 1.0 else "1"
    return f"{one['mitigated_events']} | {ratio} | {one['induced']:.3f}"


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.platforms", description="Print a table of docs/platforms.md."
    )
    parser.add_argument("folder", type=Path, help="of dsa-des study equipage or link_latency")
    for line in rows(parser.parse_args(arguments).folder):
        say(line)
    return 0


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
