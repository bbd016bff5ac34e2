"""What cameras detected last of each target, and the picture of one: its bodies and the horizon."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from components.aircraft.aircraft import Roster, VisibleAreas
from components.cdti.contacts import OwnNow
from components.geometry import body_to_ned, ned_to_body, unit_vector_unchecked
from components.messages.alerts import TRACKS_FROM
from components.messages.detections import Detections
from components.messages.targets import TrafficStates
from components.optical.camera import Camera
from components.optical.silhouette import PLATE_ASPECT_RATIO
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Component
from dsa_des.text.safe_text import escape_unprintable

# When, where in body axes, how far, how large, how far above the threshold.
_COLUMNS = 6
#: A picture belongs to a track if it was taken so near to its direction, so lately.
NEAR_RAD, LATELY_S = math.radians(3.0), 2.0
_AROUND = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)


class CameraSights:
    """The last detection of each target by each camera that has a picture."""

    def __init__(self, components: Mapping[str, Component]) -> None:
        self._cameras = {n: c for n, c in components.items() if isinstance(c, Camera)}
        self._seen: dict[str, FloatArray] = {}
        self._roster: Roster | None = None
        self._ticks_per_s = 1
        #: The latest positions and attitudes of all aircraft: what there is to be seen.
        self.states: TrafficStates | None = None

    def store_detections(self, block: str, message: Detections, ticks_per_s: int) -> None:
        """Store a message's detections as each target's latest, if by a camera with a picture."""
        if block not in self._cameras or "pixels" not in message.extras:
            return
        self._roster, self._ticks_per_s = message.roster, ticks_per_s
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

    def picture_of_contact(
        self, contact: int, toward: tuple[float, float] | None, time_s: float, own: OwnNow
    ) -> dict[str, Any] | None:
        """Return a contact's newest camera picture as page fields; None if no camera has seen it.

        Of a tracker that knows no targets the picture nearest to its direction is taken, of bearing
        and elevation `toward`, rad.
        """
        states, roster = self.states, self._roster
        if roster is None or states is None:
            return None
        target = contact
        if contact >= TRACKS_FROM:
            target = -1 if toward is None else self._nearest_target(toward, time_s, own)
        if not 0 <= target < len(roster):
            return None
        names = [n for n, seen in self._seen.items() if math.isfinite(seen[target, 0])]
        if not names:
            return None
        name = max(names, key=lambda n: self._seen[n][target, 0])
        camera = self._cameras[name]
        seen_s, azimuth, elevation, range_m, pixels, margin = self._seen[name][target].tolist()
        index = int(np.searchsorted(states.columns, target))
        if index == len(states.columns) or states.columns[index] != target:
            return None
        attitude = np.array(
            [getattr(states, f"{a}_rad")[-1, index] for a in ("yaw", "pitch", "roll")]
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
        line = horizon(own_attitude, (azimuth, elevation), _horizon_dip_rad(own.alt_m), pixel_rad)
        strength = camera.p.static_weight * pixels * float(camera.counted_signature_share(pixels))
        contrast = (margin + camera.detector.threshold) / strength if strength > 0.0 else 0.0
        # A camera that renders what it sees shows just that.
        patches = getattr(camera, "patches", {})
        patch = patches.get((target, round(seen_s * self._ticks_per_s)))
        if patch is not None:  # how far a spot stands out is no measure of its contrast
            contrast = math.nan
        return {
            **({} if patch is None else {"patch": patch.tolist()}),
            "target": contact,
            "sensor": escape_unprintable(name),
            "infrared": camera.areas == "ir",
            "age": round(max(time_s - seen_s, 0.0), 2),
            "pixels": round(pixels, 1),
            "contrast": None if math.isnan(contrast) else round(contrast, 3),
            "background": "sky" if line.height <= 0.0 else "ground",
            "horizon": round(line.height, 1),
            "tilt": round(math.degrees(line.tilt_rad), 2),
            "fuselage": np.round(drawn.fuselage, 2).tolist(),
            "wing": np.round(drawn.wing, 2).tolist(),
        }

    def _nearest_target(self, toward: tuple[float, float], time_s: float, own: OwnNow) -> int:
        """Return the lately seen target nearest to a direction (index); -1 for none close by."""
        attitude = own.heading_rad, own.pitch_rad, own.roll_rad
        line = np.array(ned_to_body(*unit_vector_unchecked(*toward), *attitude))
        best, least = -1, math.cos(NEAR_RAD)
        for seen in self._seen.values():
            along = np.stack(unit_vector_unchecked(seen[:, 1], seen[:, 2]), axis=1) @ line
            along = np.where(time_s - seen[:, 0] < LATELY_S, along, -1.0)
            index = int(np.argmax(along))
            if along[index] > least:
                best, least = index, float(along[index])
        return best


def _horizon_dip_rad(alt_m: float) -> float:
    """Return how far, rad, a spherical Earth's horizon lies below the horizontal at an altitude."""
    return math.acos(1.0 / (1.0 + max(alt_m, 0.0) / 6_371_000.0))


class Silhouette(NamedTuple):
    """Outlines on the picture, (points, 2), pixels from its middle: to the right and up."""

    fuselage: FloatArray
    wing: FloatArray


def silhouette(
    areas: VisibleAreas,
    target_attitude_rad: FloatArray,
    own_attitude_rad: FloatArray,
    direction_rad: tuple[float, float],
    range_m: float,
    pixel_rad: tuple[float, float],
) -> Silhouette:
    """Return pixel outlines of a target's fuselage and wing in an ownship camera's picture.

    The bodies are those whose areas decide about the detection: a sphere drawn out into a capsule
    along the x axis, and a plate in the x-y plane (`components.optical.silhouette`).
    Attitudes are yaw, pitch and roll, NED to body; the direction of the target is azimuth and
    elevation in the ownship's body axes; a pixel sees `pixel_rad` across and up.
    """
    to_body = _body_to_ned(own_attitude_rad).T @ _body_to_ned(target_attitude_rad)
    right, up, _ = _picture_axes(direction_rad)
    scale = np.stack([right / pixel_rad[0], up / pixel_rad[1]]) @ to_body / range_m
    radius = math.sqrt(areas.front_m2 / math.pi)
    half = 0.25 * areas.side_m2 / radius if radius else 0.0
    ends = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0]]) @ scale.T
    circle = np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1)
    round_px = circle * radius / (range_m * np.array(pixel_rad))
    fuselage = _convex_hull(np.concatenate([ends[0] + round_px, ends[1] + round_px]))
    span = math.sqrt(areas.horizontal_m2 * PLATE_ASPECT_RATIO)
    chord = areas.horizontal_m2 / span if span else 0.0
    corners = 0.5 * np.array([
        [chord, span, 0.0], [chord, -span, 0.0], [-chord, -span, 0.0], [-chord, span, 0.0],
    ])  # fmt: skip
    return Silhouette(fuselage, corners @ scale.T)


class Horizon(NamedTuple):
    """The horizon on the picture, as a straight line.

    The height is its distance from the middle of the picture, pixels, positive where the middle is
    below it; its upper side points to `tilt_rad`, clockwise from the top of the picture.
    """

    height: float
    tilt_rad: float


def horizon(
    own_attitude_rad: FloatArray,
    direction_rad: tuple[float, float],
    dip_rad: float,
    pixel_rad: tuple[float, float],
) -> Horizon:
    """Return the horizon's straight line, `dip_rad` below level, in a picture of this direction.

    The sine of the elevation over the level is linear in the direction; what is far from the middle
    lies where its tangent there puts it.
    """
    right, up, along = _picture_axes(direction_rad)
    upward = -_body_to_ned(own_attitude_rad)[2]
    across, upright = float(right @ upward) * pixel_rad[0], float(up @ upward) * pixel_rad[1]
    missing = -math.sin(dip_rad) - float(along @ upward)
    return Horizon(missing / max(math.hypot(across, upright), 1e-12), math.atan2(across, upright))


def _picture_axes(direction_rad: tuple[float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return three unit vectors in body axes: picture's right, picture's up, and line of sight."""
    azimuth, _ = direction_rad
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    along = np.array(unit_vector_unchecked(*direction_rad))
    return right, np.cross(right, along), along  # body z points down


def _body_to_ned(attitude_rad: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) from body to north, east, down axes for yaw, pitch and roll."""
    return np.stack(body_to_ned(*np.eye(3), *attitude_rad))


def _convex_hull(points: FloatArray) -> FloatArray:
    """Return the convex hull of points in a plane, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, points.tolist()))
    return np.array([*_half_convex_hull(ordered), *_half_convex_hull(ordered[::-1])])


def _half_convex_hull(points: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    result: list[tuple[float, ...]] = []
    for point in points:
        while len(result) > 1 and _twice_signed_area(result[-2], result[-1], point) <= 0.0:
            result.pop()
        result.append(point)
    return result[:-1]


def _twice_signed_area(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
