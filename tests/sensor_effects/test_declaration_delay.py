"""A sensor declares a target after m detections in its last n looks."""

RULE = "declare_m = 3\ndeclare_n = 5"


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


def test_detections_are_reported_all_the_same(scene, runs):
    without, ruled = runs.run(scene()), runs.run(scene(RULE))
    drop = ["declared"]
    assert without.tables["detections"].drop(drop) == ruled.tables["detections"].drop(drop)
    assert set(without.tables["detections"]["declared"].to_pylist()) == {True}
    assert "declarations" not in without.outcome.report


def test_a_target_that_is_never_declared_is_said_so(scene, runs):
    run = runs.run(scene("threshold = 1e6\n" + RULE))
    assert set(run.outcome.report["declarations"]["eo"].values()) == {None}
