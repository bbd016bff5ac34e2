"""The operator's browser is killed: the run waits for another, and keeps what was decided.

Left out by name where Playwright's Python package, websockets or a Chromium is missing.
"""

import math
import os
import shutil
import signal
import subprocess
from contextlib import contextmanager

import pyarrow.parquet as pq
import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
pytest.importorskip("websockets", reason="needs the package websockets")
from live import Session, hear, page, say  # noqa: E402

import dsa_des  # noqa: E402
from components.cdti import control  # noqa: E402
from tests.support.waiting import WAIT_S, wait_for  # noqa: E402

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
if CHROMIUM is None:
    pytest.skip("needs a Chromium: there is no program chromium", allow_module_level=True)


@contextmanager
def chromium(folder):
    """A browser with processes of its own, and the address at which it takes orders."""
    process = subprocess.Popen(
        [CHROMIUM, "--headless=new", "--no-sandbox", "--remote-debugging-port=0",
         f"--user-data-dir={folder}", "about:blank"],
        start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    said = folder / "DevToolsActivePort"
    try:
        # It writes the port before its own path, in two lines.
        port, _ = wait_for(lambda: said.exists() and len(f := said.read_text().split()) == 2 and f)
        yield process, f"http://127.0.0.1:{port}"
    finally:
        kill(process)


def kill(process):
    """End it and all it has started, without a word."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(WAIT_S)


def test_a_browser_that_is_killed_leaves_a_run_that_another_goes_on_with(tmp_path, monkeypatch):
    monkeypatch.setattr(control, "GONE_S", 0.2)
    sets = ("blocks.operator.unattended='pauses'", "record.truth=true")
    session = Session(monkeypatch, tmp_path / "run", realtime="8", duration="8", sets=sets,
                      until=lambda picture: picture["t"] > 1.0)  # fmt: skip
    with chromium(tmp_path / "profile") as (process, orders), sync_api.sync_playwright() as play:
        browser = play.chromium.connect_over_cdp(orders, timeout=1000 * WAIT_S)
        screen = browser.contexts[0].new_page()
        screen.set_default_timeout(1000 * WAIT_S)
        screen.goto(session.address)
        screen.wait_for_function("() => App.state().role === 'operator'")
        with session.socket() as watcher:
            screen.keyboard.press("Enter")
            stood = session.stands()
            screen.select_option("#turn-by", "30")
            screen.locator("#scope").focus()
            screen.keyboard.press("ArrowLeft")
            taken = hear(watcher, "taken")
            kill(process)
            last = wait_for(lambda: (f := hear(watcher, "frame"))["operators"] == 0 and f)
            session.go_on()
            # The step that the run is in when its last operator goes is still taken.
            stands_s = hear_until_it_stands(watcher, last["t"])
            assert last["t"] <= stands_s <= last["t"] + 0.2
            token = session.new_address().partition("token=")[2]
    assert stood <= taken["time"] <= stands_s < 2.0
    session.go_on(until=lambda picture: True)  # but for what the other decides
    with page(session, token=token) as (socket, welcome):
        assert welcome["role"] == "operator"
        assert [one["id"] for one in welcome["log"]] == [taken["id"]]
        say(socket, type="decide", decision="climb", target=-1, value=50, id="c" * 16)
        climbed = hear(socket, "taken")
        assert stands_s <= climbed["time"] < stands_s + 1.0
        session.go_on()
        hear(socket, "end")
    session.ended()
    rows = pq.read_table(session.out / "decisions.parquet").to_pylist()
    assert [(row["decision"], row["time_s"]) for row in rows] == [
        ("turn", taken["time"]), ("climb", climbed["time"])
    ]  # fmt: skip
    assert rows[0]["turn_rad"] == pytest.approx(math.radians(-30))
    again = dsa_des.run(dsa_des.load_scene(session.out / "scene.toml"))
    for name in ("truth", "decisions", "manoeuvres"):
        assert again[name].equals(pq.read_table(session.out / f"{name}.parquet")), name


def hear_until_it_stands(watcher, time_s):
    """The last instant of which a picture comes, a second before which none came."""
    while True:
        try:
            time_s = hear(watcher, "frame", timeout=1.0)["t"]
        except TimeoutError:
            return time_s
