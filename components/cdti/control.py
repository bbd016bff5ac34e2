"""Between the pages of a session and its simulation: decisions, and the pace at which it runs."""

import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from components.cdti.page import (
    OPERATOR,
    Admission,
    Chosen,
    Climbed,
    Judged,
    PageMessage,
    Ready,
    Turned,
)
from components.cdti.scope import Received, Scope
from components.messages.decisions import CLIMB, KINDS, TURN, OperatorDecision
from components.operator.human import Desk, PendingDecision, Taken
from dsa_des.running.pacing import Pacer
from dsa_des.scene.scene import Scene
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import escape_unprintable

if TYPE_CHECKING:
    from components.cdti.server import DisplayServer, Page

#: Pictures are sent no closer together than this, wall seconds.
FRAME_S = 0.015
#: Of the time between two of them, making one takes no more than this share: the rest is for the
#: simulation, which many contacts would otherwise slow.
_SHARE = 0.2
#: A page that is gone for so long is not being reloaded, s.
GONE_S = 3.0
_LOG = 200
#: Wall time that a window stands for, s: so long, at most, a decision waits to be taken in.
WINDOW_S = 0.02
_LOOK_AGAIN_S = 0.25


class LivePacer(Pacer):
    """A pacer that waits while `holds()` is true, and reports simulated time and lag, s.

    Simulated time runs at `factor` seconds per second of the clock.
    """

    def __init__(
        self,
        factor: float,
        holds: Callable[[], bool],
        came_to: Callable[[float, float], None],
    ) -> None:
        super().__init__(factor)
        self._holds, self._came_to = holds, came_to
        self._changed = threading.Event()
        self.paused_s = 0.0

    @property
    def longest_window_s(self) -> float:
        """Longest simulated time that the engine may compute between two waits, s."""
        return WINDOW_S * self.factor

    def wake(self) -> None:
        """Make the waiting run check at once whether it may go on; any thread may call it."""
        self._changed.set()

    def stop(self) -> None:
        """Make the run end after the window that is being computed."""
        self.stopped = True
        self._changed.set()

    def start(self) -> None:
        """Set the wall-clock time of simulated time 0 to now, once nothing holds the run."""
        self._wait_while_held()
        super().start()

    def __call__(self, time_s: float) -> None:
        """Wait for the instant up to which the simulation has come, and while the run is held."""
        self.time_s = time_s
        due = self._started + time_s / self.factor
        while not self.stopped and (ahead_s := due - self.now()) > 0.0:
            self._changed.wait(min(ahead_s, _LOOK_AGAIN_S))
            self._changed.clear()
        lag_s = max(0.0, self.now() - due)
        self.windows += 1
        self.max_lag_s = max(self.max_lag_s, lag_s)
        self.total_lag_s += lag_s
        self._came_to(time_s, lag_s)
        self._wait_while_held()

    def _wait_while_held(self) -> None:
        """Block while the run is held, and shift its start by that time, so that no lag arises."""
        began = self.now()
        while not self.stopped and self._holds():
            self._changed.wait(_LOOK_AGAIN_S)
            self._changed.clear()
        held_s = self.now() - began
        self._started += held_s
        self.paused_s += held_s

    def report(self) -> dict[str, float]:
        """Return the pacer's figures, with ``paused_s``, the time in s that the run was held."""
        return {**super().report(), "paused_s": self.paused_s}


class SessionControl:
    """Answers the pages of one session, and holds its run until an operator is ready if it `waits`.

    All pages only watch without a console, the block at which the operator sits.
    """

    def __init__(
        self,
        scene: Scene,
        desk: Desk,
        console: str | None,
        factor: float,
        units: str,
        *,
        waits: bool,
    ) -> None:
        self._scene, self._desk, self._console, self._factor = scene, desk, console, factor
        self._units = units
        self._pauses = False
        if console is not None:
            parameters: Any = scene.blocks[console].parameters
            self._pauses = parameters.unattended == "pauses"
        self._waits = waits
        self._operators = 0
        self._began = False
        self._gone_at: float | None = None
        self.scope: Scope | None = None
        #: How far the run has come, its lag, and what was received by then.
        self._now: tuple[float, float, Received | None] = (0.0, 0.0, None)
        self._shown_at = -math.inf
        self._named = 0
        #: How long the last picture took to be made, s, and the one of which instant it was.
        self._made_s = 0.0
        self._made: tuple[float, dict[str, Any]] | None = None
        #: What became of each decision, by the page's number for it.
        self._answers: dict[str, dict[str, Any]] = {}
        self._log: list[dict[str, Any]] = []

    def attach(self, server: "DisplayServer", pacer: LivePacer, admission: Admission) -> None:
        """Set the server, the pacer and the admission that this session works with."""
        self._server, self._pacer, self._admission = server, pacer, admission

    # -- the thread of the simulation --------------------------------------------------------------

    def is_held(self) -> bool:
        """Return whether the run must wait; print a new address if the operator's page is gone."""
        if self._gone_at is not None and time.monotonic() - self._gone_at > GONE_S:
            self._gone_at = None
            address = self._server.page_url(self._admission.unused_operator_token())
            say(f"the operator's page is gone; to decide again: {address}")
        if self._waits and not self._began:
            return True
        return self._pauses and self._operators == 0

    def show_time(self, time_s: float, lag_s: float) -> None:
        """Store the simulated time that the run has reached, and show it on the pages."""
        self._now = time_s, lag_s, None if self.scope is None else self.scope.received_so_far()
        if self._gone_at is not None:
            self.is_held()
        if self.scope is not None and len(self.scope.names) != self._named:
            self._named = len(self.scope.names)
            self._server.broadcast({"type": "names", "names": self.scope.names})
        wall_s = time.perf_counter()
        if wall_s - self._shown_at >= max(FRAME_S, self._made_s / _SHARE):
            self._shown_at = wall_s
            self._server.announce_picture()

    def decisions_sentence(self) -> str:
        """Return a sentence on how many decisions were accepted, up to which simulated time."""
        taken = sum(answer["type"] == "taken" for answer in self._answers.values())
        return f"{taken} decision{'' if taken == 1 else 's'} taken in, up to {self._now[0]:.1f} s"

    def _decision_fields(self, message: Judged | Turned | Climbed, taken: Taken) -> dict[str, Any]:
        """Return the fields that pages receive of an accepted decision: its time, s, the alert's
        level, the commanded value, until when it is flown, and which command it replaces.
        """
        assert self.scope is not None
        answer: dict[str, Any] = {
            "time": round(taken.time_s, 6), "level": self.scope.alert_level_of(message.target)
        }  # fmt: skip
        if isinstance(message, Judged) or not math.isfinite(taken.ends_s):
            return answer
        answer["to"] = self.scope.commanded_value(message.decision, message.value)
        answer["ends"] = round(taken.ends_s, 6)
        if math.isfinite(taken.replaces_s):
            replaced = next(
                one
                for one in reversed(self._log)
                if one["decision"] == message.decision and one["time"] == round(taken.replaces_s, 6)
            )
            answer["replaces"] = {name: replaced[name] for name in ("time", "value")}
        return answer

    # -- the thread of the server ------------------------------------------------------------------

    def store_operator_count(self, count: int) -> None:
        """Store how many connected pages may decide."""
        if self._operators and not count:
            self._gone_at = time.monotonic()
        elif count:
            self._gone_at = None
        self._operators = count
        self._pacer.wake()
        # A run that pauses now comes to no other instant, and the other pages are to know of it.
        self._server.announce_picture()

    def welcome(self, role: str) -> dict[str, Any]:
        """Return the first message to a new page: names, units and limits of the scene."""
        scope = self.scope
        duration = self._scene.duration_s
        return {
            "title": escape_unprintable(self._scene.title),
            "duration": None if duration is None else float(duration),
            "factor": self._factor,
            "units": self._units,
            "sensors": [] if scope is None else scope.sensors,
            "names": [] if scope is None else scope.names,
            "console": self._console is not None,
            "began": self._began or not self._waits,
            "log": self._log[-_LOG:],
        }

    def frame(self, chosen: int) -> dict[str, Any] | None:
        """Return a page's newest content as a message, with the camera's picture of contact
        `chosen` (-1: the most urgent); None without a display.
        """
        scope = self.scope
        if scope is None:
            return None
        began = time.thread_time()
        time_s, lag_s, received = self._now
        if self._made is None or self._made[0] != time_s:
            self._made = time_s, scope.page_content(time_s, received)
        picture = self._made[1]
        content = {
            "type": "frame",
            "t": round(time_s, 4),
            "lag": round(lag_s, 4),
            "operators": self._operators,
            **picture,
            "camera": scope.camera_picture(picture, time_s, chosen),
        }
        self._made_s = time.thread_time() - began
        return content

    async def on_message(self, page: "Page", message: PageMessage) -> None:
        """Process a message from a page."""
        if isinstance(message, Chosen):
            page.chosen = message.target
            self._server.announce_picture()
            return
        if page.role != OPERATOR:
            number = getattr(message, "id", None)
            await page.send({"type": "refused", "id": number, "why": "this page only watches"})
            return
        if isinstance(message, Ready):
            if not self._began:
                self._began = True
                self._pacer.wake()
                self._server.broadcast({"type": "began"})
        elif isinstance(message, Judged | Turned | Climbed):
            await self._decide(page, message)

    async def _decide(self, page: "Page", message: Judged | Turned | Climbed) -> None:
        known = self._answers.get(message.id)
        if known is not None:  # sent again after the connection was lost
            if known["type"] != "waits":
                await page.send(known)
            return
        name = None if self.scope is None else self.scope.name_of(message.target)
        why = ""
        if self._console is None:
            why = "nobody decides in this scene"
        elif name is None or self.scope is None:
            why = "there is no such target"
        elif isinstance(message, Climbed) and self.scope.own_alt_m + message.value < 0.0:
            why = "that leads below the ground"
        elif not self._submit(message, name):
            why = "the run is over, or too much was decided at once"
        if why:
            await page.send({"type": "refused", "id": message.id, "why": why})

    def _submit(self, message: Judged | Turned | Climbed, name: str) -> bool:
        """Queue an operator's decision, return whether it worked; tell pages if accepted later."""
        kind = KINDS.index(message.decision)
        value = getattr(message, "value", 0.0)
        decision = OperatorDecision(
            kind,
            name,
            turn_rad=math.radians(value) if kind == TURN else 0.0,
            climb_m=value if kind == CLIMB else 0.0,
            wall_time_s=round(time.time(), 6),
        )
        content = {
            "id": message.id,
            "decision": message.decision,
            "target": message.target,
            "value": value,
        }
        self._answers[message.id] = {"type": "waits"}

        def taken(one: Taken) -> None:
            answer = {"type": "taken", **content, **self._decision_fields(message, one)}
            self._answers[message.id] = answer
            self._log.append(answer)
            self._server.broadcast(answer)

        if self._desk.submit(PendingDecision(decision, taken)):
            return True
        del self._answers[message.id]
        return False
