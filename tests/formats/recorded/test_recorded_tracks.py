"""Tracks of people and autopilots: GPX, KML, IGC, PX4 logs and MAVLink logs, by their formats."""

import gzip
import io
import math
import struct
import zipfile

import pytest
import recorded_files as write

from components.formats.recorded.known_kinds import recording_of_file
from components.formats.text_rows import TrafficFileError

START = 1_717_243_200.0  # 2024-06-01 12:00 UTC
FIXES = [(START + k, 47.0 + 0.0004 * k, 8.0 - 0.0002 * k, 1000.0 + 2.0 * k) for k in range(12)]
OTHER = [(START + 0.5 + k, 47.01, 8.01 + 0.0001 * k, 1200.0) for k in range(8)]


def read(tmp_path, name, data, **options):
    path = tmp_path / name
    path.write_bytes(data)
    return recording_of_file(path, **options)


def assert_flown(samples, fixes, deg=1e-9, up_m=1e-9):
    for key, values, near in zip(
        ("time", "lat", "lon", "alt"), zip(*fixes, strict=True), (1e-5, deg, deg, up_m), strict=True
    ):
        assert samples[key] == pytest.approx(values, abs=near)


@pytest.mark.parametrize(
    "data", [write.gpx({"one": FIXES, "two": OTHER}), write.kml({"one": FIXES, "two": OTHER})]
)
def test_tracks_in_xml_are_flown(tmp_path, data):
    read_in = read(tmp_path, "any.name", data)
    assert list(read_in.samples) == ["one", "two"]
    assert_flown(read_in.samples["one"], FIXES)
    assert_flown(read_in.samples["two"], OTHER)
    assert read_in.height == "geometric altitude above mean sea level"
    assert f"{read_in.height} is read: there is no barometric altitude" in read_in.notes.harmless


def test_placemarks_with_times_are_the_document_s_flight(tmp_path):
    assert_flown(
        read(tmp_path, "a.kml", write.kml({"one": FIXES}, points=True)).samples["one"], FIXES
    )


def test_packed_tracks_are_read(tmp_path):
    kml = write.kml({"one": FIXES})
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("icon.png", b"\x89PNG")
        archive.writestr("doc.kml", kml)
    for name, data in (("a.kmz", packed.getvalue()), ("a.kml.gz", gzip.compress(kml))):
        assert_flown(read(tmp_path, name, data).samples["one"], FIXES)


def test_two_tracks_of_one_name_are_two(tmp_path):
    twice = write.gpx({"one": FIXES, "two": OTHER}).replace(b"<name>two", b"<name>one")
    assert list(read(tmp_path, "a.gpx", twice).samples) == ["one", "one 2"]
    unnamed = twice.replace(b"<name>one</name>", b"")
    assert list(read(tmp_path, "my.gpx", unnamed).samples) == ["my", "my 2"]


def test_tracks_without_times_are_said(tmp_path):
    timeless = write.gpx({"one": FIXES}).replace(b"time>", b"x>")
    with pytest.raises(TrafficFileError, match="its 12 positions have no times"):
        read(tmp_path, "a.gpx", timeless)
    line = b"<kml><Document><Placemark><LineString><coordinates>8,47,1 8,48,1</coordinates>"
    line += b"</LineString></Placemark></Document></kml>"
    with pytest.raises(TrafficFileError, match="there is no track in it"):
        read(tmp_path, "a.kml", line)


def test_what_stands_beside_a_track_point_s_own_is_not_its(tmp_path):
    """Times of the file and of extensions, names of points, and prefixes that nobody declared."""
    of_file = b"<metadata><time>2001-01-01T00:00:00Z</time></metadata><trk>"
    data = write.gpx({"one": FIXES}).replace(b"<trk>", of_file)
    inside = b"<name>7</name><extensions><x:time>noon</x:time><x:ele>9</x:ele></extensions></trkpt>"
    data = data.replace(b"</trkpt>", inside)
    assert_flown(read(tmp_path, "a.gpx", data).samples["one"], FIXES)
    first = data.replace(b"<time>2024-06-01T12:00:00Z</time>", b"")
    assert_flown(read(tmp_path, "a.gpx", first).samples["one"], FIXES[1:])


def test_heights_that_are_none_are_said(tmp_path):
    flat = write.gpx({"one": FIXES}).replace(b"ele>", b"x>")
    with pytest.raises(TrafficFileError, match="no samples: all points have no height; time"):
        read(tmp_path, "a.gpx", flat)
    some = write.gpx({"one": FIXES}).replace(b"<ele>1000.0</ele>", b"")
    warnings = read(tmp_path, "a.gpx", some).notes.warnings
    assert warnings == ["1 point was left out that had no height"]
    with pytest.raises(
        TrafficFileError, match=r"point 1, column geometric .* 100001000\.0 is out of"
    ):
        read(tmp_path, "a.gpx", write.gpx({"one": FIXES}).replace(b"<ele>10", b"<ele>1000010"))
    low = write.kml({"one": FIXES}).replace(b">absolute<", b">relativeToGround<")
    (warning,) = read(tmp_path, "a.kml", low).notes.warnings
    assert warning.startswith("heights are above ground (altitudeMode relativeToGround)")


def test_an_igc_file_as_programs_write_it_again(tmp_path):
    """Without its first record; with a line cut short, and a second fix of one second."""
    whole = write.igc([*FIXES[:4], *FIXES], list(range(1000, 1016)))
    _, *lines = whole.decode().splitlines()
    assert lines[2].startswith("B120000")
    cut = "\n".join([*lines[:2], *lines[6:], "B1200", lines[-1][:-5] + "01111"]).encode()
    found = read(tmp_path, "a.igc", cut)
    assert_flown(found.samples["TST"], FIXES[:12], deg=2e-5, up_m=30.0)
    assert found.notes.warnings[0] == "1 fix is damaged and left out, the first in line 15"
    assert list(read(tmp_path, "my.igc", whole.replace(b"TST", b"NKN")).samples) == ["my"]


def test_an_igc_file_has_two_heights_and_goes_over_midnight(tmp_path):
    late = [(START + 43_196 + 2 * k, -47.0 - k / 60, -8.5 + k / 600, 900.0 + k) for k in range(5)]
    pressures = [1000, 1001, 1002, 1003, 1004]
    data = write.igc(late, pressures, "D-1234")
    found = read(tmp_path, "flight.igc", data)
    (name,) = found.samples
    assert name == "D-1234"
    assert_flown(found.samples[name], [(*f[:3], p) for f, p in zip(late, pressures, strict=True)],
                 deg=1e-5)  # fmt: skip
    geometric = read(tmp_path, "flight.igc", data, altitude="geometric")
    assert_flown(geometric.samples[name], late, deg=1e-5)
    # Without a pressure sensor the field is zeros.
    assert_flown(read(tmp_path, "f.igc", write.igc(late)).samples["TST"], late, deg=1e-5)


def test_further_digits_of_an_igc_fix_are_read(tmp_path):
    data = b"AXXX1\nHFDTE010624\nI033637LAD3839LOD4040TDS\n"
    data += b"B1200004712345N00812345EA010000110067895\nB1200014712345S00812345WA010000110000004\n"
    one = read(tmp_path, "a.igc", data).samples["a"]
    minutes = 12.34567, 12.34589
    assert one["lat"] == pytest.approx([47 + minutes[0] / 60, -47 - 12.345 / 60], abs=1e-12)
    assert one["lon"] == pytest.approx([8 + minutes[1] / 60, -8 - 12.345 / 60], abs=1e-12)
    assert one["time"] == pytest.approx([START + 0.5, START + 1.4])


Q = (math.cos(math.radians(45)), 0.0, 0.0, math.sin(math.radians(45)))  # heading 090


def px4(**more):
    boot = [5_000_000 + 1_000_000 * k for k in range(len(FIXES))]
    own = [(t, lat, lon, alt) for t, (_, lat, lon, alt) in zip(boot, FIXES, strict=True)]
    utc = [(t, int(1e6 * fix[0]), 3) for t, fix in zip(boot, FIXES, strict=True)]
    heard = [
        (t, 0x3C6444, 47.01, 8.01 + 0.0001 * k, 0, 1200.0, math.radians(-90), 7.6, 0.5,
         *b"TEST1\0\0\0\0", 0, 1 | 2 | 4 | 8 | 16 | 128)
        for k, t in enumerate(boot)
    ]  # fmt: skip
    return {
        "vehicle_global_position": ("double lat;double lon;float alt", own),
        "vehicle_gps_position": ("uint64_t time_utc_usec;uint8_t fix_type", utc),
        "vehicle_local_position": (
            "float vx;float vy;float vz", [(t, 44.5, -15.2, -2) for t in boot],
        ),
        "vehicle_attitude": ("float[4] q", [(t, *Q) for t in boot]),
        "transponder_report": (
            "uint32_t icao_address;double lat;double lon;uint8_t altitude_type;float altitude;"
            "float heading;float hor_velocity;float ver_velocity;uint8_t[9] callsign;uint8_t tslc;"
            "uint16_t flags", heard,
        ),
        **more,
    }  # fmt: skip


def test_a_px4_log_holds_its_own_flight_and_whom_it_heard(tmp_path):
    found = read(tmp_path, "log7.ulg", write.ulog(px4()))
    assert list(found.samples) == ["log7", "3c6444"] and found.callsigns == {"3c6444": "TEST1"}
    own, other = found.samples.values()
    assert_flown(own, FIXES, up_m=1e-3)
    assert [own[key][0] for key in ("vn", "ve", "vu")] == pytest.approx(
        [44.5, -15.2, 2.0], abs=1e-4
    )
    assert [own[key][3] for key in ("yaw", "pitch", "roll")] == pytest.approx([90, 0, 0], abs=1e-4)
    assert other["lon"] == pytest.approx([8.01 + 0.0001 * k for k in range(len(FIXES))])
    assert other["time"][0] == pytest.approx(START, abs=1e-5) and other["alt"][0] == 1200.0
    assert [other[key][0] for key in ("ve", "vn", "vu")] == pytest.approx([-7.6, 0, 0.5], abs=1e-5)


def test_a_px4_log_may_have_positions_of_gnss_alone(tmp_path):
    rows = [
        (1_000_000 * k, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), int(t * 1e6), 3)
        for k, (t, lat, lon, alt) in enumerate(FIXES)
    ]
    fields = "int32_t lat;int32_t lon;int32_t alt;uint64_t time_utc_usec;uint8_t fix_type"
    found = read(tmp_path, "a.ulg", write.ulog({"vehicle_gps_position": (fields, rows)}))
    assert_flown(found.samples["a"], FIXES, deg=1e-7, up_m=1e-3)
    with pytest.raises(TrafficFileError, match="holds no position"):
        read(tmp_path, "a.ulg", write.ulog({"vehicle_attitude": ("float[4] q", [(0, *Q)])}))


def heard_messages():
    """A flight with attitude, and one aircraft that is heard each second and repeated between."""
    messages = []
    for k, (t, lat, lon, alt) in enumerate(FIXES):
        boot = 1000 * k
        messages.append((t - 0.1, 1, 30, (boot, 0.1, 0.05, math.pi / 2, 0.0, 0.0, 0.0)))
        messages.append((t, 1, 33, (boot, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), 0,
                                    4450, -1520, -200, 9000)))  # fmt: skip
        for age in (0, 1):
            messages.append((t + age + 0.25, 1, 246, (
                0xA1B2C3, 470_100_000, 80_100_000 + 1000 * k, 1_200_000, 27000, 760, 50, 159, 1200,
                1, b"TEST2", 1, age,
            )))  # fmt: skip
    return messages


@pytest.mark.parametrize("version", [1, 2])
def test_a_mavlink_log_holds_its_own_flight_and_whom_it_heard(tmp_path, version):
    found = read(tmp_path, "fly.tlog", write.tlog(heard_messages(), version))
    assert list(found.samples) == ["fly", "a1b2c3"] and found.callsigns == {"a1b2c3": "TEST2"}
    own, other = found.samples.values()
    assert_flown(own, FIXES, deg=1e-7, up_m=1e-3)
    assert [own[key][0] for key in ("vn", "ve", "vu")] == pytest.approx([44.5, -15.2, 2.0])
    angles = [own[key][0] for key in ("yaw", "pitch", "roll")]
    assert angles == pytest.approx([90, math.degrees(0.05), math.degrees(0.1)], abs=1e-4)
    # What is repeated with a greater age is one report.
    assert other["time"] == pytest.approx([t + 0.25 for t, *_ in FIXES], abs=1e-5)
    assert other["alt"].tolist() == [1200.0] * len(FIXES)
    assert [other[key][0] for key in ("ve", "vn", "vu")] == pytest.approx([-7.6, 0, 0.5], abs=1e-9)


def test_damaged_frames_are_counted(tmp_path):
    data = bytearray(write.tlog(heard_messages()))
    at = data.index(struct.pack("<i", round(FIXES[3][1] * 1e7)))
    data[at] ^= 255
    found = read(tmp_path, "a.tlog", bytes(data))
    assert len(found.samples["a"]["time"]) == len(FIXES) - 1
    assert found.notes.warnings == ["1 frame is damaged and left out"]


KINDS = {
    "a.gpx": lambda: write.gpx({"one": FIXES, "two": OTHER}),
    "a.kml": lambda: write.kml({"one": FIXES, "two": OTHER}),
    "a.igc": lambda: write.igc(FIXES, [1000] * len(FIXES)),
    "a.ulg": lambda: write.ulog(px4()),
    "a.tlog": lambda: write.tlog(heard_messages()),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_gives_one_error_or_whole_flights(tmp_path, name):
    write.assert_refused_or_whole(tmp_path / name, KINDS[name]())
