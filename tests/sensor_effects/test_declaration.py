"""The m-of-n rule against counting by hand, in any division into windows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.declaration import (
    declare,
    declare_looks,
    no_looks_yet,
)


def by_hand(detected, m, n):
    return [sum(detected[max(0, k - n + 1) : k + 1]) >= m for k in range(len(detected))]


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    looks=st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=40),
    n=st.integers(1, 6),
    data=st.data(),
)
def test_ragged_looks_agree_with_counting_by_hand(looks, n, data):
    m = data.draw(st.integers(1, n))
    cut = data.draw(st.integers(0, len(looks)))
    target = np.array([who for who, _ in looks], dtype=int)
    seen = np.array([hit for _, hit in looks], dtype=bool)
    memory = no_looks_yet(n, 4)
    first, memory = declare_looks(target[:cut], seen[:cut], m, n, memory)
    second, memory = declare_looks(target[cut:], seen[cut:], m, n, memory)
    declared = np.concatenate((first, second))
    for who in range(4):
        mine = seen[target == who]
        assert declared[target == who].tolist() == by_hand(mine.tolist(), m, n)
        padded = np.concatenate((np.zeros(n - 1, dtype=bool), mine))
        assert memory[who].tolist() == padded[len(padded) - (n - 1) :].tolist()


def test_scans_of_every_target_in_windows_of_any_size():
    seen = np.random.Generator(np.random.PCG64(4)).random((50, 7)) < 0.4
    whole, after = declare(seen, 3, 5, no_looks_yet(5, 7))
    assert whole[:, 2].tolist() == by_hand(seen[:, 2].tolist(), 3, 5)
    for size in (1, 3, 50):
        memory, parts = no_looks_yet(5, 7), []
        for start in range(0, 50, size):
            part, memory = declare(seen[start : start + size], 3, 5, memory)
            parts.append(part)
        np.testing.assert_array_equal(np.concatenate(parts), whole)
        np.testing.assert_array_equal(memory, after)


def test_one_of_one_is_the_detection_itself():
    seen = np.array([[True, False], [False, True]])
    declared, memory = declare(seen, 1, 1, no_looks_yet(1, 2))
    np.testing.assert_array_equal(declared, seen)
    assert memory.shape == (2, 0)
    assert declare(np.empty((0, 3)), 2, 3, no_looks_yet(3, 3))[0].shape == (0, 3)
    assert declare(np.empty((2, 0)), 2, 3, no_looks_yet(3, 0))[0].shape == (2, 0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: declare([[True]], 3, 2, no_looks_yet(2, 1)), "m is 3: .*at most n, 2"),
        (lambda: declare([[True]], 1.5, 2, no_looks_yet(2, 1)), "m is 1.5"),
        (lambda: no_looks_yet(0, 1), "n is 0"),
        (lambda: declare([True], 1, 2, no_looks_yet(2, 1)), r"\(scans, targets\)"),
        (lambda: declare([[True]], 1, 2, no_looks_yet(3, 1)), "memory has the shape"),
        (lambda: declare_looks([1], [True], 1, 2, no_looks_yet(2, 1)), "target is 1"),
        (lambda: declare_looks([0], [True, False], 1, 2, no_looks_yet(2, 1)), "must be"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()
