"""The table files that an aircraft names, and their content."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import PlainSerializer, PlainValidator, TypeAdapter

from dsa_des.block.component import ScenePath
from dsa_des.files.input_files import InputFileError, cache_file_reads, readable_file_status
from dsa_des.text.safe_text import shorten

#: A table of every degree in both angles is a hundredth of it.
LARGEST_TABLE_BYTES = 64 * 1024 * 1024

_PATH: TypeAdapter[Path] = TypeAdapter(ScenePath)


@dataclass(frozen=True, eq=False)
class TableFile:
    """A file's table, read when the scene is checked, so that it cannot stop a run half-way.

    It is an `RcsTable` or a `SilhouetteTable` of `components.aircraft.aspect_tables`.
    """

    path: Path
    table: Any


def _read_rcs_table(path: Path) -> Any:
    from components.aircraft.aspect_tables import RcsTable

    return RcsTable.from_csv(path)


def _read_silhouette_table(path: Path) -> Any:
    from components.aircraft.aspect_tables import read_silhouette_table

    return read_silhouette_table(path)


@cache_file_reads(64)
def _read_table_file(path: Path, reader: Callable[[Path], Any]) -> TableFile:
    # Aircraft that name the same file share one table, and are looked up in it together.
    readable_file_status(path, LARGEST_TABLE_BYTES)
    return TableFile(path, reader(path))


def _table_file_validator(reader: Callable[[Path], Any]) -> Callable[[Any], TableFile]:
    def validate(value: Any) -> TableFile:
        if isinstance(value, TableFile):
            return value
        path = _PATH.validate_python(value)
        name = shorten(str(path), 300)
        try:
            return _read_table_file(path, reader)
        except InputFileError as error:
            raise ValueError(f"must be a table that can be read: {name}: {error}") from None

    return validate


_AS_PATH = PlainSerializer(lambda file: str(file.path))

#: A CSV file with the columns az_deg, el_deg and dbsm.
RcsTableFile = Annotated[
    TableFile, PlainValidator(_table_file_validator(_read_rcs_table)), _AS_PATH
]

#: A CSV file with the columns az_deg, el_deg and an area.
SilhouetteTableFile = Annotated[
    TableFile, PlainValidator(_table_file_validator(_read_silhouette_table)), _AS_PATH
]
