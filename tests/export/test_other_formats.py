"""Runs in other programs' formats, read again by what reads such files."""

import io
import json
import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner
from scipy.io import loadmat

import dsa_des
from components.export.command import export
from components.traffic.daa_file import read_daa
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
    time_s = np.array([0.5, 3.0, 5.5])
    state = other.at(time_s)
    lat, lon, alt = flown(time_s)
    assert state.lat_deg == pytest.approx(lat, abs=2e-6)
    assert (state.lon_deg - lon + 180) % 360 - 180 == pytest.approx(np.zeros(3), abs=3e-6)
    assert state.alt_m == pytest.approx(alt, abs=0.5)
    assert np.degrees(own.at(time_s).yaw_rad) % 360 == pytest.approx([217.0] * 3, abs=0.01)


def test_matlab_has_numbers_and_texts(run):
    assert call(run, "--to", "mat").exit_code == 0
    found = loadmat(run.with_name("run.mat"), simplify_cells=True)
    table = pq.read_table(run / "detections.parquet")
    assert found["detections"]["azimuth_rad"] == pytest.approx(table["azimuth_rad"].to_numpy())
    assert found["detections"]["block"].tolist() == table["block"].to_pylist()
    assert np.isnan(found["detections"]["range_m"]).sum() == table["range_m"].null_count


def test_kml_is_well_formed_and_in_place(run):
    assert call(run, "--to", "kml").exit_code == 0
    space = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}
    root = ElementTree.parse(run.with_name("run.kml")).getroot()
    tracks = root.findall(".//gx:Track/..", space)
    assert [t.findtext("k:name", namespaces=space) for t in tracks] == ["ownship", "a<b&c"]
    coordinates = [c.text.split() for c in tracks[1].findall(".//gx:coord", space)]
    lat, lon, alt = flown(np.array([0.0]))
    assert [float(x) for x in coordinates[0]] == pytest.approx([lon[0], lat[0], alt[0]], abs=1e-3)
    points = root.findall(".//k:Point/k:coordinates", space)
    assert len(points) == 12
    for point in points:
        east, north, _ = pymap3d.geodetic2enu(
            *[float(x) for x in np.array(point.text.split(","))[[1, 0, 2]]], -41.3, 179.98, 2200
        )
        assert math.hypot(east + 2500, north + 3500) < 700  # along 6 s of its flight


def test_czml_has_the_same_places(run):
    assert call(run, "--to", "czml").exit_code == 0
    packets = json.loads(run.with_name("run.czml").read_text(encoding="utf-8"))
    assert packets[0]["id"] == "document" and packets[0]["version"] == "1.0"
    (other,) = (p for p in packets if p["id"] == "aircraft/a<b&c")
    samples = np.array(other["position"]["cartographicDegrees"]).reshape(-1, 4)
    lat, _, alt = flown(samples[:, 0])
    assert samples[:, 2] == pytest.approx(lat, abs=3e-6)
    assert samples[:, 3] == pytest.approx(alt, abs=0.5)
    assert sum(p["id"].startswith("detection/") for p in packets) == 12


@pytest.mark.parametrize("to", ["csv", "kml", "czml", "daa", "mat"])
def test_the_same_run_gives_the_same_bytes(run, to, tmp_path):
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
    assert done.exit_code == 2 and "'csv', 'kml', 'czml', 'daa', 'mat'" in done.output
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in ("run.json", "scans.parquet"):
        (bare / name).write_bytes((run / name).read_bytes())
    done = call(bare, "--to", "kml")
    assert done.exit_code == 2 and "truth" in done.output
    assert [p.name for p in tmp_path.iterdir()] == ["bare"]
