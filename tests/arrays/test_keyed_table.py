"""A keyed table keeps the things of runs apart, as one table for each run would."""

import numpy as np
import pytest

from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence


def a_table(rows):
    """Return the table of (run, thing, value) triples."""
    run, thing, value = np.array(rows, dtype=np.int64).reshape(-1, 3).T
    return KeyedTable(replica=run, thing=thing, value=np.stack([value, -value]))


def rows_of(table):
    assert (table.value[0] == -table.value[1]).all()
    columns = table.replica, table.thing, table.value[0]
    return list(zip(*(column.tolist() for column in columns), strict=True))


@pytest.mark.parametrize("seed", range(20))
def test_what_is_kept_is_what_a_table_of_each_run_keeps(seed):
    """Wakes bring new rows of some runs; runs end from the first on."""
    dice = np.random.default_rng(seed)
    table = KeyedTable.empty({"replica": int, "thing": int, "value": int}, {"value": (2,)})
    apart, first_run = {}, 0
    for _ in range(30):
        first_run = min(first_run + int(dice.random() < 0.2), 4)
        runs = np.flatnonzero(dice.random(6) < 0.4) if seed % 2 else dice.integers(0, 6, 1)
        runs = runs[runs >= first_run]
        if not len(runs):
            continue
        mine = [row for run in runs.tolist() for row in apart.get(run, [])]
        assert rows_of(table.rows_of_runs(runs)) == mine
        new = {run: [(run, k, int(dice.integers(99))) for k in range(dice.integers(4))]
               for run in runs.tolist()}  # fmt: skip
        rows = [row for run in runs.tolist() for row in new[run]]
        table = table.replace_and_drop_earlier_runs(runs, a_table(rows), first_run)
        apart = {run: rows for run, rows in {**apart, **new}.items() if run >= first_run}
        kept = [row for row in rows_of(table) if row[0] >= first_run]
        assert kept == [row for run in sorted(apart) for row in apart[run]]
        others = {row[0] for row in rows_of(table)} - set(runs.tolist())
        assert all(run >= first_run for run in others)


def test_rows_of_a_run_are_continued_where_there_are_any_and_copied():
    old, new = a_table([(1, 5, 7), (3, 5, 8)]), a_table([(0, 0, 0), (1, 0, 0), (3, 0, 0)])
    found = old.kept_rows_or_new(new)
    assert rows_of(found) == [(0, 0, 0), (1, 5, 7), (3, 5, 8)]
    found.thing[:] = 9  # nobody else's
    assert old.thing.tolist() == [5, 5] and new.thing.tolist() == [0, 0, 0]


def test_things_are_put_in_order_of_runs_and_keep_their_order_within():
    assert rows_of(a_table([(2, 1, 0), (0, 9, 0), (2, 0, 0), (0, 1, 0)]).sort()) == [
        (0, 9, 0), (0, 1, 0), (2, 1, 0), (2, 0, 0)]  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "expected"),
    [([], []), ([4], [[0]]), ([7, 2, 7, 7, 2], [[0, 1], [2, 4], [3]]), ([1, 1], [[0], [1]])],
)
def test_every_key_has_its_turn(keys, expected):
    assert [
        rows.tolist() for rows in indices_by_occurrence(np.array(keys, dtype=np.int64))
    ] == expected
