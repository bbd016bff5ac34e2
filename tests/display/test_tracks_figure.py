"""``tracks.png``: what a tracker confirmed, drawn over the flights."""

import numpy as np
import pytest

import dsa_des
from components.display.tracks import _nearest, draw_tracks
from dsa_des.running.simulation import Simulation


def simulated(tmp_path, *sets):
    scene = dsa_des.load_scene(
        "first_light",
        sets=["duration_s=3", "blocks.fusion.type='fusion.pass_through'",
              "blocks.traffic.intruders.0.north_m=3000", *sets],
    )  # fmt: skip
    dsa_des.run(scene, out=tmp_path / "run")
    return Simulation(scene), tmp_path / "run"


def test_confirmed_tracks_are_drawn_the_same_every_time(tmp_path):
    simulation, folder = simulated(tmp_path, "blocks.tracker.type='tracking.ekf'")
    paths = [draw_tracks(tmp_path / name, simulation, folder) for name in ("one.png", "two.png")]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert paths[0].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.parametrize("sets", [(), ("blocks.tracker.type='tracking.ekf'",
                                       "blocks.tracker.confirm_m=60",
                                       "blocks.tracker.confirm_n=62")])  # fmt: skip
def test_where_nothing_is_confirmed_there_is_no_figure(tmp_path, sets):
    simulation, folder = simulated(tmp_path, *sets)
    assert draw_tracks(tmp_path / "none.png", simulation, folder) is None


def test_a_track_is_as_near_as_at_the_same_time():
    one = {"north_m": np.zeros(3), "east_m": np.zeros(3), "down_m": np.zeros(3),
           "state_s": np.array([0.0, 1.0, 2.0])}  # fmt: skip
    place = np.array([[50.0, 150.0], [0.0, 0.0], [0.0, 0.0]])
    assert _nearest(one, {"passing": (np.array([0.0, 2.0]), place)}) == pytest.approx(50.0)
