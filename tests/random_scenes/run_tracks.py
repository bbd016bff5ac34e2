"""Run hundreds of tracked scenes: ``python tests/random_scenes/run_tracks.py --count 300``.

Aircraft with and without equipage come and go before a radar, ADS-B and active surveillance, which
are up to 2 s late, behind every fusion and tracker. No run may fail. Where a tracker gets every
error stated (`fusion.pass_through`, some half of the scenes) no confirmed track may be of nobody,
and the normalised error squared of its tracks, averaged over the scenes at each instant, must lie
within bounds; behind other fusions neither is judged. The exit code is 1 if anything is wrong.
"""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from comparisons import difference, recorded
from dice import Dice

import dsa_des
from dsa_des.errors import BlockFailure, SceneError

DURATION_S = 50
#: A track younger than this has a velocity that is a guess, s.
SETTLED_S = 10.0
#: Farther than this from all aircraft, in metres and in deviations, is nobody.
NOBODY_M, NOBODY_SIGMAS = 500.0, 6.0


def scene_of(dice: Dice) -> dict[str, Any]:
    """Return a scene: three aircraft a third of a turn apart, two or three sensors, a tracker."""
    late = lambda: dice.pick(0, 0, 0.2, 0.3, 0.8, 1.1, 2)  # noqa: E731
    sensors: dict[str, dict[str, Any]] = {
        "radar": {"type": "radar.range_boundary", "scan_rate_hz": dice.pick(0.5, 1, 2, 5),
                  "range_km": 15, "errors": "stated", "quantised": False,
                  "azimuth_error_deg": 0.3, "elevation_error_deg": 0.3, "range_error_m": 15,
                  "latency_s": late()},
        "ether": {"type": "surveillance.ads_b", "scan_rate_hz": dice.pick(0.5, 1, 5, 10),
                  "reception": dice.pick("certain", "do_365", "fitted"), "range_km": 30,
                  "latency_s": late()},
        "asker": {"type": "surveillance.active", "scan_rate_hz": 1, "latency_s": late()},
    }  # fmt: skip
    dice.features |= {f"latency {one['latency_s']}" for one in sensors.values()}
    left_out = dice.pick("radar", "ether", "asker", "", "")
    sensors.pop(left_out, None)
    dice.features.add(f"without {left_out or 'nothing'}")
    first, aircraft = dice.near(0, 360, 1), []
    for number in range(3):
        bearing = first + 120.0 * number + dice.near(-15, 15, 1)
        away = dice.near(3000, 9000, 0)
        one: dict[str, Any] = {
            "name": f"t{number}", "up_m": dice.near(-300, 300, 0),
            "north_m": float(round(away * np.cos(np.radians(bearing)))),
            "east_m": float(round(away * np.sin(np.radians(bearing)))),
            "heading_deg": dice.near(0, 360, 1), "speed_mps": dice.near(40, 90, 1),
        }  # fmt: skip
        dice.maybe(one, "climb_mps", 0.3, 3, -4)
        if dice.chance(0.4, "born in the middle"):
            one["start_time_s"] = dice.near(3, 20, 1)
        if dice.chance(0.3, "gone before the end"):
            one["end_time_s"] = dice.near(30, 45, 1)
        if dice.chance(0.75, "equipped"):
            one |= {"mode_s": True, "ads_b": {"nacp": dice.pick(8, 9, 10), "nacv": 2}}
        aircraft.append(one)
    fusion = dice.pick("pass_through", "pass_through", "gated", "pick_best")
    tracker: dict[str, Any] = {"type": f"tracking.{dice.pick('ekf', 'ukf', 'imm')}"}
    dice.maybe(tracker, "late", 0.6, "drop", "rerun")
    dice.maybe(tracker, "association", 0.3, "nearest", "jpda")
    dice.features |= {f"fusion.{fusion}", tracker["type"], f"late {tracker.get('late', 'usual')}"}
    own = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1500, "heading_deg": dice.near(0, 360, 0),
           "speed_mps": dice.near(40, 80, 0)}  # fmt: skip
    return {
        "duration_s": DURATION_S, "seed": dice.randrange(1000), "record": {"truth": True},
        "wires": ["traffic -> transform -> gate", *(f"gate -> {n} -> fusion" for n in sensors),
                  "fusion -> tracker"],
        "blocks": {"traffic": {"type": "traffic.scripted", "ownship": own, "intruders": aircraft},
                   "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"},
                   **sensors, "fusion": {"type": f"fusion.{fusion}"}, "tracker": tracker},
    }  # fmt: skip


def errors(run: Any) -> tuple[list[str], dict[int, list[float]]]:
    """Return the tracks of nobody, and the normalised errors squared by whole second."""
    seen: dict[str, list[tuple[float, float, float, float]]] = {}
    for row in run.truth.to_pylist():
        place = row["time_s"], row["lat_deg"], row["lon_deg"], row["alt_m"]
        seen.setdefault(row["target"], []).append(place)
    flights = {name: np.array(sorted(places)).T for name, places in seen.items()}
    nobody: Counter[int] = Counter()
    rows: Counter[int] = Counter()
    nees: dict[int, list[float]] = {}
    for row in run.state_tracks.to_pylist():
        if row["track_status"] not in ("confirmed", "coasted") or not row["has_range"]:
            continue
        state = np.array([row[f"{axis}_m"] for axis in ("north", "east", "down")]
                         + [row[f"{axis}_m_s"] for axis in ("north", "east", "down")])  # fmt: skip
        spread = np.zeros((6, 6))
        for i in range(6):
            for j in range(i, 6):
                unit = ("m2", "m2_s", "m2_s2")[(i > 2) + (j > 2)]
                spread[i, j] = spread[j, i] = row[f"covariance_{i}{j}_{unit}"]
        origin = [row[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
        near = [_off(flight, row["state_s"], origin, state, spread) for flight in flights.values()]
        away_m, sigmas, normalised, there = min(near)
        rows[row["track"]] += 1
        nobody[row["track"]] += away_m > NOBODY_M and sigmas > NOBODY_SIGMAS
        if there and row["age_s"] >= SETTLED_S:
            nees.setdefault(round(row["state_s"]), []).append(normalised)
    lost = [f"track {n}: {nobody[n]} of {rows[n]} rows" for n in nobody if nobody[n]]
    return lost, nees


def _off(
    flight: Any, time_s: float, origin: list[float], state: Any, spread: Any
) -> tuple[float, float, float, bool]:
    """Return how far a state is from a straight flight: m, deviations, and as six quantities."""
    times = flight[0]
    k = int(np.clip(np.searchsorted(times, time_s), 1, len(times) - 1))
    (t0, *one), (t1, *other) = flight[:, k - 1], flight[:, k]
    before, after = (
        np.array(pymap3d.geodetic2ned(*place, *origin), dtype=float) for place in (one, other)
    )
    velocity = (after - before) / (t1 - t0)
    off = state - np.concatenate([before + velocity * (time_s - t0), velocity])
    place = off[:3] @ np.linalg.solve(spread[:3, :3], off[:3])
    there = bool(times[0] <= time_s <= times[-1])
    whole = off @ np.linalg.solve(spread, off)
    return float(np.linalg.norm(off[:3])), float(np.sqrt(place)), float(whole), there


def judged(seed: int, *, same: bool = True) -> tuple[str, dict[int, list[float]], set[str]]:
    """Return what is wrong with the scene of a seed, its errors where stated, and its features."""
    dice = Dice(seed)
    tables = scene_of(dice)
    try:
        lost, nees = errors(dsa_des.run(tables))
        if same:
            scene = dsa_des.load_scene(tables)
            if found := difference(recorded(scene), recorded(scene, window=1)):
                return f"window=1: {found}", {}, dice.features
    except (BlockFailure, SceneError, np.linalg.LinAlgError) as error:
        return f"{type(error).__name__}: {error}", {}, dice.features
    stated = tables["blocks"]["fusion"]["type"] == "fusion.pass_through"
    # Gates may put together what is of two aircraft, and the best of several is of two instants.
    wrong = ", ".join(lost) if stated else ""
    return wrong, nees if stated else {}, dice.features


def main() -> None:
    """Judge as many scenes as asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, help="how many scenes [300]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first [1]")
    parser.add_argument(
        "--every", type=int, default=10, help="scenes from one window=1 to the next"
    )
    options = parser.parse_args()
    features: Counter[str] = Counter()
    nees: dict[int, list[float]] = {}
    wrong, started = 0, time.monotonic()
    for seed in range(options.seed, options.seed + options.count):
        found, more, has = judged(seed, same=seed % options.every == 0)
        features.update(has)
        for second, values in more.items():
            nees.setdefault(second, []).extend(values)
        if found:
            wrong += 1
            print(f"{seed}: {found}", flush=True)
    for feature, count in sorted(features.items()):
        print(f"  {count:6} {feature}")
    outside = []
    for second, values in sorted(nees.items()):
        mean, off = float(np.mean(values)), float(np.mean(np.array(values) > 22.46))
        outside += (
            [second]
            if len(values) >= 30 and not 1.0 < mean < 6.0 + 20.0 / len(values) ** 0.5
            else []
        )
        print(f"  {second:3} s: {len(values):5} tracks, NEES {mean:.2f}, beyond 99.9 %: {off:.2%}")
    print(f"{options.count} scenes in {time.monotonic() - started:.0f} s: {wrong} wrong; "
          f"NEES outside at {outside or 'no instant'}")  # fmt: skip
    sys.exit(1 if wrong or outside else 0)


if __name__ == "__main__":
    main()
