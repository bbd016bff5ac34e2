"""A row for each alert, with the decisions that belong to it, against a table made by hand."""

import csv
import io
from pathlib import Path

import pyarrow as pa
import pytest

from components.display.recorded_run import RecordedTables
from components.export.alert_levels import alerts_of
from components.export.operator_answers import operator_csv
from dsa_des.errors import UsageError

WALL = 1.8e9


def decided(time_s, decision, target="a", turn_rad=0.0, climb_m=0.0):
    return {
        "time_s": time_s, "decision": decision, "target": target, "turn_rad": turn_rad,
        "climb_m": climb_m, "wall_time_s": WALL + time_s,
    }  # fmt: skip


def rows(alerts, decisions):
    levels = [dict(zip(("time_s", "target", "level"), alert, strict=True)) for alert in alerts]
    tables = {"alerts": pa.Table.from_pylist(levels), "decisions": pa.Table.from_pylist(decisions)}
    text = operator_csv(RecordedTables(Path("run"), tables)).decode()
    return list(csv.DictReader(io.StringIO(text)))


def test_every_alert_has_the_first_answers_while_it_lasts():
    found = rows(
        [(1.0, "a", 0), (2.0, "a", 1), (2.0, "b", 2), (3.0, "a", 3), (9.0, "a", 0), (12.0, "a", 2)],
        [
            decided(1.5, "looked"),  # before there was an alert
            decided(2.25, "shown"), decided(2.5, "looked", "b"), decided(4.0, "looked"),
            decided(5.0, "rejected"), decided(6.0, "verified"),
            decided(7.5, "turn", None, turn_rad=-0.5235987755982988),
            decided(8.0, "climb", None, climb_m=152.4),
            decided(13.0, "shown"), decided(14.0, "climb", climb_m=-300.0),
        ],
    )  # fmt: skip
    assert [(row["target"], row["alert_s"], row["ended_s"]) for row in found] == [
        ("a", "2.0", "9.0"), ("b", "2.0", ""), ("a", "12.0", ""),
    ]  # fmt: skip
    first, other, again = found
    assert first["highest_level"] == "3" and first["shown_s"] == "2.25"
    assert (first["looked_s"], first["look_response_s"]) == ("4.0", "2.0")
    assert (first["judged_s"], first["judged_as"]) == ("5.0", "rejected")
    assert (first["acted_s"], first["action"], first["turn_deg"]) == ("7.5", "turn", "-30.0")
    assert first["climb_m"] == other["turn_deg"] == ""
    assert first["act_response_s"] == "5.5" and float(first["acted_wall_s"]) == WALL + 7.5
    assert (other["looked_s"], other["shown_s"], other["judged_s"]) == ("2.5", "", "")
    assert (other["action"], other["climb_m"]) == ("climb", "152.4")  # one manoeuvre, one alert
    assert (again["shown_s"], again["climb_m"], again["looked_s"]) == ("13.0", "-300.0", "")


def test_alerts_of_targets_without_tracks_are_apart():
    """Alerting by the truth has 0 for a track of each."""
    told = ("time_s", "target", "level", "track")
    levels = [(1.0, "a", 1, 0), (1.0, "b", 2, 0), (2.0, "a", 0, 0), (2.0, "b", 2, 0)]
    table = pa.Table.from_pylist([dict(zip(told, row, strict=True)) for row in levels])
    found = alerts_of(RecordedTables(Path("run"), {"alerts": table}))
    assert [(one.name, one.end_s) for one in found] == [("a", 2.0), ("b", None)]


def test_decisions_about_a_track_belong_to_its_alert():
    """Displays name what a tracker's alert is about by its track, as an operator knows no names."""
    told = ("time_s", "target", "level", "track")
    alerts = [
        (1.0, "a", 2, 7),
        (1.0, "a", 0, 9),
        (3.0, "a", 3, 7),
        (5.0, None, 1, 8),
    ]  # 7 is gone at 5 s
    tables = {
        "alerts": pa.Table.from_pylist([dict(zip(told, one, strict=True)) for one in alerts]),
        "decisions": pa.Table.from_pylist(
            [decided(2.0, "shown", "track 7"), decided(6.0, "verified", "track 8")]
        ),
    }
    text = operator_csv(RecordedTables(Path("run"), tables)).decode()
    first, second = csv.DictReader(io.StringIO(text))
    assert (first["target"], first["shown_s"], first["highest_level"]) == ("a", "2.0", "3")
    assert (first["ended_s"], first["judged_s"]) == ("5.0", "")
    assert (second["target"], second["judged_as"], second["shown_s"]) == ("track 8", "verified", "")


def test_a_run_without_a_console_is_refused():
    with pytest.raises(UsageError, match=r"run: has no decisions\.parquet"):
        operator_csv(RecordedTables(Path("run"), {"alerts": pa.table({"time_s": [1.0]})}))
