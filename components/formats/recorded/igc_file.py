"""Read IGC files, the flight recorders' of gliders (FAI, technical specification of 2023)."""

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import islice

from components.formats.reports import Log, PositionReport
from components.formats.text_rows import Problems, iterate_lines, text_of

_DATE = re.compile(r"HFDTE(?:DATE)?:?\s*(\d\d)(\d\d)(\d\d)", re.IGNORECASE)
_FIX = re.compile(
    r"B(\d\d)(\d\d)(\d\d)(\d\d)(\d{5})([NS])(\d{3})(\d{5})([EW])([AV])(-\d{4}|\d{5})(-\d{4}|\d{5})"
)
#: Whose header says what the aircraft is called: competition number, else registration.
_NAMES = (re.compile(r"HFCID[^:]*:\s*(\S.*)", re.I), re.compile(r"HFGID[^:]*:\s*(\S.*)", re.I))
_NAMELESS = frozenset({"none", "nkn", "nil", "unknown", "not recorded"})
_EXTENSION = re.compile(r"(\d\d)(\d\d)([A-Z0-9]{3})")
_DAY = timedelta(days=1)


def is_igc(head: bytes) -> bool:
    """Return whether data begins as an IGC file does."""
    lines = head.lstrip(b"\xef\xbb\xbf\r\n ").splitlines()[:60]
    return any(re.match(rb"HFDTE[D\d]|B\d{13}[NS]\d{8}[EW][AV]", line) for line in lines)


def igc_log(problems: Problems, data: bytes, stem: str) -> Log:
    """Return a log of an IGC file's flight, with pressure and GNSS (ellipsoid) altitudes."""
    text = text_of(data, problems)
    warnings: list[str] = []
    fixes = _fixes(problems, text, _name_from_headers(text) or stem, warnings)
    return Log("an IGC file", "m", fixes, {}, "fixes", warnings)


def _name_from_headers(text: str) -> str:
    for pattern in _NAMES:
        for _, line in islice(iterate_lines(text), 200):
            if (match := pattern.match(line)) and match[1].strip().lower() not in _NAMELESS:
                return match[1].strip()
    return ""


def _fixes(
    problems: Problems, text: str, name: str, warnings: list[str]
) -> Iterator[tuple[int, PositionReport]]:
    day: datetime | None = None
    damaged: list[int] = []
    last_s = -1
    more: dict[str, slice] = {}
    pressed = any(one[25:30].strip("0") for _, one in iterate_lines(text) if _FIX.match(one))
    for number, line in iterate_lines(text):
        if match := _DATE.match(line):
            try:
                day = datetime(2000 + int(match[3]), int(match[2]), int(match[1]), tzinfo=UTC)
            except ValueError:
                problems.add(f"{line[:24]!r} is no date", line=number)
            if day is not None and day.year > 2079:
                day = day.replace(year=day.year - 100)
            last_s = -1
        elif line.startswith("I") and line[1:3].isdigit():
            parts = _EXTENSION.findall(line[3:])
            more = {code: slice(int(first) - 1, int(end)) for first, end, code in parts}
        elif line.startswith("B"):
            fix = _FIX.match(line)
            if fix is None:
                damaged.append(number)
                continue
            if day is None:
                problems.fail("there is no date (HFDTE) before its first fix", line=number)
            of_day = 3600 * int(fix[1]) + 60 * int(fix[2]) + int(fix[3])
            if of_day < last_s - 43_200:  # past midnight
                day += _DAY
            last_s = of_day
            lat = _angle(fix[4], fix[5], _extension_digits(line, more.get("LAD")), fix[6] == "S")
            lon = _angle(fix[7], fix[8], _extension_digits(line, more.get("LOD")), fix[9] == "W")
            tenths = _extension_digits(line, more.get("TDS"))
            time_s = day.timestamp() + of_day + (float(f"0.{tenths}") if tenths else 0.0)
            geometric = float(fix[12]) if fix[10] == "A" else None
            yield (
                number,
                PositionReport(
                    name, time_s, lat, lon, geometric, float(fix[11]) if pressed else None
                ),
            )
    if damaged:
        what = "fix is" if len(damaged) == 1 else "fixes are"
        said = f"{len(damaged)} {what} damaged and left out, the first in line {damaged[0]}"
        warnings.append(said)


def _extension_digits(line: str, where: slice | None) -> str:
    """Return further digits that an extension of the fix holds."""
    digits = "" if where is None else line[where]
    return digits if digits.isdigit() else ""


def _angle(degrees: str, thousandths: str, more: str, is_negative: bool) -> float:
    minutes = int(thousandths + more) / 10.0 ** (3 + len(more))
    return (-1.0 if is_negative else 1.0) * (int(degrees) + minutes / 60.0)
