"""Text files of rows: separators, units, and all that is wrong with one file in one error."""

from __future__ import annotations

import csv
import io
import math
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import NoReturn

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.flights.sampled_flight import SampledTrajectory
from dsa_des.errors import Lines, nearest_name
from dsa_des.files.input_files import (
    LARGEST_BYTES,
    InputFileError,
    NoSuchFile,
    is_folder,
    read_input_bytes,
)
from dsa_des.text.safe_text import shorten


def _factors_by_name(*units: tuple[str, float]) -> dict[str, float]:
    """Return the factor of each unit by each of the names that it may have."""
    return {name: worth for names, worth in units for name in names.split()}


LENGTH_M = _factors_by_name(
    ("m metre metres meter meters", 1.0), ("km", 1000.0), ("cm", 0.01), ("mm", 0.001),
    ("ft foot feet", FOOT_M), ("nmi nm", NAUTICAL_MILE_M),
)  # fmt: skip
SPEED_MPS = _factors_by_name(
    ("m/s mps", 1.0), ("km/h kph kmh", 1.0 / 3.6),
    ("knot knots kn kt kts", NAUTICAL_MILE_M / 3600.0), ("mph mi/h", 1609.344 / 3600.0),
    ("cm/s", 0.01), ("nmi/h", NAUTICAL_MILE_M / 3600.0), ("nmi/s", NAUTICAL_MILE_M),
    ("fpm ft/min", FOOT_M / 60.0), ("ft/s fps", FOOT_M),
)  # fmt: skip
ANGLE_DEG = _factors_by_name(
    ("deg degree degrees", 1.0), ("rad radian radians", 180.0 / math.pi), ("1e-7deg dege7", 1e-7)
)
TIME_S = _factors_by_name(
    ("s sec second seconds", 1.0), ("ms millisecond milliseconds", 1e-3), ("us µs", 1e-6),
    ("ns", 1e-9), ("min", 60.0), ("h hr", 3600.0),
)  # fmt: skip
NO_UNIT = {"none": 1.0, "unitless": 1.0, "": 1.0, "-": 1.0, "1": 1.0}

#: In m, m/s, deg and s.
UNIT_KINDS = (LENGTH_M, SPEED_MPS, ANGLE_DEG, TIME_S, NO_UNIT)
ALL_TOKENS = {token for kind in UNIT_KINDS for token in kind}


def clean_token(token: str) -> str:
    """Return a unit token in its plain form: no brackets, no blanks, lower case."""
    return re.sub(r"[\s\[\](){}]", "", token).lower()


MOST_PROBLEMS = 20
"""Problems listed in one error; further ones are only counted."""
MOST_COLUMNS = 30
"""Names of columns listed in a message."""
MOST_OF_A_CELL = 24
"""Letters of a cell that a message repeats."""


class TrafficFileError(ValueError):
    """A traffic file cannot be used; `problems` says everything that is wrong with it."""

    def __init__(self, path: str, problems: Iterable[str]) -> None:
        self.path = str(path)
        self.problems = list(problems)
        # Plain positional arguments: pickling and SimPy rebuild an exception from them.
        super().__init__(self.path, self.problems)

    def __str__(self) -> str:
        if len(self.problems) == 1:
            return Lines.from_lines([f"{self.path}: {self.problems[0]}"])
        lines = [f"{self.path}: {len(self.problems)} problems"]
        return Lines.from_lines(lines + [f"  {problem}" for problem in self.problems])


@dataclass(frozen=True)
class TrafficFile:
    """The aircraft of a file as flights: the ownship, and all others in the order of the file.

    Times count from the file's earliest sample, `start_time_s` of its own; `notes` says what was
    assumed, reordered or ignored, `warnings` those of them that change what is flown.
    """

    ownship: SampledTrajectory
    intruders: list[SampledTrajectory]
    start_time_s: float
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    #: When what was chosen of it ends.
    end_s: float | None = None
    #: What the file is, in which units it says things, and which height was read.
    kind: str = ""
    units: str = ""
    height: str = ""

    @property
    def aircraft(self) -> list[SampledTrajectory]:
        """Ownship first, then the intruders."""
        return [self.ownship, *self.intruders]


class Problems:
    """Collects what is wrong with one file, to be reported at once.

    Its rows are lines of text, unless `of` calls them something else, which a reader may set. The
    first `most` are listed.
    """

    def __init__(self, path: str, of: str = "line", most: int = MOST_PROBLEMS) -> None:
        self.path, self.of, self._most = path, of, most
        #: Line (infinite for none) and text.
        self._lines: list[tuple[float, str]] = []
        self._more = 0

    def add(self, problem: str, *, line: int | None = None, column: str | None = None) -> None:
        """Add a problem, with its line and column where known."""
        where = [f"{self.of} {line}"] if line is not None else []
        where += [f"column {column}"] if column is not None else []
        if len(self._lines) < self._most:
            text = f"{', '.join(where)}: {problem}" if where else problem
            self._lines.append((math.inf if line is None else line, text))
        else:
            self._more += 1

    def raise_if_any(self) -> None:
        """Raise one `TrafficFileError` with all problems so far, in order of their lines."""
        if not self._lines:
            return
        lines = [text for _, text in sorted(self._lines, key=lambda one: one[0])]
        if self._more:
            lines[-1] += f" (and {self._more} more problems)"
        raise TrafficFileError(self.path, lines)

    def fail(self, problem: str, *, line: int | None = None, column: str | None = None) -> NoReturn:
        """Raise with a problem after which reading on is pointless, and all problems so far."""
        self.add(problem, line=line, column=column)
        self.raise_if_any()
        raise AssertionError


def shown_columns(headers: Iterable[str], known: bool) -> str:
    """Return column names as text for a message, or only their number if none is known.

    A file without any of our columns is something else, whose content is not quoted.
    """
    names = [shorten(header, MOST_OF_A_CELL) for header in headers]
    if not known:
        return f"the {len(names)} columns of the first row"
    return ", ".join(names[:MOST_COLUMNS]) + (", …" if len(names) > MOST_COLUMNS else "")


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return a suggestion for a misspelt name, or an empty string when nothing is close."""
    close = nearest_name(name, sorted(allowed))
    return f"; did you mean {close!r}?" if close else ""


_SEPARATORS = re.compile(r"[,;]")
_TOKEN = re.compile(r"\[[^\]]*\]|[^\s,;\[\]]+")
_TRAFFIC = "a text file with one row per aircraft and time"
_ROWS = "a row of column names and rows of samples"


def read_lines(
    path: Path, problems: Problems, needed: str = _TRAFFIC, holds: str = _ROWS
) -> list[tuple[int, str]]:
    """Return a file's lines with their numbers from 1, without blank lines and comments.

    `needed` and `holds` are for the messages of a binary and of an empty file. Text may be as
    `text_of` says; lines may end in LF, CR LF or CR.
    """
    lines = iterate_lines(text_of(read_content(path, problems), problems, needed))
    rows = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if not rows:
        problems.fail(f"the file is empty: {holds} are needed")
    return rows


def read_content(path: Path, problems: Problems) -> bytes:
    """Return a file's bytes, unpacked where they are packed (gzip)."""
    try:
        data = read_input_bytes(path)
    except NoSuchFile:
        close = [p.name for p in path.parent.glob("*")] if is_folder(path.parent) else []
        problems.fail(f"there is no such file{did_you_mean(path.name, close)}")
    except InputFileError as error:
        if is_folder(path):
            problems.fail("this is a directory: give the file itself")
        problems.fail(f"the file {error}")
    if not data.startswith(b"\x1f\x8b"):
        return data
    unpack = zlib.decompressobj(wbits=31)
    try:
        content = unpack.decompress(data, LARGEST_BYTES)
    except zlib.error as error:
        problems.fail(f"the packed file is damaged ({error})")
    if not unpack.eof:
        larger = (
            f"holds more than {LARGEST_BYTES / 2**20:,.0f} MB" if unpack.unconsumed_tail else ""
        )
        problems.fail(f"the packed file {larger or 'is cut off'}")
    return content


def text_of(data: bytes, problems: Problems, needed: str = _TRAFFIC) -> str:
    """Return bytes decoded as UTF-8, UTF-16 with byte-order mark, or Latin-1; error if binary."""
    text = _decode(data)
    if text is None:
        problems.fail(f"this is a binary file: {needed} is needed")
    return text


_LINE = re.compile(r"[^\r\n]+|\r\n|\r|\n")


def iterate_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines that are not blank, numbered from 1, as they are wanted."""
    number = 1
    for match in _LINE.finditer(text):
        line = match[0]
        if line[0] in "\r\n":
            number += 1
        elif line.strip():
            # Not tabs: one at either end delimits an empty cell.
            yield number, line.strip(" ")


def _decode(data: bytes) -> str | None:
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


def split_cells(line: str, count: int, name_column: int) -> list[str] | int:
    """Split a row into as many cells as columns, or return its number of cells if not possible.

    Commas (or semicolons, or tabs where there are neither) separate first; a cell that holds
    blanks is split further until the count fits, the aircraft's name last of all, so that names
    with blanks survive in comma-separated rows.
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
    return len([part for part in re.split(r"[,;\s]+", line) if part])


#: A line of the frame of a table, and how far from the first line one must be.
_FRAME, _HEAD = re.compile(r"[+|]?-[-+]+-[+|]?"), 30


def strip_frame(lines: Iterator[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield a table's rows without a database shell's frame (Impala, Trino), its header once."""
    head = list(islice(lines, _HEAD))
    names = ""
    if not any(_FRAME.fullmatch(text) for _, text in head):
        yield from chain(head, lines)
        return
    for number, text in chain(head, lines):
        if "|" in text and not _FRAME.fullmatch(text) and text != names:
            names = names or text
            yield number, text.strip("|")


def quoted_rows(
    lines: Iterator[tuple[int, str]], delimiter: str
) -> Iterator[tuple[int, list[str]]]:
    """Yield each row's first line number and its cells; a quoted cell may span lines."""
    if delimiter == " ":
        yield from ((number, text.split()) for number, text in lines)
        return
    begun: list[int] = []

    def fed() -> Iterator[str]:
        for number, text in lines:
            begun.append(number)
            yield text + "\n"

    reader = csv.reader(fed(), delimiter=delimiter)
    while True:
        begun.clear()
        try:
            row = next(reader, None)
        except csv.Error:  # a cell of over 131,072 characters: no row of ours
            row = []
        if row is None:
            return
        yield begun[0], [cell.strip() for cell in row]


def csv_table(
    text: str, fail: Callable[[str, int], Exception]
) -> tuple[list[str], Iterator[tuple[int, list[str]]]]:
    """Return the column names of a CSV table, and its rows with their lines; blank ones left out.

    `fail` makes the error of what cannot be read, and of a row that has another number of cells.
    """
    reader = csv.reader(io.StringIO(text))

    def each() -> Iterator[tuple[int, list[str]]]:
        try:
            for row in reader:
                if any(cell.strip() for cell in row):
                    yield reader.line_num, [cell.strip() for cell in row]
        except csv.Error as error:
            raise fail(str(error), reader.line_num) from None

    rows = each()
    names = next(rows, (0, []))[1]

    def checked() -> Iterator[tuple[int, list[str]]]:
        for line, row in rows:
            if len(row) != len(names):
                raise fail(f"has {len(row)} values, but there are {len(names)} columns", line)
            yield line, row

    return names, checked()
