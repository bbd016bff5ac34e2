"""Count how often intervals of the risk ratio hold the truth, and on which side they miss it.

``python -m tests.encounters.count_coverage`` prints the table of docs/encounters.md. The sets of
encounters are synthetic, their true ratio is known, and nothing of the intervals' own computation
is used.
"""

import argparse

import numpy as np

from components.metrics.risk import METHODS, risk_ratio

CHANCE, LEFT, NEW = 0.5, 0.25, 0.01
TRUTH = LEFT + (1 - CHANCE) / CHANCE * NEW
#: Log-normal weights spread as those of a published set of 10,000 do: its encounters with loss of
#: well clear (σ 0.7), and all of it (1.6).
SHAPES = {
    "equal": lambda random, count: np.ones(count),
    "log-normal, σ 0.7": lambda random, count: random.lognormal(0.0, 0.7, count),
    "log-normal, σ 1.6": lambda random, count: random.lognormal(0.0, 1.6, count),
    "Pareto, 1.5": lambda random, count: random.pareto(1.5, count) + 1.0,
}
EVENTS = (1, 3, 5, 9, 10, 30, 434)


def misses(shape: str, events: int, sets: int, method: str, seed: int = 19) -> np.ndarray:
    """Return the shares of intervals above the truth, below it, and below it without a warning.

    Parameters
    ----------
    shape : str
        One of `SHAPES`.
    events : int
        Mitigated ones that are expected.
    sets : int
        How many are drawn; those without any nominal event have no ratio and do not count.
    method : str
    seed : int
    """
    random = np.random.default_rng([seed, events, list(SHAPES).index(shape)])
    count = round(events / (CHANCE * (LEFT + NEW)))
    found = []
    for _ in range(sets):
        w = SHAPES[shape](random, count)
        n = random.random(count) < CHANCE
        m = random.random(count) < np.where(n, LEFT, NEW)
        if n.any():
            told = risk_ratio(n, m, w, method=method, resamples=1000)
            low, high = told.interval
            found.append((low > TRUTH, high < TRUTH, high < TRUTH and not told.few))
    return np.mean(found, axis=0)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=2000)
    parser.add_argument("--methods", default="gamma,delta", help=f"of {', '.join(METHODS)}")
    parser.add_argument("--weights", default=";".join(SHAPES), help="with ; between them")
    options = parser.parse_args()
    methods, sets = options.methods.split(","), options.sets
    print("| weights | events | " + " | ".join(f"{m}: above, below" for m in methods) + " |")
    print("|---" * (2 + len(methods)) + "|")
    for shape in options.weights.split(";"):
        for events in EVENTS:
            cells = []
            for method in methods:
                above, below, unmarked = 100.0 * misses(shape, events, sets, method)
                marked = "" if unmarked > 0.5 * below or method == "gamma" else " *"
                cells.append(f"{above:.1f}, {below:.1f} %{marked}")
            print(f"| {shape} | {events} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
