"""Take what was sent over UDP out of captures of a network: pcap and pcapng."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

from components.formats.text_rows import Problems

#: Magic numbers of pcap: byte order, and seconds a count of the second half of the time is worth.
_PCAP = {
    b"\xd4\xc3\xb2\xa1": ("<", 1e-6), b"\xa1\xb2\xc3\xd4": (">", 1e-6),
    b"\x4d\x3c\xb2\xa1": ("<", 1e-9), b"\xa1\xb2\x3c\x4d": (">", 1e-9),
}  # fmt: skip
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_SECTION, _INTERFACE, _SIMPLE, _ENHANCED = 0x0A0D0D0A, 1, 3, 6
#: How long the header of each kind of link is, and where in it the protocol stands.
_LINKS = {0: (4, None), 1: (14, 12), 12: (0, None), 101: (0, None), 113: (16, 14), 228: (0, None),
          229: (0, None), 276: (20, 0)}  # fmt: skip
_VLANS, _IPV4, _IPV6, _UDP = (0x8100, 0x88A8), 0x0800, 0x86DD, 17


class Packet(NamedTuple):
    """A packet as it was captured: when, on which kind of link, and its bytes."""

    time_s: float
    link: int
    content: bytes


def is_capture(data: bytes) -> bool:
    """Return whether data is a packet capture."""
    return data[:4] in _PCAP or data[:4] == _PCAPNG


def udp_times_and_payloads(problems: Problems, data: bytes) -> list[tuple[float, bytes]]:
    """Return a capture's UDP datagrams, each its time (s) and content; TrafficFileError if none."""
    problems.of = "packet"
    packets = _read_pcap(problems, data) if data[:4] in _PCAP else _read_pcapng(problems, data)
    found, links = [], set()
    for packet in packets:
        links.add(packet.link)
        payload = _udp_payload(packet)
        if payload:
            found.append((packet.time_s, payload))
    if not found:
        kinds = ", ".join(map(str, sorted(links)))
        problems.fail(
            f"the capture holds no UDP datagrams (its packets are of link type {kinds})"
            if links else "the capture holds no packets"
        )  # fmt: skip
    return found


def _read_pcap(problems: Problems, data: bytes) -> Iterator[Packet]:
    order, fraction_s = _PCAP[data[:4]]
    if len(data) < 24:
        problems.fail("the capture is cut off in its header")
    link = struct.unpack(f"{order}I", data[20:24])[0] & 0xFFFF
    at, number = 24, 0
    while at < len(data):
        number += 1
        if at + 16 > len(data):
            problems.fail("the capture is cut off", line=number)
        seconds, part, size, _ = struct.unpack(f"{order}4I", data[at : at + 16])
        at += 16
        if at + size > len(data):
            problems.fail(f"has {size} bytes, but the capture ends before", line=number)
        yield Packet(seconds + part * fraction_s, link, data[at : at + size])
        at += size


def _read_pcapng(problems: Problems, data: bytes) -> Iterator[Packet]:
    order = "<"
    interfaces: list[tuple[int, float]] = []
    at, number = 0, 0
    while at < len(data):
        number += 1
        if at + 12 > len(data):
            problems.fail("the capture is cut off", line=number)
        if data[at : at + 4] == _PCAPNG:
            order = "<" if data[at + 8 : at + 12] == b"\x4d\x3c\x2b\x1a" else ">"
            interfaces = []
        kind, size = struct.unpack(f"{order}2I", data[at : at + 8])
        if size < 12 or size % 4 or at + size > len(data):
            problems.fail(f"a block of {size} bytes does not fit into the capture", line=number)
        body = data[at + 8 : at + size - 4]
        at += size
        try:
            if kind == _INTERFACE:
                interfaces.append(
                    (struct.unpack(f"{order}H", body[:2])[0], _time_resolution_s(body, order))
                )
            elif kind == _ENHANCED:
                which, high, low, kept = struct.unpack(f"{order}4I", body[:16])
                link, tick_s = interfaces[which]
                yield Packet(((high << 32) + low) * tick_s, link, body[20 : 20 + kept])
            elif kind == _SIMPLE:
                yield Packet(0.0, interfaces[0][0], body[4:])
        except (struct.error, IndexError):
            problems.fail("the block is damaged", line=number)


def _time_resolution_s(body: bytes, order: str) -> float:
    """Return the unit (s) in which an interface's times are counted, from its options."""
    at = 8
    while at + 4 <= len(body):
        code, size = struct.unpack(f"{order}2H", body[at : at + 4])
        if code == 9 and size:
            value = body[at + 4]
            return 2.0 ** -(value & 127) if value & 128 else 10.0**-value
        at += 4 + size + -size % 4
        if code == 0:
            break
    return 1e-6


def _udp_payload(packet: Packet) -> bytes | None:
    """Return the content of a packet's UDP datagram; None if it is other or only a fragment."""
    data = packet.content
    if packet.link not in _LINKS:
        return None
    head, at = _LINKS[packet.link]
    if at is not None:
        while int.from_bytes(data[at : at + 2], "big") in _VLANS and packet.link == 1:
            head, at = head + 4, at + 4
        if int.from_bytes(data[at : at + 2], "big") not in (_IPV4, _IPV6):
            return None
    ip = data[head:]
    if not ip:
        return None
    if ip[0] >> 4 == 4:
        start = 4 * (ip[0] & 15)
        if len(ip) < 20 or ip[9] != _UDP or int.from_bytes(ip[6:8], "big") & 0x3FFF:
            return None
        ip = ip[: int.from_bytes(ip[2:4], "big") or len(ip)]
    elif ip[0] >> 4 == 6:
        start = 40
        if len(ip) < 40 or ip[6] != _UDP:
            return None
    else:
        return None
    udp = ip[start:]
    return udp[8 : int.from_bytes(udp[4:6], "big")] if len(udp) >= 8 else None
