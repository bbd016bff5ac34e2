"""A Chromium for the tests of pages, which are left out by name where it is missing."""

import shutil

import pytest

from tests.support.waiting import WAIT_S


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("needs a Chromium: there is no program chromium")
    with sync_api.sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"],
                                                timeout=1000 * WAIT_S)  # fmt: skip
        yield launched
        launched.close()
