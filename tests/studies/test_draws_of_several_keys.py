"""Draws of different keys are independent; a range in steps ends where it says."""

import numpy as np
import pytest

from dsa_des.scene.scene import load_scene
from dsa_des.studies.axes import parse_axis
from dsa_des.studies.draws import Draw


@pytest.mark.parametrize("stratified", [False, True])
def test_two_keys_are_drawn_independently(stratified):
    keys = ("blocks.radar.power_w", "blocks.radar.losses_db")
    values = [
        [Draw(key, "uniform", (0.0, 1.0), stratified).value(7, replica, 50)
         for replica in range(400)] for key in keys
    ]  # fmt: skip
    assert abs(np.corrcoef(values)[0, 1]) < 0.15


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ({"from": 1, "to": 2, "steps": 5}, [1.0, 1.25, 1.5, 1.75, 2.0]),
        ({"from": 1, "to": 2, "steps": 1}, [1.0]),
        ({"from": 0, "to": 9, "steps": 2}, [0.0, 9.0]),
    ],
)
def test_a_range_in_steps_has_both_its_ends(configs, spec, expected):
    scene = load_scene(configs / "first_light.toml")
    axis = parse_axis("blocks.radar.range_km", spec, scene)
    assert [float(label) for label in axis.labels] == pytest.approx(expected)
