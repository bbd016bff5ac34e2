"""OpenSky's history in CSV and Parquet, tables of one flight, and ASTERIX in captures."""

import json
import struct
from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import recorded_files as write

from components.formats.asterix_records import ADS_B, PLOTS, AsterixRecord, encode_records
from components.formats.measurement_file import read_measurements
from components.formats.recorded import captures
from components.formats.recorded.known_kinds import asterix_blocks_of_capture, recording_of_file
from components.formats.text_rows import Problems, TrafficFileError

START = 1_717_243_200


def history() -> dict[str, list]:
    """State vectors each second; the position of the second aircraft is new every third one."""
    rows: dict[str, list] = {
        name: []
        for name in ("time", "icao24", "lat", "lon", "velocity", "heading", "vertrate", "callsign",
                     "onground", "squawk", "baroaltitude", "geoaltitude", "lastposupdate",
                     "lastcontact")
    }  # fmt: skip
    for k in range(12):
        for name, at in (("4b1805", k), ("3c6444", k - k % 3)):
            one = (
                START + k, name, 47 + 0.001 * at, 8.0, 111.2, 0.0, None if k == 4 else 0.0,
                f"SWR{name[0]}  ", False, None, 1000.0 + k, None if name[0] == "3" else 1050.0 + k,
                START + at - 0.25, START + k - 0.1,
            )  # fmt: skip
            for column, value in zip(rows.values(), one, strict=True):
                column.append(value)
    return rows


def as_csv(rows: dict[str, list]) -> bytes:
    lines = [",".join(rows)]
    lines += [
        ",".join("" if v is None else str(v) for v in row)
        for row in zip(*rows.values(), strict=True)
    ]
    return "\n".join(lines).encode()


def as_parquet(tmp_path, rows, **columns) -> bytes:
    path = tmp_path / "made"
    pq.write_table(pa.table({**rows, **columns}), path)
    return path.read_bytes()


def read(tmp_path, name, data, **options):
    path = tmp_path / name
    path.write_bytes(data)
    return recording_of_file(path, **options)


def test_columns_as_pandas_writes_them(tmp_path):
    rows = history()
    records = [dict(zip(rows, one, strict=True)) for one in zip(*rows.values(), strict=True)]
    columns = {name: {str(k): v for k, v in enumerate(one)} for name, one in rows.items()}
    split = {"columns": [*rows], "data": [list(one.values()) for one in records]}
    plain = read(tmp_path, "a.json", json.dumps(records).encode()).samples
    assert len(plain["4b1805"]["time"]) == 12
    for document in (columns, split):
        found = read(tmp_path, "a.json", json.dumps(document).encode()).samples
        assert {name: one["lat"].tolist() for name, one in found.items()} == {
            name: one["lat"].tolist() for name, one in plain.items()
        }


def test_a_drone_s_table_with_clocks_past_midnight_and_no_names(tmp_path):
    lines = ["time(millisecond),name,latitude,longitude,height_above_takeoff(feet),"
             "altitude_above_seaLevel(feet)"]  # fmt: skip
    lines += [f"{100 * k},,47.0,{8 + 1e-5 * k:.5f},{k},{1000 + k}" for k in range(5)]
    found = read(tmp_path, "mine.csv", "\n".join(lines).encode())
    own = found.samples["mine"]
    assert own["time"] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert own["alt"] == pytest.approx([0.3048 * (1000 + k) for k in range(5)])
    assert found.notes.warnings == ["5 rows have no name: called mine"]
    late = ["time,id,lat,lon,alt"]
    late += [f"{hour:02d}:{minute:02d}:00,{name},47,8,{k}" for name in "ab" for k, (hour, minute)
             in enumerate([(20, 0), (23, 50), (0, 10), (3, 0)])]  # fmt: skip
    found = read(tmp_path, "late.csv", "\n".join(late).encode())
    for name in "ab":
        hours = found.samples[name]["time"] / 3600
        assert hours == pytest.approx([20, 23 + 5 / 6, 24 + 1 / 6, 27])


def as_json(rows: dict[str, list], *, lines: bool) -> bytes:
    records = [dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True)]
    return ("\n".join(map(json.dumps, records)) if lines else json.dumps(records)).encode()


@pytest.mark.parametrize("kind", ["csv", "parquet", "times", "json", "jsonl"])
def test_positions_of_opensky_count_when_they_were_received(tmp_path, kind):
    rows = history()
    data = as_csv(rows) if kind == "csv" else as_json(rows, lines=kind == "jsonl") if (
        kind.startswith("json")
    ) else as_parquet(
        tmp_path, rows, **({"lastposupdate": pa.array(
            [datetime.fromtimestamp(t, UTC) for t in rows["lastposupdate"]]
        )} if kind == "times" else {}),
    )  # fmt: skip
    found = read(tmp_path, f"states.{kind}", data)
    one, two = found.samples["4b1805"], found.samples["3c6444"]
    assert one["time"] == pytest.approx(START - 0.25 + np.arange(12), abs=1e-6)
    assert two["time"] == pytest.approx(START - 0.25 + 3 * np.arange(4), abs=1e-6)
    assert two["lat"] == pytest.approx([47.0, 47.003, 47.006, 47.009])
    # Geometric where there is one; the other has none.
    assert one["alt"].tolist() == [1050.0 + k for k in range(12)]
    assert two["alt"].tolist() == [1000.0 + 3 * k for k in range(4)]
    pressed = read(tmp_path, f"states.{kind}", data, altitude="barometric").samples["4b1805"]
    assert pressed["alt"].tolist() == [1000.0 + k for k in range(12)]


def test_a_table_without_names_is_the_flight_of_its_file(tmp_path):
    table = b"timestamp,latitude,longitude,altitude_ft\n1,47,8,1000\n2,47.001,8,1000\n"
    found = read(tmp_path, "morning.csv", table)
    assert list(found.samples) == ["morning"]
    assert found.samples["morning"]["alt"] == pytest.approx([304.8, 304.8])


def test_units_of_autopilots_and_cells_of_several_lines(tmp_path):
    table = (
        'time_us,id,lat_dege7,"lon (1e-7 deg)",alt_mm,speed_mph,track,vs,remark\n'
        '1000000,a,470000000,80000000,1000000,100,90,0,"one,\n\ntwo"\n'
        "2000000,a,470000000,80005868,1000000,100,90,0,\n"
        "2000000,a,470000000,80005868,1000000,100,90,0,\n"
    )
    found = read(tmp_path, "t.csv", table.encode())
    one = found.samples["a"]
    assert one["time"].tolist() == [1.0, 2.0] and one["lat"].tolist() == [47.0, 47.0]
    assert one["lon"] == pytest.approx([8.0, 8.0005868]) and one["alt"].tolist() == [1000.0] * 2
    assert one["ve"] == pytest.approx([44.704, 44.704])
    found.notes.summarize_aircraft_notes()
    assert found.notes.warnings == ["a: 1 of its samples stand there again and count once"]


def adsb(times=range(5)) -> list[bytes]:
    return [
        encode_records([AsterixRecord(ADS_B, 43_200.0 + t, {
            "number": 0x3C6444, "lat_deg": 47.0 + 0.001 * t, "lon_deg": 8.0,
            "flight_level_m": 1524.0,
        })])
        for t in times
    ]  # fmt: skip


@pytest.mark.parametrize("make", [write.pcap, write.pcapng])
def test_asterix_is_read_out_of_captures_with_their_day(tmp_path, make):
    pytest.importorskip("asterix", reason="needs asterix")
    sent = [(START + 0.4 + k, block) for k, block in enumerate(adsb())]
    sent.insert(2, (START + 1.5, b"GET / HTTP/1.1"))
    sent.insert(3, (START + 1.6, b"\x3e\x00\x05\xff\xff"))  # a block without its records
    found = read(tmp_path, "udp.dump", make(sent))
    (one,) = found.samples.values()
    assert one["time"] == pytest.approx(START + np.arange(5.0), abs=1 / 256)
    assert one["lat"] == pytest.approx(47.0 + 0.001 * np.arange(5), abs=1e-6)
    assert one["alt"] == pytest.approx([1524.0] * 5)
    assert found.notes.warnings == ["2 datagrams are no ASTERIX that can be read and were left out"]


def test_plots_of_a_radar_are_read_out_of_a_capture(tmp_path):
    """The same as from its data blocks alone; where it stands a scene says."""
    pytest.importorskip("asterix", reason="needs asterix")
    blocks = [
        encode_records([AsterixRecord(PLOTS, 100.0 + 4 * k, {
            "sac": 1, "sic": 2, "range_m": 30_000.0 + 100 * k, "azimuth_deg": 40.0,
            "alt_m": 1524.0,
        })])
        for k in range(3)
    ]  # fmt: skip
    plain, captured = tmp_path / "a.ast", tmp_path / "a.pcap"
    plain.write_bytes(b"".join(blocks))
    captured.write_bytes(write.pcap([(START + k, block) for k, block in enumerate(blocks)]))
    place = 47.0, 8.0, 500.0
    one = read_measurements(plain, None, place)
    other = read_measurements(captured, None, place, asterix_blocks_of_capture(captured))
    for name, values in one.entries.items():
        np.testing.assert_array_equal(other.entries[name], values)
    assert other.entries["range_m"] == pytest.approx([30_000, 30_100, 30_200], abs=4)
    assert asterix_blocks_of_capture(plain) is None
    with pytest.raises(TrafficFileError, match=r"none of its 3 plots of radars \(048\) says whose"):
        recording_of_file(captured)


KINDS = {
    "a.csv": lambda _: as_csv(history()),
    "a.parquet": lambda tmp_path: as_parquet(tmp_path, history()),
    "a.pcap": lambda _: write.pcap([(START + k, block) for k, block in enumerate(adsb())]),
    "a.pcapng": lambda _: write.pcapng([(START + k, block) for k, block in enumerate(adsb())]),
    "a.ast": lambda _: b"".join(adsb()),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_gives_one_error_or_whole_flights(tmp_path, name):
    if name in ("a.pcap", "a.pcapng", "a.ast"):
        pytest.importorskip("asterix", reason="needs asterix")
    write.assert_refused_or_whole(tmp_path / name, KINDS[name](tmp_path))


def udp_v4(payload: bytes, protocol: int = 17, fragment: int = 0) -> bytes:
    """RFC 791 and 768: a header of 24 bytes, 4 of them an option, and what is behind the end."""
    size = 24 + 8 + len(payload)
    ip = struct.pack(">BBHHHBBH8x4x", 0x46, 0, size, 1, fragment, 64, protocol, 0)
    return ip + struct.pack(">4H", 5, 6, 8 + len(payload), 0) + payload + b"behind it"


def udp_v6(payload: bytes) -> bytes:
    """RFC 8200: a header of 40 bytes."""
    ip = struct.pack(">IHBB32x", 6 << 28, 8 + len(payload), 17, 64)
    return ip + struct.pack(">4H", 5, 6, 8 + len(payload), 0) + payload


def ethernet(ip: bytes, kind: int = 0x0800, vlans: int = 0) -> bytes:
    return bytes(12) + b"\x81\x00\x00\x07" * vlans + struct.pack(">H", kind) + ip


#: Kind of link, a packet, and what it holds over UDP.
PACKETS = [
    (1, ethernet(udp_v4(b"one")), b"one"), (1, ethernet(udp_v4(b"two"), vlans=2), b"two"),
    (1, ethernet(udp_v6(b"three"), 0x86DD), b"three"), (101, udp_v6(b"four"), b"four"),
    (0, bytes(4) + udp_v4(b"five"), b"five"), (113, bytes(14) + b"\x08\x00" + udp_v4(b"6"), b"6"),
    (276, b"\x08\x00" + bytes(18) + udp_v4(b"seven"), b"seven"),
    (1, ethernet(udp_v4(b"tcp", protocol=6)), None), (1, ethernet(udp_v4(b"arp"), 0x0806), None),
    (101, udp_v4(b"a part", fragment=0x2000), None), (105, udp_v4(b"of no known link"), None),
    (101, b"", None), (101, b"\x50" + bytes(60), None), (101, udp_v4(b"")[:19], None),
]  # fmt: skip


@pytest.mark.parametrize("magic", captures._PCAP)
def test_datagrams_of_every_link_are_taken_out_of_a_capture(magic: bytes) -> None:
    order, fraction_s = {0xD4: ("<", 1e-6), 0xA1: (">", 1e-6), 0x4D: ("<", 1e-9)}[magic[0]]
    if magic == b"\xa1\xb2\x3c\x4d":
        fraction_s = 1e-9
    for link, packet, payload in PACKETS:
        head = (
            magic + struct.pack(f"{order}2H3I", 2, 4, 0, 0, 65535) + struct.pack(f"{order}I", link)
        )
        good = head[:20] + struct.pack(f"{order}I", 1)
        other = struct.pack(f"{order}4I", 7, 500, len(packet), len(packet)) + packet
        known = ethernet(udp_v4(b"known"))
        last = struct.pack(f"{order}4I", 9, 250, len(known), len(known)) + known
        if payload is not None:
            found = captures.udp_times_and_payloads(Problems("a.pcap"), head + other)
            assert found == [(pytest.approx(7 + 500 * fraction_s), payload)]
            continue
        with pytest.raises(TrafficFileError, match=rf"no UDP .* packets are of link type {link}\)"):
            captures.udp_times_and_payloads(Problems("a.pcap"), head + other)
        if link == 1:
            found = captures.udp_times_and_payloads(Problems("a.pcap"), good + other + last)
            assert found == [(pytest.approx(9 + 250 * fraction_s), b"known")]


def test_where_a_capture_is_cut_off_is_said_as_a_whole() -> None:
    packet = ethernet(udp_v4(b"one"))
    head = b"\xd4\xc3\xb2\xa1" + bytes(16) + struct.pack("<I", 1)
    one = struct.pack("<4I", 7, 0, len(packet), len(packet)) + packet
    block = struct.pack("<3I", 6, 12, 12)
    for data, said in (
        (head[:20], "the capture is cut off in its header"),
        (head, "the capture holds no packets"),
        (head + one + one[:15], "packet 2: the capture is cut off"),
        (head + one + one[:-1],
         f"packet 2: has {len(packet)} bytes, but the capture ends before"),
        (captures._PCAPNG + b"\x1c\0\0\0", "packet 1: the capture is cut off"),
        (captures._PCAPNG + struct.pack(">2I", 13, 0), "packet 1: a block of 13 bytes does not fit "
         "into the capture"),
        (captures._PCAPNG + struct.pack("<3I", 12, 0x1A2B3C4D, 12)[:8] + block,
         "packet 2: the block is damaged"),
    ):  # fmt: skip
        with pytest.raises(TrafficFileError) as error:
            captures.udp_times_and_payloads(Problems("a.pcap"), data)
        assert str(error.value) == f"a.pcap: {said}"
