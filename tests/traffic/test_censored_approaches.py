"""Closest approaches that only lie where looking began or ended are marked."""

import pytest

from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
duration_s = {duration}
seed = 1
wires = ["traffic -> transform -> radar"]
[blocks.traffic]
type = "traffic.scripted"
[blocks.traffic.ownship]
lat_deg = 0
lon_deg = 0
alt_m = 1000
heading_deg = 0
speed_mps = 100
[[blocks.traffic.intruders]]
name = "one"
east_m = 500
north_m = {north}
up_m = 0
heading_deg = 180
speed_mps = 100
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 1
range_km = 5
"""


def approach(tmp_path, north, duration=30):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(north=north, duration=duration))
    report = Simulation(load_scene(path)).run().report
    return report["targets"]["one"]["closest_approach"]


@pytest.mark.parametrize(
    ("north", "time_s", "at"),
    # Closing at 200 m/s: abeam after north / 200 s.
    [(3000, 15, None), (-100, 0, "the start"), (9000, 30, "the end of the run")],
)
def test_where_the_closest_approach_is(tmp_path, north, time_s, at):
    found = approach(tmp_path, north)
    assert found["time_s"] == pytest.approx(time_s, abs=0.11)
    assert found.get("at") == at


def test_the_end_of_a_run_between_samples(tmp_path):
    assert approach(tmp_path, 9000, 29.987)["at"] == "the end of the run"


def test_a_flight_that_ends_earlier(tmp_path):
    rows = ["time,id,lat,lon,alt"]
    for t in range(21):
        rows.append(f"{t},own,0,{t * 0.001},1000")
        if 3 <= t <= 9:
            rows.append(f"{t},one,0.01,{0.05 - t * 0.001},1000")
    (tmp_path / "flights.csv").write_text("\n".join(rows))
    head, _, tail = SCENE.format(north=0, duration=20).partition("[blocks.traffic]")
    tail = tail.partition("[blocks.transform]")[2]
    block = '[blocks.traffic]\ntype = "traffic.csv"\nfile = "flights.csv"\n[blocks.transform]'
    path = tmp_path / "scene.toml"
    path.write_text(head + block + tail)
    report = Simulation(load_scene(path)).run().report
    found = report["targets"]["one"]["closest_approach"]
    assert (found["time_s"], found["at"]) == (9, "the end of its flight")
