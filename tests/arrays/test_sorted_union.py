"""The union of arrays, and what a union of instants knows of its parts."""

import numpy as np
import pytest

from dsa_des.arrays.run_ticks import (
    RunTicks,
    last_position_at_or_before,
    positions_with_found_mask,
    shared_zero_run_numbers,
    union_of_instants,
)
from dsa_des.arrays.sorted_union import sorted_union_and_positions


@pytest.mark.parametrize("seed", range(3))
def test_every_value_once_and_where_it_lies(seed: int) -> None:
    random = np.random.default_rng(seed)
    for lengths in ((5,), (0, 0), (4, 0, 7), (30, 20, 10)):
        # A radar with cells reports targets in no order, and may be the only one that reports.
        parts = [random.integers(0, 25, length) for length in lengths]
        values, places = sorted_union_and_positions(parts)
        assert values.tolist() == sorted({int(one) for part in parts for one in part})
        assert [values[place].tolist() for place in places] == [part.tolist() for part in parts]


@pytest.mark.parametrize("parts", [[7], [7, 7], [7, 7, 7], [7, 7, 5]])
def test_single_values_alike_are_one(parts: list[int]) -> None:
    values, places = sorted_union_and_positions([np.array([part]) for part in parts])
    assert values.tolist() == sorted(set(parts)) and values.dtype == np.int64
    assert [values[place].tolist() for place in places] == [[part] for part in parts]


@pytest.mark.parametrize("runs", [1, 3])
def test_a_union_knows_its_parts_and_no_others(runs: int) -> None:
    random = np.random.default_rng(runs)
    for _ in range(4):
        parts = []
        for _ in range(3):
            run = np.sort(random.integers(0, runs, 40))
            tick = random.integers(0, 60, 40)
            order = np.lexsort((tick, run))
            known = RunTicks(shared_zero_run_numbers(40) if runs == 1 else run, tick[order])
            parts.append(known)
        every = union_of_instants(parts)
        pairs = list(zip(every.run.tolist(), every.tick.tolist(), strict=True))
        assert union_of_instants(parts[::-1]) is every
        assert union_of_instants(parts[:2]) is not every
        for part in parts:
            # Equal to the part, but not the same: it is searched for.
            twin = RunTicks(part.run, part.tick.copy())
            asked = list(zip(part.run.tolist(), part.tick.tolist(), strict=True))
            for instants in (part, twin):
                assert last_position_at_or_before(every, instants).tolist() == [
                    pairs.index(p) for p in asked
                ]
                place, there = positions_with_found_mask(every, instants)
                assert there is None
                assert [pairs[row] for row in place.tolist()] == asked
        with pytest.raises(ValueError, match="read-only"):
            last_position_at_or_before(every, parts[0])[0] = (
                7  # the next who asks is given the same
            )
