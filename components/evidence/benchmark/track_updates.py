"""Track updates for timing: a tracker's own work on wakes that a run has given it."""

import math
from collections.abc import Callable
from typing import Any

import dsa_des
from components.tracking.filters import ExtendedKalman
from dsa_des.block.wake import Wake
from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.replicas.lockstep import lock_step

_DURATION_S = 4
#: Of radar and two cameras, in `_DURATION_S`.
LOOKS = (5 + 20 + 2) * _DURATION_S


class Listening(ExtendedKalman):
    """A tracker that keeps what it is given."""

    lockstep = True
    rewindable = False
    kept: list[Wake]

    def setup(self) -> None:
        """Start with nothing kept."""
        super().setup()
        self.kept = []

    def run(self, wake: Wake) -> Any:
        """Track, and keep the wake."""
        self.kept.append(wake)
        return super().run(wake)


def heard(replicas: int, targets: int) -> Listening:
    """Return the tracker of a run of some replicas, with all that it was given.

    Three sensors see every target at every look.
    """
    scene = dsa_des.load_scene(_scene(targets))
    simulation = lock_step([scene_of(scene, Replica(1 + i, {})) for i in range(replicas)])
    simulation.run()
    block: Any = simulation.components["tracker"]
    assert isinstance(block, Listening)
    return block


def updates(replicas: int, targets: int) -> Callable[[], object]:
    """Return what tracks all targets of some replicas anew, gating and association included."""
    known = heard(replicas, targets)

    def track() -> None:
        block = ExtendedKalman(known.name, known.p, known.context)
        block.setup()
        for wake in known.kept:
            block.run(wake)

    return track


def _scene(targets: int) -> dict[str, Any]:
    around = [2.0 * math.pi * k / targets for k in range(targets)]
    flights = [
        {
            "name": f"t{k}", "east_m": 6000.0 * math.sin(a), "north_m": 6000.0 * math.cos(a),
            "up_m": 100.0 + 10.0 * (k % 20), "heading_deg": math.degrees(a + 1.5) % 360.0,
            "speed_mps": 60.0,
        }
        for k, a in enumerate(around)
    ]  # fmt: skip
    # Errors that are new at every look: what other trackers take them for.
    new = {"errors": "stated", "quantised": False}
    camera = {
        "type": "optical.range_boundary", "range_km": 20.0, "azimuth_error_deg": 0.015,
        "elevation_error_deg": 0.015, **new,
    }  # fmt: skip
    radar = {
        "type": "radar.range_boundary", "range_km": 20.0, "scan_rate_hz": 5,
        "azimuth_error_deg": 0.15, "elevation_error_deg": 0.15, "range_error_m": 3.0, **new,
    }  # fmt: skip
    own = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 1000.0, "heading_deg": 0, "speed_mps": 50.0}
    return {
        "duration_s": _DURATION_S,
        "seed": 1,
        "wires": [
            "traffic -> transform -> gate -> radar -> fusion -> tracker",
            "gate -> eo -> fusion", "gate -> ir -> fusion",
        ],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": flights},
            "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "radar": radar,
            "eo": {**camera, "scan_rate_hz": 20},
            "ir": {**camera, "scan_rate_hz": 2},
            "fusion": {"type": "fusion.pass_through"},
            "tracker": {"type": f"{Listening.__module__}:{Listening.__name__}"},
        },
    }  # fmt: skip
