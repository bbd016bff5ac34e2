"""Runs in other programs' formats, read again by what reads such files."""

import io
import json
import math
import shutil
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

import dsa_des
from components.display.recorded_run import RecordedTables, tables_of
from components.export.alert_levels import alerts_of
from components.export.asterix_export import _estimated_track_records
from components.export.command import export
from components.export.flight_files import daa_text, xyz_text
from components.formats.daa_file import read_daa
from components.view.command import view
from docs.make.reference.__main__ import recorded_tables
from dsa_des.errors import UsageError
from tests.support.wired import chain
from tests.view.test_page import SCENE

NAME = "a<b&'c"


def call(*arguments):
    return CliRunner().invoke(export, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    scene = folder / "scene.toml"
    scene.write_text(SCENE.format(title="t", name=NAME.replace("'", "")))
    dsa_des.run(dsa_des.load_scene(scene), out=folder / "run")
    return folder / "run"


def flown(time_s):
    """The intruder as the scene has it, by pymap3d; a straight flight of some seconds."""
    north = -3500 + 90 * time_s * math.cos(math.radians(60))
    east = -2500 + 90 * time_s * math.sin(math.radians(60))
    return pymap3d.enu2geodetic(east, north, 400 + 0 * time_s, -41.3, 179.98, 2200)


def test_csv_has_every_table(run):
    assert call(run, "--to", "csv").exit_code == 0
    folder = run.with_name("run-csv")
    assert {p.stem for p in folder.iterdir()} == {p.stem for p in run.glob("*.parquet")}
    for path in run.glob("*.parquet"):
        table, text = pq.read_table(path), (folder / f"{path.stem}.csv").read_bytes()
        again = pa_csv.read_csv(io.BytesIO(text))
        assert again.column_names == table.column_names and again.num_rows == table.num_rows
        for name in ("time_s", "azimuth_rad", "lat_deg"):
            if name in table.column_names:
                assert again[name].to_pylist() == table[name].to_pylist()


def test_daa_is_read_again(run):
    assert call(run, "--to", "daa").exit_code == 0
    found = read_daa(run.with_name("run.daa"))
    own, other = found.ownship, found.intruders[0]
    time_s = np.array([0.5, 3.0, 4.5])  # rows are at whole seconds, up to 5
    state = other.at(time_s)
    lat, lon, alt = flown(time_s)
    assert state.lat_deg == pytest.approx(lat, abs=2e-6)
    assert (state.lon_deg - lon + 180) % 360 - 180 == pytest.approx(np.zeros(3), abs=3e-6)
    assert state.alt_m == pytest.approx(alt, abs=0.5)
    assert np.degrees(own.at(time_s).yaw_rad) % 360 == pytest.approx([217.0] * 3, abs=0.01)


def flights_of_xyz(path):
    """An .xyz file, read at the reference point that it says itself."""
    head = path.read_text().splitlines()[0]
    lat, lon, alt = (float(part.split()[1]) for part in head.partition(": ")[2].split(","))
    return read_daa(
        path, reference_lat_deg=lat, reference_lon_deg=lon, reference_alt_m=alt
    ).aircraft


@pytest.mark.parametrize("to", ["daa", "xyz"])
def test_flights_out_and_in_again_agree_within_their_digits(run, to, tmp_path):
    path = tmp_path / f"run.{to}"
    assert call(run, "--to", to, "--step-s", 0, "--out", path).exit_code == 0
    found = read_daa(path).aircraft if to == "daa" else flights_of_xyz(path)
    truth = pq.read_table(run / "truth.parquet").to_pylist()
    assert [craft.name for craft in found] == ["ownship", "a<b&c"]
    for craft, name in zip(found, (None, "a<b&c"), strict=True):
        rows = [row for row in truth if row["target"] == name]
        flown = {key: np.array([row[key] for row in rows]) for key in rows[0] if key != "target"}
        state = craft.at(flown["time_s"])
        assert state.lat_deg == pytest.approx(flown["lat_deg"], abs=2e-13)
        lon = (state.lon_deg - flown["lon_deg"] + 180) % 360 - 180
        assert lon == pytest.approx(0.0 * lon, abs=2e-13)
        assert state.alt_m == pytest.approx(flown["alt_m"], abs=1e-9)
        turned = (state.yaw_rad - flown["heading_rad"] + math.pi) % (2 * math.pi) - math.pi
        assert turned == pytest.approx(0.0 * turned, abs=1e-12)
        assert not craft.velocity_was_ignored


def turning(time_s):
    """A turn of 3 deg/s at 60 m/s that climbs with 4 m/s, by pymap3d: places and velocities."""
    angle = math.radians(3.0) * np.asarray(time_s) + math.radians(200.0)
    radius_m = 60.0 / math.radians(3.0)
    place = pymap3d.enu2geodetic(
        -radius_m * np.cos(angle), radius_m * np.sin(angle), 4.0 * np.asarray(time_s),
        -41.3, 179.99, 800.0,
    )  # fmt: skip
    return *place, 60.0 * np.cos(angle), 60.0 * np.sin(angle), angle


def test_rows_are_at_even_steps_of_a_turn_that_was_recorded_at_odd_times():
    """Half a second and less apart, with an aircraft that comes late and goes early."""
    random = np.random.default_rng(8)
    recorded_s = 0.17 + np.cumsum(random.uniform(0.05, 0.5, 40))
    truth = {"target": [], "time_s": [], "pitch_rad": [], "roll_rad": []}
    columns = ("lat_deg", "lon_deg", "alt_m", "velocity_north_m_s", "velocity_east_m_s",
               "heading_rad", "velocity_down_m_s")  # fmt: skip
    parts: dict = {name: [] for name in columns}
    for name, kept in ((None, recorded_s), ("late", recorded_s[7:23])):
        truth["target"] += [name] * len(kept)
        truth["time_s"] += kept.tolist()
        values = (*turning(kept), np.full(len(kept), -4.0))
        for column, value in zip(columns, values, strict=True):
            parts[column] += value.tolist()
    truth["pitch_rad"] = truth["roll_rad"] = [0.0] * len(truth["target"])
    run = RecordedTables(Path("run"), {"truth": pa.table(truth | parts)})
    for step_s, text in ((1.0, daa_text(run)), (0.4, daa_text(run, 0.4))):
        rows = [line.split(", ") for line in text.splitlines()[2:]]
        for name, kept in (("ownship", recorded_s), ("late", recorded_s[7:23])):
            found = np.array([row[1:] for row in rows if row[0] == name], dtype=float)
            lat, lon, alt, track, speed, climb, heading, time_s = found.T
            wanted = [k * step_s for k in range(100) if kept[0] <= k * step_s <= kept[-1]]
            assert time_s == pytest.approx(wanted, abs=1e-9)
            exact = turning(time_s)
            east, north, up = pymap3d.geodetic2enu(lat, lon, alt, -41.3, 179.99, 800.0)
            there = pymap3d.geodetic2enu(*exact[:3], -41.3, 179.99, 800.0)
            assert np.stack([east, north, up]) == pytest.approx(np.stack(there), abs=2e-3)
            ways = speed * np.exp(1j * np.radians(track))
            assert ways == pytest.approx(exact[3] + 1j * exact[4], abs=0.03)
            assert climb == pytest.approx(4.0)
            turned = np.exp(1j * (np.radians(heading) - exact[5]))
            assert turned == pytest.approx(1.0 + 0.0j, abs=1e-6)


def test_velocities_of_xyz_are_along_the_axes_of_its_reference_point(tmp_path):
    """Far from the point, where the aircraft's own axes have turned by some degrees."""
    run, truth, _ = crafted()
    truth["lon_deg"][1::2] += 5.0
    far = RecordedTables(run.folder, {"truth": pa.table(truth)})
    rows = [line.split(", ") for line in xyz_text(far, 0.0).splitlines()[3:]]
    for k, row in enumerate(rows):
        x, y, z = (float(cell) for cell in row[4:7])
        place = [truth[key][k] for key in ("lat_deg", "lon_deg")]
        ecef = pymap3d.enu2uvw(
            truth["velocity_east_m_s"][k], truth["velocity_north_m_s"][k],
            -truth["velocity_down_m_s"][k], *place,
        )  # fmt: skip
        origin = truth["lat_deg"][0], truth["lon_deg"][0]
        assert pymap3d.enu2uvw(x, y, z, *origin) == pytest.approx(ecef, abs=1e-9)
        assert float(row[3]) == truth["alt_m"][k]


def axes(row):
    """North, east and down of a place in Earth-centred axes, as columns, by pymap3d."""
    place = row["lat_deg"], row["lon_deg"]
    return np.array([pymap3d.enu2uvw(*v, *place) for v in np.eye(3)[[1, 0, 2]]]).T * [1, 1, -1]


def moved_axes(start, row):
    """What turns vectors north, east and down of a place into those of the start."""
    return axes(start).T @ axes(row)


def test_axes_far_from_the_start_are_those_of_the_start(tmp_path):
    """After 100 km at 60° N: velocities, errors and attitudes are turned by 1.5°, not by none."""
    reader = pytest.importorskip("mcap.reader", reason="needs the extra mcap")
    sides = {"east_m": 0.0, "north_m": 3000.0, "up_m": 0.0}
    level = {"heading_deg": 90.0, "speed_mps": 170.0}
    radar = {
        "type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 20.0, "errors": "stated",
        "quantised": False, "azimuth_error_deg": 0.2, "elevation_error_deg": 1.0,
        "range_error_m": 1.0,
    }  # fmt: skip
    scene = chain(
        {"radar": radar}, duration_s=600, targets=[{"name": "beside", **sides, **level}],
        ownship={"lat_deg": 60.0, "lon_deg": 10.0, "alt_m": 1000.0, **level},
        fusion={"type": "fusion.pass_through"}, record={"truth": True},
        tracker={"type": "tracking.ekf"},
    )  # fmt: skip
    dsa_des.run(scene, out=tmp_path / "far")
    truth = pq.read_table(tmp_path / "far" / "truth.parquet").to_pylist()
    own = [row for row in truth if row["target"] is None]
    assert call(tmp_path / "far", "--to", "mcap", "--out", tmp_path / "far.mcap").exit_code == 0
    with open(tmp_path / "far.mcap", "rb") as stream:
        poses = [
            json.loads(message.data)["pose"]["orientation"]
            for _, channel, message in reader.make_reader(stream).iter_messages()
            if channel.topic == "/aircraft/ownship/pose"
        ]
    nose = Rotation.from_quat([poses[-1][axis] for axis in "xyzw"]).apply([1.0, 0.0, 0.0])
    start, last = own[0], own[-1]
    along = np.array([last[f"velocity_{axis}_m_s"] for axis in ("north", "east", "down")])
    turned = moved_axes(start, last) @ along
    assert math.degrees(math.atan2(turned[0], turned[1])) == pytest.approx(0.0, abs=0.01)
    assert nose == pytest.approx(turned[[1, 0, 2]] * [1, 1, -1] / np.linalg.norm(turned), abs=1e-4)
    # Of an estimated track, as ASTERIX has it: north where it is, and errors along its axes.
    found = list(_estimated_track_records(tables_of(tmp_path / "far"), {"tracker": 1}))
    values = [one.values for one in found if not (one.values["tentative"] or one.values["last"])][
        -1
    ]
    course = math.degrees(math.atan2(values["velocity_east_m_s"], values["velocity_north_m_s"]))
    beside = [row for row in truth if row["target"] == "beside"][-1]
    wanted = math.degrees(math.atan2(beside["velocity_east_m_s"], beside["velocity_north_m_s"]))
    assert wanted - 90.0 > 1.4 and course == pytest.approx(wanted, abs=0.4)
    assert values["velocity_up_m_s"] == pytest.approx(0.0, abs=3.0)


def test_mcap_opens_in_its_own_reader(run, tmp_path):
    reader = pytest.importorskip("mcap.reader", reason="needs the extra mcap")
    path = tmp_path / "run.mcap"
    assert call(run, "--to", "mcap", "--out", path).exit_code == 0
    with open(path, "rb") as stream:
        found: dict = {}
        for schema, channel, message in reader.make_reader(stream).iter_messages():
            described = json.loads(schema.data)
            content = json.loads(message.data)
            assert schema.encoding == "jsonschema" and schema.name == described["title"]
            assert content.keys() <= described["properties"].keys()
            when = message.log_time / 1e9 - datetime(2000, 1, 1, tzinfo=UTC).timestamp()
            found.setdefault((channel.topic, schema.name), []).append((when, content))
    for name in ("detections", "truth", "scans"):
        table = pq.read_table(run / f"{name}.parquet").to_pylist()
        rows = [content for _, content in found[f"/tables/{name}", f"dsa_des.{name}"]]
        assert rows == [
            {key: None if value != value else value for key, value in row.items()} for row in table
        ]
    truth = [r for r in pq.read_table(run / "truth.parquet").to_pylist() if r["target"] == "a<b&c"]
    fixes = found["/aircraft/a<b&c/location", "foxglove.LocationFix"]
    assert [(f["latitude"], f["longitude"], f["altitude"]) for _, f in fixes] == [
        (r["lat_deg"], r["lon_deg"], r["alt_m"]) for r in truth
    ]
    assert [when for when, _ in fixes] == pytest.approx([r["time_s"] for r in truth], abs=1e-6)
    own = [r for r in pq.read_table(run / "truth.parquet").to_pylist() if r["target"] is None]
    for (_, pose), row in zip(
        found["/aircraft/ownship/pose", "foxglove.PoseInFrame"], own, strict=True
    ):
        turn = Rotation.from_quat([pose["pose"]["orientation"][axis] for axis in "xyzw"])
        angles = [row[f"{name}_rad"] for name in ("heading", "pitch", "roll")]
        # Axes forward, right and down in north, east and down, as the run has them.
        ned = Rotation.from_euler("ZYX", angles).as_matrix()
        flip = np.diag([1.0, -1.0, -1.0])
        enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ moved_axes(own[0], row) @ ned @ flip
        assert turn.as_matrix() == pytest.approx(enu, abs=1e-9)
    balls = found["/detections", "foxglove.SceneUpdate"]
    sphere = balls[0][1]["entities"][0]["spheres"][0]["pose"]["position"]
    first = pymap3d.geodetic2enu(truth[0]["lat_deg"], truth[0]["lon_deg"], truth[0]["alt_m"],
                                 own[0]["lat_deg"], own[0]["lon_deg"], own[0]["alt_m"])  # fmt: skip
    assert [sphere[axis] for axis in "xyz"] == pytest.approx(first, abs=300.0)
    assert len(balls) == 12


@pytest.mark.parametrize(("to", "module"), [("mcap", "mcap.writer"), ("asterix", "asterix.base")])
def test_a_missing_extra_is_named_and_nothing_written(run, to, module, tmp_path, monkeypatch):
    for name in (module, "asterix.generated"):
        monkeypatch.setitem(sys.modules, name, None)
    done = call(run, "--to", to, "--out", tmp_path / "o")
    assert done.exit_code == 2 and f"needs an extra: pip install 'dsa-des[{to}]'" in done.output
    assert list(tmp_path.iterdir()) == []


def test_matlab_has_numbers_and_texts(run):
    assert call(run, "--to", "mat").exit_code == 0
    found = loadmat(run.with_name("run.mat"), simplify_cells=True)
    table = pq.read_table(run / "detections.parquet")
    assert found["detections"]["azimuth_rad"] == pytest.approx(table["azimuth_rad"].to_numpy())
    assert found["detections"]["block"].tolist() == table["block"].to_pylist()
    assert np.isnan(found["detections"]["range_m"]).sum() == table["range_m"].null_count


def crafted():
    """Climbing, turning flights and banked detections at odd times, as Arrow tables."""
    random = np.random.default_rng(5)
    count, start = 6, 0.1234567
    time_s = np.repeat(start + 1.3 * np.arange(count), 2)
    truth = {
        "target": [None, "a"] * count, "time_s": time_s,
        "lat_deg": -33.9 + 0.01 * random.random(2 * count),
        "lon_deg": 18.4 + 0.01 * random.random(2 * count),
        "alt_m": 900.0 + 50.0 * random.random(2 * count),
        **{f"velocity_{axis}_m_s": random.normal(0.0, 40.0, 2 * count)
           for axis in ("north", "east", "down")},
        "heading_rad": random.uniform(-3.0, 6.0, 2 * count),
        "pitch_rad": np.zeros(2 * count), "roll_rad": np.zeros(2 * count),
    }  # fmt: skip
    detections = {
        "block": ["radar", "eo", "ir"], "target": ["a", None, "a"],
        "time_s": [0.25, 1.0004, 61.999],
        "azimuth_rad": [0.4, -1.0, 2.2], "elevation_rad": [0.1, -0.2, 0.3],
        "range_m": [1500.0, 2500.0, 800.0],
        "own_lat_deg": [-33.9] * 3, "own_lon_deg": [18.4] * 3, "own_alt_m": [950.0] * 3,
        "own_heading_rad": [math.radians(217.0)] * 3, "own_pitch_rad": [0.1, -0.1, 0.05],
        "own_roll_rad": [0.5, -0.4, 0.3],
    }  # fmt: skip
    tables = {"truth": pa.table(truth), "detections": pa.table(detections)}
    return RecordedTables(Path("run"), tables), truth, detections


def test_daa_holds_every_row_in_its_units():
    run, truth, _ = crafted()
    head, units, *rows = [line.split(", ") for line in daa_text(run, 0.0).splitlines()]
    assert dict(zip(head, units, strict=True)) == {
        "NAME": "[]", "lat": "[deg]", "lon": "[deg]", "alt": "[m]", "trk": "[deg]", "gs": "[m/s]",
        "vs": "[m/s]", "heading": "[deg]", "time": "[s]",
    }  # fmt: skip
    assert [row[0] for row in rows] == ["ownship", "a"] * 6
    for k, row in enumerate(rows):
        found = dict(zip(head[1:], map(float, row[1:]), strict=True))
        north, east = (truth[f"velocity_{axis}_m_s"][k] for axis in ("north", "east"))
        way = complex(north, east)
        assert abs(way) * complex(
            math.cos(math.radians(found["trk"])), math.sin(math.radians(found["trk"]))
        ) == pytest.approx(way)
        assert found["gs"] == pytest.approx(abs(way))
        assert found["vs"] == -truth["velocity_down_m_s"][k]
        assert found["heading"] == pytest.approx(math.degrees(truth["heading_rad"][k]) % 360.0)
        for name, column in (
            ("lat", "lat_deg"),
            ("lon", "lon_deg"),
            ("alt", "alt_m"),
            ("time", "time_s"),
        ):
            assert found[name] == truth[column][k]


@pytest.mark.parametrize(
    ("to", "table", "column", "value", "said"),
    [
        ("czml", "truth", "alt_m", math.nan, "truth.parquet: alt_m in row 0 is nan"),
        ("kml", "truth", "lat_deg", math.inf, "lat_deg in row 0 is inf"),
        ("daa", "truth", "time_s", "x", "time_s holds no numbers"),
        ("czml", "truth", "lon_deg", None, "there is no column 'lon_deg'"),
        ("kml", "scans", "own_roll_rad", None, "there is no column 'own_roll_rad'"),
        ("kml", "detections", "time_s", 1e300, "detections.parquet: time_s in row 0 is 1e+300"),
        ("view", "truth", "lat_deg", None, "truth.parquet: there is no column 'lat_deg'"),
        ("view", "detections", "azimuth_rad", "x", "azimuth_rad holds no numbers"),
        ("view", "scans", "detected", "x", "scans.parquet: detected holds no numbers"),
        ("view", "scans", "block", 1.5, "block holds something else than text"),
    ],
)
def test_damaged_run_folders_are_said(run, tmp_path, to, table, column, value, said):
    folder = tmp_path / "damaged"
    shutil.copytree(run, folder)
    found = pq.read_table(folder / f"{table}.parquet")
    place = found.column_names.index(column)
    rest = found.drop_columns([column])
    if value is not None:
        values = (
            [value, *found[column].to_pylist()[1:]]
            if isinstance(value, float) and column != "block"
            else [value] * len(found)
        )
        rest = rest.add_column(place, column, pa.array(values))
    pq.write_table(rest, folder / f"{table}.parquet")
    command, words = (view, []) if to == "view" else (export, ["--to", to])
    done = CliRunner().invoke(command, [str(folder), *words, "--out", str(tmp_path / "o.html")])
    assert done.exit_code == 2 and said in done.output and not (tmp_path / "o.html").exists()


def test_alerts_of_another_program_are_said():
    rows = {"time_s": [0.0], "block": ["alerting"], "target": ["a"], "level": ["x"]}
    with pytest.raises(UsageError, match=r"run: alerts\.parquet: level holds no numbers"):
        alerts_of(RecordedTables(Path("run"), {"alerts": pa.table(rows)}))


@pytest.mark.parametrize("name", ["", "_x", "1x", "x y", "x" * 64])
def test_names_that_matlab_cannot_have_are_said(run, tmp_path, name):
    folder = tmp_path / "named"
    shutil.copytree(run, folder)
    found = pq.read_table(folder / "scans.parquet")
    pq.write_table(found.append_column(name, found["scan"]), folder / "scans.parquet")
    words = [str(folder), "--to", "mat", "--out", str(tmp_path / "o.mat")]
    done = CliRunner().invoke(export, words)
    assert done.exit_code == 2 and f"scans.parquet: {name!r} cannot be the name" in done.output


@pytest.mark.parametrize("to", ["csv", "kml", "czml", "daa", "xyz", "asterix", "mcap", "mat"])
def test_the_same_run_gives_the_same_bytes(run, to, tmp_path):
    if to in ("asterix", "mcap"):
        pytest.importorskip(to, reason=f"needs the extra {to}")
    for name in ("one", "two"):
        assert call(run, "--to", to, "--out", tmp_path / name).exit_code == 0
    one, two = tmp_path / "one", tmp_path / "two"
    if to == "csv":
        names = [p.name for p in one.iterdir()]
        assert [(one / n).read_bytes() for n in names] == [(two / n).read_bytes() for n in names]
    else:
        assert one.read_bytes() == two.read_bytes()


def test_what_cannot_be_exported_is_refused(run, tmp_path):
    done = call(tmp_path / "nothing", "--to", "csv")
    assert done.exit_code == 2 and "there is no such folder" in done.output
    done = call(tmp_path, "--to", "csv")
    assert done.exit_code == 2 and "holds no run" in done.output
    done = call(run, "--to", "xml")
    assert (
        done.exit_code == 2
        and "'csv', 'kml', 'czml', 'daa', 'xyz', 'asterix', 'mcap', 'mat'" in done.output
    )
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in ("run.json", "scans.parquet"):
        (bare / name).write_bytes((run / name).read_bytes())
    done = call(bare, "--to", "kml")
    assert done.exit_code == 2 and "truth" in done.output
    assert [p.name for p in tmp_path.iterdir()] == ["bare"]


def test_columns_name_their_units():
    """CSV and MATLAB have nothing else to say them with."""
    endings = {
        "dB": "_db", "deg": "_deg", "m": "_m", "m/s": ("_m_s", "_mps"),
        "m/s²": ("_m_s2", "_mps2"), "m²": "_m2", "m²/s": "_m2_s", "m²/s²": "_m2_s2",
        "pixels": ("_px", "pixels"), "rad": "_rad", "rad/s": "_rad_s", "rad²": "_rad2", "s": "_s",
    }  # fmt: skip
    # Counts, and what a sensor is as sure by as its own kind has it.
    without = {"", "messages", "targets", "dB or signature"}
    for table, columns in recorded_tables().items():
        for name, column in columns.items():
            assert column.unit in without or name.endswith(endings[column.unit]), (table, name)
