"""The display in a Chromium; tests that need one are left out by name where it is missing."""

import shutil

import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
if CHROMIUM is None:
    pytest.skip("needs a Chromium: there is no program chromium", allow_module_level=True)

#: The intruder is in sight of the camera at once, of the radar after 6 s; a warning follows at 7 s.
SETS = (
    "blocks.traffic.intruders[0].east_m=3000", "blocks.traffic.intruders[0].north_m=2500",
    "blocks.radar.range_km=3.5", "blocks.eo.scan_rate_hz=5", "record.truth=true",
    "blocks.radar.false_alarm_probability=1e-6",
)  # fmt: skip


@pytest.fixture(scope="module")
def chromium():
    with sync_api.sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield launched
        launched.close()


class Screen:
    """A page of the display in the browser; it must have nothing to complain of."""

    def __init__(self, browser, address, **context):
        self.context = browser.new_context(
            **{"viewport": {"width": 1280, "height": 800}, **context}
        )
        self.page = self.context.new_page()
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address)
        self.when("App.state().role !== ''")

    def state(self):
        return self.page.evaluate("App.state()")

    def when(self, what, timeout=90_000):
        self.page.wait_for_function(f"() => ({what})", timeout=timeout)
        return self.state()

    def taken(self, decision):
        self.when(f"App.said.some(one => one.type === 'taken' && one.decision === '{decision}')")
        said = self.page.evaluate("App.said")
        return next(one for one in said if one.get("decision") == decision)

    def close(self, authority):
        assert self.said == [], self.said
        assert [url for url in self.asked if authority not in url] == []
        self.context.close()
