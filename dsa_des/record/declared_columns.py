"""Columns that messages declare: what was not declared is an error, not a column less."""

from collections.abc import Iterable, Mapping

from dsa_des.block.recorded_columns import Schema
from dsa_des.errors import nearest

# Declared names that an error lists.
_MOST_NAMES = 30


class DeclaredColumns:
    """The tables of a run's messages with their columns, also those that are not wanted.

    Parameters
    ----------
    schemas : mapping
        Table → column → kind.
    leading : collection of str
        Columns that the engine adds.
    """

    def __init__(self, schemas: Mapping[str, Schema], leading: Iterable[str]) -> None:
        self._columns = {table: frozenset(schema) for table, schema in schemas.items()}
        self._leading = frozenset(leading)
        #: By block and table, the columns that were found to be declared.
        self._sound: dict[tuple[str, str], tuple[str, ...]] = {}

    def check(self, block: str, table: str, columns: Iterable[str], message: str) -> None:
        """Refuse what would be lost without a word; the same columns again cost nothing.

        Parameters
        ----------
        block : str
            Who sends.
        table : str
        columns : iterable of str
        message : str
            Name of the message's class.

        Raises
        ------
        ValueError
            If no message of the run declares the table or the column, or the table has no
            instants.
        """
        names = tuple(columns)
        if self._sound.get((block, table)) == names:
            return
        where = f"block {block!r}: its {message} records"
        how = "; a message class declares what it records, table by table, in `recorded`"
        known = self._columns.get(table)
        if known is None:
            raise ValueError(
                f"{where} a table {table!r} that no message of the run declares"
                f"{_nearest_and_all(table, self._columns)}{how}"
            )
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ValueError(
                f"{where} a column {unknown[0]!r} in table {table!r} that no message of the run "
                f"declares{_nearest_and_all(unknown[0], known - self._leading)}{how}"
            )
        if "tick" not in names:
            raise ValueError(f"{where} a table {table!r} without a column 'tick'")
        self._sound[block, table] = names


def _nearest_and_all(name: str, declared: Iterable[str]) -> str:
    """Return the declared name nearest to one that is not, and what is declared."""
    names = sorted(declared)
    close = nearest(name, names)
    shown = ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")
    asked = "" if close is None else f"; did you mean {close!r}?"
    return f"{asked} (declared: {shown or 'nothing'})"
