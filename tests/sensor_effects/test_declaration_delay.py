"""A sensor declares a target after m detections in its last n looks."""

import numpy as np
import pytest

from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene

RULE = "declare_m = 3\ndeclare_n = 5"
NEVER_MISSES = "threshold = -1\n"


def test_windows_do_not_change_a_bit(scene, runs):
    run = runs.assert_grain_changes_nothing(scene(RULE, "declare_m = 2\ndeclare_n = 2", RULE))
    assert set(run.tables["detections"]["declared"].to_pylist()) == {True, False}


def test_places_are_remembered_across_windows(scene, runs):
    """Noise takes part, and a place that was seen before the window began counts."""
    noise = "threshold = 5\nfalse_alarms_per_frame = 0.5"
    every = "declare_m = 3\ndeclare_n = 3"  # of as many scans as are remembered
    path = scene(f"{every}\n{noise}", f"{RULE}\n{noise}\ndeclare_by = 'place'")
    run = runs.run(path)
    for window in (1, 37):
        runs.assert_same(run, runs.run(path, window=window))
    told = run.outcome.report["declarations"]["eo"]
    rows = [row for row in run.tables["detections"].to_pylist() if row["block"] == "eo"]
    for target in ("propeller", "turbofan", "turbojet"):
        declared = [row for row in rows if row["target"] == target and row["declared"]]
        first = declared[0]
        assert told[target] == {"time_s": first["time_s"], "range_m": first["true_range_m"]}
        seen = [row for row in rows if row["target"] == target]
        assert [row["declared"] for row in seen[:5]] == [False, False, True, True, True]
    assert {row["declared"] for row in rows if row["target"] is None} == {False}


def test_the_delay_is_the_period_times_m_minus_1(scene, runs):
    one = runs.run(scene(NEVER_MISSES))
    several = runs.run(scene(NEVER_MISSES + "declare_m = 4\ndeclare_n = 6"))
    period_s = 0.1
    declared = several.outcome.report["declarations"]["eo"]
    assert set(declared) == {"propeller", "turbofan", "turbojet"}
    for target, first in declared.items():
        rows = [row for row in runs.detections(one, "eo").values() if row["target"] == target]
        start = min(rows, key=lambda row: row["scan"])
        assert first["time_s"] == pytest.approx(start["time_s"] + 3 * period_s, abs=1e-12)
        same = runs.detections(several, "eo")[start["scan"] + 3, target]
        assert first["range_m"] == same["true_range_m"] and same["declared"]
        assert not runs.detections(several, "eo")[start["scan"] + 2, target]["declared"]


def test_the_column_is_the_rule_applied_to_what_was_detected(scene, runs):
    found = runs.detections(runs.run(scene("", RULE + "\nthreshold = 5")), "ir")
    looks = 20 * 4
    for target in ("propeller", "turbofan", "turbojet"):
        seen = np.array([(scan, target) in found for scan in range(looks)])
        for scan in np.flatnonzero(seen):
            expected = seen[max(0, scan - 4) : scan + 1].sum() >= 3
            assert found[scan, target]["declared"] == expected


def test_detections_are_reported_all_the_same(scene, runs):
    without, ruled = runs.run(scene()), runs.run(scene(RULE))
    drop = ["declared"]
    assert without.tables["detections"].drop(drop) == ruled.tables["detections"].drop(drop)
    assert set(without.tables["detections"]["declared"].to_pylist()) == {True}
    assert "declarations" not in without.outcome.report


def test_a_target_that_is_never_declared_is_said_so(scene, runs):
    run = runs.run(scene("threshold = 1e6\n" + RULE))
    assert set(run.outcome.report["declarations"]["eo"].values()) == {None}


def test_sentences(scene, runs):
    path = scene(RULE)
    assert runs.sentences(path, "eo")["declaration"] == (
        "declaration: simulated, declare_m is 3 and declare_n is 5"
    )
    assert runs.sentences(path, "radar")["declaration"] == (
        "declaration: not simulated, declare_m and declare_n are not given"
    )


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("declare_m = 2", "declare_m and declare_n belong together"),
        ("declare_m = 6\ndeclare_n = 5", "declare_m = 6: it must be at most declare_n, 5"),
        ("declare_m = 0\ndeclare_n = 5", "declare_m"),
    ],
)
def test_bad_rules(scene, keys, words):
    with pytest.raises(SceneError, match=words):
        load_scene(scene(keys))
