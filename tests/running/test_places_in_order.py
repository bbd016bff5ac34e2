"""Where one array lies in another: what was found before is a guess, and no more than that."""

import numpy as np
import pytest

from dsa_des.arrays.sorted_union import last_at_or_before

_MANY = 2000


@pytest.mark.parametrize("seed", range(3))
def test_arrays_of_the_same_lengths_are_told_apart(seed: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(4):
        values = np.cumsum(random.integers(1, 4, _MANY))
        for asked in (values[::2], values[1::2], values[::2] + 1):
            found, met = last_at_or_before(values, asked)
            assert found.tolist() == [np.flatnonzero(values <= one)[-1] for one in asked]
            assert not met or set(asked) <= set(values)
            found += 1  # it is the asker's own


def test_of_equal_values_the_last_is_found_whatever_was_found_before() -> None:
    values = np.arange(_MANY) * 3
    asked = values[::2]
    assert last_at_or_before(values, asked)[0].tolist() == list(range(0, _MANY, 2))
    twice = values.copy()
    twice[1::2] = twice[::2]
    assert last_at_or_before(twice, asked)[0].tolist() == list(range(1, _MANY, 2))
