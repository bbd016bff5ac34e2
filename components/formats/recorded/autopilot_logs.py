"""Read autopilots' logs: PX4's ``.ulg``, and MAVLink as ground stations record it, ``.tlog``.

Both hold the vehicle's own flight, and the aircraft that its ADS-B receiver heard.
"""

import binascii
import math
import struct
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import NamedTuple

import numpy as np

from components.formats.recorded.ulog_file import Topic, read_topics
from components.formats.reports import ABOVE_SEA, Log, PositionReport
from components.formats.text_rows import Problems
from dsa_des.arrays.types import AnyArray, FloatArray

#: Bits of ADSB_VEHICLE's and transponder_report's flags: what of it is valid.
_COORDS, _ALTITUDE, _HEADING, _VELOCITY, _CALLSIGN, _VERTICAL = 1, 2, 4, 8, 16, 128
_GEOMETRIC = 1


# -- PX4 ------------------------------------------------------------------------------------------

_POSITIONS = ("vehicle_global_position", "vehicle_gps_position", "sensor_gps")
_OTHERS = ("vehicle_local_position", "vehicle_attitude", "transponder_report")


def ulog_log(problems: Problems, data: bytes, stem: str) -> Log:
    """Return a PX4 log's flight of the vehicle and of the aircraft its receiver reported.

    Times are UTC where GNSS said it, else those since the start. The own heights are above mean sea
    level; of the others they are pressure altitudes where they are said to be.
    """
    problems.of = "sample"
    warnings: list[str] = []
    topics = read_topics(problems, data, [*_POSITIONS, *_OTHERS], warnings)
    callsigns: dict[str, str] = {}

    def each() -> Iterator[tuple[int, PositionReport]]:
        own, heard = _own_of_ulog(problems, topics, stem), _reports_heard_by_px4(topics, callsigns)
        try:
            yield from enumerate(chain(own, heard), start=1)
        except (KeyError, IndexError, TypeError) as error:
            what = f"{type(error).__name__}: {error}"
            problems.fail(f"its topics are not as PX4 writes them ({what})")

    return Log("a PX4 log (ULog)", "m and m/s", each(), callsigns, "samples", warnings, ABOVE_SEA)


def _boot_time_utc_s(topics: Mapping[str, Topic]) -> float:
    """Return the autopilot's start in UTC (s since 1970) by its GNSS receiver; 0 if unknown."""
    for name in _POSITIONS[1:]:
        gps = topics.get(name, {})
        if "time_utc_usec" in gps:
            utc, boot = (np.asarray(gps[key], float) for key in ("time_utc_usec", "timestamp"))
            if (known := utc > 1e14).any():
                return float(np.median((utc - boot)[known])) / 1e6
    return 0.0


def _own_of_ulog(
    problems: Problems, topics: Mapping[str, Topic], stem: str
) -> Iterator[PositionReport]:
    name = next((name for name in _POSITIONS if len(topics.get(name, {}).get("timestamp", ()))), "")
    if not name:
        problems.fail(f"holds no position: one of the topics {', '.join(_POSITIONS)} is needed")
    with np.errstate(all="ignore"):
        yield from _own_position_reports(topics, name, stem)


#: So many messages are taken at a time.
_AT_ONCE = 8192


def _own_position_reports(
    topics: Mapping[str, Topic], name: str, stem: str
) -> Iterator[PositionReport]:
    utc_less_boot_s = _boot_time_utc_s(topics)
    for first in range(0, len(topics[name]["timestamp"]), _AT_ONCE):
        block = slice(first, first + _AT_ONCE)
        own = {key: np.asarray(values[block], float) for key, values in topics[name].items()}
        boot_s = own["timestamp"] / 1e6
        if "latitude_deg" in own:
            lat, lon, alt = own["latitude_deg"], own["longitude_deg"], own["altitude_msl_m"]
        elif name == _POSITIONS[0]:
            lat, lon, alt = own["lat"], own["lon"], own["alt"]
        else:
            lat, lon, alt = own["lat"] * 1e-7, own["lon"] * 1e-7, own["alt"] * 1e-3
        move, angles = (
            _track_speed_and_climb(topics, own, boot_s),
            _latest_yaw_pitch_roll_deg(topics, boot_s),
        )
        fix = own.get("fix_type", np.full(len(lat), 3.0)) >= 2
        columns = np.stack([boot_s + utc_less_boot_s, lat, lon, alt, *move, *angles])
        for time_s, lat_deg, lon_deg, alt_m, *others in columns[:, fix].T.tolist():
            yield PositionReport(stem, time_s, lat_deg, lon_deg, alt_m, None, *others)


def _interpolated_values(times_s: FloatArray, values: AnyArray, wanted_s: FloatArray) -> FloatArray:
    return np.interp(wanted_s, times_s, np.asarray(values, float))


def _track_speed_and_climb(
    topics: Mapping[str, Topic], own: dict[str, FloatArray], boot_s: FloatArray
) -> list[FloatArray]:
    """Return track (deg), ground speed and climb (m/s) at some times; NaN where there are none."""
    local = topics.get("vehicle_local_position", {})
    if "vel_n_m_s" in own:
        north, east, down = (own[f"vel_{axis}_m_s"] for axis in "ned")
    elif "vel_n" in own:
        north, east, down = (own[f"vel_{axis}"] for axis in "ned")
    elif len(local.get("timestamp", ())) and "vx" in local:
        known_s = np.asarray(local["timestamp"], float) / 1e6
        north, east, down = (
            _interpolated_values(known_s, local[key], boot_s) for key in ("vx", "vy", "vz")
        )
    else:
        return [np.full(len(boot_s), np.nan)] * 3
    return [np.degrees(np.arctan2(east, north)) % 360.0, np.hypot(north, east), -down]


def _latest_yaw_pitch_roll_deg(topics: Mapping[str, Topic], boot_s: FloatArray) -> list[FloatArray]:
    """Return yaw, pitch and roll (deg) of the last attitude before each time."""
    known = topics.get("vehicle_attitude", {})
    if not len(known.get("timestamp", ())) or "q" not in known:
        return [np.full(len(boot_s), np.nan)] * 3
    times_s = np.asarray(known["timestamp"], float) / 1e6
    at = np.clip(np.searchsorted(times_s, boot_s, side="right") - 1, 0, None)
    w, x, y, z = np.asarray(known["q"][at], float).T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return [np.degrees(angle) for angle in (yaw, pitch, roll)]


def _reports_heard_by_px4(
    topics: Mapping[str, Topic], callsigns: dict[str, str]
) -> Iterator[PositionReport]:
    heard = topics.get("transponder_report", {})
    if not len(heard.get("timestamp", ())):
        return
    offset_s = _boot_time_utc_s(topics)
    keys = (
        "timestamp", "icao_address", "lat", "lon", "altitude_type", "altitude", "heading",
        "hor_velocity", "ver_velocity", "flags", "tslc",
    )  # fmt: skip
    letters = heard["callsign"][:, :8].tolist()
    rows = zip(*(np.asarray(heard[key], float).tolist() for key in keys), strict=True)
    for k, row in enumerate(rows):
        time, address, lat, lon, kind, alt, heading, fast, climb, flags, age = row
        text = "".join(chr(letter & 127) for letter in letters[k])
        heard_at_s = time / 1e6 + offset_s - age
        yield _transponder_report(
            callsigns, int(address), text, heard_at_s, lat, lon, kind, alt,
            math.degrees(heading), fast, climb, int(flags),
        )  # fmt: skip


def _transponder_report(
    callsigns: dict[str, str], address: int, callsign: str, time_s: float, lat: float, lon: float,
    kind: float, alt: float, heading: float, fast: float, climb: float, flags: int,
) -> PositionReport:  # fmt: skip
    """Return a report of an aircraft the autopilot's receiver heard; in degrees, m and m/s."""
    name = f"{address:06x}"
    if flags & _CALLSIGN and callsign.strip("\0 "):
        callsigns[name] = callsign.strip("\0 ")
    height = alt if flags & _ALTITUDE else None
    has_place, moves = flags & _COORDS, flags & _HEADING and flags & _VELOCITY
    return PositionReport(
        name, time_s, lat if has_place else None, lon if has_place else None,
        height if kind == _GEOMETRIC else None, None if kind == _GEOMETRIC else height,
        heading % 360.0 if moves else None, fast if moves else None, climb if moves else None,
    )  # fmt: skip


# -- MAVLink --------------------------------------------------------------------------------------

_V1, _V2 = 0xFE, 0xFD
_SIGNED, _SIGNATURE = 1, 13
_STAMP = 8
#: From 2000 to 2100, µs.
_YEARS_US = (946_684_800_000_000, 4_102_444_800_000_000)
_ATTITUDE, _POSITION, _VEHICLE = 30, 33, 246
#: Of messages of the common dialect, their values as they are sent, and what ends their checksum.
_MESSAGES = {
    _ATTITUDE: (struct.Struct("<I6f"), 39),
    _POSITION: (struct.Struct("<IiiiihhhH"), 104),
    _VEHICLE: (struct.Struct("<IiiiHHhHHB9sBB"), 184),
}
#: How old an attitude may be beside a position, s.
_LASTS_S = 1.0
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


class _Frame(NamedTuple):
    """A message with its time and its sender."""

    time_s: float
    system: int
    kind: int
    payload: bytes


def is_tlog(data: bytes) -> bool:
    """Return whether data begins with two MAVLink frames, each after a time."""
    end = _end_of_frame(data, 0)
    return end is not None and (end == len(data) or _end_of_frame(data, end) is not None)


def _end_of_frame(data: bytes, at: int) -> int | None:
    """Return the index after the frame at ``at`` with its time; None if no frame begins there."""
    if at + _STAMP + 3 > len(data) or data[at + _STAMP] not in (_V1, _V2):
        return None
    stamp = int.from_bytes(data[at : at + _STAMP], "big")
    if not _YEARS_US[0] <= stamp <= _YEARS_US[1]:
        return None
    size = data[at + _STAMP + 1]
    if data[at + _STAMP] == _V1:
        return at + _STAMP + 8 + size
    signed = _SIGNATURE if data[at + _STAMP + 2] & _SIGNED else 0
    return at + _STAMP + 12 + size + signed


def tlog_log(problems: Problems, data: bytes, stem: str) -> Log:
    """Return a log of the vehicles' flights in a tlog, and of the aircraft they received.

    Times are those of the ground station. Heights of vehicles are above mean sea level.
    """
    problems.of = "frame"
    callsigns: dict[str, str] = {}
    lost: list[int] = []
    warnings: list[str] = []
    frames = _numbered_wanted_frames(data, lost)

    def each() -> Iterator[tuple[int, PositionReport]]:
        yield from _reports_from_frames(problems, frames, stem, callsigns)
        if lost:
            what = "frame is" if len(lost) == 1 else "frames are"
            warnings.append(f"{len(lost)} {what} damaged and left out")

    units = "1e-7 deg, mm and cm/s"
    return Log("a MAVLink log (tlog)", units, each(), callsigns, "frames", warnings, ABOVE_SEA)


def _numbered_wanted_frames(data: bytes, lost: list[int]) -> Iterator[tuple[int, _Frame]]:
    """Yield the wanted complete frames with their numbers, skipping damaged ones."""
    at, number = 0, 0
    while at < len(data):
        end = _end_of_frame(data, at)
        if end is None or end > len(data):
            lost.append(number)
            marks = [k for k in (data.find(b"\xfe", at + 9), data.find(b"\xfd", at + 9)) if k >= 0]
            while marks and _end_of_frame(data, min(marks) - _STAMP) is None:
                after = min(marks) + 1
                marks = [
                    k for k in (data.find(b"\xfe", after), data.find(b"\xfd", after)) if k >= 0
                ]
            if not marks:
                return
            at = min(marks) - _STAMP
            continue
        number += 1
        start = at + _STAMP
        is_first = data[start] == _V1
        head = 6 if is_first else 10
        kind = (
            data[start + 5] if is_first else int.from_bytes(data[start + 7 : start + 10], "little")
        )
        if kind in _MESSAGES:
            body = start + head + data[start + 1]
            summed = data[start + 1 : body] + bytes([_MESSAGES[kind][1]])
            reverse = binascii.crc_hqx(summed.translate(_REVERSED), 0xFFFF)
            if int(f"{reverse:016b}"[::-1], 2) != int.from_bytes(data[body : body + 2], "little"):
                lost.append(number)
            else:
                system = data[start + 3] if is_first else data[start + 5]
                time_s = int.from_bytes(data[at:start], "big") / 1e6
                yield number, _Frame(time_s, system, kind, data[start + head : body])
        at = end


def _reports_from_frames(
    problems: Problems, frames: Iterator[tuple[int, _Frame]], stem: str,
    callsigns: dict[str, str],
) -> Iterator[tuple[int, PositionReport]]:  # fmt: skip
    attitude: dict[int, tuple[float, tuple[float, ...]]] = {}
    systems: dict[int, str] = {}
    last: dict[str, tuple[float, float]] = {}
    own = False
    for number, frame in frames:
        form = _MESSAGES[frame.kind][0]
        # Zeros at the end are not sent.
        values = form.unpack(frame.payload[: form.size].ljust(form.size, b"\0"))
        if frame.kind == _ATTITUDE:
            roll, pitch, yaw = (math.degrees(angle) for angle in values[1:4])
            attitude[frame.system] = frame.time_s, (yaw % 360.0, pitch, roll)
        elif frame.kind == _POSITION:
            own = True
            name = systems.setdefault(
                frame.system, stem if not systems else f"{stem} {frame.system}"
            )
            _, lat, lon, alt, _, north, east, down, _ = values
            if (lat, lon) == (0, 0):  # before the first fix
                continue
            at, angles = attitude.get(frame.system, (-math.inf, ()))
            recent = angles if frame.time_s - at <= _LASTS_S else (None,) * 3
            track = math.degrees(math.atan2(east, north)) % 360.0
            speed = math.hypot(north, east) / 100.0
            yield number, PositionReport(
                name, frame.time_s, lat * 1e-7, lon * 1e-7, alt * 1e-3, None, track, speed,
                -down / 100.0, *recent,
            )  # fmt: skip
        else:
            (address, lat, lon, alt, heading, fast, climb, flags, _, kind, text, _, age) = values
            report = _transponder_report(
                callsigns, address, text.decode("latin-1"), frame.time_s - age, lat * 1e-7,
                lon * 1e-7, kind, alt * 1e-3, heading / 100.0, fast / 100.0, climb / 100.0, flags,
            )  # fmt: skip
            if last.get(report.name) != (report.lat, report.lon):  # else it is the last one again
                last[report.name] = report.lat, report.lon
                yield number, report
    if not own:
        problems.fail("holds no position of a vehicle (GLOBAL_POSITION_INT)")
