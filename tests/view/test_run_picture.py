"""The page's columns, against tables written by hand, plain rotations and pymap3d."""

import json
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pymap3d
import pytest

from components.display.symbols import block_marks
from components.messages.alerts import BAND_REGIONS
from components.sensor import palette
from components.view.run_picture import encounter_picture, run_picture

SCENE = """
title = "By hand"
description = "said"
[blocks.radar]
type = "radar.swerling"
scan_rate_hz = 2
rate_error_ppm = 250000
beam_sweep = true
azimuth_deg = [-70, 40]
mount_azimuth_deg = 10
range_km = 7.5
[blocks.eo]
type = "optical.eo"
azimuth_deg = [-20, 20]
scan_rate_hz = 5
beam_sweep = false
"""
#: Across the date line in the south; the ownship is banked, pitched, and turns through north.
OWN = {
    "time_s": [0.0, 1.0, 2.0],
    "lat_deg": [-41.3, -41.3006, -41.3012],
    "lon_deg": [179.9999, -179.9999, -179.9997],
    "alt_m": [2200.0, 2210.0, 2220.0],
    "heading_rad": [6.2, 0.1, 0.4],
    "pitch_rad": [0.1, 0.12, 0.05],
    "roll_rad": [-0.35, 0.3, 0.6],
}
PLANE = OWN["lat_deg"][0], OWN["lon_deg"][0], 0.0
SIGHTS = {  # azimuth, elevation, range, of the ownship at each time
    "azimuth_rad": [0.3, -1.1, 2.5],
    "elevation_rad": [0.15, -0.2, 0.05],
    "range_m": [2500.0, math.nan, 900.0],
}
POSE = {f"own_{name}": values for name, values in OWN.items() if name != "time_s"}


def spaced(name, values):
    """A column; None in a text is nobody."""
    return pa.array(values, pa.dictionary(pa.int32(), pa.string())) if name in (
        "target", "block", "region", "track_status") else pa.array(values)  # fmt: skip


def picture_of(folder, tables, scene=SCENE):
    (folder / "scene.toml").write_text(scene)
    info = {"seed": 7, "duration_s": 3.5, "scene_sha256": "0123456789abcdef", "versions": {
        "dsa_des": "9.9"}}  # fmt: skip
    (folder / "run.json").write_text(json.dumps(info))
    for table, columns in tables.items():
        arrays = {name: spaced(name, values) for name, values in columns.items()}
        pq.write_table(pa.table(arrays), folder / f"{table}.parquet")
    return run_picture(folder)


TRUTH_ROWS = [(None, k) for k in (2, 0, 1)] + [("b", 1), ("a", 0), ("b", 0), ("a", 2)]
OFFSET = {None: 0.0, "a": 0.01, "b": -0.02}
TABLES = {
    "scans": {"block": ["radar", "eo", "radar"], "time_s": [0.0, 0.5, 1.0], "detected": [1, 0, 2]},
    "detections": {
        "block": ["radar", "eo", "radar"], "target": ["b", "a", None], "time_s": OWN["time_s"],
        "scan": [0, 4, 2], **SIGHTS, **POSE,
    },
    "truth": {
        "target": [name for name, _ in TRUTH_ROWS],
        **{name: [values[k] + (OFFSET[who] if name == "lat_deg" else 0.0) for who, k in TRUTH_ROWS]
           for name, values in OWN.items()},
    },
    "fused": {"target": ["b", None, "a"], "time_s": [-0.5, 1.5, 2.0], **SIGHTS},
    "tracks": {"target": ["a", "b", "a"], "time_s": OWN["time_s"], "age_s": [0.1, 0.2, 0.3],
               **SIGHTS},
    "alerts": {"target": ["b", "a"], "time_s": [1.0, 2.0], "level": [2, 3],
               "time_to_level_1_s": [5.0, 6.0], "time_to_level_3_s": [7.0, 8.0]},
    "manoeuvres": {"time_s": [1.25], "turn_rad": [-0.5], "climb_m": [100.0], "other": [1]},
    "bands": {"region": [BAND_REGIONS[1], BAND_REGIONS[0]], "time_s": [1.0, 1.0],
              "low_rad": [0.1, 0.2], "high_rad": [0.3, 0.4], "low_m": [10.0, 20.0],
              "high_m": [30.0, 40.0]},
}  # fmt: skip


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    return picture_of(tmp_path_factory.mktemp("hand"), TABLES)


def turned(azimuth, elevation, heading, pitch, roll):
    """North, east, up of a line of sight in the body: three rotations, one after another."""
    ahead, right, below = (
        math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth),
        -math.sin(elevation),
    )  # fmt: skip
    right, below = (right * math.cos(roll) - below * math.sin(roll),
                    right * math.sin(roll) + below * math.cos(roll))  # fmt: skip
    ahead, below = (ahead * math.cos(pitch) + below * math.sin(pitch),
                    below * math.cos(pitch) - ahead * math.sin(pitch))  # fmt: skip
    north = ahead * math.cos(heading) - right * math.sin(heading)
    east = ahead * math.sin(heading) + right * math.cos(heading)
    return north, east, -below


def expected(row, own_row):
    """From where a line of sight goes, its bearing, and its end in the plane."""
    here = [OWN[name][own_row] for name in ("lat_deg", "lon_deg", "alt_m")]
    pose = [OWN[name][own_row] for name in ("heading_rad", "pitch_rad", "roll_rad")]
    north, east, up = turned(SIGHTS["azimuth_rad"][row], SIGHTS["elevation_rad"][row], *pose)
    range_m = SIGHTS["range_m"][row]
    start = pymap3d.geodetic2enu(*here, *PLANE)[:2]
    bearing = math.atan2(east, north)
    if math.isnan(range_m):
        return (*start, bearing, math.nan, math.nan, math.nan)
    end = pymap3d.enu2geodetic(east * range_m, north * range_m, up * range_m, *here)
    return (*start, bearing, *pymap3d.geodetic2enu(*end, *PLANE)[:2], end[2])


COLUMNS = ("from_east_m", "from_north_m", "bearing_rad", "east_m", "north_m", "alt_m")


@pytest.mark.parametrize(
    ("table", "rows_of_own"),
    [("detections", (0, 1, 2)), ("fused", (None, 1, 2)), ("tracks", (0, 1, 2))],
)
def test_lines_of_sight_go_from_the_ownship_where_they_were_measured(picture, table, rows_of_own):
    found = picture.tables[table]
    wanted = np.array([
        [math.nan] * 6 if own is None else expected(row, own) for row, own in enumerate(rows_of_own)
    ])  # fmt: skip
    for name, column in zip(COLUMNS, wanted.T, strict=True):
        np.testing.assert_allclose(found[name], column, atol=2e-3, err_msg=name)
    np.testing.assert_array_equal(found["range_m"], SIGHTS["range_m"])
    np.testing.assert_array_equal(found["elevation_rad"], SIGHTS["elevation_rad"])
    assert found["time_s"].tolist() == TABLES[table]["time_s"]
    names = {"a": 0, "b": 1, None: -1}
    assert found["target"].tolist() == [names[name] for name in TABLES[table]["target"]]
    assert list(found.get("age_s", [])) == TABLES[table].get("age_s", [])


def test_flights_are_in_order_of_time_and_in_one_plane(picture):
    own = picture.tables["own"]
    assert own["time_s"].tolist() == OWN["time_s"] and own["alt_m"].tolist() == OWN["alt_m"]
    places = [pymap3d.geodetic2enu(*(OWN[n][k] for n in ("lat_deg", "lon_deg", "alt_m")), *PLANE)
              for k in range(3)]  # fmt: skip
    np.testing.assert_allclose(own["east_m"], [p[0] for p in places], atol=2e-3)
    np.testing.assert_allclose(own["north_m"], [p[1] for p in places], atol=2e-3)
    # The heading goes on through north.
    assert own["heading_rad"] == pytest.approx([6.2, 0.1 + 2 * math.pi, 0.4 + 2 * math.pi])
    truth = picture.tables["truth"]
    rows = [("a", 0), ("a", 2), ("b", 0), ("b", 1)]
    assert truth["target"].tolist() == [0, 0, 1, 1]
    for place, (who, k) in enumerate(rows):
        lat = OWN["lat_deg"][k] + OFFSET[who]
        at = pymap3d.geodetic2enu(lat, OWN["lon_deg"][k], OWN["alt_m"][k], *PLANE)
        got = [truth[name][place] for name in ("time_s", "east_m", "north_m", "alt_m")]
        assert got == pytest.approx([OWN["time_s"][k], *at[:2], OWN["alt_m"][k]], abs=2e-3)


def test_tables_and_what_is_said_of_the_run_go_through(picture):
    assert picture.title == "By hand" and picture.duration_s == 3.5 and picture.start_s == 0.0
    assert picture.targets == ["a", "b"]
    assert picture.facts == {
        "seed": 7, "scene": "0123456789ab", "version": "9.9", "description": "said"
    }  # fmt: skip
    scans, alerts = picture.tables["scans"], picture.tables["alerts"]
    assert scans["sensor"].tolist() == [1, 0, 1] and scans["detected"].tolist() == [1, 0, 2]
    assert picture.tables["detections"]["sensor"].tolist() == [1, 0, 1]
    assert picture.tables["detections"]["scan"].tolist() == [0, 4, 2]
    assert alerts["target"].tolist() == [1, 0] and alerts["level"].tolist() == [2, 3]
    assert {n: v.tolist() for n, v in alerts.items() if n.startswith("time_to")} == {
        "time_to_level_1_s": [5.0, 6.0], "time_to_level_3_s": [7.0, 8.0]
    }  # fmt: skip
    assert {n: v.tolist() for n, v in picture.tables["manoeuvres"].items()} == {
        "time_s": [1.25], "turn_rad": [-0.5], "climb_m": [100.0]
    }  # fmt: skip
    bands = picture.tables["bands"]
    assert bands["region"].tolist() == [1, 0]
    for name in ("time_s", "low_rad", "high_rad", "low_m", "high_m"):
        # Directions are turned from the north of where the ownship was into the plane's.
        assert bands[name].tolist() == pytest.approx(TABLES["bands"][name], abs=1e-4)


def test_fields_of_view_are_round_the_nose_and_a_sweep_takes_a_scan(picture):
    eo, radar = picture.sensors
    assert (eo["name"], eo["azimuth_deg"], "sweep_s" in eo, "range_m" in eo) == (
        "eo", [-20.0, 20.0], False, False
    )  # fmt: skip
    assert radar["azimuth_deg"] == [-60.0, 50.0] and radar["range_m"] == 7500.0
    assert radar["sweep_s"] == pytest.approx(1 / (2 * 1.25))


def test_where_the_truth_is_not_told_the_ownship_believes(tmp_path):
    tables = {name: TABLES[name] for name in ("scans", "detections")}
    tables["detections"] = {
        name: [values[k] for k in (1, 2, 0, 1)] for name, values in tables["detections"].items()
    }
    found = picture_of(tmp_path, tables, scene="")
    assert found.title == tmp_path.name and found.facts["version"] == "9.9"
    assert found.tables["own"]["time_s"].tolist() == OWN["time_s"]
    assert found.tables["own"]["alt_m"].tolist() == OWN["alt_m"]
    assert found.targets == ["a", "b"] and "truth" not in found.tables


def test_where_the_truth_is_told_what_the_ownship_believes_is_not_drawn(tmp_path):
    believed = TABLES["detections"] | {"own_alt_m": [alt + 30.0 for alt in OWN["alt_m"]]}
    found = picture_of(tmp_path, TABLES | {"detections": believed})
    assert found.tables["own"]["alt_m"].tolist() == OWN["alt_m"]


def test_states_of_tracks_are_brought_into_the_plane(tmp_path):
    origin = {"origin_lat_deg": -41.28, "origin_lon_deg": 179.99, "origin_alt_m": 2000.0}
    state = {
        "north_m": [300.0, 500.0, math.nan, 800.0], "east_m": [-700.0, 900.0, math.nan, 10.0],
        "down_m": [-50.0, 60.0, math.nan, 5.0], "north_m_s": [1.0, 2.0, 3.0, 4.0],
        "east_m_s": [5.0, 6.0, 7.0, 8.0], "covariance_00_m2": [11.0, 12.0, 13.0, 14.0],
        "covariance_01_m2": [1.5, -2.5, 3.5, 4.5], "covariance_11_m2": [21.0, 22.0, 23.0, 24.0],
        "azimuth_rad": [0.1, 0.2, 0.3, 0.4],
    }  # fmt: skip
    told = {
        **state, "track": [5, 6, 7, 8], "time_s": [0.0, 1.5, 2.0, 2.0],
        "track_status": ["confirmed", "tentative", "coasted", "deleted"],
        **{name: [value] * 4 for name, value in origin.items()},
    }  # fmt: skip
    wanted = {name: TABLES[name] for name in ("scans", "detections", "truth")}
    found = picture_of(tmp_path, {**wanted, "state_tracks": told}).tables["tracks"]
    assert found["number"].tolist() == [5, 6, 7]
    assert found["tentative"].tolist() == [False, True, False]
    for mine, theirs in (
        ("east_mps", "east_m_s"), ("north_mps", "north_m_s"), ("bearing_rad", "azimuth_rad"),
        ("variance_north_m2", "covariance_00_m2"), ("variance_east_m2", "covariance_11_m2"),
        ("covariance_m2", "covariance_01_m2"),
    ):  # fmt: skip
        # Its frame begins 1 km beside the plane: north there is turned by 0.4 minutes of arc.
        assert found[mine].tolist() == pytest.approx(state[theirs][:3], abs=5e-3)
    for row in (0, 1):
        place = [state[name][row] for name in ("east_m", "north_m", "down_m")]
        at = pymap3d.enu2geodetic(place[0], place[1], -place[2], *origin.values())
        east, north, _ = pymap3d.geodetic2enu(*at, *PLANE)
        got = [found[name][row] for name in ("east_m", "north_m", "alt_m")]
        assert got == pytest.approx([east, north, at[2]], abs=2e-3)
    assert np.isnan([found[name][2] for name in ("east_m", "north_m", "alt_m")]).all()
    for row, own in enumerate((0, 1, 2)):
        here = [OWN[name][own] for name in ("lat_deg", "lon_deg", "alt_m")]
        start = pymap3d.geodetic2enu(*here, *PLANE)
        assert found["from_east_m"][row] == pytest.approx(start[0], abs=2e-3)
        assert found["from_north_m"][row] == pytest.approx(start[1], abs=2e-3)


def test_far_from_the_start_north_is_another_direction(tmp_path):
    """A track's frame two degrees east of the plane: what moves north there moves aside here."""
    origin = {"origin_lat_deg": -41.3, "origin_lon_deg": -178.02, "origin_alt_m": 2000.0}
    state = {
        "north_m": [0.0], "east_m": [0.0], "down_m": [0.0], "north_m_s": [60.0], "east_m_s": [0.0],
        "covariance_00_m2": [400.0], "covariance_01_m2": [0.0], "covariance_11_m2": [100.0],
        "azimuth_rad": [0.0],
    }  # fmt: skip
    told = {**state, "track": [1], "time_s": [2.0], "track_status": ["confirmed"],
            **{name: [value] for name, value in origin.items()}}  # fmt: skip
    wanted = {name: TABLES[name] for name in ("scans", "detections", "truth")}
    found = picture_of(tmp_path, {**wanted, "state_tracks": told}).tables["tracks"]
    here = tuple(origin.values())
    start = pymap3d.geodetic2enu(*here, *PLANE)
    end = pymap3d.geodetic2enu(*pymap3d.enu2geodetic(0.0, 60.0, 0.0, *here), *PLANE)
    east, north = (float(b - a) for a, b in zip(start[:2], end[:2], strict=True))
    assert math.degrees(math.atan2(east, north)) == pytest.approx(1.32, abs=0.1)
    assert found["east_mps"][0] == pytest.approx(east, abs=0.05)
    assert found["north_mps"][0] == pytest.approx(north, abs=0.05)
    assert found["bearing_rad"][0] == pytest.approx(math.atan2(east, north), abs=1e-3)
    along = np.array([east, north]) / math.hypot(east, north)
    spread = np.array([
        [found["variance_east_m2"][0], found["covariance_m2"][0]],
        [found["covariance_m2"][0], found["variance_north_m2"][0]],
    ])  # fmt: skip
    assert along @ spread @ along == pytest.approx(400.0, abs=0.5)


def test_a_recorded_encounter_is_in_its_own_plane_and_time(tmp_path):
    lines = [
        "NAME, lat, lon, alt, vx, vy, vz, time",
        "[], [deg], [deg], [m], [m/s], [m/s], [m/s], [s]",
    ]
    for t in range(3):
        lines.append(
            f"own, {-41.3 - 5e-4 * t}, 174.2, {900 + t}, {0.3 * (t - 1)}, -50, 0, {100 + t}"
        )
        lines.append(f"one, -41.2, {174.2 + 1e-3 * t}, 1000, 80, 1, 0, {100 + t}")
        lines.append(f"two, -41.4, {174.1 - 1e-3 * t}, 1100, -80, 1, 0, {100 + t}")
    (tmp_path / "three.daa").write_text("\n".join(lines) + "\n")
    found = encounter_picture(tmp_path / "three.daa")
    assert (found.title, found.facts) == ("three.daa", {"ownship": "own"})
    assert (found.duration_s, found.start_s, found.targets) == (2.0, 100.0, ["one", "two"])
    own, truth = found.tables["own"], found.tables["truth"]
    # From 180.3 deg through south to 179.7, without a jump.
    assert own["heading_rad"] % (2 * math.pi) == pytest.approx(
        [math.atan2(0.3 * (t - 1), -50) % (2 * math.pi) for t in range(3)]
    )
    assert np.abs(np.diff(own["heading_rad"])).max() < 0.1
    assert own["time_s"].tolist() == [0.0, 1.0, 2.0] and own["alt_m"].tolist() == [900, 901, 902]
    assert truth["target"].tolist() == [0, 0, 0, 1, 1, 1]
    assert truth["time_s"].tolist() == [0.0, 1.0, 2.0] * 2
    for row, (lat, lon, alt) in enumerate(
        [(-41.2, 174.2 + 1e-3 * t, 1000) for t in range(3)]
        + [(-41.4, 174.1 - 1e-3 * t, 1100) for t in range(3)]
    ):
        east, north, _ = pymap3d.geodetic2enu(lat, lon, alt, -41.3, 174.2, 0.0)
        assert truth["east_m"][row] == pytest.approx(east, abs=2e-3)
        assert truth["north_m"][row] == pytest.approx(north, abs=2e-3)
        assert truth["alt_m"][row] == alt


def test_shades_of_a_kind_are_mixed_with_white_and_black():
    names = {f"r{k}": "radar.x" for k in range(4)}
    found = [block_marks(names)[name].colour for name in sorted(names)]
    base = [int(palette.RADAR.colour[i : i + 2], 16) for i in (1, 3, 5)]
    linear = [((c / 255 + 0.055) / 1.055) ** 2.4 if c / 255 > 0.04045 else c / 255 / 12.92
              for c in base]  # fmt: skip
    light = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] >= 0.25
    first, second = (0, 255) if light else (255, 0)
    mixed = [
        "#" + "".join(f"{round(c + share * (end - c)):02X}" for c in base)
        for share, end in ((0.0, 0), (0.4, first), (0.35, second), (0.0, 0))
    ]
    assert found == mixed
