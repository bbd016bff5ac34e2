"""Targets that cannot come in reach are not moved, and nothing else changes."""

import math
import random
from pathlib import Path

import numpy as np
import pytest

from components.aircraft.aircraft import Aircraft, Roster
from components.flights.culling import near_intervals
from components.flights.legs import Straight, Turn, Waypoint, Waypoints
from components.flights.sampled_flight import SampledTrajectory
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight
from components.messages.targets import TrafficStates
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

OWN = ScriptedTrajectory("own", lat_deg=52.0, lon_deg=4.0, alt_m=1000, speed_mps=50)
ALONE = ScriptedFleet([OWN])


def flights(count: int, seed: int) -> list[ScriptedTrajectory]:
    draw = random.Random(seed)
    made = []
    for i in range(count):
        speed = draw.uniform(0, 150)
        legs = draw.choice(
            [
                (),
                (Straight(duration_s=40), Turn(rate_deg_s=draw.uniform(1, 5))),
                (
                    Waypoints(
                        points=(
                            Waypoint(
                                east_m=0, north_m=draw.uniform(0, 9e3), up_m=500, speed_mps=90
                            ),
                            Waypoint(east_m=3e4, north_m=0, up_m=0, speed_mps=140),
                        )
                    ),
                ),
            ]
        )
        made.append(
            ScriptedTrajectory.from_offset(
                f"t{i}",
                east_m=draw.uniform(-5e4, 5e4),
                north_m=draw.uniform(-5e4, 5e4),
                up_m=draw.uniform(-500, 3000),
                reference=(52.0, 4.0, 1000.0),
                heading_deg=draw.uniform(0, 360),
                speed_mps=speed if legs == () else speed + 1,
                climb_mps=draw.uniform(-5, 5),
                legs=legs,
            )
        )
    return made


@pytest.mark.parametrize("seed", range(4))
def test_whoever_comes_in_reach_is_active(seed: int) -> None:
    targets = flights(60, seed)
    fleet = ScriptedFleet(targets)
    intervals = near_intervals(ALONE, fleet, 15_000.0, 320.0)
    left_out = 0
    for start in np.arange(0, 300, 7.3):
        times = np.linspace(start, start + 13.0, 60)
        columns = intervals.targets_near(times[0], times[-1])
        own, all_states = OWN.at(times), fleet.at(times)
        _, _, range_m = line_of_sight(
            own.lat_deg[:, None], own.lon_deg[:, None], own.alt_m[:, None],
            all_states.lat_deg, all_states.lon_deg, all_states.alt_m,
        )  # fmt: skip
        near = np.flatnonzero((range_m <= 15_000.0).any(axis=0))
        assert set(near) <= set(columns.tolist())
        left_out += len(targets) - len(columns)
        # The few are moved exactly as they would be among all.
        subset = fleet.subset(columns)
        np.testing.assert_array_equal(subset.at(times).lat_deg, all_states.lat_deg[:, columns])
    assert left_out > 500


def test_intervals_are_those_of_entry_and_exit() -> None:
    targets, reach = flights(80, 11), 15_000.0
    found = near_intervals(ALONE, ScriptedFleet(targets), reach, 400.0)
    times = np.arange(0, 400, 0.05)
    own, states = OWN.at(times), ScriptedFleet(targets).at(times)
    _, _, range_m = line_of_sight(
        own.lat_deg[:, None], own.lon_deg[:, None], own.alt_m[:, None],
        states.lat_deg, states.lon_deg, states.alt_m,
    )  # fmt: skip
    covered = np.zeros(range_m.shape, dtype=bool)
    for target, start, end in zip(found.target, found.start_s, found.end_s, strict=True):
        inside = (times >= start) & (times <= end)
        covered[inside, target] = True
        # Each interval has a moment, within the finest step of its ends, at the very edge.
        for edge in (start, end):
            if 0 < edge < 400:
                near_edge = np.abs(times - edge) <= 0.6
                assert np.min(np.abs(range_m[near_edge, target] - reach)) < 300 * 0.6
    assert covered[range_m <= reach].all()
    spare = covered & (range_m > reach + 2.0)
    assert 0 < spare.sum() * 0.05 < len(found.target) * 1.2
    assert found.max_near_targets_at_once() == covered.sum(axis=1).max()


def test_absent_targets_and_an_absent_ownship_are_near_nobody() -> None:
    def flight(name: str, start: float, end: float | None) -> ScriptedTrajectory:
        return ScriptedTrajectory(
            name, lat_deg=52, lon_deg=4, alt_m=900, start_time_s=start, end_time_s=end
        )

    targets = [flight("early", 0, 20), flight("late", 70, None), flight("always", 0, None)]
    own = ScriptedFleet([flight("own", 0, 60)])
    found = near_intervals(own, ScriptedFleet(targets), 1000.0, 100.0)
    assert found.target.tolist() == [0, 2]
    assert found.end_s == pytest.approx([20, 60], abs=0.6)
    none = near_intervals(ALONE, ScriptedFleet([]), 1000.0, 100.0)
    assert len(none.targets_near(0, 100)) == 0 == none.max_near_targets_at_once()


def test_a_flight_along_the_edge_of_the_reach_is_not_cut_up_for_ever() -> None:
    beside = ScriptedTrajectory.from_offset(
        "beside", east_m=15_000, north_m=0, up_m=0, reference=(52.0, 4.0, 1000.0), speed_mps=50
    )
    found = near_intervals(ALONE, ScriptedFleet([beside]), 15_000.0, 86_400.0)
    assert len(found.target) < 200
    assert found.targets_near(40_000, 40_001).tolist() == [0]


def test_speed_bounds_hold_for_sampled_flights() -> None:
    rng = np.random.default_rng(2)
    time_s = np.cumsum(rng.uniform(0.5, 3.0, 40))
    track = np.cumsum(rng.uniform(-0.2, 0.2, 40))
    east, north = 80 * np.sin(track), 80 * np.cos(track)
    lat = 52 + np.cumsum(np.append(0, north[:-1] * np.diff(time_s))) / 111_000
    lon = 4 + np.cumsum(np.append(0, east[:-1] * np.diff(time_s))) / 68_000
    for velocity in (None, (east, north, np.zeros(40))):
        flight = SampledTrajectory(
            "s", time_s, lat, lon, np.full(40, 900.0), velocity_enu_mps=velocity
        )
        fine = np.linspace(time_s[0], time_s[-1], 20_001)
        state = flight.at(fine)
        _, _, step = line_of_sight(
            state.lat_deg[:-1], state.lon_deg[:-1], state.alt_m[:-1],
            state.lat_deg[1:], state.lon_deg[1:], state.alt_m[1:],
        )  # fmt: skip
        fastest = float(np.max(step / np.diff(fine)))
        assert fastest <= flight.max_speed_mps < 4 * fastest


def sparse_scene(folder: Path, configs: Path, optics: bool) -> Path:
    draw = random.Random(9)
    lines = [
        f'extends = "{(configs / "detect_and_sense.toml").as_posix()}"',
        "duration_s = 120",
        "seed = 4",
        "[blocks.eo]",
        f"scan_rate_hz = 2\nenabled = {str(optics).lower()}",
        "[blocks.ir]",
        "scan_rate_hz = 1",
        "[blocks.traffic]",
        'type = "traffic.scripted"',
        "ownship = { lat_deg = 52, lon_deg = 4.4, alt_m = 1000, heading_deg = 30, speed_mps = 60 }",
    ]
    for i in range(200):
        far = draw.random() < 0.9
        lines += [
            "[[blocks.traffic.intruders]]",
            f'name = "t{i}"',
            f"east_m = {draw.uniform(60e3, 300e3) if far else draw.uniform(-9e3, 9e3)}",
            f"north_m = {draw.uniform(-20e3, 20e3)}",
            "up_m = 100",
            f"heading_deg = {draw.uniform(0, 360)}",
            f"speed_mps = {draw.uniform(30, 150)}",
        ]
    path = folder / "sparse.toml"
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("optics", [False, True])
def test_culling_changes_nothing_but_the_counts(
    tmp_path: Path, configs: Path, optics: bool
) -> None:
    scene = load_scene(sparse_scene(tmp_path, configs, optics))

    def run(**options: object) -> tuple[dict, int]:
        sink = MemorySink()
        moved = 0

        class Counting(Recorder):
            def record(self, block: str, message: object) -> None:
                nonlocal moved
                if isinstance(message, TrafficStates):
                    moved += message.lat_deg.size
                super().record(block, message)

        Simulation(scene, recorder=Counting([sink]), **options).run()
        return sink.tables(), moved

    planned, cells = run()
    whole, all_cells = run(simulate_everything=True)
    assert cells < all_cells / 3
    for name in ("detections", "fused", "tracks"):
        assert planned[name].num_rows > 0
        assert planned[name].equals(whole[name]), name
    counts = [c for c in whole["scans"].column_names if c.startswith("skipped_")] + ["evaluated"]
    rest = [c for c in whole["scans"].column_names if c not in counts]
    assert planned["scans"].select(rest).equals(whole["scans"].select(rest))
    for tables in (planned, whole):
        total = sum(np.array(tables["scans"][c]) for c in counts)
        assert (total == 200).all()
    assert math.fsum(np.array(planned["scans"]["skipped_culled"])) > 0
    for window in (1, 5):
        again, _ = run(window=window)
        for name in planned:  # the counts of what was left out as well
            assert planned[name].equals(again[name]), (name, window)


def test_keys_of_draws_are_made_for_those_who_are_drawn_for() -> None:
    roster = Roster.from_pairs([(f"t{i}", Aircraft()) for i in range(50)])
    some = np.array([7, 3, 7, 49])
    keys = roster.draw_keys_of(some)
    assert "keys" not in vars(roster)
    np.testing.assert_array_equal(roster.draw_keys_of(np.array([3, 4])), roster.keys[[3, 4]])
    np.testing.assert_array_equal(keys, roster.keys[some])
