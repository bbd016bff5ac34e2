"""What a sensor decides when the gate's messages are lost on the way."""

import pytest

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

# The intruder comes into the radar's 5 km after about half of the run, at 300 m/s.
SCENE = """
duration_s = 20
seed = 7
wires = [
  "traffic -> transform -> gate",
  { from = "gate", to = "radar", drop_probability = 0.4 },
]

[blocks]
transform.type = "geometry.ellipsoid"
gate.type = "gate"
radar = { type = "radar.range_boundary", scan_rate_hz = 2, range_km = 5 }

[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52, lon_deg = 4, alt_m = 1000 }

[[blocks.traffic.intruders]]
name = "fast"
east_m = 0
north_m = 8000
up_m = 0
heading_deg = 180
speed_mps = 300
"""


def recorded(path, **options):
    sink = MemorySink()
    Simulation(load_scene(path), recorder=Recorder([sink]), **options).run()
    return sink.tables()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("window", [None, 1, 7])
def test_the_last_picture_that_came_decides(tmp_path, window, seed):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.replace("seed = 7", f"seed = {seed}"))
    tables = recorded(path, window=window)
    path.write_text(SCENE.replace("drop_probability = 0.4", "drop_probability = 0"))
    whole = recorded(path)
    ranges_m = {row["time_s"]: row["range_m"] for row in whole["detections"].to_pylist()}
    seen = {row["time_s"]: row["range_m"] for row in tables["detections"].to_pylist()}
    evaluated = {row["time_s"]: row["evaluated"] for row in tables["scans"].to_pylist()}
    stale = 0
    for time_s, here in evaluated.items():
        # What is seen was in reach when the picture was taken, and is dated by its distance.
        assert here == (time_s in seen)
        if here:
            assert seen[time_s] in ranges_m.values()
            stale += seen[time_s] != ranges_m[time_s]
    missed = [time_s for time_s in ranges_m if evaluated.get(time_s) == 0]
    assert stale > 3
    # Lost at the edge of the reach: the picture before still shows it outside.
    assert all(time_s < 12.5 for time_s in missed)
