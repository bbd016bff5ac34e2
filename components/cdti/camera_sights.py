"""What cameras detected last of each target, and the picture of one of them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.cdti.camera_picture import horizon, silhouette
from components.cdti.own_flight import OwnNow
from components.geometry.attitude import ned_to_body
from components.messages.alerts import TRACKS_FROM
from components.messages.detections import Detections
from components.messages.targets import TrafficStates
from components.optical.camera import Camera
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Component
from dsa_des.text.safe_text import printable

# When, where in body axes, how far, how large, how far above the threshold.
_COLUMNS = 6
#: A picture belongs to a track if it was taken so near to its direction, so lately.
NEAR_RAD, LATELY_S = math.radians(3.0), 2.0


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
        seen = np.full((len(message.roster), _COLUMNS), np.nan) if seen is None else seen.copy()
        seen[message.target[real]] = np.stack([
            message.measured_ticks()[real] / ticks_per_s, message.azimuth_rad[real],
            message.elevation_rad[real], message.true_range_m[real],
            message.extras["pixels"][real], message.confidence[real],
        ], axis=1)  # fmt: skip
        self._seen[block] = seen

    def picture(
        self, contact: int, toward: tuple[float, float] | None, time_s: float, own: OwnNow
    ) -> dict[str, Any] | None:
        """Return the newest picture of a contact, or None where no camera has seen it.

        Parameters
        ----------
        contact : int
            Of a tracker that knows no targets the picture nearest to its direction is taken.
        toward : (bearing, elevation) or None
            Of the contact, rad.
        time_s : float
        own : OwnNow
        """
        states, roster = self.states, self._roster
        if roster is None or states is None:
            return None
        target = contact
        if contact >= TRACKS_FROM:
            target = -1 if toward is None else self._nearest(toward, time_s, own)
        if not 0 <= target < len(roster):
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
        own_attitude = np.array([own.heading_rad, own.pitch_rad, own.roll_rad])
        pixel_rad = camera.pixel_azimuth_rad, camera.pixel_elevation_rad
        aircraft = roster.aircraft[target]
        drawn = silhouette(
            aircraft.ir if camera.areas == "ir" else aircraft.eo,
            attitude,
            own_attitude,
            (azimuth, elevation),
            range_m,
            pixel_rad,
        )
        line = horizon(own_attitude, (azimuth, elevation), _dip_rad(own.alt_m), pixel_rad)
        strength = camera.p.static_weight * pixels
        contrast = (margin + camera.detector.threshold) / strength if strength > 0.0 else 0.0
        return {
            "target": contact,
            "sensor": printable(name),
            "infrared": camera.areas == "ir",
            "age": round(max(time_s - seen_s, 0.0), 2),
            "pixels": round(pixels, 1),
            "contrast": round(contrast, 3),
            "background": "sky" if line.height <= 0.0 else "ground",
            "horizon": round(line.height, 1),
            "tilt": round(math.degrees(line.tilt_rad), 2),
            "fuselage": np.round(drawn.fuselage, 2).tolist(),
            "wing": np.round(drawn.wing, 2).tolist(),
        }

    def _nearest(self, toward: tuple[float, float], time_s: float, own: OwnNow) -> int:
        """Return the target that a camera saw lately nearest to a direction, -1 for none."""
        north, east = math.cos(toward[0]), math.sin(toward[0])
        level, up = math.cos(toward[1]), math.sin(toward[1])
        line = np.array(ned_to_body(
            level * north, level * east, -up, own.heading_rad, own.pitch_rad, own.roll_rad
        ))  # fmt: skip
        best, least = -1, math.cos(NEAR_RAD)
        for seen in self._seen.values():
            azimuth, elevation = seen[:, 1], seen[:, 2]
            level_seen = np.cos(elevation)
            along = np.stack([
                level_seen * np.cos(azimuth), level_seen * np.sin(azimuth), -np.sin(elevation)
            ], axis=1) @ line  # fmt: skip
            along = np.where(time_s - seen[:, 0] < LATELY_S, along, -1.0)
            place = int(np.argmax(along))
            if along[place] > least:
                best, least = place, float(along[place])
        return best


def _dip_rad(alt_m: float) -> float:
    """Return how far the horizon of a sphere of the Earth's size lies below the level."""
    return math.acos(1.0 / (1.0 + max(alt_m, 0.0) / 6_371_000.0))
