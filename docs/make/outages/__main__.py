"""``python -m docs.make.outages RISK MOMENT LINK``: the tables of outages, of docs/scenes.md.

The folders are those of ``dsa-des study radar_outage_risk``, ``radar_outage_moment`` and
``link_outage_risk``.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd  # type: ignore[import-untyped]

from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

_EVENTS = ("nmac", "well_clear_lost")
_NEVER = "never"
_LEAD, _MISSED, _OUT = "alert_to_loss_s.alerting", "alert_missed.alerting", "out_share.radar"


def ratios_of(folder: Path) -> dict[str, list[str]]:
    """Return the risk ratios of near collisions and losses with their intervals, by outage."""
    ratios = pd.read_parquet(folder / "ratios.parquet")
    found: dict[str, list[str]] = {}
    for outage, mine in ratios.groupby("outage", sort=False):
        of = mine.set_index("result")
        found[str(outage)] = [
            f"{one.ratio:.2f} ({one.gamma_low:.2f} to {one.gamma_high:.2f})"
            for one in (of.loc[f"{event}_risk_ratio"] for event in _EVENTS)
        ]
    return found


def link_rows(folder: Path) -> list[str]:
    """Return the lines of the table of risk over a link's outages."""
    head = "| mean time up, to repair | NMAC, risk ratio, 95 % | loss of well clear |"
    rows = (f"| {outage} | {' | '.join(cells)} |" for outage, cells in ratios_of(folder).items())
    return [head, "|---" * 3 + "|", *rows]


def risk_rows(folder: Path) -> list[str]:
    """Return the lines of the table of risk over outages.

    Alerts missed because of an outage are those that the run of the same draws without one has.
    """
    runs = pd.read_parquet(folder / "parts")
    lines = [
        "| mean time up, to repair | out | NMAC, risk ratio, 95 % | loss of well clear | "
        "alerts missed | because of it | missed while out |",
        "|---" * 7 + "|",
    ]
    never = runs[runs.outage == _NEVER].set_index("replica")[_MISSED]
    ratios = ratios_of(folder)
    for outage, mine in runs.groupby("outage", sort=False):
        cells = ratios[str(outage)]
        missed = mine.set_index("replica")[_MISSED]
        because = int((missed > never[missed.index]).sum())
        while_out = int(mine["alert_missed_while_out.alerting"].sum())
        counts = f"{int(missed.sum())} of {len(mine)} | {because} | {while_out}"
        share = f"{100 * mine[_OUT].mean():.0f} %"
        lines.append(f"| {outage} | {share} | {' | '.join(cells)} | {counts} |")
    return lines


def moment_rows(folder: Path) -> list[str]:
    """Return the lines of the table of what an alert loses, over when the failure begins.

    It loses what it has in the last cell, whose failure begins after all alerts.
    """
    runs = pd.read_parquet(folder / "parts")
    late = runs[runs.fails_at_s == runs.fails_at_s.max()].set_index("replica")
    lines = [
        "| fails at, s | from alert to loss, s | lost, s | most lost, s | without any alert |",
        "|---" * 5 + "|",
    ]
    for fails_s, mine in runs.groupby("fails_at_s"):
        lead = mine.set_index("replica")[_LEAD]
        lost = late[_LEAD] - lead
        missed = f"{int(mine[_MISSED].sum())} of {len(mine)}"
        each = f"{lead.mean():.1f} | {lost.mean():.1f} | {lost.max():.1f}"
        lines.append(f"| {fails_s:g} | {each} | {missed} |")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.outages", description="Print the tables of outages."
    )
    parser.add_argument("risk", type=Path, help="of dsa-des study radar_outage_risk")
    parser.add_argument("moment", type=Path, help="of dsa-des study radar_outage_moment")
    parser.add_argument("link", type=Path, help="of dsa-des study link_outage_risk")
    folders = parser.parse_args(arguments)
    tables = risk_rows(folders.risk), moment_rows(folders.moment), link_rows(folders.link)
    for line in (*tables[0], "", *tables[1], "", *tables[2]):
        say(line)
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
