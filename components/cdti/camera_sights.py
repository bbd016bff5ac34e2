"""What cameras detected last of each target, and the picture of one of them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.cdti.camera_picture import silhouette
from components.cdti.own_flight import OwnNow
from components.messages.detections import Detections
from components.messages.targets import TrafficStates
from components.optical.camera import Camera
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Component
from dsa_des.text.safe_text import printable

# When, where in body axes, how far, how large, how far above the threshold.
_COLUMNS = ("time_s", "azimuth_rad", "elevation_rad", "range_m", "pixels", "margin")


class CameraSights:
    """The last detection of each target by each camera that has a picture.

    Parameters
    ----------
    components : mapping
        Blocks by name.
    """

    def __init__(self, components: Mapping[str, Component]) -> None:
        self._cameras = {n: c for n, c in components.items() if isinstance(c, Camera)}
        self._seen: dict[str, FloatArray] = {}
        self._roster: Roster | None = None
        #: The latest positions and attitudes of all aircraft: what there is to be seen.
        self.states: TrafficStates | None = None

    def take(self, block: str, message: Detections, ticks_per_s: int) -> None:
        """Take in what a camera detected."""
        if block not in self._cameras or "pixels" not in message.extras:
            return
        self._roster = message.roster
        real = np.flatnonzero(message.target >= 0)
        if len(real) == 0:
            return
        seen = self._seen.get(block)
        seen = np.full((len(message.roster), 6), np.nan) if seen is None else seen.copy()
        seen[message.target[real]] = np.stack([
            message.measured_ticks()[real] / ticks_per_s, message.azimuth_rad[real],
            message.elevation_rad[real], message.true_range_m[real],
            message.extras["pixels"][real], message.confidence[real],
        ], axis=1)  # fmt: skip
        self._seen[block] = seen

    def picture(self, target: int, time_s: float, own: OwnNow) -> dict[str, Any] | None:
        """Return the newest picture of a target, or None where no camera has seen it."""
        states, roster = self.states, self._roster
        if roster is None or states is None or not 0 <= target < len(roster):
            return None
        names = [n for n, seen in self._seen.items() if math.isfinite(seen[target, 0])]
        if not names:
            return None
        name = max(names, key=lambda n: self._seen[n][target, 0])
        camera = self._cameras[name]
        seen_s, azimuth, elevation, range_m, pixels, margin = self._seen[name][target].tolist()
        place = int(np.searchsorted(states.columns, target))
        if place == len(states.columns) or states.columns[place] != target:
            return None
        attitude = np.array(
            [getattr(states, f"{a}_rad")[-1, place] for a in ("yaw", "pitch", "roll")]
        )
        aircraft = roster.aircraft[target]
        drawn = silhouette(
            aircraft.ir if camera.areas == "ir" else aircraft.eo,
            attitude,
            np.array([own.heading_rad, own.pitch_rad, own.roll_rad]),
            (azimuth, elevation),
            range_m,
            (camera.pixel_azimuth_rad, camera.pixel_elevation_rad),
        )
        strength = camera.p.static_weight * pixels
        contrast = (margin + camera.p.threshold) / strength if strength > 0.0 else 0.0
        up = elevation + own.pitch_rad * math.cos(azimuth) - own.roll_rad * math.sin(azimuth)
        return {
            "target": target,
            "sensor": printable(name),
            "infrared": camera.areas == "ir",
            "age": round(max(time_s - seen_s, 0.0), 2),
            "pixels": round(pixels, 1),
            "contrast": round(contrast, 3),
            # Above or below the horizon, small attitudes taken as small.
            "background": "sky" if up >= -_dip_rad(own.alt_m) else "ground",
            "horizon": round((-_dip_rad(own.alt_m) - up) / camera.pixel_elevation_rad, 1),
            "fuselage": np.round(drawn.fuselage, 2).tolist(),
            "wing": np.round(drawn.wing, 2).tolist(),
        }


def _dip_rad(alt_m: float) -> float:
    """Return how far the horizon of a sphere of the Earth's size lies below the level."""
    return math.acos(1.0 / (1.0 + max(alt_m, 0.0) / 6_371_000.0))
