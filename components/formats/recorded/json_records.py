"""Read records in JSON, a list of them or one in each line, with the columns of a table."""

from collections.abc import Iterator
from typing import Any

from components.formats.csv_file import known_among, record_rows
from components.formats.receiver_logs import UNKNOWN_JSON, json_documents
from components.formats.recording import Recording
from components.formats.sample_columns import Altitude
from components.formats.text_rows import Problems


def is_json(data: bytes) -> bool:
    """Tell whether some content begins as JSON does."""
    return data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"["))


def record_json(
    problems: Problems,
    data: bytes,
    ownship: str | None = None,
    altitude: Altitude | None = None,
    stem: str | None = None,
) -> Recording:
    """Return the aircraft of records, in a list or a line each, with the columns of a table."""
    records = _records(problems, data)
    first = next(records, (1, None))[1]
    if first is None or known_among(map(str, first)) < _FEWEST:
        problems.fail(UNKNOWN_JSON)
    headers = [str(key) for key in first]
    keys = list(headers)

    def rows() -> Iterator[tuple[int, list[str]]]:
        for number, one in _records(problems, data):
            yield (
                number,
                [
                    value if isinstance(value, str) else "" if value is None else repr(value)
                    for value in map(one.get, keys)
                ],
            )

    return record_rows(
        problems, headers, 1, rows(), ownship, altitude, stem, kind="records in JSON"
    )


#: Of the columns of a table, as many must be there.
_FEWEST = 3


def _records(problems: Problems, data: bytes) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, document in json_documents(problems, data):
        for one in document if isinstance(document, list) else [document]:
            if not isinstance(one, dict):
                problems.fail(UNKNOWN_JSON, line=number)
            yield number, one
