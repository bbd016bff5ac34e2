"""Arrays that grow at their end: each state stays, and adding does not move all again."""

import numpy as np

from dsa_des.arrays.growing_arrays import Growing, GrowingArray


def test_each_state_stays_and_values_are_moved_a_few_times_only():
    states = [GrowingArray(np.zeros((2, 0)))]
    for k in range(1000):
        states.append(states[-1].with_appended(np.array([[k], [-k]])))
    for k in (0, 1, 500, 1000):
        assert np.array_equal(states[k].values, np.outer([1, -1], np.arange(k)))
    # By doubling, 1,000 additions need 10 rooms; memory of its own for each would be 1,000.
    assert len({id(state._room) for state in states[1:]}) <= 10


def test_two_that_grew_out_of_one_do_not_see_each_others():
    one = GrowingArray(np.asfortranarray(np.ones((3, 2)))).with_appended(np.full((3, 1), 2.0))
    left, right = one.with_appended(np.full((3, 2), 3.0)), one.with_appended(np.full((3, 1), 4.0))
    assert left.values[0].tolist() == [1, 1, 2, 3, 3]
    assert right.values[0].tolist() == [1, 1, 2, 4]
    assert left.with_appended(np.full((3, 1), 5.0)).values[0].tolist() == [1, 1, 2, 3, 3, 5]
    # Columns that lie together in memory stay so.
    assert one.values.T.flags.c_contiguous and right.values.T.flags.c_contiguous


def test_what_holds_some_keeps_them_apart_from_its_copies():
    class Held(Growing):
        names, other = np.array(["a"], dtype=object), 7

    held = Held()
    first = held.with_appended(names=np.array(["b"], dtype=object))
    second = held.with_appended(names=np.array(["c"], dtype=object))
    third = first.with_appended(names=np.array(["d"], dtype=object))
    assert [h.names.tolist() for h in (held, first, second, third)] == [
        ["a"], ["a", "b"], ["a", "c"], ["a", "b", "d"]
    ]  # fmt: skip
    assert third.other == 7
