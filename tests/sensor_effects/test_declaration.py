"""The m-of-n rule against counting by hand, in any division into windows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.declaration import declare_looks, empty_look_memory


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
    memory = empty_look_memory(n, 4)
    first, memory = declare_looks(target[:cut], seen[:cut], m, n, memory)
    second, memory = declare_looks(target[cut:], seen[cut:], m, n, memory)
    declared = np.concatenate((first, second))
    for who in range(4):
        mine = seen[target == who]
        assert declared[target == who].tolist() == by_hand(mine.tolist(), m, n)
        padded = np.concatenate((np.zeros(n - 1, dtype=bool), mine))
        assert memory[who].tolist() == padded[len(padded) - (n - 1) :].tolist()
