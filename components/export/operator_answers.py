"""What an operator did about each alert, as CSV for work on human factors."""

import csv
import io
import math
from itertools import groupby
from typing import Any

from components.display.recorded_run import RecordedTables
from dsa_des.errors import UsageError

_COLUMNS = (
    "target", "alert_s", "ended_s", "highest_level", "shown_s", "looked_s", "judged_s", "judged_as",
    "acted_s", "action", "value", "look_response_s", "judge_response_s", "act_response_s",
    "shown_wall_s", "looked_wall_s", "judged_wall_s", "acted_wall_s",
)  # fmt: skip
_JUDGED, _ACTS = ("verified", "rejected"), ("turn", "climb")


def operator_csv(run: RecordedTables) -> bytes:
    """Return a row for each alert: when it came, was on screen, was looked at, judged, acted on.

    An alert of a target, or of a track of it, lasts as long as its level is above 0 without a gap.
    To it belongs the first decision of each kind about the target, or about "track N" as displays
    name what is known by a track alone, while it lasts; a manoeuvre also where it names no target,
    but not one that belongs to an alert before. Responses are counted from when the alert
    came; ``_wall_s`` are seconds since 1970 by the clock on the wall. What did not happen is empty;
    turns are in degrees to the right, climbs in m.
    """
    for name, needed in (("alerts", "an alerting block"), ("decisions", "an operator's console")):
        if name not in run.tables:
            raise UsageError(f"{run.folder}: has no {name}.parquet, which {needed} records")
    decisions = run.tables["decisions"].to_pylist()
    taken: set[int] = set()
    rows = [
        _answered(alert, names, decisions, taken) for alert, names in _alerts(run.tables["alerts"])
    ]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue().encode("utf-8")


def _alerts(table: Any) -> list[tuple[dict[str, Any], set[str | None]]]:
    """Return the alerts in the order in which they came, and the names of what each is about."""
    on: dict[Any, dict[str, Any]] = {}
    found = []
    for (time_s, block), look in groupby(sorted(table.to_pylist(), key=_look), key=_look):
        rows = {(block, _about(row)): row for row in look}
        # A track that its block no longer tells of is gone, and its alert with it.
        for about in [a for a in on if a[0] == block and isinstance(a[1], int) and a not in rows]:
            on.pop(about)["ended_s"] = time_s
        for about, row in rows.items():
            target, level, track = row["target"], row["level"], row.get("track")
            if level > 0:
                if about not in on:
                    label = None if track is None else f"track {track}"
                    on[about] = {"target": target or label, "alert_s": time_s,
                                 "highest_level": 0, "ended_s": None}  # fmt: skip
                    found.append((on[about], {target, label} - {None}))
                on[about]["highest_level"] = max(on[about]["highest_level"], level)
            elif about in on:
                on.pop(about)["ended_s"] = time_s
    return found


def _look(row: dict[str, Any]) -> tuple[float, str]:
    return float(row["time_s"]), row.get("block", "")


def _about(row: dict[str, Any]) -> Any:
    return row["target"] if row.get("track") is None else row["track"]


def _answered(
    alert: dict[str, Any],
    names: set[str | None],
    decisions: list[dict[str, Any]],
    taken: set[int],
) -> dict[str, Any]:
    """Return the row of an alert with the decisions that belong to it."""
    ended_s = math.inf if alert["ended_s"] is None else alert["ended_s"]
    row = dict(alert)
    for number, one in enumerate(decisions):
        if not alert["alert_s"] <= one["time_s"] <= ended_s or number in taken:
            continue
        what = one["decision"]
        about = one["target"] in names
        if what in _ACTS and (about or one["target"] is None):
            name = "acted"
        elif about:
            name = "judged" if what in _JUDGED else what
        else:
            continue
        if f"{name}_s" in row:
            continue
        taken.add(number)
        row[f"{name}_s"], row[f"{name}_wall_s"] = one["time_s"], one["wall_time_s"]
        if name == "judged":
            row["judged_as"] = what
        elif name == "acted":
            row["action"] = what
            turned = what == "turn"
            row["value"] = round(math.degrees(one["turn_rad"]) if turned else one["climb_m"], 6)
    for name, short in (("looked", "look"), ("judged", "judge"), ("acted", "act")):
        if f"{name}_s" in row:
            row[f"{short}_response_s"] = round(row[f"{name}_s"] - row["alert_s"], 9)
    return row
