"""What a run prints: content and width, not the looks of every line."""

import io

import pytest
from rich.console import Console

from components.display.report import DetectAndSenseReport
from components.display.terminal import distance_text, speed_text

SIGHTING = {"time_s": 60.013, "range_m": 5536.4, "target": "crossing"}
LAST = {"time_s": 114.463, "range_m": 122.1, "target": "head_on"}


def sensor(scans, detections, first=None, last=None):
    return {
        "scans": scans,
        "evaluated": scans,
        "detections": detections,
        "skipped": {},
        "first_detection": first,
        "last_detection": last,
    }


def printed(summary, width=80):
    file = io.StringIO()
    DetectAndSenseReport().show(Console(file=file, width=width), summary)
    return file.getvalue()


def test_a_whole_summary_fits_80_columns():
    text = printed(
        {
            "sensors": {"eo": sensor(2400, 1733, SIGHTING, LAST), "ir": sensor(240, 0)},
            "fused": {"radar+eo": 1234, "eo": 17},
            "targets": {
                "head_on": {"closest_approach": {"time_s": 109.1, "range_m": 72.9}},
                "crossing": {"closest_approach": {"time_s": 99.6, "range_m": 1555.2}},
                "ghost": {"closest_approach": None},
            },
            "simulated_s": 120.0,
            "cpu_s": 0.04,
            "out": "runs/first_light-001",
        }
    )
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "\x1b" not in text
    rows = [line.split() for line in text.splitlines()]
    assert ["eo", "2,400", "1,733", "first", "60.013", "5.54", "km", "crossing"] in rows
    assert ["last", "114.463", "122.1", "m", "head_on"] in rows
    assert ["ir", "240", "0", "never"] in rows
    assert ["radar+eo", "1,234"] in rows
    assert ["head_on", "109.100", "72.9", "m"] in rows
    assert text.index("head_on     109") < text.index("crossing     99")  # nearest first
    assert "1 are never there" in text
    assert "3,000 simulated s per s" in text
    assert "Results in runs/first_light-001" in text


def test_names_are_printed_as_they_are_and_folded():
    names = (
        "[bold]x[/bold]",
        "a_name_that_is_much_longer_than_anyone_would_like_it_to_be_on_a_screen",
    )
    sightings = [{"time_s": 1.0, "range_m": None, "target": name} for name in names]
    text = printed({"sensors": {"radar": sensor(1, 1, *sightings)}})
    assert names[0] in text
    assert "unknown" in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_many_targets_are_cut_to_the_nearest():
    targets = {
        f"t{i:03d}": {"closest_approach": {"time_s": 1.0, "range_m": 1000.0 - i}}
        for i in range(200)
    }
    text = printed({"targets": targets})
    assert "t199" in text
    assert "t000" not in text
    assert "190 more pass farther away" in text


def test_a_long_path_is_not_broken():
    path = "/somewhere/" + "x" * 120
    assert f"Results in {path}\n" in printed({"out": path})


def test_nothing_to_say_is_fine():
    assert printed({}) == ""
    assert printed({"out": None, "sensors": {}, "fused": {}, "targets": {}}) == ""


@pytest.mark.parametrize(
    ("range_m", "text"),
    [(None, "unknown"), (0.04, "0.0 m"), (999.94, "999.9 m"), (999.96, "1.00 km"),
     (12000.2, "12.00 km"), (1234567.0, "1,234.57 km")],
)  # fmt: skip
def test_distances_read_well(range_m, text):
    assert distance_text(range_m) == text


def test_speed_survives_a_clock_that_did_not_tick():
    assert speed_text(10.0, 0.0) == "10 s simulated in 0 s of CPU time"
    assert "1,230" in speed_text(36000.0, 29.3)


def test_why_a_sensor_saw_nothing():
    blind = sensor(70, 0) | {"evaluated": 0, "skipped": {"field_of_view": 70, "range": 0}}
    weak = sensor(70, 0) | {"evaluated": 100, "skipped": {"field_of_view": 10, "range": 30}}
    seeing = sensor(9, 1, SIGHTING, LAST) | {"evaluated": 0, "skipped": {"range": 9}}
    text = " ".join(printed({"sensors": {"eo": blind, "ir": weak, "radar": seeing}}).split())
    assert "eo saw nothing: target outside its field of view in 70 of 70 scans" in text
    assert (
        "ir saw nothing: target beyond its range in 30, outside its field of view in 10, "
        "in reach but not detected in 100 of 140 looks" in text
    )
    assert "radar saw nothing" not in text


def test_censored_values_are_marked():
    first = SIGHTING | {"at": "the start"}
    approach = {"time_s": 9.0, "range_m": 800.0, "at": "the end of the run"}
    text = printed(
        {
            "sensors": {"eo": sensor(1, 1, first, LAST)},
            "targets": {"a": {"closest_approach": approach}, "b": {"closest_approach": None}},
        }
    )
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert any(line.startswith("eo 1 1 first* 60.013") for line in lines)
    assert "a 9.000 800.0 m at the end of the run" in lines
    assert "* cut off by the run: first at the start" in lines
    assert sum("*" in line for line in lines) == 2
