"""Columns that hold the same in all rows."""

import numpy as np
import pytest

from dsa_des.arrays.column_values import constant_column, first_row_if_stored_once, is_stored_once


@pytest.mark.parametrize("value", [3.5, [1.0, -0.0, np.nan], [[1.0, 2.0]]])
def test_one_value_or_row_is_seen_in_all_rows_and_is_nobodys_to_change(value):
    one = np.array(value)
    column = constant_column(one, 4, np.float64)
    assert column.tobytes() == np.stack([one] * 4).tobytes()
    assert is_stored_once(column) and first_row_if_stored_once(column).tobytes() == one.tobytes()
    with pytest.raises(ValueError, match="read-only"):
        column[0] = 7.0
    one[...] = 9.0  # what it was made of does not count any more
    assert not (column == 9.0).any()
