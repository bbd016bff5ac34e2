"""What is kept in memory takes less room than its rows, and comes back bit by bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from dsa_des.arrays.column_values import Text
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.sinks import ColumnSink, MemorySink

SCHEMA = {
    "small": "int64", "large": "int64", "same": "float64", "zeros": "float64",
    "measured": "float64", "flag": "bool", "name": "text",
}  # fmt: skip


def rows(count: int, seed: int) -> dict[str, Any]:
    """Return columns as a recorder hands them on, with what narrowing could lose."""
    rng = np.random.default_rng(seed)
    large = rng.integers(-(2**63), 2**63 - 1, count)
    large[:2] = -(2**63), 2**63 - 1
    return {
        "small": rng.integers(-128, 128, count),
        "large": large,
        "same": np.broadcast_to(0.1, count),
        "zeros": np.where(rng.uniform(size=count) < 0.5, 0.0, -0.0),
        "measured": rng.normal(size=count),
        "flag": rng.uniform(size=count) < 0.5,
        "name": Text(rng.integers(-1, 3, count).astype(np.int32), ("a", "b", "c")),
    }


def kept(sink: Any, pieces: dict[str, list[dict[str, Any]]]) -> Any:
    """Return the tables of a sink that took these pieces by turns."""
    sink.open(dict.fromkeys(pieces, SCHEMA))
    for turn in zip(*pieces.values(), strict=True):
        for table, columns in zip(pieces, turn, strict=True):
            sink.write(table, columns)
    return sink.tables()


@pytest.mark.parametrize("counts", [(5000,), (5000, 9000, 7), (3,)])
def test_columns_come_back_bit_by_bit(counts: tuple[int, ...]) -> None:
    first = [rows(count, seed) for seed, count in enumerate(counts)]
    # The second table repeats some columns of the first, and some but for the sign of a zero.
    second = [{**piece, "zeros": -piece["zeros"], "small": piece["small"] + 1} for piece in first]
    pieces = {"first": first, "second": second}
    as_columns, as_arrow = kept(ColumnSink(), pieces), kept(MemorySink(), pieces)
    for table, parts in pieces.items():
        for name in SCHEMA:
            given, back = [part[name] for part in parts], as_columns[table][name]
            if name == "name":
                codes = np.concatenate([text.codes for text in given])
                assert (back.codes.dtype, back.codes.tolist()) == (np.int32, codes.tolist())
                words = [text.names[code] if code >= 0 else None for text in given
                         for code in text.codes.tolist()]  # fmt: skip
                assert as_arrow[table][name].to_pylist() == words
                continue
            dense = np.concatenate(given)
            assert back.dtype == dense.dtype
            assert back.tobytes() == dense.tobytes()
            assert as_arrow[table][name].to_numpy().tobytes() == dense.tobytes()


def test_what_two_tables_share_and_whole_numbers_take_little() -> None:
    piece = rows(8192, 1)
    sink = MemorySink()
    kept(sink, {"first": [piece], "second": [dict(piece)]})
    held = {
        id(values): values.nbytes
        for parts in sink._parts.values()
        for values in (getattr(v, "codes", v) for v in parts[0].values())
        if values.strides[0]
    }
    # Three columns of 8 bytes in a row, and three of one; names share codes, which are small.
    assert sum(held.values()) <= 8192 * (3 * 8 + 4)


def test_of_a_table_no_more_than_a_row_group_waits_to_be_written(tmp_path: Path) -> None:
    """Two megabytes of values, whatever the columns: a wide table is written after fewer rows."""
    wide = {"tick": "int64", **{f"c{i}": "float64" for i in range(59)}}
    narrow = {"tick": "int64", "time_s": "float64"}
    sink = ParquetSink(tmp_path)
    sink.open({"wide": wide, "narrow": narrow})
    for turn in range(30):
        for table, schema in (("wide", wide), ("narrow", narrow)):
            ticks = np.arange(5000) + 5000 * turn
            sink.write(table, {n: ticks if n == "tick" else ticks * 0.5 for n in schema})
            waiting = sum(len(piece["tick"]) for piece in sink._pieces[table])
            assert waiting * len(schema) < 2**18
    sink.close()
    for table, size in (("wide", 4096), ("narrow", 65536)):
        file = pq.ParquetFile(tmp_path / f"{table}.parquet")
        groups = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
        assert set(groups[:-1]) == {size} and sum(groups) == 150_000
        assert file.read()["tick"].to_pylist() == list(range(150_000))
