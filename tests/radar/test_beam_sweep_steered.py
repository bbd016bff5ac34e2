"""A sweeping beam over an ownship that flies what was sensed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsa_des.recording import MemorySink, Recorder
from dsa_des.scene import load_scene
from dsa_des.simulation import Simulation

# A manoeuvre arrives 0.7 s after a scan begins and one scan lasts a second: most turns begin while
# the beam is under way.
SCENE = """
duration_s = 60
seed = 3
wires = [
  "traffic -> transform -> gate -> radar -> fusion -> tracker -> avoidance",
  { from = "avoidance", to = "traffic", delay_s = 0.7, holds = "nothing" },
]

[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52, lon_deg = 4, alt_m = 1000, heading_deg = 20, speed_mps = 80 }
intruders = [
  { name = "ahead", east_m = 1500, north_m = 4500, up_m = 50, heading_deg = 190, speed_mps = 60 },
  { name = "left", east_m = -3000, north_m = 1500, up_m = -80, heading_deg = 60, speed_mps = 90 },
]

[blocks.transform]
type = "geometry.ellipsoid"

[blocks.gate]
type = "gate"

[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 1
range_km = 12
azimuth_deg = [-170, 170]
beam_sweep = true

[blocks.fusion]
type = "fusion.pick_best"

[blocks.tracker]
type = "tracking.stub"

[blocks.avoidance]
type = "avoidance.turn_away"
range_km = 10
turn_deg = 40
rate_deg_s = 6
pause_s = 12
"""


def simulate(tmp_path: Path, **options: Any) -> tuple[Any, dict[str, Any]]:
    path = tmp_path / "loop.toml"
    path.write_text(SCENE)
    sink = MemorySink()
    simulation = Simulation(load_scene(path), recorder=Recorder([sink]), **options)
    simulation.run()
    return simulation, sink.tables()


def test_any_window_gives_the_same_rows(tmp_path: Path) -> None:
    _, whole = simulate(tmp_path)
    assert whole["manoeuvres"].num_rows >= 3
    for options in ({"window": 1}, {"window": 5}, {"shuffle_ties": 2}):
        _, other = simulate(tmp_path, **options)
        for name, table in whole.items():
            assert table.equals(other[name]), (name, options)


def test_lit_positions_follow_the_steered_flight(tmp_path: Path) -> None:
    simulation, tables = simulate(tmp_path)
    traffic = simulation.components["traffic"]
    revisit = simulation.components["transform"]._revisit(traffic.flights)
    # The flight of the whole run is known now; a scan knows what was ordered when it began.
    turns = np.array([start for start, _ in traffic.own.parts])
    assert len(turns) == tables["manoeuvres"].num_rows
    rows = tables["detections"].to_pylist()
    compared = 0
    for row in rows:
        scan, lit = float(row["scan"]), row["illuminated_s"]
        target = traffic.roster.names.index(row["target"])
        seen = revisit(np.array([target]), np.array([[lit]]))
        if ((turns > scan) & (turns <= lit)).any():
            continue
        compared += 1
        assert row["range_m"] == pytest.approx(seen["range_m"][0, 0], abs=1e-6)
        assert row["azimuth_rad"] == pytest.approx(seen["body_azimuth_rad"][0, 0], abs=1e-9)
    assert compared > 0.9 * len(rows) > 50
    # Without the manoeuvres the same targets would be elsewhere.
    traffic.own = traffic.own.flight
    last = rows[-1]
    target = traffic.roster.names.index(last["target"])
    straight = revisit(np.array([target]), np.array([[last["illuminated_s"]]]))
    assert abs(straight["range_m"][0, 0] - last["range_m"]) > 100.0
