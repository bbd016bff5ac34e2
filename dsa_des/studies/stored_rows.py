"""The rows of a study's parts, read part by part: however many there are, few columns are held."""

from collections import Counter, OrderedDict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, IntArray

if TYPE_CHECKING:
    import pyarrow as pa

    from dsa_des.studies.folder import StudyFolder

#: Bytes of columns that are held at a time; a study of more rows than that holds at least one.
_MOST_BYTES = 2**27
#: Of rows without result, the first ones are told.
MOST_FAILED = 50
_PLACE = ("cell", "replica")
#: Columns that stand in no statistics.
_ABOUT = ("status", "error", "command")


class StoredRows:
    """The rows with a result, in order of cell and replica, and what became of the others.

    Parameters
    ----------
    folder : StudyFolder
        With results.
    before_round : int, optional
        Only those of earlier rounds.

    Raises
    ------
    UsageError
        If there are none, or if a part is damaged or of another study.
    """

    def __init__(self, folder: "StudyFolder", before_round: int | None = None) -> None:
        self._folder, self._before_round = folder, before_round
        schema = folder.record.schema_of_parts()
        self.names = [field.name for field in schema if field.name not in _ABOUT]
        #: Status → how many runs ended in it.
        self.status: Counter[str] = Counter()
        #: The first rows without result, and the first row of all, as column → value.
        self.failed: list[dict[str, Any]] = []
        self.first: dict[str, Any] = {}
        self._order: IntArray | None = None
        self._held: OrderedDict[str, AnyArray] = OrderedDict()
        rows = max(1, folder.record.cells * folder.record.replicas)
        self._at_once = max(3, _MOST_BYTES // (8 * rows))
        others = [name for name in self.names if name not in _PLACE]
        self._read([*_PLACE, *others[: self._at_once - len(_PLACE)]], look=True)

    def __len__(self) -> int:
        return self._count

    def column(self, name: str) -> AnyArray:
        """Return a column; missing numbers are NaN, missing texts None."""
        if name not in self._held:
            place = self.names.index(name)
            others = [n for n in self.names[place:] if n not in self._held]
            self._read(others[: self._at_once], look=False)
        self._held.move_to_end(name)
        return self._held[name]

    def _read(self, names: Sequence[str], *, look: bool) -> None:
        """Read columns of all parts; `look` also at what became of the runs."""
        while self._held and len(self._held) + len(names) > self._at_once:
            self._held.popitem(last=False)
        columns = None if look else [*names, "error"]
        pieces: dict[str, list[Any]] = {name: [] for name in names}
        for table in self._folder.each_part(self._before_round, columns):
            good = np.asarray(table["error"].is_null())
            if look:
                self._look(table, good)
            kept = table if good.all() else table.filter(good)
            for name, found in pieces.items():
                found.append(_codes(kept[name].combine_chunks()))
        if look:
            cell, replica = (_joined(pieces[name]) for name in _PLACE)
            self._count = len(cell)
            later = (np.diff(cell) > 0) | ((np.diff(cell) == 0) & (np.diff(replica) > 0))
            self._order = None if later.all() else np.lexsort((replica, cell))
        for name in names:
            column = _joined(pieces.pop(name))
            self._held[name] = column if self._order is None else column[self._order]

    def _look(self, table: "pa.Table", good: BoolArray) -> None:
        self.status.update(table["status"].to_pylist())
        places = table.select(_PLACE).to_pydict()
        least = min(range(table.num_rows), key=lambda k: tuple(places[name][k] for name in _PLACE))
        self.first = min(
            (row for row in (self.first, table.slice(least, 1).to_pylist()[0]) if row), key=_place
        )
        if not good.all():
            bad = table.filter(~good).slice(0, MOST_FAILED).to_pylist()
            self.failed = sorted([*self.failed, *bad], key=_place)[:MOST_FAILED]


def _place(row: dict[str, Any]) -> tuple[int, int]:
    return row["cell"], row["replica"]


def _codes(values: "pa.Array") -> Any:
    """Return numbers as an array, texts as Arrow's codes of them: each text is held once."""
    import pyarrow as pa

    if pa.types.is_string(values.type):
        return values.dictionary_encode()
    return values.to_numpy(zero_copy_only=False)


def _joined(pieces: list[Any]) -> AnyArray:
    if not pieces or isinstance(pieces[0], np.ndarray):
        return np.concatenate(pieces) if pieces else np.empty(0)
    texts: dict[str, str] = {}
    found = []
    for piece in pieces:
        names = [texts.setdefault(name, name) for name in piece.dictionary.to_pylist()]
        place = piece.indices.fill_null(len(names)).to_numpy(zero_copy_only=False)
        found.append(np.array([*names, None], dtype=object)[place])
    joined: AnyArray = np.concatenate(found)
    return joined
