"""Which piece of a path a time lies in: expected on even grids, halved on others, as a search."""

import numpy as np
import pytest

from components.flights.fleet import PieceSearch

RNG = np.random.default_rng(11)
EVEN = [2.0 + 0.5 * np.arange(40), -7.0 + 0.1 * np.arange(181), np.array([0.0, 3.0])]
GRIDS = {
    "even": EVEN,
    "shaken": [grid + RNG.uniform(0.0, 0.02, len(grid)) for grid in EVEN],
    "uneven": [np.sort(RNG.uniform(0.0, 20.0, 50)), EVEN[0]],
    "one piece": [np.array([5.0]), EVEN[0]],
    "twice the same": [np.repeat(np.arange(12.0), 2), np.zeros(20)],
}


@pytest.mark.parametrize("name", GRIDS)
def test_a_piece_is_that_of_a_search(name: str) -> None:
    grids = GRIDS[name]
    find = PieceSearch.from_starts(grids)
    assert (find._per_s is not None) is (name in ("even", "shaken"))
    path = RNG.integers(0, len(grids), 4000)
    times = np.array([RNG.uniform(grids[k][0] - 2.0, grids[k][-1] + 2.0) for k in path])
    at_starts = np.array([RNG.choice(grids[k]) for k in path])
    near = np.nextafter(at_starts, RNG.choice([-np.inf, np.inf], 4000))
    ends = np.array([0, *np.cumsum([len(grid) for grid in grids])])
    for time_s in (times, at_starts, near, np.full(4000, np.nan), np.full(4000, 1e300)):
        wanted = [
            ends[k] + (0 if np.isnan(t) else max(0, np.searchsorted(grids[k], t, side="right") - 1))
            for k, t in zip(path, time_s, strict=True)
        ]
        assert find(path, time_s).tolist() == wanted
