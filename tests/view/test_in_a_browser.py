"""The page in a real browser: what is on screen is what was recorded."""

import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner

import dsa_des
from components.examples import configs_folder
from components.view.command import view
from tests.support.waiting import WAIT_S
from tests.view.test_page import SCENE, luminance

FADE_S = 4.0
PLACE = ("lat_deg", "lon_deg", "alt_m")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    out = tmp_path_factory.mktemp("watched") / "run"
    scene = dsa_des.load_scene(configs_folder() / "alerting" / "first_light.toml")
    dsa_des.run(scene, out=out)
    done = CliRunner().invoke(view, [str(out)], catch_exceptions=False)
    assert done.exit_code == 0
    return out


@pytest.fixture
def page(browser, recorded):
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    opened = context.new_page()
    said, asked = [], []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda request: asked.append(request.url))
    opened.goto(f"file://{recorded}.html")
    yield opened
    assert said == []
    assert [url for url in asked if not url.startswith("file://")] == []
    context.close()


def rows(recorded, table, start_s, end_s):
    found = pq.read_table(recorded / f"{table}.parquet").to_pylist()
    return [row for row in found if start_s < row["time_s"] <= end_s]


@pytest.mark.parametrize("time_s", [0.05, 61.3, 96.1])
def test_what_is_on_screen_is_what_was_recorded(page, recorded, time_s):
    page.evaluate("t => App.seek(t)", time_s)
    shown = page.evaluate("App.state()")
    wanted = rows(recorded, "detections", time_s - FADE_S, time_s)
    assert [(d["sensor"], d["target"], d["time_s"]) for d in shown["detections"]] == [
        (row["block"], row["target"], row["time_s"]) for row in wanted
    ]
    ranged = [row["range_m"] is not None for row in wanted]
    assert [d["ranged"] for d in shown["detections"]] == ranged
    own = shown["own"]
    for d, row in zip(shown["detections"], wanted, strict=True):
        if row["time_s"] == time_s and d["ranged"]:
            away = np.hypot(d["east_m"] - own["east"], d["north_m"] - own["north"])
            assert away == pytest.approx(row["range_m"] * np.cos(row["elevation_rad"]), rel=2e-3)
    last = max((row["time_s"] for row in rows(recorded, "tracks", -1, time_s)), default=None)
    tracks = [] if last is None else rows(recorded, "tracks", last - 1e-9, last)
    assert [t["label"] for t in shown["tracks"]] == [row["target"] for row in tracks]
    alerts = rows(recorded, "alerts", time_s - 1, time_s)
    assert {a["target"]: a["level"] for a in shown["alerts"]} == {
        row["target"]: row["level"] for row in alerts if row["level"] > 0
    }


def test_the_first_view_holds_an_aircraft(page):
    def nearest():
        shown = page.evaluate("App.state()")
        own, others = shown["own"], shown["truth"]
        return shown["t"], min(
            np.hypot(o["east"] - own["east"], o["north"] - own["north"]) for o in others
        )

    far = page.evaluate("Data.reach.near_m")
    t, away = nearest()
    assert 0 < t < 120 and away <= far
    page.evaluate("App.seek(App.first_s - 1)")
    assert nearest()[1] > far
    page.keyboard.press("Home")
    assert page.evaluate("App.state().t") == 0


def test_steps_go_from_scan_to_scan_of_a_sensor(page, recorded):
    page.select_option("#steps", label="ir")
    times = [r["time_s"] for r in rows(recorded, "scans", 50, 53) if r["block"] == "ir"]
    page.evaluate("App.seek(50)")
    for time_s in times:
        page.keyboard.press("ArrowRight")
        assert page.evaluate("App.state().t") == time_s
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("App.state().t") == times[-2]


def test_it_plays_at_a_speed_and_pauses(page):
    page.select_option("#speed", "10")
    page.keyboard.press("Escape")
    page.locator("#plan").focus()
    page.keyboard.press("Home")
    page.keyboard.press(" ")
    # A function: the page's policy lets nobody evaluate a text, and a text is asked for again.
    page.wait_for_function("() => App.state().t > 2 && App.state().playing", timeout=1000 * WAIT_S)
    page.keyboard.press(" ")
    stopped = page.evaluate("App.state().t")
    page.wait_for_timeout(120)
    assert page.evaluate("App.state().t") == stopped


def test_on_a_narrow_screen_the_buttons_cover_no_aircraft(page):
    page.set_viewport_size({"width": 390, "height": 844})
    tools, plan = (page.locator(name).bounding_box() for name in ("#plan-tools", "#plan"))
    assert tools["y"] + tools["height"] <= plan["y"]
    assert plan["height"] > 200


def test_a_link_opens_at_its_instant(page, recorded, browser):
    page.evaluate("App.seek(96.1)")
    page.locator("#up").click()
    page.locator("#link").click()
    assert page.url.endswith("#t=96.1&up=heading")
    other = browser.new_context().new_page()
    other.goto(page.url)
    assert other.evaluate("App.state().t") == 96.1
    assert other.evaluate("App.options.headingUp")
    other.context.close()


def test_the_table_counts_what_was_seen_so_far(page, recorded):
    page.evaluate("App.seek(70)")
    page.evaluate("App.state()")
    cells = page.locator("#seen tbody tr").nth(0).locator("th, td").all_inner_texts()
    names = page.locator("#seen thead th").all_inner_texts()
    counted = [
        sum(
            r["block"] == name and r["target"] == cells[0]
            for r in rows(recorded, "detections", -1, 70)
        )
        for name in names[1:]
    ]
    assert [0 if text == "–" else int(text) for text in cells[1:]] == counted


def test_everything_answers_to_the_keyboard(page):
    page.locator("#plan").focus()
    page.keyboard.press("n")
    assert page.evaluate("App.options.headingUp")
    page.keyboard.press("f")
    assert page.locator("#follow").get_attribute("aria-pressed") == "false"
    page.keyboard.press("End")
    assert page.evaluate("App.state().t") == 120
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.keyboard.press("d")
    assert page.evaluate("document.documentElement.dataset.theme") != theme


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_stand_out_from_their_ground(browser, recorded, scheme):
    """The contrast of WCAG 2.2 AA: 4.5 to 1 for text."""
    context = browser.new_context(color_scheme=scheme)
    opened = context.new_page()
    opened.goto(f"file://{recorded}.html")
    names = ("ink", "faint", "level1", "level2", "level3")
    names += ("track", "track2", "track3", "track4")
    script = "n => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim()"
    ground, panel = (luminance(opened.evaluate(script, name)) for name in ("ground", "panel"))
    for name in names:
        mine = luminance(opened.evaluate(script, name))
        for under in (ground, panel):
            light, dark = max(mine, under), min(mine, under)
            assert (light + 0.05) / (dark + 0.05) >= 4.5, name
    context.close()


def test_each_tracker_is_shown_in_its_colour_and_by_itself(browser, tmp_path):
    scene = dsa_des.load_scene(
        configs_folder() / "tracking" / "architectures.toml", sets=["duration_s=8"]
    )
    dsa_des.run(scene, out=tmp_path / "run")
    assert CliRunner().invoke(view, [str(tmp_path / "run")]).exit_code == 0
    opened = browser.new_page()
    opened.goto(f"file://{tmp_path / 'run.html'}")
    trackers = sorted({row["block"] for row in rows(tmp_path / "run", "state_tracks", -1, 99)})
    assert len(trackers) > 1
    opened.evaluate("App.seek(7)")

    def shown():
        return {one["label"].split()[0] for one in opened.evaluate("App.state().tracks")}

    assert shown() == set(trackers)
    colours = [opened.evaluate("n => Symbols.tracker(n)", k) for k in range(len(trackers[:4]))]
    assert len(set(colours)) == len(colours)
    opened.get_by_label(trackers[0], exact=True).uncheck()
    assert shown() == set(trackers[1:])
    opened.close()


def test_the_beam_looks_at_a_target_when_it_lights_it(browser, tmp_path):
    scene = tmp_path / "scene.toml"
    swept = "scan_rate_hz = 2\nbeam_sweep = true\nazimuth_deg = [-100, 120]"
    text = SCENE.format(title="t", name="n").replace("scan_rate_hz = 2", swept)
    scene.write_text(text)
    dsa_des.run(dsa_des.load_scene(scene), out=tmp_path / "run")
    assert CliRunner().invoke(view, [str(tmp_path / "run")]).exit_code == 0
    opened = browser.new_page()
    opened.goto(f"file://{tmp_path / 'run.html'}")
    found = [r for r in rows(tmp_path / "run", "detections", -1, 99) if r["block"] == "radar"]
    for row in found[:4]:
        opened.evaluate("t => App.seek(t)", row["illuminated_s"])
        (beam,) = opened.evaluate("App.state().beams")
        assert beam["azimuth_deg"] == pytest.approx(np.degrees(row["azimuth_rad"]), abs=1.5)
    opened.close()


def test_the_page_of_several_shows_what_each_has_through_its_eyes(browser, tmp_path):
    """Fields of view stand at what carries the sensors; chosen in the browser, one has the page."""
    scene = dsa_des.load_scene(
        configs_folder() / "platforms" / "one_is_blind.toml", sets=["duration_s=20"]
    )
    dsa_des.run(scene, out=tmp_path / "run")
    assert CliRunner().invoke(view, [str(tmp_path / "run")]).exit_code == 0
    opened, wrong = browser.new_page(), []
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.goto(f"file://{tmp_path / 'run.html'}#t=10")
    truth = {row["target"]: row for row in rows(tmp_path / "run", "truth", 9.999, 10)}
    place = "Data.carrier(Data.sensors.find((one) => one.name === 'radar_b'), 10)"

    def there():
        found = opened.evaluate(place)
        return found["east"], found["north"], found["alt"]

    east, north, _ = pymap3d.geodetic2enu(*(truth["other"][name] for name in PLACE), 52.0, 4.4, 0.0)
    assert there() == pytest.approx((east, north, truth["other"]["alt_m"]), abs=5.0)
    own = opened.evaluate("Data.ownship(10)")
    assert {d["sensor"] for d in opened.evaluate("App.state()")["detections"]} == {"radar"}
    opened.select_option("#eyes", label="other")
    opened.wait_for_function("() => window.App && Data.eyes === 'other'", timeout=1000 * WAIT_S)
    assert opened.url.endswith("#t=10&eyes=other")
    assert (opened.evaluate("App.state().t"), opened.evaluate("Data.targets")) == (10, ["ownship"])
    assert there() == pytest.approx((east, north, truth["other"]["alt_m"]), abs=5.0)
    seen = opened.evaluate("App.state()")
    assert seen["own"]["east"] == pytest.approx(east, abs=5.0)
    assert (seen["truth"][0]["east"], seen["truth"][0]["north"]) == pytest.approx(
        (own["east"], own["north"]), abs=5.0
    )
    opened.select_option("#eyes", label="all")
    opened.wait_for_function("() => window.App && Data.eyes === null", timeout=1000 * WAIT_S)
    assert wrong == []
    opened.close()
