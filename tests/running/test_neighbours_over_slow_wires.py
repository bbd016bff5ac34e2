"""What blocks tell each other before the run travels over wires with a delay as over others."""

import pytest

from components.traffic.source import TrafficSource
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

# Names in an order that is not that of the chain: among blocks of one depth names decide.
SCENE = """
duration_s = 5
wires = [
  {{ from = "z_traffic", to = "b_transform", holds = "nothing"{late} }},
  {{ from = "b_transform", to = "c_gate", holds = "nothing"{late} }},
  {{ from = "c_gate", to = "a_camera", holds = "nothing"{late} }},
  {{ from = "c_gate", to = "r_radar" }},
  "r_radar -> fusion -> tracker -> avoidance",
  {{ from = "avoidance", to = "z_traffic", delay_s = 0.5, holds = "nothing" }},
]

[accuracy]
angle_deg = 1
range_m = 1000

[blocks]
b_transform.type = "geometry.ellipsoid"
c_gate.type = "gate"
fusion.type = "fusion.pick_best"
tracker.type = "tracking.stub"
avoidance.type = "avoidance.turn_away"
r_radar = {{ type = "radar.range_boundary", scan_rate_hz = 1, range_km = 5 }}

[blocks.a_camera]
type = "optical.ir"
scan_rate_hz = 1
azimuth_pixels = 640
elevation_pixels = 512
silhouette = "{silhouette}"

[blocks.z_traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52, lon_deg = 4, alt_m = 1000, speed_mps = 50 }}

[[blocks.z_traffic.intruders]]
name = "other"
east_m = 0
north_m = 2000
up_m = 0
ir = {{ front_m2 = 1.0, back_m2 = 2.0, side_m2 = 3.0, horizontal_m2 = 4.0 }}
"""
LATE = ", delay_s = 0.25"


def simulation(tmp_path, silhouette, late):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(silhouette=silhouette, late=late))
    return Simulation(load_scene(path))


@pytest.mark.parametrize("late", ["", LATE])
def test_a_camera_learns_its_targets_before_the_run(tmp_path, late):
    with pytest.raises(SceneError, match="'mesh' needs them alike"):
        simulation(tmp_path, "mesh", late)


@pytest.mark.parametrize("late", ["", LATE])
def test_a_transform_learns_that_the_ownship_is_steered(tmp_path, late):
    built = simulation(tmp_path, "exact", late)
    (producer,) = built.components["b_transform"].context.producers
    assert isinstance(built.components["z_traffic"], TrafficSource)
    assert producer.offer.envelope(1000.0, 0.0) is None


@pytest.mark.parametrize("late", ["", LATE])
def test_the_traffic_learns_how_far_set_up_sensors_look(tmp_path, late):
    """A camera cuts its reach to what it can see when it is set up, and asks for that."""
    built = simulation(tmp_path, "exact", late)
    camera = built.components["a_camera"]
    assert camera.reach.range_max_m < camera.stated_reach.range_max_m
    (consumer,) = built.components["z_traffic"].context.consumers
    farthest_m = max(5000.0, camera.reach.range_max_m)
    assert farthest_m <= consumer.request.range_m < 1.01 * farthest_m + 100.0
