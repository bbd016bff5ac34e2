"""What an operator did about each alert, as CSV for work on human factors."""

import csv
import io
import math
from typing import Any

from components.export.recorded import RecordedTables
from dsa_des.errors import UsageError

_COLUMNS = (
    "target", "alert_s", "ended_s", "highest_level", "shown_s", "looked_s", "judged_s", "judged_as",
    "acted_s", "action", "value", "look_response_s", "judge_response_s", "act_response_s",
    "shown_wall_s", "looked_wall_s", "judged_wall_s", "acted_wall_s",
)  # fmt: skip
_JUDGED, _ACTS = ("verified", "rejected"), ("turn", "climb")


def operator_csv(run: RecordedTables) -> bytes:
    """Return a row for each alert: when it came, was on screen, was looked at, judged, acted on.

    An alert of a target lasts as long as its level is above 0 without a gap. To it belongs the
    first decision of each kind about the target while it lasts; a manoeuvre also where it names no
    target, but not one that belongs to an alert before. Responses are counted from when the alert
    came; ``_wall_s`` are seconds since 1970 by the clock on the wall. What did not happen is empty;
    turns are in degrees to the right, climbs in m.

    Raises
    ------
    UsageError
        The run has no alerts or no decisions.
    """
    for name, needed in (("alerts", "an alerting block"), ("decisions", "an operator's console")):
        if name not in run.tables:
            raise UsageError(f"{run.folder}: has no {name}.parquet, which {needed} records")
    decisions = run.tables["decisions"].to_pylist()
    taken: set[int] = set()
    rows = [_answered(alert, decisions, taken) for alert in _alerts(run.tables["alerts"])]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue().encode("utf-8")


def _alerts(table: Any) -> list[dict[str, Any]]:
    """Return the alerts of all targets in the order in which they came."""
    on: dict[str, dict[str, Any]] = {}
    found = []
    rows = sorted(table.select(["time_s", "target", "level"]).to_pylist(), key=_time)
    for row in rows:
        target, level = row["target"], row["level"]
        if level > 0:
            if target not in on:
                on[target] = {"target": target, "alert_s": row["time_s"], "highest_level": 0,
                              "ended_s": None}  # fmt: skip
                found.append(on[target])
            on[target]["highest_level"] = max(on[target]["highest_level"], level)
        elif target in on:
            on.pop(target)["ended_s"] = row["time_s"]
    return found


def _answered(
    alert: dict[str, Any], decisions: list[dict[str, Any]], taken: set[int]
) -> dict[str, Any]:
    """Return the row of an alert with the decisions that belong to it."""
    ended_s = math.inf if alert["ended_s"] is None else alert["ended_s"]
    row = dict(alert)
    for place, one in enumerate(decisions):
        if not alert["alert_s"] <= one["time_s"] <= ended_s or place in taken:
            continue
        what = one["decision"]
        about = one["target"] == alert["target"]
        if what in _ACTS and (about or one["target"] is None):
            name = "acted"
        elif about:
            name = "judged" if what in _JUDGED else what
        else:
            continue
        if f"{name}_s" in row:
            continue
        taken.add(place)
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


def _time(row: dict[str, Any]) -> float:
    return float(row["time_s"])
