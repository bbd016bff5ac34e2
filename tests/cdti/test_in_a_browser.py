"""Sessions in a real browser: what the operator sees, does, and what becomes of it.

Left out by name where Playwright's Python package, websockets or a Chromium is missing.
"""

import itertools
import math

import numpy as np
import pyarrow.parquet as pq
import pymap3d
import pytest

pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
pytest.importorskip("websockets", reason="needs the package websockets")
from live import TRACKS, Session
from screen import SETS, Screen, chromium

import dsa_des

browser = chromium

HOSTILE = "<script>alert(1)</script>"
#: What tells of a loss of separation here, m: half of the volume's radius of 4000 ft.
KEPT_M = 0.5 * 4000 * 0.3048


def closest_m(run):
    """Horizontal distance of the aircraft at its least, from the recorded truth, by pymap3d."""
    rows = pq.read_table(run / "truth.parquet").to_pylist()
    own = {row["time_s"]: row for row in rows if row["target"] is None}
    return min(
        math.hypot(*pymap3d.geodetic2enu(
            row["lat_deg"], row["lon_deg"], row["alt_m"],
            *(own[row["time_s"]][name] for name in ("lat_deg", "lon_deg", "alt_m")),
        )[:2])
        for row in rows if row["target"] is not None
    )  # fmt: skip


def above_own_ft(run, track, time_s):
    """How far a track was above the ownship, by the last of its rows before an instant.

    A window of the run ends before its end: a page that shows an instant has not heard what is sent
    at it, and shows nothing of what the run has computed since then.
    """
    rows = pq.read_table(run / "state_tracks.parquet").to_pylist()
    known = [row for row in rows if row["track"] == track - TRACKS and row["time_s"] < time_s]
    return (known[-1]["own_down_m"] - known[-1]["down_m"]) / 0.3048


@pytest.mark.parametrize(
    ("key", "judged", "arrow", "by_deg", "kept"),
    [("v", "verified", "ArrowRight", 60, True), ("x", "rejected", "ArrowLeft", -10, False)],
)
def test_a_session_is_decided_by_its_operator_and_replays(
    browser, tmp_path, monkeypatch, key, judged, arrow, by_deg, kept
):
    sets = (*SETS, "blocks.operator.turn_rate_deg_s=6", "blocks.guidance.level=9")
    session = Session(monkeypatch, tmp_path / "run", realtime="8", duration="50", sets=sets,
                      until=lambda picture: picture["contacts"])  # fmt: skip
    screen = Screen(browser, session)
    page = screen.page
    assert page.evaluate("document.activeElement.id") == "ready"
    page.keyboard.press("Enter")
    seen = screen.state()
    assert seen["lines"] and not seen["symbols"] and not seen["alerts"]
    assert seen["lines"][0]["bearing"] == pytest.approx(50.2, abs=3)
    session.go_on(until=lambda picture: picture["alerts"])
    seen = screen.state()
    alert = seen["alerts"][0]
    track, name = alert["target"], f"track {alert['target'] - TRACKS}"
    (symbol,) = [one for one in seen["symbols"] if one["number"] == track]
    seen_s = seen["t"]
    shape, word = {2: ("circle", "CORRECTIVE"), 3: ("square", "WARNING")}[alert["level"]]
    assert symbol["shape"] == shape and seen["sounds"] == 1
    assert page.locator("#banner").inner_text().startswith(f"{word} {name}: separation is lost")
    assert page.locator("#contacts li").first.inner_text().startswith(f"{word}, {name}, 2 o'clock")
    page.keyboard.press(key)
    answer = screen.taken(judged)
    page.select_option("#turn-by", str(abs(by_deg)))
    page.locator("#scope").focus()
    page.keyboard.press(arrow)
    turn = screen.taken("turn")
    assert answer["time"] <= turn["time"] and answer["target"] == track
    # What is rejected stays on screen, and says so.
    screen.state()
    said = page.locator("#banner").inner_text()
    assert name in said and ("(rejected)" in said) == (judged == "rejected")
    row = page.locator("#contacts li").first.inner_text()
    assert row.endswith("rejected") == (judged == "rejected")
    session.go_on(until=lambda p: abs((p["own"]["heading"] - by_deg + 180) % 360 - 180) < 0.5)
    heading = screen.state()["own"]["heading"]
    assert (heading - by_deg + 180) % 360 - 180 == pytest.approx(0, abs=0.5)
    session.go_on()
    seen = screen.when("App.state().over")
    assert seen["ended"] == "the scene has come to its end" and seen["waiting"] == 0
    screen.close()
    session.ended()
    rows = pq.read_table(session.out / "decisions.parquet").to_pylist()
    answers = [row for row in rows if row["decision"] != "shown"]  # an alert may come again
    assert rows[0]["decision"] == "shown"
    assert [row["decision"] for row in answers] == [judged, "turn"]
    assert math.degrees(answers[1]["turn_rad"]) == pytest.approx(by_deg) == turn["value"]
    assert rows[0]["time_s"] < answers[0]["time_s"] <= answers[1]["time_s"]
    assert (closest_m(session.out) > KEPT_M) == kept
    shown_ft = 100 * int(symbol["tag"].replace("−", "-"))
    assert shown_ft == pytest.approx(above_own_ft(session.out, track, seen_s), abs=50 + 1)
    dsa_des.run(dsa_des.load_scene(session.out / "scene.toml"), out=tmp_path / "again")
    for table in session.out.glob("*.parquet"):
        assert (tmp_path / "again" / table.name).read_bytes() == table.read_bytes(), table.name


@pytest.fixture(scope="module")
def alerted(browser, tmp_path_factory):
    """A page with an alert on it, for what only looks and clicks; the scene stands."""
    with pytest.MonkeyPatch.context() as patch:
        sets = (*SETS, "title='''a title & " + HOSTILE + "'''",
                f"blocks.traffic.intruders[0].name='{HOSTILE}'")  # fmt: skip
        out = tmp_path_factory.mktemp("alerted") / "run"
        session = Session(
            patch, out, realtime="8", duration="600", sets=sets, swaps=("tracker=tracking.stub",),
            until=lambda picture: picture["alerts"] and picture["bands"]["direction"],
        )  # fmt: skip
        screen = Screen(browser, session)
        screen.page.keyboard.press("Enter")
        screen.state()
        yield session, screen
        session.stop()
        screen.close()
        session.ended()


def test_bands_of_guidance_are_drawn(alerted):
    _, screen = alerted
    low, high, region = screen.state()["bands"]["direction"][0]
    assert region in ("FAR", "MID", "NEAR", "RECOVERY") and 0 <= low < high <= 360


def test_names_carry_no_markup(alerted):
    _, screen = alerted
    page = screen.page
    assert HOSTILE in page.locator("#contacts li").first.inner_text()
    assert page.locator("h1").inner_text() == f"a title & {HOSTILE}"
    assert page.locator("script").count() == 1


def test_another_browser_watches_and_cannot_decide(browser, alerted):
    session, _ = alerted
    screen = Screen(browser, session)
    assert screen.state()["role"] == "watcher"
    screen.when("App.state().t !== null")
    buttons = screen.page.locator("#decide button")
    assert [button.is_disabled() for button in buttons.all()] == [True] * 6
    screen.page.keyboard.press("ArrowRight")
    screen.page.evaluate("Link.decide({ decision: 'turn', target: -1, value: 20 })")
    screen.when("App.said.some(one => one.why === 'this page only watches')")
    screen.close()


def test_a_page_of_another_origin_gets_no_socket(browser, alerted):
    session, _ = alerted
    context = browser.new_context()
    page = context.new_page()
    page.goto("data:text/html,<p>hostile")
    answer = page.evaluate(
        "url => new Promise(done => { const s = new WebSocket(url);"
        " s.onopen = () => done('open'); s.onerror = () => done('refused'); })",
        f"ws://{session.authority}/socket?token={session.token}",
    )
    assert answer == "refused"
    context.close()


def test_everything_answers_to_the_keyboard(alerted):
    _, screen = alerted
    page = screen.page
    page.locator("#theme").focus()
    reached = []
    for _ in range(24):
        reached.append(page.evaluate("document.activeElement.id"))
        page.keyboard.press("Tab")
    wanted = (
        "theme units scope in out mute contacts verify reject turn-by left right climb-by up down"
    )
    assert [name for name in wanted.split() if name not in reached] == []
    page.locator("#scope").focus()
    theme = page.evaluate("document.documentElement.dataset.theme")
    page.keyboard.press("d")
    assert page.evaluate("document.documentElement.dataset.theme") != theme
    before = screen.state()["range"]
    page.keyboard.press("+")
    assert screen.when(f"App.state().range < {before}")["range"] < before
    page.keyboard.press("s")
    assert page.locator("#mute").get_attribute("aria-pressed") == "true"
    page.keyboard.press("n")
    assert screen.state()["chosen"] == 0
    for name in page.locator("button, select, canvas:not([aria-hidden]), ul").all():
        told = [name.get_attribute(f"aria-label{way}") for way in ("", "ledby")]
        assert any([*told, name.inner_text()]), name


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_words_and_symbols_stand_out_from_their_ground(alerted, theme):
    """WCAG 2.2 AA: 4.5 to 1 for text (1.4.3), 3 to 1 for symbols (1.4.11)."""
    _, screen = alerted
    page = screen.page
    page.evaluate("name => { document.documentElement.dataset.theme = name; }", theme)
    script = "n => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim()"
    colour = {
        name: luminance(page.evaluate(script, name))
        for name in ("ground", "panel", "ink", "faint", "caution", "warning", "eo", "ir", "radar",
                     "recovery", "traffic", "own", "symbol-caution", "symbol-warning", "on-caution",
                     "on-warning")
    }  # fmt: skip
    texts = ("ink", "faint", "caution", "warning", "eo", "ir", "radar", "traffic")
    for name, under in itertools.product(texts, ("ground", "panel")):
        assert ratio(colour[name], colour[under]) >= 4.5, (name, under)
    for name in ("own", "recovery", "symbol-caution", "symbol-warning"):
        assert ratio(colour[name], colour["ground"]) >= 3.0, name
    for level in ("caution", "warning"):
        assert ratio(colour[f"on-{level}"], colour[f"symbol-{level}"]) >= 3.0, level
    # A warning's arrowhead also for protanopes (Machado et al. 2009, severity 1).
    red, ink = (page.evaluate(script, name) for name in ("symbol-warning", "on-warning"))
    assert ratio(protan_luminance(red), protan_luminance(ink)) >= 3.0


def ratio(one, other):
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)


def linear(colour):
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]


def luminance(colour):
    return float(np.dot(linear(colour), (0.2126, 0.7152, 0.0722)))


PROTAN = np.array([
    [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998],
])  # fmt: skip


def protan_luminance(colour):
    return float(np.dot(np.clip(PROTAN @ linear(colour), 0, 1), (0.2126, 0.7152, 0.0722)))


def test_a_page_that_is_loaded_again_decides_still_and_lost_nothing(alerted):
    _, screen = alerted
    screen.page.locator("#scope").focus()
    screen.page.keyboard.press("ArrowUp")
    taken = screen.taken("climb")
    screen.page.reload()
    assert screen.when("App.state().role !== ''")["role"] == "operator"
    first = screen.page.locator("#log li").first
    assert first.inner_text() == f"{taken['time']:.2f} s: climb 1000 ft ({HOSTILE})"
