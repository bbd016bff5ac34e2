"""What shared processors do in a window, before any block runs in it.

When each message enters a line, and so when all of them leave it, does not depend on what they say
but on whether they are sent. Rehearsed is the window in which every block sends one message
whenever it is woken; what is known better (`Rehearsal.known`, `guesses`) takes precedence. A
rehearsal is right up to the first instant at which a block on a processor sends other than was
rehearsed: lines are causal, and no work takes less than a tick.
"""

import heapq
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dsa_des.running.channel import Channel
from dsa_des.running.processors import DONE, DROPPED, SKIPPED, Service

_FINISH, _WAKE, _ENTER = range(3)
#: A message in a line: who sent it, and when.
Job = tuple[str, int]
#: What a wake goes back to: a block, and the tick of its clock.
Root = tuple[str, int]


@dataclass(frozen=True)
class Player:
    """A block whose messages wait at a processor, or wake one whose do.

    Parameters
    ----------
    name : str
    place : int
        In an instant: a block stands behind those that wake it at once.
    processor : str
        Empty for a block that waits at none.
    wakes : tuple of (Channel, str)
        Wires to the players whom its messages wake, and their names.
    """

    name: str
    place: int
    processor: str
    wakes: tuple[tuple[Channel, str], ...]


@dataclass
class WaitingLine:
    """One processor and those who wait for it.

    Parameters
    ----------
    service : Service
    when_busy : str
        As in the scene.
    working : (job, tick of the start, tick of the end) or None
    waiting : deque of Job
    """

    service: Service
    when_busy: str
    working: tuple[Job, int, int] | None = None
    waiting: deque[Job] = field(default_factory=deque)

    def copy(self) -> "WaitingLine":
        """Return another one that stands as this one does."""
        return WaitingLine(self.service, self.when_busy, self.working, self.waiting.copy())


@dataclass
class Rehearsed:
    """What came of a rehearsal of [start, end).

    Parameters
    ----------
    lines : dict
        How each processor stands at the end.
    sent : dict
        By block: ticks at which it sends, ascending.
    refused : dict
        By block: ticks at which it is not to run.
    left : dict
        Job to the tick at which it leaves the processor; a job that was dropped has none.
    dropped : set of Job
    notes : dict
        By block: rows of `Processing` (tick, entered, started, behind, outcome), in order.
    woken : dict
        By block that waits at a processor: its wakes, and what each goes back to.
    roots : dict
        What each job goes back to.
    """

    lines: dict[str, WaitingLine]
    sent: dict[str, list[int]] = field(default_factory=dict)
    refused: dict[str, set[int]] = field(default_factory=dict)
    left: dict[Job, int] = field(default_factory=dict)
    dropped: set[Job] = field(default_factory=set)
    notes: dict[str, list[tuple[int, int, int, int, int]]] = field(default_factory=dict)
    woken: dict[str, list[tuple[int, Root]]] = field(default_factory=dict)
    roots: dict[Job, Root] = field(default_factory=dict)


class Rehearsal:
    """Rehearses windows.

    Parameters
    ----------
    players : iterable of Player
    """

    def __init__(self, players: Iterable[Player]) -> None:
        self._players = {player.name: player for player in players}
        #: Whether a block sends at a tick, as far as it was found out.
        self.known: dict[Job, bool] = {}
        #: Whether a block sent when it was woken by what goes back to the same root, and at last.
        self.guesses: dict[tuple[str, Root], bool] = {}
        self.usual: dict[str, bool] = {}

    def play(
        self,
        lines: Mapping[str, WaitingLine],
        woken: Mapping[str, np.ndarray],
        end: int,
        roots: Mapping[Job, Root],
    ) -> Rehearsed:
        """Rehearse up to a tick.

        Parameters
        ----------
        lines : mapping
            How the processors stand; left as they are.
        woken : mapping
            By player: ticks at which clocks, and messages that are on their way, wake it.
        end : int
        roots : mapping
            What the messages in the lines go back to.
        """
        guesses, usual = self.guesses, self.usual
        players, known = self._players, self.known
        found = Rehearsed({name: line.copy() for name, line in lines.items()}, roots=dict(roots))
        events: list[tuple[int, int, int, str, Root]] = []
        nothing: Root = "", 0
        for name, ticks in woken.items():
            place = players[name].place
            events += [(tick, _WAKE, place, name, (name, tick)) for tick in ticks.tolist()]
        for (name, tick), sends in known.items():
            if sends:
                events.append((tick, _WAKE, players[name].place, name, (name, tick)))
        for name, line in found.lines.items():
            if line.working is not None:
                events.append((line.working[2], _FINISH, 0, name, nothing))
        heapq.heapify(events)
        entering: dict[str, list[str]] = {name: [] for name in found.lines}
        last: dict[str, int] = {}
        push, pop = heapq.heappush, heapq.heappop

        def note(block: str, *row: int) -> None:
            found.notes.setdefault(block, []).append(row)  # type: ignore[arg-type]

        def wake(player: Player, made: int, sent: int, root: Root) -> None:
            for channel, target in player.wakes:
                arrival = channel.arrival(made, sent)
                if arrival is not None and arrival < end:
                    push(events, (arrival, _WAKE, players[target].place, target, root))

        def begin(name: str, line: WaitingLine, now: int) -> None:
            job = line.waiting.popleft()
            done = now + line.service.of(*job)
            line.working = (job, now, done)
            push(events, (done, _FINISH, 0, name, nothing))

        while events and events[0][0] < end:
            now, phase, _, name, root = pop(events)
            if phase == _WAKE:
                if last.get(name) == now:
                    continue
                last[name] = now
                player = players[name]
                if not player.processor:
                    wake(player, now, now, root)
                    continue
                line = found.lines[player.processor]
                if line.when_busy == "skip" and line.working is not None:
                    note(name, now, now, -1, len(line.waiting), SKIPPED)
                    found.refused.setdefault(name, set()).add(now)
                    continue
                found.woken.setdefault(name, []).append((now, root))
                guess = guesses.get((name, root), usual.get(name, True))
                if known.get((name, now), guess):
                    found.sent.setdefault(name, []).append(now)
                    found.roots[name, now] = root
                    if not entering[player.processor]:
                        push(events, (now, _ENTER, 0, player.processor, nothing))
                    entering[player.processor].append(name)
                continue
            line = found.lines[name]
            if phase == _FINISH:
                assert line.working is not None
                job, started, _ = line.working
                line.working = None
                note(job[0], now, job[1], started, len(line.waiting), DONE)
                found.left[job] = now
                wake(players[job[0]], job[1], now, found.roots[job])
                if line.waiting:
                    begin(name, line, now)
                continue
            for block in sorted(entering[name]):
                if line.when_busy == "skip" and (line.working is not None or line.waiting):
                    note(block, now, now, -1, len(line.waiting), SKIPPED)
                    found.dropped.add((block, now))
                    continue
                if line.when_busy == "drop_oldest" and line.waiting:
                    old = line.waiting.popleft()
                    note(old[0], now, old[1], -1, len(line.waiting), DROPPED)
                    found.dropped.add(old)
                line.waiting.append((block, now))
            entering[name] = []
            if line.waiting and line.working is None:
                begin(name, line, now)
        return found
