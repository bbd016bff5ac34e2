"""Rows that are read part by part, few columns at a time, are those of the whole table."""

from collections.abc import Iterator, Sequence
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from dsa_des.results import rows as rows_of_parts
from dsa_des.results.rows import StoredRows


class _Folder:
    """Parts of two rounds over two cells, so that they are not in order; some runs failed."""

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.read: list[list[str]] = []
        self.parts = []
        for number in (0, 1):
            for cell in (0, 1):
                n = 40
                bad = rng.random(n) < 0.4
                self.parts.append(pa.table({
                    "cell": [cell] * n, "replica": np.arange(n) + n * number,
                    **{k: pa.array(np.where(rng.random(n) < 0.1, np.nan, rng.random(n)),
                                   from_pandas=True) for k in "abcd"},
                    "kind": [None if k % 7 == 0 else ("left", "right")[k % 2] for k in range(n)],
                    "status": ["failed" if b else "done" for b in bad],
                    "error": pa.array(["why" if b else None for b in bad], pa.string()),
                    "command": pa.nulls(n, pa.string()),
                }))  # fmt: skip
        schema = self.parts[0].schema
        self.record = SimpleNamespace(cells=2, replicas=80, schema_of_parts=lambda: schema)

    def each_part(
        self, before_round: int | None = None, columns: Sequence[str] | None = None
    ) -> Iterator[pa.Table]:
        self.read.append(list(columns or ()))
        for part in self.parts[: 2 * (2 if before_round is None else before_round)]:
            yield part if columns is None else part.select(columns)


@pytest.mark.parametrize("room", [1, 4 * 8 * 160, 2**20])
def test_columns_are_those_of_the_table(room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows_of_parts, "_MOST_HELD_BYTES", room)
    folder = _Folder()
    rows = StoredRows(folder)  # type: ignore[arg-type]
    whole = pa.concat_tables(folder.parts).sort_by(
        [("cell", "ascending"), ("replica", "ascending")]
    )
    good = whole.filter(whole["error"].is_null())
    assert len(rows) == good.num_rows
    for name in ["d", "kind", "a", "replica", "c", "cell", "b", "kind", "d"]:
        wanted = good[name].to_numpy(zero_copy_only=False)
        if name == "kind":
            assert rows.column(name).tolist() == wanted.tolist()
        else:
            assert np.array_equal(rows.column(name), wanted, equal_nan=True)
        assert len(rows._held) <= max(3, room // (8 * 160))
    assert rows.status == {"done": good.num_rows, "failed": 160 - good.num_rows}
    assert rows.first == whole.slice(0, 1).to_pylist()[0]
    bad = whole.filter(whole["error"].is_valid()).to_pylist()
    assert rows.failed == bad[: rows_of_parts.MOST_FAILED] and len(bad) > rows_of_parts.MOST_FAILED
    assert len(folder.read) == 1 or room < 2**20


def test_later_rounds_are_left_out() -> None:
    rows = StoredRows(_Folder(), before_round=1)  # type: ignore[arg-type]
    assert rows.column("replica").max() < 40 and rows.status.total() == 80
