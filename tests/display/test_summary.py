"""Running summaries, against columns written by hand and against the recorded tables."""

import json

import numpy as np

import dsa_des
from components.display.summary import SensorSummary
from components.display.terminal import lines_on_sensors_without_detection, outcome_lines
from dsa_des.block.message import Text

NAMES = ("eo", "radar")
TARGETS = ("a", "b", "c")


def text(names, all_names):
    codes = [-1 if name is None else all_names.index(name) for name in names]
    return Text(np.array(codes, dtype=np.int32), all_names)


def scans(rows):
    """Columns from rows of (block, tick, evaluated, skipped_range)."""
    return {
        "block": text([row[0] for row in rows], NAMES),
        "tick": np.array([row[1] for row in rows], dtype=np.int64),
        "evaluated": np.array([row[2] for row in rows], dtype=np.int64),
        "skipped_range": np.array([row[3] for row in rows], dtype=np.int64),
    }


def detections(rows):
    """Columns from rows of (block, tick, target, true range); ten ticks are a second."""
    tick = np.array([row[1] for row in rows], dtype=np.int64)
    return {
        "block": text([row[0] for row in rows], NAMES),
        "tick": tick,
        "time_s": tick / 10,
        "target": text([row[2] for row in rows], TARGETS),
        "true_range_m": np.array([row[3] for row in rows], dtype=np.float64),
    }


SEEN = [
    ("eo", 10, "b", 500.0),
    ("radar", 10, "a", 900.0),
    ("radar", 10, "b", 500.0),
    ("radar", 10, "c", 700.0),
    ("radar", 20, "a", 800.0),
    ("eo", 30, "c", 300.0),
    ("eo", 30, "a", 700.0),
    ("radar", 30, "a", 700.0),
]


def sensors_of(pieces, sensors=NAMES):
    observer = SensorSummary(sensors)
    for table, columns in pieces:
        observer.update(table, columns)
    return observer.result()["sensors"]


def test_scans_are_counted_with_what_was_skipped():
    rows = [("eo", 0, 2, 1), ("radar", 0, 3, 0), ("eo", 5, 1, 2), ("eo", 10, 0, 3)]
    result = sensors_of([("scans", scans(rows))])
    assert (result["eo"]["scans"], result["eo"]["evaluated"]) == (3, 3)
    assert (result["radar"]["scans"], result["radar"]["evaluated"]) == (1, 3)
    assert result["eo"]["skipped"] == {
        "absent": 0,
        "off": 0,
        "field_of_view": 0,
        "range": 6,
        "culled": 0,
    }


def test_a_sensor_that_saw_nothing_is_there():
    result = sensors_of([], sensors=("radar", "ir"))
    assert list(result) == ["ir", "radar"]
    assert result["ir"] == {
        "scans": 0,
        "evaluated": 0,
        "detections": 0,
        "false_alarms": 0,
        "skipped": {"absent": 0, "off": 0, "field_of_view": 0, "range": 0, "culled": 0},
        "first_detection": None,
        "last_detection": None,
    }


def test_results_are_plain_json():
    result = sensors_of([("detections", detections(SEEN)), ("scans", scans([("eo", 0, 2, 1)]))])
    assert json.loads(json.dumps(result, allow_nan=False)) == result


def test_sightings_at_the_first_and_the_last_scan_are_marked():
    rows = [("radar", 10, 1, 0), ("radar", 20, 1, 0), ("radar", 30, 1, 0)]
    early = [("eo", 5, 1, 0), ("eo", 30, 1, 0), ("eo", 40, 1, 0)]
    pieces = [("scans", scans(rows)), ("scans", scans(early)), ("detections", detections(SEEN))]
    found = sensors_of(pieces)
    assert found["radar"]["first_detection"]["at"] == "the start"
    assert found["radar"]["last_detection"]["at"] == "the end of the run"
    assert "at" not in found["eo"]["first_detection"]
    assert "at" not in found["eo"]["last_detection"]


def test_a_line_for_each_block():
    summary = {
        "tracks": {
            "ekf": {
                "confirmed": 3,
                "false": 1,
                "position_error_m": 34.56,
                "first_confirmed": {"time_s": 1.0, "range_m": None},
                "targets": {f"t{i}": {"time_s": 9.0 - i, "range_m": 1e3 * i} for i in range(1, 7)},
            },
            "eo": {"confirmed": 1, "first_confirmed": {"time_s": 4.0, "range_m": None}},
            "camera": {
                "confirmed": 2,
                "false": None,
                "position_error_m": None,
                "targets": {},
                "first_confirmed": {"time_s": 4.5, "range_m": None},
            },
            "one": {
                "confirmed": 1,
                "false": 0,
                "first_confirmed": {"time_s": 5.0, "range_m": 7e3},
            },
            "ir": {"confirmed": 0},
        },
        "alerts": {
            "alerting": {
                "1": {
                    "first_s": 12.0,
                    "last_s": 30.0,
                    "targets": {
                        "a": {"first_s": 14.25, "last_s": 14.25},
                        "b": {"first_s": 12.0, "last_s": 30.0},
                    },
                },
                "3": {
                    "first_s": 14.25,
                    "last_s": 14.25,
                    "targets": {
                        "a": {"first_s": 14.25, "last_s": 14.25},
                    },
                },
            },
            "true": {},
        },
        "alerts_of": {"alerting": ["ekf", "eo"]},
        "manoeuvres": {
            "a": {"count": 0, "first_s": None, "last_s": None},
            "b": {"count": 1, "first_s": 22.0, "last_s": 22.0},
            "c": {"count": 2, "first_s": 22.0, "last_s": 34.0},
        },
    }
    assert outcome_lines(summary) == [
        "ekf: 3 confirmed tracks, 1 of them false; position error 34.6 m rms; "
        "first within 300 m of t6 at 3.0 s "
        "(6.00 km away), t5 at 4.0 s (5.00 km away), t4 at 5.0 s (4.00 km away), t3 at 6.0 s "
        "(3.00 km away) and 2 more targets",
        "eo: 1 confirmed track; first confirmed at 4.0 s",
        "camera: 2 confirmed tracks, all without a range; first confirmed at 4.5 s",
        "one: 1 confirmed track, none false; first confirmed at 5.0 s (7.00 km away)",
        "ir: no confirmed track",
        "alerting (by ekf and eo): level 1 from 12.0 s to 30.0 s "
        "(b from 12.0 s to 30.0 s, a at 14.2 s)",
        "alerting (by ekf and eo): level 3 at 14.2 s (a)",
        "true: no alert",
        "a: no manoeuvre",
        "b: 1 manoeuvre, at 22.0 s",
        "c: 2 manoeuvres, from 22.0 s to 34.0 s",
    ]
    assert outcome_lines({}) == []


def test_a_sensor_that_is_off_is_said_to_be(configs):
    scene = dsa_des.load_scene(
        configs / "first_light.toml", sets=["blocks.ir.enabled=false"], duration_s="0.1"
    )
    sensors = dsa_des.run(scene).summary["sensors"]
    assert (
        "ir saw nothing: it is switched off (enabled = false)"
        in lines_on_sensors_without_detection(sensors)
    )
    assert [name for name, told in sensors.items() if "enabled" in told] == ["ir"]


def test_each_sensor_that_saw_nothing_says_why_and_no_other_does():
    seen = {"at": "", "time_s": 1.0}
    sensors = {
        "first": {"first_detection": seen, "scans": 9, "evaluated": 9},
        "idle": {"first_detection": None, "scans": 0},
        "second": {"first_detection": seen, "scans": 9, "evaluated": 9},
        "blind": {"first_detection": None, "scans": 20, "evaluated": 5,
                  "skipped": {"one": 4, "none": 0, "other": 1011}},
        "alone": {"first_detection": None, "scans": 7, "evaluated": 7, "skipped": {}},
    }  # fmt: skip
    assert lines_on_sensors_without_detection(sensors) == [
        "idle saw nothing: it never scanned",
        "blind saw nothing: target other in 1,011, one in 4, in reach but not detected in 5 of "
        "1,020 looks (one per scan and target)",
        "alone saw nothing: target in reach but not detected in 7 of 7 scans",
    ]
