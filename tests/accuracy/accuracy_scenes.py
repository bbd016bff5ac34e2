"""Random scenes with tolerances, and how wrong their lines of sight really were."""

import math
from pathlib import Path
from random import Random

import numpy as np

from components.geometry import body_angles_of_sight_line, line_of_sight, unit_vector
from components.messages.reach import EVALUATE
from components.messages.targets import GatedTargets, TrafficStates
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

CONFIGS = Path(__file__).parent.parent.parent / "configs"


class Listener(Recorder):
    """Keeps the messages of the traffic and of the gate."""

    def __init__(self) -> None:
        self.memory = MemorySink()
        super().__init__([self.memory])
        self.states: list[TrafficStates] = []
        self.gated: list[GatedTargets] = []

    def record(self, block: str, message: object) -> None:
        if isinstance(message, TrafficStates):
            self.states.append(message)
        elif isinstance(message, GatedTargets):
            self.gated.append(message)
        super().record(block, message)


def write_scene(folder: Path, seed: int, transform: str, accuracy: dict[str, float]) -> Path:
    """Write a random scene with a 1° radar: any latitude, own manoeuvres, one to five targets.

    Its cameras have no noise: no bound is proven for the Pd of others.
    """
    draw = Random(seed)
    turn = f'legs = [{{ kind = "turn", rate_deg_s = {draw.choice([-3.0, -0.5, 1.0, 2.5])} }}]'
    lat = draw.uniform(-75, 75) if draw.random() < 0.9 else draw.choice([-89.95, 88.0, 85.0, 90.0])
    alt = draw.uniform(200, 9000)
    lines = [
        f'extends = "{(CONFIGS / "detect_and_sense.toml").as_posix()}"',
        "duration_s = 30",
        f"seed = {seed}",
        "[accuracy]",
        *(f"{key} = {value!r}" for key, value in accuracy.items()),
        "[blocks.transform]",
        transform,
        "[blocks.radar]",
        "scan_rate_hz = 1",
        f"range_km = {draw.uniform(3, 20)}",
        f"swerling = {draw.choice([0, 1, 3])}",
        "[blocks.eo]",
        "noise_equivalent_contrast = 0",
        f"scan_rate_hz = 0.5\nenabled = {str(draw.random() < 0.5).lower()}",
        "[blocks.ir]",
        "noise_equivalent_contrast = 0",
        f"scan_rate_hz = 0.5\nenabled = {str(draw.random() < 0.5).lower()}",
        "[blocks.traffic]",
        'type = "traffic.scripted"',
        f"ownship = {{ lat_deg = {lat}, lon_deg = {draw.uniform(-180, 180)}, alt_m = {alt}, "
        f"heading_deg = {draw.uniform(0, 360)}, speed_mps = {draw.uniform(20, 90)}, "
        f"climb_mps = {draw.choice([0.0, 0.0, draw.uniform(-5, 5)])}"
        + draw.choice(["", f", {turn}"])
        + " }",
    ]
    for number in range(draw.randint(1, 5)):
        distance, bearing = 1000 * 10 ** draw.uniform(-0.3, 1.3), draw.uniform(0, 2 * math.pi)
        lines += [
            "[[blocks.traffic.intruders]]",
            f'name = "t{number}"',
            f"rcs_dbsm = {draw.uniform(0, 20)}",
            f"east_m = {distance * math.sin(bearing)}",
            f"north_m = {distance * math.cos(bearing)}",
            f"up_m = {draw.uniform(-0.1, 0.1) * distance}",
            f"heading_deg = {draw.uniform(0, 360)}",
            f"speed_mps = {draw.uniform(0, 150)}",
            f"climb_mps = {draw.uniform(-5, 5)}",
        ]
    path = folder / f"scene_{seed}.toml"
    path.write_text("\n".join(lines))
    return path


def run(path: Path, **options: object) -> tuple[Simulation, Listener]:
    """Run a scene and keep what was said on the way."""
    listener = Listener()
    simulation = Simulation(load_scene(path), recorder=listener, **options)
    simulation.run()
    return simulation, listener


def true_errors(listener: Listener) -> dict[str, float]:
    """Return the largest errors of what sensors looked at, against the exact line of sight.

    Angles in rad (azimuth and elevation in body axes, direction between unit vectors), range in m.
    """
    worst = dict.fromkeys(("azimuth", "elevation", "direction", "range"), 0.0)
    for states, targets in zip(listener.states, listener.gated, strict=True):
        assert np.array_equal(states.tick, targets.tick)
        azimuth, elevation, range_m = line_of_sight(
            states.own_lat_deg[:, None],
            states.own_lon_deg[:, None],
            states.own_alt_m[:, None],
            states.lat_deg,
            states.lon_deg,
            states.alt_m,
        )
        attitude = (
            states.own_yaw_rad[:, None],
            states.own_pitch_rad[:, None],
            states.own_roll_rad[:, None],
        )
        p, q = body_angles_of_sight_line(azimuth, elevation, *attitude)
        looked = np.zeros(range_m.shape, dtype=bool)
        for decision in targets.decisions.values():
            looked[decision.rows] |= decision.reason == EVALUATE
        if not looked.any():
            continue
        true = np.array(unit_vector(p, q))
        got = np.array(unit_vector(targets.body_azimuth_rad, targets.body_elevation_rad))
        chord = np.sqrt(((true - got) ** 2).sum(axis=0))
        turn = targets.body_azimuth_rad - p
        errors = {
            "azimuth": np.abs(np.arctan2(np.sin(turn), np.cos(turn))),
            "elevation": np.abs(targets.body_elevation_rad - q),
            "direction": 2 * np.arcsin(chord / 2),
            "range": np.abs(targets.range_m - range_m),
        }
        for name, error in errors.items():
            worst[name] = max(worst[name], float(error[looked].max()))
    return worst
