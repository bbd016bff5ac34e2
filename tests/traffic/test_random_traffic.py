"""Random traffic: spread as it says, and unmoved by who else is there."""

import numpy as np
import pytest

from components.geometry.ellipsoid import line_of_sight
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "configs/benchmark/hundred.toml"


def starts(count, seed="1", **sets):
    more = [f"blocks.traffic.{key}={value}" for key, value in sets.items()]
    scene = load_scene(SCENE, sets=[f"blocks.traffic.intruders={count}", f"seed={seed}", *more])
    traffic = Simulation(scene).components["traffic"]
    state = traffic.targets.at(np.zeros(1))
    own = traffic.own.at(np.zeros(1))
    _, _, range_m = line_of_sight(
        own.lat_deg, own.lon_deg, own.alt_m, state.lat_deg[0], state.lon_deg[0], state.alt_m[0]
    )
    return state, range_m


def test_evenly_spread_over_the_disc():
    state, range_m = starts(4000, radius_km=20)
    assert range_m.max() < 20_010.0
    # An even disc holds a quarter of its targets within half its radius: 1000 ± 27.
    assert abs(np.count_nonzero(range_m < 10_000.0) - 1000) < 100
    assert np.abs(state.alt_m - 1000.0).max() <= 300.0


def test_more_intruders_leave_the_first_ones_where_they_were():
    few, many = starts(5)[0], starts(50)[0]
    assert np.array_equal(few.lat_deg[0], many.lat_deg[0][:5])
    assert not np.array_equal(few.lat_deg, starts(5, seed="2")[0].lat_deg)


def test_speeds_in_the_wrong_order_are_refused():
    with pytest.raises(SceneError, match="speed_max_mps = 10: it must be at least"):
        starts(5, speed_max_mps=10)
