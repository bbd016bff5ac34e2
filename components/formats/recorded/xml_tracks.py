"""Read tracks in XML: GPX, and KML with times (``gx:Track``, or a ``TimeStamp`` at each point)."""

import math
from array import array
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from xml.parsers import expat

from components.formats.reports import ABOVE_SEA, Log, PositionReport
from components.formats.text_rows import Problems


def xml_log(problems: Problems, data: bytes, stem: str) -> Log | None:
    """Return the tracks of a GPX or KML file, or None where it is another XML.

    Aircraft are called as their tracks, or as the file. GPX and KML give heights above mean sea
    level in m, latitude and longitude in degrees, and times in UTC.
    """
    problems.of = "point"
    head = data[:4096].lower()
    if b"<gpx" in head:
        points = _numbered_position_reports(problems, _read_gpx(problems, data, stem))
        return Log("GPX tracks", "m", points, {}, "points", geometric=ABOVE_SEA)
    if b"<kml" in head or (b"<document" in head and b"<placemark" in data.lower()):
        warnings: list[str] = []
        points = _numbered_position_reports(problems, _read_kml(problems, data, stem, warnings))
        return Log("KML tracks", "m", points, {}, "points", warnings, ABOVE_SEA)
    return None


#: Name, time (text where it is none), longitude, latitude and height.
_Point = tuple[str, float | str | None, float | None, float | None, float | None]


def _numbered_position_reports(
    problems: Problems, points: Iterator[_Point]
) -> Iterator[tuple[int, PositionReport]]:
    timed, number = 0, 0
    for number, (name, when, lon, lat, up) in enumerate(points, start=1):
        time_s = None if isinstance(when, str) else when
        if isinstance(when, str):
            problems.add(f"{when[:40]!r} is no date and time", line=number)
        timed += time_s is not None
        yield number, PositionReport(name, time_s, lat, lon, geometric=up)
    if not timed:
        what = f"its {number} positions have no times" if number else "there is no track in it"
        problems.fail(
            f"{what} (routes, waypoints and LineStrings have none): a GPX with <time> at its track "
            "points is needed, or a KML with gx:Track or a TimeStamp at each point"
        )


def _unix_time_or_text(text: str) -> float | str | None:
    """Return an ISO 8601 text as Unix time (s); the text if it is no time, None if it is empty."""
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        return text or None
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


#: So much of a file is parsed at a time.
_CHUNK = 2**16


def _elements(
    problems: Problems, data: bytes, begins: Collection[str], ends: Collection[str]
) -> Iterator[tuple[str, dict[str, str] | None, str, tuple[str, ...]]]:
    """Yield XML elements' name, attributes (at begin), text (at end) and parent tags."""
    events: list[tuple[str, dict[str, str] | None, str, tuple[str, ...]]] = []
    inside: list[str] = []
    text: list[str] = []

    def begin(tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        text.clear()
        if tag in begins:
            events.append((tag, attributes, "", tuple(inside)))
        inside.append(tag)

    def end(_: str) -> None:
        if (tag := inside.pop()) in ends:
            events.append((tag, None, "".join(text).strip(), tuple(inside)))
        text.clear()

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = text.append
    try:
        for first in range(0, len(data), _CHUNK):
            parser.Parse(data[first : first + _CHUNK], first + _CHUNK >= len(data))
            yield from events
            events.clear()
    except (expat.ExpatError, LookupError) as error:
        problems.fail(f"is no XML that can be read: {error}")


def _read_gpx(problems: Problems, data: bytes, stem: str) -> Iterator[_Point]:
    name = ele = when = ""
    names: dict[str, int] = {}
    place: dict[str, str] = {}
    ends = {"name", "ele", "time", "trkpt"}
    for tag, attributes, text, inside in _elements(problems, data, {"trk", "trkpt"}, ends):
        if tag == "trk":
            name = stem
            names[name] = names.get(name, 0) + 1
        elif attributes is not None:
            place, ele, when = attributes, "", ""
        elif tag == "trkpt":
            called = name if names.get(name, 0) < 2 else f"{name} {names[name]}"
            lon, lat = (_float(place.get(key, "")) for key in ("lon", "lat"))
            yield called, _unix_time_or_text(when), lon, lat, _float(ele)
        elif tag == "name" and inside[-1:] == ("trk",) and text:
            names[name] -= 1
            name = text
            names[name] = names.get(name, 0) + 1
        elif inside[-1:] == ("trkpt",) and tag != "name":
            ele, when = (text, when) if tag == "ele" else (ele, text)


def _read_kml(problems: Problems, data: bytes, stem: str, warnings: list[str]) -> Iterator[_Point]:
    """Yield the points of tracks, and those of placemarks with a time each."""
    names: dict[int, str] = {}
    tracks: dict[str, int] = {}
    whens, coords, odd = array("d"), array("d"), dict[int, str | None]()
    when = point = ""
    begins = {"Track", "Placemark"}
    ends = {"name", "altitudeMode", "when", "coord", "coordinates", *begins}
    for tag, attributes, text, inside in _elements(problems, data, begins, ends):
        parent = inside[-1] if inside else ""
        if attributes is not None and tag == "Track":
            whens, coords, odd = array("d"), array("d"), {}
        elif attributes is not None:
            when = point = ""
            names.pop(len(inside) + 1, None)
        elif tag == "name":
            names[len(inside)] = text
        elif tag == "altitudeMode":
            if text in _GROUND and not warnings and parent in ("Track", "Point"):
                said = f"heights are {_GROUND[text]} (altitudeMode {text})"
                warnings.append(f"{said} and are read as above mean sea level")
        elif tag == "when" and parent == "Track":
            time_s = _unix_time_or_text(text)
            if isinstance(time_s, float):
                whens.append(time_s)
            else:
                odd[len(whens)] = time_s
                whens.append(math.nan)
        elif tag == "coord":
            coords.extend(_lon_lat_height(text.split()))
        elif tag == "when":
            when = text
        elif tag == "coordinates" and parent == "Point":
            point = text
        elif tag == "Track":
            if 3 * len(whens) != len(coords):
                said = f"{len(whens)} times and {len(coords) // 3} positions"
                problems.fail(f"a gx:Track has {said}")
            at = max((k for k, one in enumerate(inside) if one == "Placemark"), default=-1) + 1
            name = names.get(at) or names.get(_document_depth(inside)) or stem
            if "MultiTrack" not in inside:
                tracks[name] = tracks.get(name, 0) + 1
            called = name if tracks.get(name, 0) < 2 else f"{name} {tracks[name]}"
            for k, one in enumerate(whens):
                lon, lat, up = coords[3 * k : 3 * k + 3]
                yield called, odd.get(k, one), lon, lat, up
        elif tag == "Placemark" and point and when:
            name = names.get(_document_depth(inside)) or stem
            yield name, _unix_time_or_text(when), *_lon_lat_height(point.split(","))


def _document_depth(inside: Sequence[str]) -> int:
    """Return the depth, from 1, of the KML ``Document`` in a path of tags; 0 if there is none."""
    return inside.index("Document") + 1 if "Document" in inside else 0


#: What heights are that are not above mean sea level, by their mode.
_GROUND = {"relativeToGround": "above ground", "clampToGround": "not meant"}


def _lon_lat_height(parts: list[str]) -> tuple[float, float, float]:
    lon, lat, up = map(_float, [*parts, "", "", ""][:3])
    return lon, lat, up
