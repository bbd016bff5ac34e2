"""Wires between posts: catenaries in pieces, each a target at rest."""

import math

import numpy as np
import pytest

from components.traffic.overhead_wires import OverheadWire, Post, catenary_points_m
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene


def wire(**keys):
    posts = [Post(east_m=-100, north_m=50, up_m=3), Post(east_m=200, north_m=450, up_m=3)]
    return OverheadWire(**{"name": "w", "posts": posts, "diameter_mm": 10, "sag_m": 12, **keys})


def test_a_wire_hangs_as_a_catenary_does():
    first, last = np.array([0.0, 0.0, 7.0]), np.array([0.0, 300.0, 7.0])
    points = catenary_points_m(first, last, 20.0, 1.0)
    assert points[:, 2].min() == pytest.approx(7.0 - 20.0, abs=1e-9)
    np.testing.assert_allclose(points[[0, -1]], [first, last], atol=1e-9)
    # z'' = sqrt(1 + z'^2) / a, with one a along the wire.
    step = points[1, 1] - points[0, 1]
    slope = (points[2:, 2] - points[:-2, 2]) / (2 * step)
    bend = (points[2:, 2] - 2 * points[1:-1, 2] + points[:-2, 2]) / step**2
    a_m = np.sqrt(1 + slope**2) / bend
    assert np.ptp(a_m) < 1e-3 * a_m.mean()


def test_pieces_join_from_post_to_post():
    made = list(wire().piece_intruder_keys())
    assert [piece["name"] for piece in made[:2]] == ["w-1", "w-2"] and len(made) == 20
    end = np.array([-100.0, 50.0, 3.0])
    for piece in made:
        laser = piece["laser"]
        level = laser["wire_length_m"] * math.cos(math.radians(laser["wire_slope_deg"]))
        turn = math.radians(laser["wire_direction_deg"])
        along = np.array(
            [level * math.sin(turn), level * math.cos(turn),
             laser["wire_length_m"] * math.sin(math.radians(laser["wire_slope_deg"]))]
        )  # fmt: skip
        place = np.array([piece[f"{axis}_m"] for axis in ("east", "north", "up")])
        np.testing.assert_allclose(place - 0.5 * along, end, atol=1e-9)
        end = place + 0.5 * along
    np.testing.assert_allclose(end, [200.0, 450.0, 3.0], atol=1e-9)


def test_wires_that_cannot_be_are_refused():
    scene = "configs/laser/power_line.toml"
    for key, value, words in (
        ("sag_m", "400", "at most its length"),
        ("piece_m", "0.001", "at most 10,000"),
        ("posts", "[{east_m=1,north_m=1,up_m=1},{east_m=1,north_m=1,up_m=9}]", "in one place"),
        ("posts", "[{east_m=1,north_m=1,up_m=1}]", "posts"),
    ):
        with pytest.raises((SceneError, ValueError), match=words):
            Simulation(load_scene(scene, sets=[f"blocks.traffic.wires.0.{key}={value}"]))
