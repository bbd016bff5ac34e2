"""What recorded tables say of themselves: the run they are of, and the meaning of each column."""

import base64
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dsa_des.block.message import Message
from dsa_des.record.version import __version__

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True)
class Notes:
    """Metadata of the tables of a run.

    Parameters
    ----------
    run : mapping
        ``dsa_des_version``, ``seed``, ``scene_sha256`` (as in run.json) and ``ticks_per_s``.
    meanings : mapping
        Table → column → (unit, frame, meaning), as messages describe them; empty texts are left
        out.
    """

    run: Mapping[str, str]
    meanings: Mapping[str, Mapping[str, tuple[str, str, str]]]

    def schema(self, table: str, schema: "pa.Schema") -> "pa.Schema":
        """Return the schema of a table with metadata of the run, and of each column."""
        import pyarrow as pa

        described = self.meanings.get(table, {})
        names = ("unit", "frame", "meaning")
        fields = []
        for field in schema:
            known = zip(names, described.get(field.name, ("", "", "")), strict=True)
            said = {name: text for name, text in known if text}
            fields.append(field.with_metadata(said) if said else field)
        return pa.schema(fields, metadata={"table": table, **self.run})

    def of_file(self, table: str, schema: "pa.Schema") -> dict[str, str]:
        """Return the key-value metadata of a table's Parquet file.

        Beside those of the run there is Arrow's own schema, which alone has metadata by column.
        """
        described = self.schema(table, schema)
        arrow = base64.b64encode(described.serialize().to_pybytes()).decode()
        return {"table": table, **self.run, "ARROW:schema": arrow}

    def on(self, tables: Mapping[str, Any]) -> "dict[str, pa.Table]":
        """Return Arrow tables with their metadata."""
        import pyarrow as pa

        return {
            name: pa.Table.from_arrays(
                list(table.itercolumns()), schema=self.schema(name, table.schema)
            )
            for name, table in tables.items()
        }


def notes_of(
    messages: Iterable[type[Message]], scene_text: str, seed: int, ticks_per_s: int
) -> Notes:
    """Return what the tables of a run say.

    Parameters
    ----------
    messages : iterable of message types
        What is recorded.
    scene_text : str
        The resolved scene.
    seed, ticks_per_s : int
    """
    meanings: dict[str, dict[str, tuple[str, str, str]]] = {}
    for message in messages:
        for table, described in message.described.items():
            meanings.setdefault(table, {}).update(described)
    run = {
        "dsa_des_version": __version__,
        "seed": str(seed),
        "scene_sha256": hashlib.sha256(scene_text.encode()).hexdigest(),
        "ticks_per_s": str(ticks_per_s),
    }
    return Notes(run, meanings)
