"""Read records in JSON, a list of them or one in each line, with the columns of a table."""

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any

from components.formats.csv_file import count_known_columns, recording_of_rows
from components.formats.receiver_logs import UNKNOWN_JSON, json_documents
from components.formats.recording import Recording
from components.formats.sample_columns import Altitude
from components.formats.text_rows import Problems


def is_json(data: bytes) -> bool:
    """Return whether data begins as JSON does."""
    return data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"["))


def recording_of_json(
    problems: Problems,
    data: bytes,
    ownship: str | None = None,
    altitude: Altitude | None = None,
    stem: str | None = None,
) -> Recording:
    """Return the aircraft of records, in a list or a line each, with the columns of a table."""
    warnings: list[str] = []
    records = _records(problems, data, warnings)
    del data
    begins, first = next(records, (1, None))
    if first is None or count_known_columns(map(str, first)) < _FEWEST:
        problems.fail(UNKNOWN_JSON)
    headers = [str(key) for key in first]
    keys = list(headers)

    def rows() -> Iterator[tuple[int, list[str]]]:
        for number, one in chain([(begins, first)], records):
            yield (
                number,
                [
                    value if isinstance(value, str) else "" if value is None else repr(value)
                    for value in map(one.get, keys)
                ],
            )

    recording = recording_of_rows(
        problems, headers, 1, rows(), ownship, altitude, stem, kind="records in JSON"
    )
    recording.notes.warnings += warnings
    return recording


#: Of the columns of a table, as many must be there.
_FEWEST = 3


def _records(
    problems: Problems, data: bytes, warnings: list[str]
) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, document in json_documents(problems, data, warnings):
        for one in _records_of_document(document):
            if not isinstance(one, dict):
                problems.fail(UNKNOWN_JSON, line=number)
            yield number, one


def _records_of_document(document: Any) -> Iterable[Any]:
    """Return a JSON document's records: itself, or the rows of a table pandas wrote by columns."""
    if isinstance(document, dict):
        columns, rows = document.get("columns"), document.get("data")
        if columns is not None and isinstance(rows, Iterable):
            return (dict(zip(map(str, columns), row, strict=False)) for row in rows)
        first = next(iter(document.values()), None)
        if first and all(isinstance(one, dict) for one in document.values()):
            return ({name: one.get(k) for name, one in document.items()} for k in first)
    return [document]
