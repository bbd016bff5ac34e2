"""What takes a short way for few values gives the bits of the long way for many."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.grid import Grid
from dsa_des.time.randomness import Stream

finite = st.floats(-1e6, 1e6, allow_nan=False)
any_step = st.sampled_from([0.0, 0.1, np.radians(0.0358), np.radians(1.0), 76.2, 1.0, 0.25])


@settings(derandomize=True, max_examples=300, deadline=None)
@given(values=st.lists(finite, min_size=1, max_size=6), step=any_step, limited=st.booleans())
def test_grids(values, step, limited):
    limits = {"limit_low": -200.0, "limit_high": 300.0} if limited else {}
    grid = Grid(step, **limits)
    # Half-way values and whole steps among them.
    given_values = np.array([*values[:3], *(np.rint(v) * step / 2 for v in values[:3])])
    few = grid.round(given_values)
    many = grid.round(np.tile(given_values, 5))
    assert few.tobytes() == many[: len(given_values)].tobytes()


def test_grids_of_what_cannot_be_counted():
    grid = Grid(1e-9)
    values = np.array([1e12, -1e301, 0.0, -0.0, 5e-324])
    assert grid.round(values).tolist() == [1e12, -1e301, 0.0, 0.0, 0.0]
    assert grid.round(np.tile(values, 3))[:5].tobytes() == grid.round(values).tobytes()
    assert not np.signbit(grid.round(values)[3])


@settings(derandomize=True, max_examples=100, deadline=None)
@given(
    keys=st.lists(st.integers(0, 2**64 - 1), min_size=1, max_size=12),
    scan=st.integers(-1, 2**47),
    draw=st.integers(0, 9),
)
def test_draws(keys, scan, draw):
    stream = Stream(7, "radar", "detection")
    targets = np.array(keys, dtype=np.uint64)
    scans = scan + np.arange(len(keys))
    many = np.tile(targets, 20), np.tile(scans, 20)
    for kind in (stream.uniform, stream.normal):
        few = kind(targets, scans, draw)
        assert few.tobytes() == np.ascontiguousarray(kind(*many, draw)[: len(keys)]).tobytes()
