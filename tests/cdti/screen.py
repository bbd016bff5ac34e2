"""The display in a Chromium; tests that need one are left out by name where it is missing."""

import json
import shutil

import pytest

from tests.support.waiting import WAIT_S, wait_for

sync_api = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
if CHROMIUM is None:
    pytest.skip("needs a Chromium: there is no program chromium", allow_module_level=True)

#: The intruder is in sight of the camera at once, of the radar after 6 s; a warning follows at 7 s.
SETS = (
    "blocks.traffic.intruders[0].east_m=3000", "blocks.traffic.intruders[0].north_m=2500",
    "blocks.radar.range_km=3.5", "blocks.eo.scan_rate_hz=5", "blocks.eo.threshold=0.3",
    "record.truth=true",
    "blocks.radar.false_alarm_probability=1e-6",
)  # fmt: skip


@pytest.fixture(scope="module")
def chromium():
    with sync_api.sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox"],
            timeout=1000 * WAIT_S,
        )
        yield launched
        launched.close()


class Screen:
    """A page of the display in the browser; it must have nothing to complain of."""

    def __init__(self, browser, session, **context):
        self.session = session
        self.context = browser.new_context(
            **{"viewport": {"width": 1280, "height": 800}, **context}
        )
        self.context.set_default_timeout(1000 * WAIT_S)
        self.page = self.context.new_page()
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(session.address)
        self.when("App.state().role !== ''")

    def resize(self, width, height):
        """Give it another size, and wait until all is drawn as large as it is shown."""
        self.page.set_viewport_size({"width": width, "height": height})
        self.when(
            f"innerWidth === {width} && innerHeight === {height} && App.state() &&"
            " [...document.querySelectorAll('canvas')].every((one) => !one.clientWidth ||"
            " one.width === Math.round(one.clientWidth * devicePixelRatio))"
        )

    def state(self):
        """What it shows once the scene stands: nothing of it changes until that goes on."""

        def settled():
            shown = self.page.evaluate("App.state()")
            stands = shown["t"] == round(self.session.stands(), 4)
            return stands and not shown["waiting"] and shown

        return wait_for(settled)

    def when(self, what):
        """What it shows when something is so: as it was then, not as it is a moment later."""
        met = self.page.wait_for_function(f"() => ({what}) && JSON.stringify(App.state())")
        return json.loads(met.json_value())

    def taken(self, decision):
        found = "App.said.find(one => one.type === 'taken' && one.decision === '{}')"
        met = self.page.wait_for_function(f"() => JSON.stringify({found.format(decision)})")
        return json.loads(met.json_value())

    def close(self):
        assert self.said == [], self.said
        assert [url for url in self.asked if self.session.authority not in url] == []
        self.context.close()
