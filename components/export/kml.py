"""A run as KML (OGC 07-147r2, with Google's tracks), whose heights are above sea level."""

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape

from components.display.recorded_run import RecordedTables
from components.display.symbols import LEVELS_ON_DARK
from components.export.globe_run import Course, DetectedPlace, GlobeRun, globe_run, iso_time
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import UsageError
from dsa_des.text.safe_text import escape_unprintable

#: Google's icons, which globes know by their addresses, for markers of figures.
_ICON = "http://maps.google.com/mapfiles/kml/shapes/{}.png"
_ICONS = {
    "o": "placemark_circle", "s": "placemark_square", "^": "triangle", "v": "triangle",
    "<": "triangle", ">": "triangle", "*": "star", "D": "polygon", "d": "polygon",
    "P": "cross-hairs", "X": "cross-hairs",
}  # fmt: skip
_DOT, _RING, _PLANE = "shaded_dot", "donut", "airports"


def scene_undulation_m(run: RecordedTables) -> float | None:
    """Return the geoid's height above the ellipsoid (m) that the run's scene states, or None."""
    try:
        terrain = run.scene.get("terrain", {})
        given = terrain.get("geoid_undulation_m") or (
            terrain.get("raster_offset_m", 0.0) if "raster" in terrain else None
        )
        return None if given is None else float(given)
    except (UsageError, ValueError, LookupError, TypeError):
        return None


def kml_text(run: RecordedTables, geoid_m: float = 0.0) -> str:
    """Return a KML document: folders of aircraft, tracks, alerts and detections, with styles.

    A run's heights are above the ellipsoid, those of KML's ``absolute`` above the geoid (EGM96):
    `geoid_m`, the height of the one above the other, is taken off, and the document says so.
    """
    shown = globe_run(run)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        "<Document>",
        f"<name>{_escaped_xml_text(shown.name)}</name>",
        f"<description>Heights above sea level: those of the run, above the WGS 84 ellipsoid, less "
        f"{geoid_m:g} m for the geoid. Second 0 is {iso_time(0.0)}.</description>",
        *_look_at_first_own_position_lines(shown, geoid_m),
        *_styles(shown),
    ]
    lines += _folder("Aircraft", _courses(shown.flights, "aircraft", geoid_m))
    for group in sorted({one.group for one in shown.tracks}):
        mine = [one for one in shown.tracks if one.group == group]
        lines += _folder(f"Tracks of {group}", _courses(mine, f"track-{group}", geoid_m))
    lines += _folder("Alerts", _courses(shown.alerts, "level", geoid_m))
    for sensor in sorted({one.sensor for one in shown.seen}):
        mine_seen = [one for one in shown.seen if one.sensor == sensor]
        lines += _folder(f"Detections of {sensor}", _points(mine_seen, geoid_m))
    return "\n".join([*lines, "</Document>", "</kml>", ""])


def _look_at_first_own_position_lines(shown: GlobeRun, geoid_m: float) -> list[str]:
    """Return KML LookAt lines, by which a globe first looks at the ownship's first position."""
    lon, lat, alt = shown.flights[0].position[0].tolist()
    return [
        "<LookAt>",
        f"<longitude>{lon}</longitude><latitude>{lat}</latitude>",
        f"<altitude>{alt - geoid_m}</altitude><heading>0</heading><tilt>45</tilt>",
        "<range>20000</range><altitudeMode>absolute</altitudeMode>",
        "</LookAt>",
    ]


def _styles(shown: GlobeRun) -> Iterator[str]:
    own, *others = shown.flights
    for one, number in ((own, 0), *((other, 1) for other in others[:1])):
        yield from _style(f"aircraft-{number}", one.colour, _PLANE, 0.7, 2)
    for group in sorted({one.group for one in shown.tracks}):
        yield from _style(f"track-{group}", shown.marks[group].colour, _DOT, 0.5, 1.5)
    for level, colour in enumerate(LEVELS_ON_DARK, start=1):
        yield from _style(f"level-{level}", colour, _RING, 0.9, 2 + level)
    for sensor in sorted({one.sensor for one in shown.seen}):
        mark = shown.marks[sensor]
        # Names of detections are in the list beside the globe: on it they would cover everything.
        yield from _style(
            f"sensor-{sensor}", mark.colour, _ICONS.get(mark.marker, _DOT), 0.4, 1, named=0
        )


def _style(
    name: str, colour: str, icon: str, scale: float, width: float, named: float = 0.8
) -> Iterator[str]:
    painted = _kml_colour(colour)
    yield f'<Style id="{_xml_id(name)}">'
    yield (
        f"<IconStyle><color>{painted}</color><scale>{scale}</scale>"
        f"<Icon><href>{_ICON.format(icon)}</href></Icon></IconStyle>"
    )
    yield f"<LabelStyle><color>{painted}</color><scale>{named}</scale></LabelStyle>"
    yield f"<LineStyle><color>{painted}</color><width>{width}</width></LineStyle>"
    yield "</Style>"


def _kml_colour(colour: str) -> str:
    """Return a colour as KML has it: opacity, blue, green, red."""
    return f"ff{colour[5:7]}{colour[3:5]}{colour[1:3]}".lower()


def _xml_id(name: str) -> str:
    """Return a name as an XML identifier: all but ASCII letters, digits, - and _ as hex codes."""
    return "".join(
        c if c.isascii() and (c.isalnum() or c in "-_") else f".{ord(c):x}" for c in name
    )


def _folder(name: str, content: Sequence[str]) -> list[str]:
    return (
        [f"<Folder><name>{_escaped_xml_text(name)}</name>", *content, "</Folder>"]
        if content
        else []
    )


def _courses(courses: Sequence[Course], style: str, geoid_m: float) -> list[str]:
    lines = []
    for number, one in enumerate(courses):
        if style == "aircraft":
            of_one = f"aircraft-{min(number, 1)}"
        else:
            of_one = f"level-{min(one.level, len(LEVELS_ON_DARK))}" if one.level else style
        lines += [
            f"<Placemark><name>{_escaped_xml_text(one.name)}</name>",
            f"<styleUrl>#{_xml_id(of_one)}</styleUrl><gx:Track>",
            "<altitudeMode>absolute</altitudeMode>",
            *(f"<when>{iso_time(t)}</when>" for t in one.time_s.tolist()),
            *_coordinate_elements(one.position, geoid_m),
            "</gx:Track></Placemark>",
        ]
    return lines


def _coordinate_elements(position: FloatArray, geoid_m: float) -> Iterator[str]:
    for lon, lat, alt in position.tolist():
        yield f"<gx:coord>{lon} {lat} {alt - geoid_m}</gx:coord>"


def _points(seen: Sequence[DetectedPlace], geoid_m: float) -> list[str]:
    lines = []
    for one in seen:
        lon, lat, alt = one.position
        lines += [
            f"<Placemark><name>{_escaped_xml_text(one.name)}</name>",
            f"<TimeStamp><when>{iso_time(one.time_s)}</when></TimeStamp>",
            f"<styleUrl>#{_xml_id(f'sensor-{one.sensor}')}</styleUrl><Point>",
            f"<altitudeMode>absolute</altitudeMode>"
            f"<coordinates>{lon},{lat},{alt - geoid_m}</coordinates>",
            "</Point></Placemark>",
        ]
    return lines


def _escaped_xml_text(text: str) -> str:
    return escape(escape_unprintable(text))
