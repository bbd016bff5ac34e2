"""Tracks end in time though nothing comes: of a whole fusion, over a wire, of what is held."""

from fractions import Fraction

import crooked
import numpy as np
import pytest
from same_runs import replicas_of, same_as_alone, same_in_any_window
from wired import HEARS_ALL, chain, rows, run

import dsa_des
from dsa_des.block.component import Component, Input
from dsa_des.block.wake import Wake

RADAR = {**HEARS_ALL, "scan_rate_hz": 2, "azimuth_resolution_deg": 0.3,
         "elevation_resolution_deg": 0.3, "range_resolution_m": 5.0}  # fmt: skip
GATED = {"type": "fusion.gated"}
#: One that is gone at 4 s, beside one that stays; none of them has been seen since.
LEAVES = {**crooked.ROLLING, "end_time_s": 4.1}
STAYS = {**crooked.DIVING, "name": "stays"}


def silent(fusion=GATED, *, targets=(LEAVES,), duration_s=14, radar=RADAR, **tracker):
    tracker = {"type": "tracking.ekf", **tracker}
    return chain({"radar": radar}, targets=targets, fusion=fusion, tracker=tracker,
                 duration_s=duration_s)  # fmt: skip


def ends(scene):
    """When each track is told deleted: by number."""
    return {
        row["track"]: row["time_s"]
        for row in rows(run(scene), "state_tracks")
        if row["track_status"] == "deleted"
    }


@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
def test_a_track_ends_within_half_a_second_of_its_time(kind):
    """The last scan that sees it is at 4 s, and its time is 6 s if nothing else is said."""
    assert ends(silent(type=kind)) == {1: 10.5}


@pytest.mark.parametrize(
    "fusion", [GATED, {"type": "fusion.pick_best"}, {"type": "fusion.pass_through"}]
)
def test_every_fusion_lets_it_end(fusion):
    assert ends(silent(fusion, delete_after_s=3)) == {1: 7.5}


def test_it_waits_for_what_may_come_late():
    late = {**RADAR, "latency_s": 0.8}
    assert ends(silent(radar=late, delete_after_s=3)) == {1: 8.0}


def test_a_slow_sensor_is_waited_for():
    """Of a radar that looks every 4 s a track lives for three of its looks, at 0.5 Hz for 6 s."""
    slow = {**RADAR, "scan_rate_hz": "1/4"}
    assert ends(silent(radar=slow, duration_s=20)) == {1: 16.5}
    assert ends(silent(radar={**RADAR, "scan_rate_hz": "1/2"}, duration_s=20)) == {1: 10.5}


def test_the_others_are_told_as_they_were():
    """Both with the states of the last look, which was at 5 s."""
    scene = silent(targets=[LEAVES, {**STAYS, "end_time_s": 5.1}], delete_after_s=3)
    found = rows(run(scene), "state_tracks")
    told = [(row["time_s"], row["track_status"], row["updated_s"]) for row in found[-3:]]
    assert sorted(told) == [(7.5, "confirmed", 5.0), (7.5, "deleted", 4.0), (8.5, "deleted", 5.0)]
    assert {row["state_s"] for row in found[-3:]} == {5.0}


@pytest.mark.parametrize(("late_s", "late"), [(0, "drop"), ("0.5", "drop"), ("0.5", "rerun")])
def test_a_track_that_ends_between_two_looks_of_one_row_is_told_once(late_s, late):
    """Both radars look at 4.5 s; it ends at the first of the two looks, and the other is empty."""
    sensors = {"one": RADAR, "other": {**RADAR, "latency_s": late_s}}
    scene = chain(
        sensors, targets=[LEAVES], fusion={"type": "fusion.pass_through"}, duration_s=7,
        tracker={"type": "tracking.ekf", "delete_misses": 1, "late": late},
    )  # fmt: skip
    found = rows(run(scene), "state_tracks")
    assert [row["track_status"] for row in found].count("deleted") == 1
    assert (found[-1]["track_status"], found[-1]["time_s"]) == ("deleted", 4.5)


def test_what_does_not_come_over_a_wire_ends_too():
    """A file of detections that stops, and a wire that loses all: nothing wakes the tracker."""
    scene = silent(duration_s=20, delete_after_s=3)
    scene["wires"] = [wire for wire in scene["wires"] if wire != "radar -> fusion"]
    scene["wires"].append({"from": "radar", "to": "fusion", "drop_probability": 0.8})
    scene["blocks"]["traffic"]["intruders"] = [crooked.ROLLING]
    found = rows(run(scene), "state_tracks")
    gaps = np.diff(sorted({row["time_s"] for row in found}))
    assert gaps.max() > 1.0
    for row in found:
        over = row["time_s"] - row["updated_s"]
        assert over < 3.0 or (row["track_status"] == "deleted" and over <= 3.5)


CASES = {
    "gated": silent(targets=[LEAVES, STAYS], duration_s=12, delete_after_s=3.3),
    "late": silent({"type": "fusion.pass_through"}, targets=[LEAVES, STAYS], duration_s=12,
                   radar={**RADAR, "latency_s": 0.37}, late="rerun"),
    "held": silent(targets=[LEAVES, STAYS], duration_s=9, type="tracking.hold_last",
                   drop_after_s=1.3),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_windows_and_company_change_no_byte(case):
    table = "tracks" if case == "held" else "state_tracks"
    scene = CASES[case]
    scene["wires"] = [wire for wire in scene["wires"] if wire != "fusion -> tracker"]
    scene["wires"].append(
        {"from": "fusion", "to": "tracker", "jitter_s": 0.2, "drop_probability": 0.5}
    )
    loaded = dsa_des.load_scene(scene)
    assert same_in_any_window(loaded)[table].num_rows
    same_as_alone(replicas_of(loaded, {}, {}, {}), window=40)


def test_what_is_held_is_dropped_in_time():
    scene = silent(type="tracking.hold_last", drop_after_s=1.3, targets=[LEAVES, STAYS])
    scene["blocks"]["traffic"]["intruders"][1]["end_time_s"] = 6.1
    scene["wires"][-1] = {"from": "fusion", "to": "tracker", "delay_s": 0.2}
    held = {}
    for row in rows(run(scene), "tracks"):
        held.setdefault(row["time_s"], set()).add(row["target"])
    # The last of the one was made at 4.0 s, and is 1.3 s old at 5.3: no row comes until 5.5.
    assert held[5.2] == {"rolling", "stays"}
    assert held[5.5] == {"stays"}


class Sleeper(Component):
    """Notes when it is woken, and whether anything came."""

    inputs = {"fused": Input(dsa_des.Message, "trigger")}
    outputs = {}
    windowed = True
    woken = []

    def acts_every_s(self):
        return Fraction(3, 10)

    def run(self, wake: Wake):
        came = wake.without_idle()
        assert (came is None) == bool(wake.idle.all())
        assert came is None or came.ticks.tolist() == wake.ticks[~wake.idle].tolist()
        Sleeper.woken += list(zip(wake.time_s.tolist(), wake.idle.tolist(), strict=True))


@pytest.mark.parametrize("window", [None, 1, 3])
def test_a_block_is_woken_as_often_as_it_asks(window):
    scene = silent(duration_s=2)
    scene["blocks"]["sleeper"] = {"type": f"{__name__}:Sleeper"}
    scene["wires"].append("fusion -> sleeper")
    Sleeper.woken.clear()
    from dsa_des.running.simulation import Simulation

    Simulation(dsa_des.load_scene(scene), window=window).run()
    times = [0.0, 0.3, 0.5, 0.6, 0.9, 1.0, 1.2, 1.5, 1.8]
    scans = {0.0, 0.5, 1.0, 1.5}
    assert [time for time, _ in Sleeper.woken] == pytest.approx(times)
    assert [idle for _, idle in Sleeper.woken] == [time not in scans for time in times]
