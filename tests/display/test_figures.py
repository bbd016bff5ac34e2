"""The two figures: they are drawn for every kind of run, and drawn the same every time."""

import struct
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from components.display.flights import Flights
from components.display.recorded_rows import Detected, SensorScans, read_scans
from components.display.report import DetectAndSenseReport, sensor_names
from components.display.timeline import find_close_up
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ObserverSink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

HEAD = """
title = "Test $cene_"
duration_s = {duration}
wires = ["traffic -> transform", "transform -> radar", "transform -> near",
         "radar -> fusion", "near -> fusion"]
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 5
range_km = 8
azimuth_deg = [-110, 110]
[blocks.near]
type = "radar.range_boundary"
scan_rate_hz = 2
offset_s = 0.1
range_km = 3
[blocks.fusion]
type = "fusion.pick_best"
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52, lon_deg = 4.4, alt_m = 1000, heading_deg = 30, speed_mps = {speed} }}
"""

TARGET = """
[[blocks.traffic.intruders]]
name = "{name}"
east_m = {east}
north_m = {north}
heading_deg = {heading}
speed_mps = {speed}
"""


def a_target(name, east=2000, north=3500, heading=210, speed=60):
    return TARGET.format(name=name, east=east, north=north, heading=heading, speed=speed)


def run(tmp_path, targets, duration=40, speed=50, window=None):
    """Run a scene into a folder; return the simulation, the folder and the summary."""
    scene = tmp_path / "scene.toml"
    scene.write_text(HEAD.format(duration=duration, speed=speed) + targets, encoding="utf-8")
    folder = tmp_path / f"run-{window}"
    folder.mkdir(exist_ok=True)
    observers = ObserverSink([])
    recorder = Recorder([ParquetSink(folder), observers])
    simulation = Simulation(load_scene(scene), recorder=recorder, window=window)
    observers.observers = DetectAndSenseReport().observers(simulation)
    outcome = simulation.run()
    return simulation, folder, {**observers.result(), **outcome.report, "simulated_s": 1.0}


def draw(simulation, folder, summary):
    return DetectAndSenseReport().draw(simulation, folder, summary)


def size_of(path):
    content = path.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", content[16:24])


SCENES = {
    "one target": (a_target("solo"), 40, 50),
    "no target": ("", 40, 50),
    "none detected": (a_target("far", east=90000) + a_target("farther", east=-90000), 40, 50),
    "ownship at rest": (a_target("hover", speed=0), 40, 0),
    "all at rest in one place": (a_target("same", east=0, north=0, speed=0), 5, 0),
    "one instant": (a_target("blink"), 0.001, 50),
    "flights that go far away": (a_target("gone", speed=250), 4000, 60),
    "strange names": (a_target("$x_{1") + a_target("_hidden") + a_target("通訊"), 20, 50),
    "many targets": ("".join(a_target(f"t{i}", east=-9000 + 600 * i) for i in range(30)), 20, 50),
}


@pytest.mark.parametrize("name", SCENES)
def test_every_kind_of_run_is_drawn(tmp_path, name):
    targets, duration, speed = SCENES[name]
    paths = draw(*run(tmp_path, targets, duration, speed))
    assert [path.name for path in paths] == ["plan.png", "timeline.png"]
    for path in paths:
        width, height = size_of(path)
        assert width > 800
        assert height > 400
        assert path.stat().st_size > 8000


def test_axes_of_both_figures_stand_where_they_belong(tmp_path, monkeypatch):
    found = []
    monkeypatch.setattr(
        FigureCanvasAgg, "print_png", lambda canvas, *_, **__: found.append(canvas.figure)
    )
    draw(*run(tmp_path, a_target("solo"), 2))
    plan, timeline = found
    above, heights = plan.axes[:2]
    places = [axes.get_position() for axes in (above, heights)]
    assert places[0].x0 == places[1].x0 and places[0].x1 == places[1].x1
    assert 0.0 < places[0].x0 < places[0].x1 < 1.0
    assert 0.0 < places[1].y0 < places[1].y1 < places[0].y0 < places[0].y1 < 1.0
    # A kilometre is as long northwards as eastwards.
    wide, high = plan.get_size_inches() * [places[0].width, places[0].height]
    assert wide / np.ptp(above.get_xlim()) == pytest.approx(high / np.ptp(above.get_ylim()))
    scans, whole = timeline.axes[:2]
    assert whole.get_title(loc="left") == "Whole run (shaded: the part above)"
    places = [axes.get_position() for axes in (scans, whole)]
    assert places[0].x0 == places[1].x0 and 0.0 < places[1].y0 < places[1].y1 < places[0].y0 < 1.0


def test_without_sensors_ranges_have_the_figure_for_themselves(tmp_path, monkeypatch):
    """An empty row of scans, and the whole run shaded for it, would say nothing."""
    monkeypatch.setattr("components.display.timeline.read_scans", lambda folder: {})
    found = []
    print_png = FigureCanvasAgg.print_png
    monkeypatch.setattr(
        FigureCanvasAgg,
        "print_png",
        lambda canvas, *given, **more: (
            found.append(canvas.figure) or print_png(canvas, *given, **more)
        ),
    )
    draw(*run(tmp_path, a_target("solo"), 10))
    (axes,) = found[-1].axes
    assert axes.get_title(loc="left").endswith(": no sensor scans")
    assert not list(axes.patches)


def test_the_same_run_is_the_same_picture(tmp_path):
    simulation, folder, summary = run(tmp_path, a_target("solo"), 10)
    first = [path.read_bytes() for path in draw(simulation, folder, summary)]
    again = [path.read_bytes() for path in draw(simulation, folder, summary)]
    assert first == again
    for content in first:
        assert b"Software" not in content
        assert b"Matplotlib" not in content


def test_detections_are_read_sensor_by_sensor(tmp_path):
    simulation, folder, summary = run(tmp_path, a_target("solo"))
    assert sensor_names(simulation) == ["near", "radar"]
    detected = Detected.read(folder, sensor_names(simulation))
    for name in ("near", "radar"):
        assert len(detected.time_s[name]) == summary["sensors"][name]["detections"] > 0
        first = summary["sensors"][name]["first_detection"]
        assert detected.time_s[name][0] == first["time_s"]
        assert detected.range_m[name][0] == first["range_m"]
        assert detected.names[detected.target[name][0]] == "solo"


def test_the_close_up_shows_the_first_fusion(tmp_path):
    _, folder, _ = run(tmp_path, a_target("solo"))
    scans = read_scans(folder)
    close_up = find_close_up(scans, folder, 40.0)
    detected = Detected.read(folder, ["near", "radar"])
    both = np.intersect1d(detected.time_s["near"], detected.time_s["radar"])
    assert close_up.joined[0] == (both[0], ["near", "radar"])
    assert close_up.start_s < both[0] < close_up.end_s
    assert "fusion" in close_up.what


def test_the_close_up_falls_back_to_the_first_detection_and_the_start(tmp_path):
    for targets, what in ((a_target("seen", east=4000, north=6000), "first detection"),
                          (a_target("far", east=90000), "At the start")):  # fmt: skip
        _, folder, _ = run(tmp_path, targets, 5)
        close_up = find_close_up(read_scans(folder), folder, 5.0)
        assert what in close_up.what
        assert close_up.joined == []
        assert 0.0 <= close_up.start_s < close_up.end_s <= 5.0


def test_the_close_up_prefers_the_largest_combination(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [(1.0, "a+b"), (2.0, "a"), (3.0, "a+b+c"), (3.5, "a+c"), (9.0, "a+b+c")]
    table = {"time_s": [row[0] for row in rows], "sensors": [row[1] for row in rows]}
    pq.write_table(pa.table(table), tmp_path / "fused.parquet", row_group_size=2)
    scans = {name: SensorScans(np.arange(0.0, 10.0, 0.5), 0.0) for name in "abc"}
    close_up = find_close_up(scans, tmp_path, 10.0)
    assert close_up.what.endswith("three sensors")
    assert close_up.start_s < 3.0 < close_up.end_s < 9.0
    assert (3.0, ["a", "b", "c"]) in close_up.joined
    assert (3.5, ["a", "c"]) in close_up.joined


def test_without_flights_there_is_still_a_timeline(tmp_path, monkeypatch):
    simulation, folder, summary = run(tmp_path, a_target("solo"), 10)
    monkeypatch.setattr(Flights, "from_simulation", classmethod(lambda cls, *_: None))
    assert [path.name for path in draw(simulation, folder, summary)] == ["timeline.png"]


def test_matplotlib_and_arrow_are_imported_only_for_drawing():
    code = (
        "import sys, components.display.report as r; r.DetectAndSenseReport();"
        "print([m for m in ('matplotlib', 'pyarrow', 'rich', 'PIL') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
