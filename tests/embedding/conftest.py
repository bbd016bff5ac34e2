"""A host program for tests: it flies what a scene's own traffic flies."""

from types import SimpleNamespace

import numpy as np
import pytest

from dsa_des.embed import Simulator
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene


def radians_of(degrees):
    """Return radians that turn back into exactly these degrees, where there are such."""
    near = np.radians(degrees)
    found = near.copy()
    for other in (np.nextafter(near, 9.0), np.nextafter(near, -9.0)):
        fits = (np.degrees(found) != degrees) & (np.degrees(other) == degrees)
        found = np.where(fits, other, found)
    return found


class Host:
    """Moves the aircraft of a scene's own traffic."""

    def __init__(self, scene, **load):
        self.whole = Simulation(load_scene(scene, **load), recorder=Recorder([]))
        self.traffic = self.whole.components["traffic"]

    def add_planes(self, simulator):
        roster = self.traffic.roster
        for name, aircraft in zip(roster.names, roster.aircraft, strict=True):
            simulator.add_plane(name, aircraft=aircraft)

    def at(self, time_s):
        """Return the arrays of `simulate` at a time."""
        time = np.array([time_s])
        own, others = self.traffic.own.at(time), self.traffic.targets.at(time)
        lla, att = [], []
        for state in (own, others):
            lat, lon = radians_of(state.lat_deg), radians_of(state.lon_deg)
            lla.append(np.stack([lat, lon, state.alt_m], axis=-1)[0])
            att.append(np.stack([state.yaw_rad, state.pitch_rad, state.roll_rad], axis=-1)[0])
        lla[1] = np.where(others.present[0][:, np.newaxis], lla[1], np.nan)
        return lla[0], att[0], lla[1], att[1]


def run_whole(scene, **load):
    """Run a scene by itself and return its tables."""
    memory = MemorySink()
    Simulation(load_scene(scene, **load), recorder=Recorder([memory])).run()
    return memory.tables()


def fly(simulator, host, end_s, plane=None):
    """Call at every scan instant before the end and return the results."""
    results = []
    time_s = simulator.next_scan_s()
    while time_s < end_s:
        states = host.at(time_s)
        if plane is None:
            results.append(simulator.simulate(*states, time_s))
        else:
            results.append([plane(simulator, states, time_s, i) for i in range(len(states[2]))])
        time_s = simulator.next_scan_s()
    return results


@pytest.fixture
def flying():
    """Everything above."""
    return SimpleNamespace(
        Host=Host, run_whole=run_whole, fly=fly, Simulator=Simulator, radians_of=radians_of
    )
