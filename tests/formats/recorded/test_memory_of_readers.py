"""Memory of a reader: at most three times the file, by rows that are added to a small one."""

import json
import tracemalloc

import pytest
import recorded_files as write

from components.flights import attitude, sampled_flight
from components.formats import receiver_logs, recording
from components.formats.recorded import autopilot_logs, xml_tracks
from components.formats.recorded.known_kinds import recording_of_file

START = 1_717_243_200.0
FEW, MANY = 60, 240
#: Blocks are as small beside these files as they are beside large ones.
BLOCKS = (
    (attitude, "CELLS_AT_ONCE", 20), (sampled_flight, "CELLS_AT_ONCE", 20),
    (recording, "CELLS_AT_ONCE", 20), (autopilot_logs, "_AT_ONCE", 20),
    (xml_tracks, "_CHUNK", 512), (receiver_logs, "_LONG", 512),
)  # fmt: skip


def fixes(count):
    return [(START + k, 47 + 1e-5 * k, 8 + 0.001 * (k // 7 % 9), 1000.0 + k % 9)
            for k in range(count)]  # fmt: skip


def trace(flown):
    points = [
        [t - START, lat, lon, 3300, 120.0, 0.0, 0, 64, None, "adsb_icao", 3500, 0, 120, 0.0]
        for t, lat, lon, _ in flown
    ]
    return json.dumps({"icao": "4b1805", "timestamp": START, "trace": points}).encode()


def states(flown):
    rows = [["4b1805", "SWR1", "CH", int(t), int(t), lon, lat, alt, False, 50.0, 0.0, 0.5, None,
             alt, "1000", False, 0] for t, lat, lon, alt in flown]  # fmt: skip
    return json.dumps({"states": rows, "time": START}).encode()


def records(flown):
    keys = ("time", "icao24", "lat", "lon", "baroaltitude", "geoaltitude", "velocity", "onground")
    rows = [(t, "4b1805", lat, lon, alt, alt, 50.0, False) for t, lat, lon, alt in flown]
    return json.dumps([dict(zip(keys, row, strict=True)) for row in rows]).encode()


def daa(flown):
    rows = [f"Own, {lat:.5f}, {lon:.5f}, {alt}, 0, 120, 0, {t}" for t, lat, lon, alt in flown]
    units = "[none] [deg] [deg] [m] [deg] [knot] [fpm] [s]"
    return "\n".join(
        ["NAME lat lon alt trk gs vs time", units, *rows, f"I,47,9,9,0,1,0,{START}"]
    ).encode()


def table(flown):
    rows = [f'{t:.0f},UTC,S1,"{lat:.5f},{lon:.5f}",3300,100,0' for t, lat, lon, _ in flown]
    return "\n".join(["Timestamp,UTC,Callsign,Position,Altitude,Speed,Direction", *rows]).encode()


def ulog(flown):
    place = [((t - START) * 1e6, lat, lon, alt) for t, lat, lon, alt in flown]
    turned = [(one[0], 1.0, 0.0, 0.0, 0.0) for one in place]
    fields = "double lat;double lon;float alt"
    return write.ulog({"vehicle_global_position": (fields, place),
                       "vehicle_attitude": ("float[4] q", turned)})  # fmt: skip


def tlog(flown):
    messages = [
        one
        for k, (t, lat, lon, alt) in enumerate(flown)
        for one in (
            (t, 1, 30, (k, 0.1, 0.05, 1.0, 0.1, 0.1, 0.1)),
            (t, 1, 33, (k, int(lat * 1e7), int(lon * 1e7), int(alt * 1e3), 1, 100, 3, 2, 9)),
        )
    ]
    return write.tlog(messages)


KINDS = {
    "a.json": trace, "states.json": states, "records.json": records, "a.daa": daa,
    "a.csv": table, "a.ulg": ulog, "a.tlog": tlog,
    "a.igc": lambda flown: write.igc(flown, [int(alt) for *_, alt in flown]),
    "a.gpx": lambda flown: write.gpx({"A": flown}), "a.kml": lambda flown: write.kml({"A": flown}),
    "points.kml": lambda flown: write.kml({"A": flown}, points=True),
}  # fmt: skip


def read(path):
    return recording_of_file(path).flights(None)


def test_samples_are_the_same_bits_whatever_the_blocks(tmp_path, monkeypatch):
    """And a list that is read part by part says what the whole of it does."""
    for name, make in KINDS.items():
        path = tmp_path / name
        path.write_bytes(make(fixes(90)))
        whole = read(path)
        with monkeypatch.context() as patch:
            for module, constant, size in BLOCKS:
                patch.setattr(module, constant, size)
            parts = read(path)
        for one, other in zip(whole.aircraft, parts.aircraft, strict=True):
            assert (one.name, one.max_speed_mps) == (other.name, other.max_speed_mps)
            assert (one.coefficients == other.coefficients).all()


@pytest.mark.parametrize(
    "name", ["a.json", "records.json", "a.ulg", "a.tlog", "a.igc", "a.gpx", "a.kml"]
)
def test_a_reader_holds_at_most_three_times_its_file(tmp_path, monkeypatch, name):
    for module, constant, size in BLOCKS:
        monkeypatch.setattr(module, constant, size)
    path, peaks, sizes = tmp_path / name, [], []
    path.write_bytes(KINDS[name](fixes(8)))
    read(path)  # what is made once
    for count in (FEW, MANY):
        path.write_bytes(KINDS[name](fixes(count)))
        tracemalloc.start()
        read(path)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        sizes.append(path.stat().st_size)
    assert peaks[1] - peaks[0] <= 3.0 * (sizes[1] - sizes[0])
