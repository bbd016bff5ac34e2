"""``python -m docs.make.track_consistency``: are covariances of tracks honest?

Scenes with stated errors, a banked ownship on the southern hemisphere and many replicas; at some
instants the mean normalised error squared (NEES) of the tracks' position and velocity, 6 where
they are honest, with its 95 % bounds by chi-square for as many tracks as there are
(Bar-Shalom, Li, Kirubarajan (2001), §5.4.2).
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import numpy as np

import dsa_des
from components.estimation.motion import ConstantVelocity, CoordinatedTurn, Motion
from components.geometry.ellipsoid import enu_to_geodetic
from components.messages.state_tracks import COVARIANCE
from components.metrics.separation import traffic_of
from components.metrics.true_states import states_in_frame
from components.optical.sensors import OpticalRangeBoundary as CameraBoundary
from components.radar.radar import RangeBoundary as RadarBoundary
from components.sensor.look import Cells, Look
from dsa_des.arrays.types import FloatArray
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.replicas.lockstep import NotInLockStep, lock_step
from dsa_des.running.simulation import Simulation
from dsa_des.terminal.interruption import plain_ending
from dsa_des.terminal.terminal import say

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
_CLASS = f"{__name__ if __name__ != '__main__' else 'docs.make.track_consistency'}:"
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
    #: What the drawn ones are, in turn, and how many there are in a scene.
    aircraft: list[dict[str, Any]] = field(default_factory=list)
    flights: int = 10
    #: Keys of every sensor's wire to the fusion.
    wire: dict[str, Any] = field(default_factory=dict)
    #: How near a track must be to be a target's: coarse bearings err by more than that of others.
    within_m: float = 300.0


_EKF = {"type": "tracking.ekf", **STILL}
_DEGREE = math.radians(1.0)
#: Of turns that a computer flies: all but no noise in a model, and turns begin at any time.
_STEADY = {
    "acceleration_intensity_m2_s3": 0.01, "turn_acceleration_intensity_m2_s3": 1.2e-5,
    "transition_rates_per_s": [[0.0, 0.05], [0.01, 0.0]],
}  # fmt: skip
#: The default of `tracking.imm`.
_TURN = CoordinatedTurn(0.1, 0.01 * _DEGREE**2)
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
ACTIVE = {"type": "surveillance.active", "scan_rate_hz": 1, "elevation_deg": [-60.0, 60.0],
          "far_every": 1}  # fmt: skip
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
            (-8000.0, 2500.0, 200.0, 6.0),
        )
    )
]  # fmt: skip
#: Of drawn flights: 60 m/s in any direction, and level at first.
_AS_DRAWN = {"start_speed_m_s": 42.4, "start_climb_m_s": 3.0}

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

_DURATION_S = 37
INSTANTS_S = np.arange(12.0, 37.0, 4.0)
_AHEAD_S = 5.0
#: A NEES of an honest track is above this once in 10^10.
_LOST_ABOVE = 60.0
_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")


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


def drawn_flights(path: Path, model: Motion, number: int, flights: int) -> None:
    """Write a CSV file with the ownship and flights drawn from a motion model, all around it."""
    step_s, rng = 0.1, np.random.default_rng(number)
    own = np.radians(OWNSHIP["heading_deg"])
    course = np.array([np.cos(own), np.sin(own)]) * OWNSHIP["speed_mps"]
    around = (np.arange(flights) + rng.uniform()) * 2.0 * np.pi / flights
    heading = rng.uniform(0.0, 2.0 * np.pi, flights)
    state = np.zeros((model.size, flights))
    state[:2] = 5000.0 * np.stack([np.cos(around), np.sin(around)])
    state[2] = -rng.uniform(100.0, 500.0, flights)
    state[3:5] = 60.0 * np.stack([np.cos(heading), np.sin(heading)])
    if model.size > 6:
        state[6] = 3.0 * _DEGREE * rng.choice([-1.0, 1.0], flights)
    step = np.full(flights, step_s)
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
        turned += [(0.0, 0.0, 0.0)] * flights
        rows += [
            f"{t:.1f},{'own' if i == 0 else f't{i}'},{lat[i]:.14g},{lon[i]:.14g},{alt[i]:.12g},"
            + ",".join(f"{angle:g}" for angle in turned[i])
            for i in range(1 + flights)
        ]
        state = model.move(state, step) + root @ rng.normal(size=state.shape)
    path.write_text("\n".join(rows) + "\n")


def _scenes(case: Case, replicas: int, folder: Path) -> Iterable[list[Any]]:
    """Yield scenes that may run in lock step together."""
    if case.drawn is None:
        traffic = {"type": "traffic.scripted", "ownship": OWNSHIP, "intruders": case.targets}
        scene = dsa_des.load_scene(scene_of_case(case, traffic))
        yield [scene_of(scene, Replica(1 + i, {})) for i in range(replicas)]
        return
    for number in range(-(-replicas // case.flights)):
        path = folder / f"flights{number}.csv"
        drawn_flights(path, case.drawn, number, case.flights)
        read: dict[str, Any] = {"type": "traffic.csv", "file": str(path), "ownship": "own"}
        for i, craft in zip(range(1, 1 + case.flights), cycle(case.aircraft), strict=False):
            read.setdefault("aircraft", {})[f"t{i}"] = craft
        scene = dsa_des.load_scene(scene_of_case(case, read))
        yield [scene_of(scene, Replica(1 + number, {}))]


def _tracks(scenes: list[Any]) -> list[Any]:
    """Return each replica's table of tracks."""
    sink = MemorySink()
    try:
        lock_step(scenes, recorder=Recorder([sink])).run()
    except NotInLockStep:
        tables = []
        for scene in scenes:
            sink = MemorySink()
            Simulation(scene, recorder=Recorder([sink])).run()
            tables.append(sink.tables()["state_tracks"])
        return tables
    table = sink.tables()["state_tracks"].combine_chunks()
    replica = table["replica"].to_numpy()
    cuts = np.searchsorted(replica, np.arange(len(scenes) + 1))
    return [table.slice(a, b - a) for a, b in pairwise(cuts.tolist())]


def nees_of(case: Case, replicas: int) -> FloatArray:
    """Return the NEES of every target's track, (targets of all replicas, instants).

    NaN where no confirmed track with a range lies within `Case.within_m`, 300 m but for coarse
    bearings, now and 5 s ahead in the mean.
    """
    found: list[FloatArray] = []
    with tempfile.TemporaryDirectory() as folder:
        for scenes in _scenes(case, replicas, Path(folder)):
            targets = traffic_of(scenes[0])[0].targets
            for table in _tracks(scenes):
                found.append(_of_run(table, targets, case.within_m))
    return np.concatenate(found)


def _of_run(table: Any, targets: list[Any], within_m: float) -> FloatArray:
    columns: Callable[[str], Any] = lambda name: table[name].to_numpy(zero_copy_only=False)  # noqa: E731
    time_s = columns("time_s")
    # A track is taken as it is told by the first message at or after the instant.
    firsts = np.searchsorted(time_s, INSTANTS_S)
    status, ranged = columns("track_status"), columns("has_range")
    nees = np.full((len(targets), len(INSTANTS_S)), np.nan)
    for k, first in enumerate(firsts.tolist()):
        if first == len(time_s):
            continue
        rows = np.flatnonzero(time_s == time_s[first])
        rows = rows[np.isin(status[rows], ("confirmed", "coasted")) & ranged[rows]]
        if len(rows) == 0:
            continue
        part = {n: columns(n)[rows] for n in (*_STATE, *COVARIANCE.values(), "state_s")}
        origin = np.stack([columns(f"origin_{n}")[rows] for n in ("lat_deg", "lon_deg", "alt_m")])
        known, _ = states_in_frame(targets, part["state_s"], origin)
        error = np.stack([part[n] for n in _STATE]) - known
        # Where two meet, who flies on elsewhere is another one.
        ahead = error[:, :3] + _AHEAD_S * error[:, 3:]
        away = np.sqrt((error[:, :3] ** 2).sum(axis=1)) + np.sqrt((ahead**2).sum(axis=1))
        spread = np.empty((len(rows), 6, 6))
        for (i, j), name in COVARIANCE.items():
            spread[:, i, j] = spread[:, j, i] = part[name]
        for target, near in enumerate(away.argmin(axis=1).tolist()):
            if away[target, near] < 2.0 * within_m:
                e = error[target, :, near]
                nees[target, k] = e @ np.linalg.solve(spread[near], e)
    return nees


def bounds(count: int) -> tuple[float, float]:
    """Return the 95 % bounds of the mean NEES of so many independent tracks."""
    from scipy.stats import chi2

    low, high = chi2.ppf([0.025, 0.975], 6 * count) / count
    return float(low), float(high)


def summary(nees: FloatArray) -> dict[str, float]:
    """Return the mean over instants, its bounds, the means' range, and the shares inside.

    What is so far off that it cannot be chance is counted as lost, and is not in the means.
    """
    lost = np.isnan(nees) | (nees > _LOST_ABOVE)
    nees = np.where(lost, np.nan, nees)
    count = int((~np.isnan(nees)).sum(axis=0).min())
    low, high = bounds(max(count, 1))
    means = np.nanmean(nees, axis=0)
    single = bounds(1)
    there = nees[~np.isnan(nees)]
    return {
        "tracks": count, "mean": float(np.nanmean(nees)), "low": low, "high": high,
        "least": float(means.min()), "most": float(means.max()),
        "inside": float(((means >= low) & (means <= high)).mean()),
        "share": float(((there >= single[0]) & (there <= single[1])).mean()),
        "median": float(np.median(there)), "lost": float(lost.mean()),
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.track_consistency",
        description="Print the mean normalised error squared of tracks, with its bounds.",
    )
    parser.add_argument("cases", nargs="*", metavar="case", help=f"of {', '.join(CASES)}")
    parser.add_argument("--replicas", type=int, default=200)
    options = parser.parse_args(arguments)
    unknown = [name for name in options.cases if name not in CASES]
    if unknown:
        parser.error(f"no case {unknown[0]!r}; allowed: {', '.join(CASES)}")
    say(
        "| case | tracks | mean | 95 % bounds | instants | inside | single inside | median | lost |"
    )
    say("|---|---|---|---|---|---|---|---|---|")
    for name in options.cases or CASES:
        s = summary(nees_of(CASES[name], options.replicas))
        say(
            f"| {CASES[name].says} | {s['tracks']} | {s['mean']:.2f} | {s['low']:.2f} to "
            f"{s['high']:.2f} | {s['least']:.2f} to {s['most']:.2f} | {s['inside']:.0%} | "
            f"{s['share']:.1%} | {s['median']:.2f} | {s['lost']:.2%} |"
        )
    return 0


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
