"""What a well-formed traffic file gives: units, frames, times, velocities, names."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_files import read_csv

from components.formats.daa_file import read_daa, read_daa_samples
from components.formats.recording import subtract_start
from components.formats.text_rows import TrafficFileError
from components.geometry.ellipsoid import line_of_sight

KNOT = 1852 / 3600


def write(folder, text, name="e.daa", **options):
    path = folder / name
    path.write_bytes(text.encode(options.get("encoding", "utf-8")))
    return path


def slant_range(file, times):
    a, b = file.ownship.at(times), file.intruders[0].at(times)
    return line_of_sight(a.lat_deg, a.lon_deg, a.alt_m, b.lat_deg, b.lon_deg, b.alt_m)[2]


def encounter(
    header="NAME lat lon alt trk gs vs time",
    units="[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]",
    seconds=5,
    t0=100.0,
):
    """Two aircraft, one north-bound at 120 knots and climbing, one standing to its north."""
    rows = [header, units]
    for t in range(seconds):
        rows.append(
            f"Own, {45 + t * 120 / 3600 / 60:.9f}, -75, {1000 + 10 * t}, 0, 120, 600, {t0 + t}"
        )
        rows.append(f"Int, 45.1, -75, 1000, 90, 0, 0, {t0 + t}")
    return "\n".join(rows) + "\n"


def test_names_times_and_units(tmp_path):
    file = read_daa(write(tmp_path, encounter()))
    assert file.ownship.name == "Own"
    assert [i.name for i in file.intruders] == ["Int"]
    assert file.start_time_s == 100.0
    assert file.notes == []
    assert (file.ownship.sample_times_s == np.arange(5)).all()
    assert file.ownship.alt_m == pytest.approx((1000 + 10 * np.arange(5)) * 0.3048, rel=1e-15)
    east, north, up = file.ownship.velocity_enu_mps
    assert (east == 0).all()
    assert north == pytest.approx(120 * KNOT)
    assert up == pytest.approx(600 * 0.3048 / 60)


def test_latitude_and_longitude_are_the_file_s_own(tmp_path):
    path = write(tmp_path, encounter())
    file, samples = read_daa(path), read_daa_samples(path)
    north = 45 + np.arange(5) * 120 / 3600 / 60
    for lat_deg, lon_deg in (
        (file.ownship.lat_deg, file.ownship.lon_deg),
        (samples["Own"]["lat"], samples["Own"]["lon"]),
    ):
        np.testing.assert_allclose(lat_deg, north, atol=1e-9)
        assert (lon_deg == -75.0).all()


@pytest.mark.parametrize("t0", [0.0, 0.3, 325374.2, 503880.4, 1577836800.1])
def test_elapsed_times_are_the_decimal_ones(t0):
    """Scans happen at k/10 s exactly; the sample at k/10 s must be met, whatever the clock read."""
    expected = np.arange(3000) / 10
    assert (subtract_start(t0 + expected, t0) == expected).all()


def test_elapsed_times_closer_than_the_clock_can_say_are_kept():
    times = np.array([1e9, np.nextafter(1e9, 2e9)])
    assert (np.diff(subtract_start(times, 1e9)) > 0).all()


def test_track_and_components_are_the_same_velocity(tmp_path):
    trk = read_daa(write(tmp_path, encounter()))
    rows = (
        encounter()
        .replace("trk gs vs", "vx vy vz")
        .replace("[deg] [knot] [fpm] [s]", "[m/s] [m/s] [m/s] [s]")
    )
    rows = rows.replace("0, 120, 600,", f"0, {120 * KNOT!r}, {600 * 0.3048 / 60!r},").replace(
        "90, 0, 0", "0, 0, 0"
    )
    xyz = read_daa(write(tmp_path, rows, "v.daa"))
    for a, b in zip(trk.ownship.velocity_enu_mps, xyz.ownship.velocity_enu_mps, strict=True):
        assert a == pytest.approx(b, abs=1e-12)


def test_xyz_heights_are_altitudes_and_distances_those_of_the_file(tmp_path):
    """Wherever on Earth the reference point is put; the Earth falls away by d² / 2R."""
    rng = np.random.default_rng(5)
    own, other = rng.uniform(-3, 3, (2, 6, 3)) * [1, 1, 1000] + [0, 0, 6000]
    rows = ["NAME sx sy sz time", "[none] [nmi] [nmi] [ft] [s]"]
    for t in range(6):
        rows.append(f"Own {' '.join(map(repr, map(float, own[t])))} {t}")
        rows.append(f"Int {' '.join(map(repr, map(float, other[t])))} {t}")
    path = write(tmp_path, "\n".join(rows), "e.xyz")
    apart = (own - other) * [1852, 1852, 0.3048]
    expected = np.linalg.norm(apart, axis=1)
    for lat, lon in ((0, 0), (45, -75), (89.99, 179.999), (-90, 0)):
        file = read_daa(path, reference_lat_deg=lat, reference_lon_deg=lon, reference_alt_m=70)
        alt = [aircraft.at(np.arange(6.0)).alt_m for aircraft in file.aircraft]
        assert alt[0] == pytest.approx(own[:, 2] * 0.3048 + 70, abs=1e-9)
        assert alt[0] - alt[1] == pytest.approx(apart[:, 2], abs=1e-9)
        assert slant_range(file, np.arange(6.0)) == pytest.approx(expected, abs=6.0)
    assert "reference point" in file.notes[0]


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.permutations(range(8)), st.sampled_from([",", ", ", ";", " ; ", "\t", "  ", ",\t"]))
def test_any_column_order_and_separator(tmp_path_factory, order, separator):
    folder = tmp_path_factory.mktemp("order")
    plain = read_daa(write(folder, encounter()))
    lines = [line.replace(",", " ").split() for line in encounter().splitlines()]
    text = "\n".join(separator.join(line[i] for i in order) for line in lines)
    file = read_daa(write(folder, text, "o.daa"))
    for a, b in zip(plain.aircraft, file.aircraft, strict=True):
        assert a.name == b.name
        assert (a.coefficients == b.coefficients).all()


def test_interleaved_rows_are_sorted_and_said(tmp_path):
    lines = encounter().splitlines()
    file = read_daa(write(tmp_path, "\n".join(lines[:2] + lines[:1:-1])))
    assert file.ownship.name == "Int"
    assert (np.diff(file.ownship.sample_times_s) > 0).all()
    assert any("sorted" in note for note in file.notes)


def test_all_of_one_aircraft_then_the_other(tmp_path):
    lines = encounter().splitlines()
    file = read_daa(write(tmp_path, "\n".join(lines[:2] + lines[2::2] + lines[3::2])))
    assert file.ownship.name == "Own"
    assert file.notes == []


def test_airspeed_in_place_of_ground_speed_is_noticed(tmp_path):
    file = read_daa(write(tmp_path, encounter().replace("0, 120, 600", "180, 300, 600")))
    assert file.ownship.velocity_was_ignored
    assert "do not fit" in file.notes[0]
    assert np.degrees(file.ownship.yaw_rad) == pytest.approx(0, abs=1e-3)


CSV = """time,id,lat,lon,alt
0,a,45,-75,1000
0.5,b,45.1,-75,1000
2,a,45.001,-75,1010
2.5,b,45.099,-75,1000
"""


def test_csv_with_own_times_per_aircraft(tmp_path):
    file = read_csv(write(tmp_path, CSV, "e.csv"))
    assert file.ownship.name == "a"
    assert file.ownship.interval_present() == (0.0, 2.0)
    assert file.intruders[0].interval_present() == (0.5, 2.5)
    b = file.intruders[0].at([0.0, 0.49, 0.5, 2.5, 2.51])
    assert b.present.tolist() == [False, False, True, True, False]


def test_csv_ownship_by_name(tmp_path):
    assert read_csv(write(tmp_path, CSV, "e.csv"), ownship="b").ownship.name == "b"


@pytest.mark.parametrize(
    "header",
    [
        "Timestamp,ICAO24,Latitude,Longitude,Altitude",
        "time_s,callsign,lat_deg,lon_deg,geo_altitude",
        "time [s],ID,Lat (deg),Lon (deg),alt_m",
        '"time","id","lat","lng","baroaltitude"',
    ],
)
def test_csv_header_spellings(tmp_path, header):
    plain = read_csv(write(tmp_path, CSV, "a.csv"))
    other = read_csv(write(tmp_path, header + CSV[CSV.index("\n") :], "b.csv"))
    for a, b in zip(plain.aircraft, other.aircraft, strict=True):
        assert (a.coefficients == b.coefficients).all()


def test_csv_units_in_headers(tmp_path):
    text = CSV.replace("time,", "time_ms,").replace(",alt\n", ",alt_ft\n")
    file = read_csv(write(tmp_path, text, "u.csv"))
    assert file.ownship.alt_m == pytest.approx(np.array([1000, 1010]) * 0.3048)
    assert file.ownship.sample_times_s == pytest.approx([0, 0.002])


def test_csv_iso_times_and_attitude(tmp_path):
    text = (
        "time;id;lat;lon;alt;heading;pitch;roll\n"
        "2020-01-01T00:00:00Z;a;45;-75;100;350;1;2\n"
        "2020-01-01T00:00:02;a;45;-75;100;10;1;4\n"
        "2020-01-01T02:00:01+02:00;b;45;-75.1;100;0;0;0\n"
    )
    file = read_csv(write(tmp_path, text, "i.csv"))
    assert file.start_time_s == 1577836800.0
    middle = file.ownship.at(1.0)
    turned = (np.degrees(middle.yaw_rad) + 180) % 360 - 180
    assert (turned, np.degrees(middle.roll_rad)) == pytest.approx((0, 3))
    assert file.intruders[0].interval_present() == (1.0, 1.0)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.data())
def test_damaged_files_give_the_one_error_or_a_whole_result(tmp_path_factory, data):
    """Cut, overwrite or insert anything anywhere: never another exception, never a NaN."""
    reader, text = data.draw(st.sampled_from([(read_daa, encounter(seconds=3)), (read_csv, CSV)]))
    raw = bytearray(text.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(raw)))
        raw[at : at + data.draw(st.integers(0, 12))] = data.draw(
            st.one_of(
                st.sampled_from([b"", b",", b"\n", b"nan", b"1e999", b"-", b"\t", b'"']),
                st.binary(max_size=6),
            )
        )
    path = tmp_path_factory.mktemp("fuzz") / "f.txt"
    path.write_bytes(bytes(raw))
    try:
        file = reader(path)
    except TrafficFileError as error:
        assert 1 <= len(error.problems) <= 20
        return
    for aircraft in file.aircraft:
        low, high = aircraft.interval_present()
        for values in aircraft.at(np.linspace(low - 1, high + 1, 7)).arrays():
            assert np.isfinite(values).all()
