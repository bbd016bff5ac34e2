"""The pictures of the operator's display, from the shipped session in a Chromium.

``python -m docs.make.pictures.display docs/images`` makes them; it needs the extra ``view``, the
package playwright and a Chromium. When a page draws is chance: no two pictures are the same.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dsa_des.terminal.interruption import exit_plainly_on_signal

_SESSION = Path(__file__).parents[3] / "configs" / "operator" / "session.toml"


def pictures(folder: Path) -> None:
    """Write ``cdti.png``, an alert on a desk, and ``cdti_narrow.png``, what is flown, in a hand."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with TemporaryDirectory() as place, sync_playwright() as playwright:
        words = [str(_SESSION), "--out", f"{place}/run", "--no-figures", "--realtime", "1"]
        command = [sys.executable, "-m", "dsa_des", "cdti", *words]
        session = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert session.stdout is not None
        address = re.findall(r"http\S+", session.stdout.readline())[0]
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        try:
            page.goto(address)
            page.locator("#ready").click()
            _shoot(page, "App.state().camera && App.state().area > 30", folder / "cdti.png")
            page.locator("#verify").click()
            page.locator("#right").click()
            page.locator("#up").click()
            page.set_viewport_size({"width": 390, "height": 844})
            page.emulate_media(color_scheme="dark")
            turns = "App.state().own.heading > 10 && App.state().own.heading < 350"
            _shoot(page, turns, folder / "cdti_narrow.png")
        finally:
            browser.close()
            session.terminate()
            session.communicate(timeout=60)


def _shoot(page: Any, when: str, path: Path) -> None:
    page.wait_for_function(f"() => ({when})", timeout=120_000)
    page.evaluate("document.activeElement.blur()")
    page.wait_for_timeout(300)
    page.screenshot(path=str(path))


if __name__ == "__main__":
    with exit_plainly_on_signal():
        pictures(Path(sys.argv[1]))
