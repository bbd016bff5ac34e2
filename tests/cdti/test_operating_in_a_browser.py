"""What a person at the display reads and reaches: units, labels, tapes, buttons that stay.

Left out by name where Playwright's Python package, websockets or a Chromium is missing.
"""

import colorsys
import itertools

import pytest

pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
pytest.importorskip("websockets", reason="needs the package websockets")
from live import SCENE, Session
from screen import SETS, Screen, chromium

from components.examples import configs_folder

browser = chromium
FOOT, KNOT, MILE = 0.3048, 1852 / 3600, 1852
KINDS = "blocks.guidance.kinds=['direction', 'altitude', 'speed']"
LONG = "a name as long as those that people give to what they fly when nobody stops them"
#: Two side by side that stay before the ownship, so near that their labels would lie on each other
#: and alerts never end.
TWO = """
extends = "{session}"
[[blocks.traffic.intruders]]
name = "{long}"
extends = "{aircraft}"
east_m = 400
north_m = 800
up_m = 20
heading_deg = 0
speed_mps = 50
[[blocks.traffic.intruders]]
name = "beside"
extends = "{aircraft}"
east_m = 450
north_m = 850
up_m = 60
heading_deg = 0
speed_mps = 50
"""


@pytest.fixture(scope="module")
def operated(browser, tmp_path_factory):
    """A page with alerts on it; the scene stands but for what is decided."""
    with pytest.MonkeyPatch.context() as patch:
        place = tmp_path_factory.mktemp("operated")
        aircraft = configs_folder() / "aircraft" / "general_aviation_fitted.toml"
        (place / "two.toml").write_text(TWO.format(session=SCENE, long=LONG, aircraft=aircraft))
        sets = (
            *SETS[2:],
            KINDS,
            "blocks.operator.turn_rate_deg_s=0.1",
            "blocks.operator.vertical_rate_mps=0.3",
        )
        session = Session(
            patch, place / "run", scene=str(place / "two.toml"), realtime="2", duration="600",
            sets=sets, swaps=("tracker=tracking.stub",),
            until=lambda picture: picture["alerts"] and all(picture["bands"].values()),
        )  # fmt: skip
        screen = Screen(browser, session)
        screen.quiet = places(screen.page)
        screen.page.keyboard.press("Enter")
        screen.state()
        screen.resize(1280, 800)  # what was hidden at the width of a hand is drawn again
        yield screen
        session.stop()
        screen.close()
        session.ended()


#: Two pictures later all is drawn anew.
DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def places(page):
    """Where each button is, at the widths of a desk and of a hand."""
    found = {}
    for size in ((1280, 800), (390, 844)):
        page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
        page.evaluate(DRAWN)
        for one in page.locator("button:visible, select").all():
            name = one.get_attribute("id")
            if name != "ready":
                found[size[0], name] = tuple(one.bounding_box().values())
    page.set_viewport_size({"width": 1280, "height": 800})
    page.evaluate(DRAWN)
    return found


def overlaps(one, other):
    return (
        one["left"] < other["right"] and other["left"] < one["right"]
        and one["top"] < other["low"] and other["top"] < one["low"]
    )  # fmt: skip


def test_buttons_stay_where_they_are_whatever_is_said(operated):
    page = operated.page
    alerted = places(page)
    assert len(alerted) >= 2 * 13 and alerted == operated.quiet
    page.keyboard.press("u")
    page.locator("#scope").focus()
    page.keyboard.press("x")
    operated.when("App.said.some(one => one.decision === 'rejected')")
    assert places(page) == alerted
    operated.resize(1280, 800)
    page.keyboard.press("u")


def test_what_steers_is_within_reach_of_a_hand(operated):
    page = operated.page
    operated.resize(390, 664)  # what a telephone's browser leaves
    for name in ("verify", "reject", "left", "right", "up", "down"):
        box = page.locator(f"#{name}").bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
        assert box["y"] >= 0 and box["y"] + box["height"] <= 664
        assert box["height"] >= 24  # WCAG 2.2, 2.5.8
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 390
    operated.resize(1280, 800)


@pytest.mark.parametrize("width", [1280, 390])
def test_labels_lie_on_nothing_and_inside_the_display(operated, width):
    page = operated.page
    operated.resize(width, 800)
    seen = operated.when("App.state().symbols.length >= 2 && App.state().labels.length >= 3")
    boxes = page.evaluate("(({ clientWidth, clientHeight }) => [clientWidth, clientHeight])(scope)")
    for one in seen["labels"]:
        assert one["left"] >= 0 and one["right"] <= boxes[0]
        assert one["top"] >= 0 and one["low"] <= boxes[1]
    named = [one for one in seen["labels"] if one["words"]]
    assert not [pair for pair in itertools.combinations(named, 2) if overlaps(*pair)]
    for one in seen["symbols"]:  # nor in the frame of the contact that is chosen
        half = 15 if one["number"] == seen["chosen"] else 9
        box = {"left": one["x"] - half, "right": one["x"] + half, "top": one["y"] - half,
               "low": one["y"] + half}  # fmt: skip
        assert not [name for name in named if overlaps(name, box)]
    operated.resize(1280, 800)


def test_the_ownship_s_speed_height_and_climb_are_said_in_the_chosen_units(operated):
    page = operated.page

    def said():
        state = operated.state()
        numbers = {name: page.locator(f"#{name}").inner_text() for name in ("speed", "altitude")}
        return state, numbers, page.locator("#climb").inner_text()

    state, numbers, climb = said()
    own = state["own"]
    assert (int(numbers["speed"]), int(numbers["altitude"])) == (
        round(own["speed"] / KNOT), round(own["alt"] / FOOT),
    )  # fmt: skip
    assert int(climb) == pytest.approx(own["climb"] / FOOT * 60, abs=20)
    assert [page.locator(f"#{n}-unit").inner_text() for n in ("speed", "altitude", "climb")] == [
        "kt", "ft", "ft/min",
    ]  # fmt: skip
    assert page.locator("#climb-by option").all_inner_texts() == ["500 ft", "1000 ft", "1500 ft"]
    assert page.locator("#range").inner_text() == f"{state['range'] / MILE:g} nmi"
    page.keyboard.press("u")
    state, numbers, _ = said()
    assert int(numbers["altitude"]) == round(state["own"]["alt"])
    assert page.locator("#speed-unit").inner_text() == "m/s"
    assert page.locator("#range").inner_text() == f"{state['range'] / 1000:g} km"
    assert page.locator("#climb-by option").all_inner_texts() == ["150 m", "300 m", "450 m"]
    assert page.locator("#climb-by").input_value() == "300"
    assert " km, " in page.locator("#contacts li").first.inner_text()
    assert any(one["tag"].endswith(" m") for one in state["symbols"])
    page.keyboard.press("u")
    assert page.locator("#climb-by").input_value() == "304.8"


def test_north_is_36_and_rates_that_round_to_nothing_have_no_sign(operated):
    heading = "Units.heading"
    found = operated.page.evaluate(f"[0, 0.4, 359.6, 1, 216.7].map({heading})")
    assert found == ["360°", "360°", "360°", "001°", "217°"]
    assert operated.page.evaluate("[0.01, -0.01, 2.54, -2.54].map(Units.rate)") == [
        "0", "0", "+500", "−500",
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "kind"), [("altitude", "altitude"), ("speed", "speed")])
def test_a_tape_carries_its_bands_in_their_colours_where_they_are(operated, name, kind):
    """The colour of each band stands on the tape at the height of a value inside it."""
    half, numbers = {"altitude": (1000 * FOOT, "alt"), "speed": (50 * KNOT, "speed")}[kind]
    state = operated.state()
    own = state["own"][numbers]
    shown = [b for b in state["bands"][kind] if b[1] > own - half and b[0] < own + half]
    assert shown
    for low, high, region in shown:
        low, high = max(low, own - 0.95 * half), min(high, own + 0.95 * half)
        colour = {"FAR": "caution", "MID": "caution", "NEAR": "warning"}.get(region)
        variable = f"--symbol-{colour}" if colour else "--recovery"
        found = operated.page.evaluate(
            """([id, from, to, name]) => {
              const canvas = document.getElementById(id), copy = document.createElement('canvas');
              Object.assign(copy, { width: canvas.width, height: canvas.height });
              const c = copy.getContext('2d', { willReadFrequently: true });
              c.drawImage(canvas, 0, 0);
              const style = getComputedStyle(document.documentElement);
              const hex = style.getPropertyValue(name).trim();
              const want = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
              const top = Math.round(canvas.height * from);
              const high = Math.round(canvas.height * to) - top;
              const pixels = c.getImageData(0, top, canvas.width, Math.max(high, 1)).data;
              let count = 0;
              for (let i = 0; i < pixels.length; i += 4) {
                if (want.every((v, k) => Math.abs(v - pixels[i + k]) < 3)) count += 1;
              }
              return count / Math.max(high, 1);
            }""",
            [f"{name}-tape", 0.5 - (high - own) / half / 2, 0.5 - (low - own) / half / 2, variable],
        )
        assert found > 1.0, (low, high, region)  # some pixels wide over all its length


#: Keeps what the line of status says, which stands there for some seconds only.
STATUSES = """() => {
  const line = document.getElementById('status');
  window.statuses = [];
  new MutationObserver(() => window.statuses.push(line.textContent)).observe(
    line, { childList: true, characterData: true, subtree: true });
}"""


def test_a_command_that_replaces_another_says_so_and_is_on_compass_and_tape(operated):
    page = operated.page
    page.locator("#scope").focus()
    page.select_option("#turn-by", "60")
    page.keyboard.press("ArrowRight")
    first = operated.taken("turn")
    page.keyboard.press("ArrowUp")
    climb = operated.taken("climb")
    state = operated.when("App.state().wanted !== null")
    assert state["wanted"] == pytest.approx(climb["to"]) and climb["value"] == 304.8
    assert state["wanted"] > state["own"]["alt"] + 100
    flying = page.locator("#flying").inner_text()
    assert flying == (
        f"flying right to {round(first['to']) % 360:03d}°, climb to {round(climb['to'] / FOOT)} ft"
    )
    page.evaluate(STATUSES)
    page.keyboard.press("ArrowLeft")
    operated.when("App.said.filter(one => one.decision === 'turn').length === 2")
    replaced = f"turn 60° left replaces turn 60° right of {first['time']:.2f} s"
    operated.when(f"window.statuses.includes('{replaced}')")
    assert replaced.partition("left")[2] in page.locator("#log li").first.inner_text()
    assert "climb to" in page.locator("#flying").inner_text()


def test_an_alert_that_was_rejected_stays_with_its_contact(operated):
    page = operated.page
    state = operated.state()
    target, level = (state["alerts"][0][name] for name in ("target", "level"))
    sounds = state["sounds"]
    # Its alert goes and comes again, no more urgent, while the contact is there all the time.
    page.evaluate(
        """([target, level]) => {
          window.heard = Link.hears.frame;
          window.frame = { t: 1e4, lag: 0, own: { heading: 0, alt: 900, speed: 50, climb: 0 },
            area: [], bands: { direction: [], altitude: [], speed: [] }, camera: null, told: true,
            out: [], contacts: [[target, 900, 900, 0, 45, 0, null, null, null, level]] };
          window.alert_ = { target, level, since: 1e4, at: 1e4, to_loss: 20, closest: 100 };
          window.show = (alerts) => {
            window.heard({ ...window.frame, alerts }); return App.state().alerts; };
          Link.hears.frame = ({ frame }) => Link.send({ type: 'drawn', frame });
          Link.hears.taken({ decision: 'rejected', target, level, time: 1, value: 0 });
        }""",
        [target, level],
    )
    (one,) = page.evaluate("show([alert_])")
    assert one["rejected"] and "(rejected)" in page.locator("#banner").inner_text()
    assert page.evaluate("show([])") == []
    (again,) = page.evaluate("show([alert_])")
    assert again["rejected"] and page.evaluate("App.state().sounds") == sounds
    # A new alert on another contact is chosen, and a more urgent one after it.
    slight, urgent = (f"{{ ...alert_, target: {4242 + n}, level: {n} }}" for n in (1, 3))
    assert page.evaluate(f"(show([{slight}]), App.state().chosen)") == 4243
    assert page.evaluate(f"(show([{urgent}, {slight}]), App.state().chosen)") == 4245
    assert page.evaluate(f"(show([{slight}]), App.state().chosen)") == 4243
    (worse,) = page.evaluate("show([{ ...alert_, level: alert_.level + 1 }])")
    assert not worse["rejected"]
    page.evaluate("() => { Link.hears.frame = window.heard; }")
    operated.session.go_on(until=lambda picture: True)  # sends the picture once more
    operated.state()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_green_stands_for_one_thing(operated, theme):
    page = operated.page
    chosen = page.evaluate("document.documentElement.dataset.theme")
    dress = "name => { document.documentElement.dataset.theme = name; }"
    page.evaluate(dress, theme)
    script = "n => getComputedStyle(document.documentElement).getPropertyValue('--' + n).trim()"
    names = ("own", "traffic", "eo", "ir", "radar", "recovery", "caution", "warning",
             "symbol-caution", "symbol-warning", "ink", "faint", "line")  # fmt: skip
    green, colours = [], {name: page.evaluate(script, name) for name in names}
    page.evaluate(dress, chosen)  # others compare what is painted with it
    for name, colour in colours.items():
        red_green_blue = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        hue, _, strength = colorsys.rgb_to_hsv(*red_green_blue)
        if strength > 0.2 and 70 <= 360 * hue <= 170:
            green.append(name)
    assert green == ["recovery"]


def test_an_alert_chosen_by_itself_is_looked_at_when_somebody_picks_it(operated):
    page = operated.page
    state = operated.when("App.state().alerts.some(one => one.target === App.state().chosen)")
    page.locator("#contacts li[aria-selected='true']").click()
    operated.when("App.said.some(one => one.decision === 'looked')")
    said = page.evaluate("App.said")
    looked = next(one for one in said if one.get("decision") == "looked")
    assert looked["target"] == state["chosen"] == operated.state()["chosen"]
    page.locator("#contacts li[aria-selected='true']").click()  # not once more
    page.keyboard.press("v")
    operated.when("App.said.some(one => one.decision === 'verified')")
    said = [one.get("decision") for one in page.evaluate("App.said")]
    assert said.count("looked") == 1


def test_a_legend_names_every_line_and_key(operated):
    page = operated.page
    assert not page.locator("#legend-list").is_visible()
    page.locator("#scope").focus()
    page.keyboard.press("l")
    rows = page.locator("#legend-list li").all_inner_texts()
    for word in ("ownship", "warning", "loss area", "recovery", "commanded", "radar", "eo"):
        assert any(word in row for row in rows), word
    assert {"V", "X", "U", "L"} <= set(page.locator("#legend kbd").all_inner_texts())
    page.keyboard.press("l")
    assert not page.locator("#legend-list").is_visible()


def test_a_display_begins_in_the_units_of_its_command(browser, tmp_path, monkeypatch):
    session = Session(
        monkeypatch, tmp_path / "run", realtime="8", duration="2", sets=SETS, units="metric"
    )
    screen = Screen(browser, session)
    assert screen.page.locator("#units").inner_text() == "km, m, m/s"
    screen.page.locator("#units").click()
    assert screen.page.locator("#units").inner_text() == "nmi, ft, kt"
    screen.page.reload()  # what somebody chose stays
    screen.when("App.state().role !== ''")
    assert screen.page.locator("#units").inner_text() == "nmi, ft, kt"
    screen.page.locator("#ready").click()
    screen.when("App.state().over")
    screen.close()
    session.ended()
