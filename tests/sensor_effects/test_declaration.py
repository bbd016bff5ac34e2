"""The m-of-n rule against counting by hand, in any division into windows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.declaration import declare_looks, no_looks_yet


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
    target = np.tile(np.arange(7), (50, 1))
    whole, after = declare_looks(target.ravel(), seen.ravel(), 3, 5, no_looks_yet(5, 7))
    assert whole.reshape(50, 7)[:, 2].tolist() == by_hand(seen[:, 2].tolist(), 3, 5)
    for size in (1, 3, 50):
        memory, parts = no_looks_yet(5, 7), []
        for start in range(0, 50, size):
            some = slice(start, start + size)
            part, memory = declare_looks(target[some].ravel(), seen[some].ravel(), 3, 5, memory)
            parts.append(part)
        np.testing.assert_array_equal(np.concatenate(parts), whole)
        np.testing.assert_array_equal(memory, after)


def test_one_of_one_is_the_detection_itself():
    seen = np.array([True, False, False, True])
    declared, memory = declare_looks(np.array([0, 1, 0, 1]), seen, 1, 1, no_looks_yet(1, 2))
    np.testing.assert_array_equal(declared, seen)
    assert memory.shape == (2, 0)
    nobody = np.empty(0, dtype=np.int64)
    assert len(declare_looks(nobody, seen[:0], 2, 3, no_looks_yet(3, 0))[0]) == 0
