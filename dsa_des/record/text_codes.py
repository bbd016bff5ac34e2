"""The codes of a text column: short numbers for names, the same in all pieces of the column."""

from collections.abc import Callable

import numpy as np

from dsa_des.arrays.column_values import Columns, Text, constant_column
from dsa_des.arrays.types import AnyArray


class TextCodes:
    """All names a text column has had, with translations of each piece's codes into theirs."""

    def __init__(self, column: str, of_block: Callable[[str], str | None] | None) -> None:
        #: Of each block what its rows hold; None of columns that messages fill.
        self._column, self._of_block = column, of_block
        self._code: dict[str, int] = {}
        #: By identity of a tuple of names, which is kept so that the identity stays its own.
        self._lookups: dict[int, tuple[tuple[str, ...], AnyArray]] = {}
        self.names: tuple[str, ...] = ()

    def translate_codes(self, block: str, columns: Columns) -> AnyArray:
        """Return the codes of one piece's text column as codes into `names`; -1 is null."""
        count = len(columns["tick"])
        if self._of_block is not None:
            name = self._of_block(block)
            code = -1 if name is None else self._code_lookup((name,))[0]
            return constant_column(code, count, "int32")
        text = columns.get(self._column)
        if text is None:
            return constant_column(-1, count, "int32")
        if not isinstance(text, Text):
            raise TypeError(f"column {self._column!r} must be Text")
        return self._code_lookup(text.names).take(
            text.codes, mode="wrap"
        )  # -1 takes the last entry

    def _code_lookup(self, names: tuple[str, ...]) -> AnyArray:
        known = self._lookups.get(id(names))
        if known is not None and known[0] is names:
            return known[1]
        codes = [self._code.setdefault(name, len(self._code)) for name in names]
        lookup = np.array([*codes, -1], dtype=np.int32)
        if len(self._lookups) > 1000:  # tuples made anew for every message
            self._lookups.clear()
        self._lookups[id(names)] = names, lookup
        if len(self._code) > len(self.names):
            self.names = tuple(self._code)
        return lookup
