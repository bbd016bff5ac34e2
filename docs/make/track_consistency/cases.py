"""The cases: who flies, what is measured with which errors, and which tracker is asked."""

import math
from dataclasses import dataclass, field
from typing import Any

from components.estimation.motion import ConstantVelocity, CoordinatedTurn, Motion
from components.optical.sensors import OpticalRangeBoundary as CameraBoundary
from components.radar.radar import RangeBoundary as RadarBoundary
from components.sensor.look import Cells, Look

OWNSHIP = {
    "lat_deg": -41.3, "lon_deg": 173.2, "alt_m": 2400.0, "heading_deg": 217.0, "speed_mps": 70.0,
    "climb_mps": 1.0, "yaw_deg": 222.0, "pitch_deg": 4.0, "roll_deg": -20.0,
}  # fmt: skip
STRAIGHT = {
    "name": "straight", "east_m": -4000.0, "north_m": -3000.0, "up_m": 420.0, "heading_deg": 100.0,
    "speed_mps": 60.0,
}  # fmt: skip
TURNING = {**STRAIGHT, "legs": [{"kind": "turn", "rate_deg_s": 3.0}]}
#: They meet after 20 s, 40 m apart in height.
CROSSING = [
    {**STRAIGHT, "name": "one", "east_m": -5200.0, "north_m": -3000.0, "heading_deg": 90.0},
    {**STRAIGHT, "name": "two", "east_m": -4000.0, "north_m": -4200.0, "heading_deg": 0.0,
     "up_m": 460.0},
]  # fmt: skip
NEARLY = [CROSSING[0], {**CROSSING[1], "up_m": 430.0}]
#: Passes at 240 m.
NEAR = {
    **STRAIGHT, "name": "near", "east_m": -800.0, "north_m": -3200.0, "up_m": 80.0,
    "heading_deg": 37.0,
}  # fmt: skip

RADAR = {
    "type": "radar.range_boundary", "range_km": 12.0, "scan_rate_hz": 1, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.6,
    "range_error_m": 15.0,
}  # fmt: skip
CAMERA = {
    "type": "optical.range_boundary", "range_km": 12.0, "errors": "stated", "quantised": False,
    "azimuth_error_deg": 0.05, "elevation_error_deg": 0.05,
}  # fmt: skip
SENSORS = {
    "radar": RADAR,
    "fast": {**CAMERA, "scan_rate_hz": 20, "offset_s": 0.013},
    "slow": {**CAMERA, "scan_rate_hz": 2, "offset_s": 0.21},
}
#: 30 x 5 x 80 cells: 1.2 false alarms in a scan.
NOISY = {
    **RADAR, "type": "radar.swerling", "swerling": 0, "range_km": 8.0, "power_w": 1e9,
    "antenna_gain_db": 30.0, "frequency_hz": 35e9, "bandwidth_hz": 1e6,
    "false_alarm_probability": 1e-4, "false_alarms": True, "azimuth_deg": [-30.0, 30.0],
    "elevation_deg": [-20.0, 20.0], "mount_azimuth_deg": 15.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 8.0, "range_resolution_m": 100.0,
}  # fmt: skip
_MISSED = 0.3
_CLASS = f"{__name__}:"
#: Straight flights have no noise of their own, but level flight follows the Earth: 60 m/s bend by
#: a = v²/R = 0.57 mm/s² from a straight line of the frame. White acceleration of intensity a² T
#: makes velocities as uncertain within the T = 37 s of a scene as they become wrong by, a T.
STILL = {"acceleration_intensity_m2_s3": 1.2e-5}


class _Missing:
    """Misses some of its looks, whatever it looks at."""

    def look(self, cells: Cells) -> Look:
        found: Look = super().look(cells)  # type: ignore[misc]
        stream = self.stream("misses")  # type: ignore[attr-defined]
        return Look(found.detected & (cells.draws(stream) >= _MISSED), found.confidence)


class MissingRadar(_Missing, RadarBoundary):
    """A radar that misses 30 % of its looks."""

    lockstep = True


class MissingCamera(_Missing, CameraBoundary):
    """A camera that does."""

    lockstep = True


@dataclass(frozen=True)
class Case:
    """Scenes whose tracks are to be honest."""

    says: str
    #: Keys of its block.
    tracker: dict[str, Any]
    #: Flights; empty where they are drawn.
    targets: list[dict[str, Any]] = field(default_factory=lambda: [STRAIGHT])
    #: The model that flights are drawn from, ten in a scene.
    drawn: Motion | None = None
    sensors: dict[str, Any] = field(default_factory=lambda: SENSORS)
    #: What the drawn ones are, in turn.
    aircraft: list[dict[str, Any]] = field(default_factory=list)
    #: Keys of every sensor's wire to the fusion.
    wire: dict[str, Any] = field(default_factory=dict)
    #: How near a track must be to be a target's: coarse bearings err by more than that of others.
    within_m: float = 300.0


_EKF = {"type": "tracking.ekf", **STILL}
_DEGREE = math.radians(1.0)
#: Of turns that a computer flies: all but no noise in a model, and turns begin at any time.
_STEADY = {
    "models": ["velocity", "turn"], "acceleration_intensity_m2_s3": 0.01,
    "turn_acceleration_intensity_m2_s3": 1.2e-5,
    "transition_rates_per_s": [[0.0, 0.05], [0.01, 0.0]],
}  # fmt: skip
#: The default of `tracking.imm`.
_TURN = CoordinatedTurn(1.0, 0.01 * _DEGREE**2)
_GONE = {"delete_misses": 40}
_MISSES = {
    name: {**one, "type": _CLASS + ("MissingRadar" if name == "radar" else "MissingCamera")}
    for name, one in SENSORS.items()
}
_NOISE = {"false_alarms_per_scan": 1.2, "detection_probability": 0.99}
_LATE = {"delay_s": 0.3, "jitter_s": 0.2}

#: The steps of the radar and of the cameras of `first_light`.
_STEPS = {
    "radar": {
        "azimuth_resolution_deg": 1.0, "elevation_resolution_deg": 1.0, "range_resolution_m": 76.2,
        "scan_rate_hz": 5,
    },
    "fast": {"azimuth_resolution_deg": 0.0358, "elevation_resolution_deg": 0.0293},
    "slow": {"azimuth_resolution_deg": 0.0977, "elevation_resolution_deg": 0.0977},
}  # fmt: skip
_GRIDS = {
    name: {k: v for k, v in one.items() if "error" not in k and k != "quantised"} | _STEPS[name]
    for name, one in SENSORS.items()
}


def _closing() -> list[dict[str, Any]]:
    """Return flights that come nearer at 130 m/s on bearings that hardly change."""
    found = []
    own = math.radians(OWNSHIP["heading_deg"])
    for i, ahead_deg in enumerate(range(-40, 41, 10)):
        bearing = own + math.radians(ahead_deg)
        east = OWNSHIP["speed_mps"] * math.sin(own) - 130.0 * math.sin(bearing)
        north = OWNSHIP["speed_mps"] * math.cos(own) - 130.0 * math.cos(bearing)
        found.append({
            "name": f"from_{ahead_deg}", "east_m": 7000.0 * math.sin(bearing) + 13.0 * i,
            "north_m": 7000.0 * math.cos(bearing), "up_m": 90.0 + 17.0 * i, "climb_mps": 1.0,
            "heading_deg": math.degrees(math.atan2(east, north)) % 360.0,
            "speed_mps": math.hypot(east, north),
        })  # fmt: skip
    return found


ADS_B = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "range_km": 40.0}
ACTIVE = {"type": "surveillance.active", "scan_rate_hz": 1, "elevation_deg": [-60.0, 60.0]}
#: Of the navigation of aircraft: categories of position and velocity, in turn.
_EQUIPPED = [
    {"mode_s": True, "ads_b": {"nacp": nacp, "nacv": nacv}}
    for nacp, nacv in ((8, 1), (9, 2), (10, 3), (7, 2), (11, 4), (9, 1))
]
_THREE = [
    {**STRAIGHT, "name": f"equipped{i}", "east_m": east, "north_m": north, "heading_deg": heading,
     "climb_mps": climb, **_EQUIPPED[i]}
    for i, (east, north, heading, climb) in enumerate(
        (
            (-4000.0, -3000.0, 100.0, 4.0),
            (3000.0, -9000.0, 330.0, -3.0),
            # Below 10,000 ft throughout: there the error of an altimeter jumps.
            (-8000.0, 2500.0, 200.0, 3.0),
        )
    )
]  # fmt: skip
#: Of drawn flights: 60 m/s in any direction, and level at first.
_AS_DRAWN = {"start_speed_m_s": 42.4, "start_climb_m_s": 3.0}
_CALM = {"acceleration_intensity_m2_s3": 0.1}

_BIASES = {"azimuth_bias_deg": 1.0, "elevation_bias_deg": 1.0, "range_bias_m": 40.0,
           "scan_rate_hz": 5}  # fmt: skip
_LASTING = {f"{name}_correlation_time_s": 5.0 for name in ("azimuth", "elevation", "range")} | {
    "scan_rate_hz": 5
}

CASES = {
    "velocity": Case("constant velocity, radar 1 Hz with cameras at 20 and 2 Hz, ekf", _EKF),
    "velocity_ukf": Case("the same, ukf", {**_EKF, "type": "tracking.ukf"}),
    "radar": Case("constant velocity, the radar alone, ekf", _EKF, sensors={"radar": RADAR}),
    "turn": Case("3 deg/s turn drawn from the model, imm as it is", {"type": "tracking.imm"},
                 drawn=_TURN, targets=[]),
    "circle": Case("3 deg/s turn without any noise, imm as it is", {"type": "tracking.imm"},
                   [TURNING]),
    "steady": Case("the same, models as steady as that",
                   {"type": "tracking.imm", **_STEADY}, [TURNING]),
    "crossing": Case("two that cross 40 m apart, gnn", _EKF, CROSSING),
    "crossing_jpda": Case("the same, jpda", {**_EKF, "association": "jpda"}, CROSSING),
    "nearly": Case("two that cross 10 m apart, gnn", _EKF, NEARLY),
    "nearly_jpda": Case("the same, jpda", {**_EKF, "association": "jpda"}, NEARLY),
    "missed": Case("30 % of the looks missed", {**_EKF, **_GONE, "detection_probability": 0.7},
                   sensors=_MISSES),
    "clutter": Case("false alarms, 1e-4 per cell (1.2 in a scan), gnn", {**_EKF, **_NOISE},
                    sensors={**SENSORS, "radar": NOISY}),
    "clutter_jpda": Case("the same, jpda", {**_EKF, **_NOISE, "association": "jpda"},
                         sensors={**SENSORS, "radar": NOISY}),
    "late": Case("latency 0.3 s, jitter 0.2 s, rerun", {**_EKF, "late": "rerun", "lag_s": 3},
                 wire=_LATE),
    "late_one_step": Case("the same, one_step", {**_EKF, "late": "one_step", "lag_s": 3},
                          wire=_LATE),
    "grid": Case("nine that close in on steady bearings, radar and cameras that round to their "
                 "grids, ekf as it is", {"type": "tracking.ekf"}, _closing(), sensors=_GRIDS),
    "grid_imm": Case("the same, imm as it is", {"type": "tracking.imm"}, _closing(),
                     sensors=_GRIDS),
    "bias": Case("a radar with biases drawn for each run, ekf", _EKF,
                 sensors={"radar": {**RADAR, **_BIASES}}),
    "lasting": Case("a radar with errors that last 5 s, ekf", _EKF,
                    sensors={"radar": {**RADAR, **_LASTING}}),
    "near": Case("passes at 240 m, ekf", _EKF, [NEAR]),
    "ads_b": Case("ADS-B of NACp 8, 9 and 10 at 1 Hz, nothing rounded, ekf", _EKF, _THREE,
                  sensors={"ads_b": {**ADS_B, "compact": False}}),
    "ads_b_ukf": Case("the same, ukf", {**_EKF, "type": "tracking.ukf"}, _THREE,
                      sensors={"ads_b": {**ADS_B, "compact": False}}),
    "ads_b_compact": Case("the same as messages round it, ekf", _EKF, _THREE,
                          sensors={"ads_b": ADS_B}),
    "ads_b_drawn": Case("ADS-B of NACp 7 to 11, drawn flights, ekf",
                        {"type": "tracking.ekf", **_CALM, **_AS_DRAWN}, [], ConstantVelocity(0.1),
                        sensors={"ads_b": {**ADS_B, "compact": False}}, aircraft=_EQUIPPED),
    "ads_b_drawn_compact": Case("the same as messages round it, ekf",
                                {"type": "tracking.ekf", **_CALM, **_AS_DRAWN}, [],
                                ConstantVelocity(0.1), sensors={"ads_b": ADS_B},
                                aircraft=_EQUIPPED),
    "active": Case("active surveillance of Mode S at 1 Hz, drawn flights, ukf",
                   {"type": "tracking.ukf", **_AS_DRAWN}, [], ConstantVelocity(4.0),
                   sensors={"active": ACTIVE}, within_m=3000.0, aircraft=_EQUIPPED),
    "active_ekf": Case("the same, ekf", {"type": "tracking.ekf", **_AS_DRAWN}, [],
                       ConstantVelocity(4.0), sensors={"active": ACTIVE}, within_m=3000.0,
                       aircraft=_EQUIPPED),
    "both": Case("ADS-B of NACp 8 and active surveillance, ukf",
                 {"type": "tracking.ukf", **STILL, "alpha": 0.3}, _THREE[:1],
                 sensors={"active": ACTIVE, "ads_b": ADS_B}, within_m=3000.0),
    "near_ukf": Case("the same, ukf", {**_EKF, "type": "tracking.ukf"}, [NEAR]),
}  # fmt: skip
