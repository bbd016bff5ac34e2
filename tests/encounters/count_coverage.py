"""Count how often intervals of the risk ratio hold the truth.

``python -m tests.encounters.count_coverage``. Synthetic sets of encounters whose true ratio is
known, with equal, uneven and long-tailed weights, and with copies that hang together.
"""

import argparse

import numpy as np

from components.metrics.risk import METHODS, risk_ratio

CHANCE, LEFT, NEW = 0.1, 0.2, 0.003
TRUTH = LEFT + (1 - CHANCE) / CHANCE * NEW
SHAPES = {
    "equal weights": lambda random, count: np.ones(count),
    "weights 1 or 3": lambda random, count: random.choice([1.0, 3.0], count),
    "exponential weights": lambda random, count: random.exponential(1.0, count),
    "log-normal weights, σ 1": lambda random, count: random.lognormal(0.0, 1.0, count),
}


def coverage(shape: str, method: str, sets: int, count: int, copies: int) -> tuple[float, float]:
    """Return the share of intervals that hold the truth, and of those marked as few."""
    random = np.random.default_rng(19)
    held = few = 0
    for _ in range(sets):
        w = np.repeat(SHAPES[shape](random, count), copies)
        n = np.repeat(random.random(count) < CHANCE, copies)
        m = random.random(count * copies) < np.where(n, LEFT, NEW)
        cluster = np.repeat(np.arange(count), copies) if copies > 1 else None
        found = risk_ratio(n, m, w, cluster=cluster, method=method, resamples=1000)
        held += found.interval[0] <= TRUTH <= found.interval[1]
        few += found.few
    return held / sets, few / sets


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--count", type=int, default=4000, help="encounters in each")
    options = parser.parse_args()
    for copies in (1, 3):
        for shape in SHAPES:
            for method in METHODS:
                held, few = coverage(shape, method, options.sets, options.count, copies)
                print(f"{shape}, {copies} of each, {method}: {held:.1%}, marked few {few:.1%}")
