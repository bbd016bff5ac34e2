"""Read what receivers of ADS-B log, and services publish, that is no table with a header.

- readsb, dump1090 and ADS-B Exchange: ``aircraft.json``, one or, line by line, a history of them,
  and ``trace_full_*.json``, one aircraft each. Feet, knots and feet per minute.
- SBS-1 (BaseStation) lines ``MSG,3,...``: messages of one aircraft are joined by its address.
- OpenSky's state vectors in JSON. Metres and m/s.
- FlightRadar24's JSON: all that is seen (``feed.js``), and single flights. Feet, knots, ft/min.
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from itertools import chain
from typing import Any

from components.arguments.units import FOOT_M, KNOT_M_S
from components.formats.reports import Log, PositionReport
from components.formats.text_rows import Problems, iterate_lines, text_of

_FPM = FOOT_M / 60.0
#: How old a velocity message of SBS may be beside a position, s.
_LASTS_S = 3.0


Reports = Iterator[tuple[int, PositionReport]]


def parse_receiver_log(problems: Problems, data: bytes) -> Log | None:
    """Return the log in a receiver's file, or None if its format is not known here."""
    head = data[:3].lstrip(b"\xef\xbb\xbf") + data[3:4096]
    head = head.lstrip()
    callsigns: dict[str, str] = {}
    # It may begin within a line, where somebody began to listen.
    if re.search(rb"^(?:MSG|MLAT|SEL|ID|AIR|STA|CLK),\s*\d*,", head, re.MULTILINE):
        reports = _read_sbs(problems, data, callsigns)
        return Log("BaseStation (SBS-1) messages", _FEET, reports, callsigns)
    if not head.startswith((b"{", b"[")):
        return None
    warnings: list[str] = []
    documents = json_documents(problems, data, warnings)
    first = next(documents, (1, None))
    for marks, said, units, reader in _JSON:
        if isinstance(first[1], dict) and marks <= first[1].keys():
            reports = _reports_of_documents(
                problems, chain([first], documents), marks, reader, callsigns
            )
            return Log(said, units, reports, callsigns, warnings=warnings)
    return None


UNKNOWN_JSON = (
    "is JSON of no known kind: an aircraft.json or trace_full of readsb, OpenSky's states (the "
    "keys now and aircraft, icao and trace, or time and states), FlightRadar24's playback or feed, "
    "or records with the columns of a table are needed"
)


def json_documents(
    problems: Problems, data: bytes, warnings: list[str]
) -> Iterator[tuple[int, Any]]:
    """Yield a file's JSON documents with their first line's number; lists element by element.

    A last line that is cut off, of a history that is being written, is left out with a warning.
    """
    text = text_of(data, problems)
    del data  # of a long history it is not held beside its text
    at, line, number = 0, 1, 0
    is_one_a_line = True
    while (found := _BEGINS.search(text, at)) is not None:
        start = found.start()
        line += text.count("\n", at, start)
        number += 1
        try:
            if text[start] == "[":
                parts = _Parts(text, start)
                yield from ((line, part) for part in parts)
                at = parts.end
            else:
                document, at = _decode_document(text, start)
                yield line, document
        except (ValueError, RecursionError) as error:
            end = text.find("\n", start)
            is_last = number > 1 and is_one_a_line and (end < 0 or not _BEGINS.search(text, end))
            if not is_last:
                problems.fail(f"is no JSON that can be read: {error}", line=line)
            warnings.append(f"the last line, {line}, is cut off and was left out")
            return
        over = text.count("\n", start, at)
        is_one_a_line &= not over
        line += over


_DECODER, _BEGINS = json.JSONDecoder(), re.compile(r"\S")
#: The lists of a document whose line is longer are read part by part.
_LONG = 2**20


class _Parts:
    """The elements of a JSON list within a text, decoded anew in each iteration.

    So few are held at a time. `end` is where it ends, once all were given.
    """

    def __init__(self, text: str, start: int) -> None:
        self._text, self._start, self.end = text, start, start

    def __iter__(self) -> Iterator[Any]:
        text, at = self._text, _index_of_next_nonblank(self._text, self._start + 1)
        while text[at] != "]":
            part, at = _DECODER.raw_decode(text, at)
            yield part
            at = _index_of_next_nonblank(text, at)
            if text[at] == ",":
                at = _index_of_next_nonblank(text, at + 1)
            elif text[at] != "]":
                raise ValueError(f"Expecting ',' delimiter: char {at}")
        self.end = at + 1


def _index_of_next_nonblank(text: str, at: int) -> int:
    """Return the index of the next character that is not blank; ValueError if there is none."""
    if at < len(text) and not text[at].isspace():
        return at
    found = _BEGINS.search(text, at)
    if found is None:
        raise ValueError(f"Expecting value: char {len(text)}")
    return found.start()


def _decode_document(text: str, start: int) -> tuple[Any, int]:
    """Return the JSON document that begins at an index of the text, and the index after it."""
    end = text.find("\n", start)
    if text[start] != "{" or (end if end >= 0 else len(text)) - start < _LONG:
        return _DECODER.raw_decode(text, start)
    document: dict[str, Any] = {}
    at = _index_of_next_nonblank(text, start + 1)
    while text[at] != "}":
        key, at = _DECODER.raw_decode(text, at)
        at = _index_of_next_nonblank(text, at)
        if not isinstance(key, str) or text[at] != ":":
            raise ValueError(f"Expecting property name and ':': char {at}")
        at = _index_of_next_nonblank(text, at + 1)
        if text[at] == "[":
            parts = document[key] = _Parts(text, at)
            for _ in parts:
                pass
            at = parts.end
        else:
            document[key], at = _DECODER.raw_decode(text, at)
        at = _index_of_next_nonblank(text, at)
        if text[at] == ",":
            at = _index_of_next_nonblank(text, at + 1)
        elif text[at] != "}":
            raise ValueError(f"Expecting ',' delimiter: char {at}")
    return document, at + 1


_Reader = Callable[[Mapping[str, Any], dict[str, str]], Iterator[PositionReport]]


def _reports_of_documents(
    problems: Problems,
    documents: Iterator[tuple[int, Any]],
    marks: frozenset[str],
    reader: _Reader,
    callsigns: dict[str, str],
) -> Reports:
    """Yield JSON documents' position reports with lines, without repeated last positions."""
    last: dict[str, PositionReport] = {}
    for number, one in documents:
        if not isinstance(one, dict) or not marks <= one.keys():
            problems.fail(UNKNOWN_JSON, line=number)
        try:
            for sample in reader(one, callsigns):
                before = last.get(sample.name)
                if before is None or not _repeats_position(sample, before):
                    if _is_number(sample.geometric) or _is_number(sample.barometric):
                        last[sample.name] = sample
                    yield number, sample
        except (TypeError, ValueError, LookupError, AttributeError, OverflowError) as error:
            problems.fail(
                f"is not as its keys promise ({type(error).__name__}: {error})", line=number
            )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


#: Ages of positions are rounded, so that one position comes at slightly different times, s.
_ROUNDED_S = 0.25


def _repeats_position(sample: PositionReport, before: PositionReport) -> bool:
    """Return whether a report repeats the one before: the same position at nearly the same time."""
    return (sample.lat, sample.lon) == (before.lat, before.lon) and (
        sample.time == before.time or abs(sample.time - before.time) <= _ROUNDED_S
    )


def _scale_if_number(value: Any, factor: float) -> Any:
    return value * factor if isinstance(value, int | float) else value


def _subtract_age(time_s: Any, age_s: Any) -> Any:
    return time_s - age_s if isinstance(age_s, int | float) else time_s


def _read_aircraft_json(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield the position reports of an ``aircraft.json``, at the times of their reception."""
    for craft in one["aircraft"]:
        name = str(craft["hex"])
        if craft.get("flight"):
            callsigns[name] = str(craft["flight"]).strip()
        climb = craft.get("geom_rate", craft.get("baro_rate", craft.get("vert_rate")))
        yield PositionReport(
            name, _subtract_age(one["now"], craft.get("seen_pos", craft.get("seen"))),
            craft.get("lat"), craft.get("lon"), _scale_if_number(craft.get("alt_geom"), FOOT_M),
            _scale_if_number(craft.get("alt_baro", craft.get("altitude")), FOOT_M),
            craft.get("track"),
            _scale_if_number(craft.get("gs", craft.get("speed")), KNOT_M_S),
            _scale_if_number(climb, _FPM),
        )  # fmt: skip


def _read_adsb_exchange(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield the aircraft in an answer of ADS-B Exchange: as readsb's, with the time in ms."""
    yield from _read_aircraft_json({"now": one["now"] / 1000.0, "aircraft": one["ac"]}, callsigns)


#: Of a trace's flags: its altitude is geometric.
_GEOMETRIC = 8


def _read_trace(one: Mapping[str, Any], callsigns: dict[str, str]) -> Iterator[PositionReport]:
    """Yield the points of a trace: seconds after its timestamp, position, altitude, and more."""
    name = str(one["icao"])
    for point in one["trace"]:
        after_s, lat, lon, alt, gs, trk, flags, climb, more = point[:9]
        geometric = point[10] if len(point) > 10 else None
        if isinstance(flags, int) and flags & _GEOMETRIC:
            alt, geometric = None, alt
        if isinstance(more, dict) and more.get("flight"):
            callsigns[name] = str(more["flight"]).strip()
        yield PositionReport(
            name, one["timestamp"] + after_s, lat, lon, _scale_if_number(geometric, FOOT_M),
            _scale_if_number(alt, FOOT_M), trk, _scale_if_number(gs, KNOT_M_S),
            _scale_if_number(climb, _FPM),
        )  # fmt: skip


def _read_opensky_path(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield the points of a flight path from OpenSky, which have no speeds."""
    name = str(one["icao24"])
    if one.get("callsign"):
        callsigns[name] = str(one["callsign"]).strip()
    for time_s, lat, lon, barometric, *_ in one["path"]:
        yield PositionReport(name, time_s, lat, lon, None, barometric)


def _read_opensky_states(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield OpenSky's state vectors, at the instants of their positions."""
    for state in one["states"] or ():
        name, callsign, _, time_s, _, lon, lat, barometric, _, gs, trk, climb = state[:12]
        if callsign:
            callsigns[name] = str(callsign).strip()
        geometric = state[13] if len(state) > 13 else None
        yield PositionReport(str(name), time_s, lat, lon, geometric, barometric, trk, gs, climb)


def _read_flightradar24_feed(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield all aircraft of FlightRadar24's live feed, each a list keyed by its flight number."""
    for state in one.values():
        if isinstance(state, list):
            address, lat, lon, trk, alt, gs, _, _, _, _, time_s, _, _, _, ground, climb, called = (
                state[:17]
            )
            name = str(address or called)
            callsigns[name] = str(called)
            yield PositionReport(
                name, time_s, lat, lon, None, None if ground else _scale_if_number(alt, FOOT_M),
                trk,
                _scale_if_number(gs, KNOT_M_S), _scale_if_number(climb, _FPM),
            )  # fmt: skip


def _read_flightradar24_playback(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield the points of a FlightRadar24 playback, in which 0 ft means on the ground."""
    flight = one["result"]["response"]["data"]["flight"]
    called = flight["identification"]
    name = str(flight["aircraft"]["identification"].get("modes") or called["id"])
    callsigns[name] = str(called["callsign"] or "")
    for point in flight["track"]:
        yield PositionReport(
            name, point["timestamp"], point["latitude"], point["longitude"], None,
            _scale_if_number(point["altitude"]["feet"] or None, FOOT_M), point["heading"],
            _scale_if_number(point["speed"]["kts"], KNOT_M_S),
            _scale_if_number(point["verticalSpeed"]["fpm"], _FPM),
        )  # fmt: skip


def _read_flightradar24_details(
    one: Mapping[str, Any], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    """Yield the trail in FlightRadar24's details of a flight, which has no climb rate."""
    called = one["identification"]
    name = str((one.get("aircraft") or {}).get("hex") or called["id"])
    callsigns[name] = str(called["callsign"] or "")
    for point in one["trail"]:
        yield PositionReport(
            name, point["ts"], point["lat"], point["lng"], None,
            _scale_if_number(point["alt"] or None, FOOT_M), point["hd"],
            _scale_if_number(point["spd"], KNOT_M_S),
        )  # fmt: skip


#: By the keys that a document has: what it is called, and what reads it.
_FEET = "ft and kt"
_JSON: tuple[tuple[frozenset[str], str, str, _Reader], ...] = (
    (frozenset({"now", "aircraft"}), "aircraft.json of readsb", _FEET, _read_aircraft_json),
    (
        frozenset({"now", "ac"}),
        "aircraft of ADS-B Exchange's interface",
        _FEET,
        _read_adsb_exchange,
    ),
    (frozenset({"icao", "timestamp", "trace"}), "a trace of readsb", _FEET, _read_trace),
    (frozenset({"time", "states"}), "OpenSky's states", "m and m/s", _read_opensky_states),
    (frozenset({"icao24", "path"}), "a track of OpenSky", "m", _read_opensky_path),
    (
        frozenset({"full_count", "version"}),
        "FlightRadar24's live feed",
        _FEET,
        _read_flightradar24_feed,
    ),
    (
        frozenset({"result", "_api"}),
        "FlightRadar24's playback",
        _FEET,
        _read_flightradar24_playback,
    ),
    (
        frozenset({"identification", "trail"}),
        "FlightRadar24's details",
        _FEET,
        _read_flightradar24_details,
    ),
)


def _read_sbs(problems: Problems, data: bytes, callsigns: dict[str, str]) -> Reports:
    """Yield positions in BaseStation messages, with the aircraft's last velocity if recent."""
    moves: dict[str, tuple[float, tuple[Any, ...]]] = {}
    lines = iterate_lines(text_of(data, problems))
    del data
    days: dict[str, float | None] = {}
    for number, line in lines:
        if not line.startswith(("MSG", "MLAT")):
            continue
        cells = line.split(",")
        if len(cells) < 17 or not (name := cells[4].strip()):
            continue
        if callsign := cells[10].strip():
            callsigns[name] = callsign
        date = cells[6]
        if date not in days:
            days[date] = _unix_midnight_of_date(date)
        time_s = _unix_time_of_clock_text(days[date], cells[7])
        if time_s is None:
            problems.add(f"{date.strip()} {cells[7].strip()} is no date and time", line=number)
            continue
        alt, gs, trk, lat, lon, climb = map(_number, cells[11:17])
        if gs is not None and trk is not None:
            moves[name] = time_s, (trk, gs * KNOT_M_S, _scale_if_number(climb, _FPM))
        if lat is None or lon is None:
            continue
        at, move = moves.get(name, (-math.inf, ()))
        recent = move if abs(time_s - at) <= _LASTS_S else (None,) * 3
        if len(cells) > 21 and cells[21].strip() in ("-1", "1"):  # on the ground
            alt = None
        yield (
            number,
            PositionReport(name, time_s, lat, lon, None, _scale_if_number(alt, FOOT_M), *recent),
        )


def _unix_midnight_of_date(date: str) -> float | None:
    try:
        day = datetime.fromisoformat(date.strip().replace("/", "-"))
    except ValueError:
        return None
    return day.replace(tzinfo=UTC).timestamp()


_CLOCK = re.compile(r"\s*(\d\d):(\d\d):(\d\d(?:\.\d*)?)\s*")


def _unix_time_of_clock_text(midnight_s: float | None, clock: str) -> float | None:
    match = _CLOCK.fullmatch(clock)
    if match is None or midnight_s is None:
        return None
    return midnight_s + 3600.0 * int(match[1]) + 60.0 * int(match[2]) + float(match[3])


def _number(cell: str) -> float | None:
    try:
        return float(cell) if cell else None
    except ValueError:
        return None
