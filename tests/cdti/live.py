"""A session in a thread of this process, and what its pages say to it."""

import json
import re
import threading
import time
from contextlib import contextmanager

from websockets.sync.client import connect

from components.cdti import control as control_module
from components.cdti import session as session_module
from components.examples import folder

#: Of the session's tracker, whose first track is that of the intruder's direction.
TRACKS = 1_000_000
SCENE = str(folder() / "operator" / "session.toml")
#: Begun when the camera already sees the intruder, and without what no test looks at.
LATER = (
    "blocks.traffic.intruders[0].east_m=4200", "blocks.traffic.intruders[0].north_m=3500",
    "record.truth=true", "blocks.radar.false_alarm_probability=1e-6", "blocks.radar.range_km=5",
    "blocks.guidance.level=9",
)  # fmt: skip


class Session:
    """A session that runs in a thread.

    Parameters
    ----------
    monkeypatch : pytest's
    out : Path
    **options
        As of the command.
    """

    def __init__(self, monkeypatch, out, **options):
        self.out, self.said, self.error = out, [], None
        self._pacers = []
        made = session_module.LivePacer
        monkeypatch.setattr(session_module, "LivePacer", lambda *a: self._noted(made(*a)))
        for module in (session_module, control_module):
            monkeypatch.setattr(module, "say", lambda text="", err=False: self.said.append(text))
        given = {
            "scene": SCENE, "sets": LATER, "swaps": (), "seed": None, "duration": None,
            "realtime": "1", "out": str(out), "host": "127.0.0.1", "port": 0, "units": "nautical",
            "no_wait": False,
            "no_figures": True, **options,
        }  # fmt: skip
        self.thread = threading.Thread(target=self._run, args=(given,), daemon=True)
        self.thread.start()
        self.address = wait_for(lambda: self._address(0))
        self.authority = self.address.split("/")[2]
        self.token = self.address.partition("token=")[2]

    def _run(self, given):
        try:
            session_module.run_session(**given)
        except BaseException as error:
            self.error = error
            self.said.append(f"http://failed/?token={error}")

    def _noted(self, pacer):
        self._pacers.append(pacer)
        return pacer

    def stop(self):
        """End it as ctrl-C does."""
        self._pacers[0].stop()

    def _address(self, number):
        found = re.findall(r"http\S+", " ".join(self.said))
        return found[number] if len(found) > number else None

    def new_address(self):
        """The address printed when the operator's page was gone."""
        return wait_for(lambda: self._address(1))

    def ended(self, timeout=60.0):
        self.thread.join(timeout)
        assert not self.thread.is_alive()
        if self.error is not None:
            raise self.error

    def socket(self, token=None, key="", **options):
        options.setdefault("origin", f"http://{self.authority}")
        token = self.token if token is None else token
        url = f"ws://{self.authority}/socket?token={token}&key={key}"
        return connect(url, open_timeout=60, **options)


def wait_for(look, timeout=90.0):
    """What `look` gives once it gives something."""
    until = time.monotonic() + timeout
    while time.monotonic() < until:
        if found := look():
            return found
        time.sleep(0.01)
    raise AssertionError("it did not come")


def hear(socket, *kinds, timeout=90.0):
    """The next message of some kinds; every picture is taken as drawn."""
    until = time.monotonic() + timeout
    while time.monotonic() < until:
        message = json.loads(socket.recv(timeout=until - time.monotonic()))
        if message["type"] == "frame":
            say(socket, type="drawn", frame=message["frame"])
        if message["type"] in kinds:
            return message
    raise AssertionError(f"no {kinds}")


def say(socket, **content):
    socket.send(json.dumps(content))


@contextmanager
def page(session, **options):
    """A page that has been welcomed, and what it was told."""
    with session.socket(**options) as socket:
        yield socket, hear(socket, "welcome")
