"""A session in a thread of this process, and what its pages say to it."""

import json
import re
import threading
import time
from contextlib import contextmanager

from websockets.sync.client import connect

from components.cdti import control as control_module
from components.cdti import session as session_module
from components.examples import configs_folder
from tests.support.waiting import WAIT_S, wait_for

#: Of the session's tracker, whose first track is that of the intruder's direction.
TRACKS = 1_000_000
SCENE = str(configs_folder() / "operator" / "session.toml")
#: Begun when the camera already sees the intruder, and without what no test looks at.
LATER = (
    "blocks.traffic.intruders[0].east_m=4200", "blocks.traffic.intruders[0].north_m=3500",
    "record.truth=true", "blocks.radar.false_alarm_probability=1e-6", "blocks.radar.range_km=5",
    "blocks.guidance.level=9",
)  # fmt: skip


class Session:
    """A session that runs in a thread, and stands still where a test wants to look at it.

    How fast the machine is decides how much scene goes by while a test looks and presses. So a test
    names the picture at which the scene stands; then it goes on for as long only as it takes to
    take in what was decided, until `go_on`.

    Parameters
    ----------
    monkeypatch : pytest's
    out : Path
    until : callable, optional
        Whether the scene is to stand at a picture (`Scope.picture`, and ``t``).
    **options
        As of the command.
    """

    def __init__(self, monkeypatch, out, until=None, **options):
        self.out, self.said, self.error = out, [], None
        self._until, self._reached, self._stands = until, False, threading.Event()
        self._asking = threading.Lock()
        monkeypatch.setattr(control_module, "_LOOK_AGAIN_S", 0.02)  # whether a decision waits
        monkeypatch.setattr(session_module, "LivePacer", self._made)
        for module in (session_module, control_module):
            monkeypatch.setattr(module, "say", lambda text="", err=False: self.said.append(text))
        given = {
            "scene": SCENE, "sets": LATER, "swaps": (), "seed": None, "duration": None,
            "realtime": "1", "out": str(out), "host": "127.0.0.1", "port": 0, "units": "nautical",
            "platform": None, "no_wait": False, "no_figures": True, **options,
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

    def _made(self, factor, holds, came_to):
        self.control = holds.__self__
        self._pacer = control_module.LivePacer(factor, lambda: self._holds() or holds(), came_to)
        return self._pacer

    def _holds(self):
        """Whether the scene stands; asked by its own thread after each of its windows."""
        control = self.control
        with self._asking:
            waits = any(one["type"] == "waits" for one in [*control._answers.values()])
            if self._until is None or control.scope is None or waits:
                self._stands.clear()
                return False
            time_s, _, received = control._now
            picture = control.scope.page_content(time_s, received)
            self._reached = self._reached or bool(self._until({"t": time_s, **picture}))
            if self._reached and not self._stands.is_set():
                # Pages get this very picture, whatever they had before.
                control._server.announce_picture()
                self.stands_at_s = time_s
                self._stands.set()
            return self._reached

    def stands(self):
        """The instant at which the scene stands, once it does, s."""
        assert self._stands.wait(WAIT_S), "it did not stand"
        return self.stands_at_s

    def go_on(self, until=None):
        """Let the scene go on, to its end or until it stands again."""
        with self._asking:
            self._until, self._reached = until, False
            self._stands.clear()
        self._pacer.wake()

    def stop(self):
        """End it as ctrl-C does."""
        self._pacer.stop()

    def _address(self, number):
        found = re.findall(r"http\S+", " ".join(self.said))
        return found[number] if len(found) > number else None

    def new_address(self):
        """The address printed when the operator's page was gone."""
        return wait_for(lambda: self._address(1))

    def ended(self):
        self.thread.join(WAIT_S)
        assert not self.thread.is_alive()
        if self.error is not None:
            raise self.error

    def socket(self, token=None, key="", **options):
        options.setdefault("origin", f"http://{self.authority}")
        token = self.token if token is None else token
        url = f"ws://{self.authority}/socket?token={token}&key={key}"
        return connect(url, open_timeout=WAIT_S, **options)


def hear(socket, *kinds, timeout=WAIT_S):
    """The next message of some kinds; every picture is taken as drawn."""
    until = time.monotonic() + timeout
    while time.monotonic() < until:
        message = json.loads(socket.recv(timeout=until - time.monotonic()))
        if message["type"] == "frame":
            say(socket, type="drawn", frame=message["frame"])
        if message["type"] in kinds:
            return message
    raise TimeoutError(f"no {kinds}")


def say(socket, **content):
    socket.send(json.dumps(content))


@contextmanager
def page(session, **options):
    """A page that has been welcomed, and what it was told."""
    with session.socket(**options) as socket:
        yield socket, hear(socket, "welcome")
