"""Looks that come late, in scenes whose cameras' messages take their time."""

from types import SimpleNamespace

import numpy as np
import pyarrow.compute as pc
import pytest
from same_runs import tables_of

import dsa_des
from components.tracking.out_of_sequence import plan_with_late_looks, plan_without_late_looks
from docs.make.track_consistency import (
    NEARLY,
    NOISY,
    OWNSHIP,
    SENSORS,
    Case,
    scene_of_case,
)
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.scene.scene import load_scene

NEARER = [
    "blocks.traffic.intruders.0.north_m=4000", "blocks.traffic.intruders.1.north_m=3500",
    "blocks.traffic.intruders.1.east_m=3000", "blocks.eo.false_alarms_per_frame=0.3",
    "blocks.tracker.delete_misses=60", "blocks.ir.scan_rate_hz=7",
]  # fmt: skip
LATE = ["blocks.eo.latency_s=0.31", "blocks.ir.latency_s=0.117"]


def scene(*sets, kind="tracking.ekf", duration_s="4"):
    swaps = [f"tracker={kind}", "fusion=fusion.pass_through"]
    chosen = {text.partition("=")[0]: text for text in (*NEARER, *sets)}  # the last of each key
    return load_scene(
        "configs/first_light.toml", swaps=swaps, sets=chosen.values(), duration_s=duration_s
    )


def tracked(scene):
    simulation, tables = tables_of(scene)
    return simulation, tables["state_tracks"]


@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.imm"])
def test_the_state_at_the_end_is_the_same_to_the_bit(kind):
    """The cameras stop at 3 s; half a second later all they saw has come, and the radar goes on."""
    stop = ["blocks.eo.offset_s=0.05", "blocks.eo.scan_rate_hz=2", "blocks.ir.scan_rate_hz=2",
            "blocks.ir.offset_s=0.1", "blocks.radar.scan_rate_hz=5"]  # fmt: skip
    rerun = ["blocks.tracker.late='rerun'"]
    delays = ["blocks.eo.latency_s=0.23", "blocks.ir.latency_s=0.29"]
    _, on_time = tracked(scene(*stop, kind=kind, duration_s="3.45"))
    _, late = tracked(scene(*stop, *delays, *rerun, kind=kind, duration_s="3.45"))
    # At 3.4 s the radar's scan is the newest of both; the cameras' last were at 3.05 and 3.1 s.
    rows = [
        {r["track"]: r for r in t.to_pylist() if r["time_s"] == pytest.approx(3.4)}
        for t in (on_time, late)
    ]
    assert rows[0].keys() == rows[1].keys() and len(rows[0]) >= 2
    for number, row in rows[0].items():
        assert {**row, "tick": 0} == {**rows[1][number], "tick": 0}
    drop = ["blocks.tracker.late='drop'"]
    _, dropped = tracked(scene(*stop, *delays, *drop, kind=kind, duration_s="3.45"))
    assert "radar+eo" not in "".join(dropped["contributors"].to_pylist())


@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.imm"])
def test_one_step_is_near_what_working_on_all_again_gives(kind):
    """Both cameras are late by two looks of the radar, all the time; errors of what is told."""
    stop = ["blocks.radar.scan_rate_hz=5", "blocks.eo.scan_rate_hz=2", "blocks.ir.scan_rate_hz=2",
            "blocks.eo.false_alarms_per_frame=0", *LATE]  # fmt: skip
    if kind == "tracking.imm":
        stop.append("blocks.tracker.association='jpda'")
    tables = {}
    for late in ("drop", "one_step", "rerun"):
        _, table = tracked(scene(*stop, f"blocks.tracker.late='{late}'", kind=kind))
        rows = {(r["tick"], r["track"]): r for r in table.to_pylist() if r["time_s"] > 2.0}
        tables[late] = rows
    newest = {}
    for (_, track), row in tables["one_step"].items():  # a late look is no newer than it is
        assert row["updated_s"] >= newest.get(track, 0.0)
        newest[track] = row["updated_s"]
    exact = tables.pop("rerun")
    apart = {}
    for late, rows in tables.items():
        shared = exact.keys() & rows.keys()
        assert len(shared) > 20
        apart[late] = np.sqrt(np.mean([
            (rows[k][name] - exact[k][name]) ** 2 / exact[k][f"covariance_{i}{i}_m2"]
            for k in shared for i, name in enumerate(("north_m", "east_m", "down_m"))
        ]))  # fmt: skip
    assert apart["one_step"] < 0.02 * apart["drop"]


def test_looks_older_than_the_lag_are_left_out_and_counted():
    def left_out(*sets):
        simulation, table = tracked(scene(*LATE, *sets, duration_s="2"))
        block = simulation.nodes["tracker"].component
        assert np.isfinite(table["existence"].to_numpy()).all()
        late = block.report()["late_looks"]["tracker"]
        for told in late.values():
            assert 0 < told["left_out"] <= told["looks"]
            assert told["share"] == told["left_out"] / told["looks"]
        return sum(told["left_out"] for told in late.values())

    rerun = "blocks.tracker.late='rerun'"
    assert left_out(rerun) == 0
    most, some = left_out(rerun, "blocks.tracker.lag_s=0.05"), left_out(
        rerun, "blocks.tracker.lag_s=0.2"
    )  # fmt: skip
    assert most > some > 0
    assert left_out("blocks.tracker.late='drop'") > some
    assert left_out() == left_out("blocks.tracker.lag_s=0.31") == 0


@pytest.mark.parametrize("rerun", [False, True])
def test_a_look_as_late_as_the_lag_still_counts_and_no_later_one(rerun):
    """Ticks 0, 10 and 20 came in time; what is as old as the lag is worked on, and remembered."""
    looks = SimpleNamespace(
        tick=np.array([0, 10, 20, 10, 9]), sensors=np.array([1, 1, 1, 2, 2]), row=np.arange(5)
    )
    plan, left_out, kept = plan_with_late_looks(looks, np.zeros(5, dtype=int), 0, 10, rerun=rerun)
    assert left_out == [4] and set(plan.look.tolist()) == {0, 1, 2, 3}
    assert kept == ([1, 3, 2] if rerun else [1, 2])


def test_where_late_looks_are_left_out_one_of_the_newest_instant_is_not_late():
    looks = SimpleNamespace(tick=np.array([20, 19, 25, 25]), row=np.arange(4))
    plan, left_out = plan_without_late_looks(looks, np.zeros(4, dtype=int), np.array([20]))
    assert plan.look.tolist() == [0, 2, 3] and left_out == [1]


def test_looks_of_the_future_wait_and_are_counted():
    """A sweeping radar's scan is reported as it begins, with the instants of its beam."""
    swept = scene("blocks.radar.beam_sweep=true", "blocks.radar.scan_rate_hz=1", duration_s="3")
    simulation, tables = tables_of(swept)
    table, seen = tables["state_tracks"], tables["detections"]
    seen = seen.filter(pc.equal(seen["block"], "radar"))
    after = seen["illuminated_s"].to_numpy() > seen["time_s"].to_numpy()
    report = simulation.nodes["tracker"].component.report()
    assert report["early_looks"]["tracker"] == after.sum() > 0
    assert (table["state_s"].to_numpy() <= table["time_s"].to_numpy()).all()


@pytest.mark.parametrize("late", ["one_step", "rerun"])
def test_late_looks_find_their_tracks_whoever_else_is_there(late):
    """Detections miss their tracks, others start and end, and a late look corrects some of them."""
    case = Case(
        "", {"type": "tracking.ekf", "late": late, "lag_s": 2, "false_alarms_per_scan": 1.2},
        NEARLY, sensors={**SENSORS, "radar": NOISY}, wire={"delay_s": 0.3, "jitter_s": 0.2},
    )  # fmt: skip
    traffic = {"type": "traffic.scripted", "ownship": OWNSHIP, "intruders": NEARLY}
    one = dsa_des.load_scene({**scene_of_case(case, traffic), "duration_s": 5})
    scenes = [replica_scene(one, Replica(1 + i, {})) for i in range(3)]
    _, together = tracked(scenes)
    _, alone = tracked(scenes[0])
    first = together.filter(pc.equal(together["replica"], 0)).drop_columns(["replica"])
    assert first.combine_chunks().equals(alone)
    assert max(alone["track"].to_pylist()) > 2
