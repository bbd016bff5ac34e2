"""Parquet files that carry a digest of themselves and of what they belong to.

The footer has a key whose value is the SHA-256 of the whole file, taken with zeros in the place of
the value, and of a text that says whose file it is. So one look tells a file that is damaged, cut
short, renamed or of another study; any other reader of Parquet sees a key that it may ignore.
"""

import hashlib
import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

_KEY = b"dsa_des.sha256"
_DIGITS = 64
#: The key as Thrift's compact protocol writes it, then a text of 64 bytes.
_MARK = _KEY + bytes([0x18, _DIGITS])
_ZEROS = b"0" * _DIGITS


def parquet(table: "pa.Table") -> bytes:
    """Return a table as the bytes of a Parquet file that can be sealed."""
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    marked = table.replace_schema_metadata({_KEY: _ZEROS})
    # Arrow's own copy of the schema holds the key again, but encoded: the zeros stay there.
    pq.write_table(marked, buffer, compression="zstd")
    return buffer.getvalue()


def sealed(content: bytes, owner: str) -> bytes:
    """Return a file of `parquet` with its digest; `owner` says whose it is."""
    place = _place(content)
    if place is None:
        raise ValueError("cannot be sealed: it was not written by parquet()")
    digest = _digest(content, place, owner)
    return content[:place] + digest + content[place + _DIGITS :]


def is_sealed(content: bytes, owner: str) -> bool:
    """Return whether these are the bytes that were sealed for `owner`."""
    place = _place(content)
    if place is None:
        return False
    return content[place : place + _DIGITS] == _digest(content, place, owner)


def _place(content: bytes) -> int | None:
    # The last one: names of columns and their least values, which stand before, may hold the mark.
    start = content.rfind(_MARK)
    end = start + len(_MARK) + _DIGITS
    return None if start < 0 or end > len(content) else start + len(_MARK)


def _digest(content: bytes, place: int, owner: str) -> bytes:
    found = hashlib.sha256(owner.encode() + b"\0")
    found.update(memoryview(content)[:place])
    found.update(_ZEROS)
    found.update(memoryview(content)[place + _DIGITS :])
    return found.hexdigest().encode()
