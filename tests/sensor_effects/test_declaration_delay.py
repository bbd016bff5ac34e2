"""A sensor declares a target after m detections in its last n looks."""

RULE = "declare_m = 3\ndeclare_n = 5"


def test_detections_are_reported_all_the_same(scene, runs):
    without, ruled = runs.run(scene()), runs.run(scene(RULE))
    drop = ["declared"]
    assert without.tables["detections"].drop(drop) == ruled.tables["detections"].drop(drop)
    assert set(without.tables["detections"]["declared"].to_pylist()) == {True}
    assert "declarations" not in without.outcome.report


def test_a_target_that_is_never_declared_is_said_so(scene, runs):
    run = runs.run(scene("threshold = 1e6\n" + RULE))
    assert set(run.outcome.report["declarations"]["eo"].values()) == {None}
