"""What the display costs, measured: run by hand, on a machine that does nothing else.

python tests/cdti/measure.py round-trips --count 20
python tests/cdti/measure.py targets --count 1000 --duration 30
python tests/cdti/measure.py frames --count 1000
python tests/cdti/measure.py fuzz --count 10000
"""

import argparse
import json
import random
import re
import shutil
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))

SESSION = Path(__file__).parents[2] / "configs" / "operator" / "session.toml"
#: What the wire from the console to the ownship takes: the latency that the scene states, s.
STATED_S = 0.1
MANY = """
extends = "{session}"
title = "Many targets"
wires = [
  "traffic -> transform -> gate", "gate -> radar", "gate -> eo", "radar -> fusion", "eo -> fusion",
  "fusion -> tracker -> alerting", "traffic -> alerting -> operator",
  {{ from = "operator", to = "traffic", delay_s = 0.1, holds = "nothing" }},
]
[blocks]
remove = ["guidance"]
[record]
truth = false
[blocks.traffic]
type = "traffic.random"
intruders = {count}
radius_km = 15
"""


@contextmanager
def session(scene, *words):
    """A session in a process of its own: its address, and its folder."""
    with TemporaryDirectory() as place:
        out = Path(place) / "run"
        command = [sys.executable, "-m", "dsa_des", "cdti", str(scene), "--out", str(out), *words]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        address = re.findall(r"http\S+", process.stdout.readline())[0]
        try:
            yield address, out, process
        finally:
            if process.poll() is None:
                process.terminate()
            print(process.communicate(timeout=60)[0].splitlines()[-1])


@contextmanager
def browser_page(address):
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.wait_for_function("() => window.App")
        yield page
        browser.close()


def round_trips(count, **_):
    """From a key to the first picture in which the ownship turns."""
    words = ("--set", "blocks.operator.turn_rate_deg_s=10", "--duration", "600")
    with session(SESSION, *words) as (address, _, _), browser_page(address) as page:
        page.wait_for_function("() => document.activeElement.id === 'ready'")
        page.keyboard.press("Enter")
        page.wait_for_function("() => App.state().t > 1")
        page.select_option("#turn-by", "10")
        page.locator("#scope").focus()
        draw = random.Random(1)
        for number in range(count):
            page.wait_for_timeout(2000 + 300 * draw.random())
            page.keyboard.press("ArrowRight" if number % 2 else "ArrowLeft")
            page.wait_for_function(f"() => App.trips.length > {number}")
        trips = page.evaluate("App.trips")
    beside = sorted(trip - 1000 * STATED_S for trip in trips)
    print(
        f"{count} turns: median {statistics.median(beside):.0f} ms beside the stated "
        f"{1000 * STATED_S:.0f} ms; least {beside[0]:.0f}, most {beside[-1]:.0f} ms"
    )


@contextmanager
def many(count, **_):
    with TemporaryDirectory() as place:
        scene = Path(place) / "many.toml"
        scene.write_text(MANY.format(session=SESSION, count=count))
        yield scene


def targets(count, duration, **_):
    """Whether the run keeps up with the clock, with a browser that watches."""
    with (
        many(count) as scene,
        session(scene, "--no-wait", "--duration", str(duration)) as (address, out, process),
        browser_page(address) as page,
    ):
        page.wait_for_function("() => App.state().over", timeout=1000 * (duration + 60))
        timing = page.evaluate("App.timing()")
        process.wait(60)
        timings = json.loads((out / "run.json").read_text())["timings"]
    print(f"{count} targets: {timings['realtime']}, {timings['cpu_s'] / duration:.2f} CPU s per s")
    print(f"{timing['count']} pictures, {timing['mean_ms']:.2f} ms each in the page")


def frames(count, **_):
    """How long the page of ``dsa-des view`` draws a picture with so many targets."""
    import dsa_des
    from components.view.run_picture import make_view

    with many(count) as scene, TemporaryDirectory() as place:
        swap = ["operator=operator.recorded"]
        table = Path(place) / "none.csv"
        table.write_text("time_s,decision\n")
        sets = [f"blocks.operator.decisions={table}", "record.truth=true",
                "blocks.eo.scan_rate_hz=2"]  # fmt: skip
        loaded = dsa_des.load_scene(scene, sets=sets, swaps=swap, duration_s=20)
        dsa_des.run(loaded, out=Path(place) / "run")
        make_view(str(Path(place) / "run"), None)
        size = (Path(place) / "run.html").stat().st_size
        with browser_page(f"file://{place}/run.html") as page:
            page.select_option("#speed", "1")
            page.evaluate("App.play(true)")
            before, began = page.evaluate("App.timing().count"), time.monotonic()
            page.wait_for_timeout(8000)
            after, spent = page.evaluate("App.timing()"), time.monotonic() - began
    shown = after["count"] - before
    print(
        f"{count} targets, page of {size / 1e6:.1f} MB: {shown / spent:.0f} pictures/s, "
        f"{after['mean_ms']:.1f} ms of drawing each"
    )


def fuzz(count, **_):
    """Messages that are none, from the operator itself and from strangers: nothing changes."""
    from test_session import fuzz as nonsense
    from websockets.sync.client import connect

    draw = random.Random(1)
    with session(SESSION, "--no-wait", "--duration", "600") as (address, out, process):
        authority, token = address.split("/")[2], address.partition("token=")[2]
        url = f"ws://{authority}/socket?token={token}"
        refused = sent = 0
        with connect(url, origin=f"http://{authority}") as socket:
            while sent < count:
                part = min(100, count - sent)
                for number in range(part):
                    socket.send(nonsense(draw, sent + number))
                sent += part
                while part:
                    part -= json.loads(socket.recv(timeout=30))["type"] == "refused"
                    refused += 1
        process.terminate()
        process.wait(60)
        import pyarrow.parquet as pq

        rows = pq.read_table(out / "decisions.parquet").num_rows
    print(f"{sent} messages sent, all refused; {rows} decisions recorded")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    kinds = {"round-trips": round_trips, "targets": targets, "frames": frames, "fuzz": fuzz}
    parser.add_argument("what", choices=kinds)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--duration", type=float, default=30.0)
    given = vars(parser.parse_args())
    kinds[given.pop("what")](**given)
