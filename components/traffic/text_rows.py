"""Read a text file into rows of cells, however its writer separated them."""

from __future__ import annotations

import re
from pathlib import Path

from components.traffic.traffic_file import Problems, did_you_mean
from dsa_des.files.input_files import InputFileError, NoSuchFile, is_folder, read_input_bytes

_SEPARATORS = re.compile(r"[,;]")
_TOKEN = re.compile(r"\[[^\]]*\]|[^\s,;\[\]]+")
_TRAFFIC = "a text file with one row per aircraft and time"
_ROWS = "a row of column names and rows of samples"


def read_lines(
    path: Path, problems: Problems, needed: str = _TRAFFIC, holds: str = _ROWS
) -> list[tuple[int, str]]:
    """Read a file's lines that hold something, with their numbers.

    Parameters
    ----------
    path : Path
        The file. UTF-8 (with or without byte-order mark), UTF-16 with one, or Latin-1; lines may
        end in LF, CR LF or CR.
    problems : Problems
        Told when there is no such file, when it is a directory, binary or empty.
    needed, holds : str
        For the messages of a binary and of an empty file: which file is needed, and what in it.

    Returns
    -------
    list of (int, str)
        Line number from 1 and the stripped text; blank lines and lines starting with # left out.
    """
    try:
        data = read_input_bytes(path)
    except NoSuchFile:
        close = [p.name for p in path.parent.glob("*")] if is_folder(path.parent) else []
        problems.fail(f"there is no such file{did_you_mean(path.name, close)}")
    except InputFileError as error:
        if is_folder(path):
            problems.fail("this is a directory: give the file itself")
        problems.fail(f"the file {error}")
    text = _decoded(data)
    if text is None:
        problems.fail(f"this is a binary file: {needed} is needed")
    lines = [
        # Not tabs: one at either end delimits an empty cell.
        (number, line.strip(" "))
        for number, line in enumerate(re.split(r"\r\n|\r|\n", text or ""), start=1)
    ]
    kept = [(n, line) for n, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not kept:
        problems.fail(f"the file is empty: {holds} are needed")
    return kept


def _decoded(data: bytes) -> str | None:
    """Decode text, or return None for something that is none."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encodings = ["utf-16"]
    else:
        encodings = ["utf-8-sig", "latin-1"]
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        control = sum(1 for c in text[:4096] if ord(c) < 32 and c not in "\t\r\n\f\v\x1a")
        # C1 control characters only turn up when bytes that are no text are read as Latin-1.
        control += sum(1 for c in text[:4096] if 0x7F <= ord(c) < 0xA0)
        return None if "\0" in text or control > len(text[:4096]) // 50 else text
    return None


def tokens(line: str) -> list[str]:
    """Split a row of names or units at commas, semicolons and blanks; [m / s] stays together."""
    return _TOKEN.findall(line)


def cells(line: str, count: int, name_column: int) -> list[str] | None:
    """Split a row of values into as many cells as there are columns.

    Commas (or semicolons, or tabs where there are neither) separate first; a cell that holds
    blanks is split further until the count fits, the aircraft's name last of all, so that names
    with blanks survive in comma-separated rows.

    Parameters
    ----------
    line : str
        The row.
    count : int
        Number of columns in the header.
    name_column : int
        Which of them is the aircraft's name.

    Returns
    -------
    list of str or None
        None if the row cannot be split into that many cells.
    """
    pattern = _SEPARATORS if _SEPARATORS.search(line) else re.compile(r"\t")
    parts = [part.strip() for part in pattern.split(line)]
    if len(parts) == count + 1 and parts[-1] == "":
        parts.pop()
    blanks = [i for i, part in enumerate(parts) if len(part.split()) > 1]
    if len(parts) == count and all(i == name_column for i in blanks):
        return parts
    for keep_name in (True, False):
        split: list[str] = []
        for i, part in enumerate(parts):
            whole = keep_name and i == name_column and len(parts) > 1
            # An empty cell between two commas stays a cell; between two tabs it is padding.
            split += [part] if whole or (not part and pattern is _SEPARATORS) else part.split()
        if len(split) == count + 1 and split[-1] == "":
            split.pop()
        if len(split) == count:
            return split
    return None


def cell_count(line: str) -> int:
    """Count the values of a row that does not fit, for the message."""
    return len([part for part in re.split(r"[,;\s]+", line) if part])
