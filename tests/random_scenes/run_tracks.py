"""Run hundreds of tracked scenes: ``python tests/random_scenes/run_tracks.py --count 300``.

Aircraft with and without equipage come and go before a radar, ADS-B and active surveillance, which
are up to 2 s late, behind every fusion and tracker. No run may fail, no confirmed track may be of
nobody, and behind each fusion the normalised error squared (NEES) of tracks must lie within bounds
at every instant. The exit code is 1 if anything is wrong.

Tracks of one scene have errors in common, so a scene counts as one sample: the mean over its
tracks. Were covariances exact, and all tracks of a scene off alike, n scenes would have a sum of
chi-square with 6 n degrees of freedom; tracks that are off each their own way are nearer to the
middle. One of the six has a longer tail: altimeters err by a Laplace distribution, the square of
which has a variance of 5 times its mean's square where a normal one's has 2, so a scene has 15 in
place of 12: chi-square with 1 / 1.25 of the degrees, 1.25 times as large. Flights are straight,
while filters allow for accelerations that never come: where looks are dense a filter of constant
velocity then has half the NEES that it states, 1 of 2 along each axis, whatever its noise
(docs/tracking.md). So bounds are those of chi-square above, and half of them below, at chances of
1e-5 each. Covariance intersection is meant to be too cautious: it has no bound below.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

import crooked
from comparisons import difference, recorded
from dice import Dice

import dsa_des
from dsa_des.errors import BlockFailure, SceneError

DURATION_S = 50
#: A track younger than this has a velocity that is a guess, s.
SETTLED_S = 10.0
#: Farther than this from all aircraft, in metres and in deviations, is nobody.
NOBODY_M, NOBODY_SIGMAS = 500.0, 6.0
#: Chance that the NEES of an instant falls outside each of its bounds.
CHANCE = 1e-5
#: NEES of a filter in straight flight by what it states, where looks are dense.
STRAIGHT = 0.5
#: Variance of the NEES of exact covariances by that of chi-square.
TAILS = 1.25
#: So few scenes say nothing of an instant.
FEWEST = 5

#: By group of tracks and whole second: the mean NEES of each scene's tracks.
Nees = dict[str, dict[int, list[float]]]


def scene_of(dice: Dice, aircraft_count: int = 3, ownship: Mapping[str, Any] | None = None) -> Any:
    """Return a scene: aircraft apart in bearing, two or three sensors, a fusion, a tracker."""
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
    for number in range(aircraft_count):
        spread = 360.0 / aircraft_count
        bearing = first + spread * number + dice.near(-15, 15, 1) * spread / 120.0
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
    kind = dice.pick("pass_through", "pass_through", "gated", "pick_best")
    tracker: dict[str, Any] = {"type": f"tracking.{dice.pick('ekf', 'ukf', 'imm')}"}
    dice.maybe(tracker, "late", 0.6, "drop", "rerun")
    dice.maybe(tracker, "association", 0.3, "nearest", "jpda")
    own = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1500, "heading_deg": dice.near(0, 360, 0),
           "speed_mps": dice.near(40, 80, 0), **(ownship or {})}  # fmt: skip
    seed = dice.randrange(1000)
    fusion: dict[str, Any] = {"type": f"fusion.{kind}"}
    if kind == "gated":
        dice.maybe(fusion, "time_gate_s", 0.5, 0.3, 1)
    if kind == "pick_best":
        dice.maybe(fusion, "coincidence_s", 0.5, 0.1, 0.5)
    if kind == "pass_through" and dice.chance(0.3):
        kind = "covariance_intersection"
    dice.features |= {f"fusion.{kind}", tracker["type"], f"late {tracker.get('late', 'usual')}"}
    dice.features |= {f"{key} {value}" for key, value in fusion.items() if key != "type"}
    wires = ["traffic -> transform -> gate", *(f"gate -> {n}" for n in sensors)]
    trackers: dict[str, dict[str, Any]] = {}
    if kind == "covariance_intersection":
        trackers["fused"] = {"type": f"fusion.{kind}"}
        for name in sensors:
            trackers |= {f"of_{name}": fusion, f"by_{name}": tracker}
            wires.append(f"{name} -> of_{name} -> by_{name} -> fused")
    else:
        trackers |= {"fusion": fusion, "tracker": tracker}
        wires += [*(f"{n} -> fusion" for n in sensors), "fusion -> tracker"]
    return {
        "duration_s": DURATION_S, "seed": seed, "record": {"truth": True}, "wires": wires,
        "blocks": {"traffic": {"type": "traffic.scripted", "ownship": own, "intruders": aircraft},
                   "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"},
                   **sensors, **trackers},
    }  # fmt: skip


def group_of(tables: Mapping[str, Any], block: str) -> str:
    """Return which tracks are judged together: those behind one kind of fusion."""
    blocks = tables["blocks"]
    if block.startswith("by_"):
        return "pass_through, one sensor"
    return str(blocks["fusion" if "fusion" in blocks else block]["type"]).partition(".")[2]


def errors(run: Any, tables: Mapping[str, Any]) -> tuple[list[str], Nees]:
    """Return the tracks of nobody, and the normalised errors squared by group and second."""
    seen: dict[str, list[tuple[float, float, float, float]]] = {}
    for row in run.truth.to_pylist():
        place = row["time_s"], row["lat_deg"], row["lon_deg"], row["alt_m"]
        seen.setdefault(row["target"], []).append(place)
    flights = {name: np.array(sorted(places)).T for name, places in seen.items()}
    nobody: Counter[tuple[str, int]] = Counter()
    rows: Counter[tuple[str, int]] = Counter()
    nees: dict[str, dict[int, list[float]]] = {}
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
        own = np.array([row[f"own_{axis}_m"] for axis in ("north", "east")])
        near = [
            _off(flight, row["state_s"], origin, own, state, spread) for flight in flights.values()
        ]
        away_m, sigmas, normalised, there = min(near)
        track = row["block"], row["track"]
        rows[track] += 1
        nobody[track] += away_m > NOBODY_M and sigmas > NOBODY_SIGMAS
        if there and row["age_s"] >= SETTLED_S:
            mine = nees.setdefault(group_of(tables, row["block"]), {})
            mine.setdefault(round(row["state_s"]), []).append(normalised)
    lost = [f"{track[0]}, track {track[1]} of nobody in {nobody[track]} of {rows[track]} rows"
            for track in nobody if nobody[track]]  # fmt: skip
    return lost, {
        group: {second: [float(np.mean(values))] for second, values in sorted(mine.items())}
        for group, mine in nees.items()
    }


def _off(
    flight: Any, time_s: float, origin: list[float], own: Any, state: Any, spread: Any
) -> tuple[float, float, float, bool]:
    """Return how far a state is from a straight flight: m, deviations, and as six quantities.

    Deviations are the less of those along straight lines and along the circle about the ownship: a
    bearing that is good to 9 degrees is off along an arc, which no covariance of positions has.
    """
    times = flight[0]
    k = int(np.clip(np.searchsorted(times, time_s), 1, len(times) - 1))
    (t0, *one), (t1, *other) = flight[:, k - 1], flight[:, k]
    before, after = (
        np.array(pymap3d.geodetic2ned(*place, *origin), dtype=float) for place in (one, other)
    )
    velocity = (after - before) / (t1 - t0)
    true = before + velocity * (time_s - t0)
    off = state - np.concatenate([true, velocity])
    seen, there = (complex(*(place[:2] - own)) for place in (state, true))
    turn = float(np.angle(seen * there.conjugate()))  # 0 where either is overhead
    along = np.exp(1j * np.angle(seen)) * complex(abs(seen) - abs(there), abs(seen) * turn)
    on_arc = np.array([along.real, along.imag, off[2]])
    place = min(one @ np.linalg.solve(spread[:3, :3], one) for one in (off[:3], on_arc))
    whole = off @ np.linalg.solve(spread, off)
    during = bool(times[0] <= time_s <= times[-1])
    return float(np.linalg.norm(off[:3])), float(np.sqrt(place)), float(whole), during


def judged(seed: int, *, same: bool = True, **keys: Any) -> tuple[str, Nees, set[str]]:
    """Return what is wrong with the scene of a seed, its NEES, and its features."""
    dice = Dice(seed)
    tables = scene_of(dice, **keys)
    try:
        lost, nees = errors(dsa_des.run(tables), tables)
        if same:
            scene = dsa_des.load_scene(tables)
            if found := difference(recorded(scene), recorded(scene, window=1)):
                return f"window=1: {found}", {}, dice.features
    except (BlockFailure, SceneError, np.linalg.LinAlgError) as error:
        return f"{type(error).__name__}: {error}", {}, dice.features
    return ", ".join(lost), nees, dice.features


def bounds(scenes: int, group: str) -> tuple[float, float]:
    """Return between what the mean NEES of so many scenes must lie."""
    low, high = TAILS * chi2.ppf([CHANCE, 1.0 - CHANCE], 6 * scenes / TAILS) / scenes
    return (0.0 if group == "covariance_intersection" else STRAIGHT * low), high


def added(parts: Iterable[Nees]) -> Nees:
    """Return the NEES of many scenes together."""
    nees: Nees = {}
    for part in parts:
        for group, mine in part.items():
            for second, values in mine.items():
                nees.setdefault(group, {}).setdefault(second, []).extend(values)
    return nees


def outside(nees: Nees, *, aloud: bool = False) -> list[str]:
    """Return the groups and instants whose mean NEES lies outside its bounds."""
    result = []
    for group, mine in sorted(nees.items()):
        whole = [value for values in mine.values() for value in values]
        if aloud:
            print(f"  {group}: mean over instants and scenes {np.mean(whole):.2f}")
        for second, values in sorted(mine.items()):
            mean, (low, high) = float(np.mean(values)), bounds(len(values), group)
            bad = len(values) >= FEWEST and not low < mean < high
            result += [f"{group} at {second} s"] if bad else []
            if aloud:
                print(f"  {second:5} s: {len(values):4} scenes, NEES {mean:5.2f}, bounds "
                      f"{low:.2f} to {high:.2f}{', outside' if bad else ''}")  # fmt: skip
    return result


def main() -> None:
    """Judge as many scenes as asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, help="how many scenes [300]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first [1]")
    parser.add_argument(
        "--every", type=int, default=10, help="scenes from one window=1 to the next"
    )
    parser.add_argument("--aircraft", type=int, default=3, help="aircraft in each [3]")
    parser.add_argument(
        "--crooked", action="store_true", help="with an ownship that is banked, in the south"
    )
    options = parser.parse_args()
    ownship = crooked.OWNSHIP if options.crooked else None
    features: Counter[str] = Counter()
    parts, wrong, started = [], 0, time.monotonic()
    for seed in range(options.seed, options.seed + options.count):
        found, more, has = judged(
            seed, same=seed % options.every == 0,
            aircraft_count=options.aircraft, ownship=ownship,
        )  # fmt: skip
        features.update(has)
        parts.append(more)
        if found:
            wrong += 1
            print(f"{seed}: {found}", flush=True)
    for feature, count in sorted(features.items()):
        print(f"  {count:6} {feature}")
    beyond = outside(added(parts), aloud=True)
    print(f"{options.count} scenes in {time.monotonic() - started:.0f} s: {wrong} wrong; "
          f"NEES outside at {', '.join(beyond) or 'no instant'}")  # fmt: skip
    sys.exit(1 if wrong or beyond else 0)


if __name__ == "__main__":
    main()
