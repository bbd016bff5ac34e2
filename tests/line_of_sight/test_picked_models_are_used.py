"""Models that are picked by their error are those that the lines of sight come from."""

import math

import crooked
from wired import chain, rows, run, sensor

from components.line_of_sight.model_choice import angle_text, model_label, range_text

NEARLY_LEVEL = {**crooked.OWNSHIP, "pitch_deg": 0.3, "roll_deg": 0.2, "climb_mps": 0.0}
RADAR = sensor(
    "radar.range_boundary", range_km=5.0, elevation_deg=[-20, 20], azimuth_deg=[-170, 170]
)
FAR = [
    {**crooked.ROLLING, "up_m": 300.0}, {**crooked.DIVING, "up_m": -200.0, "climb_mps": 0.0},
]  # fmt: skip


def looked(**transform):
    scene = chain({"radar": RADAR}, ownship=NEARLY_LEVEL, targets=FAR)
    if transform.get("model") == "auto":
        scene["accuracy"] = {"angle_deg": 3.0, "range_m": 200.0}
    scene["blocks"]["transform"] |= transform
    found = run(scene)
    return rows(found), found.summary


def test_what_is_picked_is_what_it_would_be_by_name():
    auto, told = looked(model="auto", attitude="auto")
    picked = told["models"]["transform"]
    assert picked["earth"] != "ellipsoid" and picked["attitude"] == "small_angle"
    named, _ = looked(model=picked["earth"], attitude=picked["attitude"])
    assert len(named) == 2
    assert auto == named
    for other in (
        {"model": "ellipsoid", "attitude": picked["attitude"]},
        {"model": picked["earth"], "attitude": "exact"},
    ):
        assert looked(**other)[0] != named


def test_nothing_is_proven_of_ranges_behind_a_moving_target_filter():
    """Its gain follows range rates, which no bound of Pd over range knows."""
    models = {}
    for kind in ("none", "double_canceller"):
        radar = sensor("radar.swerling", range_km=5.0, elevation_deg=[-20, 20],
                       azimuth_deg=[-170, 170], moving_target_filter=kind, prf_hz=20e3)  # fmt: skip
        scene = chain({"radar": radar}, ownship=NEARLY_LEVEL, targets=FAR)
        scene["accuracy"] = {"angle_deg": 3.0, "range_m": 200.0, "detection_probability": 0.3}
        scene["blocks"]["transform"] |= {"model": "auto"}
        models[kind] = run(scene).summary["models"]["transform"]["earth"]
    assert models["none"] != "ellipsoid" == models["double_canceller"]


def test_errors_and_models_are_said_in_words():
    assert (range_text(5.2531), range_text(math.inf)) == ("5.3 m", "any size")
    assert angle_text(math.radians(0.00412)) == "0.0041 deg" and angle_text(math.pi) == "any size"
    assert model_label("flat_earth") == "flat earth"
    assert model_label("flat_earth", "first_order") == "flat earth with first-order attitude"
