"""``python -m docs.make.sensors.passive_ranging``: a weaving camera's ranges beside their bound.

The Cramér-Rao bound is worked out here from the flights alone, with nothing of the trackers': the
information of all looks about where a target that flies straight was at first and how fast, in
Cartesian coordinates that are fixed to the Earth.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation

SCENE = "configs/tracking/passive_ranging.toml"
STRAIGHT = "blocks.traffic.ownship.legs=[]"
AT_S = (10.0, 12.0, 14.0, 16.0, 20.0, 40.0, 59.8)
# GRS 80.
_A_M, _E2 = 6378137.0, 0.00669438002290


@dataclass
class Ranges:
    """At each instant: the range, its bound, and errors, stated deviations and NEES of runs."""

    time_s: Any
    range_m: Any
    bound_m: Any
    error_m: Any  # (runs, instants)
    stated_m: Any
    nees: Any


def ecef_m(lat_deg: Any, lon_deg: Any, alt_m: Any) -> Any:
    """Return places on the Earth, (n, 3), m."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    normal = _A_M / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    level = (normal + alt_m) * np.cos(lat)
    return np.stack(
        [level * np.cos(lon), level * np.sin(lon), ((1.0 - _E2) * normal + alt_m) * np.sin(lat)],
        axis=-1,
    )


def belly(lat_deg: Any, lon_deg: Any, pitch_rad: Any, roll_rad: Any, heading_rad: Any) -> Any:
    """Return the direction that is down in the aircraft, (n, 3), in axes fixed to the Earth."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    zero = np.zeros_like(lat)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    east = np.stack([-np.sin(lon), np.cos(lon), zero])
    down = -np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    level = np.cos(heading_rad) * north + np.sin(heading_rad) * east
    right = np.cos(heading_rad) * east - np.sin(heading_rad) * north
    under = np.cos(pitch_rad) * down + np.sin(pitch_rad) * level
    return (np.cos(roll_rad) * under - np.sin(roll_rad) * right).T


def bounds_m(
    time_s: Any,
    own_m: Any,
    down: Any,
    target_m: Any,
    angle_rad: float,
    prior: tuple[float, float],
) -> Any:
    """Return the bound of the range's standard deviation after each look, m.

    `prior` is the share to which the first range is known, and the deviation of each speed, m/s.
    Each look measures azimuth about the axis `down`, and elevation from the plane across it, with
    errors that are new each time.
    """
    share, speed_m_s = prior
    information = np.zeros((6, 6))
    found = []
    for i, time in enumerate(time_s - time_s[0]):
        line = target_m[i] - own_m[i]
        range_m = float(np.linalg.norm(line))
        along = np.outer(line, line) / range_m**2
        sideways = np.cross(down[i], line)  # as long as the range times the elevation's cosine
        upward = np.cross(line, sideways)
        upward /= np.linalg.norm(upward) * range_m * angle_rad
        sideways /= float(sideways @ sideways) * angle_rad
        across = np.outer(sideways, sideways) + np.outer(upward, upward)
        carried = np.hstack([np.eye(3), time * np.eye(3)])  # place by first place and velocity
        information += carried.T @ across @ carried
        if i == 0:
            information[:3, :3] += along / (share * range_m) ** 2
            information[3:, 3:] += np.eye(3) / speed_m_s**2
        place = carried @ np.linalg.inv(information) @ carried.T
        found.append(math.sqrt(line @ place @ line) / range_m)
    return np.array(found)


def ranges(*sets: str, seeds: int = 200, scene: str = SCENE) -> Ranges:
    """Return what the tracker makes of the range in runs of the scene, and what can be made."""
    known = dsa_des.load_scene(
        scene, sets=[*sets, "blocks.tracker.passive_range_share=10", "record.truth=true"]
    )
    scenes = [replica_scene(known, Replica(known.seed + i, {})) for i in range(seeds)]
    sink = MemorySink()
    make_lockstep_simulation(scenes, recorder=Recorder([sink])).run()
    tables = sink.tables()
    tracks = {name: tables["state_tracks"][name].to_numpy(zero_copy_only=False)
              for name in tables["state_tracks"].column_names}  # fmt: skip
    truth = {name: tables["truth"][name].to_numpy(zero_copy_only=False)
             for name in tables["truth"].column_names}  # fmt: skip
    # Tracks after the first begin beside it when a detection falls out of its gate.
    mine = tracks["track"] == 1
    tracks = {name: values[mine] for name, values in tracks.items()}
    first = truth["replica"] == 0
    own, target = (
        ecef_m(*(truth[key][first & here] for key in ("lat_deg", "lon_deg", "alt_m")))
        for here in (truth["target"] == None, truth["target"] != None)  # noqa: E711
    )
    times = truth["time_s"][first & (truth["target"] != None)]  # noqa: E711
    blocks: Any = known.blocks
    p = blocks["tracker"].parameters
    angle_rad = math.radians(blocks["eo"].parameters.azimuth_error_deg)
    pose = ("lat_deg", "lon_deg", "pitch_rad", "roll_rad", "heading_rad")
    down = belly(*(truth[key][first & (truth["target"] == None)] for key in pose))  # noqa: E711
    bound = bounds_m(times, own, down, target, angle_rad, (0.5, p.start_speed_m_s))
    shape = seeds, len(times)
    error, stated, nees = (np.full(shape, np.nan) for _ in range(3))
    true_m = np.linalg.norm(target - own, axis=1)
    place = np.searchsorted(times, tracks["time_s"])
    away = np.stack([tracks[f"{a}_m"] - tracks[f"own_{a}_m"] for a in ("north", "east", "down")])
    range_m = np.linalg.norm(away, axis=0)
    spread = np.empty((3, 3, len(range_m)))
    for i in range(3):
        for j in range(3):
            spread[i, j] = tracks[f"covariance_{min(i, j)}{max(i, j)}_m2"]
    along = np.sqrt(np.einsum("in,ijn,jn->n", away, spread, away)) / range_m
    at = tracks["replica"], place
    error[at], stated[at] = range_m - true_m[place], along
    nees[at] = (error[at] / stated[at]) ** 2
    return Ranges(times, true_m, bound, error, stated, nees)


def rows(found: Ranges) -> list[str]:
    """Return lines of the table: by time, range and its errors as shares of it."""
    lines = []
    for at_s in AT_S:
        i = int(np.searchsorted(found.time_s, at_s - 1e-6))
        rms = math.sqrt(float(np.mean(found.error_m[:, i] ** 2)))
        share = 100.0 / found.range_m[i]
        lines.append(
            f"| {at_s:g} s | {found.range_m[i] / 1000.0:.2f} km | {rms * share:.2g} % | "
            f"{float(np.mean(found.stated_m[:, i])) * share:.2g} % | "
            f"{found.bound_m[i] * share:.2g} % | {float(np.mean(found.nees[:, i])):.2f} |"
        )
    return lines


def main(arguments: Sequence[str] = ()) -> int:
    """Print the table with the manoeuvre, and without."""
    for sets in ((), (STRAIGHT,)):
        print("\n".join(rows(ranges(*sets, *arguments))), end="\n\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
