"""Differences of two runs in the words of the registered reports: no quantity is named here."""

from collections.abc import Mapping, Sequence
from typing import Any

from dsa_des.running.reports import Change, Difference, Report

_NOTHING = Difference("what differs", "share of what differs", lambda changes: 0.0)


class Comparison:
    """What all reports together say of the difference between two runs.

    Parameters
    ----------
    reports : sequence of Report
        Those that compare; the first one's `difference` counts.
    """

    def __init__(self, reports: Sequence[Report]) -> None:
        self._reports = [report for report in reports if hasattr(report, "compare")]
        #: Columns of tables.
        self.changes: tuple[Change, ...] = tuple(
            change for report in self._reports for change in getattr(report, "changes", ())
        )
        known = [report.difference for report in self._reports if hasattr(report, "difference")]
        #: The one number that is weighed against cost.
        self.difference = known[0] if known else _NOTHING

    def __call__(self, reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
        """Return what changed from one run's recorded tables to another's."""
        found: dict[str, Any] = {}
        for report in self._reports:
            found.update(report.compare(reference, other))
        return found

    def remarks(self, changes: Mapping[str, Any]) -> list[str]:
        """Return what is better said in words than in columns."""
        return [
            remark
            for report in self._reports
            if hasattr(report, "remarks")
            for remark in report.remarks(changes)
        ]


def shown(change: Change, changes: Mapping[str, Any], none: str) -> str:
    """Return one number as its table shows it, or `none` where it is unknown."""
    value = changes.get(change.key)
    return none if value is None else format(value, change.form)
