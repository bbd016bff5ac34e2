"""Reading a table of a run row group by row group: no table is ever in memory as a whole."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

#: Columns that are read as codes and names.
TEXT = ("block", "target", "sensors")


class RowGroups:
    """The row groups of a Parquet file.

    Parameters
    ----------
    file : pyarrow.parquet.ParquetFile or None
        None stands for a table without rows.
    """

    def __init__(self, file: Any) -> None:
        self._file = file

    def __len__(self) -> int:
        return 0 if self._file is None else int(self._file.num_row_groups)

    def read(self, number: int, columns: Sequence[str]) -> dict[str, Any]:
        """Return columns of a row group as arrays, text as codes (-1 is null) and names."""
        table = self._file.read_row_group(number, columns=list(columns))
        return {name: _array(table[name], name in TEXT) for name in columns}

    def last(self, number: int, column: str) -> Any:
        """Return the last value of a column in a row group."""
        return self.read(number, [column])[column][-1]


@contextmanager
def row_groups(path: Path, columns: Sequence[str]) -> Iterator[RowGroups]:
    """Open a table, to read some of its columns; one that is not there has no rows."""
    if not path.is_file():
        yield RowGroups(None)
        return
    import pyarrow.parquet as pq

    text = [name for name in columns if name in TEXT]
    with pq.ParquetFile(path, read_dictionary=text) as file:
        yield RowGroups(file)


def each_row_group(path: Path, columns: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Give columns of each row group that has rows, in order; see `RowGroups.read`."""
    with row_groups(path, columns) as groups:
        for number in range(len(groups)):
            rows = groups.read(number, columns)
            if len(rows["time_s"]):
                yield rows


def _array(column: Any, text: bool) -> Any:
    if not text:
        return column.combine_chunks().to_numpy(zero_copy_only=False)
    if column.num_chunks > 1:
        column = column.unify_dictionaries()
    chunks = column.chunks
    codes = [chunk.indices.fill_null(-1).to_numpy(zero_copy_only=False) for chunk in chunks]
    if not codes:
        return np.empty(0, dtype=np.int64), []
    return np.concatenate(codes).astype(np.int64), chunks[0].dictionary.to_pylist()
