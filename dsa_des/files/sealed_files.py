"""Files of a folder that a stranger may have filled: only our own, whole ones are read.

No link is followed and no pipe waited for. A Parquet file carries a digest of itself and of what it
belongs to: a key of its footer holds the SHA-256 of the whole file, taken with zeros in the place
of the value, and of a text that says whose file it is. So each part is its own manifest, written
in one go with what it vouches for, and one look tells a file that is damaged, cut short, renamed or
of another study; any other reader of Parquet sees a key that it may ignore.
"""

import hashlib
import io
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_NO_WAIT = getattr(os, "O_NONBLOCK", 0)
_BINARY = getattr(os, "O_BINARY", 0)


def read_regular_file(path: Path, most: int | None = None) -> bytes:
    """Return a regular file's content; OSError if it is not one or has more than `most` bytes.

    `most` is the largest size in bytes.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | _NO_FOLLOW | _NO_WAIT | _BINARY), "rb") as file:
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise OSError(22, "is no regular file", str(path))
        if most is not None and about.st_size > most:
            raise OSError(27, f"is larger than {most:,} bytes", str(path))
        return file.read()


def open_lock_file(path: Path) -> int:
    """Open a lock file, which is made if it does not exist, and return its file descriptor."""
    number = os.open(path, os.O_RDWR | os.O_CREAT | _NO_FOLLOW | _NO_WAIT, 0o666)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(22, "is no regular file", str(path))
    return number


_KEY = b"dsa_des.sha256"
_DIGITS = 64
#: The key as Thrift's compact protocol writes it, then a text of 64 bytes.
_MARK = _KEY + bytes([0x18, _DIGITS])
_ZEROS = b"0" * _DIGITS


#: What is said of the rows of a file as a whole.
ABOUT = b"dsa_des.about"


def sealable_parquet(table: "pa.Table", about: bytes = b"") -> bytes:
    """Return a table as the bytes of a Parquet file with empty space for a seal.

    `about` says something of all its rows; it stands in the metadata of the table that is read.
    """
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    said = {ABOUT: about} if about else {}
    marked = table.replace_schema_metadata({_KEY: _ZEROS, **said})
    # Arrow's own copy of the schema holds the key again, but encoded: the zeros stay there.
    pq.write_table(marked, buffer, compression="zstd")
    return buffer.getvalue()


def seal_parquet(content: bytes, owner: str) -> bytes:
    """Return the bytes of a `sealable_parquet` file with its digest and owner written into it."""
    index = _seal_start(content)
    if index is None:
        raise ValueError("cannot be sealed: it was not written by parquet()")
    digest = _seal_digest(content, index, owner)
    return content[:index] + digest + content[index + _DIGITS :]


def is_sealed(content: bytes, owner: str) -> bool:
    """Return whether a file's bytes have a valid seal for `owner`."""
    index = _seal_start(content)
    if index is None:
        return False
    return content[index : index + _DIGITS] == _seal_digest(content, index, owner)


def _seal_start(content: bytes) -> int | None:
    # The last one: names of columns and their least values, which stand before, may hold the mark.
    start = content.rfind(_MARK)
    end = start + len(_MARK) + _DIGITS
    return None if start < 0 or end > len(content) else start + len(_MARK)


def _seal_digest(content: bytes, index: int, owner: str) -> bytes:
    digest = hashlib.sha256(owner.encode() + b"\0")
    digest.update(memoryview(content)[:index])
    digest.update(_ZEROS)
    digest.update(memoryview(content)[index + _DIGITS :])
    return digest.hexdigest().encode()
