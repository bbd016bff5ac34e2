"""Reports of aircraft one by one, as receivers, trackers and autopilots log them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from components.formats.recording import Recording
from components.formats.sample_columns import Altitude, SampleColumn, convert_to_enu_velocity
from components.formats.sample_table import SampleTable
from components.formats.text_rows import Problems


class PositionReport(NamedTuple):
    """One position report in degrees and SI units; a field may hold None or text for no number."""

    name: str
    time: Any
    lat: Any = None
    lon: Any = None
    geometric: Any = None
    barometric: Any = None
    trk: Any = None
    gs: Any = None
    vs: Any = None
    yaw: Any = None
    pitch: Any = None
    roll: Any = None


class Log(NamedTuple):
    """A file of position reports: its kind, its units, and its reports with their places in it.

    `callsigns` are known, by the names of aircraft, when the reports are read; `rows` is what its
    places count.
    """

    kind: str
    units: str
    reports: Iterator[tuple[int, PositionReport]]
    callsigns: Mapping[str, str]
    rows: str = "reports"
    #: What its reader has to say of it, when the reports are read.
    warnings: Sequence[str] = ()
    #: What its geometric heights are above; of receivers and flight recorders the ellipsoid.
    geometric: str = "geometric altitude"


#: Of GPX, KML and autopilots.
ABOVE_SEA = "geometric altitude above mean sea level"
_MOVES = {"trk": "track", "gs": "speed", "vs": "climb rate"}
_ANGLES = ("yaw", "pitch", "roll")
#: Where values stand in a report.
_PLACE = {name: place for place, name in enumerate(PositionReport._fields)}


def build_recording(
    problems: Problems, log: Log, ownship: str | None = None, altitude: Altitude | None = None
) -> Recording:
    """Return a `Recording` of a log; the ownship is the first or that of the name or callsign.

    Heights are pressure altitudes, of an aircraft that reports none its geometric height; with
    `altitude`, those of that kind alone. Aircraft of one report are there at that instant only. All
    that is wrong is one `TrafficFileError`.
    """
    kinds: list[Altitude] = ["barometric", "geometric"] if altitude is None else [altitude]
    heights = dict(zip(("alt", "alt instead"), kinds, strict=False))
    headers = {
        "time": "time", "lat": "lat", "lon": "lon",
        **{
            key: log.geometric if kind == "geometric" else f"{kind} altitude"
            for key, kind in heights.items()
        },
        **_MOVES, **{angle: angle for angle in _ANGLES},
    }  # fmt: skip
    columns = {
        key: SampleColumn(k + 1, header, 1.0) for k, (key, header) in enumerate(headers.items())
    }
    table = SampleTable(
        problems, ("name", *headers.values()), 0, columns, optional=(*_MOVES, *_ANGLES), gaps=True,
        instead={} if altitude else {"alt": "alt instead"}, rows=log.rows, least=1,
        seldom=(*_MOVES, *_ANGLES),
    )  # fmt: skip
    table.notes.harmless.append(f"read as {log.kind}, {log.units}")
    places = [_PLACE[str(heights.get(key, key))] for key in headers]
    for number, one in log.reports:
        table.add_numbers(number, one.name, [one[place] for place in places])
    table.notes.warnings += log.warnings
    named = [name for name, callsign in log.callsigns.items() if callsign == ownship]
    own = named[0] if len(named) == 1 else ownship
    return table.recording(
        own, convert_to_enu_velocity, kind=log.kind, units=log.units, callsigns=log.callsigns
    )
