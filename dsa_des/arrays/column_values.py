"""Values of recorded columns: numbers, text as codes, instants as ticks, and what is known of them.

A column that is the same in all rows, or null, is one number seen many times: who asks need not
look at the rows.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, IntArray


@dataclass(frozen=True, eq=False)
class Text:
    """A text column kept as codes into a tuple of names (code -1 is null).

    Parameters
    ----------
    codes : ndarray of int
    names : tuple of str
    """

    codes: AnyArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.codes)


@dataclass(frozen=True, eq=False)
class Instants:
    """A column of instants: ticks, which are recorded as seconds since the start of the run.

    Parameters
    ----------
    ticks : ndarray of int64
    ticks_per_s : int
        As the message knows it (its field of that name, 10⁹ without one); a recorder knows it
        itself. A single value is given in seconds.
    """

    ticks: IntArray
    ticks_per_s: int = 10**9

    def __len__(self) -> int:
        return len(self.ticks)

    def __getitem__(self, rows: Any) -> Any:
        if isinstance(rows, int):
            return self.ticks[rows] / self.ticks_per_s
        return Instants(self.ticks[rows], self.ticks_per_s)


#: Recorded columns by name, and what kind each is: "int64", "float64", "bool" or "text".
#: In float64, NaN means null.
#: Beside arrays and text, `Instants` on the way to a recorder and its sinks.
Columns = dict[str, AnyArray | Text]
Schema = dict[str, str]


def instants_to_seconds(values: Any) -> Any:
    """Convert instants to seconds since the start of their run; return other columns unchanged."""
    return values.ticks / values.ticks_per_s if isinstance(values, Instants) else values


def shared_nan_column(rows: int) -> AnyArray:
    """Return a float64 column of `rows` NaN values, which are stored once."""
    return _NANS[:rows]


def is_shared_nan_column(values: Any) -> bool:
    """Return whether a column is the shared NaN column (all rows null); values are not examined."""
    return isinstance(values, np.ndarray) and values.base is _NAN


def has_same_bits(some: AnyArray, others: AnyArray) -> bool:
    """Return whether two columns are equal bit by bit: NaN equals NaN, 0.0 is not -0.0."""
    if some.dtype != others.dtype or len(some) != len(others):
        return False
    bits = _BITS[some.itemsize]
    some, others = some.view(bits), others.view(bits)
    if some[0] != others[0] or some[-1] != others[-1]:
        return False
    return not (some.strides[0] or others.strides[0]) or bool((some == others).all())


def has_only_value(values: AnyArray, one: AnyArray) -> bool:
    """Return whether all rows have the bits of `one`, shape (1,); NaN equals NaN, 0.0 not -0.0."""
    if values.dtype != one.dtype:
        return False
    bits = _BITS[one.itemsize]
    values, value = values.view(bits), one.view(bits)[0]
    if values[-1] != value or values[0] != value:
        return False
    return not values.strides[0] or bool((values == value).all())


def constant_column(value: Any, rows: int, kind: Any) -> AnyArray:
    """Return a read-only column of `rows` times `value`, stored once (stride 0)."""
    one = np.array(value, dtype=kind)
    one.flags.writeable = False
    shape, strides = (rows, *one.shape), (0, *one.strides)
    column: AnyArray = np.ndarray(shape, one.dtype, buffer=one, strides=strides)
    return column


def is_stored_once(values: AnyArray) -> bool:
    """Return whether a column stores one value for all rows (stride 0), not equal values by row."""
    return not values.strides[0]


def first_row_if_stored_once(values: AnyArray) -> AnyArray:
    """Return the first row of a column with one stored value (stride 0); others unchanged."""
    return values if values.strides[0] else values[:1]


def store_once_if_equal(values: AnyArray) -> AnyArray:
    """Return a long column of equal rows as one stored value; return other columns unchanged."""
    if len(values) < _MANY:
        return values
    same = has_only_value(values, values[:1])
    return constant_column(values[0], len(values), values.dtype) if same else values


def take_rows(values: AnyArray, rows: IntArray) -> AnyArray:
    """Return a column's rows at the indices; one stored value stays one stored value."""
    if len(values) and is_stored_once(values):
        if len(rows) <= len(values):  # a part of it is made in no time
            return values[: len(rows)]
        return constant_column(values[0], len(rows), values.dtype)
    return values.take(rows)


def pick_rows(value: Any, rows: slice | IntArray) -> Any:
    """Return given rows of an array, dict of arrays or object with `take_rows`; None stays None."""
    if value is None:
        return None
    if value.__class__ is np.ndarray:  # nearly all are, and looking for a method costs more
        return value[rows]
    if isinstance(value, dict):
        return {key: pick_rows(item, rows) for key, item in value.items()}
    if hasattr(value, "take_rows"):
        return value.take_rows(rows)
    return value[rows]


def join_values(values: list[Any], counts: list[int]) -> Any:
    """Return the parts' values joined; a part that is None becomes as many nulls as in `counts`."""
    if {*map(type, values)} == {np.ndarray}:  # nearly all are
        return np.concatenate(values)
    known = next((value for value in values if value is not None), None)
    if known is None:
        return None
    if isinstance(known, dict):
        tables = [value or {} for value in values]
        names = dict.fromkeys(name for table in tables for name in table)
        return {name: join_values([table.get(name) for table in tables], counts) for name in names}
    if hasattr(known, "join_rows"):
        return type(known).join_rows(values)
    # What a wire held before the first message may lack columns that real ones have.
    whole = zip(values, counts, strict=True)
    return np.concatenate(
        [_null_values(known, n) if value is None else value for value, n in whole]
    )


def _null_values(like: AnyArray, count: int) -> AnyArray:
    return np.full(count, np.nan if like.dtype.kind == "f" else 0, dtype=like.dtype)


#: Whole numbers that hold the bits of values of so many bytes.
_BITS = {size: np.dtype(f"u{size}") for size in (1, 2, 4, 8)}

# Of fewer rows, to look whether they are the same costs more than they do.
_MANY = 64

_NAN = np.full((), np.nan)
_NAN.flags.writeable = False
#: As often as a column may have rows: a slice of it is made in no time.
_NANS: AnyArray = np.ndarray((1 << 40,), np.float64, buffer=_NAN, strides=(0,))
