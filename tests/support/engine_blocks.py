"""Small blocks for the engine's tests; scenes name them ``engine_blocks:Class``.

Each windowed block computes row by row what it would compute scan by scan, so its recordings must
not depend on the window.
"""

from collections import deque
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from dsa_des.block.component import ClockedParameters, Component, Input, Output, Parameters
from dsa_des.block.message import PER_ROW, Message, column, per_entry, static


@dataclass(eq=False)
class Beat(Message):
    """One number per row."""

    row_table = "beats"

    value: np.ndarray = column("", "", "what is sent", of=PER_ROW)
    scan: np.ndarray = column("", "", "number of the scan", "int64", of=PER_ROW)
    seen: np.ndarray = column("", "", "how many were seen", "int64", of=PER_ROW)

    @classmethod
    def make_initial(cls, values):
        if set(values) != {"value"}:
            raise ValueError("needs value and nothing else")
        return beat(np.zeros(1, dtype=np.int64), np.array([float(values["value"])]))


@dataclass(eq=False)
class LoudBeat(Beat):
    """A kind of beat, accepted wherever a beat is."""


@dataclass(eq=False)
class Note(Message):
    """A message of another type."""


@dataclass(eq=False)
class Ragged(Message):
    """A message with entries, a table of columns and a static field."""

    offsets: np.ndarray
    value: np.ndarray
    entry: np.ndarray = per_entry()
    columns: dict = per_entry()
    label: str = static()


def beat(tick, value, scan=None, seen=None, kind=Beat):
    """Return a beat of the given rows."""
    nothing = np.full(len(tick), -1, dtype=np.int64)
    return kind(
        tick,
        np.asarray(value, dtype=float),
        nothing if scan is None else scan,
        nothing if seen is None else seen,
    )


class PulseParameters(ClockedParameters):
    """Parameters of a pulse."""

    gain: float = Field(default=1.0, ge=0, description="Factor of the drawn value.")


class Pulse(Component):
    """A clocked source of keyed draws."""

    outputs = {"out": Output(Beat)}
    Parameters = PulseParameters
    windowed = True

    def run(self, wake):
        value = self.p.gain * self.stream("value").uniform(np.uint64(7), wake.scans)
        return beat(wake.ticks, value, wake.scans)


class SlowPulse(Pulse):
    """The same, one scan at a time."""

    windowed = False


class DemandedParameters(Parameters):
    """Parameters of a source on demand."""

    lasts_s: float | None = None


class Demanded(Component):
    """A source that runs when blocks downstream scan; its value is the time."""

    outputs = {"out": Output(Beat)}
    Parameters = DemandedParameters
    windowed = True
    clocked = "demand"

    def natural_duration_s(self):
        return None if self.p.lasts_s is None else Fraction(repr(self.p.lasts_s))

    def run(self, wake):
        return beat(wake.ticks, wake.time_s)


class Relay(Component):
    """Triggered: twice the value plus one."""

    inputs = {"in": Input(Beat, "trigger")}
    outputs = {"out": Output(Beat)}
    windowed = True

    def run(self, wake):
        message = wake["in"]
        if message is None:
            return None
        return beat(wake.ticks, 2 * message.value + 1, message.scan)


class Fickle(Relay):
    """Passes on some of what it hears."""

    rewindable = True

    def run(self, wake):
        message = wake["in"]
        kept = np.flatnonzero(message.value * 8.0 % 1.0 < 0.5)
        return beat(wake.ticks[kept], message.value[kept], message.scan[kept])


class SlowRelay(Relay):
    """The same, one instant at a time."""

    windowed = False


class Sampler(Component):
    """Clocked: the value its input holds at each scan."""

    inputs = {"in": Input(Beat, "sampled")}
    outputs = {"out": Output(Beat)}
    Parameters = ClockedParameters
    windowed = True

    def run(self, wake):
        held = wake.held("in")
        message, rows = held
        value = np.where(rows >= 0, message.value[np.maximum(rows, 0)], np.nan)
        return beat(wake.ticks, value, wake.scans, np.where(rows >= 0, 1, 0))


class Queuer(Component):
    """Clocked: the sum and number of all that came since its last scan."""

    inputs = {"in": Input(Beat, "queued")}
    outputs = {"out": Output(Beat)}
    Parameters = ClockedParameters
    windowed = False

    def run(self, wake):
        rows = [new.message for new in wake.arrivals("in")]
        value = sum((float(v) for message in rows for v in message.value), 0.0)
        seen = np.array([sum(len(message) for message in rows)], dtype=np.int64)
        return beat(wake.ticks, [value], wake.scans, seen)


class Join(Component):
    """Triggered by any of many writers: the sum of what came at the instant, and how many."""

    inputs = {"in": Input(Beat, "trigger", many=True)}
    outputs = {"out": Output(Beat)}
    windowed = True

    def run(self, wake):
        value = np.zeros(len(wake))
        seen = np.zeros(len(wake), dtype=np.int64)
        for new in wake.arrivals("in"):
            place = np.searchsorted(wake.ticks, new.tick)
            value[place] += new.message.value
            seen[place] += 1
        return beat(wake.ticks, value, wake.scans, seen)


class SlowJoin(Join):
    """The same, one instant at a time."""

    windowed = False


class Cued(Component):
    """Clocked, with a cue that comes back from downstream: a quarter of the cue plus a draw."""

    inputs = {
        "in": Input(Beat, "sampled"),
        "cue": Input(Beat, "sampled", required=False),
    }
    outputs = {"out": Output(Beat)}
    Parameters = ClockedParameters
    windowed = True

    def run(self, wake):
        held = wake.held("cue")
        cue, seen = np.zeros(len(wake)), np.zeros(len(wake), dtype=np.int64)
        if held is not None:
            message, rows = held
            cue = np.where(rows >= 0, message.value[np.maximum(rows, 0)], 0.0)
            seen = np.where(rows >= 0, 1, 0)
        message, rows = wake.held("in")
        draw = self.stream("cue").uniform(np.uint64(1), wake.scans)
        return beat(wake.ticks, message.value[rows] + 0.25 * cue + draw, wake.scans, seen)


class QueuedCue(Component):
    """Clocked, with a queued input fed back from downstream."""

    inputs = {"in": Input(Beat, "sampled"), "cue": Input(Beat, "queued", required=False)}
    outputs = {"out": Output(Beat)}
    Parameters = ClockedParameters

    def run(self, wake):
        count = sum(len(new.message) for new in wake.arrivals("cue"))
        return beat(wake.ticks, wake["in"].value, wake.scans, np.array([count]))


class TwoOutputs(Component):
    """Triggered, with two outputs of one type."""

    inputs = {"in": Input(Beat, "trigger")}
    outputs = {"left": Output(Beat), "right": Output(Beat)}
    windowed = True

    def run(self, wake):
        message = wake["in"]
        return {
            "left": beat(wake.ticks, message.value),
            "right": beat(wake.ticks, -message.value),
        }


class LoudPulse(Pulse):
    """A source of a subclass of the message."""

    outputs = {"out": Output(LoudBeat)}

    def run(self, wake):
        value = self.stream("value").uniform(np.uint64(7), wake.scans)
        return beat(wake.ticks, value, wake.scans, kind=LoudBeat)


class NoteSource(Component):
    """A source of another type of message."""

    outputs = {"out": Output(Note)}
    Parameters = ClockedParameters
    windowed = True

    def run(self, wake):
        return Note(wake.ticks)


class OwnParameters(Parameters):
    """Parameters of the block with its own process."""

    hold_ticks: int = 0


class OwnProcess(Component):
    """A block with a generator of its own: passes on what arrives, after a while."""

    inputs = {"in": Input(Beat, "trigger")}
    outputs = {"out": Output(Beat)}
    Parameters = OwnParameters

    def process(self, env):
        while True:
            yield env.arrival()
            wake = env.receive()
            value = wake["in"].value
            if self.p.hold_ticks:
                yield env.timeout(self.p.hold_ticks)
            env.send(beat(env.tick_array(), value))


class OwnSource(Component):
    """A source with a generator of its own: a beat every 0.1 s."""

    outputs = {"out": Output(Beat)}

    def process(self, env):
        number = 0
        while True:
            env.send(beat(env.tick_array(), [float(number)]))
            number += 1
            yield env.timeout(env.ticks_per_s // 10)


class OwnReader(Component):
    """A generator that reads its input every 0.1 s, from the first instant on."""

    inputs = {"in": Input(Beat, "sampled")}
    outputs = {"out": Output(Beat)}

    def process(self, env):
        while True:
            message = env.receive()["in"]
            value = np.nan if message is None else message.value[0]
            env.send(beat(env.tick_array(), [value]))
            yield env.timeout(env.ticks_per_s // 10)


class KeywordOnly(Exception):
    """An exception that cannot be rebuilt from its args."""

    def __init__(self, *, code: int) -> None:
        super().__init__()
        self.code = code

    def __str__(self) -> str:
        return f"code {self.code}"


class FaultParameters(ClockedParameters):
    """When and how to fail."""

    at_scan: int = 12
    how: str = "value"


def _raise(how: str) -> None:
    if how == "keyword":
        raise KeywordOnly(code=7)
    if how == "zero":
        _ = 1 // 0
    raise ValueError("the antenna fell off")


class Faulty(Component):
    """Clocked source that fails at one of its scans."""

    outputs = {"out": Output(Beat)}
    Parameters = FaultParameters

    def run(self, wake):
        if (wake.scans == self.p.at_scan).any():
            _raise(self.p.how)
        return beat(wake.ticks, wake.time_s, wake.scans)


class FaultyWindowed(Faulty):
    """The same, in look-ahead windows."""

    windowed = True


class FaultySetup(Faulty):
    """Fails when it is set up."""

    def setup(self):
        _raise(self.p.how)


class FaultyInit(Faulty):
    """Fails when it is built."""

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        raise ValueError("no such antenna")


class FaultyProcess(Component):
    """Fails in a generator of its own, at 1.2 s."""

    outputs = {"out": Output(Beat)}
    Parameters = FaultParameters

    @classmethod
    def clock_of(cls, parameters):
        return None

    def process(self, env):
        yield env.timeout(env.ticks_per_s * 12 // 10)
        _raise(self.p.how)


class Sender(Component):
    """Returns something that must not be sent."""

    inputs = {}
    outputs = {"out": Output(Beat)}
    Parameters = FaultParameters

    def run(self, wake):
        how = self.p.how
        if how == "type":
            return Note(wake.ticks)
        if how == "port":
            return {"nowhere": beat(wake.ticks, wake.time_s)}
        if how == "future":
            return beat(wake.ticks + 1, wake.time_s)
        if how == "float":
            return beat(wake.ticks.astype(float), wake.time_s)
        raise AssertionError(how)


class ManyFaults(Component):
    """Two outputs, one lone message."""

    outputs = {"left": Output(Beat), "right": Output(Beat)}
    Parameters = FaultParameters

    def run(self, wake):
        return beat(wake.ticks, wake.time_s)


class NeverRuns(Component):
    """Only samples, and has no clock."""

    inputs = {"in": Input(Beat, "sampled")}
    outputs = {"out": Output(Beat)}

    def run(self, wake):
        return beat(wake.ticks, wake["in"].value)


class NotABlock:
    """No component."""


#: What `Collector` blocks saw, by block name: (tick, source, value) in order.
SEEN: dict[str, deque] = {}


class Collector(Component):
    """Triggered by many; notes every row in the order it is handed over."""

    inputs = {"in": Input(Beat, "trigger", many=True)}
    outputs = {}

    def setup(self):
        SEEN[self.name] = deque()

    def run(self, wake):
        for new in wake.arrivals("in"):
            for tick, value in zip(new.tick, new.message.value, strict=True):
                SEEN[self.name].append((int(wake.ticks[0]), new.source, int(tick), float(value)))
