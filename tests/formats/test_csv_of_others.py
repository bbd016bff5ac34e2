"""CSV tables as receivers and services publish them: gaps, repetitions, their own units."""

import json

import numpy as np
import pytest
from recorded_files import read_csv

from components.formats.recorded import known_kinds
from components.formats.text_rows import TrafficFileError

FOOT, KNOT, MILE_S = 0.3048, 1852 / 3600, 1609.344 / 3600
PLAIN = (
    "time,id,lat,lon,alt\n0,a,47,8,1000\n10,a,47.005,8,1000\n0,b,47.05,8,1100\n10,b,47.04,8,1100\n"
)


def read(folder, text, name="t.csv", encoding="utf-8", **options):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return read_csv(path, **options)


def flights(file):
    return {
        craft.name: [
            (time, round(lat, 9), round(lon, 9), round(alt, 9))
            for time, lat, lon, alt in zip(
                craft.sample_times_s.tolist(),
                craft.lat_deg,
                craft.lon_deg,
                craft.alt_m,
                strict=True,
            )
        ]
        for craft in file.aircraft
    }


OPENSKY = """\
time,icao24,lat,lon,velocity,heading,vertrate,callsign,onground,roll,baroaltitude,geoaltitude
0,a00001,47.000,8.000,50,0,0,T1,False,,1000,1050
10,a00001,47.005,8.000,,,,T1,False,,1000,{gap}
20,a00001,47.009,8.000,50,0,0,T1,False,,1000,1050
0,a00002,47.050,8.000,50,180,0,T2,False,1.2,1000,1050
10,a00002,{gap},{gap},50,180,0,T2,False,{gap},1000,1050
20,a00002,47.041,8.000,50,180,0,T2,False,,{gap},{gap}
30,a00002,47.036,8.000,50,180,0,T2,False,,1000,1050
"""


@pytest.mark.parametrize("gap", ["", "NA", "N/A", "nan", "NaN", "None", "null", "NULL", r"\N", "-"])
def test_rows_with_gaps_are_left_out_and_columns_with_gaps_are_not_used(tmp_path, gap):
    file = read(tmp_path, OPENSKY.format(gap=gap))
    assert flights(file) == {
        "a00001": [(0, 47.0, 8.0, 1050), (20, 47.009, 8.0, 1050)],
        "a00002": [(0, 47.05, 8.0, 1050), (30, 47.036, 8.0, 1050)],
    }
    assert file.ownship.velocity_enu_mps is not None  # its one gap is in a row left out
    assert file.warnings[0] == "3 rows were left out that had no position or no height"
    assert file.warnings[1] == (
        "a00002: column roll has no number in 1 of its 2 samples and is ignored"
    )
    assert len(file.warnings) == 2
    roll = "a00001: column roll has no number in 2 of its 2 samples and is ignored"
    assert roll in file.notes  # all of it is missing: nothing is lost


def test_a_gap_in_the_velocity_of_a_used_row_costs_the_velocity_alone(tmp_path):
    file = read(tmp_path, OPENSKY.format(gap=""), altitude="barometric")
    own = file.ownship
    assert own.velocity_enu_mps is None
    assert own.alt_m.tolist() == [1000, 1000, 1000]
    assert not own.velocity_was_ignored
    assert [w.partition(":")[2].split()[1] for w in file.warnings[1:]] == [
        "velocity", "heading", "vertrate", "roll",
    ]  # fmt: skip
    assert "has no number in 1 of its 3 samples" in file.warnings[1]


def test_an_aircraft_without_the_altitude_read_has_its_other_one(tmp_path):
    text = "time,icao24,lat,lon,geoaltitude,baroaltitude\n0,a,47,8,1050,1000\n5,a,47,8.01,,1000\n"
    file = read(tmp_path, text + "0,b,47,8.1,,900\n5,b,47,8.09,,900\n0,c,47,8,,\n")
    assert flights(file) == {
        "a": [(0, 47, 8, 1050)], "b": [(0, 47, 8.1, 900), (5, 47, 8.09, 900)],
    }  # fmt: skip
    assert file.warnings == [
        "b: baroaltitude is read beside geoaltitude of others: it has no geoaltitude",
        "2 rows were left out that had no height, 1 aircraft wholly",
    ]
    assert "geoaltitude is read, baroaltitude differs by up to 50 m (164 ft, a)" in file.notes


def test_rows_on_the_ground_are_left_out(tmp_path):
    file = read(tmp_path, PLAIN + "20,a,47.01,8,ground\n")
    assert flights(file) == flights(read(tmp_path, PLAIN))
    assert file.warnings == ["1 row was left out that had no height"]


def test_what_stands_there_again_counts_once(tmp_path):
    again = (
        "time,id,lat,lon,alt,squawk\n0,a,47,8,1000,1\n10,a,47.005,8,1000,1\n10,a,47.005,8,1000,2\n"
    )
    file = read(tmp_path, again + "0,b,47.05,8,1100,\n10,b,47.04,8,1100,\n0,b,47.05,8,1100,\n")
    assert flights(file) == flights(read(tmp_path, PLAIN))
    assert file.warnings == [
        "a: 1 of its samples stand there again and count once (and 1 more aircraft)"
    ]
    assert "b: rows were not in the order of time and have been sorted" in file.notes
    with pytest.raises(TrafficFileError, match="a already has a sample at 10 s, in line 3"):
        read(tmp_path, PLAIN + "10,a,47.006,8,1000\n")


def test_a_few_samples_at_one_instant_and_a_few_gaps_are_slips(tmp_path):
    rows = [f"{k},a,{47 + 0.001 * k:g},8,1000,{10 * k}" for k in range(20)]
    rows[7], rows[19] = rows[7][:-2], rows[19][:-3]
    text = "\n".join(["time,id,lat,lon,alt,heading", *rows, "5,a,47.0052,8,1000,55"])
    text += "\n0,b,47,9,1,0\n1,b,47,9,1,0\n"
    file = read(tmp_path, text)
    own = file.ownship
    assert len(own.sample_times_s) == 20 and own.lat_deg[5] == 47.0052
    assert "a: several samples at one instant, 1 times: the last one counts" in file.warnings
    # Of two as near the earlier one.
    yaw = own.at(own.sample_times_s).yaw_rad
    assert np.degrees(yaw[[6, 7, 8, 18, 19]]) % 360 == pytest.approx([60, 60, 80, 180, 180])
    filled = "a: column heading has no number in 2 of its 21 samples: that of the nearest one is"
    assert any(note.startswith(filled) for note in file.notes)
    many = text + "".join(f"{k},a,47.2,8,1000,0\n" for k in (3, 8))
    with pytest.raises(TrafficFileError, match="3 problems"):
        read(tmp_path, many)


READSB = """\
UTC,icao,flight,spd,track,lat,lon,alt_geom,alt_baro,baro_rate,squawk
2024-06-01 12:00:00,a00001,TEST1,100,0,47.0000,8.0000,2000,1900,0,7000
2024-06-01 12:00:30,a00001,TEST1,100,0,47.0139,8.0000,2000,1900,0,7000
2024-06-01 12:00:00,a00002,TEST2,100,180,47.0300,8.0000,2100,2000,0,7000
2024-06-01 12:00:30,a00002,TEST2,100,180,47.0161,8.0000,2100,2000,0,7000
"""
FR24 = """\
Timestamp,UTC,Callsign,Position,Altitude,Speed,Direction
1700000000,2023-11-14T22:13:20Z,TST1,"47.000000,8.000000",3000,100,0
1700000030,2023-11-14T22:13:50Z,TST1,"47.013900,8.000000",3000,100,0
1700000000,2023-11-14T22:13:20Z,TST2,"47.030000,8.000000",3100,100,180
1700000030,2023-11-14T22:13:50Z,TST2,"47.016100,8.000000",3100,100,180
"""


@pytest.mark.parametrize(
    ("text", "altitude", "names", "feet", "who"),
    [
        (READSB, None, ("a00001", "a00002"), (2000, 2100), "readsb"),
        (READSB, "barometric", ("a00001", "a00002"), (1900, 2000), "readsb"),
        (FR24, None, ("TST1", "TST2"), (3000, 3100), "FlightRadar24"),
    ],
)
def test_tables_of_known_writers_are_in_feet_and_knots(tmp_path, text, altitude, names, feet, who):
    file = read(tmp_path, text, altitude=altitude)
    assert [craft.name for craft in file.aircraft] == list(names)
    for craft, height, lats in zip(
        file.aircraft, feet, ((47.0, 47.0139), (47.03, 47.0161)), strict=True
    ):
        assert craft.alt_m == pytest.approx([height * FOOT] * 2)
        assert craft.lat_deg.tolist() == list(lats)
        assert craft.lon_deg.tolist() == [8.0, 8.0]
        assert craft.sample_times_s.tolist() == [0.0, 30.0]
    if "baro_rate" in text:  # else there is no climb rate, and no whole velocity
        assert file.ownship.velocity_enu_mps[1] == pytest.approx([100 * KNOT] * 2)
    assert any(f"as {who} writes it" in note for note in file.notes)
    assert file.warnings == []


def test_a_stated_unit_goes_before_what_a_writer_does(tmp_path):
    file = read(tmp_path, READSB.replace("alt_geom", "alt_geom (m)"))
    assert file.ownship.alt_m.tolist() == [2000, 2000]


def test_two_aircraft_of_one_callsign_are_told_apart_by_their_address(tmp_path):
    text = (
        "time,callsign,{},lat,lon,alt\n0,X,aa,47,8,1000\n0,X,bb,48,8,1000\n1,X,aa,47,8.001,1000\n"
    )
    for column in ("hex", "icao24", "ICAO", "icao_address", "HexIdent"):
        file = read(tmp_path, text.format(column) + "1,X,bb,48,8.001,1000\n")
        assert [craft.name for craft in file.aircraft] == ["aa", "bb"]
        assert file.ownship.max_speed_mps < 100


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("time_us,id,lat_1e-7deg,lon_degE7,alt_mm", [
            "5000000,a,470000000,80000000,1000000", "15000000,a,470050000,80000000,1000000",
            "5000000,b,470500000,80000000,1100000", "15000000,b,470400000,80000000,1100000",
        ]),
        ("timestamp,id,lat,lon,alt (km)", [
            "1700000000123,a,47,8,1", "1700000010123,a,47.005,8,1",
            "1700000000123,b,47.05,8,1.1", "1700000010123,b,47.04,8,1.1",
        ]),
        ("timestamp,id,lat,lon,alt", [
            "1700000000000000000,a,47,8,1000", "1700000010000000000,a,47.005,8,1000",
            "1700000000000000000,b,47.05,8,1100", "1700000010000000000,b,47.04,8,1100",
        ]),
        ("date,time,id,lat,lon,alt", [
            "2024/06/01,23:59:55,a,47,8,1000", "2024/06/02,00:00:05,a,47.005,8,1000",
            "2024-06-01,23:59:55.0,b,47.05,8,1100", "2024-06-02,00:00:05,b,47.04,8,1100",
        ]),
        ("time,id,lat,lon,alt", [
            "10:00:00,a,47,8,1000", "10:00:10Z,a,47.005,8,1000",
            "10:00:00,b,47.05,8,1100", "10:00:10,b,47.04,8,1100",
        ]),
        ('time,id,"remarks",lat,lon,alt', [
            '0,a,"two\nlines, ""quoted""",47,8,1000', "10,a,,47.005,8,1000",
            "0,b,x,47.05,8,1100", "10,b,x,47.04,8,1100,",
        ]),
        ("sep=;\ntime;id;lat;lon;alt", [
            "0;a;47;8;1000", "10;a;47.005;8;1000", "0;b;47.05;8;1100", "10;b;47.04;8;1100",
        ]),
        ("# made by hand\n# time,id,lat,lon,alt", [
            "0,a,47,8,1000", "10,a,47.005,8,1000", "# a pause", "0,b,47.05,8,1100",
            "10,b,47.04,8,1100",
        ]),
        ("time|id|latlng|alt", [
            "0|a|(47, 8)|1000", "10|a|47.005 8|1000", "0|b|47.05;8|1100", "10|b|47.04,8|1100",
        ]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_units_clocks_headers_and_cells_as_they_come(tmp_path, header, rows, encoding):
    file = read(tmp_path, "\r\n".join([header, *rows]), encoding=encoding)
    assert flights(file) == flights(read(tmp_path, PLAIN))
    assert file.warnings == []


def test_speeds_in_miles_per_hour(tmp_path):
    header = "time,id,lat,lon,alt,track,speed [mph],vs"
    rows = [
        f"{time},{name},{lat + time * 50 * MILE_S / 111_194.0},8,1000,0,50,0"
        for name, lat in (("a", 47), ("b", 47.1))
        for time in (0, 10)
    ]
    file = read(tmp_path, "\n".join([header, *rows]))
    assert np.asarray(file.ownship.velocity_enu_mps)[1] == pytest.approx([50 * MILE_S] * 2)


def test_altitudes_that_look_like_feet_are_told(tmp_path):
    rows = [f"{t},{n},47,{8 + t / 1000},{1000 + 25 * t}" for t in range(8) for n in "ab"]
    file = read(tmp_path, "\n".join(["time,id,lat,lon,altitude", *rows]))
    assert file.warnings == [
        "altitude has no unit and is read in m, but all its numbers are multiples of 25, as feet "
        "are: altitude_ft would say so"
    ]
    assert read(tmp_path, "\n".join(["time,id,lat,lon,alt_m", *rows])).warnings == []


@pytest.mark.parametrize(
    ("heights", "is_noted"),
    [
        ((1000, 1025, 1050, 1100, 1200), True), ((1000, 1025, 1050, 1100), False),
        # One that is no multiple of 25, and flight levels, which metres may be as well.
        ((1000, 1025, 1050, 1101, 1200), False), ((1000, 1100, 1200, 1300, 1500), False),
        ((1010, 1025, 1050, 1075, 1200), False), ((100, 1125, 1200, 1300, 1500), True),
    ],
)  # fmt: skip
def test_feet_are_suspected_where_five_heights_are_all_steps_of_25(tmp_path, heights, is_noted):
    rows = [f"{t},{n},47,{8 + t / 1000},{up}" for t, up in enumerate(heights) for n in "ab"]
    file = read(tmp_path, "\n".join(["time,id,lat,lon,altitude", *rows]))
    assert bool(file.warnings) is is_noted


def test_check_tells_what_was_left_out_and_run_json_keeps_it(tmp_path, monkeypatch):
    from click.testing import CliRunner

    from dsa_des.cli import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.csv").write_text(OPENSKY.format(gap="NA"))
    scene = 'extends = "detect_and_sense"\n[blocks.traffic]\ntype = "traffic.csv"\nfile = "t.csv"\n'
    (tmp_path / "s.toml").write_text(scene + 'altitude = "barometric"\n')
    done = CliRunner().invoke(main, ["check", "s.toml"])
    assert done.exit_code == 0, done.stderr
    assert (
        "note: blocks.traffic: file t.csv: 2 rows were left out that had no position" in done.stderr
    )
    done = CliRunner().invoke(main, ["run", "s.toml", "--no-figures", "--out", "r"])
    assert done.exit_code == 0, done.stderr
    kept = json.loads((tmp_path / "r" / "run.json").read_text())["notes"]
    assert any("2 rows were left out" in note for note in kept)


#: Two flights of one callsign, 300 km apart, and one of another; seconds, latitude, longitude.
FIRST = [(10 * k, 47.0 + 0.02 * k, 8.0) for k in range(6)]
SECOND = [(10 * k, 48.0, 12.0 - 0.03 * k) for k in range(4)]


def shared(rows, ident="callsign"):
    lines = [f"{t},DUP1,{lat!r},{lon!r},3000" for t, lat, lon in rows]
    lines += [f"{10 * k},OTHER,46.{k},7,2000" for k in range(4)]
    return "\n".join([f"time,{ident},lat,lon,alt", *lines, ""])


@pytest.mark.parametrize("late_s", [0, 5, 3600])
@pytest.mark.parametrize("ident", ["callsign", "id"])
def test_two_aircraft_of_one_name_are_told_apart_where_none_could_fly_so(tmp_path, late_s, ident):
    """At the same instants, in between, and an hour later, which no note can bridge."""
    second = [(t + late_s, lat, lon + (10 if late_s > 99 else 0)) for t, lat, lon in SECOND]
    if late_s > 99:  # on the other side of the Earth
        second = [(t, -lat, lon + 170.0) for t, lat, lon in second]
    file = read(tmp_path, shared(sorted(FIRST + second), ident))
    assert [craft.name for craft in file.aircraft] == ["DUP1", "DUP1 (2)", "OTHER"]
    one, other, _ = file.aircraft
    assert one.lat_deg.tolist() == [lat for _, lat, _ in FIRST]
    assert other.lat_deg.tolist() == [lat for _, lat, _ in second]
    assert max(one.max_speed_mps, other.max_speed_mps) < 300.0
    (said,) = [note for note in file.warnings if "DUP1" in note and "aircraft, for none" in note]
    assert said == (
        "DUP1: is 2 aircraft, for none flies so far from one sample to the next: 'DUP1' with 6, "
        "'DUP1 (2)' with 4 samples"
    )


def test_one_aircraft_with_wrong_places_stays_one_and_an_address_is_one_aircraft(tmp_path):
    """Two places gone wrong are no aircraft; and who is sure of its identity is not split."""
    wrong = [FIRST[0], (15, 50.0, 8.0), *FIRST[1:], (57, 51.0, 8.0)]
    file = read(tmp_path, shared(sorted(wrong)))
    assert [craft.name for craft in file.aircraft] == ["DUP1", "OTHER"]
    assert len(file.ownship.lat_deg) == 8
    late = [(t + 5, lat, lon) for t, lat, lon in SECOND]
    file = read(tmp_path, shared(sorted(FIRST + late), "hex"))
    assert [craft.name for craft in file.aircraft] == ["DUP1", "OTHER"]
    taken = shared(sorted(FIRST + late)) + "0,DUP1 (2),46,6,900\n9,DUP1 (2),46,6.01,900\n"
    names = [craft.name for craft in read(tmp_path, taken).aircraft]
    assert names == ["DUP1", "DUP1 (3)", "OTHER", "DUP1 (2)"]


def test_a_table_that_a_shell_drew_is_read(tmp_path):
    """Impala's repeats its names between blocks; Trino's has no bars at its edges."""
    names = " | ".join(("time      ", "icao24", "lat   ", "lon", "baroaltitude", "squawk"))
    rows = [
        " | ".join((str(1480760792 + k), "a0d724", f"47.00{k}", "8.0", "1000        ", "NULL  "))
        for k in range(4)
    ]
    line = "+".join("-" * (len(cell) + 2) for cell in names.split(" | "))
    frame, bars = f"+{line}+", [f"| {one} |" for one in (names, *rows)]
    impala = ["Query: select * from x", frame, bars[0], frame, *bars[1:3], frame, bars[0], frame,
              *bars[3:], frame, "Fetched 4 row(s) in 1.03s"]  # fmt: skip
    trino = [f" {names} ", line, *(f" {one} " for one in rows), "(4 rows)"]
    for drawn in (impala, trino):
        path = tmp_path / "log.txt"
        path.write_text("\n".join(drawn))
        (flown,) = known_kinds.recording_of_file(path).flights().aircraft
        assert flown.name == "a0d724" and flown.alt_m.tolist() == [1000.0] * 4
        assert flown.lat_deg.tolist() == [47.0, 47.001, 47.002, 47.003]
        assert flown.sample_times_s.tolist() == [0.0, 1.0, 2.0, 3.0]


GRANULAR = """\
network_time,receiver_time,hex,callsign,latitude,longitude,altitude,speed,track,vspeed,,
2024-01-02 07:41:03Z.515,1970-01-01 00:00:00Z.000,0x8467d8,T1,41.5,141.6,1000,100,0,64,,
2024-01-02 07:41:03Z.572,2024-01-02 07:41:02Z.991,0x8467d8,T1,41.4998,141.6,1000,100,0,64,,
2024-01-02 07:41:04Z.100,2024-01-02 07:41:04Z.000,0x8467d8,T1,0,0,1000,0,0,0,,
2024-01-02 07:41:04Z.515,2024-01-02 07:41:04Z.400,0x8467d8,T1,41.5005,141.6,1000,100,0,64,,
2024-01-02 07:41:06Z.015,2024-01-02 07:41:05Z.900,0x8467d8,T1,41.5012,141.6,0,0,0,0,,
"""


def test_flightradar24_s_messages_are_thinned_to_a_second(tmp_path):
    """Receivers' clocks are wrong, zeros are no position, and 0 ft is the ground."""
    path = tmp_path / "t.csv"
    path.write_text(GRANULAR)
    flown = known_kinds.recording_of_file(path).flights()
    assert flown.start_time_s == 1704181263.515
    assert flown.ownship.name == "8467d8"
    assert flown.ownship.sample_times_s.tolist() == [0.0, 1.0]
    assert flown.ownship.lat_deg.tolist() == [41.5, 41.5005]
    assert flown.ownship.alt_m.tolist() == [1000 * FOOT] * 2
    assert flown.ownship.velocity_enu_mps[1] == pytest.approx([100 * KNOT] * 2)
    assert flown.warnings == [
        "1 positions were left out that came within a second of another: receivers' delays differ "
        "by as much",
        "2 rows were left out that had no position or no height",
    ]


def test_zeros_are_a_position_near_there_only(tmp_path):
    rows = "0,a,{0},0,1000\n1,a,0,0,1000\n0,b,47,8,1000\n1,b,0,0,1000\n"
    for lat, there in (("0.01", 2), ("20", 1)):
        file = read(tmp_path, f"time,id,lat,lon,alt\n{rows.format(lat)}")
        assert [len(one.alt_m) for one in file.aircraft] == [there, 1]


def test_a_clock_of_whole_seconds_says_several_places_of_each(tmp_path):
    rows = [f"{k // 2},a,{47 + 1e-4 * k:.4f},8,{1000 + k},0" for k in range(8)]
    text = "\n".join(["time,id,lat,lon,alt,squawk", *rows, "0,b,47,9,1,0\n"])
    own = read(tmp_path, text).ownship
    assert own.sample_times_s.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert own.lat_deg.tolist() == [47.0001, 47.0003, 47.0005, 47.0007]
    with pytest.raises(TrafficFileError, match="a already has a sample at 0 s"):
        read(tmp_path, text.replace("47.0001", "47.0011"))


def test_days_of_silence_are_a_gap_where_times_are_dates(tmp_path):
    text = "time,id,lat,lon,alt\n" + "".join(f"{{{k}}},a,47,8,1000\n" for k in range(4))
    path = tmp_path / "t.csv"
    for begins, days, taken in ((1.7e9, 40, True), (1.7e9, 400, False), (5.0, 2, False)):
        path.write_text(text.format(*(begins + k for k in (0, 1, 2, 86400 * days))))
        if taken:
            own = known_kinds.recording_of_file(path).flights(None).ownship
            assert own.away.tolist() == [False, False, True, False]
            assert own.sample_times_s[3] == 40 * 86400
            continue
        with pytest.raises(TrafficFileError, match="more than 86400 s, where it says dates 366"):
            known_kinds.recording_of_file(path)


def test_a_unit_may_be_joined_to_a_name_by_its_capital(tmp_path):
    text = "timeMs,id,lat,lon,altFt\n0,a,47,8,1000\n500,a,47,8,1000\n0,b,47,8.1,1000\n"
    own = read(tmp_path, text).ownship
    assert own.sample_times_s.tolist() == [0.0, 0.5] and own.alt_m.tolist() == [1000 * FOOT] * 2
