"""Targets are left out by their true ranges, sensors go by those of the model: both agree."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from components.aircraft.aircraft import Roster
from components.aircraft.known_targets import KnownTraffic
from components.geometry import ellipsoid
from components.geometry.earth_models import LineOfSight
from components.geometry.ellipsoid import enu_to_geodetic
from components.geometry.error_bounds import max_true_range_m
from components.line_of_sight.model_choice import convert_range_to_seeming
from components.messages.reach import FarthestLook
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

# Two rings of slow targets about the radar's 15 km: flat Earth sees some of them half a per cent
# nearer, and some farther, than they are.
SCENE = """
duration_s = 14
wires = ["traffic -> transform -> gate -> radar"]
[blocks.transform]
type = "geometry.{model}"
[blocks.gate]
type = "gate"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 5
range_km = 15
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = {lat}, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 1 }}
intruders = [
{intruders}
]
"""


def detections(path: Path, **options: object) -> object:
    sink = MemorySink()
    Simulation(load_scene(path), recorder=Recorder([sink]), **options).run()
    return sink.tables()["detections"]


@pytest.mark.parametrize("lat_deg", [0.0, 52.0, 88.0])
@pytest.mark.parametrize("model", ["flat_earth", "local_radii", "daidalus_sphere", "geodesic"])
def test_no_model_loses_who_it_takes_to_be_in_reach(
    tmp_path: Path, model: str, lat_deg: float
) -> None:
    lines = []
    for number in range(60):
        bearing, distance = math.radians(7.3 * number), 14_850.0 + 5.0 * number
        lines.append(
            f'{{ name = "t{number}", east_m = {distance * math.sin(bearing)}, '
            f"north_m = {distance * math.cos(bearing)}, up_m = 0, speed_mps = 1 }},"
        )
    path = tmp_path / "rings.toml"
    path.write_text(SCENE.format(model=model, lat=lat_deg, intruders="\n".join(lines)))
    planned = detections(path)
    assert planned.num_rows > 1000
    for options in ({"simulate_everything": True}, {"window": 1}):
        assert planned.equals(detections(path, **options)), options


@pytest.mark.parametrize("model", ["flat_earth", "local_radii", "geodesic"])
def test_who_seems_to_be_in_reach_is_within_the_true_reach(model: str) -> None:
    rng = np.random.default_rng(6)
    pairs = 400 if model == "geodesic" else 20_000
    for reach_m in (2e3, 15e3, 60e3):
        for lat in (-70.0, 0.0, 40.0, 80.0):
            own = (rng.uniform(lat - 0.5, lat + 0.5, pairs), 170.0, rng.uniform(0, 9e3, pairs))
            true_m = max_true_range_m(model, reach_m, (lat - 0.5, lat + 0.5), (0.0, 9e3))
            assert reach_m < true_m < 1.2 * reach_m
            distance, bearing = rng.uniform(0.8, 1.3, pairs) * reach_m, rng.uniform(0, 6.28, pairs)
            up = rng.uniform(-0.3, 0.3, pairs) * distance
            level = np.sqrt(distance**2 - up**2)
            target = enu_to_geodetic(
                level * np.sin(bearing), level * np.cos(bearing), up,
                reference_lat_deg=own[0], reference_lon_deg=own[1], reference_alt_m=own[2],
            )  # fmt: skip
            seems = LineOfSight(model).in_ned(*own, *target)[2] <= reach_m
            truly = ellipsoid.line_of_sight(*own, *target)[2]
            assert seems.sum() > pairs / 10
            assert (truly[seems] <= true_m).all()


def test_nothing_is_proven_at_a_pole_and_the_exact_form_needs_no_proof() -> None:
    look, envelope = FarthestLook(15e3), SimpleNamespace()
    assert max_true_range_m("flat_earth", 15e3, (89.95, 89.99), (0.0, 100.0)) == math.inf
    offer = KnownTraffic(Roster.from_pairs([]), lambda _reach, _lasts: envelope)
    context: Any = SimpleNamespace(producers=[SimpleNamespace(offer=offer)])
    assert convert_range_to_seeming(context, "flat_earth", look).seeming == (("flat_earth", 15e3),)
    assert convert_range_to_seeming(context, "ellipsoid", look) == look
    assert not offer.is_envelope_used
    unknown: Any = SimpleNamespace(producers=[SimpleNamespace(offer=None)])
    assert convert_range_to_seeming(unknown, "flat_earth", look) == FarthestLook(math.inf)
