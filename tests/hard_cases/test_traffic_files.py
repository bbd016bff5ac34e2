"""Traffic files as they are found, and as they should never be: one row per case.

Sources: "wild 1-7" are the features of `.daa` and `.xyz` files collected from NASA's DAIDALUS
scenarios (github.com/nasa/daidalus, folder Scenarios) and NRC Canada's flown intercepts
(github.com/nrc-cnrc/daamsim); "contract" is the list of bad input that this project promises to
report; the others are named where they stand. All text here is our own.
"""

import pickle

import numpy as np
import pytest
from recorded_files import read_csv

from components.formats.daa_file import read_daa
from components.formats.text_rows import TrafficFileError

H = "NAME lat lon alt trk gs vs time\n"
U = "[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]\n"
A0, A1 = "A, 45, -75, 1000, 0, 0, 0, 10\n", "A, 45, -75, 1000, 0, 0, 0, 11\n"
B0, B1 = "B, 45.1, -75, 2000, 0, 0, 0, 10\n", "B, 45.1, -75, 2000, 0, 0, 0, 11\n"
GOOD = H + U + A0 + B0 + A1 + B1
FOOT = 0.3048


def plain(text):
    return text.encode()


# (case, source, bytes of the file); every one must give aircraft A and B, at 1000 and 2000 ft.
SURVIVES = [
    ("plain", "wild", plain(GOOD)),
    (
        "no comma before time, leading blanks, comma headers, unitless",
        "wild 1 (NRC)",
        plain(
            " NAME,  lat,  lon,  alt,  vx,  vy,  vz,  time \n"
            " unitless, [deg], [deg], [ft], [m/s], [m/s], [m/s], [s] \n"
            "A, 45, -75, 1000, 0, 0, 0 10\nB, 45.1, -75, 2000, 0, 0, 0 10\n"
            "  A, 45, -75, 1000, 0, 0, 0 11\n B, 45.1, -75, 2000, 0, 0, 0 11\n"
        ),
    ),
    ("blank header, blank rows", "wild 1", plain(GOOD.replace(",", ""))),
    (
        "comments first and in between",
        "wild 1",
        plain("## made by hand\n# x\n" + H + U + A0 + "# y\n" + B0),
    ),
    ("commas at the line's end", "own", plain(H + U + A0.replace("\n", ",\n") + B0 + A1 + B1)),
    (
        "metres",
        "wild 2",
        plain(GOOD.replace("[ft]", "[m]").replace("1000", "304.8").replace("2000", "609.6")),
    ),
    (
        "nautical miles of altitude",
        "wild 2",
        plain(
            GOOD.replace("[ft]", "[nmi]")
            .replace(" 1000", f" {304.8 / 1852!r}")
            .replace(" 2000", f" {609.6 / 1852!r}")
        ),
    ),
    *[
        (f"speed in {unit}", "wild 2", plain(GOOD.replace("[knot]", unit)))
        for unit in ("[kn]", "[kts]", "[m/s]", "[nmi/s]", "[fpm]", "[KNOT]", "[ m / s ]")
    ],
    (
        "milliseconds",
        "wild 2",
        plain(
            GOOD.replace("[s]", "[ms]").replace(" 10\n", " 10000\n").replace(" 11\n", " 11000\n")
        ),
    ),
    (
        "radians",
        "own",
        plain(
            GOOD.replace("[deg] [deg] [ft]", "[rad] [rad] [ft]")
            .replace("45.1", "0.7")
            .replace("45", "0.7")
            .replace("-75", "-1.3")
        ),
    ),
    ("units without brackets", "own", plain(GOOD.replace("[", "").replace("]", ""))),
    (
        "no velocity",
        "wild 3",
        plain(
            "NAME lat lon alt time\n[none] [deg] [deg] [ft] [s]\n"
            "A 45 -75 1000 10\nB 45.1 -75 2000 10\nA 45 -75 1000 11\n"
        ),
    ),
    (
        "optional columns, text in one of them",
        "wild 4",
        plain(
            "NAME lat lon alt trk gs vs heading airspeed time alerter s_EW_std v_EW_std note\n"
            "[none] [deg] [deg] [ft] [deg] [knot] [fpm] [deg] [knot] [s] "
            "[none] [nmi] [furlong] [none]\n"
            "A, 45, -75, 1000, 0, 0, 0, 0, 0, 10, 1, 0.02, nan, -\n"
            "B, 45.1, -75, 2000, 0, 0, 0, 0, 0, 10, 1, 0.02, nan, hello\n"
        ),
    ),
    (
        "one comes late, one leaves early",
        "wild 5",
        plain(H + U + A0 + A1 + B1 + B1.replace(" 11\n", " 12.5\n")),
    ),
    ("three aircraft", "wild 5", plain(GOOD + A1.replace("A,", "C,"))),
    (
        "GPS seconds of week",
        "wild 6",
        plain(GOOD.replace(" 10\n", " 503880.4\n").replace(" 11\n", " 503880.5\n")),
    ),
    ("no row of units", "own (DAIDALUS assumes deg, ft, knot, fpm, s)", plain(H + A0 + B0 + A1)),
    ("CR LF", "own", plain(GOOD.replace("\n", "\r\n"))),
    ("CR alone", "own", plain(GOOD.replace("\n", "\r"))),
    ("no newline at the end", "own", plain(GOOD.rstrip())),
    ("byte-order mark", "own", b"\xef\xbb\xbf" + plain(GOOD)),
    ("UTF-16", "own", GOOD.encode("utf-16")),
    ("Latin-1 in a comment", "own", "# H\xf6he\n".encode("latin-1") + plain(GOOD)),
    ("blank lines", "own", plain(GOOD.replace("\n", "\n\n \n"))),
    ("tabs", "own", plain(GOOD.replace(", ", "\t"))),
    ("semicolons", "own", plain(GOOD.replace(",", ";"))),
    ("upper-case headers", "own", plain(H.upper() + U.upper() + A0 + B0 + A1)),
    ("longitude in 0...360 and beyond", "own", plain(GOOD.replace("-75", "285"))),
]


@pytest.mark.parametrize("data", [row[2] for row in SURVIVES], ids=[row[0] for row in SURVIVES])
def test_reader_survives(tmp_path, data):
    path = tmp_path / "wild.daa"
    path.write_bytes(data)
    file = read_daa(path)
    assert [a.name for a in file.aircraft][:2] == ["A", "B"]
    for aircraft, feet in zip(file.aircraft, (1000, 2000), strict=False):
        assert aircraft.alt_m == pytest.approx(feet * FOOT, rel=1e-12)
        assert -76 < aircraft.lon_deg[0] < -74
        assert 40 < aircraft.lat_deg[0] < 46
    assert min(a.sample_times_s[0] for a in file.aircraft) == 0
    first, last = file.ownship.interval_present()
    assert last - first == pytest.approx(0.1 if file.start_time_s > 1e5 else last, abs=1e-9)


def test_names_with_blanks_in_a_comma_separated_file(tmp_path):
    path = tmp_path / "n.daa"
    path.write_text(GOOD.replace("A,", "Big  Bird,").replace("B,", "N 123 AB,"))
    assert [a.name for a in read_daa(path).aircraft] == ["Big  Bird", "N 123 AB"]


def test_late_and_early_aircraft_are_absent_outside_their_samples(tmp_path):
    path = tmp_path / "late.daa"
    path.write_text(H + U + A0 + A1 + B1 + B1.replace(" 11\n", " 12.5\n"))
    file = read_daa(path)
    times = np.array([-0.1, 0.0, 0.9, 1.0, 1.1, 2.5, 2.6])
    assert file.ownship.at(times).present.tolist() == [False, True, True, True] + [False] * 3
    assert file.intruders[0].at(times).present.tolist() == [False] * 3 + [True] * 3 + [False]


# (case, source, text of the file, what each problem must say, in order)
REFUSED = [
    (
        "truncated row",
        "contract",
        GOOD + "A, 45, -75, 10",
        ["line 7: the row has 4 values: the header names 8 columns"],
    ),
    (
        "too many values",
        "own",
        GOOD + "A, 45, -75, 10, 0, 0, 0, 12, 13",
        ["line 7: the row has 9 values: the header names 8 columns"],
    ),
    (
        "non-numeric cell",
        "contract",
        GOOD.replace("2000, 0, 0, 0, 11", "high, 0, 0, 0, 11"),
        ["line 6, column alt: 'high' is not a number: a finite number is needed"],
    ),
    (
        "empty cell",
        "own",
        GOOD.replace("A, 45, -75, 1000, 0, 0, 0, 11", "A, 45, , 1000, 0, 0, 0, 11"),
        ["line 5, column lon: the cell is empty: a finite number is needed"],
    ),
    (
        "one aircraft only",
        "contract",
        H + U + A0 + A1,
        ["there is one aircraft only, 'A': an ownship and at least one intruder are needed"],
    ),
    (
        "duplicate times",
        "contract",
        GOOD + A1,
        ["line 7, column time: A already has a sample at 11 s, in line 5"],
    ),
    (
        "NaN",
        "contract",
        GOOD.replace("45.1, -75, 2000, 0, 0, 0, 11", "NaN, -75, 2000, 0, 0, 0, 11"),
        ["line 6, column lat: 'NaN' is not finite"],
    ),
    (
        "infinity",
        "contract",
        GOOD.replace("2000, 0, 0, 0, 11", "-inf, 0, 0, 0, 11"),
        ["line 6, column alt: '-inf' is not finite"],
    ),
    (
        "overflowing number",
        "own",
        GOOD.replace("2000, 0, 0, 0, 11", "1e999, 0, 0, 0, 11"),
        ["line 6, column alt: '1e999' is not finite"],
    ),
    (
        "underscore in a number",
        "own",
        GOOD.replace("2000, 0, 0, 0, 11", "2_000, 0, 0, 0, 11"),
        ["line 6, column alt: '2_000' is not a number"],
    ),
    (
        "latitude out of range",
        "contract",
        GOOD.replace("45.1", "95.1"),
        ["line 4, column lat: 95.1 is out of range: it must lie in [-90, 90] degrees", "line 6"],
    ),
    (
        "unknown unit",
        "contract",
        GOOD.replace("[ft]", "[furlong]"),
        ["line 2, column alt: unit '[furlong]' is unknown here: it must be one of m, metre"],
    ),
    (
        "unit of another kind",
        "own",
        GOOD.replace("[ft]", "[s]"),
        ["line 2, column alt: unit '[s]' is unknown here"],
    ),
    (
        "no unit where one is needed",
        "own",
        GOOD.replace("[ft]", "[none]"),
        ["line 2, column alt: has no unit"],
    ),
    (
        "too few units",
        "own",
        GOOD.replace("[none] ", ""),
        ["line 2: the row of units has 7 entries: the header names 8 columns"],
    ),
    (
        "misspelt column",
        "contract",
        GOOD.replace("lat lon", "latt lon"),
        [
            "line 1: there is no column 'lat' among NAME, latt, lon, alt, trk, gs, vs, time; "
            "is it 'latt'?"
        ],
    ),
    (
        "no time column",
        "own",
        "NAME lat lon alt\n[none] [deg] [deg] [ft]\nA 1 1 1\n",
        ["line 1: there is no column 'time'"],
    ),
    ("empty file", "contract", "", ["the file is empty"]),
    ("only comments", "own", "# a\n\n## b\n", ["the file is empty"]),
    ("header only", "own", H, ["there are no samples"]),
    ("header and units only", "own", H + U, ["there are no samples"]),
    (
        "several at once",
        "contract",
        GOOD + "A, 1\nB, x, y, 1, 0, 0, 0, 12\n" + A1,
        [
            "line 7: the row has 2",
            "line 8, column lat: 'x'",
            "line 8, column lon: 'y'",
            "line 9, column time: A already",
        ],
    ),
]


@pytest.mark.parametrize("text, expected", [r[2:] for r in REFUSED], ids=[r[0] for r in REFUSED])
def test_reader_refuses(tmp_path, text, expected):
    path = tmp_path / "bad.daa"
    path.write_text(text)
    with pytest.raises(TrafficFileError) as caught:
        read_daa(path)
    assert len(caught.value.problems) == len(expected)
    for problem, start in zip(caught.value.problems, expected, strict=True):
        assert problem.startswith(start)
    assert str(path) in str(caught.value)


def test_no_such_file_names_the_nearest(tmp_path):
    (tmp_path / "Intercept3.daa").write_text(GOOD)
    with pytest.raises(TrafficFileError, match=r"no such file; did you mean 'Intercept3.daa'\?"):
        read_daa(tmp_path / "intercept_3.daa")


@pytest.mark.parametrize("reader", [read_daa, read_csv])
def test_directory_and_binary(tmp_path, reader):
    with pytest.raises(TrafficFileError, match="this is a directory"):
        reader(tmp_path)
    for data in (bytes(range(256)) * 20, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", b"\xff\xfe\x00"):
        (tmp_path / "b.daa").write_bytes(data)
        with pytest.raises(TrafficFileError, match="this is a binary file"):
            reader(tmp_path / "b.daa")


def test_at_most_twenty_problems_are_listed(tmp_path):
    path = tmp_path / "many.daa"
    path.write_text(GOOD + "A, 1\n" * 30)
    with pytest.raises(TrafficFileError) as caught:
        read_daa(path)
    assert len(caught.value.problems) == 20
    assert caught.value.problems[-1].endswith("(and 10 more problems)")


def test_error_survives_pickling_and_rebuilding_from_its_args(tmp_path):
    path = tmp_path / "p.daa"
    path.write_text(H + U + A0)
    with pytest.raises(TrafficFileError) as caught:
        read_daa(path)
    error = caught.value
    for again in (pickle.loads(pickle.dumps(error)), type(error)(*error.args)):
        assert (again.path, again.problems, str(again)) == (error.path, error.problems, str(error))


CSV = "time,id,lat,lon,alt\n0,a,45,-75,1000\n0,b,45.1,-75,1000\n1,a,45,-75,1000\n"

CSV_REFUSED = [
    ("truncated row", "contract", CSV + "2,a,45\n", "line 5: the row has 3 values"),
    ("non-numeric", "contract", CSV + "2,a,45,-75,FL100\n", "line 5, column alt: 'FL100' is not"),
    ("infinity", "contract", CSV + "2,a,inf,-75,1\n", "line 5, column lat: 'inf' is not finite"),
    ("duplicate time", "contract", CSV + "1,a,45,-75,1\n", "line 5, column time: a already has"),
    (
        "one aircraft",
        "contract",
        CSV.replace("b", "a").replace("\n0,a,45.1", "\n3,a,45.1"),
        "there is one aircraft only",
    ),
    (
        "misspelt column",
        "contract",
        CSV.replace("lat", "lattitude"),
        "line 1: there is no column 'lat'",
    ),
    (
        "unknown unit",
        "contract",
        CSV.replace("alt", "alt (yd)"),
        "line 1, column alt (yd): unit 'yd'",
    ),
    (
        "decimal comma",
        "own",
        CSV.replace(",", ";") + "2;a;45,5;-75;1\n",
        "line 5, column lat: '45,5' is not a number: a finite number is needed; "
        "use a decimal point",
    ),
    (
        "not a date",
        "own",
        CSV + "2020-13-01,a,45,-75,1\n",
        "line 5, column time: '2020-13-01' is no time: it must be seconds, or as 2024-06-01T12",
    ),
    ("no name", "own", CSV + "2,,45,-75,1\n", "line 5: the aircraft has no name"),
    ("empty", "contract", "", "the file is empty"),
    ("header only", "own", "time,id,lat,lon,alt\n", "there are no samples"),
]


@pytest.mark.parametrize(
    "text, start", [r[2:] for r in CSV_REFUSED], ids=[r[0] for r in CSV_REFUSED]
)
def test_csv_reader_refuses(tmp_path, text, start):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(TrafficFileError) as caught:
        read_csv(path)
    assert caught.value.problems[0].startswith(start)
    assert len(caught.value.problems) == 1


def test_csv_ownship_that_is_not_there(tmp_path):
    path = tmp_path / "o.csv"
    path.write_text(CSV)
    with pytest.raises(TrafficFileError, match="no aircraft 'z': it must be one of a, b"):
        read_csv(path, ownship="z")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (A0 + B0 + A1.replace("11\n", "10.0000001\n"), "must be at least 1e-06 s later"),
        (A0 + B0 + A1.replace("45,", "46,").replace("11\n", "10.01\n"), "A flies at up to 1.1"),
        (
            A0 + B0 + B1.replace("11\n", "86411\n"),
            "may not be without a sample for more than 86400",
        ),
    ],
)
def test_times_that_cannot_be_meant(tmp_path, rows, message):
    path = tmp_path / "t.daa"
    path.write_text(H + U + rows)
    with pytest.raises(TrafficFileError, match=message):
        read_daa(path)


def test_a_day_of_silence_is_still_read(tmp_path):
    path = tmp_path / "t.daa"
    path.write_text(H + U + A0 + B0 + B1.replace("11\n", "86410\n"))
    assert read_daa(path).intruders[0].interval_present()[1] == 86400.0
