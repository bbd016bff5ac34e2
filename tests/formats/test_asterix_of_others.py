"""ASTERIX as centres and radars send it, bytes made by hand: heights, places, repetitions."""

import math
import struct

import numpy as np
import pymap3d
import pytest
from asterix_flights import read_asterix
from covering import covers

import dsa_des
from components.formats.asterix_file import read_asterix_plots
from components.formats.recorded.traffic_of_files import TrafficChoice, read_traffic
from components.formats.text_rows import TrafficFileError
from dsa_des.running.simulation import Simulation

pytest.importorskip("asterix", reason="needs the extra asterix")

FOOT_M, NMI_M = 0.3048, 1852.0
PLACE = (43.5, 16.4, 700)


def block(category, record):
    return bytes([category]) + (len(record) + 3).to_bytes(2, "big") + record


def track(number, time_s, lat, lon, level_ft=None, geometric_ft=None):
    """A record of 062: items 010, 070, 105, 040, 080, and 136 and 130 where they are given."""
    # FSPEC: 010, 070, 105 in the first octet, 040, 080 in the second, 136, 130 in the third.
    third = 0x20 * (level_ft is not None) | 0x10 * (geometric_ft is not None)
    head = bytes([0x99, 0x0D | (third > 0), third] if third else [0x99, 0x0C])
    record = head + bytes([25, 100]) + int(time_s * 128).to_bytes(3, "big")
    record += struct.pack(">ii", round(lat * 2**25 / 180), round(lon * 2**25 / 180))
    record += struct.pack(">HB", number, 0)
    if level_ft is not None:
        record += struct.pack(">h", round(level_ft / 25))
    if geometric_ft is not None:
        record += struct.pack(">h", round(geometric_ft / 6.25))
    return block(62, record)


def tracks(*heights):
    return b"".join(
        track(101 + k, time_s, 41 + 0.1 * k, 15 + (time_s - 43200) * 2e-3, *pair)
        for time_s in (43200.0, 43204.0)
        for k, pair in enumerate(heights)
    )


def heights_ft(path, **options):
    file = read_asterix(path, **options)
    return [float(craft.alt_m[0] / FOOT_M) for craft in file.aircraft], file


def test_flight_levels_are_read_and_what_differs_is_told(tmp_path):
    path = tmp_path / "two.ast"
    path.write_bytes(tracks((39000, 36481.25), (38000, 42331.25)))
    found, file = heights_ft(path)
    assert found == pytest.approx([39000, 38000])
    assert file.warnings == [
        "barometric altitude is read, geometric altitude differs by up to 1,320 m (4,331 ft, "
        "25/100/102)"
    ]
    assert heights_ft(path, altitude="geometric")[0] == pytest.approx([36481.25, 42331.25])
    path.write_bytes(tracks((39000, 39500), (38000, 38200)))
    assert heights_ft(path)[1].warnings == []


def test_an_aircraft_without_a_level_has_its_geometric_height(tmp_path):
    path = tmp_path / "three.ast"
    path.write_bytes(tracks((39000, 39500), (None, 30000), (None, None)))
    found, file = heights_ft(path)
    assert found == pytest.approx([39000, 30000])
    assert file.warnings == [
        "25/100/102: geometric altitude is read beside barometric altitude of others: it has no "
        "barometric altitude",
        "2 records were left out that had no height, 1 aircraft wholly",
    ]
    path.write_bytes(tracks((None, 39500), (None, 30000)))
    found, file = heights_ft(path)
    assert found == pytest.approx([39500, 30000])
    assert file.warnings == []
    with pytest.raises(TrafficFileError, match="no samples"):
        heights_ft(path, altitude="barometric")


def test_what_is_recorded_twice_counts_once_and_other_categories_are_counted(tmp_path):
    path = tmp_path / "twice.ast"
    data = tracks((39000, None), (38000, None))
    path.write_bytes(data + data + block(65, b"\x80\x19\x64") + block(63, b"\x80\x19\x64"))
    found, file = heights_ft(path)
    assert found == pytest.approx([39000, 38000])
    assert file.warnings == [
        "1 data blocks of category 063 were left out",
        "1 data blocks of category 065 were left out",
        "4 records stand there again and count once",
    ]


@covers("altitude", of=("traffic.asterix",))
@pytest.mark.parametrize(("key", "feet"), [("", 39000), ('altitude = "geometric"\n', 36481.25)])
def test_a_scene_says_which_altitude_is_flown(tmp_path, key, feet):
    (tmp_path / "two.ast").write_bytes(tracks((39000, 36481.25), (38000, 42331.25)))
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'extends = "detect_and_sense.toml"\n[blocks.traffic]\ntype = "traffic.asterix"\n'
        f'file = "two.ast"\n{key}[record]\ntruth = true\n'
    )
    found = dsa_des.run(dsa_des.load_scene(scene, duration_s=1))
    own = next(row for row in found.truth.to_pylist() if row["target"] is None)
    assert own["alt_m"] == pytest.approx(feet * FOOT_M)


def plot(time_s, range_nmi, azimuth_deg, level=None, code=None, address=None, radar=12):
    """A record of 048: items 010, 140, 020, 040, and 070, 090 and 220 where they are given."""
    head = 0xF0 | 0x08 * (code is not None) | 0x04 * (level is not None)
    record = bytes([head] if address is None else [head | 1, 0x80]) + bytes([25, radar])
    record += int(time_s * 128).to_bytes(3, "big") + b"\xa0"
    record += struct.pack(">HH", round(range_nmi * 256), round(azimuth_deg * 65536 / 360))
    for number in (code, None if level is None else level * 4):
        record += b"" if number is None else struct.pack(">H", number)
    return block(48, record + (b"" if address is None else address.to_bytes(3, "big")))


def north(time_s, place=None):
    """A north marker of 034: items 010, 000, 030, and 120 where it says its place."""
    record = bytes([0xE1, 0x10] if place else [0xE0]) + bytes([25, 12, 1])
    record += int(time_s * 128).to_bytes(3, "big")
    if place:
        lat, lon, height_m = place
        record += struct.pack(">h", height_m)
        record += b"".join(round(x * 2**23 / 180).to_bytes(3, "big") for x in (lat, lon))
    return block(34, record)


FIRST = plot(100.0, 30, 200, 100) + plot(100.5, 40, 250, 200)
SECOND = plot(103.0, 30.1, 200.2, 100) + plot(103.5, 40.1, 250.2, 200)


def test_plots_before_the_first_north_marker_are_seen_from_the_radar_s_place(tmp_path):
    path = tmp_path / "p.ast"
    found = []
    for data in (
        north(99.0, PLACE) + FIRST + north(101.0, PLACE) + SECOND,
        FIRST + north(101.0, PLACE) + SECOND,
        FIRST + north(101.0) + SECOND + north(105.0, PLACE),
        north(99.0, PLACE) + FIRST + north(101.0) + SECOND,
    ):
        path.write_bytes(data)
        plots = read_asterix_plots(path)
        assert np.isfinite(plots.own_lat_deg).all()
        found.append(plots.elevation_rad.tolist())
    assert found[0] == found[1] == found[2] == found[3]
    # The height that the elevation leads to is the level's.
    _, _, height = pymap3d.aer2geodetic(200.0, math.degrees(found[0][0]), 30 * NMI_M, *PLACE)
    assert height == pytest.approx(10_000 * FOOT_M, abs=10.0)


def scene_of(path, folder, **keys):
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    (folder / "s.toml").write_text(
        'duration_s = 6\nwires = ["radar -> fusion"]\n[blocks.radar]\ntype = "sensor.recorded"\n'
        f'file = "{path.name}"\n{lines}[blocks.fusion]\ntype = "fusion.pass_through"\n'
    )
    return dsa_des.load_scene(folder / "s.toml")


@covers("radar_lat_deg", "radar_lon_deg", "radar_alt_m", of=("sensor.recorded",))
def test_a_radar_that_says_no_place_is_put_where_the_scene_says(tmp_path):
    path = tmp_path / "p.ast"
    path.write_bytes(FIRST + north(101.0) + SECOND)
    with pytest.raises(Exception, match=r"radar 25/12 does not say where it is .*radar_lat_deg"):
        dsa_des.run(scene_of(path, tmp_path))
    with pytest.raises(Exception, match="radar_alt_m: needed with the other two"):
        scene_of(path, tmp_path, radar_lat_deg=1, radar_lon_deg=2)
    lat, lon, alt = PLACE
    put = dsa_des.run(scene_of(path, tmp_path, radar_lat_deg=lat, radar_lon_deg=lon,
                               radar_alt_m=alt))  # fmt: skip
    path.write_bytes(FIRST + north(101.0, PLACE) + SECOND)
    said = dsa_des.run(scene_of(path, tmp_path))
    for name in ("azimuth_rad", "elevation_rad", "range_m", "time_s"):
        one, other = put.detections[name].to_numpy(), said.detections[name].to_numpy()
        assert one == pytest.approx(other, abs=1e-7) and len(one) == 4
    assert {round(x, 6) for x in put.scans["own_lat_deg"].to_pylist()} == {lat}


@covers(
    "place.lat_deg",
    "place.lon_deg",
    "place.alt_m",
    of=("traffic.file", "traffic.csv", "traffic.asterix"),
)
def test_plots_that_say_whose_they_are_are_flown(tmp_path):
    """By address, else by code; those of a second radar, and primary ones, are left out."""
    path = tmp_path / "p.ast"
    plots = b"".join(
        plot(100 + 4 * k, 30 - 0.1 * k, 200, 300, address=0x4B1805)
        + plot(101 + 4 * k, 10, 90 + k, 100, code=0o4521) + plot(101 + 4 * k, 7, 10)
        + plot(102 + 4 * k, 50, 20, 300, address=0x4B1805, radar=13)
        for k in range(4)
    )  # fmt: skip
    path.write_bytes(plots)
    with pytest.raises(TrafficFileError, match=r"radar 25/12.* place = \{ lat_deg, lon_deg, alt_m"):
        read_traffic([path], TrafficChoice())
    placed = read_traffic([path], TrafficChoice(place=PLACE))
    path.write_bytes(plots + north(100, PLACE))
    lat, lon, alt = PLACE
    traffic = {"type": "traffic.file", "file": str(path),
               "place": {"lat_deg": 0, "lon_deg": 0, "alt_m": 0}}  # fmt: skip
    tables = {"extends": "detect_and_sense", "blocks": {"traffic": traffic}}
    said = Simulation(dsa_des.load_scene(tables)).components["traffic"].content
    for file in (placed, said):
        assert [one.name for one in file.aircraft] == ["4B1805", "A4521"]
        assert file.warnings == [
            "8 plots are left out that do not say whose they are or how high, or are of aircraft "
            "that another radar sees"
        ]
        for craft, far_nmi, turned, high_ft in ((file.ownship, 29.9, 200, 30_000),
                                                (file.intruders[0], 10, 91, 10_000)):  # fmt: skip
            assert craft.sample_times_s[1] - craft.sample_times_s[0] == 4.0
            at = craft.lat_deg[1], craft.lon_deg[1], craft.alt_m[1]
            azimuth, _, range_m = pymap3d.geodetic2aer(*at, lat, lon, alt)
            assert range_m == pytest.approx(far_nmi * NMI_M, abs=3)
            assert azimuth == pytest.approx(turned, abs=0.006)
            assert at[2] == pytest.approx(high_ft * FOOT_M)
    path.write_bytes(b"".join(plot(100 + k, 7, 10) for k in range(3)))
    with pytest.raises(TrafficFileError, match=r"none of its 3 plots .* says whose it is"):
        read_traffic([path], TrafficChoice(place=PLACE))


def test_plots_without_a_height_are_left_out_and_counted(tmp_path):
    path = tmp_path / "p.ast"
    path.write_bytes(north(99.0, PLACE) + FIRST + FIRST + plot(100.2, 20, 10) + SECOND)
    run = dsa_des.run(scene_of(path, tmp_path))
    assert run.detections.num_rows == 4
    # Whose plots these are nobody says: they are no false alarms.
    radar = run.info["summary"]["sensors"]["radar"]
    assert (radar["detections"], radar["false_alarms"], radar["unnamed_detections"]) == (0, 0, 4)
    notes = [note for note in run.info["notes"] if "file:" in note]
    assert "2 records stand there again and count once" in notes[0]
    assert "1 of 5 plots have no height and are left out" in notes[1]
    path.write_bytes(north(99.0, PLACE) + plot(100.2, 20, 10))
    with pytest.raises(Exception, match="none of 1 plots has a height"):
        dsa_des.run(scene_of(path, tmp_path))


def test_plots_of_a_turn_may_come_out_of_their_order(tmp_path):
    path = tmp_path / "p.ast"
    path.write_bytes(north(99.0, PLACE) + FIRST + SECOND)
    ordered = read_asterix_plots(path)
    path.write_bytes(SECOND + north(99.0, PLACE) + FIRST)
    mixed = read_asterix_plots(path)
    assert mixed.range_m.tolist() == ordered.range_m.tolist()
    assert mixed.scan_s.tolist() == ordered.scan_s.tolist() == [0.0]


def test_records_of_an_edition_that_is_not_read_are_called_that(tmp_path):
    path = tmp_path / "old.ast"
    path.write_bytes(track(1, 10.0, 43.0, 16.0, 30_000) + track(2, 10.0, 120.0, 16.0, 30_000))
    with pytest.raises(TrafficFileError, match="record 2: category 062, a latitude of 120 degrees"):
        read_asterix(path)
