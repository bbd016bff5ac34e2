"""Time functions by what they do in a second: alert levels, bands of states, track updates.

``python -m components.benchmark.rates RATE`` prints one JSON object; the command starts it
anew for every rate.
"""

import argparse
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np

from components.alert_configuration.conf_file import read_conf
from components.alerting.levels import due_levels, violation_times_s
from components.benchmark import encounters
from components.benchmark.measure import pin
from components.benchmark.other_trackers import by_stone_soup, plainly
from components.benchmark.track_updates import LOOKS, updates
from components.examples import folder
from components.guidance.bands import guidance_of_many
from components.guidance.kinds import KINDS
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from dsa_des.terminal.terminal import say_json


@dataclass(frozen=True)
class Rate:
    """Something done many times.

    Parameters
    ----------
    name, what : str
    wanted : float
        At least so many in a second of CPU.
    count : int
        How many at once.
    prepare : callable
        From the count to what does them.
    beside : mapping, optional
        By name what does the same work otherwise: from whether it has to be quick to how many are
        done and what does them, or to None where it is not installed.
    """

    name: str
    what: str
    wanted: float
    count: int
    prepare: Callable[[int], Callable[[], object]]
    beside: Mapping[str, Callable[[bool], tuple[int, Callable[[], object]] | None]] = field(
        default_factory=dict
    )


def states(count: int, within_m: float, apart_m: float, seed: int) -> tuple[State, State]:
    """Return ownships at the origin, and an intruder of each, in flight in all directions."""
    random = np.random.default_rng(seed)

    def flown(position: list[Any]) -> State:
        track, speed = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(25.0, 130.0, count)
        climb = random.normal(0.0, 3.0, count)
        east_mps, north_mps = speed * np.sin(track), speed * np.cos(track)
        return State(position[0], position[1], position[2], east_mps, north_mps, climb)

    up, zero = random.uniform(500.0, 3000.0, count), np.zeros(count)
    east, north = random.uniform(-within_m, within_m, (2, count))
    return flown([zero, zero, up]), flown([east, north, up + random.normal(0.0, apart_m, count)])


def _levels(count: int) -> Callable[[], object]:
    configuration = read_conf(folder() / "alerting" / "do365b.conf")
    levels, lookahead_s = configuration.alerters[0].levels, configuration["lookahead_time"]
    own, intruder = states(count, 10_000.0, 200.0, 1)
    relative = own.less(intruder)
    return lambda: due_levels(levels, violation_times_s(levels, relative, lookahead_s, None))


def _bands(count: int) -> Callable[[], object]:
    configuration = read_conf(folder() / "alerting" / "do365b.conf")
    own, intruder = states(count, 6_000.0, 150.0, 2)
    level = np.zeros(count, dtype=np.int64)
    intruders = [GuidedIntruders(intruder, configuration.alerters[0], level)]
    return lambda: [guidance_of_many(kind, configuration, own, intruders) for kind in KINDS]


def _tracks_in_lock_step(count: int) -> Callable[[], object]:
    return updates(count // (4 * LOOKS), 4)


def _tracks_of_one_run(count: int) -> Callable[[], object]:
    return updates(1, count // LOOKS)


RATES = (
    Rate("pair_alerts", "levels of pairs of aircraft, three volumes each", 1e6, 200_000, _levels),
    Rate("bands", "states of an ownship and an intruder, four kinds of bands", 1e3, 1000, _bands),
    Rate(
        "track_updates",
        "updates of tracks, EKF and global nearest neighbour, 4 targets and three "
        "sensors in 1000 replicas in lock step",
        5e5,
        4000 * LOOKS,
        _tracks_in_lock_step,
        {"a plain loop": lambda quick: plainly(4), "Stone Soup": lambda quick: by_stone_soup(4)},
    ),
    Rate(
        "track_updates_alone",
        "the same of 100 targets in a single run",
        2e4,
        100 * LOOKS,
        _tracks_of_one_run,
        {"a plain loop": lambda quick: plainly(10 if quick else 100)},
    ),
    Rate(
        "replicas",
        "runs of 120 s, an intruder, 5, 20 and 2 Hz, other phases, first detections and ages",
        1000,
        500,
        encounters.replicas,
    ),
    Rate(
        "replicas_all",
        "the same, every column and the truth recorded to memory",
        1000,
        500,
        encounters.replicas_all,
    ),
    Rate(
        "flights",
        "encounters of 120 s with other flights, two intruders, three sensors at 1 Hz, open loop",
        1000,
        1000,
        encounters.flights,
    ),
    Rate(
        "loop",
        "the same in a closed loop of tracker, alerting and pilot, lookahead 0.5 s",
        333,
        1000,
        encounters.loop,
    ),
    Rate(
        "risk",
        "encounters of 180 s of a model, radar, tracker and alerting, nominal and mitigated",
        167,
        512,
        encounters.risk,
    ),
)


def measured(rate: Rate, quick: bool, repeats: int) -> dict[str, Any]:
    """Return how many are done in a second of CPU, the median of some repetitions."""
    count = rate.count // 10 if quick else rate.count
    beside = {}
    for name, prepare in rate.beside.items():
        other = prepare(quick)
        if other is not None:
            beside[name] = _per_s(*other, 1 if quick else min(repeats, 2))
    per_s = _per_s(count, rate.prepare(count), repeats)
    return {"scene": rate.name, "per_s": per_s, "wanted": rate.wanted, "beside": beside}


def _per_s(count: int, do: Callable[[], object], repeats: int) -> float:
    do()
    found = []
    for _ in range(repeats):
        started = time.process_time()
        do()
        found.append(count / (time.process_time() - started))
    return median(found)


def main(arguments: list[str] | None = None) -> int:
    """Measure one rate and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m components.benchmark.rates")
    parser.add_argument("rate", choices=[rate.name for rate in RATES])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    pin()
    (rate,) = (rate for rate in RATES if rate.name == options.rate)
    say_json(measured(rate, options.quick, options.repeats))
    return 0


if __name__ == "__main__":
    sys.exit(main())
