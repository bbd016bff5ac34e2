"""When the ownship is first steered, and how often, of the runs of a study."""

import math

import pytest

import dsa_des
from dsa_des.errors import SceneError


def measured(scene):
    result = dsa_des.study(scene, metrics=["manoeuvres"], replicas=1, workers=1)
    return {row["result"]: row["value"] for row in result.summary.to_pylist()}


def test_manoeuvres_count_from_when_they_reach_the_ownship():
    assert measured("published/degas") == {"first_manoeuvre_time_s": 97.0, "manoeuvres": 2.0}
    late = dsa_des.load_scene("published/degas").resolved()
    late["wires"] = [
        {"from": "pilot", "to": "traffic", "delay_s": 2.5, "holds": "nothing"}
        if wire in ("pilot -> traffic", "pilot.manoeuvres -> traffic.manoeuvres") else wire
        for wire in late["wires"]
    ]  # fmt: skip
    assert measured(late)["first_manoeuvre_time_s"] == 99.5


def test_a_run_without_a_manoeuvre_has_no_time():
    calm = dsa_des.load_scene("published/degas", sets=["blocks.pilot.level=4"])
    found = measured(calm)
    assert found["manoeuvres"] == 0.0
    assert math.isnan(found["first_manoeuvre_time_s"])


def test_a_scene_that_steers_nobody_is_refused():
    with pytest.raises(SceneError, match="no manoeuvres are wired"):
        measured("published/degas_unmitigated")
