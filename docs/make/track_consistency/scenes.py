"""The scenes of a case: its sensors and tracker, and flights as stated or drawn from a model."""

import math
from collections.abc import Iterable
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

import dsa_des
from components.estimation.motion import Motion
from components.geometry import enu_to_geodetic
from docs.make.track_consistency.cases import OWNSHIP, Case
from dsa_des.replicas.changed_scene import Replica, replica_scene

_DURATION_S = 37
_FLIGHTS = 10


def scene_of_case(case: Case, traffic: dict[str, Any]) -> dict[str, Any]:
    """Return a scene as a table."""
    wires: list[Any] = ["traffic -> transform -> gate", "fusion -> tracker"]
    for name in case.sensors:
        wires += [f"gate -> {name}", {"from": name, "to": "fusion", **case.wire}]
    return {
        "duration_s": _DURATION_S, "seed": 1, "wires": wires,
        "blocks": {
            "traffic": traffic, "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"}, **case.sensors, "fusion": {"type": "fusion.pass_through"},
            "tracker": case.tracker,
        },
    }  # fmt: skip


def drawn_flights(path: Path, model: Motion, number: int) -> None:
    """Write a CSV file with the ownship and flights drawn from a motion model, all around it."""
    step_s, rng = 0.1, np.random.default_rng(number)
    own = np.radians(OWNSHIP["heading_deg"])
    course = np.array([np.cos(own), np.sin(own)]) * OWNSHIP["speed_mps"]
    around = (np.arange(_FLIGHTS) + rng.uniform()) * 2.0 * np.pi / _FLIGHTS
    heading = rng.uniform(0.0, 2.0 * np.pi, _FLIGHTS)
    state = np.zeros((model.size, _FLIGHTS))
    state[:2] = 5000.0 * np.stack([np.cos(around), np.sin(around)])
    state[2] = -rng.uniform(100.0, 500.0, _FLIGHTS)
    state[3:5] = 60.0 * np.stack([np.cos(heading), np.sin(heading)])
    if model.size > 6:
        state[6] = math.radians(3.0) * rng.choice([-1.0, 1.0], _FLIGHTS)
    step = np.full(_FLIGHTS, step_s)
    root = np.linalg.cholesky(model.noise(step)[:, :, 0] + 1e-20 * np.eye(model.size))
    rows = ["time_s,id,lat_deg,lon_deg,alt_m,yaw_deg,pitch_deg,roll_deg"]
    for k in range(int((_DURATION_S + 1) / step_s)):
        t = k * step_s
        north, east, down = np.column_stack([[*(course * t), -OWNSHIP["climb_mps"] * t], state[:3]])
        lat, lon, alt = enu_to_geodetic(
            east, north, -down, reference_lat_deg=OWNSHIP["lat_deg"],
            reference_lon_deg=OWNSHIP["lon_deg"], reference_alt_m=OWNSHIP["alt_m"],
        )  # fmt: skip
        turned = [tuple(OWNSHIP[f"{name}_deg"] for name in ("yaw", "pitch", "roll"))]
        turned += [(0.0, 0.0, 0.0)] * _FLIGHTS
        rows += [
            f"{t:.1f},{'own' if i == 0 else f't{i}'},{lat[i]:.14g},{lon[i]:.14g},{alt[i]:.12g},"
            + ",".join(f"{angle:g}" for angle in turned[i])
            for i in range(1 + _FLIGHTS)
        ]
        state = model.move(state, step) + root @ rng.normal(size=state.shape)
    path.write_text("\n".join(rows) + "\n")


def scenes_of(case: Case, replicas: int, folder: Path) -> Iterable[list[Any]]:
    """Yield scenes that may run in lock step together."""
    if case.drawn is None:
        traffic = {"type": "traffic.scripted", "ownship": OWNSHIP, "intruders": case.targets}
        scene = dsa_des.load_scene(scene_of_case(case, traffic))
        yield [replica_scene(scene, Replica(1 + i, {})) for i in range(replicas)]
        return
    for number in range(-(-replicas // _FLIGHTS)):
        path = folder / f"flights{number}.csv"
        drawn_flights(path, case.drawn, number)
        read: dict[str, Any] = {"type": "traffic.csv", "file": str(path), "ownship": "own"}
        if case.aircraft:
            crafts = zip(range(1, 1 + _FLIGHTS), cycle(case.aircraft), strict=False)
            read["aircraft"] = {f"t{i}": craft for i, craft in crafts}
        scene = dsa_des.load_scene(scene_of_case(case, read))
        yield [replica_scene(scene, Replica(1 + number, {}))]
