"""Rows of results from tables in memory, and a small study."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from dsa_des.results.rows import Rows
from tests.studies.conftest import small

__all__ = ["small"]


class _Table:
    """As `dsa_des.results.rows.StoredRows`, of a table."""

    def __init__(self, table: pa.Table) -> None:
        self.status = Counter(table["status"].to_pylist())
        self._good = table.filter(np.asarray(table["error"].is_null()))
        self.names = table.column_names

    def __len__(self) -> int:
        return int(self._good.num_rows)

    def column(self, name: str) -> Any:
        return self._good[name].to_numpy(zero_copy_only=False)


def rows_of_table(table: pa.Table, axes: Sequence[str], over: Sequence[str]) -> Rows:
    return Rows(_Table(table), axes, over)  # type: ignore[arg-type]
