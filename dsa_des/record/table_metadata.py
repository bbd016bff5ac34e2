"""What recorded tables say of themselves: the run they are of, and the meaning of each column."""

import base64
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dsa_des.block.message import Column, Message, derive_columns
from dsa_des.block.recorded_columns import LEADING, ON_PLATFORM
from dsa_des.record.version import __version__

if TYPE_CHECKING:
    import pyarrow as pa


#: Metadata of a column: the table to whose rows its values belong, joined by block and tick.
OF_ROWS = b"of_rows"


@dataclass(frozen=True)
class Notes:
    """Metadata of the tables of a run.

    Parameters
    ----------
    run : mapping
        ``dsa_des_version``, ``seed``, ``scene_sha256`` (as in run.json) and ``ticks_per_s``.
    meanings : mapping
        Table → column, as messages declare them; empty texts are left out.
    rows_of : mapping
        Table → column → the table whose rows it belongs to as well.
    """

    run: Mapping[str, str]
    meanings: Mapping[str, Mapping[str, Column]]
    rows_of: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def with_metadata(self, table: str, schema: "pa.Schema") -> "pa.Schema":
        """Return an Arrow schema with metadata on the run and columns (unit, frame, meaning)."""
        import pyarrow as pa

        described, rows_of = self.meanings.get(table, {}), self.rows_of.get(table, {})
        fields = []
        for item in schema:
            unit, frame, meaning, _ = described.get(item.name, Column())
            known = {"unit": unit, "frame": frame, "meaning": meaning}
            known[OF_ROWS.decode()] = rows_of.get(item.name, "")
            said = {name: text for name, text in known.items() if text}
            fields.append(item.with_metadata(said) if said else item)
        return pa.schema(fields, metadata={"table": table, **self.run})

    def parquet_metadata(self, table: str, schema: "pa.Schema") -> dict[str, str]:
        """Return the key-value metadata of a table's Parquet file.

        Beside those of the run there is Arrow's own schema, which alone has metadata by column.
        """
        described = self.with_metadata(table, schema)
        arrow = base64.b64encode(described.serialize().to_pybytes()).decode()
        return {"table": table, **self.run, "ARROW:schema": arrow}

    def tables_with_metadata(self, tables: Mapping[str, Any]) -> "dict[str, pa.Table]":
        """Return tables by name as Arrow tables with metadata on the run and each column."""
        import pyarrow as pa

        return {
            name: pa.Table.from_arrays(
                list(table.itercolumns()), schema=self.with_metadata(name, table.schema)
            )
            for name, table in tables.items()
        }


def metadata_of_run(
    messages: Iterable[type[Message]], scene_text: str, seed: int, ticks_per_s: int
) -> Notes:
    """Return the table metadata of a run with these messages and resolved `scene_text`."""
    meanings: dict[str, dict[str, Column]] = {}
    rows_of: dict[str, dict[str, str]] = {}
    for message in messages:
        for table, columns in message.recorded.items():
            meanings.setdefault(table, {**LEADING, **ON_PLATFORM}).update(columns)
        rows_of.setdefault(message.row_table, {}).update(derive_columns(message).for_entries)
    run = {
        "dsa_des_version": __version__,
        "seed": str(seed),
        "scene_sha256": hashlib.sha256(scene_text.encode()).hexdigest(),
        "ticks_per_s": str(ticks_per_s),
    }
    return Notes(run, meanings, rows_of)
