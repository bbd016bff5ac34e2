"""FMUs as blocks (``foreign.fmu``)."""

import math
import re
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import fields
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from components.foreign.fmu.model import FmuModel, Variable, read_fmu, unit_of_column
from components.foreign.signals import Signals
from components.messages.reach import farthest_look
from components.messages.steering import Manoeuvre, Manoeuvres
from components.messages.targets import TrafficStates
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import (
    Component,
    Input,
    NonNegativeRational,
    Output,
    Parameters,
    PositiveRational,
    Rational,
    ScenePath,
)
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.errors import Disagreements, did_you_mean
from dsa_des.time.clock import ClockSpec

_OWNSHIP = ("own_lat_deg", "own_lon_deg", "own_alt_m", "own_yaw_rad", "own_pitch_rad",
            "own_roll_rad")  # fmt: skip
#: What a manoeuvre changes; its other fields say how fast.
_CHANGES = ("turn_rad", "climb_m", "speed_mps", "vertical_speed_mps")
_SOURCE = re.compile(r"(?P<block>[^.\[\]]+)\.(?P<column>[^\[\]]+)(\[(?P<which>[^\]]*)\])?")
_ELEMENT = re.compile(r"(?P<name>.*)\[(?P<place>\d+)\]")
_MOST_ELEMENTS = 100_000


class FmuParameters(Parameters):
    """Parameters of an FMU."""

    file: ScenePath = Field(description="The FMU: FMI 2 or 3, co-simulation or, FMI 3, scheduled.")
    scan_rate_hz: PositiveRational | None = Field(
        default=None,
        description="Communication points per second. By default they are the instants at which "
        "something arrives, and without wires the FMU's own step.",
    )
    offset_s: NonNegativeRational = Field(
        default=Fraction(0), description="Time of the first communication point, s."
    )
    start: dict[str, Any] = Field(
        default={}, description='Start values by variable, in its own unit or as "5 km/h".'
    )
    inputs: dict[str, str] = Field(
        default={},
        description='Where inputs come from: "BLOCK.COLUMN", "BLOCK.COLUMN[TARGET]", and of '
        'another FMU "BLOCK.VARIABLE"; a whole terminal as "BLOCK" or "BLOCK[TARGET]".',
    )
    outputs: list[str] | None = Field(
        default=None, description="Variables that are sent and recorded; by default all outputs."
    )
    clocks: dict[str, list[Rational] | str] = Field(
        default={},
        description="When triggered clocks tick: at times, s, or whenever the block of a name "
        "sends.",
    )
    ownship: dict[str, str] = Field(
        default={},
        description="Fields of the ownship's state (own_alt_m) by output: traffic that comes in "
        "goes out with them.",
    )
    manoeuvre: dict[str, str] = Field(
        default={}, description="Fields of a manoeuvre (turn_rad) by output that commands it."
    )
    deadline_s: float = Field(
        default=10.0, gt=0, description="Longest time for one communication point, s."
    )
    _model: Any = PrivateAttr(None)
    _wiring: Any = PrivateAttr(None)

    @property
    def model(self) -> FmuModel:
        """What the FMU says of itself."""
        return self._model

    @property
    def wiring(self) -> "Wiring":
        """How its variables are read and set."""
        return self._wiring

    @model_validator(mode="after")
    def _fits(self) -> "FmuParameters":
        try:
            self._model = read_fmu(self.file)
        except ValueError as error:
            raise Disagreements([f"file: {error}"]) from error
        wiring = Wiring(self)
        Disagreements.refuse(wiring.wrong)
        self._wiring = wiring
        return self

    def clock_spec(self) -> ClockSpec | None:
        """Return when it communicates, if that does not follow from what arrives."""
        if self.model.kind == "se":
            step = _common(self.wiring.instants)
            return ClockSpec(1 / step) if step else None
        if self.scan_rate_hz is not None:
            return ClockSpec(self.scan_rate_hz, self.offset_s)
        if not self.wiring.sources and not self.ownship:
            return ClockSpec(1 / (self.model.step_s or Fraction(1, 100)), self.offset_s)
        return None


def _common(instants: Sequence[Fraction]) -> Fraction:
    """Return the largest step of which all instants are multiples."""
    step = Fraction(0)
    for instant in instants:
        denominator = math.lcm(step.denominator, instant.denominator)
        step = Fraction(math.gcd(int(step * denominator), int(instant * denominator)), denominator)
    return step


class Wiring:
    """How the variables of an FMU are read and set, with all that is wrong about it."""

    def __init__(self, p: FmuParameters) -> None:
        self.wrong: list[str] = []
        self.p, self.model = p, p.model
        self.sizes = dict[str, int]()
        self.starts = [s for s in map(self._start, p.start.items()) if s is not None]
        self._read_outputs()
        self._read_inputs()
        self._read_clocks()
        for key, known in (("ownship", _OWNSHIP), ("manoeuvre", Manoeuvre._fields)):
            self._read_fields(key, getattr(p, key), known)
        if self.model.kind == "se" and p.scan_rate_hz is not None:
            self.wrong.append("scan_rate_hz: a scheduled FMU has clocks of its own")
        if not self.model.varying_steps and p.scan_rate_hz is None and (p.inputs or p.ownship):
            self.wrong.append("scan_rate_hz: needed, the FMU takes steps of one length only")

    def _start(self, item: tuple[str, Any]) -> Any:
        name, value = item
        try:
            variable = self.model.variable(name)
            if not variable.settable:
                raise ValueError(f"{name!r} is a {variable.causality} of which no start is given")
            size = self.size(variable)
            values = _flat(value)
            if len(values) != size:
                raise ValueError(f"{name!r} has {len(values)} values where it needs {size}")
            values = [self._value(variable, one) for one in values]
        except ValueError as error:
            self.wrong.append(f"start: {error}")
            return None
        structural = variable.causality == "structuralParameter"
        return variable.kind, variable.reference, values, structural

    def _value(self, variable: Variable, value: Any) -> Any:
        kind, said = variable.kind, f"{variable.name!r} is {value!r}"
        if kind == "String":
            if isinstance(value, str):
                return str(value)
            raise ValueError(f"{said}: text is needed")
        if kind == "Binary":
            try:
                return bytes.fromhex(value)
            except (TypeError, ValueError):
                raise ValueError(f"{said}: hexadecimal digits are needed") from None
        if kind == "Boolean":
            if isinstance(value, bool):
                return value
            raise ValueError(f"{said}: true or false is needed")
        if kind.startswith("Float"):
            if isinstance(value, str) and " " in value.strip():
                number, unit = value.strip().split(None, 1)
                a, b = self.model.converted(unit, variable)
                try:
                    return a * float(number) + b
                except ValueError:
                    raise ValueError(f"{said}: a number and a unit are needed") from None
            if isinstance(value, int | float) and not isinstance(value, bool):
                return float(value)
            raise ValueError(f"{said}: a number is needed")
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"{said}: a whole number is needed")
        bounds = np.iinfo(kind.lower())
        if not bounds.min <= value <= bounds.max:
            raise ValueError(f"{said}: it must be from {bounds.min} to {bounds.max}")
        return value

    def size(self, variable: Variable) -> int:
        """Return how many values a variable has."""
        size = 1
        for length in variable.dimensions:
            if isinstance(length, str):
                given = self.p.start.get(length, self.model.variables[length].start)
                length = int(given) if isinstance(given, int | str) else 1
            size *= length
        if not 0 <= size <= _MOST_ELEMENTS:
            raise ValueError(f"{variable.name!r} has {size} values: at most {_MOST_ELEMENTS}")
        return size

    def _read_outputs(self) -> None:
        names = self.p.outputs
        raised = list(self.model.raised)
        if names is None:
            names = [
                v.name
                for v in self.model.variables.values()
                if v.causality == "output" and not v.alias
            ]
        else:
            raised = [name for name in names if name in raised]
            names = [name for name in names if name not in raised]
        for extra in (*self.p.ownship.values(), *self.p.manoeuvre.values()):
            if extra not in names:
                names = [*names, extra]
        groups: dict[str, list[Variable]] = {}
        for name in dict.fromkeys(names):
            try:
                variable = self.model.variable(name)
                self.size(variable)
            except ValueError as error:
                self.wrong.append(f"outputs: {error}")
                continue
            groups.setdefault(variable.kind, []).append(variable)
        text = ("String", "Binary")
        ordered = sorted(groups, key=lambda kind: kind in text)
        self.outputs = [(kind, self._sized(groups[kind])) for kind in ordered]
        variables = [variable for kind in ordered for variable in groups[kind]]
        self.names = tuple([v.name for v in variables] + raised)
        self.units = tuple([v.unit for v in variables] + [""] * len(raised))
        self.raised = [self.model.raised[name] for name in raised]
        #: (name, element) of each value of a row: numbers, then text, then clocks.
        self.layout: list[tuple[int, int]] = []
        self.number_count = 0
        for code, variable in enumerate(variables):
            size = self.size(variable)
            array = bool(variable.dimensions)
            self.layout += [(code, i + 1 if array else 0) for i in range(size)]
            self.number_count += size if variable.kind not in text else 0
        self.layout += [(len(variables) + i, 0) for i in range(len(raised))]

    def _sized(self, variables: Sequence[Variable]) -> list[tuple[int, int]]:
        return [(variable.reference, self.size(variable)) for variable in variables]

    def _read_inputs(self) -> None:
        #: For each source: its column among the inputs, and how it is scaled.
        self.sources: list[tuple[int, str, str, str | None, Variable, str]] = []
        given = dict(self.p.inputs)
        for name, members in self.model.terminals.items():
            if name in given and name not in self.model.variables:
                block, _, which = given.pop(name).partition("[")
                inputs = {m: v for m, v in members.items() if self._is_input(v)}
                tail = f"[{which}" if which else ""
                given |= {v: f"{block}.{member}{tail}" for member, v in inputs.items()}
        groups: dict[str, list[Variable]] = {}
        parsed: list[tuple[Variable, int, str]] = []
        for name, source in given.items():
            try:
                variable, place = self._input(name)
            except ValueError as error:
                self.wrong.append(f"inputs: {error}")
                continue
            group = groups.setdefault(variable.kind, [])
            if variable not in group:
                group.append(variable)
            parsed.append((variable, place, source))
        self.inputs = [(kind, self._sized(groups[kind])) for kind in groups]
        first, self.defaults = dict[str, int](), list[float]()
        for kind in groups:
            for variable in groups[kind]:
                first[variable.name] = len(self.defaults)
                self.defaults += self._defaults(variable)
        for variable, place, source in parsed:
            match = _SOURCE.fullmatch(source)
            if match is None:
                self.wrong.append(
                    f"inputs: {variable.name!r} is {source!r}: it must be BLOCK.COLUMN, or "
                    "BLOCK.COLUMN[TARGET]"
                )
                continue
            block, column, which = match["block"], match["column"], match["which"]
            key = f"inputs.{variable.name}"
            self.sources.append((first[variable.name] + place, block, column, which, variable, key))
        self.discrete = any(
            variable.variability != "continuous" for group in groups.values() for variable in group
        )

    def _is_input(self, name: str) -> bool:
        variable = self.model.variables.get(name)
        return variable is not None and variable.causality == "input"

    def _input(self, name: str) -> tuple[Variable, int]:
        match, place = _ELEMENT.fullmatch(name), 0
        if name not in self.model.variables and match and match["name"] in self.model.variables:
            name, place = match["name"], int(match["place"]) - 1
        known = [v.name for v in self.model.variables.values() if v.causality == "input"]
        if name not in known:
            known += list(self.model.terminals)
            raise ValueError(
                f"{self.model.path.name} has no input {name!r}{did_you_mean(name, known)}"
            )
        variable = self.model.variables[name]
        if variable.kind in ("String", "Binary"):
            raise ValueError(f"{name!r} is text: give it as a start value")
        if not 0 <= place < self.size(variable):
            raise ValueError(f"{name!r} has the elements 1 to {self.size(variable)}")
        return variable, place

    def _defaults(self, variable: Variable) -> list[float]:
        size = self.size(variable)
        given = self.p.start.get(variable.name)
        for _, reference, values, _ in self.starts:
            if given is not None and reference == variable.reference:
                return [float(value) for value in values]
        words = (variable.start or "").split()
        numbers = [_number(word) for word in words]
        return numbers if len(numbers) == size else [numbers[0] if numbers else 0.0] * size

    def _read_clocks(self) -> None:
        #: Instants that a scheduled FMU's wakes must hit: intervals, shifts, times.
        self.instants: list[Fraction] = []
        known = self.model.clocks
        for name in self.p.clocks:
            if name not in known or known[name].variability != "triggered":
                triggered = [n for n, clock in known.items() if clock.variability == "triggered"]
                self.wrong.append(
                    f"clocks: {self.model.path.name} has no triggered input clock {name!r}"
                    f"{did_you_mean(name, triggered)}"
                )
        for clock in known.values():
            if clock.variability in ("constant", "fixed", "tunable"):
                if clock.interval_s is None or clock.interval_s <= 0:
                    self.wrong.append(f"file: clock {clock.name!r} has no interval above 0")
                    continue
                self.instants += [clock.interval_s, clock.shift_s]
        for name, times in self.p.clocks.items():
            if not isinstance(times, str):
                if any(time < 0 for time in times):
                    self.wrong.append(f"clocks: {name!r} ticks before 0 s")
                self.instants += times
        self.instants = [instant for instant in self.instants if instant > 0]

    def _read_fields(self, key: str, given: Mapping[str, str], known: Sequence[str]) -> None:
        for name, output in given.items():
            if name not in known:
                self.wrong.append(f"{key}: there is no {name!r}{did_you_mean(name, known)}")
            elif output in self.model.variables:
                variable = self.model.variables[output]
                try:
                    self.model.converted(unit_of_column(name), variable)
                    if self.size(variable) != 1 or variable.kind in ("String", "Binary"):
                        raise ValueError(f"{output!r} is no single number")
                except ValueError as error:
                    self.wrong.append(f"{key}.{name}: {error}")

    def outward(self, name: str, output: str) -> tuple[int, float, float]:
        """Return where the numbers hold an output, and how it becomes a column: (place, a, b)."""
        code = self.names.index(output)
        place = next(i for i, (signal, _) in enumerate(self.layout) if signal == code)
        a, b = self.model.converted(unit_of_column(name), self.model.variables[output])
        return place, 1.0 / a, -b / a

    def spec(self, name: str) -> dict[str, Any]:
        """Return what the FMU's process needs to know."""
        model = self.model
        asked = ("countdown", "changing")
        return {
            "version": model.version, "kind": model.kind, "identifier": model.identifier,
            "token": model.token, "name": name, "events": model.events,
            "discrete": self.discrete, "start": self.starts, "inputs": self.inputs,
            "outputs": self.outputs, "raised": self.raised,
            "clocks": [
                {"name": c.name, "reference": c.reference, "priority": c.priority,
                 "fraction": c.fraction, "asked": c.variability in asked}
                for c in model.clocks.values()
            ],
        }  # fmt: skip


def _flat(value: Any) -> list[Any]:
    return [one for item in value for one in _flat(item)] if isinstance(value, list) else [value]


def _number(word: str) -> float:
    return float({"true": 1, "false": 0}.get(word, word))


class _Saved:
    """A state in which the FMU was saved; it is given back when nobody holds it any more."""

    def __init__(self, slot: int, freed: list[int]) -> None:
        self.slot, self._freed = slot, freed

    def __del__(self) -> None:
        self._freed.append(self.slot)


class ForeignFmu(Component):
    """Runs an FMU (FMI 2 or 3) in a process of its own, as a block of the scene.

    It communicates at the scans of its clock, or whenever something arrives: it is stepped up to
    the instant, given its inputs as they are then, and read. Inputs hold their last value.

    Raises
    ------
    FmuError
        If the FMU fails, crashes, or needs longer than ``deadline_s``.

    References
    ----------
    Functional Mock-up Interface 2.0.4 and 3.0.2.
    """

    inputs = {
        "messages": Input(Message, "trigger", "What its inputs are read from.", False, True),
    }
    outputs = {
        "signals": Output(Signals, "Its outputs."),
        "states": Output(TrafficStates, "Traffic with the ownship where the FMU flies it."),
        "manoeuvres": Output(Manoeuvres, "What it commands the ownship to fly."),
    }
    Parameters = FmuParameters
    windowed = True
    stands_alone = True

    @classmethod
    def class_for(cls, parameters: Any) -> type[Component]:
        """Return the class whose state can be saved, or not, and that sends what is asked for."""
        if parameters.ownship or parameters.manoeuvre:
            return RewindableFmu if parameters.model.rewindable else cls
        return RewindableSignalFmu if parameters.model.rewindable else SignalFmu

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return its clock, if what arrives does not decide."""
        found: ClockSpec | None = parameters.clock_spec()
        return found

    def records(self) -> list[type[Message]]:
        """Return the tables that it fills."""
        return [Signals, *([Manoeuvres] if self.p.manoeuvre else [])]

    def offer(self, port: str) -> Any:
        """Say what its signals are, or pass on what the traffic says."""
        if port == "signals":
            return dict(zip(self.p.wiring.names, self.p.wiring.units, strict=True))
        if port == "states":
            offers = [one.offer for one in self.context.producers]
            return next((offer for offer in offers if hasattr(offer, "names")), None)
        return None

    def setup(self) -> None:
        """Start the FMU's process, and see that everything it reads from is there."""
        from components.foreign.fmu.process import process_for

        wiring, model = self.p.wiring, self.p.model
        self._check_sources()
        reach = farthest_look(c.request for c in self.context.consumers if c.port == "states")
        if self.p.ownship and math.isfinite(reach.range_m) and reach.lasts_s > 0.0:
            raise ValueError(
                "a sensor needs to know where aircraft are between instants, as beam_sweep and "
                "measures_range_rate do: an FMU says where the ownship is at instants only"
            )
        self._process = process_for(model.path, alone=model.alone)
        self._number = self._process.open(wiring.spec(self.name), self.p.deadline_s)
        self._freed: Any = _Shared()
        self._saved = _Saved(0, self._freed.slots)
        self._last: FloatArray = np.array(wiring.defaults)
        self._set: FloatArray = np.full(len(wiring.defaults), np.nan)
        self._told: FloatArray = np.zeros(len(self.p.manoeuvre))
        self._traffic: Any = None
        self._scales: dict[int, tuple[float, float]] = {}

    def _check_sources(self) -> None:
        fed = {producer.block: producer for producer in self.context.producers}
        clocks = [(name, who) for name, who in self.p.clocks.items() if isinstance(who, str)]
        named = [(key, block) for _, block, _, _, _, key in self.p.wiring.sources]
        for key, block in [*named, *((f"clocks.{name}", who) for name, who in clocks)]:
            if block not in fed:
                raise ValueError(
                    f"{key}: no wire comes from {block!r}{did_you_mean(block, sorted(fed))}"
                )
        for _, block, column, _, variable, key in self.p.wiring.sources:
            offer = fed[block].offer
            if (
                isinstance(offer, dict)
                and offer
                and all(isinstance(u, str) for u in offer.values())
            ):
                if column not in offer:
                    raise ValueError(
                        f"{key}: {block!r} gives no {column!r}{did_you_mean(column, offer)}"
                    )
                self.p.model.converted(offer[column], variable)

    def close(self) -> None:
        """End the FMU's process: the simulation is over."""
        self._process.close()

    # -- running -------------------------------------------------------------------------------

    def run(self, wake: Wake) -> Mapping[str, Message] | None:
        """Step the FMU through the instants, and send what it gives."""
        own = np.arange(len(wake))
        scheduled = self.p.model.kind == "se"
        due: list[list[int]] = [[] for _ in own]
        if scheduled:
            due = self._due(wake)
            own = np.array([row for row in own if due[row] or self._waiting], dtype=np.int64)
        elif self.p.clock_spec() is not None:
            own = np.flatnonzero(wake.scans >= 0)
        values, traffic = self._values(wake)
        if len(own) == 0:
            return None
        rows = np.ascontiguousarray(values[own])
        changed = np.any(rows != np.vstack([self._set[np.newaxis], rows[:-1]]), axis=1)
        self._set = rows[-1].copy()
        freed, self._freed.slots[:] = list(self._freed.slots), []
        answer = self._process.ask(
            {
                "do": "run", "instance": self._number, "slot": self._saved.slot, "freed": freed,
                "ticks": wake.ticks[own].tolist(), "per_s": wake.ticks_per_s,
                "inputs": rows, "changed": changed.tolist(), "due": [due[row] for row in own],
                "save": type(self).rewindable,
            },
            self.p.deadline_s,
        )  # fmt: skip
        if type(self).rewindable:
            self._saved = _Saved(answer["slot"], self._freed.slots)
        own = own[: answer["done"]]
        if len(own) == 0:
            return None
        for name in ("numbers", "raised"):
            answer[name] = answer[name][: len(own)]
        return self._messages(wake.ticks[own], answer, traffic, own)

    #: Whether a scheduled FMU has a clock that it sets itself, so that every wake may be its.
    @property
    def _waiting(self) -> bool:
        return any(c.variability in ("countdown", "changing") for c in self.p.model.clocks.values())

    def _due(self, wake: Wake) -> list[list[int]]:
        """Return the clocks that tick at each row."""
        per_s, ticks = wake.ticks_per_s, wake.ticks
        due: list[list[int]] = [[] for _ in ticks]
        for number, clock in enumerate(self.p.model.clocks.values()):
            given = self.p.clocks.get(clock.name)
            if clock.interval_s is not None and clock.variability != "triggered":
                shift, interval = int(clock.shift_s * per_s), int(clock.interval_s * per_s)
                ticking = (ticks >= shift) & ((ticks - shift) % interval == 0)
            elif isinstance(given, str):
                came = [a.tick for a in wake.arrivals("messages") if a.source == given]
                ticking = np.isin(wake.ticks, np.concatenate(came)) if came else ticks < 0
            else:
                ticking = np.isin(ticks, [int(time * per_s) for time in given or ()])
            for row in np.flatnonzero(ticking).tolist():
                due[row].append(number)
        return due

    def _values(self, wake: Wake) -> tuple[FloatArray, Any]:
        """Return the inputs at each row, and the traffic with the row that holds there."""
        values = np.tile(self._last, (len(wake), 1))
        traffic: list[tuple[Any, IntArray]] = []
        for arrivals in wake.arrivals("messages"):
            message = arrivals.message
            place = np.searchsorted(arrivals.tick, wake.ticks, side="right") - 1
            if self.p.ownship and isinstance(message, TrafficStates):
                traffic.append((message, place))
            for at, block, column, which, variable, key in self.p.wiring.sources:
                if block != arrivals.source or not len(message):
                    continue
                if at not in self._scales:
                    unit = unit_of_column(column)
                    if isinstance(message, Signals) and column in message.names:
                        unit = message.units[message.names.index(column)]
                    self._scales[at] = self.p.model.converted(unit, variable)
                a, b = self._scales[at]
                came = a * _column(message, column, which, key) + b
                known = np.isfinite(came)
                held = np.maximum.accumulate(np.where(known, np.arange(len(came)), -1))[place]
                there = (place >= 0) & (held >= 0)
                values[there, at] = came[held[there]]
        if len(values):
            self._last = values[-1].copy()
        return values, self._held_traffic(wake, traffic)

    def _held_traffic(self, wake: Wake, came: list[tuple[Any, IntArray]]) -> Any:
        if not self.p.ownship:
            return None
        parts = [] if self._traffic is None else [self._traffic]
        shift = len(parts)
        place = np.full(len(wake), -1, dtype=np.int64)
        for message, where in came:
            parts.append(message)
            place = where
        if not parts:
            return None
        whole = type(parts[-1]).concatenate(parts)
        rows = np.where(place >= 0, place + shift, shift - 1)
        if rows[-1] >= 0:
            self._traffic = whole.take(rows[-1:])
        return whole, rows

    # -- sending -------------------------------------------------------------------------------

    def _messages(self, ticks: IntArray, answer: Any, traffic: Any, own: IntArray) -> Any:
        wiring = self.p.wiring
        numbers, texts, raised = answer["numbers"], answer["texts"], answer["raised"]
        count, wide = len(ticks), len(wiring.layout)
        values = np.full((count, wide), np.nan)
        values[:, : wiring.number_count] = numbers
        if raised.shape[1]:
            values[:, wide - raised.shape[1] :] = raised
        words = [""] * (count * wide)
        for row, said in enumerate(texts):
            start = row * wide + wiring.number_count
            words[start : start + len(said)] = said
        for (row, place), word in answer["exact"].items():
            words[row * wide + place] = word
        sent: dict[str, Message] = {}
        if wide:
            sent["signals"] = Signals.of_rows(
                ticks, wiring.layout, values, words, wiring.names, wiring.units
            )
        if traffic is not None:
            whole, rows = traffic
            there = rows[own] >= 0
            states = copy(whole.take(rows[own][there]))
            states.tick = ticks[there]
            states.flights = None
            for name, output in self.p.ownship.items():
                place, a, b = wiring.outward(name, output)
                setattr(states, name, a * numbers[there, place] + b)
            sent["states"] = states
        if self.p.manoeuvre:
            manoeuvres = self._commands(ticks, numbers)
            if manoeuvres is not None:
                sent["manoeuvres"] = manoeuvres
        return sent

    def _commands(self, ticks: IntArray, numbers: FloatArray) -> Manoeuvres | None:
        """Return the commands that are new, and not to do nothing."""
        how = [self.p.wiring.outward(*item) for item in self.p.manoeuvre.items()]
        told = np.stack([a * numbers[:, place] + b for place, a, b in how], axis=1)
        before = np.vstack([self._told[np.newaxis], told[:-1]])
        changes = [place for place, name in enumerate(self.p.manoeuvre) if name in _CHANGES]
        new = np.flatnonzero((told != before).any(axis=1) & (told[:, changes] != 0.0).any(axis=1))
        self._told = told[-1].copy()
        names = list(self.p.manoeuvre)
        return Manoeuvres.at_rows(
            RunTicks.of_run(0, ticks),
            {
                row: Manoeuvre(**dict(zip(names, told[row].tolist(), strict=True)))
                for row in new.tolist()
            },
        )


class RewindableFmu(ForeignFmu):
    """An FMU whose state can be saved: it looks ahead, and is taken back if something came."""

    rewindable = True


class SignalFmu(ForeignFmu):
    """An FMU that sends no message but its signals."""

    outputs = {"signals": ForeignFmu.outputs["signals"]}


class RewindableSignalFmu(SignalFmu):
    """The same, where its state can be saved."""

    rewindable = True


class _Shared:
    """The numbers of states that nobody holds; it is never taken back itself."""

    def __init__(self) -> None:
        self.slots: list[int] = []


def _column(message: Any, column: str, which: str | None, key: str) -> FloatArray:
    """Return a value for each row of a message; NaN where it has none."""
    if isinstance(message, Signals):
        return _signal(message, column, which, key)
    known = [item.name for item in fields(message) if _is_numbers(getattr(message, item.name))]
    if column not in known:
        raise ValueError(
            f"{key}: {type(message).__name__} has no column {column!r}{did_you_mean(column, known)}"
        )
    values: AnyArray = getattr(message, column)
    rows = len(message)
    entries = hasattr(message, "offsets") and len(values) == int(message.offsets[-1])
    if which is None:
        if (
            values.ndim == 1
            and len(values) == rows
            and not (entries and _per_entry(message, column))
        ):
            return values.astype(np.float64)
        raise ValueError(f"{key}: {column!r} has a value for each target: say {column}[TARGET]")
    names = message.roster.names
    if which not in names:
        raise ValueError(f"{key}: there is no target {which!r}{did_you_mean(which, names)}")
    target = names.index(which)
    found = np.full(rows, np.nan)
    if values.ndim == 2:
        place = np.flatnonzero(message.columns == target)
        if len(place):
            found = np.where(message.present[:, place[0]], values[:, place[0]], np.nan)
        return found
    row = np.repeat(np.arange(rows), np.diff(message.offsets))
    mine = message.target == target
    found[row[mine]] = values[mine]
    return found


def _is_numbers(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf"


def _per_entry(message: Any, column: str) -> bool:
    found = next(item for item in fields(message) if item.name == column)
    return found.metadata.get("per") == "entry"


def _signal(message: Signals, column: str, which: str | None, key: str) -> FloatArray:
    if column not in message.names:
        raise ValueError(
            f"{key}: there is no signal {column!r}{did_you_mean(column, message.names)}"
        )
    mine = message.signal == message.names.index(column)
    if which is not None:
        mine &= message.element == int(which)
    row = np.repeat(np.arange(len(message)), np.diff(message.offsets))
    found = np.full(len(message), np.nan)
    found[row[mine]] = message.value[mine]
    return found
