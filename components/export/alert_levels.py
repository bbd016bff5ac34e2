"""Alerts of a recorded run: when each came, changed its level and ended."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from components.display.recorded_run import RecordedTables


@dataclass
class Alert:
    """An alert of a target or a track, from when its level rises above 0 until it is 0 again."""

    block: str
    #: Of a track the one it was near when the alert came, None for none.
    target: str | None
    #: The tracker's number, where alerts are of tracks.
    track: int | None
    #: Time, s, and level of each change, the first when the alert came.
    levels: list[tuple[float, int]]
    #: None if it lasts until the run ends.
    end_s: float | None = None

    @property
    def start_s(self) -> float:
        """Return the time (s) at which the alert's level first rose above 0."""
        return self.levels[0][0]

    @property
    def track_name(self) -> str | None:
        """Return the name that displays give the track of the alert."""
        return None if self.track is None else f"track {self.track}"

    @property
    def name(self) -> str | None:
        """Return the name of an alert's target, or its track's displayed name if none is known."""
        return self.target or self.track_name

    def level_periods(self, run_end_s: float) -> Iterator[tuple[float, float, int]]:
        """Yield start, end and level of each period of constant level."""
        ends = [time_s for time_s, _ in self.levels[1:]]
        ends.append(run_end_s if self.end_s is None else self.end_s)
        for (start_s, level), end_s in zip(self.levels, ends, strict=True):
            yield start_s, end_s, level


def alerts_of(run: RecordedTables) -> list[Alert]:
    """Return a run's alerts in order of start time; an empty list if it has no table of alerts."""
    if "alerts" not in run.tables:
        return []
    for name in ("time_s", "level"):
        run.numbers("alerts", name)  # refuses what another program may have written
    on: dict[Any, Alert] = {}
    result = []
    rows = sorted(run.tables["alerts"].to_pylist(), key=_time_and_block)
    for (time_s, block), look in groupby(rows, key=_time_and_block):
        now = {(block, _track_or_target_of(row)): row for row in look}
        # A track that its block no longer tells of is gone, and its alert with it.
        for about in [a for a in on if a[0] == block and isinstance(a[1], int) and a not in now]:
            on.pop(about).end_s = time_s
        for about, row in now.items():
            level = row["level"]
            if level <= 0:
                if about in on:
                    on.pop(about).end_s = time_s
            elif about not in on:
                on[about] = Alert(block, row["target"], row.get("track") or None, [(time_s, level)])
                result.append(on[about])
            elif on[about].levels[-1][1] != level:
                on[about].levels.append((time_s, level))
    return result


def _time_and_block(row: dict[str, Any]) -> tuple[float, str]:
    return float(row["time_s"]), row.get("block", "")


def _track_or_target_of(row: dict[str, Any]) -> Any:
    return row.get("track") or row["target"]  # tracks count from 1; 0 stands where there are none
