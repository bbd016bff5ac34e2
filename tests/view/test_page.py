"""The page of a run: what it holds, where things are in it, and that nothing gets out or in."""

import base64
import hashlib
import itertools
import json
import math
import re
import struct
from html import unescape

import numpy as np
import pymap3d
import pytest
from click.testing import CliRunner

import dsa_des
from components.display.symbols import block_marks
from components.sensor import palette
from components.view.command import view

HOSTILE = '</script><script>alert(1)</script>{{script}} & "q"'
SCENE = """
title = '''{title}'''
duration_s = 6
seed = 4
wires = ["traffic -> transform -> radar -> fusion -> tracker", "transform -> eo -> fusion"]
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 2
range_km = 15
mount_azimuth_deg = 10
[blocks.eo]
type = "optical.range_boundary"
scan_rate_hz = 4
offset_s = 0.1
range_km = 12
[blocks.fusion]
type = "fusion.pick_best"
[blocks.tracker]
type = "tracking.stub"
[blocks.traffic]
type = "traffic.scripted"
[blocks.traffic.ownship]
lat_deg = -41.3
lon_deg = 179.98
alt_m = 2200
heading_deg = 217
speed_mps = 70
roll_deg = -20
pitch_deg = 6
[[blocks.traffic.intruders]]
name = '''{name}'''
east_m = -2500
north_m = -3500
up_m = 400
heading_deg = 60
speed_mps = 90
"""


def call(*arguments):
    return CliRunner().invoke(view, [str(a) for a in arguments], catch_exceptions=False)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view")
    scene = folder / "scene.toml"
    scene.write_text(SCENE.format(title=HOSTILE, name=HOSTILE))
    dsa_des.run(dsa_des.load_scene(scene), out=folder / "run")
    done = call(folder / "run")
    assert done.exit_code == 0, done.output
    return folder / "run", (folder / "run.html").read_text(encoding="utf-8")


def data_of(page):
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    found = json.loads(text)
    for table in found["tables"].values():
        for name, packed in table.items():
            code = {"i4": "i", "f4": "f", "f8": "d"}[packed["kind"]]
            content = base64.b64decode(packed["data"])
            size = struct.calcsize(code)
            table[name] = np.array(struct.unpack(f"<{len(content) // size}{code}", content))
    return found


def test_detections_lie_where_the_target_was(run):
    """By pymap3d: the scan's grid is 0.5 deg and 75 m at most, 4 km away."""
    data = data_of(run[1])
    assert data["targets"] == [HOSTILE]
    assert [sensor["name"] for sensor in data["sensors"]] == ["eo", "radar"]
    seen = data["tables"]["detections"]
    radar = seen["sensor"] == 1
    assert radar.sum() == 12 and np.isnan(seen["east_m"][~radar]).all()
    own = pymap3d.geodetic2enu(-41.3, 179.98, 2200, -41.3, 179.98, 0)
    assert own[:2] == pytest.approx((0, 0), abs=1e-6)
    time_s = seen["time_s"]
    heading, other = math.radians(217), math.radians(60)
    east = -2500 + 90 * time_s * math.sin(other)
    north = -3500 + 90 * time_s * math.cos(other)
    # Tangent planes at the start and at sea level below it differ by the height over the radius.
    assert np.abs(seen["east_m"] - east)[radar].max() < 100
    assert np.abs(seen["north_m"] - north)[radar].max() < 100
    assert np.abs(seen["alt_m"] - 2600)[radar].max() < 100
    own_east, own_north = 70 * time_s * math.sin(heading), 70 * time_s * math.cos(heading)
    bearing = np.arctan2(east - own_east, north - own_north)
    assert np.abs(seen["bearing_rad"] - bearing).max() < math.radians(1.2)
    assert seen["from_east_m"] == pytest.approx(own_east, abs=1)


def test_scans_fields_of_view_and_tracks_are_there(run):
    data = data_of(run[1])
    tables = data["tables"]
    assert np.bincount(tables["scans"]["sensor"]).tolist() == [24, 12]
    assert tables["scans"]["detected"].sum() == len(tables["detections"]["time_s"])
    radar = data["sensors"][1]
    assert radar["range_m"] == 15000 and radar["colour"] == "#D55E00"
    assert len(radar["azimuth_deg"]) == 2 and sum(radar["azimuth_deg"]) == pytest.approx(20)
    assert (tables["tracks"]["target"] == 0).all()


def test_sensors_of_one_kind_differ_in_marker_and_shade():
    """The lines and scans of a sensor have no marker; three shades of a colour are told apart."""
    types = {f"radar{k}": "radar.swerling" for k in range(3)}
    types |= {"eo0": "optical.eo", "eo1": "optical.projection", "my": "a:B",
              "ir0": "optical.ir", "ir1": "optical.ir"}  # fmt: skip
    found = block_marks(types)
    assert [found[name].colour for name in ("radar0", "eo0", "ir0")] == [
        palette.RADAR.colour, palette.EO.colour, palette.IR.colour
    ]  # fmt: skip
    assert found["ir0"].marker == palette.IR.marker
    for kind in (("radar0", "radar1", "radar2"), ("eo0", "eo1"), ("ir0", "ir1")):
        assert len({found[name].marker for name in kind}) == len(kind)
        levels = sorted(luminance(found[name].colour) for name in kind)
        assert all((b + 0.05) / (a + 0.05) > 1.6 for a, b in itertools.pairwise(levels))
    # All stand out from both grounds.
    for mark in found.values():
        assert 0.05 < luminance(mark.colour) < 0.45, mark


def luminance(colour):
    """Relative luminance of sRGB, by WCAG 2.2."""
    parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(parts > 0.04045, ((parts + 0.055) / 1.055) ** 2.4, parts / 12.92)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def test_text_of_the_run_carries_no_markup(run):
    page = run[1]
    assert page.count("<script") == 2 and "alert(1)" in page
    assert "<script>alert" not in page
    assert "&lt;/script&gt;&lt;script&gt;alert(1)" in page  # the title, escaped


def test_only_the_program_inside_may_run_and_nothing_is_fetched(run):
    page = run[1]
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)
    (script,) = re.findall(r"<script>(.*)</script>", page, re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy.startswith("default-src &#x27;none&#x27;") and f"sha256-{digest}" in policy
    assert not re.search(r"https?://|src=|@import|url\(|fetch\(|XMLHttp|WebSocket", page)


def test_pages_beside_each_other_run_their_two_programs_and_nothing_else(run, tmp_path):
    """Frames take the policy of the page that they stand in, beside their own."""
    assert call(run[0], run[0], "--out", tmp_path / "two.html").exit_code == 0
    page = (tmp_path / "two.html").read_text(encoding="utf-8")
    frames = [unescape(text) for text in re.findall(r'srcdoc="([^"]*)"', page)]
    assert len(frames) == 2
    for frame in frames:
        assert "<script>alert" not in frame and data_of(frame)["targets"] == [HOSTILE]
    outer = re.sub(r'srcdoc="[^"]*"', "", page)
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', outer)
    programs = [
        re.findall(r"<script>(.*?)</script>", text, re.S)[-1] for text in (outer, frames[0])
    ]
    allowed = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
               for text in programs]  # fmt: skip
    assert policy.startswith("default-src &#x27;none&#x27;")
    assert re.findall(r"sha256-([^&]*)&", policy) == allowed
    assert "<script>alert" not in outer and outer.count("<script") == 1


def test_the_same_run_gives_the_same_page(run, tmp_path):
    assert call(run[0], "--out", tmp_path / "again.html").exit_code == 0
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == run[1]


def test_a_recorded_encounter_has_flights_only(tmp_path):
    path = tmp_path / "two.daa"
    lines = [
        "NAME, lat, lon, alt, trk, gs, vs, time",
        "[], [deg], [deg], [m], [deg], [m/s], [m/s], [s]",
    ]
    for t in range(5):
        lines.append(f"own, {-41.3 + 1e-4 * t}, 174.2, 900, 0, 11.1, 0, {100 + t}")
        lines.append(f"other, -41.2, {174.2 - 1e-4 * t}, 1000, 270, 8, 0, {100 + t}")
    path.write_text("\n".join(lines) + "\n")
    assert call(path).exit_code == 0
    data = data_of((tmp_path / "two.html").read_text(encoding="utf-8"))
    assert data["targets"] == ["other"] and data["start_s"] == 100 and data["duration_s"] == 4
    truth = data["tables"]["truth"]
    east, north, _ = pymap3d.geodetic2enu(-41.2, 174.2, 1000, -41.3, 174.2, 0)
    assert truth["east_m"][0] == pytest.approx(east, abs=1e-2)
    assert truth["north_m"][0] == pytest.approx(north, abs=1e-2)
    assert "detections" not in data["tables"]


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (None, "there is no such folder or file"),
        ("folder", "holds no run"),
        ("text.csv", "is neither a run's folder nor a .daa file"),
    ],
)
def test_what_is_no_run_is_refused(made, says, tmp_path):
    path = tmp_path / (made or "nothing")
    if made == "folder":
        path.mkdir()
    elif made:
        path.write_text("a,b\n")
    done = call(path)
    assert done.exit_code == 2 and says in done.output and str(path) in done.output
    assert [p.name for p in tmp_path.iterdir()] == ([made] if made else [])


def test_a_scene_in_the_place_of_a_run_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("first_light")
    assert done.exit_code == 2
    assert "of the scene: dsa-des run first_light, then the folder it names" in done.output
    assert not list(tmp_path.iterdir())
