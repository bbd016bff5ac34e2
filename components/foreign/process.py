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
from components.aircraft.known_targets import offered_rosters
from components.foreign.process_answers import message_of_table
from components.foreign.process_link import VERSION, ProcessError, ProcessLink, frame_parts_of_batch
from components.messages.detections import Detections, SensorOffer
from components.messages.state_tracks import StateTracks
from components.messages.steering import Manoeuvres
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
from dsa_des.block.message import Message, derive_columns
from dsa_des.block.wake import Wake
from dsa_des.time.clock import ClockSpec

_HELLO, _CALL, _STATE = "hello", "call", "state"


def _refuse_single_text(value: Any) -> Any:
    if isinstance(value, str):
        raise ValueError(
            'must be a list of words, as ["python3", "tracker.py"]: no shell takes a line apart'
        )
    return value


class ProcessParameters(Parameters):
    """Parameters of a program that runs as a block."""

    command: Annotated[list[str], BeforeValidator(_refuse_single_text), Field(min_length=1)] = (
        Field(
            description="The program and its arguments, word by word; no shell looks at them. "
            "`python` is the one that runs this."
        )
    )
    folder: ScenePath | None = Field(
        None, description="Where the program runs; by default the folder of the scene's file."
    )
    arguments: dict[str, Any] = Field(
        {}, description="Passed on to the program when it starts; any keys that it expects."
    )
    scan_rate_hz: PositiveRational | None = Field(
        None, description="Calls per second besides those at which something arrives."
    )
    offset_s: NonNegativeRational = Field(Fraction(0), description="Time of the first of them, s.")
    deadline_s: float = Field(10.0, gt=0, description="Longest wall time of one call, s.")
    snapshots: bool = Field(
        False,
        description="Whether the program hands out its state and takes it back, so that its scene "
        "looks ahead.",
    )
    on_failure: Literal["stop", "restart"] = Field(
        "stop",
        description="Whether a program that died, hung or sent garbage ends the run, or is started "
        "again and asked again.",
    )
    most_restarts: int = Field(3, ge=1, description="How often at most in a run.")

    @model_validator(mode="before")
    @classmethod
    def _default_folder(cls, values: Any) -> Any:
        command = values.get("command") if isinstance(values, dict) else None
        if isinstance(command, list) and command and values.get("folder") is None:
            first = command[0]
            if isinstance(first, SourcedText):
                return {**values, "folder": str(first.folder.absolute())}
        return values

    @model_validator(mode="after")
    def _check_program(self) -> "ProcessParameters":
        program = self.program_path()
        if program is None:
            raise ValueError(f"command: there is no program {self.command[0]!r}")
        if self.folder is not None and not self.folder.is_dir():
            raise ValueError(f"folder: {self.folder} is no folder")
        return self

    def program_path(self) -> str | None:
        """Return the path of the command's program, or None if it is not found."""
        name = self.command[0]
        if name == "python":
            return sys.executable
        beside = Path(self.folder or ".") / name
        return shutil.which(str(beside.absolute()) if "/" in name else name)

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key that has no effect."""
        said = [] if self.on_failure == "restart" else self.note_ineffective(
            "most_restarts", because='as on_failure is "stop"'
        )  # fmt: skip
        return said + (
            []
            if self.scan_rate_hz
            else self.note_ineffective("offset_s", because="without scan_rate_hz")
        )


class Process(Component):
    """Runs one's own program as a block, exchanging tables over pipes when messages arrive.

    What arrives is sent as the tables that a run records of it, and answers are tables of
    ``manoeuvres``, ``detections``, ``tracks`` or ``state_tracks`` with the columns of these
    messages. Docs in docs/foreign.md. A program that dies, hangs or sends garbage ends the run with
    its last words and exit code 3, or is started again (``on_failure``). With ``snapshots`` its
    scene looks ahead.
    """

    inputs = {
        "received": Input(Message, "trigger", "What is sent to it.", required=False, many=True)
    }
    outputs = {
        "manoeuvres": Output(Manoeuvres, "What the ownship is to fly."),
        "detections": Output(Detections, "What it detected."),
        "tracks": Output(Tracks, "What it holds of each target."),
        "state_tracks": Output(StateTracks, "Tracks with states."),
    }
    Parameters = ProcessParameters
    stands_alone = True

    @classmethod
    def class_for(cls, parameters: Any) -> type[Component]:
        """Return the class for the parameters: rewindable if the program has ``snapshots``."""
        return RewindableProcess if parameters.snapshots else cls

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the clock by which the program is called without input, if any."""
        rate = parameters.scan_rate_hz
        return None if rate is None else ClockSpec(rate, parameters.offset_s)

    def offer(self, port: str) -> Any:
        """Return an offer of detections, maybe with range, without accuracy; None for others."""
        return (
            SensorOffer(measures_range=True, resolution_rad=0.0) if port == "detections" else None
        )

    def setup(self) -> None:
        """Prepare the program; it starts when it is asked first."""
        self._link = ProcessLink(
            [str(self.p.program_path()), *self.p.command[1:]], Path(self.p.folder or ".")
        )
        #: Its state before the next call, and the state in which it is: one by value, one by run.
        self._state: bytes | None = None
        self._first_state: bytes | None = None
        self._is_in = _Current()
        #: How often it was asked, and how often it had something to say.
        self._calls = self._answers = 0
        rosters = offered_rosters(self.context)
        self._roster = rosters[0] if rosters else None

    def start(self) -> None:
        """Start the program, if it does not run yet, before its first call."""
        if not self._link.runs:
            self._start_program()

    # -- calls ---------------------------------------------------------------------------------

    def run(self, wake: Wake) -> Mapping[str, Message] | None:
        """Send the inputs of every instant of the wake-up to the program; return its answers."""
        parts: dict[str, list[Message]] = {}
        arrivals = wake.arrivals("received")
        for row, tick in enumerate(wake.ticks.tolist()):
            sent = []
            for new in arrivals:
                first, last = np.searchsorted(new.tick, [tick, tick + 1])
                if last > first:
                    sent.append((new.source, new.message.take(slice(int(first), int(last)))))
            answer = self._call_program(tick, int(wake.scans[row]), sent)
            said = list(self._messages(answer, wake.ticks[row : row + 1], sent))
            self._calls, self._answers = self._calls + 1, self._answers + bool(said)
            for name, message in said:
                parts.setdefault(name, []).append(message)
        return {n: type(found[0]).concatenate(found) for n, found in parts.items()} or None

    def _call_program(self, tick: int, scan: int, sent: Any) -> Any:
        frames = self._call_frames(tick, scan)
        for source, message in sent:
            for table, batch in _recorded_batches(message):
                frames += frame_parts_of_batch(table, batch, {"block": source})
        while True:
            try:
                return self._ask_and_keep_state(frames)
            except ProcessError:
                self._is_in.state = None
                if self.p.on_failure == "stop" or self._is_in.restarts >= self.p.most_restarts:
                    raise
                self._is_in.restarts += 1

    def _ask_and_keep_state(self, frames: list[Any]) -> Any:
        self.start()
        before = self._first_state if self._state is None else self._state
        wanted = []
        if before is not None and before is not self._is_in.state:
            wanted = frame_parts_of_batch(_STATE, _single_row_batch(state=before), {})
        answer = self._link.ask([*wanted, *frames], self.p.deadline_s)
        after = [table for about, table in answer if about.get("table") == _STATE]
        if type(self).rewindable:
            if not after or after[0].num_rows != 1 or after[0].column_names != ["state"]:
                self._link.stop()
                raise ProcessError("has not sent its state, which it said it would (snapshots)")
            self._state = self._is_in.state = after[0].column(0)[0].as_py()
        return [(about, table) for about, table in answer if about.get("table") != _STATE]

    def _start_program(self) -> None:
        self._link.start()
        about = {
            "version": VERSION, "block": self.name, "ticks_per_s": str(self.context.ticks_per_s),
            "arguments": json.dumps(self.p.arguments), "seed": str(self.context.streams.seed),
            "snapshots": str(type(self).rewindable).lower(),
        }  # fmt: skip
        answer = self._link.ask(
            frame_parts_of_batch(_HELLO, _single_row_batch(), about), self.p.deadline_s
        )
        said = answer[0][0] if answer else {}
        wrong = ""
        if said.get("table") != _HELLO:
            wrong = "has not said hello: its first answer must be a table of that name"
        elif said.get("version") != VERSION:
            wrong = f"speaks version {said.get('version')!r} of the exchange, and we {VERSION!r}"
        elif type(self).rewindable and said.get("snapshots") != "true":
            wrong = (
                "cannot hand out its state (its hello does not say snapshots = true): leave out "
                "snapshots in the scene"
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
        return frame_parts_of_batch(
            _CALL, _single_row_batch(tick=tick, time_s=time_s, scan=scan), {}
        )

    # -- answers -------------------------------------------------------------------------------

    def _messages(self, answer: Any, tick: IntArray, sent: Any) -> Iterator[tuple[str, Message]]:
        for about, table in answer:
            name = about.get("table", "")
            try:
                message = message_of_table(
                    name, table, tick, self._roster_of(sent), self.name, self.context.ticks_per_s
                )
            except ValueError as error:
                self._link.stop()
                raise ProcessError(f"sent a table {name!r}: {error}") from None
            if table.num_rows or name != "manoeuvres":
                yield name, message

    def _roster_of(self, sent: Any) -> Roster:
        for _, message in sent:
            if isinstance(found := getattr(message, "roster", None), Roster):
                self._roster = found
        return self._roster or Roster.from_pairs([])

    def failure_counts(self) -> dict[str, tuple[int, int]]:
        """Return how often the program was called if it never answered with a row, else nothing."""
        if self._answers or not self._calls:
            return {}
        return {"it was asked and answered with no row": (self._calls, self._calls)}

    def close(self) -> None:
        """End the program."""
        self._link.stop()

    def report(self) -> dict[str, Any]:
        """End the program and return how often it was restarted, or nothing if it never was."""
        self._link.stop()
        restarts = self._is_in.restarts
        return {"restarts": {self.name: restarts}} if restarts else {}


class RewindableProcess(Process):
    """A program that can save and restore its state, so that its scene can run ahead."""

    windowed = True
    rewindable = True


class _Current:
    """What belongs to the running program itself, and stays when the engine rewinds the block."""

    state: bytes | None = None
    restarts = 0


def _single_row_batch(**values: Any) -> Any:
    import pyarrow as pa

    if not values:
        return pa.RecordBatch.from_arrays([], schema=pa.schema([]))
    return pa.RecordBatch.from_pydict({name: [value] for name, value in values.items()})


def _recorded_batches(message: Message) -> Iterator[tuple[str, Any]]:
    """Yield the name and the Arrow batch of each table that a run records of a message."""
    from dsa_des.record.arrow import to_arrow

    declared = derive_columns(type(message)).recorded
    for table, columns in message.tables().items():
        kinds = {n: declared[table][n].kind if n in declared[table] else "int64" for n in columns}
        yield table, to_arrow(columns, kinds)
