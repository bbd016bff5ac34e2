"""What an operator did about each alert, as CSV for work on human factors."""

import csv
import io
import math
from typing import Any

from components.display.recorded_run import RecordedTables
from components.export.alert_levels import alerts_of
from dsa_des.errors import UsageError

_COLUMNS = (
    "target", "alert_s", "ended_s", "highest_level", "shown_s", "looked_s", "judged_s", "judged_as",
    "acted_s", "action", "turn_deg", "climb_m",
    "look_response_s", "judge_response_s", "act_response_s",
    "shown_wall_s", "looked_wall_s", "judged_wall_s", "acted_wall_s",
)  # fmt: skip
_JUDGED, _ACTS = ("verified", "rejected"), ("turn", "climb")


def operator_csv(run: RecordedTables) -> bytes:
    """Return CSV, a row for each alert: when it began, was displayed, looked at, judged, acted on.

    Alerts are those of `alerts_of`; of several platforms those on which somebody decides, each by
    itself.
    To it belongs the first decision of each kind about the target, or about "track N" as displays
    name what is known by a track alone, while it lasts; a manoeuvre also where it names no target,
    but not one that belongs to an alert before. Responses are counted from when the alert
    came; ``_wall_s`` are seconds since 1970 by the clock on the wall. What did not happen is empty;
    ``turn_deg`` is to the right.
    """
    for name, needed in (("alerts", "an alerting block"), ("decisions", "an operator's console")):
        if name not in run.tables:
            raise UsageError(f"{run.folder}: has no {name}.parquet, which {needed} records")
    each = [run]
    if run.has_columns("decisions", "platform"):
        on = sorted({str(name) for name in run.texts("decisions", "platform")})
        each = [run.seen_from(name) for name in on] or each
    rows = []
    for mine in each:
        decisions, taken = mine.tables["decisions"].to_pylist(), set[int]()
        rows += [
            _alert_row(alert, names, decisions, taken)
            for alert, names in _alert_rows_and_names(mine)
        ]
    stream = io.StringIO()
    writer = csv.DictWriter(stream, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue().encode("utf-8")


def _alert_rows_and_names(run: RecordedTables) -> list[tuple[dict[str, Any], set[str | None]]]:
    """Return alerts in order of start time: each one's row, and its target's and track's names."""
    result = []
    for alert in alerts_of(run):
        row = {
            "target": alert.name, "alert_s": alert.start_s,
            "highest_level": max(level for _, level in alert.levels), "ended_s": alert.end_s,
        }  # fmt: skip
        result.append((row, {alert.target, alert.track_name} - {None}))
    return result


def _alert_row(
    alert: dict[str, Any],
    names: set[str | None],
    decisions: list[dict[str, Any]],
    taken: set[int],
) -> dict[str, Any]:
    """Return an alert's row with the first matching decisions; their numbers go to ``taken``."""
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
            if what == "turn":
                row["turn_deg"] = round(math.degrees(one["turn_rad"]), 6)
            else:
                row["climb_m"] = round(one["climb_m"], 6)
    for name, short in (("looked", "look"), ("judged", "judge"), ("acted", "act")):
        if f"{name}_s" in row:
            row[f"{short}_response_s"] = round(row[f"{name}_s"] - row["alert_s"], 9)
    return row
