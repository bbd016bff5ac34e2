"""Replicas run in lock step whatever model of the Earth they see by, each with its own reach."""

import math

import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from dsa_des.scene.scene import load_scene

MODELS = ["flat_earth", "local_radii", "daidalus_sphere", "geodesic"]
# Slow targets all around, about the 15 km up to which the radar looks.
SCENE = """
duration_s = 2
wires = ["traffic -> transform -> gate -> radar"]
navigation.position_noise_m = [2, 2, 3]
[blocks]
transform.type = "geometry.{model}"
gate.type = "gate"
radar = {{ type = "radar.range_boundary", scan_rate_hz = 2, range_km = 15 }}
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = -30, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 50 }}
intruders = [{intruders}]
"""


ALLOWED = ["accuracy.angle_deg=0.2", "accuracy.range_m=50"]


def ring() -> str:
    lines = []
    for number in range(48):
        bearing, range_m = math.radians(7.5 * number), 14_850.0 + 6.0 * number
        place = f"east_m = {range_m * math.sin(bearing)}, north_m = {range_m * math.cos(bearing)}"
        late = "start_time_s = 1" if number % 5 == 0 else "speed_mps = 1"
        lines.append(f'{{ name = "t{number}", {place}, up_m = 0, {late} }}')
    return ", ".join(lines)


def flown_at(*places: dict[str, float]) -> list[dict[str, float]]:
    return [{f"blocks.traffic.ownship.{k}": v for k, v in place.items()} for place in places]


@pytest.mark.parametrize("model", MODELS)
def test_each_replica_has_the_reach_of_where_it_flies(tmp_path, model):
    """How far who seems to be in reach truly is depends on latitude; nothing is proven at a pole.

    Without one reach each, targets at the edge are counted as too far away in one run only.
    """
    path = tmp_path / "ring.toml"
    path.write_text(SCENE.format(model=model, intruders=ring()), encoding="utf-8")
    changes = flown_at({"lat_deg": -2.0}, {"lat_deg": -62.0, "alt_m": 9000.0}, {"lat_deg": -89.96})
    scenes = replicas_of(load_scene(path), *changes)
    simulation = same_as_alone(scenes)
    assert list(simulation.timeline.together) == ["traffic"]
    assert not simulation.timeline.split
    _, tables = tables_of(scenes)
    assert {*tables["detections"]["replica"].to_pylist()} == {0, 1, 2}


@pytest.mark.parametrize("model", [*MODELS, "auto"])
def test_encounters_of_a_steered_ownship(model):
    """Where it and its targets can be is not known, in no replica: none goes by it."""
    # Only an exact line of sight will do for a range rate.
    allowed = [*ALLOWED, "blocks.radar.enabled=false"] if model == "auto" else ALLOWED
    scene = load_scene(
        "configs/avoidance/radar_and_camera.toml",
        duration_s="4",
        sets=[f"blocks.transform.model={model}", "blocks.traffic.lat_deg=-52", *allowed],
    )
    scenes = replicas_of(scene, *({"blocks.traffic.encounter": n} for n in (0, 7)))
    same_as_alone(scenes)
