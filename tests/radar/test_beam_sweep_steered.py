"""A sweeping beam over an ownship that flies what was sensed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from components.flights.many_flights import SteeredFlight
from components.geometry.state import TrajectoryState
from components.messages.known_flights import KnownFlights
from components.messages.steering import Manoeuvre
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

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


def simulate(tmp_path: Path, scene: str = SCENE, **options: Any) -> tuple[Any, dict[str, Any]]:
    path = tmp_path / "loop.toml"
    path.write_text(scene)
    sink = MemorySink()
    simulation = Simulation(load_scene(path), recorder=Recorder([sink]), **options)
    simulation.run()
    return simulation, sink.tables()


def seen_from(simulation: Any, own: Any, target: int, time_s: float) -> tuple[float, float]:
    """Return the azimuth and range of a target at a time, if the ownship flies like this."""
    traffic, transform = simulation.components["traffic"], simulation.components["transform"]
    flights = (own, traffic.targets[target])
    seen = transform._columns_at_other_instants(
        *(flight.at(np.array([[time_s]])) for flight in flights)
    )
    return seen["body_azimuth_rad"][0, 0], seen["range_m"][0, 0]


# In the second, manoeuvres are on their way for so long that a window knows of some that come
# while it lasts; in the third, they may overtake each other.
LATE = SCENE.replace("delay_s = 0.7", "delay_s = 4.3").replace("pause_s = 12", "pause_s = 1.5")
JITTERED = SCENE.replace("delay_s = 0.7", "delay_s = 0.2, jitter_s = 2").replace(
    "pause_s = 12", "pause_s = 0.5"
)


@pytest.mark.parametrize("scene", [SCENE, LATE, JITTERED])
def test_any_window_gives_the_same_rows(tmp_path: Path, scene: str) -> None:
    scene = scene.replace("duration_s = 60", "duration_s = 40")
    _, whole = simulate(tmp_path, scene)
    assert whole["manoeuvres"].num_rows >= 3
    for options in ({"window": 1}, {"window": 7}, {"window": 31, "shuffle_ties": 2}):
        _, other = simulate(tmp_path, scene, **options)
        for name, table in whole.items():
            assert table.equals(other[name]), (name, options)


# In this one, manoeuvres arrive just as scans begin.
ON_TIME = SCENE.replace("delay_s = 0.7", "delay_s = 1")


@pytest.mark.parametrize(("scene", "delay_s"), [(SCENE, 0.7), (LATE, 4.3), (ON_TIME, 1.0)])
@pytest.mark.parametrize("window", [None, 1])
def test_a_scan_follows_the_flight_that_is_known_when_it_begins(
    tmp_path: Path, scene: str, delay_s: float, window: int | None
) -> None:
    """What was ordered is read from the record, and the flight built from the first orders only."""
    simulation, tables = simulate(tmp_path, scene, window=window)
    traffic = simulation.components["traffic"]
    orders = tables["manoeuvres"].to_pylist()
    came_s = [order["time_s"] + delay_s for order in orders]
    flights: list[Any] = [SteeredFlight(traffic.own.flight)]
    for order, at_s in zip(orders, came_s, strict=True):
        turn = Manoeuvre(order["turn_rad"], order["rate_rad_s"])
        flights.append(flights[-1].add_manoeuvre(at_s, turn))
    compared = under_way = 0
    for row in tables["detections"].to_pylist():
        scan_s, lit_s = float(row["scan"]), row["illuminated_s"]
        target = traffic.roster.names.index(row["target"])
        known = sum(at_s <= scan_s for at_s in came_s)
        azimuth_rad, range_m = seen_from(simulation, flights[known], target, lit_s)
        assert row["range_m"] == pytest.approx(range_m, abs=1e-6)
        assert row["azimuth_rad"] == pytest.approx(azimuth_rad, abs=1e-9)
        # The beam, at 340 deg/s from -170 deg on, is there then.
        beam_rad = np.radians(-170 + 340 * (lit_s - scan_s))
        assert row["azimuth_rad"] == pytest.approx(beam_rad, abs=1e-8)
        compared += 1
        if any(scan_s < at_s < lit_s - 0.05 for at_s in came_s):
            under_way += 1
            _, turned_m = seen_from(simulation, traffic.own, target, lit_s)
            assert turned_m != range_m
    assert compared > 50
    assert (under_way >= 2) is (scene is not ON_TIME)


def test_without_manoeuvres_the_targets_would_be_elsewhere(tmp_path: Path) -> None:
    simulation, tables = simulate(tmp_path)
    traffic = simulation.components["traffic"]
    last = tables["detections"].to_pylist()[-1]
    target = traffic.roster.names.index(last["target"])
    _, straight_m = seen_from(simulation, traffic.own.flight, target, last["illuminated_s"])
    assert abs(straight_m - last["range_m"]) > 100.0


def test_rows_keep_the_flights_they_know() -> None:
    """Rows of many messages, joined, cut and picked, answer as each would alone."""

    class Manoeuvres:
        """Ownships that are 100 times their run and as many degrees north as is known of them."""

        traffic = "one"

        def __init__(self, count: int) -> None:
            self.manoeuvre_count = count

        def states(
            self, run: Any, known: Any, columns: Any, time_s: Any, ahead_s: Any, viewer: int
        ) -> Any:
            assert viewer == -1
            known = known[..., 0]
            assert (known <= self.manoeuvre_count).all()
            zero = np.zeros(time_s.shape)
            north = zero + 100 * run + known
            own = TrajectoryState(north, zero, zero, zero, zero, zero, zero == 0)
            time_s = time_s + ahead_s
            other = TrajectoryState(time_s, zero + columns, zero, zero, zero, zero, zero == 0)
            return own, other

    runs, knows = np.array([0, 0, 0, 0, 7, 7, 7]), np.array([0, 1, 1, 1, 1, 3, 2])
    parts = [
        KnownFlights(Manoeuvres(count), runs[rows], knows[rows, np.newaxis])
        for count, rows in ((1, slice(0, 3)), (4, slice(3, 4)), (3, slice(4, 7)))
    ]
    joined = KnownFlights.join_rows(parts)
    north = 100 * runs + knows
    columns, rows = np.array([5, 8]), np.array([6, 0, 3, 5, 5])
    time_s = np.arange(14.0).reshape(7, 2)
    for one, which in ((joined, np.arange(7)), (joined.take_rows(rows), rows)):
        own, other = one(columns, time_s[which])
        assert (own.lat_deg == north[which, np.newaxis]).all()
        assert (other.lat_deg == time_s[which]).all()
        assert (other.lon_deg == columns).all()

    def northward(own: Any, other: Any) -> Any:
        return {"north_deg": other.lat_deg - own.lat_deg, "of": {"target": other.lon_deg}}

    halves = [
        joined.take_rows(rows).with_states_transformed(northward)
        for rows in (slice(0, 4), slice(4, 7))
    ]
    seen = KnownFlights.join_rows(halves)
    assert (seen(columns, time_s)["north_deg"] == time_s - north[:, np.newaxis]).all()
    row, ahead_s = np.array([5, 0, 6]), np.array([0.5, 0.25, 0.0])
    each = seen.columns_of_single_targets(row, np.array([8, 5, 8]), time_s[row, 0], ahead_s)
    assert (each["north_deg"] == time_s[row, 0] + ahead_s - north[row]).all()
    assert each["of_target"].tolist() == [8, 5, 8]
