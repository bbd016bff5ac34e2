"""Bands of guidance in a scene: what an avoidance flies out of, and what its keys change."""

import math

from covering import covers
from test_avoidance_by_bands import scene as by_bands
from wired import rows, run

KIND = ("guidance.daidalus",)


def scene(tmp_path, **keys):
    found = by_bands(tmp_path)
    found["duration_s"] = 45
    found["record"] = {"truth": False}
    conf = found["blocks"]["avoidance"]["conf"]
    found["blocks"]["guidance"] = {"type": "guidance.daidalus", "conf": conf, **keys}
    found["wires"].append("alerting -> guidance")
    return found


def bands(run, time_s, band="direction"):
    return [row for row in rows(run, "bands") if (row["time_s"], row["band"]) == (time_s, band)]


def test_an_avoidance_turns_to_the_edge_of_a_band(tmp_path):
    found = run(scene(tmp_path))
    told = rows(found, "manoeuvres")[0]
    # Head-on, heading 217 deg: one band about the own direction, its nearer edge to the left.
    there = bands(found, told["time_s"])
    assert {row["region"] for row in there} <= {"MID", "NEAR"}
    assert {row["low_m"] for row in there} == {row["high_m"] for row in there} == {None}
    low, high = min(row["low_rad"] for row in there), max(row["high_rad"] for row in there)
    assert low < math.radians(217) < high
    edge = low - math.radians(217)
    # The alerting's own velocity is a mean over seconds, good to a few hundredths of a degree.
    assert abs(told["turn_rad"] - edge) < math.radians(0.5)
    levels = bands(found, told["time_s"], "altitude")
    assert min(row["low_m"] for row in levels) < 930 < max(row["high_m"] for row in levels)
    assert {row["low_rad"] for row in levels} == {None}


@covers("level", of=KIND)
def test_bands_come_with_alerts_of_a_level(tmp_path):
    found = run(scene(tmp_path))
    began = next(row["time_s"] for row in rows(found, "alerts") if row["level"] >= 1)
    assert rows(found, "bands")[0]["time_s"] == began
    higher = run(scene(tmp_path, level=3))
    assert rows(higher, "bands") == []
    every = run(scene(tmp_path, level=0))
    assert rows(every, "bands")[0]["time_s"] <= began


@covers("kinds", of=KIND)
def test_bands_are_of_the_kinds_that_are_asked_for(tmp_path):
    both, three = run(scene(tmp_path)), run(scene(tmp_path, kinds=["speed", "direction"]))
    assert {row["band"] for row in rows(both, "bands")} == {"direction", "altitude"}
    assert {row["band"] for row in rows(three, "bands")} == {"direction", "speed"}

    # What is asked for beside them changes no band.
    def turns(found):
        return [row for row in rows(found, "bands") if row["band"] == "direction"]

    assert turns(both) == turns(three)
    began_s = rows(three, "bands")[0]["time_s"]
    speeds = bands(three, began_s, "speed")
    assert speeds and {row["low_rad"] for row in speeds} == {row["low_m"] for row in speeds} == {
        None
    }
    # Head-on nobody escapes by flying faster: the own speed and all above it are in bands.
    own_mps = 50.0
    assert min(r["low_mps"] for r in speeds) < own_mps < max(r["high_mps"] for r in speeds)


@covers("conf", "alerter", of=KIND)
def test_a_larger_alerter_has_wider_bands(tmp_path):
    width = {}
    for number in (1, 2):
        found = run(scene(tmp_path, alerter=number))
        there = bands(found, 40.0)
        width[number] = max(r["high_rad"] for r in there) - min(r["low_rad"] for r in there)
    assert width[2] > 1.2 * width[1]
