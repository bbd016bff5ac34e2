"""Times of single calls of the embedding interface: how long a host waits for an answer."""

import time
from typing import Any

import numpy as np

from components.benchmark.scenes import SCENES
from dsa_des.embed import Simulator
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

#: What a call may take at its 99th percentile, us.
WANTED_US = 1000.0
_SCENE = "thesis"


def measure_calls(calls: int, repeats: int) -> dict[str, Any]:
    """Return counts and percentiles of wall and CPU time, µs, of embedding interface calls.

    Four intruders fly towards and past the ownship; radar, EO and IR are all due at every call,
    which is the most that a call can have to do. Wall time is what the host waits; processor time
    leaves out what other programs took of it; undisturbed is each call's best of all repetitions.
    Fixed work, the same every time, is timed between the calls: how far its 99th percentile lies
    above its median is the machine's doing.
    """
    scene = SCENES / f"{_SCENE}.toml"
    traffic: Any = Simulation(load_scene(scene)).components["traffic"]
    flights = [_host_inputs(traffic, float(k)) for k in range(calls)]
    wall, cpu, first, machine = [], [], [], []
    detections = 0
    for _ in range(repeats):
        simulator = Simulator(scene)
        for name, craft in zip(traffic.roster.names, traffic.roster.aircraft, strict=True):
            simulator.add_plane(name, aircraft=craft)
        simulator.start()
        for k, states in enumerate(flights):
            started, worked = time.perf_counter_ns(), time.thread_time_ns()
            result = simulator.simulate(*states, float(k))
            spent, waited = time.thread_time_ns() - worked, time.perf_counter_ns() - started
            assert len(result.scans) == 3
            detections += sum(sighting.detected for sighting in result)
            wall.append(waited / 1000.0)
            cpu.append(spent / 1000.0)
            if k == 0:
                first.append(waited / 1000.0)
            machine.append(_fixed_work_ns() / 1000.0)
    return {
        "scene": "embed",
        "what": "4 intruders, 3 sensors, all due at every call",
        "calls": len(wall),
        "sightings": detections,
        "wanted_p99_us": WANTED_US,
        "first_us": max(first),
        "wall_us": _percentiles(wall),
        "cpu_us": _percentiles(cpu),
        "undisturbed_us": _percentiles(np.array(wall).reshape(repeats, calls).min(axis=0).tolist()),
        "fixed_us": _percentiles(machine),
        "share_within_wanted": float(np.mean(np.array(wall) <= WANTED_US)),
    }


def _fixed_work_ns() -> int:
    """Run 500 small NumPy additions and return the time they took, ns."""
    few = np.arange(4.0)
    started = time.perf_counter_ns()
    for _ in range(500):
        np.add(few, few)
    return time.perf_counter_ns() - started


def _host_inputs(traffic: Any, time_s: float) -> tuple[Any, Any, Any, Any]:
    """Return what a host passes to a call at a time: own position and attitude, then targets'."""
    time_of = np.array([time_s])
    states = [traffic.own.at(time_of), traffic.targets.at(time_of)]
    lla = [np.stack([np.radians(s.lat_deg), np.radians(s.lon_deg), s.alt_m], -1) for s in states]
    att = [np.stack([s.yaw_rad, s.pitch_rad, s.roll_rad], -1) for s in states]
    return lla[0][0], att[0][0], lla[1][0], att[1][0]


def _percentiles(values: list[float]) -> dict[str, float]:
    return {
        "p50": float(np.percentile(values, 50)),
        "p99": float(np.percentile(values, 99)),
        "max": max(values),
    }
