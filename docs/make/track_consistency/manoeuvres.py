"""How trackers follow manoeuvres: ``python -m docs.make.track_consistency.manoeuvres``.

Nine flights at 60 m/s, straight for 20 s, then a turn, a climb and its level-off, or another speed
(2 m/s every second); a radar with stated errors (0.2 deg, 10 m) at some 4 km. Of every flight and
rate: the largest error of position (rms over replicas), the time for which a track is outside the
95 % of chi-square (mean over replicas, lost tracks among it; an honest one is for a fortieth of
the 55 s), and the largest mean normalised error squared (NEES) of any instant, 6 where covariances
are honest.
"""

import argparse
import math
import sys
from typing import Any

import numpy as np

import dsa_des
from components.messages.state_tracks import COVARIANCE
from components.metrics.separation import traffic_and_duration
from components.metrics.true_states import states_and_presence_in_frame
from docs.make.track_consistency.cases import OWNSHIP, Case
from docs.make.track_consistency.nees import tracks_of
from docs.make.track_consistency.scenes import scene_of_case
from dsa_des.arrays.types import FloatArray
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

BEGINS_S, DURATION_S, RATES_HZ = 20.0, 75.0, (0.5, 1, 5)
#: A single NEES is above this once in forty times; a track farther away is another's.
OUTSIDE, WITHIN_M = 14.449, 500.0
_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_STRAIGHT = {"kind": "straight", "duration_s": BEGINS_S}


def _turn(rate_deg_s: float) -> list[dict[str, Any]]:
    return [{"kind": "turn", "rate_deg_s": rate_deg_s, "duration_s": 30.0}, {"kind": "straight"}]


def _climb(climb_mps: float) -> list[dict[str, Any]]:
    up = {"kind": "straight", "climb_mps": climb_mps, "duration_s": 25.0}
    return [up, {"kind": "straight", "climb_mps": 0.0}]


def _speed(change_mps: float) -> list[dict[str, Any]]:
    steps = [60.0 + math.copysign(2.0 * k, change_mps) for k in range(1, 11)]
    slower = [{"kind": "straight", "speed_mps": one, "duration_s": 1.0} for one in steps]
    return [*slower, {"kind": "straight"}]


MANOEUVRES = {
    "none": [],
    **{f"turn {rate:g}°/s": _turn(rate) for rate in (1.5, 3.0, 5.0)},
    **{f"climb {climb:g} m/s": _climb(climb) for climb in (5.0, 12.0)},
    "descent 5 m/s": _climb(-5.0),
    "20 m/s faster": _speed(20.0),
    "20 m/s slower": _speed(-20.0),
}
_RADAR = {
    "type": "radar.range_boundary", "range_km": 30.0, "errors": "stated", "quantised": False,
    "azimuth_error_deg": 0.2, "elevation_error_deg": 0.2, "range_error_m": 10.0,
}  # fmt: skip


def flights() -> list[dict[str, Any]]:
    """Return the flights, all around the ownship and each about it."""
    found = []
    for i, (name, legs) in enumerate(MANOEUVRES.items()):
        around = 2.0 * math.pi * i / len(MANOEUVRES)
        found.append({
            "name": name, "east_m": 4000.0 * math.sin(around),
            "north_m": 4000.0 * math.cos(around), "up_m": 100.0,
            "heading_deg": math.degrees(around) + 60.0, "speed_mps": 60.0,
            "legs": [_STRAIGHT, *legs] if legs else [{"kind": "straight"}],
        })  # fmt: skip
    return found


def measured(
    tracker: dict[str, Any], rate_hz: float, replicas: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return instants, and squared errors of position and NEES (replicas, flights, instants)."""
    own = {**OWNSHIP, "speed_mps": 1.0, "climb_mps": 0.0}
    case = Case("", tracker, sensors={"radar": {**_RADAR, "scan_rate_hz": rate_hz}})
    table = scene_of_case(
        case, {"type": "traffic.scripted", "ownship": own, "intruders": flights()}
    )
    scene = dsa_des.load_scene({**table, "duration_s": DURATION_S})
    scenes = [replica_scene(scene, Replica(1 + i, {})) for i in range(replicas)]
    targets = traffic_and_duration(scenes[0])[0].targets
    times = np.arange(10.0, DURATION_S, max(1.0, 1.0 / rate_hz))
    square, nees = np.full((2, replicas, len(targets), len(times)), np.nan)
    for replica, found in enumerate(tracks_of(scenes)):
        known = np.isin(found["track_status"].to_pylist(), ("confirmed", "coasted"))
        part = found.filter(known)
        columns = {
            n: part[n].to_numpy() for n in (*_STATE, *COVARIANCE.values(), "state_s", "time_s")
        }
        origin = np.stack([part[f"origin_{n}"].to_numpy() for n in ("lat_deg", "lon_deg", "alt_m")])
        true, _ = states_and_presence_in_frame(targets, columns["state_s"], origin)
        error = np.stack([columns[n] for n in _STATE]) - true  # (targets, 6, rows)
        spread = np.empty((len(columns["state_s"]), 6, 6))
        for (i, j), name in COVARIANCE.items():
            spread[:, i, j] = spread[:, j, i] = columns[name]
        for k, time_s in enumerate(times.tolist()):
            rows = np.flatnonzero(np.abs(columns["time_s"] - time_s) < 1e-6)
            if len(rows) == 0:
                continue
            away = (error[:, :3, rows] ** 2).sum(axis=1)
            near = away.argmin(axis=1)
            e = error[np.arange(len(targets)), :, rows[near]]
            there = away.min(axis=1) < WITHIN_M**2
            square[replica, there, k] = away.min(axis=1)[there]
            inverse = np.linalg.solve(spread[rows[near]], e[..., np.newaxis])[..., 0]
            nees[replica, there, k] = (e * inverse).sum(axis=1)[there]
    return times, square, nees


def summary(times: FloatArray, square: FloatArray, nees: FloatArray) -> list[tuple[float, ...]]:
    """Return of each flight the largest error, the time outside and the largest mean NEES."""
    since = times >= BEGINS_S
    error = np.sqrt(np.nanmean(square, axis=0)[:, since]).max(axis=1)
    step_s = times[1] - times[0]
    outside = (~(nees[..., since] <= OUTSIDE)).sum(axis=2).mean(axis=0) * step_s
    largest = np.nanmean(nees, axis=0)[:, since].max(axis=1)
    return list(zip(error.tolist(), outside.tolist(), largest.tolist(), strict=True))


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.track_consistency.manoeuvres",
        description="Print how the filters follow manoeuvres: error, time outside, NEES.",
    )
    parser.add_argument("--replicas", type=int, default=20)
    options = parser.parse_args(arguments)
    kinds = ("ekf", "ukf", "imm")
    say("| | Hz | " + " | ".join(f"`{kind}`" for kind in kinds) + " |")
    say("|---|---|" + "---|" * len(kinds))
    found = {
        (kind, rate): summary(*measured({"type": f"tracking.{kind}"}, rate, options.replicas))
        for kind in kinds
        for rate in RATES_HZ
    }
    for i, name in enumerate(MANOEUVRES):
        for rate in RATES_HZ:
            cells = (found[kind, rate][i] for kind in kinds)
            shown = (f"{e:.0f} m, {out:.0f} s, {most:.0f}" for e, out, most in cells)
            say(f"| {name if rate == RATES_HZ[0] else ''} | {rate:g} | " + " | ".join(shown) + " |")
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
