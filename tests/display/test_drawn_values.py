"""What the four figures of a run show, read from what they draw, against tables and pymap3d."""

import math
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.stats import chi2

import dsa_des
from components.display import plan
from components.display.map_view import MAP_WIDTH_IN, draw_outline, outline_of
from components.display.recorded_rows import Detected, scan_period_s
from components.display.report import DetectAndSenseReport
from components.messages.reach import Reach
from components.sensor.mounting import SensorAxes
from components.sensor.palette import EO, RADAR
from dsa_des.cli import main
from dsa_des.record.arrow import ParquetSink
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ObserverSink
from dsa_des.running.simulation import Simulation

START = -41.3, 179.98, 2200.0
#: A banked ownship with a southerly heading in the southern hemisphere, across the date line.
SCENE = """
title = "Banked"
duration_s = 24
seed = 4
wires = ["traffic -> transform -> radar -> fusion -> tracker", "transform -> eo -> fusion"]
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.range_boundary"
scan_rate_hz = 2
range_km = 6
azimuth_deg = [-70, 40]
errors = "stated"
azimuth_error_deg = 0.3
elevation_error_deg = 0.3
range_error_m = 20
mount_azimuth_deg = 10
[blocks.eo]
type = "optical.range_boundary"
scan_rate_hz = 4
offset_s = 0.25
range_km = 4.5
azimuth_deg = [-80, 80]
elevation_deg = [-60, 60]
errors = "stated"
azimuth_error_deg = 0.1
elevation_error_deg = 0.1
[blocks.fusion]
type = "fusion.pass_through"
[blocks.tracker]
type = "tracking.ekf"
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
name = "one"
east_m = -2500
north_m = -3500
up_m = 400
heading_deg = 60
speed_mps = 90
[[blocks.traffic.intruders]]
name = "two"
east_m = -900
north_m = -4300
up_m = -250
heading_deg = 330
speed_mps = 60
"""
HEADING = {"one": 60.0, "two": 330.0, "ownship": 217.0}
CLOCKS = {"radar": (2.0, 0.0), "eo": (4.0, 0.25)}


class Drawn:
    """A run's tables, its summary, and the figures by their file's name."""

    def __init__(self, folder) -> None:
        path = folder / "scene.toml"
        path.write_text(SCENE)
        observers = ObserverSink([])
        scene = dsa_des.load_scene(path, sets=["record.truth=true"])
        self.simulation = Simulation(scene, recorder=Recorder([ParquetSink(folder), observers]))
        observers.observers = DetectAndSenseReport().observers(self.simulation)
        outcome = self.simulation.run()
        self.summary = {**observers.result(), **outcome.report, "simulated_s": 24.0}
        self.table = {
            path.stem: {
                name: np.array(column) for name, column in pq.read_table(path).to_pydict().items()
            }
            for path in folder.glob("*.parquet")
        }
        figures = []

        def keep(canvas, out, **_):
            figures.append(canvas.figure)
            out.write(b"drawn")

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(FigureCanvasAgg, "print_png", keep)
            paths = DetectAndSenseReport().draw(self.simulation, folder, self.summary)
        self.figure = dict(zip([path.stem for path in paths], figures, strict=True))

    def true(self, name, time_s):
        """East, north, up and altitude of an aircraft, in m from the ownship's start."""
        angle = math.radians(HEADING[name])
        begin, speed = {
            "one": ((-2500, -3500, 400), 90), "two": ((-900, -4300, -250), 60),
            "ownship": ((0, 0, 0), 70),
        }[name]  # fmt: skip
        east = begin[0] + speed * np.sin(angle) * np.asarray(time_s)
        north = begin[1] + speed * np.cos(angle) * np.asarray(time_s)
        return east, north, begin[2] + START[2]

    def place(self, name, time_s):
        """Latitude, longitude and altitude, from the table of the truth."""
        truth = self.table["truth"]
        mine = truth["target"] == name
        lon_deg = truth["lon_deg"][mine] % 360.0
        columns = truth["lat_deg"][mine], lon_deg, truth["alt_m"][mine]
        return [np.interp(time_s, truth["time_s"][mine], column) for column in columns]

    def apart_m(self, name, time_s):
        """True slant range: the Earth's curvature takes a metre at most over these 5 km."""
        own, other = self.true("ownship", time_s), self.true(name, time_s)
        return np.sqrt(sum((a - b) ** 2 for a, b in zip(own, other, strict=True)))

    def seen(self, sensor):
        table = self.table["detections"]
        mine = (table["block"] == sensor) & (table["target"] != None)  # noqa: E711
        return {name: values[mine] for name, values in table.items()}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    return Drawn(tmp_path_factory.mktemp("drawn"))


def collections(axes):
    return [one for one in axes.collections if isinstance(one, LineCollection)]


def marks(axes, colour):
    """Points of the markers of a colour."""
    (line,) = [
        one for one in axes.lines
        if one.get_linestyle() == "None" and one.get_marker() != "|"
        and to_hex(one.get_markeredgecolor()) == colour
    ]  # fmt: skip
    return line.get_xydata()


COLOURS = {"radar": "#d55e00", "eo": "#0072b2"}


def near(points, wanted, atol):
    """Whether each point is one of those wanted."""
    apart = np.hypot(*(points[:, np.newaxis] - wanted[np.newaxis]).T)
    return bool((apart.min(axis=0) < atol).all())


def test_the_scene_has_what_is_to_be_drawn(drawn):
    assert list(drawn.figure) == ["plan", "timeline", "tracks", "consistency"]
    assert {name: len(drawn.seen(name)["time_s"]) > 20 for name in CLOCKS} == dict.fromkeys(
        CLOCKS, True
    )


def test_flights_on_the_plan_and_the_arrows_at_their_ends(drawn):
    plan, _heights = drawn.figure["plan"].axes
    flown, heads, _met = collections(plan)
    assert [to_hex(c) for c in flown.get_colors()] == ["#777777", "#777777", "#000000"]
    assert flown.get_linewidths() == [1.0, 1.0, 2.0]
    width_px = plan.get_position().width * drawn.figure["plan"].get_size_inches()[0] * 110
    km_per_px = np.ptp(plan.get_xlim()) / width_px
    for line, head, name in zip(
        flown.get_segments(), heads.get_segments(), ("one", "two", "ownship"), strict=True
    ):
        time_s = np.linspace(0.0, 24.0, len(line))
        if name in drawn.summary["targets"]:  # with a point at the closest approach
            met_s = drawn.summary["targets"][name]["closest_approach"]["time_s"]
            time_s = np.union1d(
                np.linspace(0.0, 24.0, len(line) - (met_s not in (0.0, 24.0))), [met_s]
            )
        east, north, _ = drawn.true(name, time_s)
        assert np.abs(line - np.column_stack([east, north]) / 1e3).max() < 3e-3
        tip, angle = head[1], math.radians(HEADING[name])
        ahead = np.array([math.sin(angle), math.cos(angle)])
        right = np.array([ahead[1], -ahead[0]])
        size = 8.0 * km_per_px
        assert tip == pytest.approx(line[-1])
        for wing, side in ((head[0], -1), (head[2], 1)):
            assert (wing - tip) @ ahead == pytest.approx(-size, rel=2e-3)
            assert (wing - tip) @ right == pytest.approx(0.5 * side * size, rel=2e-2)
    (starts,) = [one for one in plan.lines if to_hex(one.get_markeredgecolor()) == "#333333"]
    assert starts.get_xydata() == pytest.approx(np.array([s[0] for s in flown.get_segments()]))
    assert plan.get_xlabel() == "east of the ownship's start (km)"
    assert plan.get_ylabel() == "north of the ownship's start (km)"
    (x, y), box = (plan.get_xlim(), plan.get_ylim()), plan.get_position()
    inches = drawn.figure["plan"].get_size_inches()
    assert np.ptp(x) / (box.width * inches[0]) == pytest.approx(
        np.ptp(y) / (box.height * inches[1])
    )
    every = np.concatenate(flown.get_segments())
    assert x[0] < every[:, 0].min() and every[:, 0].max() < x[1]
    assert y[0] < every[:, 1].min() and every[:, 1].max() < y[1]


def test_map_and_altitudes_stand_above_each_other_beside_the_legend(drawn):
    """Both as wide as a map is, from its left edge to where the legend begins."""
    figure = drawn.figure["plan"]
    plan, heights = (axes.get_position() for axes in figure.axes[:2])
    width_in = figure.get_figwidth()
    for place in (plan, heights):
        assert (place.x1 - place.x0) * width_in == pytest.approx(MAP_WIDTH_IN)
        assert place.x0 * width_in == pytest.approx(0.75, abs=0.5)
    assert plan.x0 == heights.x0 and heights.y1 < plan.y0
    legend = figure.legends[0].get_window_extent().transformed(figure.transFigure.inverted())
    assert plan.x1 < legend.x0 < 1.0


def test_detections_on_the_plan_by_height_and_over_time(drawn):
    plan, heights = drawn.figure["plan"].axes
    below = drawn.figure["timeline"].axes[1]
    for name, colour in COLOURS.items():
        seen = drawn.seen(name)
        places = [drawn.true(*one) for one in zip(seen["target"], seen["time_s"], strict=True)]
        east, north, alt_m = np.array(places).T
        for axes, wanted, scale in (
            (plan, np.column_stack([east, north]) / 1e3, 3e-3),
            (heights, np.column_stack([seen["time_s"], alt_m]), 3.0),
            (below, np.column_stack([seen["time_s"], seen["true_range_m"] / 1e3]), 1e-9),
        ):
            points = marks(axes, colour)
            assert len(points) > 8 and near(points, wanted, scale)
            # The first of each target is always there.
            first = [np.flatnonzero(seen["target"] == target)[0] for target in ("one", "two")]
            assert near(wanted[first], points, 2 * scale)
    text = [one.get_text() for one in drawn.figure["plan"].legends[0].get_texts()]
    counts = {name: len(drawn.seen(name)["time_s"]) for name in CLOCKS}
    on_plan = {name: len(marks(plan, colour)) for name, colour in COLOURS.items()}
    assert text[:4] == ["ownship", "target", "start", "closest approach"]
    for line, (name, field) in zip(text[4:], [
        ("eo", "field of view ±80°,\nto 4.5 km"),
        ("radar", "field of view -70° to 40°\nround 10°,\nto 6 km"),
    ], strict=True):  # fmt: skip
        few = f"\n({on_plan[name]} of them marked)" if on_plan[name] < counts[name] else ""
        assert line == f"{name}: {counts[name]} detections{few}\n{field}"


def test_altitudes_and_ranges_over_time(drawn):
    heights, below = drawn.figure["plan"].axes[1], drawn.figure["timeline"].axes[1]
    for line, name in zip(
        collections(heights)[0].get_segments(), ("one", "two", "ownship"), strict=True
    ):
        assert np.abs(line[:, 1] - drawn.true(name, 0.0)[2]).max() < 3.0
        assert (line[0, 0], line[-1, 0]) == (0.0, 24.0)
    low, high = heights.get_ylim()
    assert low == pytest.approx(2275.0 - 650.0 * 0.58, abs=3)
    assert high == pytest.approx(2275.0 + 650.0 * 0.58, abs=3)
    assert heights.get_xlim() == below.get_xlim() == (0.0, 24.0)
    assert heights.get_ylabel() == "altitude (m)"
    assert sorted(one.get_text() for one in heights.texts) == ["one", "ownship", "two"]
    for one in below.texts:  # a name stands at the end of its own line
        assert one.xy[1] * 1e3 == pytest.approx(drawn.apart_m(one.get_text(), one.xy[0]), abs=3)
    farthest = 0.0
    for line, name in zip(collections(below)[0].get_segments(), ("one", "two"), strict=True):
        assert line[:, 1] * 1e3 == pytest.approx(drawn.apart_m(name, line[:, 0]), abs=3)
        farthest = max(farthest, line[:, 1].max())
    top = 1.6 * max(drawn.seen(name)["true_range_m"].max() for name in CLOCKS) / 1e3
    assert below.get_ylim() == pytest.approx((0.0, 1.05 * min(farthest, top)))
    assert below.get_ylabel() == "true slant range (km)"


def test_closest_approaches_and_names(drawn):
    plan = drawn.figure["plan"].axes[0]
    met = collections(plan)[2].get_segments()
    crosses = next(one for one in plan.lines if one.get_marker() == "x").get_xydata()
    texts = {one.get_text(): one.get_position() for one in plan.texts}
    approaches = {n: one["closest_approach"] for n, one in drawn.summary["targets"].items()}
    order = sorted(approaches, key=lambda name: approaches[name]["range_m"])
    for name, segment, cross in zip(order, met, crosses, strict=True):
        time_s = approaches[name]["time_s"]
        for point, who in zip(segment, ("ownship", name), strict=True):
            assert point == pytest.approx(np.array(drawn.true(who, time_s)[:2]) / 1e3, abs=3e-3)
        assert cross == pytest.approx(segment[1])
        fine_s = np.linspace(0.0, 24.0, 24001)
        least = drawn.apart_m(name, fine_s)
        assert approaches[name]["range_m"] == pytest.approx(least.min(), abs=3)
        said = [text for text in texts if text.endswith(f" at {time_s:.6g} s")]
        assert said and math.hypot(*(np.array(texts[said[0]]) - cross)) < 1.5
        first = np.array(drawn.true(name, 0.0)[:2]) / 1e3
        assert math.hypot(*(np.array(texts[name]) - first)) < 1.0
    assert "ownship" in texts and len(texts) == 5
    assert plan.get_title(loc="left") == "Banked: plan view"


def test_fields_of_view_lie_round_the_nose(drawn):
    plan = drawn.figure["plan"].axes[0]
    outlines = [one for one in plan.patches if isinstance(one, Polygon)]
    for (name, low, high, km), filled, edge in zip(
        (("eo", -80, 80, 4.5), ("radar", -60, 50, 6.0)), outlines[::2], outlines[1::2], strict=True
    ):
        corners = filled.get_xy()
        ring = corners[:-2]  # then the origin, and the first again
        assert np.hypot(*ring.T) == pytest.approx(km)
        bearing = np.degrees(np.unwrap(np.arctan2(*ring.T)))
        assert bearing % 360 == pytest.approx(np.linspace(217 + low, 217 + high, len(ring)) % 360)
        assert corners[-2] == pytest.approx((0.0, 0.0))
        assert (edge.get_xy() == corners).all() and to_hex(edge.get_edgecolor()) == COLOURS[name]


def test_the_close_up_shows_each_scan_on_its_clock(drawn):
    above, below = drawn.figure["timeline"].axes
    start_s, end_s = above.get_xlim()
    scans, fused = drawn.table["scans"], drawn.table["fused"]
    together = [k for k, name in enumerate(fused["sensors"]) if "+" in name]
    assert end_s - start_s == pytest.approx(4.2 * 0.5)
    (shaded,) = list(below.patches)
    assert (shaded.get_x(), shaded.get_x() + shaded.get_width()) == pytest.approx((start_s, end_s))
    ticks = [one for one in above.lines if one.get_marker() == "|"]
    hits = [one for one in above.lines if one.get_marker() != "|"]
    assert [one.get_text() for one in above.get_yticklabels()] == ["eo\n4 Hz", "radar\n2 Hz"]
    assert above.get_yticks().tolist() == [1, 0]
    for line, hit, (name, height) in zip(ticks, hits, (("eo", 1), ("radar", 0)), strict=False):
        mine = (scans["block"] == name) & (scans["time_s"] >= start_s) & (scans["time_s"] <= end_s)
        assert line.get_xdata().tolist() == scans["time_s"][mine].tolist()
        assert set(line.get_ydata()) == set(hit.get_ydata()) | {height} == {height}
        with_hit = mine & (scans["detected"] > 0)
        assert hit.get_xdata().tolist() == scans["time_s"][with_hit].tolist()
        assert len(line.get_xdata()) > 3
    inside = [k for k in together if start_s <= fused["time_s"][k] < end_s]
    assert not inside and not collections(above)  # nothing is fused here: the tracker fuses
    seen_s = min(drawn.seen(name)["time_s"][0] for name in CLOCKS)
    assert start_s == pytest.approx(max(0.0, seen_s - 0.3 * 2.1))
    assert above.get_title(loc="left") == "Banked\nAround the first detection"


def states(drawn):
    table = drawn.table["state_tracks"]
    held = np.isin(table["track_status"], ["confirmed", "coasted"]) & table["has_range"]
    return {name: values[held] for name, values in table.items()}


def test_tracks_and_their_ellipses(drawn):
    plan, height = drawn.figure["tracks"].axes
    table = states(drawn)
    numbers = sorted(set(table["track"].tolist()))
    thick = [one for one in plan.lines if one.get_linewidth() == 1.4]
    upper = [one for one in height.lines if one.get_linewidth() == 1.4]
    edges = [one for one in plan.lines if one.get_linewidth() == 0.6]
    filled = [one.get_xy() for one in plan.patches]
    assert len(thick) == len(upper) == len(numbers) >= 2
    place = 0
    for number, line, above, band in zip(numbers, thick, upper, height.collections, strict=True):
        mine = table["track"] == number
        one = {name: values[mine] for name, values in table.items()}
        step = max(1, int(mine.sum()) // 400)
        assert line.get_xdata() == pytest.approx(one["east_m"][::step] / 1e3)
        assert line.get_ydata() == pytest.approx(one["north_m"][::step] / 1e3)
        up = one["origin_alt_m"] - one["down_m"]
        assert above.get_xdata() == pytest.approx(one["state_s"][::step])
        assert above.get_ydata() == pytest.approx(up[::step])
        spread = 1.959964 * np.sqrt(one["covariance_22_m2"])
        outline = band.get_paths()[0].vertices
        assert outline[:, 1].max() == pytest.approx((up + spread)[::step].max(), rel=1e-9)
        assert outline[:, 1].min() == pytest.approx((up - spread)[::step].min(), rel=1e-9)
        count = len(one["east_m"][::step])
        for row in range(0, count, max(1, count // 8)):
            edge = edges[place].get_xydata() * 1e3
            assert filled[place][: len(edge)] * 1e3 == pytest.approx(edge)
            place += 1
            at = row * step
            nn, ne, ee = (one[f"covariance_{ij}_m2"][at] for ij in ("00", "01", "11"))
            away = edge - (one["east_m"][at], one["north_m"][at])
            squared = np.einsum("ni,ij,nj->n", away, np.linalg.inv([[ee, ne], [ne, nn]]), away)
            assert squared == pytest.approx(chi2.ppf(0.95, 2), rel=1e-6)
            turn = np.unwrap(np.arctan2(away[:, 0], away[:, 1]))
            assert abs(turn[-1] - turn[0]) == pytest.approx(2 * math.pi)
    assert place == len(edges)
    assert plan.get_title(loc="left").startswith(f"{len(numbers)} confirmed tracks near targets, 0")
    assert plan.get_xlabel() == "east of the origin (km)" and plan.get_ylabel()[:5] == "north"


def test_true_flights_behind_the_tracks(drawn):
    plan, height = drawn.figure["tracks"].axes
    table = states(drawn)
    origin = [table[f"origin_{name}"][0] for name in ("lat_deg", "lon_deg", "alt_m")]
    grid = np.linspace(table["state_s"].min(), table["state_s"].max(), 400)
    thin = [one for one in plan.lines if one.get_linewidth() == 0.7]
    upper = [one for one in height.lines if one.get_linewidth() == 0.7]
    for name, line, above in zip(("ownship", "one", "two"), thin, upper, strict=True):
        east, north, alt_m = drawn.true(name, grid)
        at = pymap3d.enu2geodetic(east, north, alt_m - START[2], *START)
        if name != "ownship":  # flown level: not along the plane that touches at the start
            at = (*at[:2], np.full(len(grid), alt_m))
        wanted = pymap3d.geodetic2enu(*at, *origin)
        assert line.get_xdata() * 1e3 == pytest.approx(wanted[0], abs=3)
        assert line.get_ydata() * 1e3 == pytest.approx(wanted[1], abs=3)
        assert above.get_ydata() == pytest.approx(origin[2] + wanted[2], abs=3)
        assert above.get_xdata() == pytest.approx(grid)
    names = {one.get_text() for one in plan.texts}
    assert {"one", "two", "ownship"} <= names


def test_how_wrong_tracks_are_and_say(drawn):
    errors, innovations = drawn.figure["consistency"].axes
    table = states(drawn)
    every, last_s = [], drawn.table["truth"]["time_s"].max()
    for number, line in zip(sorted(set(table["track"].tolist())), errors.lines, strict=False):
        mine = table["track"] == number
        one = {name: values[mine] for name, values in table.items()}
        assert line.get_xdata() == pytest.approx(one["state_s"])
        wanted = []
        for row in range(int(mine.sum())):
            origin = [one[f"origin_{n}"][row] for n in ("lat_deg", "lon_deg", "alt_m")]
            state = np.array([one[n][row] for n in ("north_m", "east_m", "down_m", "north_m_s",
                                                    "east_m_s", "down_m_s")])  # fmt: skip
            best = None
            for name in ("one", "two"):
                places = []
                now_s = one["state_s"][row]
                around_s = np.clip([now_s - 0.2, now_s + 0.2], 0.0, last_s)
                for moment in (now_s, *around_s):
                    east, north, up = pymap3d.geodetic2enu(*drawn.place(name, moment), *origin)
                    places.append(np.array([north, east, -up]))
                true = np.concatenate([places[0], (places[2] - places[1]) / np.ptp(around_s)])
                if best is None or np.linalg.norm((state - true)[:3]) < np.linalg.norm(best[:3]):
                    best = state - true
            spread = np.empty((6, 6))
            for i in range(6):
                for j in range(i, 6):
                    unit = ("m2", "m2_s", "m2_s2")[(i > 2) + (j > 2)]
                    spread[i, j] = spread[j, i] = one[f"covariance_{i}{j}_{unit}"][row]
            wanted.append(best @ np.linalg.solve(spread, best))
        assert line.get_ydata() == pytest.approx(wanted, rel=2e-3, abs=2e-3)
        every += line.get_ydata().tolist()
    low, high = chi2.ppf([0.025, 0.975], 6)
    (band,) = errors.patches
    assert (band.get_extents().transformed(errors.transData.inverted()).bounds[1]) == pytest.approx(
        low, rel=1e-6
    )
    inside = np.mean([(low <= value <= high) for value in every])
    assert errors.get_title(loc="left") == (
        f"Error squared by its covariance (NEES): mean {np.mean(every):.3g}, "
        f"{100 * inside:.0f} % inside (honest: 6, 95 %)"
    )
    told = table["nis_freedom"] > 0
    time_s, nis, freedom = (table[n][told] for n in ("state_s", "nis", "nis_freedom"))
    edges = np.linspace(table["state_s"].min(), table["state_s"].max() + 1e-9, 41)
    points = []
    good = []
    for a, b in pairwise(edges):
        here = (time_s >= a) & (time_s < b)
        if here.any():
            many = freedom[here].sum()
            points.append(((a + b) / 2, nis[here].sum() / many))
            good.append(chi2.ppf(0.025, many) <= nis[here].sum() <= chi2.ppf(0.975, many))
    (line,) = [one for one in innovations.lines if one.get_marker() == "."]
    assert line.get_xydata() == pytest.approx(np.array(points))
    assert innovations.get_title(loc="left") == (
        "Innovation squared by its covariance (NIS) per quantity: "
        f"{nis.sum() / freedom.sum():.3g}, {100 * np.mean(good):.0f} % of stretches inside "
        "(honest: 1, 95 %)"
    )


@pytest.mark.parametrize("everywhere", [False, True])
def test_a_field_of_view_without_end_is_its_two_edges(everywhere):
    azimuth_rad = (-math.pi, math.pi) if everywhere else (math.radians(-30), math.radians(50))
    reach = Reach(azimuth_rad, (-1.0, 1.0), math.inf)
    outline = outline_of(math.radians(217), reach, SensorAxes())
    axes = Figure().add_subplot()
    draw_outline(axes, outline, {"a": RADAR, "eo": EO}, "eo", 40.0)
    wanted = [] if everywhere else [187, 267]
    assert not outline.closed and not axes.patches and len(axes.lines) == len(wanted)
    for line, bearing_deg in zip(axes.lines, wanted, strict=True):
        ends = line.get_xydata()
        assert ends[0] == pytest.approx((0, 0))
        angle = math.radians(bearing_deg)
        assert ends[1] == pytest.approx((40 * math.sin(angle), 40 * math.cos(angle)))
        assert to_hex(line.get_color()) == COLOURS["eo"] and line.get_linestyle() == "--"


def test_a_field_of_view_all_around_is_a_ring_without_a_corner_at_the_ownship():
    around = Reach((-math.pi, math.pi), (-1.0, 1.0), 5000.0)
    corners = outline_of(1.0, around, SensorAxes()).corners_km
    assert np.hypot(*corners.T) == pytest.approx(5.0)
    most = Reach((-math.radians(170), math.radians(170)), (-1.0, 1.0), 5000.0)
    assert outline_of(1.0, most, SensorAxes()).corners_km[-1] == pytest.approx((0.0, 0.0))


def test_bars_show_when_sensors_were_out(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(
        FigureCanvasAgg, "print_png", lambda canvas, *_, **__: figures.append(canvas.figure)
    )
    words = ["run", "radar_outage", "--out", str(tmp_path / "run"), "--quiet"]
    assert CliRunner().invoke(main, words).exit_code == 0  # off from 30 s to 50 s
    above, below = figures[-1].axes[:2]
    # It scans no slower for being off: its mean over the run would be 4.2 Hz.
    rates = dict(tick.get_text().split("\n") for tick in above.get_yticklabels())
    assert rates["radar"] == "5 Hz" == f"{1 / scan_period_s(np.r_[0:30:0.2, 50:60:0.2]):.4g} Hz"
    bars = {of.get_label(): of.get_paths() for of in below.collections if of.get_label() == "radar"}
    (bar,) = bars["radar"]
    assert bar.vertices[:, 0].min() == 30 and bar.vertices[:, 0].max() == 50
    assert "bars: radar off or failed)" in below.get_title(loc="left")


def test_legends_beside_the_map_end_within_the_picture():
    """They ran off its right edge where sensors are on several platforms."""
    none = {"radar_b": np.empty(0)}
    detected = Detected(["radar_b"], none, none, {}, [], {"radar_b": RADAR})
    counts = {"sensors": {"radar_b": {"detections": 1026}}}
    handles = plan._legend_entries(
        {}, detected, {"radar_b": 1026}, counts, {"radar_b": "head_on"}, False
    )
    assert handles[-1].get_label() == "radar_b on head_on:\n1,026 detections"
