"""The message of foreign parts: named values that no message of ours has a field for."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Message, Text, column, static


class Words:
    """Texts, one for each entry of a message."""

    def __init__(self, words: Sequence[str]) -> None:
        self.words = list(words)

    def take_rows(self, rows: slice | IntArray) -> "Words":
        """Return the words of some entries."""
        if isinstance(rows, slice):
            return Words(self.words[rows])
        return Words([self.words[i] for i in rows.tolist()])

    @classmethod
    def join_rows(cls, parts: Sequence["Words"]) -> "Words":
        """Return the words of several messages, one after the other."""
        return cls([word for part in parts for word in part.words])


def _names(message: Any) -> Text:
    return Text(message.signal, message.names)


def _units(message: Any) -> Text:
    known = tuple(dict.fromkeys(message.units))
    code = np.array([known.index(unit) if unit else -1 for unit in message.units], dtype=np.int64)
    return Text(code[message.signal], known)


def _text(message: Any) -> Text:
    known = tuple(sorted(set(message.text.words)))
    code = {word: place if word else -1 for place, word in enumerate(known)}
    return Text(np.array([code[word] for word in message.text.words], dtype=np.int64), known)


@dataclass(eq=False)
class Signals(Message):
    """The values of an external part's outputs at each of its communication points.

    Parameters
    ----------
    offsets : (rows + 1,)
    signal : (entries,) of int
        Index into `names`.
    element : (entries,) of int
        Place in an array, row by row, from 1 on; 0 for what is no array.
    value : (entries,)
        NaN for text.
    text : Words
        Text, bytes as hexadecimal digits, and whole numbers that a float would round; else empty.
    names, units : tuple of str
        Of the signals; the unit as the foreign part writes it.
    """

    entry_table = "signals"

    offsets: IntArray
    signal: IntArray = column("", "", "name of the signal", "text", value=_names)
    element: IntArray = column("", "", "place in an array, from 1; 0 for a single value", "int64")
    value: FloatArray = column("", "", "its value, in its unit; null for text")
    text: Words = column(
        "", "", "text, bytes as hexadecimal digits, whole numbers from 2^53", "text", value=_text
    )
    unit_of: IntArray = column(
        "", "", "unit as the foreign part writes it", "text", name="unit", value=_units,
        default=None, kw_only=True,
    )  # fmt: skip
    names: tuple[str, ...] = static(kw_only=True)
    units: tuple[str, ...] = static(kw_only=True)

    def __post_init__(self) -> None:
        """A unit belongs to its signal."""
        self.unit_of = self.signal

    @classmethod
    def of_rows(
        cls, tick: IntArray, layout: Sequence[tuple[int, int]], values: FloatArray,
        words: Sequence[str], names: tuple[str, ...], units: tuple[str, ...],
    ) -> Self:  # fmt: skip
        """Return signals with the same entries in every row, from a table (rows, entries).

        Parameters
        ----------
        tick : (rows,)
        layout : sequence of (signal, element)
        values : (rows, entries of a row)
        words : sequence of str
            Of all entries.
        names, units : tuple of str
        """
        rows, wide = values.shape
        signal, element = np.array(layout, dtype=np.int64).reshape(-1, 2).T
        return cls(
            tick, np.arange(rows + 1) * wide, np.tile(signal, rows), np.tile(element, rows),
            np.ascontiguousarray(values).reshape(-1), Words(words), names=names, units=units,
        )  # fmt: skip
