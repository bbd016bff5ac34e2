"""Files of recorded flights, written by the public specifications of their formats.

A fix is (time in s since 1970, latitude, longitude in deg, altitude in m); a flight is a list of
them.
"""

import random
import struct
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from components.formats.csv_file import recording_of_table
from components.formats.receiver_logs import UNKNOWN_JSON, parse_receiver_log
from components.formats.recorded.known_kinds import recording_of_file
from components.formats.reports import build_recording
from components.formats.text_rows import (
    Problems,
    TrafficFileError,
    iterate_lines,
    read_content,
    text_of,
)

Fix = tuple[float, float, float, float]
Flights = Mapping[str, Sequence[Fix]]


def _utc(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat().replace("+00:00", "Z")


def gpx(flights: Flights) -> bytes:
    """Tracks of GPX 1.1."""
    tracks = "".join(
        f"<trk><name>{name}</name><trkseg>"
        + "".join(
            f'<trkpt lat="{lat!r}" lon="{lon!r}"><ele>{alt!r}</ele><time>{_utc(t)}</time></trkpt>\n'
            for t, lat, lon, alt in fixes
        )
        + "</trkseg></trk>\n"
        for name, fixes in flights.items()
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1" creator="test" '
        f'xmlns="http://www.topografix.com/GPX/1/1">\n{tracks}</gpx>\n'
    ).encode()


def kml(flights: Flights, *, points: bool = False) -> bytes:
    """Tracks of KML: ``gx:Track``, or a placemark with a time stamp for each fix."""
    parts = []
    for name, fixes in flights.items():
        if points:
            parts += [
                f"<Placemark><name>{_utc(t)}</name><TimeStamp><when>{_utc(t)}</when></TimeStamp>"
                "<Point><altitudeMode>absolute</altitudeMode>"
                f"<coordinates>{lon!r},{lat!r},{alt!r}</coordinates></Point></Placemark>\n"
                for t, lat, lon, alt in fixes
            ]
            continue
        whens = "".join(f"<when>{_utc(t)}</when>\n" for t, *_ in fixes)
        coords = "".join(f"<gx:coord>{o!r} {a!r} {h!r}</gx:coord>\n" for _, a, o, h in fixes)
        parts.append(
            f"<Placemark><name>{name}</name><gx:Track><altitudeMode>absolute</altitudeMode>\n"
            f"{whens}{coords}</gx:Track></Placemark>\n"
        )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" '
        'xmlns:gx="http://www.google.com/kml/ext/2.2">\n'
        f"<Document><name>{next(iter(flights))}</name>\n{''.join(parts)}</Document></kml>\n"
    ).encode()


def _dm(angle: float, width: int, letters: str) -> str:
    thousandths = round(abs(angle) * 60_000)
    degrees, rest = divmod(thousandths, 60_000)
    return f"{degrees:0{width}d}{rest:05d}{letters[angle < 0]}"


def igc(fixes: Sequence[Fix], pressure_m: Sequence[int] | None = None, name: str = "TST") -> bytes:
    """Records A, H and B; without pressures their field is zeros, as without a sensor."""
    day = datetime.fromtimestamp(fixes[0][0], UTC)
    lines = [f"AXXXTEST\r\nHFDTEDATE:{day:%d%m%y},01\r\nHFGIDGLIDERID:{name}\r\n"]
    for k, (t, lat, lon, alt) in enumerate(fixes):
        pressed = 0 if pressure_m is None else pressure_m[k]
        clock = datetime.fromtimestamp(t, UTC)
        place = f"{_dm(lat, 2, 'NS')}{_dm(lon, 3, 'EW')}"
        lines.append(f"B{clock:%H%M%S}{place}A{pressed:05d}{round(alt):05d}\r\n")
    return "".join(lines).encode()


_ULOG_CODES = {"uint64_t": "Q", "double": "d", "float": "f", "int32_t": "i", "uint32_t": "I",
               "uint16_t": "H", "uint8_t": "B"}  # fmt: skip


def ulog(topics: Mapping[str, tuple[str, Iterable[Sequence[float]]]]) -> bytes:
    """Topics of PX4: fields as ``"double lat;double lon"`` after the time stamp, and rows."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    parts = [b"ULog\x01\x12\x35\x01", struct.pack("<Q", 0), message("B", bytes(40))]
    for name, (fields, _) in topics.items():
        parts.append(message("F", f"{name}:uint64_t timestamp;{fields};".encode()))
    data = []
    for number, (name, (fields, rows)) in enumerate(topics.items()):
        parts.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
        form = "<HQ"
        for one in fields.split(";"):
            kind, _, count = one.split()[0].partition("[")
            form += _ULOG_CODES[kind] * int(count.rstrip("]") or 1)
        for row in rows:
            data.append((row[0], message("D", struct.pack(form, number, int(row[0]), *row[1:]))))
    return b"".join(parts + [body for _, body in sorted(data, key=lambda one: one[0])])


#: Form and extra byte of each message of MAVLink's common dialect that is written here.
_MAVLINK = {30: ("<I6f", 39), 33: ("<IiiiihhhH", 104),
            246: ("<IiiiHHhHHB9sBB", 184)}  # fmt: skip


def _crc(data: bytes) -> int:
    """CRC-16/MCRF4XX, bit by bit, as MAVLink's specification has it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


def tlog(messages: Iterable[tuple[float, int, int, Sequence[object]]], version: int = 2) -> bytes:
    """Messages of MAVLink, each after the time (s) at which a ground station had it.

    A message is its time, its sender, its number and its values in the order on the wire.
    """
    parts = []
    for sequence, (time_s, system, number, values) in enumerate(messages):
        form, extra = _MAVLINK[number]
        payload = struct.pack(form, *values)
        low = sequence & 255
        if version == 1:
            head = struct.pack("<BBBBB", len(payload), low, system, 1, number)
            start = b"\xfe"
        else:
            payload = payload.rstrip(b"\0") or b"\0"
            head = struct.pack("<BBBBBB", len(payload), 0, 0, low, system, 1)
            head += number.to_bytes(3, "little")
            start = b"\xfd"
        crc = _crc(head + payload + bytes([extra]))
        stamp = round(time_s * 1e6).to_bytes(8, "big")
        parts.append(stamp + start + head + payload + struct.pack("<H", crc))
    return b"".join(parts)


def _datagram(payload: bytes) -> bytes:
    """A frame of Ethernet with IPv4 and UDP."""
    udp = struct.pack(">4H", 8600, 8600, 8 + len(payload), 0) + payload
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, bytes(4), bytes(4))
    return bytes(12) + b"\x08\x00" + ip + udp


def pcap(payloads: Iterable[tuple[float, bytes]]) -> bytes:
    """Datagrams with the times at which they were captured."""
    parts = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)]
    for time_s, payload in payloads:
        frame = _datagram(payload)
        whole = int(time_s)
        parts.append(struct.pack("<4I", whole, round((time_s - whole) * 1e6), *[len(frame)] * 2))
        parts.append(frame)
    return b"".join(parts)


def pcapng(payloads: Iterable[tuple[float, bytes]]) -> bytes:
    """The same in blocks, with times in ns."""

    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)

    parts = [block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))]
    nanoseconds = struct.pack("<HHB3xHH", 9, 1, 9, 0, 0)
    parts.append(block(1, struct.pack("<HHI", 1, 0, 65535) + nanoseconds))
    for time_s, payload in payloads:
        frame, ticks = _datagram(payload), round(time_s * 1e9)
        head = struct.pack("<5I", 0, ticks >> 32, ticks & 0xFFFFFFFF, *[len(frame)] * 2)
        parts.append(block(6, head + frame))
    return b"".join(parts)


def assert_refused_or_whole(path: Path, whole: bytes) -> None:
    """Check that damaged copies of a file, read from a path, give one error or whole flights."""
    rng = random.Random(path.name)
    for _ in range(50):
        raw = bytearray(whole)
        for _ in range(rng.choice((1, 1, 2, 5))):
            at = rng.randrange(len(raw) or 1)
            kind = rng.random()
            if kind < 0.4:
                raw[at : at + 1] = rng.randbytes(1)
            elif kind < 0.6:
                del raw[at : at + rng.randrange(1, 40)]
            elif kind < 0.8:
                raw[at:at] = rng.randbytes(rng.randrange(1, 9))
            else:
                raw = raw[: max(at, 1)]
        path.write_bytes(bytes(raw))
        try:
            file = recording_of_file(path).flights()
        except TrafficFileError as error:
            assert 1 <= len(error.problems) <= 20
            continue
        for one in file.aircraft:
            states = one.at(one.sample_times_s).arrays()
            assert all(np.isfinite(values).all() for values in states)


def read_csv(path, ownship=None, altitude=None):
    """Return the flights of a CSV file or a receiver's log, as the readers of any kind do."""
    problems = Problems(str(path))
    data = read_content(Path(path), problems)
    log = parse_receiver_log(problems, data)
    if log is not None:
        return build_recording(problems, log, ownship, altitude).flights()
    if data[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"[")):
        problems.fail(UNKNOWN_JSON)
    lines = iterate_lines(text_of(data, problems))
    return recording_of_table(problems, lines, ownship, altitude).flights()
