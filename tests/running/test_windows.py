"""Windows of every kind keep one contract, and which kind a run goes through changes no byte."""

import random

import numpy as np
import pytest
from click.testing import CliRunner

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.cli import main
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.running.pacing import Pacer
from dsa_des.running.simulation import Simulation
from dsa_des.running.timeline import Timeline
from dsa_des.running.windows import Rewinder, Window, Windows
from dsa_des.scene.scene import load_scene
from dsa_des.time.timeline_runs import Runs
from tests.running.window_cost import window_cost_s

LOOP = "configs/benchmark/manoeuvres.toml"
FEEDBACK = '{ from = "end", to = "cue.cue", delay = "1 scan", holds = "nothing" }'


def all_of(windows):
    found = []
    while (window := windows.next()) is not None:
        assert windows.commit(window, None) == window.end
        found.append(tuple(window[:2]))
    return found


@pytest.mark.parametrize(
    ("longest", "expected"), [(4, [(0, 4), (4, 8), (8, 10)]), (10, [(0, 10)]), (99, [(0, 10)])]
)
def test_equal_windows_cover_a_run_once(longest, expected):
    assert all_of(Windows(Runs(1, 10), longest)) == expected
    windows = Windows(Runs(1, 10), longest)
    windows.limit_length(0)  # no window is shorter than a tick
    assert all_of(windows) == [(k, k + 1) for k in range(10)]


@pytest.mark.parametrize("longest", [1, 3, 10, 25, 1000])
def test_windows_over_replicas_cover_each_once_and_hold_whole_ones(longest):
    runs, ran, count = Runs(4, 10), [], 0
    windows = Windows(runs, longest)
    while (window := windows.next()) is not None:
        ran += [(run, tick) for tick in range(*window[:2]) for run in runs.going]
        assert len(runs.going) == 1 or window[:2] == (0, 10)
        assert windows.commit(window, None) == window.end
        count += 1
    assert sorted(ran) == [(run, tick) for run in range(4) for tick in range(10)]
    assert count == {1: 40, 3: 16, 10: 4, 25: 2, 1000: 1}[longest]


def test_windows_of_a_loop_begin_where_something_happens():
    simulation = Simulation(load_scene("configs/avoidance/crossing_pilot.toml", duration_s="20"))
    second, starts = simulation.ticks_per_s, []
    run_window = simulation.run_window
    simulation.run_window = lambda window: starts.append(window.start) or run_window(window)
    simulation.run()
    # All scans are at whole seconds, and the horizon is half of one.
    assert len(starts) <= 22 and all(start % second == 0 for start in starts[:-1])


def test_windows_of_runs_together_come_back_to_each_of_them():
    runs = Runs(4, 10)
    windows = Windows(runs, 16, 9)
    found = []
    while (window := windows.next()) is not None:
        found.append((runs.going, *window[:2]))
        windows.commit(window, None)
    cuts = [(0, 4), (4, 8), (8, 10)]
    assert found == [(range(4), *cut) for cut in cuts]


def test_rows_are_final_up_to_where_all_runs_have_come():
    runs = Runs(9, 10)
    assert runs.rows_complete_before(7, range(2, 5)) == (2, 0)
    assert runs.rows_complete_before(10, range(2, 5)) == (5, 0)
    assert runs.rows_complete_before(7, range(2, 3)) == (2, 7)
    assert Runs(1, 10).rows_complete_before(7, range(1)) == (0, 7)


def a_loop(lab, end, back):
    return lab.write(
        {"src": "Pulse; scan_rate_hz = 20", "cue": "Cued; scan_rate_hz = 10", "end": end},
        ['"src -> cue.in"', '"cue -> end"', *back],
        duration_s=4,
    )


@pytest.mark.parametrize(
    ("end", "back", "why"),
    [
        ("SlowRelay", [FEEDBACK], "windowed is False"),
        ("SlowRelay", [], ""),
        ("Relay", [FEEDBACK], ""),
        ("Relay", [FEEDBACK.replace("1 scan", "0.03 s")], "sooner than the next scan"),
    ],
)
def test_check_says_which_block_slows_a_loop(lab, end, back, why):
    back = [text.replace('delay = "0.03 s"', "delay_s = 0.03") for text in back]
    said = CliRunner().invoke(main, ["check", str(a_loop(lab, end, back))]).output
    assert ("feedback loop of cue, end runs scan by scan" in said) == bool(why)
    assert why in said and ("note: blocks.end: " in said) == bool(why)


@pytest.mark.parametrize("jitter", ["", ", jitter_s = 0.4, drop_probability = 0.2"])
def test_a_loop_that_cannot_be_rewound_runs_in_windows_that_nothing_comes_back_in(lab, jitter):
    path = a_loop(lab, "Relay", [FEEDBACK.replace('delay = "1 scan"', f"delay_s = 0.35{jitter}")])
    alone = lab.run(path, window=1)
    assert alone.outcome.windowed == []
    for window in (None, 2, 3, 7):
        run = lab.run(path, window=window)
        assert run.outcome.windowed == ["cue", "end", "src"]
        for name, table in alone.tables.items():
            assert table.equals(run.tables[name]), (name, window)


def test_blocks_before_a_loop_run_ahead_of_it():
    windows, found = Windows(Runs(1, 100), 40, 15), []
    while (window := windows.next()) is not None:
        assert windows.commit(window, None) == window.end
        found.append((window.start, window.end, window.ahead))
    assert found == [(0, 15, 30), (15, 30, 15), (30, 45, 60), (45, 60, 45), (60, 75, 90),
                     (75, 90, 75), (90, 100, 100)]  # fmt: skip


class Wilful(Timeline):
    """One run in windows of lengths that a die throws."""

    def windows(self, *lengths_and_rewinder):
        inner = super().windows(*lengths_and_rewinder)
        self.made = WilfulWindows(inner)
        return self.made


class WilfulWindows:
    def __init__(self, inner):
        self.inner, self.dice, self.seen = inner, random.Random(5), []

    def limit(self, longest_ticks):
        self.inner.limit(longest_ticks)

    def next(self):
        self.inner.limit_length(self.dice.randrange(10**9, 20 * 10**9))
        return self.inner.next()

    def commit(self, window, failure):
        assert failure is None and isinstance(window, Window)
        self.seen.append(window)
        return self.inner.commit(window, failure)


@pytest.mark.parametrize("sets", [[], ["blocks.avoidance.pause_s=5"]])
def test_windows_of_ones_own_need_no_other_simulation(sets):
    scene = load_scene(LOOP, sets=["blocks.traffic.intruders=4", *sets], duration_s="30")
    tables = []
    for timeline in (None, Wilful(scene)):
        sink = ColumnSink()
        Simulation(scene, timeline=timeline, recorder=Recorder([sink])).run()
        tables.append(sink.tables())
    seen, horizon = timeline.made.seen, timeline.made.inner._horizon
    assert len(seen) > 2 and {w.provisional for w in seen} == {True, False}
    for w in seen:  # what is sent within the horizon comes back behind it
        assert w.provisional == (w.ahead > w.start or w.end > w.start + horizon)
    for name, columns in tables[0].items():
        assert columns["tick"].tolist() == tables[1][name]["tick"].tolist(), name
        for column, values in columns.items():
            if isinstance(values, np.ndarray):
                assert values.tobytes() == tables[1][name][column].tobytes(), (name, column)


def test_a_pacer_waits_for_what_is_final_only():
    """It starts with the first window; one that does not stand is waited for by none."""
    waits, ran = [], []

    class Undecided(Windows):
        tries = 0

        def commit(self, window, failure):
            self.tries += 1
            ran.append(window.end)
            return super().commit(window, failure) if self.tries % 2 == 0 else None

    now = [50.0]
    pacer = Pacer(2.0, lambda: now[0], lambda s: (waits.append(s), now.__setitem__(0, now[0] + s)))
    scene = load_scene("configs/first_light.toml", duration_s="0.4")
    simulation = Simulation(scene)
    simulation.windows = Undecided(simulation.runs, simulation.end_tick)
    now[0] = 70.0  # until the run begins, no time goes by
    simulation.run_window = lambda window: None
    simulation.run(pacer=pacer)
    assert np.array(ran) / simulation.ticks_per_s == pytest.approx([0.2, 0.2, 0.4, 0.4])
    assert waits == pytest.approx([0.1, 0.1])  # 0.1 s of wall time at twice its speed
    assert pacer.windows == 2
    pacer.max_lag_s, pacer.total_lag_s = 205.3, 0.02
    assert pacer.sentence().endswith(
        "behind by at most 205.3 s, 10.0 ms on average, over 2 windows"
    )


def test_a_pacer_that_was_stopped_ends_the_run():
    pacer = Pacer(1e6)
    simulation = Simulation(load_scene("configs/first_light.toml", duration_s="3"))
    simulation.windows.limit_length(simulation.ticks_per_s)

    def stop(time_s):
        pacer.stopped = time_s >= 2.0

    simulation.run(stop, pacer)
    assert pacer.time_s == 2.0


def test_an_end_found_in_a_window_that_is_undone_was_never_found():
    runs = Runs(1, 100)
    rewinder = Rewinder([], set(), None, runs)
    rewinder.save_state()
    runs.note_ends(RunTicks.of_run(0, np.array([40])), "over")
    assert runs.early and runs.ended_by == {0: "over"}
    rewinder.restore()
    assert not runs.early and runs.ended_by == {} and runs.ends.tolist() == [100]


def test_what_a_window_costs_is_measured_over_all_of_them():
    windows, cost_s = window_cost_s(3.0, 1)
    assert windows == 30 and cost_s > 0.0
