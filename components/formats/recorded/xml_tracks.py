"""Read tracks in XML: GPX, and KML with times (``gx:Track``, or a ``TimeStamp`` at each point)."""

import io
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any
from xml.etree import ElementTree

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
        points = _points(problems, _of_gpx(problems, data, stem))
        return Log("GPX tracks", "m", points, {}, "points", geometric=ABOVE_SEA)
    if b"<kml" in head or (b"<document" in head and b"<placemark" in data.lower()):
        warnings: list[str] = []
        points = _points(problems, _of_kml(problems, data, stem, warnings))
        return Log("KML tracks", "m", points, {}, "points", warnings, ABOVE_SEA)
    return None


#: Name, time, longitude, latitude and height, as they are written.
_Point = tuple[str, str, str, str, str]


def _points(problems: Problems, points: Iterator[_Point]) -> Iterator[tuple[int, PositionReport]]:
    timed, number = 0, 0
    for number, (name, when, lon, lat, up) in enumerate(points, start=1):
        time_s = _instant(when)
        if when and time_s is None:
            problems.add(f"{when[:40]!r} is no date and time", line=number)
        timed += time_s is not None
        yield number, PositionReport(name, time_s, _float(lat), _float(lon), geometric=_float(up))
    if not timed:
        what = f"its {number} positions have no times" if number else "there is no track in it"
        problems.fail(
            f"{what} (routes, waypoints and LineStrings have none): a GPX with <time> at its track "
            "points is needed, or a KML with gx:Track or a TimeStamp at each point"
        )


def _instant(text: str) -> float | None:
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def _float(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _elements(problems: Problems, data: bytes) -> Iterator[tuple[str, str, Any]]:
    """Give "start" or "end", the plain name, and the element; what has ended is thrown away."""
    try:
        for event, element in ElementTree.iterparse(io.BytesIO(data), ("start", "end")):
            yield event, element.tag.rpartition("}")[2], element
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        problems.fail(f"is no XML that can be read: {error}")


def _text(element: Any) -> str:
    return (element.text or "").strip()


def _of_gpx(problems: Problems, data: bytes, stem: str) -> Iterator[_Point]:
    name, tracks = "", 0
    names: dict[str, int] = {}
    inside: list[str] = []
    ele = when = ""
    for event, tag, element in _elements(problems, data):
        if event == "start":
            inside.append(tag)
            if tag == "trk":
                name, tracks = stem, tracks + 1
                names[name] = names.get(name, 0) + 1
            continue
        inside.pop()
        if tag == "name" and inside[-1:] == ["trk"] and _text(element):
            names[name] -= 1
            name = _text(element)
            names[name] = names.get(name, 0) + 1
        elif tag == "ele":
            ele = _text(element)
        elif tag == "time":
            when = _text(element)
        elif tag == "trkpt":
            called = name if names.get(name, 0) < 2 else f"{name} {names[name]}"
            yield called, when, element.get("lon", ""), element.get("lat", ""), ele
            ele = when = ""
        if tag in ("trkpt", "trkseg", "trk", "wpt", "rte"):
            element.clear()


def _of_kml(problems: Problems, data: bytes, stem: str, warnings: list[str]) -> Iterator[_Point]:
    """Give the points of tracks, and those of placemarks with a time each."""
    names: dict[int, str] = {}
    inside: list[str] = []
    tracks: dict[str, int] = {}
    whens: list[str] = []
    coords: list[str] = []
    when = point = ""
    for event, tag, element in _elements(problems, data):
        if event == "start":
            inside.append(tag)
            if tag == "Track":
                whens, coords = [], []
            if tag == "Placemark":
                when = point = ""
                names.pop(len(inside), None)
            continue
        depth = len(inside)
        inside.pop()
        if tag == "name":
            names[depth - 1] = _text(element)
        elif tag == "altitudeMode" and _text(element) in _GROUND and not warnings:
            if inside[-1:] in (["Track"], ["Point"]):
                mode = _text(element)
                said = f"heights are {_GROUND[mode]} (altitudeMode {mode})"
                warnings.append(f"{said} and are read as above mean sea level")
        elif tag == "when" and inside[-1:] == ["Track"]:
            whens.append(_text(element))
        elif tag == "coord":
            coords.append(_text(element))
        elif tag == "when":
            when = _text(element)
        elif tag == "coordinates" and inside[-1:] == ["Point"]:
            point = _text(element)
        elif tag == "Track":
            if len(whens) != len(coords):
                problems.fail(f"a gx:Track has {len(whens)} times and {len(coords)} positions")
            at = max((k for k, one in enumerate(inside) if one == "Placemark"), default=-1) + 1
            name = names.get(at) or names.get(_document(inside)) or stem
            if "MultiTrack" not in inside:
                tracks[name] = tracks.get(name, 0) + 1
            called = name if tracks.get(name, 0) < 2 else f"{name} {tracks[name]}"
            for one, coord in zip(whens, coords, strict=True):
                yield called, one, *_three(coord.split())
        elif tag == "Placemark" and point and when:
            yield names.get(_document(inside)) or stem, when, *_three(point.split(","))
        if tag in ("Placemark", "Track", "when", "coord", "Style", "StyleMap"):
            element.clear()


def _document(inside: list[str]) -> int:
    """Return at which depth the document is, whose name all that has none of its own goes by."""
    return inside.index("Document") + 1 if "Document" in inside else 0


#: What heights are that are not above mean sea level, by their mode.
_GROUND = {"relativeToGround": "above ground", "clampToGround": "not meant"}


def _three(parts: list[str]) -> tuple[str, str, str]:
    lon, lat, up = [*parts, "", "", ""][:3]
    return lon.strip(), lat.strip(), up.strip()
