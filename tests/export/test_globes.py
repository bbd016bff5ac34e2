"""KML and CZML of a run made by hand, read by parsers of XML and JSON, places by pymap3d."""

import json
import math
import xml.etree.ElementTree as ElementTree
from datetime import UTC, datetime

import numpy as np
import pyarrow as pa
import pymap3d
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

import dsa_des
from components.display.recorded_run import RecordedTables
from components.display.symbols import LEVELS_ON_DARK, ON_DARK
from components.export.command import export
from components.export.czml import czml_text
from components.export.export_formats import _geoid_note_and_height_m
from components.export.kml import kml_text
from components.export.mcap_export import mcap_bytes
from components.sensor.palette import EO, RADAR, TRACKER
from components.view.page import read_page_file
from tests.view.test_page import SCENE as WATCHED

SPACE = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
SCENE = """
[blocks.radar]
type = "radar.swerling"
[blocks.eo]
type = "optical.eo"
[blocks.tracker]
type = "tracking.ekf"
[blocks.second]
type = "tracking.imm"
"""
ORIGIN = {"origin_lat_deg": -33.95, "origin_lon_deg": 179.99, "origin_alt_m": 500.0}
#: An ownship banked in a turn, and two targets across the date line, at odd times.
FLIGHTS = {
    None: ([0.1, 2.3, 4.7, 9.9], [-33.9, -33.901, -33.902, -33.903], [179.98] * 4, [900.0] * 4),
    "a": ([0.1, 2.3, 4.7, 9.9], [-33.91] * 4, [179.999, 179.9999, -179.9999, -179.998],
          [1000.0, 1010.0, 1020.0, 1030.0]),
    "b & <c>": ([2.3, 4.7], [-33.92] * 2, [179.97] * 2, [1100.0] * 2),
}  # fmt: skip
SEEN = {
    "block": ["radar", "eo", "radar"], "target": ["a", None, "b & <c>"],
    "time_s": [0.25, 1.0004, 9.5], "azimuth_rad": [0.4, -1.0, 2.2],
    "elevation_rad": [0.1, -0.2, 0.3], "range_m": [1500.0, 2500.0, 800.0],
    "own_lat_deg": [-33.9] * 3, "own_lon_deg": [179.98] * 3, "own_alt_m": [950.0] * 3,
    "own_heading_rad": [math.radians(217.0)] * 3, "own_pitch_rad": [0.1, -0.1, 0.05],
    "own_roll_rad": [0.5, -0.4, 0.3],
}  # fmt: skip
STATES = {  # of the second tracker first, so that order in the table is not order by name
    "block": ["tracker", "second", "tracker", "second", "tracker", "second"],
    "track": [3, 3, 3, 3, 3, 8],
    "track_status": ["tentative", "confirmed", "confirmed", "coasted", "deleted", "tentative"],
    "state_s": [1.0, 1.5, 2.0, 2.5, 2.9, 1.0],
    "north_m": [100.0, 200.0, 300.0, 400.0, 500.0, 0.0],
    "east_m": [-700.0, 900.0, 10.0, 20.0, 30.0, 0.0],
    "down_m": [-50.0, 60.0, -400.0, 5.0, 0.0, 0.0],
}  # fmt: skip
#: Time, target, track, level.
ALERTS = [
    (1.0, "a", None, 0), (2.0, "a", None, 1), (3.0, "a", None, 1), (3.5, "a", None, 4),
    (6.0, "a", None, 0), (8.0, "a", None, 2),
    (1.6, None, 3, 2), (2.0, None, 3, 2), (2.4, None, 3, 0),
]  # fmt: skip


def crafted(tmp_path, scene=SCENE):
    rows = [(who, k) for who, flight in FLIGHTS.items() for k in range(len(flight[0]))]
    truth = {"target": [who for who, _ in rows]}
    for place, name in enumerate(("time_s", "lat_deg", "lon_deg", "alt_m")):
        truth[name] = [FLIGHTS[who][place][k] for who, k in rows]
    for name in ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s", "heading_rad",
                 "pitch_rad", "roll_rad"):  # fmt: skip
        truth[name] = [0.0] * len(rows)
    states = STATES | {name: [value] * 6 for name, value in ORIGIN.items()}
    held = {
        "block": ["holder"] * 3, "target": ["a", "a", "a"], "measured_s": [0.25, 0.25, 9.5],
        **{name: [SEEN[name][k] for k in (0, 0, 2)] for name in SEEN if name[:3] in
           ("azi", "ele", "ran", "own")},
    }  # fmt: skip
    alerts = [
        dict(zip(("time_s", "target", "track", "level"), one, strict=True)) | {"block": "alerting"}
        for one in sorted(ALERTS, key=lambda one: one[0])
    ]
    (tmp_path / "scene.toml").write_text(scene)
    tables = {"truth": truth, "detections": SEEN, "state_tracks": states, "tracks": held}
    found = {name: pa.table(table) for name, table in tables.items()}
    return RecordedTables(tmp_path, {**found, "alerts": pa.Table.from_pylist(alerts)})


def seconds(text):
    """Seconds of a globe's time from its second 0, by what ISO 8601 says."""
    return (datetime.fromisoformat(text) - datetime(2000, 1, 1, tzinfo=UTC)).total_seconds()


def where_seen(k):
    """Longitude, latitude and height of a detection, by SciPy's rotations and pymap3d."""
    azimuth, elevation, far_m = (SEEN[n][k] for n in ("azimuth_rad", "elevation_rad", "range_m"))
    body = [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth),
            -math.sin(elevation)]  # fmt: skip
    angles = [SEEN[f"own_{name}_rad"][k] for name in ("heading", "pitch", "roll")]
    ned = Rotation.from_euler("ZYX", angles).apply(far_m * np.array(body))
    lat, lon, alt = pymap3d.ned2geodetic(
        *ned, *(SEEN[f"own_{name}"][k] for name in ("lat_deg", "lon_deg", "alt_m"))
    )
    return (lon + 180) % 360 - 180, lat, alt


def where_estimated(k):
    ned = [STATES[name][k] for name in ("north_m", "east_m", "down_m")]
    lat, lon, alt = pymap3d.ned2geodetic(*ned, *ORIGIN.values())
    return (lon + 180) % 360 - 180, lat, alt


def courses():
    """Name, colour and samples (time, longitude, latitude, height) of all that moves, by hand."""
    for who, (times, lat, lon, alt) in FLIGHTS.items():
        colour = ON_DARK["truth" if who else "own"]
        yield who or "ownship", colour, list(zip(times, lon, lat, alt, strict=True))
    # A kind's second block is a shade lighter or darker; names in order are holder, second, tracker
    yield "second #3", TRACKER.colour, [(STATES["state_s"][k], *where_estimated(k)) for k in (1, 3)]
    yield "tracker #3", None, [(STATES["state_s"][k], *where_estimated(k)) for k in (0, 2)]
    yield "holder a", None, [(0.25, *where_seen(0)), (9.5, *where_seen(2))]
    first, second, third = LEVELS_ON_DARK
    lat, alt = -33.91, lambda t: np.interp(t, *(FLIGHTS["a"][k] for k in (0, 3)))
    lon = lambda t: (np.interp(t, FLIGHTS["a"][0], [179.999, 179.9999, 180.0001, 180.002])  # noqa: E731
                     + 180) % 360 - 180  # fmt: skip
    for level, colour, times in ((1, first, [2.0, 2.3, 3.5]), (4, third, [3.5, 4.7, 6.0]),
                                 (2, second, [8.0, 9.9])):  # fmt: skip
        yield f"a: alert {level}", colour, [(t, float(lon(t)), lat, float(alt(t))) for t in times]
    # The track of that number that went on longest: the second tracker's, known from 1.5 to 2.5 s.
    start, end = (np.array((STATES["state_s"][k], *where_estimated(k))) for k in (1, 3))
    between = [start + part * (end - start) for part in (0.1, 0.9)]
    yield "track 3: alert 2", second, between


def kml_colour(element):
    """A colour of KML, opacity, blue, green, red, as one of the web."""
    text = element.findtext(".//k:LineStyle/k:color", namespaces=SPACE)
    assert text[:2] == "ff"
    return f"#{text[6:8]}{text[4:6]}{text[2:4]}"


def test_kml_holds_flights_tracks_and_alerts_at_their_times_and_heights(tmp_path):
    geoid_m = 31.25
    root = ElementTree.fromstring(kml_text(crafted(tmp_path), geoid_m))
    styles = {f"#{s.get('id')}": s for s in root.findall(".//k:Style", SPACE)}
    marks = {m.findtext("k:name", namespaces=SPACE): m
             for m in root.findall(".//gx:Track/..", SPACE)}  # fmt: skip
    wanted = list(courses())
    assert set(marks) == {name for name, _, _ in wanted}  # a track never confirmed is not there
    colours = {}
    for name, colour, samples in wanted:
        track = marks[name].find("gx:Track", SPACE)
        times = [seconds(w.text) for w in track.findall("k:when", SPACE)]
        places = np.array([c.text.split() for c in track.findall("gx:coord", SPACE)], dtype=float)
        rows = np.array(samples)
        assert times == pytest.approx(rows[:, 0], abs=1e-6), name
        assert places[:, :2] == pytest.approx(rows[:, 1:3], abs=1e-7), name
        # Heights of a run are above the ellipsoid, those of KML above the geoid.
        assert places[:, 2] == pytest.approx(rows[:, 3] - geoid_m, abs=1e-3), name
        assert track.findtext("k:altitudeMode", namespaces=SPACE) == "absolute"
        colours[name] = kml_colour(styles[marks[name].findtext("k:styleUrl", namespaces=SPACE)])
        if colour is not None:
            assert colours[name].lower() == colour.lower(), name
    assert len({colours[n] for n in ("second #3", "tracker #3", "holder a")}) == 3
    assert "31.25 m for the geoid" in root.findtext(".//k:description", namespaces=SPACE)
    folders = [f.findtext("k:name", namespaces=SPACE) for f in root.findall(".//k:Folder", SPACE)]
    assert folders == ["Aircraft", "Tracks of holder", "Tracks of second", "Tracks of tracker",
                       "Alerts", "Detections of eo", "Detections of radar"]  # fmt: skip


def test_czml_holds_the_same_above_the_ellipsoid(tmp_path):
    document, *packets = json.loads(czml_text(crafted(tmp_path)))
    assert [seconds(t) for t in document["clock"]["interval"].split("/")] == [0.0, 9.9]
    moving = {p["name"]: p for p in packets if not p["id"].startswith("detection/")}
    wanted = list(courses())
    assert set(moving) == {name for name, _, _ in wanted}
    assert len({p["id"] for p in packets}) == len(packets)
    # An alert goes with an aircraft or a track: its words stand below the other's.
    offset = {p["id"]: p["label"]["pixelOffset"]["cartesian2"] for p in moving.values()}
    assert {tuple(at) for id, at in offset.items() if id.startswith("alert/")} == {(12, 16)}
    assert {tuple(at) for id, at in offset.items() if not id.startswith("alert/")} == {(12, 0)}
    for name, colour, samples in wanted:
        packet, rows = moving[name], np.array(samples)
        found = np.reshape(packet["position"]["cartographicDegrees"], (-1, 4))
        assert seconds(packet["position"]["epoch"]) == 0.0
        assert found[:, [0, 1, 2]] == pytest.approx(rows[:, [0, 1, 2]], abs=1e-7), name
        assert found[:, 3] == pytest.approx(rows[:, 3], abs=1e-3), name
        there = [seconds(t) for t in packet["availability"].split("/")]
        assert there == pytest.approx([rows[0, 0], rows[-1, 0]], abs=1e-6)
        if colour is not None:
            part = packet["path"]["material"]["solidColor"]["color"] if "path" in packet else (
                packet["point"]["outlineColor"])  # fmt: skip
            assert part["rgba"] == [*bytes.fromhex(colour[1:]), 255], name


def test_detections_are_where_and_when_they_were_in_their_sensors_colours(tmp_path):
    run = crafted(tmp_path)
    root = ElementTree.fromstring(kml_text(run))
    points = root.findall(".//k:Point/..", SPACE)
    _, *packets = json.loads(czml_text(run))
    dots = [p for p in packets if p["id"].startswith("detection/")]
    order = {"eo": 1, "radar a": 0, "radar b & <c>": 2}
    assert [p.findtext("k:name", namespaces=SPACE) for p in points] == list(order)
    assert sorted(p["name"] for p in dots) == sorted(order)
    styles = {f"#{s.get('id')}": s for s in root.findall(".//k:Style", SPACE)}
    for mark, (name, k) in zip(points, order.items(), strict=True):
        (dot,) = [p for p in dots if p["name"] == name]
        kind = EO if name == "eo" else RADAR
        assert dot["point"]["color"]["rgba"] == [*bytes.fromhex(kind.colour[1:]), 255]
        style = styles[mark.findtext("k:styleUrl", namespaces=SPACE)]
        assert kml_colour(style) == kind.colour.lower()
        shape = {"o": "placemark_circle", "s": "placemark_square"}[kind.marker]
        assert style.findtext(".//k:href", namespaces=SPACE).endswith(f"/{shape}.png")
        when = mark.findtext("k:TimeStamp/k:when", namespaces=SPACE)
        assert seconds(when) == pytest.approx(SEEN["time_s"][k], abs=1e-6)
        shown = [seconds(t) for t in dot["availability"].split("/")]
        assert shown == pytest.approx([SEEN["time_s"][k], SEEN["time_s"][k] + 4.0], abs=1e-6)
        point = mark.findtext("k:Point/k:coordinates", namespaces=SPACE).split(",")
        for place in (dot["position"]["cartographicDegrees"], [float(x) for x in point]):
            assert place[:2] == pytest.approx(where_seen(k)[:2], abs=1e-8)
            assert place[2] == pytest.approx(where_seen(k)[2], abs=1e-3)


#: Children that elements may have, in the order of the schema of OGC 07-147r2; those of Google's
#: tracks by its KML reference.
ORDER = {
    "kml": ["Document"],
    "Document": ["name", "visibility", "open", "description", "LookAt", "TimeStamp", "styleUrl",
                 "Style", "Folder", "Placemark"],
    "Folder": ["name", "visibility", "open", "description", "LookAt", "styleUrl", "Style",
               "Placemark"],
    "Placemark": ["name", "visibility", "description", "LookAt", "TimeStamp", "styleUrl", "Style",
                  "Point", "Track"],
    "LookAt": ["longitude", "latitude", "altitude", "heading", "tilt", "range", "altitudeMode"],
    "Style": ["IconStyle", "LabelStyle", "LineStyle", "PolyStyle"],
    "IconStyle": ["color", "colorMode", "scale", "heading", "Icon", "hotSpot"],
    "Icon": ["href"], "LabelStyle": ["color", "colorMode", "scale"],
    "LineStyle": ["color", "colorMode", "width"], "TimeStamp": ["when"],
    "Point": ["extrude", "altitudeMode", "coordinates"],
    "Track": ["extrude", "tessellate", "altitudeMode", "when", "coord", "angles"],
}  # fmt: skip


def test_kml_is_built_as_its_schema_has_it(tmp_path):
    root = ElementTree.fromstring(kml_text(crafted(tmp_path)))
    styles = {f"#{s.get('id')}" for s in root.findall(".//k:Style", SPACE)}
    for element in root.iter():
        space, _, tag = element.tag[1:].partition("}")
        assert space == SPACE["gx" if tag in ("Track", "coord") else "k"]
        places = [ORDER.get(tag, []).index(child.tag.partition("}")[2]) for child in element]
        assert places == sorted(places), tag
        if tag == "styleUrl":
            assert element.text in styles
        if tag == "Track":
            counts = [len(element.findall(n, SPACE)) for n in ("k:when", "gx:coord")]
            assert counts[0] == counts[1] > 0
    ids = [s.get("id") for s in root.findall(".//k:Style", SPACE)]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize(
    ("terrain", "given_m", "geoid_m", "said"),
    [
        ("", None, 0.0, "--geoid-m is 0"), ("", -12.5, -12.5, ""),
        ('[terrain]\nraster = "x.hgt"\nraster_offset_m = 8\n', None, 8.0, "(geoid 8 m above"),
        ('[terrain]\nraster = "x.hgt"\nraster_offset_m = 8\n', 3.0, 3.0, ""),
    ],
)  # fmt: skip
def test_the_geoid_is_given_or_the_terrain_s_or_taken_for_the_ellipsoid(
    tmp_path, terrain, given_m, geoid_m, said
):
    tables = crafted(tmp_path)
    (tmp_path / "scene.toml").write_text(terrain + SCENE)
    words, found_m = _geoid_note_and_height_m(tables, given_m)
    assert found_m == geoid_m and said in words and bool(words) is bool(said)


@pytest.mark.parametrize(
    ("terrain", "options", "geoid_m", "said"),
    [
        ("", [], 0.0, "--geoid-m is 0"),
        ("", ["--geoid-m", "-12.5"], -12.5, ""),
        ('[terrain]\nraster = "x.hgt"\nraster_offset_m = 8\n', [], 8.0, "geoid 8 m above"),
        ('[terrain]\nraster = "x.hgt"\nraster_offset_m = 8\n', ["--geoid-m", "3"], 3.0, ""),
    ],
)
def test_the_geoid_is_what_is_given_or_the_terrains(run, terrain, options, geoid_m, said):
    scene = run / "scene.toml"
    before = scene.read_text()
    scene.write_text(terrain + before)
    done = CliRunner().invoke(export, [str(run), "--to", "kml", *options])
    scene.write_text(before)
    assert done.exit_code == 0 and said in done.output
    kml = run.with_name("run.kml").read_text()
    assert f"less {geoid_m:g} m" in kml
    root = ElementTree.fromstring(kml)
    heights = [float(c.text.split()[2]) for c in root.findall(".//gx:coord", SPACE)]
    assert CliRunner().invoke(export, [str(run), "--to", "czml"]).exit_code == 0
    _, own, *_ = json.loads(run.with_name("run.czml").read_text())
    assert own["position"]["cartographicDegrees"][3] - heights[0] == pytest.approx(geoid_m)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("globe")
    (folder / "scene.toml").write_text(WATCHED.format(title="t", name="n"))
    dsa_des.run(dsa_des.load_scene(folder / "scene.toml"), out=folder / "run")
    return folder / "run"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--to", "czml", "--geoid-m", "3"], "--geoid-m belongs to --to kml, not czml"),
        (["--to", "kml", "--step-s", "3"], "--step-s belongs to --to daa or xyz, not kml"),
        (["--to", "kml", "--geoid-m", "300"], "--geoid-m 300: the geoid is within ±200 m"),
        (["--to", "kml", "--geoid-m", "nan"], "--geoid-m nan"),
        (["--to", "daa", "--step-s", "-1"], "--step-s -1: at least 0.001 s, or 0"),
        (["--to", "daa", "--step-s", "inf"], "--step-s inf"),
        (["--to", "daa", "--step-s", "1000"], ""),
    ],
)
def test_options_that_do_not_fit_are_refused(run, tmp_path, options, said):
    done = CliRunner().invoke(export, [str(run), *options, "--out", str(tmp_path / "o")])
    if said:
        assert done.exit_code == 2 and said in done.output and not list(tmp_path.iterdir())
    else:  # one row each, of second 0
        assert done.exit_code == 0 and len((tmp_path / "o").read_text().splitlines()) == 2 + 2


def test_colours_on_dark_are_those_of_the_page():
    """One kit: what the page shows in its dark theme, globes show alike."""
    style = read_page_file("components.view", "style.css")
    dark = style[style.index('[data-theme="dark"]') :]
    levels = {f"level{k}": colour for k, colour in enumerate(LEVELS_ON_DARK, start=1)}
    for name, colour in (ON_DARK | levels).items():
        assert f"--{name}: {colour};" in dark


def test_detections_in_mcap_have_their_sensors_colours(tmp_path):
    reader = pytest.importorskip("mcap.reader", reason="needs the extra mcap")
    (tmp_path / "run.mcap").write_bytes(mcap_bytes(crafted(tmp_path)))
    with open(tmp_path / "run.mcap", "rb") as stream:
        found = [
            json.loads(message.data)["entities"][0]
            for _, channel, message in reader.make_reader(stream).iter_messages()
            if channel.topic == "/detections"
        ]
    assert [entity["metadata"][0]["value"] for entity in found] == ["radar", "eo", "radar"]
    for entity, kind in zip(found, (RADAR, EO, RADAR), strict=True):
        colour = entity["spheres"][0]["color"]
        rgb = [round(255 * colour[part]) for part in "rgb"]
        assert rgb == [*bytes.fromhex(kind.colour[1:])]
