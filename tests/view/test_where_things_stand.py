"""What stands where on the page, in a real browser: names, zoom, and pages beside each other."""

import itertools
import math

import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner

import dsa_des
from components.examples import configs_folder
from components.view.command import view
from tests.results.test_study_report import call
from tests.results.test_study_report import folder as studied
from tests.support.waiting import wait_for
from tests.view.test_page import SCENE

study = studied
NEAR = SCENE.format(title="t", name="near")
INTRUDER = NEAR[NEAR.index("[[blocks.traffic.intruders]]") :]


def opened_page(browser, path, width=1280, height=800, hash=""):
    """Return a page and what it said or asked for."""
    page = browser.new_page(viewport={"width": width, "height": height})
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(("file:", "about:"))
            else wrong.append(asked.url))  # fmt: skip
    page.goto(f"file://{path}{hash}")
    return page, wrong


def recorded(where, text, name="run"):
    (where / f"{name}.toml").write_text(text)
    dsa_des.run(dsa_des.load_scene(where / f"{name}.toml"), out=where / name)
    return where / name


def shown(*runs):
    done = CliRunner().invoke(view, [str(run) for run in runs], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return runs[0].with_name("-".join(run.name for run in runs) + ".html")


def covered(one, other):
    beside = one["left"] >= other["right"] or other["left"] >= one["right"]
    return not (beside or one["top"] >= other["low"] or other["top"] >= one["low"])


def test_names_of_a_swarm_do_not_cover_each_other(browser, tmp_path):
    text = SCENE.format(title="t", name="swarm 0")
    first = text[text.index("[[blocks.traffic.intruders]]") :]
    for number in range(1, 8):
        moved = first.replace("north_m = -3500", f"north_m = {-3500 + 15 * number}")
        text += moved.replace("swarm 0", f"swarm {number}")
    text += first.replace("swarm 0", "alone").replace("east_m = -2500", "east_m = 1500")
    (tmp_path / "scene.toml").write_text(text)
    dsa_des.run(dsa_des.load_scene(tmp_path / "scene.toml"), out=tmp_path / "run")
    assert CliRunner().invoke(view, [str(tmp_path / "run")]).exit_code == 0
    opened = browser.new_page()
    opened.goto(f"file://{tmp_path / 'run.html'}#t=3.1")
    boxes = opened.evaluate("App.state().labels")
    assert {f"swarm {k}" for k in range(8)} | {"alone"} == {box["words"] for box in boxes}
    for one, other in itertools.combinations(boxes, 2):
        assert not covered(one, other), (one, other)
    # One name each, of target and track; who has room keeps to its place.
    assert len(boxes) == 9
    x, y = opened.evaluate(
        "(() => { const at = Data.truths(3.1).find(one => Data.targets[one.target] === 'alone');"
        " return Plan.place(at.east, at.north); })()"
    )
    (box,) = [box for box in boxes if box["words"] == "alone"]
    assert (box["left"], box["low"]) == pytest.approx((x + 11.0, y + 7.0))
    opened.close()


@pytest.fixture(scope="module")
def crowd(tmp_path_factory):
    """The page of a hundred aircraft around the ownship, and one far away that nobody sees."""
    random = np.random.default_rng(3)
    text = NEAR[: NEAR.index("[[blocks.traffic.intruders]]")]
    places = [*random.uniform(-8000, 8000, (100, 2)).tolist(), [90_000.0, 40_000.0]]
    for number, (east, north) in enumerate(places):
        name = f"intruder {number}" if number < 100 else "far away"
        moved = INTRUDER.replace("near", name).replace("east_m = -2500", f"east_m = {east}")
        text += moved.replace("north_m = -3500", f"north_m = {north}")
    run = recorded(tmp_path_factory.mktemp("crowd"), text + "[record]\ntruth = true\n")
    return run, shown(run)


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1280, 800), (390, 844)])
def test_names_of_a_hundred_aircraft_do_not_cover_each_other(browser, crowd, width, height):
    page, wrong = opened_page(browser, crowd[1], width, height, "#t=3.1")
    state = page.evaluate("App.state()")
    boxes, high = state["labels"], page.evaluate("Plan.canvas.clientHeight")
    for one, other in itertools.combinations(boxes, 2):
        assert not covered(one, other), (one, other)
    words = [box["words"] for box in boxes]
    assert len(set(words)) == len(words)
    # Who is seen is named, where there is room: on a telephone a part of them, the nearest first.
    assert len(words) > (85 if width > 400 else 25) and state["named"] >= 100
    places = {
        one["name"]: one
        for one in page.evaluate(
            "Data.truths(3.1).map(one => { const [x, y] = Plan.place(one.east, one.north);"
            " const own = Data.ownship(3.1);"
            " return {name: Data.targets[one.target], x, y,"
            " far: Math.hypot(one.east - own.east, one.north - own.north)}; })"
        )
    }
    for box in boxes:  # and stands beside what it names
        at = places[box["words"]]
        aside = max(box["left"] - at["x"], at["x"] - box["right"])
        assert aside == pytest.approx(11.0) and abs((box["top"] + box["low"]) / 2 - at["y"]) < 85
        assert box["top"] >= 0 and box["low"] <= high
    assert page.evaluate("[document.documentElement.scrollWidth, innerWidth]") == [width, width]
    assert wrong == []
    page.close()


def test_it_shows_what_matters_and_all_on_request(browser, crowd):
    """The farthest tenth of what is seen may be outside, and who is never seen is."""
    run, html = crowd
    page, _ = opened_page(browser, html)
    seen = [r for r in pq.read_table(run / "detections.parquet").to_pylist() if r["range_m"]]
    far_m = np.array([r["range_m"] * math.cos(r["elevation_rad"]) for r in seen])
    half_m = "Plan.view.perPixel * Math.min(Plan.canvas.clientWidth, Plan.canvas.clientHeight) / 2"
    # In body axes of an ownship that is banked, elevation is nearly that from the horizon.
    shown_m = page.evaluate(half_m)
    assert shown_m == pytest.approx(1.15 * np.quantile(far_m, 0.9), rel=0.05)
    page.keyboard.press("a")
    assert page.evaluate(half_m) > math.hypot(90_000, 40_000)
    page.keyboard.press("0")
    assert page.evaluate(half_m) == pytest.approx(shown_m)
    page.close()


def test_alerts_say_how_far_it_looks_and_every_aircraft_has_one_name(browser, tmp_path):
    """Alerts of a track and of the truth, by two alerting blocks; who is far is of no account."""
    run = recorded(
        tmp_path,
        f"extends = '{configs_folder() / 'avoidance' / 'crossing_tracked.toml'}'\n"
        "[blocks.traffic.intruders.far]\neast_m = 60000\nnorth_m = 0\nspeed_mps = 60\n",
    )
    alerts = pq.read_table(run / "alerts.parquet").to_pylist()
    on = [row for row in alerts if row["level"] > 0]
    assert on and {row["track"] for row in on} != {None}
    truth = {
        (r["target"], r["time_s"]): r for r in pq.read_table(run / "truth.parquet").to_pylist()
    }
    far_m = []
    for row in on:
        own, other = truth[None, row["time_s"]], truth[row["target"], row["time_s"]]
        east, north, _ = pymap3d.geodetic2enu(
            other["lat_deg"], other["lon_deg"], other["alt_m"],
            own["lat_deg"], own["lon_deg"], own["alt_m"],
        )  # fmt: skip
        far_m.append(math.hypot(east, north))
    page, wrong = opened_page(browser, shown(run))
    assert page.evaluate("Data.reach.near_m") == pytest.approx(max(far_m), rel=1e-3)
    last = on[-1]
    page.evaluate("t => App.seek(t)", last["time_s"])
    state = page.evaluate("App.state()")
    assert state["alerts"] == [{"target": "crossing", "level": last["level"]}]
    words = [box["words"] for box in state["labels"]]
    assert sorted(words) == [f"crossing · alert {last['level']}", "track 1"]
    assert page.locator("#alerts").inner_text() == f"crossing: level {last['level']}"
    page.keyboard.press("a")
    assert "far" in [box["words"] for box in page.evaluate("App.state().labels")]
    # What was said once stands no longer than until it is due again.
    page.evaluate("t => App.seek(t)", last["time_s"] + 20.0)
    assert page.evaluate("App.state().alerts") == []
    assert wrong == []
    page.close()


def test_a_recorded_encounter_shows_the_two_minutes_before_its_closest_approach(browser, tmp_path):
    """Head on at 100 m/s, at one place after 200 s; another one passes 30 km away."""
    lines = [
        "NAME, lat, lon, alt, vx, vy, vz, time",
        "[], [deg], [deg], [m], [m/s], [m/s], [m/s], [s]",
    ]
    for t in range(0, 301, 5):
        for name, north, speed in (("own", 50.0 * (t - 200), 50), ("one", -50.0 * (t - 200), -50)):
            lat, lon, _ = pymap3d.enu2geodetic(0.0, north, 0.0, -41.3, 174.2, 0.0)
            lines.append(f"{name}, {float(lat)!r}, {float(lon)!r}, 900, 0, {speed}, 0, {t}")
        lines.append(f"far, -41.3, 174.56, 900, 0, 1, 0, {t}")
    (tmp_path / "met.daa").write_text("\n".join(lines) + "\n")
    assert CliRunner().invoke(view, [str(tmp_path / "met.daa")]).exit_code == 0
    page, _ = opened_page(browser, tmp_path / "met.html")
    assert page.evaluate("Data.reach.near_m") == pytest.approx(120 * 100.0, rel=2e-3)
    page.close()


@pytest.mark.parametrize("width", [1280, 390])
def test_what_is_pressed_is_large_enough_for_a_finger(browser, tmp_path, width):
    """WCAG 2.2 AA, 2.5.8: 24 by 24 pixels; and nothing is wider than the page."""
    page, _ = opened_page(browser, shown(recorded(tmp_path, NEAR)), width)
    pressed = page.locator("button:visible, select:visible, input:visible").all()
    assert len(pressed) > 10
    for one in pressed:
        box = one.bounding_box()
        assert min(box["width"], box["height"]) >= 24, one.evaluate("e => e.outerHTML")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_the_report_of_a_study_is_no_wider_than_its_window(browser, study):
    """With all that is folded opened; tables wider than a telephone scroll by themselves."""
    assert call("report", study).exit_code == 0
    page, wrong = opened_page(browser, study / "report.html")
    page.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    wider = "[...document.querySelectorAll('.wide')].filter(e => e.scrollWidth > e.clientWidth)"
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(f"{wider}.length") > 0
    images = page.evaluate("[...document.images].map(one => one.getBoundingClientRect().right)")
    assert images and max(images) <= 390
    assert wrong == []
    page.close()


def test_two_runs_stand_beside_each_other_on_one_clock(browser, tmp_path):
    one = recorded(tmp_path, NEAR, "one")
    longer = NEAR.replace("duration_s = 6", "duration_s = 9").replace(
        "range_km = 15", "range_km = 4"
    )
    other = recorded(tmp_path, longer.replace("title = '''t'''", "title = '''<b>'''"), "other")
    page, wrong = opened_page(browser, shown(one, other), hash="#t=2.5")
    assert page.title() == page.locator("main h1").inner_text() == "one: t | other: <b>"
    left, right = (frame for frame in page.frames if frame.parent_frame)
    titles = [frame.locator("h1").inner_text() for frame in (left, right)]
    assert titles == ["one: t", "other: <b>"]

    def both(script):
        return [frame.evaluate(script) for frame in (left, right)]

    def come_to(script, *wanted):
        """What is done in one is told to the other, which takes its time."""
        wait_for(lambda: both(script) == list(wanted))

    come_to("App.state().t", 2.5, 2.5)
    # Keys are heard before anything was clicked; what is shown can be chosen above the footer.
    page.keyboard.press("Home")
    come_to("App.state().t", 0.0, 0.0)
    page.evaluate("document.activeElement.blur()")
    page.evaluate("window.focus()")
    page.keyboard.press("End")
    come_to("App.state().t", 9.0, 9.0)
    left.evaluate("App.seek(2.5)")
    come_to("App.state().t", 2.5, 2.5)
    bottoms = both(
        "[document.querySelector('#layers').getBoundingClientRect().bottom,"
        " document.querySelector('footer').getBoundingClientRect().top]"
    )
    assert all(layers <= footer for layers, footer in bottoms)
    counts = both("App.state().detections.length")
    assert counts[0] > counts[1]  # each shows its own run
    wait_for(lambda: len(set(both("Plan.view.perPixel"))) == 1)
    # What is done in one is done in both, from either side; time goes to the end of the longer.
    right.locator("#plan").focus()
    page.keyboard.press("End")
    come_to("App.state().t", 9.0, 9.0)
    before = both("Plan.view.perPixel")
    page.keyboard.press("+")
    wait_for(lambda: both("Plan.view.perPixel") == pytest.approx([before[0] / 1.4] * 2))
    page.keyboard.press("n")
    page.keyboard.press("d")
    come_to("App.options.headingUp", True, True)
    wait_for(lambda: len(set(both("document.documentElement.dataset.theme"))) == 1)
    left.select_option("#speed", "10")
    right.evaluate("App.seek(1)")
    come_to("App.state().t", 1.0, 1.0)
    right.locator("#plan").focus()
    page.keyboard.press(" ")
    wait_for(lambda: left.evaluate("App.state().t") > 2)
    page.keyboard.press(" ")
    come_to("App.state().playing", False, False)
    wait_for(lambda: len(set(both("App.state().t"))) == 1)
    assert left.evaluate("App.state().t") > 2
    right.evaluate("App.seek(3)")
    come_to("App.state().t", 3.0, 3.0)
    left.locator("#link").click()
    assert page.url.endswith("#t=3&up=heading")
    assert wrong == []
    page.close()


_ALTITUDE_WORDS = """([far_m]) => {
  const said = [], text = Canvas.text, state = Data.truths;
  const east = Data.ownship(1).east;
  Data.truths = () => [{ east: east + far_m, north: Data.ownship(1).north, alt: 900 }];
  Canvas.text = (c, words, x, y, colour, align = "left", ...rest) => {
    Canvas.font(c);
    const wide = c.measureText(words).width;
    const left = x - (align === "right" ? wide : align === "center" ? wide / 2 : 0);
    said.push([words, left, left + wide]);
    text(c, words, x, y, colour, align, ...rest);
  };
  Altitude.draw(1, { truth: true, sensors: new Set(), fade: 1, bands: false });
  [Canvas.text, Data.truths] = [text, state];
  return [document.getElementById("altitude").clientWidth, said];
}"""


def test_no_distance_on_the_altitudes_is_cut_off(browser, tmp_path):
    page, wrong = opened_page(browser, shown(recorded(tmp_path, NEAR)))
    for far_m in range(9000, 20000, 250):
        width, said = page.evaluate(_ALTITUDE_WORDS, [far_m])
        assert any("km" in words for words, *_ in said)
        assert all(left >= 0 and right <= width for _, left, right in said), (far_m, width, said)
    assert wrong == []
    page.close()


def test_three_runs_are_the_most(tmp_path):
    done = CliRunner().invoke(view, [str(tmp_path)] * 4)
    assert done.exit_code == 2 and "4 runs: at most 3 stand beside each other" in done.output
    assert list(tmp_path.iterdir()) == []
