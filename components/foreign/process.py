"""Any program as a block (``foreign.process``)."""

import json
import shutil
import sys
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from components.aircraft.aircraft import Roster
from components.aircraft.known_targets import known_targets
from components.foreign.process_link import VERSION, ProcessError, ProcessLink, frame
from components.foreign.reported_look import reported_looks
from components.messages.detections import Detections, SensorOffer
from components.messages.steering import Manoeuvre, Manoeuvres
from components.messages.tracks import Tracks
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import (
    Component,
    Input,
    NonNegativeRational,
    Output,
    Parameters,
    PositiveRational,
    ScenePath,
    SourcedText,
)
from dsa_des.block.message import Message, derived
from dsa_des.block.wake import Wake
from dsa_des.errors import did_you_mean
from dsa_des.time.clock import ClockSpec

_HELLO, _CALL, _STATE = "hello", "call", "state"
_LINE = ("azimuth_rad", "elevation_rad", "range_m")
_NEEDED = {
    "manoeuvres": ("turn_rad", "rate_rad_s"),
    "detections": _LINE[:2],
    "tracks": ("target", *_LINE),
}


def _is_list(value: Any) -> Any:
    if isinstance(value, str):
        raise ValueError(
            'must be a list of words, as ["python3", "tracker.py"]: no shell takes a line apart'
        )
    return value


class ProcessParameters(Parameters):
    """Parameters of a program that runs as a block."""

    command: Annotated[list[str], BeforeValidator(_is_list), Field(min_length=1)] = Field(
        description="The program and its arguments, word by word; no shell looks at them. `python` "
        "is the one that runs this."
    )
    folder: ScenePath | None = Field(
        None, description="Where the program runs; by default the folder of the scene's file."
    )
    arguments: dict[str, Any] = Field(
        {}, description="What the program is told when it starts, as it wants it."
    )
    scan_rate_hz: PositiveRational | None = Field(
        None, description="Calls per second besides those at which something arrives."
    )
    offset_s: NonNegativeRational = Field(Fraction(0), description="Time of the first of them, s.")
    deadline_s: float = Field(10.0, gt=0, description="Longest wall time of one call, s.")
    on_failure: Literal["stop", "restart"] = Field(
        "stop",
        description="Whether a program that died, hung or sent garbage ends the run, or is started "
        "again and asked again.",
    )
    most_restarts: int = Field(3, ge=1, description="How often at most in a run.")

    @model_validator(mode="before")
    @classmethod
    def _beside_the_scene(cls, values: Any) -> Any:
        command = values.get("command") if isinstance(values, dict) else None
        if isinstance(command, list) and command and values.get("folder") is None:
            first = command[0]
            if isinstance(first, SourcedText):
                return {**values, "folder": str(first.folder.absolute())}
        return values

    @model_validator(mode="after")
    def _is_there(self) -> "ProcessParameters":
        program = self.program()
        if program is None:
            raise ValueError(f"command: there is no program {self.command[0]!r}")
        if self.folder is not None and not self.folder.is_dir():
            raise ValueError(f"folder: {self.folder} is no folder")
        return self

    def program(self) -> str | None:
        """Return the path of the program, or None where there is none."""
        name = self.command[0]
        if name == "python":
            return sys.executable
        beside = Path(self.folder or ".") / name
        return shutil.which(str(beside.absolute()) if "/" in name else name)

    def without_effect(self) -> list[str]:
        """Say which keys change nothing."""
        said = [] if self.on_failure == "restart" else self.idle(
            "most_restarts", because='as on_failure is "stop"'
        )  # fmt: skip
        return said + (
            [] if self.scan_rate_hz else self.idle("offset_s", because="without scan_rate_hz")
        )


class Process(Component):
    """Runs a program and asks it, over pipes, at every instant at which something comes.

    What arrives is sent as the tables that a run records of it, and answers are tables of
    ``manoeuvres``, ``detections`` or ``tracks`` with the columns of these messages. Docs in
    docs/foreign.md. A program that dies, hangs or sends garbage ends the run with its last words
    and exit code 3, or is started again (``on_failure``).
    """

    inputs = {
        "received": Input(Message, "trigger", "What is sent to it.", required=False, many=True)
    }
    outputs = {
        "manoeuvres": Output(Manoeuvres, "What the ownship is to fly."),
        "detections": Output(Detections, "What it detected."),
        "tracks": Output(Tracks, "What it holds."),
    }
    Parameters = ProcessParameters
    stands_alone = True

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return when it is called without being sent anything, if it is."""
        rate = parameters.scan_rate_hz
        return None if rate is None else ClockSpec(rate, parameters.offset_s)

    def offer(self, port: str) -> Any:
        """Say that detections may have a range; of the rest, nothing."""
        return (
            SensorOffer(measures_range=True, resolution_rad=0.0) if port == "detections" else None
        )

    def setup(self) -> None:
        """Prepare the program; it starts when it is asked first."""
        self._link = ProcessLink(
            [str(self.p.program()), *self.p.command[1:]], Path(self.p.folder or ".")
        )
        #: Its state before the next call, and the state in which it is: one by value, one by run.
        self._state: bytes | None = None
        self._first_state: bytes | None = None
        self._is_in = _Current()
        rosters = known_targets(self.context)
        self._roster = rosters[0] if rosters else None

    def start(self) -> None:
        """Start the program ahead of the first call."""
        if not self._link.runs:
            self._greet()

    # -- calls ---------------------------------------------------------------------------------

    def run(self, wake: Wake) -> Mapping[str, Message] | None:
        """Ask the program at every instant of the wake."""
        parts: dict[str, list[Message]] = {}
        arrivals = wake.arrivals("received")
        for row, tick in enumerate(wake.ticks.tolist()):
            sent = []
            for new in arrivals:
                first, last = np.searchsorted(new.tick, [tick, tick + 1])
                if last > first:
                    sent.append((new.source, new.message.take(slice(int(first), int(last)))))
            answer = self._call(tick, int(wake.scans[row]), sent)
            for name, message in self._messages(answer, wake.ticks[row : row + 1], sent):
                parts.setdefault(name, []).append(message)
        return {n: type(found[0]).concatenate(found) for n, found in parts.items()} or None

    def _call(self, tick: int, scan: int, sent: Any) -> Any:
        frames = self._call_frames(tick, scan)
        for source, message in sent:
            for table, batch in _batches(message):
                frames += frame(table, batch, {"block": source})
        while True:
            try:
                return self._asked(frames)
            except ProcessError:
                self._is_in.state = None
                if self.p.on_failure == "stop" or self._is_in.restarts >= self.p.most_restarts:
                    raise
                self._is_in.restarts += 1

    def _asked(self, frames: list[Any]) -> Any:
        self.start()
        before = self._first_state if self._state is None else self._state
        wanted = []
        if before is not None and before is not self._is_in.state:
            wanted = frame(_STATE, _one(state=before), {})
        answer = self._link.ask([*wanted, *frames], self.p.deadline_s)
        after = [table for about, table in answer if about.get("table") == _STATE]
        if type(self).rewindable:
            if not after or after[0].num_rows != 1 or after[0].column_names != ["state"]:
                self._link.stop()
                raise ProcessError("has not sent its state, which it said it would (snapshots)")
            self._state = self._is_in.state = after[0].column(0)[0].as_py()
        return [(about, table) for about, table in answer if about.get("table") != _STATE]

    def _greet(self) -> None:
        self._link.start()
        about = {
            "version": VERSION, "block": self.name, "ticks_per_s": str(self.context.ticks_per_s),
            "arguments": json.dumps(self.p.arguments), "seed": str(self.context.streams.seed),
            "snapshots": str(type(self).rewindable).lower(),
        }  # fmt: skip
        answer = self._link.ask(frame(_HELLO, _one(), about), self.p.deadline_s)
        said = answer[0][0] if answer else {}
        wrong = ""
        if said.get("table") != _HELLO:
            wrong = "has not said hello: its first answer must be a table of that name"
        elif said.get("version") != VERSION:
            wrong = f"speaks version {said.get('version')!r} of the exchange, and we {VERSION!r}"
        elif type(self).rewindable and said.get("snapshots") != "true":
            wrong = (
                'cannot hand out its state (snapshots is not "true"): its type is foreign.process'
            )
        first = [table for about, table in answer[1:] if about.get("table") == _STATE]
        if not wrong and type(self).rewindable and not first:
            wrong = "has not sent the state in which it starts"
        if wrong:
            self._link.stop()
            raise ProcessError(wrong)
        if type(self).rewindable and self._first_state is None:
            self._first_state = first[0].column(0)[0].as_py()
            self._is_in.state = self._first_state

    def _call_frames(self, tick: int, scan: int) -> list[Any]:
        time_s = tick / self.context.ticks_per_s
        return frame(_CALL, _one(tick=tick, time_s=time_s, scan=scan), {})

    # -- answers -------------------------------------------------------------------------------

    def _messages(self, answer: Any, tick: IntArray, sent: Any) -> Iterator[tuple[str, Message]]:
        for about, table in answer:
            name = about.get("table", "")
            try:
                if name not in _NEEDED:
                    raise ValueError(f"no such table is known{did_you_mean(name, _NEEDED)}")
                for column in _NEEDED[name]:
                    if column not in table.column_names:
                        hint = did_you_mean(column, table.column_names)
                        raise ValueError(f"there is no column {column!r}{hint}")
                if table.num_rows or name != "manoeuvres":
                    yield name, self._message(name, table, tick, sent)
            except ValueError as error:
                self._link.stop()
                raise ProcessError(f"sent a table {name!r}: {error}") from None

    def _message(self, name: str, table: Any, tick: IntArray, sent: Any) -> Message:
        numbers = {
            column: _numbers(table, column) for column in table.column_names if column != "target"
        }
        count = table.num_rows
        if name == "manoeuvres":
            known = [column for column in Manoeuvre._fields if column in numbers]
            told = Manoeuvres(
                np.repeat(tick, count), **{column: numbers[column] for column in known}
            )
            if not all(np.isfinite(getattr(told, column)).all() for column in Manoeuvre._fields):
                raise ValueError("finite numbers are needed")
            return told
        roster = self._roster_of(sent)
        target = _targets(table, roster)
        if name == "detections":
            zero = np.zeros(1, dtype=np.int64)
            looks = {n: v[:1] if count else np.full(1, np.nan) for n, v in numbers.items()
                     if n.startswith("own_")}  # fmt: skip
            offsets = np.array([0, count])
            return reported_looks(tick, zero - 1, offsets, numbers, looks, target, roster)
        return Tracks(
            tick=tick, offsets=np.array([0, count]), target=target,
            **{column: numbers[column] for column in _LINE},
            age_s=numbers.get("age_s", np.zeros(count)),
            contributors=np.zeros(count, dtype=np.int64), roster=roster, sensors=(),
            ticks_per_s=self.context.ticks_per_s,
        )  # fmt: skip

    def _roster_of(self, sent: Any) -> Roster:
        for _, message in sent:
            if isinstance(found := getattr(message, "roster", None), Roster):
                self._roster = found
        return self._roster or Roster.of([])

    def close(self) -> None:
        """End the program."""
        self._link.stop()

    def report(self) -> dict[str, Any]:
        """End the program, and say how often it was started again."""
        self._link.stop()
        restarts = self._is_in.restarts
        return {"restarts": {self.name: restarts}} if restarts else {}


class RewindableProcess(Process):
    """Runs a program that hands out its state and takes it back, so that its scene looks ahead.

    All else is as with ``foreign.process``; docs/foreign.md says what the program has to do.
    """

    windowed = True
    rewindable = True


class _Current:
    """What is so of the program itself, wherever the engine has taken the block back to."""

    state: bytes | None = None
    restarts = 0


def _one(**values: Any) -> Any:
    import pyarrow as pa

    if not values:
        return pa.RecordBatch.from_arrays([], schema=pa.schema([]))
    return pa.RecordBatch.from_pydict({name: [value] for name, value in values.items()})


def _batches(message: Message) -> Iterator[tuple[str, Any]]:
    """Yield each table of a message, as a run records it."""
    from dsa_des.record.arrow import to_arrow

    declared = derived(type(message)).recorded
    for table, columns in message.tables().items():
        kinds = {n: declared[table][n].kind if n in declared[table] else "int64" for n in columns}
        yield table, to_arrow(columns, kinds)


def _numbers(table: Any, column: str) -> Any:
    import pyarrow as pa

    try:
        return table.column(column).combine_chunks().cast(pa.float64()).to_numpy(
            zero_copy_only=False
        ).copy()  # fmt: skip
    except pa.ArrowException:
        kind = table.column(column).type
        raise ValueError(f"column {column!r} is of {kind}: numbers are needed") from None


def _targets(table: Any, roster: Roster) -> IntArray:
    place = {name: number for number, name in enumerate(roster.names)}
    if "target" not in table.column_names:
        return np.full(table.num_rows, -1, dtype=np.int64)
    names = table.column("target").to_pylist()
    for name in names:
        if name is not None and name not in place:
            raise ValueError(f"target {name!r} is not in the scene{did_you_mean(str(name), place)}")
    return np.array([place.get(name, -1) for name in names], dtype=np.int64)
