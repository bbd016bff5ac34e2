"""The yardstick: the same detect-and-sense chain as one plain loop over scans, targets and sensors.

This is what one writes in an afternoon without an engine and without arrays: the same formulas,
the same keyed draws, the same detections, one target at a time. Speed is given as a ratio to it,
because a ratio in one process survives a change of machine.

It covers what the benchmark's scenes need: straight flight, the exact line of sight, level or
fixed attitude, Swerling I with one pulse, the exact silhouette, rounding, fusion of one instant and
a tracker that holds the last measurement. Random draws come in one block per sensor (a scalar
Philox generator would make the yardstick look slower than it need be).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan2, cos, exp, fmod, hypot, inf, pi, sin, sqrt
from typing import Any

import numpy as np

from components.geometry import ECCENTRICITY_SQUARED, FLATTENING, SEMI_MAJOR_AXIS_M
from components.radar.detection.threshold import detection_threshold
from dsa_des.running.simulation import Simulation

Position = tuple[float, float, float, float]
_DEG = 180.0 / pi
_RAD = pi / 180.0


def straight_flight(parameters: list[float]) -> Callable[[float], Position]:
    """Return a function from elapsed seconds to latitude, longitude (deg), altitude (m) and yaw."""
    speed_radius, centre, climb, alt0, tau0, per_metre, sin_az0, cos_az0 = parameters[:8]
    lon0, lon_slope, _, radius = parameters[8:12]
    i1, i2, i3, i4, i5, l1, l2, l3 = parameters[12:20]
    shrink = 1.0 - FLATTENING

    def position(elapsed: float) -> Position:
        climbed = climb * elapsed
        below = max(centre + 0.5 * climbed, 0.5 * radius)
        tau = speed_radius * elapsed / below * per_metre + tau0
        s, c = sin(tau), cos(tau)
        two = 2.0 * (c - s) * (c + s)
        b4 = i4 + two * i5
        b3 = i3 + two * b4 - i5
        b2 = i2 + two * b3 - b4
        delta = (i1 + two * b2 - b3) * 2.0 * s * c
        sigma = tau + delta
        s, c = sin(sigma), cos(sigma)
        along = cos_az0 * c
        lat = atan2(cos_az0 * s, sqrt(along * along + sin_az0 * sin_az0) * shrink) * _DEG
        two = 2.0 * (c - s) * (c + s)
        b2 = l2 + two * l3
        bend = (l1 + two * b2 - l3) * 2.0 * s * c
        lon = (atan2(sin_az0 * s, c) - (sigma + bend) * lon_slope + lon0) * _DEG
        return lat, fmod(lon + 540.0, 360.0) - 180.0, alt0 + climbed, atan2(sin_az0, along)

    return position


def north_east_up_m(own: Position, target: Position) -> tuple[float, float, float]:
    """Return north, east and up offsets (m) of a target, exact on the WGS-84 ellipsoid."""
    e2 = ECCENTRICITY_SQUARED
    lat1, lon1, alt1, _ = own
    lat2, lon2, alt2, _ = target
    s1, c1 = sin(lat1 * _RAD), cos(lat1 * _RAD)
    dlat = lat2 - lat1
    half = dlat * 0.5 * _RAD
    sin_half, cos_half = sin(half), cos(half)
    ds = 2.0 * sin_half * (c1 * cos_half - s1 * sin_half)
    s2 = s1 + ds
    w1, w2 = sqrt(1.0 - e2 * s1 * s1), sqrt(1.0 - e2 * s2 * s2)
    n2 = SEMI_MAJOR_AXIS_M / w2
    dn = n2 * e2 * ds * (s1 + s2) / (w1 * (w1 + w2))
    dns = n2 * ds + dn * s1
    dlon = lon2 - lon1
    if dlon >= 180.0:
        dlon -= 360.0
    elif dlon < -180.0:
        dlon += 360.0
    half_lon = dlon * 0.5 * _RAD
    sin_half_lon = sin(half_lon)
    n2 += alt2
    across = 2.0 * n2 * cos(lat2 * _RAD) * sin_half_lon
    bulge = across * sin_half_lon
    north = 2.0 * n2 * sin_half * cos_half - e2 * c1 * dns + s1 * bulge
    up = dn + (alt2 - alt1) - 2.0 * n2 * sin_half * sin_half - e2 * s1 * dns - c1 * bulge
    return north, across * cos(half_lon), up


def ned_to_body_matrix(yaw_rad: float, pitch_rad: float, roll_rad: float) -> list[float]:
    """Return nine elements, by row, of the rotation from NED to nose, right wing, floor (ZYX)."""
    sy, cy = sin(yaw_rad), cos(yaw_rad)
    sp, cp = sin(pitch_rad), cos(pitch_rad)
    sr, cr = sin(roll_rad), cos(roll_rad)
    return [
        cp * cy, cp * sy, -sp,
        sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp,
        cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp,
    ]  # fmt: skip


def aspect_cosine_sine_body_z(
    north: float, east: float, up: float, range_m: float, attitude: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the aspect angle's cosine and sine, and the sight line's absolute part on body z."""
    m = ned_to_body_matrix(*attitude)
    n, e, d = north / range_m, east / range_m, -up / range_m
    x = m[0] * n + m[1] * e + m[2] * d
    y = m[3] * n + m[4] * e + m[5] * d
    z = m[6] * n + m[7] * e + m[8] * d
    return x, hypot(y, z), abs(z)


#: Latitude, longitude, altitude and yaw, and pitch and roll.
OwnState = tuple[Position, tuple[float, float]]


@dataclass
class LoopSensor:
    """A sensor's data for the plain loop: scans, field of view, resolution, detection threshold."""

    name: str
    kind: str
    scans: list[tuple[int, int]]
    azimuth: tuple[float, float]
    elevation: tuple[float, float]
    range_max_m: float
    azimuth_step: float
    elevation_step: float
    range_step: float
    draws: Any = None
    snr_constant: list[float] = field(default_factory=list)
    threshold: float = 0.0
    nearest_m: float = 0.0
    pixel_sr: float = 1.0
    pixels: float = inf
    weight: float = 0.0
    areas: list[tuple[float, float, float, float, float]] = field(default_factory=list)


@dataclass
class LoopResult:
    """The plain loop's detections by (sensor, scan, target index), fused count, and tracks held."""

    detections: dict[tuple[str, int, int], tuple[float, float, float]]
    fused: int
    target_scans: int
    held: dict[int, tuple[int, float, float, float]]


@dataclass
class Prepared:
    """What the plain loop starts from: flights, random draws, and sensors to scan at each tick."""

    seconds_per_tick: float
    own: Callable[[float], OwnState]
    flights: list[Callable[[float], Position]]
    pitch_roll: list[tuple[float, float]]
    calendar: dict[int, list[tuple[LoopSensor, int]]]


def prepare_plain_loop(simulation: Simulation) -> Prepared:
    """Return what the plain loop needs of a ready scene: flights, sensors, draws and scan times."""
    traffic: Any = simulation.components["traffic"]
    targets = [target.segments[0] for target in traffic.targets]
    calendar: dict[int, list[tuple[LoopSensor, int]]] = {}
    for sensor in _loop_sensors(simulation):
        for tick, scan in sensor.scans:
            calendar.setdefault(tick, []).append((sensor, scan))
        if sensor.kind == "radar":
            stream = simulation.components[sensor.name].stream("detection")
            numbers = np.array([scan for _, scan in sensor.scans], dtype=np.int64)
            sensor.draws = [stream.uniform(key, numbers).tolist() for key in traffic.roster.keys]
    return Prepared(
        1.0 / simulation.ticks_per_s,
        _own_flight(traffic.own, sorted(calendar), simulation.ticks_per_s),
        [straight_flight(target.parameters.tolist()) for target in targets],
        [(target.pitch_rad, target.roll_rad) for target in targets],
        dict(sorted(calendar.items())),
    )


def _own_flight(own: Any, ticks: list[int], ticks_per_s: int) -> Callable[[float], OwnState]:
    """Return a function from time to own position and tilt; steered flights are as flown."""
    if len(getattr(own, "segments", ())) == 1:
        flight, segment = straight_flight(own.segments[0].parameters.tolist()), own.segments[0]
        return lambda time_s: (flight(time_s), (segment.pitch_rad, segment.roll_rad))
    seconds = [tick * (1.0 / ticks_per_s) for tick in ticks]
    state = own.at(np.array(ticks) / ticks_per_s)
    columns = (state.lat_deg, state.lon_deg, state.alt_m, state.yaw_rad)
    positions = zip(*(column.tolist() for column in columns), strict=True)
    tilts = zip(state.pitch_rad.tolist(), state.roll_rad.tolist(), strict=True)
    flown = dict(zip(seconds, zip(positions, tilts, strict=True), strict=True))
    return lambda time_s: flown[time_s]


def _loop_sensors(simulation: Simulation) -> list[LoopSensor]:
    roster = simulation.components["traffic"].roster  # type: ignore[attr-defined]
    sensors = []
    for name in ("radar", "eo", "ir"):
        block: Any = simulation.components[name]
        clock = simulation.nodes[name].clock
        assert clock is not None
        numbers, instants = clock.scans_between(0, simulation.end_tick)
        reach = block.stated_reach
        sensor = LoopSensor(
            name,
            "radar" if block.measures_range else name,
            list(zip(instants.tick.tolist(), numbers.tolist(), strict=True)),
            reach.azimuth_rad,
            reach.elevation_rad,
            reach.range_max_m,
            block.azimuth_step_rad,
            block.elevation_step_rad,
            block.range_step_m,
        )
        if block.measures_range:
            sensor.snr_constant = [float(block.budget.snr(1000.0, s)) * 1e12 for s in roster.rcs_m2]
            sensor.threshold = float(
                detection_threshold(1, false_alarm_probability=block.p.false_alarm_probability)
            )
            sensor.nearest_m = block.budget.nearest_m
        else:
            sensor.pixel_sr = block.pixel_azimuth_rad * block.pixel_elevation_rad
            sensor.pixels = float(block.p.azimuth_pixels * block.p.elevation_pixels)
            sensor.weight = block.p.static_weight
            sensor.threshold = block.detector.threshold
            sensor.areas = _target_areas_and_contrasts(roster, block.areas, block.contrasts)
        sensors.append(sensor)
    return sensors


def _target_areas_and_contrasts(
    roster: Any, areas: str, contrast: str
) -> list[tuple[float, float, float, float, float]]:
    back = "back_m2" if areas == "ir" else "front_m2"
    names = (f"{areas}.front_m2", f"{areas}.{back}", f"{areas}.side_m2", f"{areas}.horizontal_m2")
    columns = [roster.column(column).tolist() for column in (*names, contrast)]
    return list(zip(*columns, strict=True))


def run(scene: Prepared, every: int = 1) -> LoopResult:
    """Run the scene as one loop."""
    seconds, flights, angles = scene.seconds_per_tick, scene.flights, scene.pitch_roll
    result = LoopResult({}, 0, 0, {})
    detections, held = result.detections, result.held
    for tick in list(scene.calendar)[::every]:
        looking = scene.calendar[tick]
        time_s = tick * seconds
        own, tilt = scene.own(time_s)
        axes = ned_to_body_matrix(own[3], *tilt)
        for target, flight in enumerate(flights):
            position = flight(time_s)
            north, east, up = north_east_up_m(own, position)
            x = axes[0] * north + axes[1] * east - axes[2] * up
            y = axes[3] * north + axes[4] * east - axes[5] * up
            z = axes[6] * north + axes[7] * east - axes[8] * up
            level = hypot(x, y)
            p, q, range_m = atan2(y, x), atan2(-z, level), hypot(level, z)
            angle: tuple[float, float] | None = None
            distance = None
            for sensor, scan in looking:
                result.target_scans += 1
                if not (
                    range_m <= sensor.range_max_m
                    and sensor.azimuth[0] <= p <= sensor.azimuth[1]
                    and sensor.elevation[0] <= q <= sensor.elevation[1]
                ):
                    continue
                if sensor.kind == "radar":
                    if range_m < sensor.nearest_m:
                        continue
                    snr = sensor.snr_constant[target] / range_m**4
                    pd = exp(-sensor.threshold / (1.0 + snr))
                    if sensor.draws[target][scan] >= pd:
                        continue
                else:
                    front, back, side, plane, contrast = sensor.areas[target]
                    nose, off_nose, floor = aspect_cosine_sine_body_z(
                        north, east, up, range_m, (position[3], *angles[target])
                    )
                    share = 0.5 * nose + 0.5
                    area = back * share + front * (1.0 - share) + side * off_nose + plane * floor
                    covered = min(area / (range_m * range_m * sensor.pixel_sr), sensor.pixels)
                    if sensor.weight * covered * contrast < sensor.threshold:
                        continue
                measured = (
                    _round_to_step(p, sensor.azimuth_step, sensor.azimuth),
                    _round_to_step(q, sensor.elevation_step, sensor.elevation),
                    round(range_m / sensor.range_step) * sensor.range_step
                    if sensor.range_step
                    else range_m,
                )
                detections[sensor.name, scan, target] = measured
                if sensor.kind == "radar":
                    distance = measured[2]
                    angle = measured[:2] if angle is None else angle
                else:
                    angle = measured[:2]
            if angle is not None:
                result.fused += 1
                held[target] = (tick, *angle, -1.0 if distance is None else distance)
    return result


def _round_to_step(value: float, step: float, limits: tuple[float, float]) -> float:
    return min(max(round(value / step) * step, limits[0]), limits[1])
