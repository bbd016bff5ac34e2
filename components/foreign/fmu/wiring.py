"""How a scene wires an FMU: which variables are read and set, in which units, and what is wrong.

Nothing here runs; `components.foreign.fmu.block` goes by it.
"""

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from components.foreign.fmu.detections import DetectionOutputs
from components.foreign.fmu.model import TEXT_KINDS, FmuModel, PartitionClock, Variable
from components.foreign.fmu.start_values import first_inputs, start_value, value_count
from components.foreign.fmu.units import unit_of_column
from components.messages.steering import Manoeuvres
from dsa_des.errors import did_you_mean

_OWNSHIP = ("own_lat_deg", "own_lon_deg", "own_alt_m", "own_yaw_rad", "own_pitch_rad",
            "own_roll_rad")  # fmt: skip
_SOURCE = re.compile(r"(?P<block>[^.\[\]]+)\.(?P<column>[^\[\]]+)(\[(?P<which>[^\]]*)\])?")
_ELEMENT = re.compile(r"(?P<name>.*)\[(?P<place>\d+)\]")


class Source(NamedTuple):
    """Where an FMU's input value comes from: the block, its column, and which of its values."""

    place: int
    block: str
    column: str
    which: str | None
    variable: Variable
    key: str


class Wiring:
    """Which FMU variables are read and set, to and from which columns, and all that is wrong.

    Parameters
    ----------
    p : FmuParameters
    """

    def __init__(self, p: Any) -> None:
        self.wrong: list[str] = []
        self.p = p
        self.model: FmuModel = p.model
        self.starts = []
        for name in p.start:
            try:
                self.starts.append(start_value(self.model, p.start, name))
            except ValueError as error:
                self.wrong.append(f"start: {error}")
        self._read_outputs()
        self._read_inputs()
        self._read_clocks()
        for key, known in (
            ("ownship", _OWNSHIP),
            ("manoeuvre", Manoeuvres.manoeuvre_field_names()),
        ):
            self._check_fields(key, getattr(p, key), known)
        self.detections = DetectionOutputs(p.detections, p.targets, self)
        self.wrong += self.detections.wrong
        if self.model.kind == "se" and p.scan_rate_hz is not None:
            self.wrong.append("scan_rate_hz: a scheduled FMU has clocks of its own")
        if not self.model.varying_steps and p.scan_rate_hz is None and (p.inputs or p.ownship):
            self.wrong.append("scan_rate_hz: needed, the FMU takes steps of one length only")

    def size(self, variable: Variable) -> int:
        """Return how many values a variable has."""
        return value_count(self.model, self.p.start, variable)

    # -- outputs -------------------------------------------------------------------------------

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
        detected = DetectionOutputs.variable_names(self.p.detections, self.model)
        for extra in (*self.p.ownship.values(), *self.p.manoeuvre.values(), *detected):
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
        ordered = sorted(groups, key=lambda kind: kind in TEXT_KINDS)
        self.outputs = [(kind, self._references_and_sizes(groups[kind])) for kind in ordered]
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
            self.number_count += size if variable.kind not in TEXT_KINDS else 0
        self.layout += [(len(variables) + i, 0) for i in range(len(raised))]

    def _references_and_sizes(self, variables: Sequence[Variable]) -> list[tuple[int, int]]:
        return [(variable.reference, self.size(variable)) for variable in variables]

    def _check_fields(self, key: str, given: Mapping[str, str], known: Sequence[str]) -> None:
        for name, output in given.items():
            if name not in known:
                self.wrong.append(f"{key}: there is no {name!r}{did_you_mean(name, known)}")
            elif output in self.model.variables:
                variable = self.model.variables[output]
                try:
                    self.model.unit_factor_and_offset(unit_of_column(name), variable)
                    if self.size(variable) != 1 or variable.kind in TEXT_KINDS:
                        raise ValueError(f"{output!r} is no single number")
                except ValueError as error:
                    self.wrong.append(f"{key}.{name}: {error}")

    def output_index_and_conversion(self, name: str, output: str) -> tuple[int, float, float]:
        """Return (index, a, b): an output's index in the FMU's numbers, whose x becomes a x + b."""
        code = self.names.index(output)
        place = next(i for i, (signal, _) in enumerate(self.layout) if signal == code)
        a, b = self.model.unit_factor_and_offset(unit_of_column(name), self.model.variables[output])
        return place, 1.0 / a, -b / a

    # -- inputs --------------------------------------------------------------------------------

    def _read_inputs(self) -> None:
        self.sources: list[Source] = []
        given = dict(self.p.inputs)
        for name, members in self.model.terminals.items():
            if name in given and name not in self.model.variables:
                block, _, which = given.pop(name).partition("[")
                inputs = {m: v for m, v in members.items() if self._is_input(v)}
                tail = f"[{which}" if which else ""
                given |= {v: f"{block}.{member}{tail}" for member, v in inputs.items()}
        groups: dict[str, list[Variable]] = {}
        parsed: list[tuple[Variable, int, str]] = []
        for name, source in self._expand_targets(given):
            try:
                variable, place = self._input_and_element_index(name)
            except ValueError as error:
                self.wrong.append(f"inputs: {error}")
                continue
            group = groups.setdefault(variable.kind, [])
            if variable not in group:
                group.append(variable)
            parsed.append((variable, place, source))
        self.inputs = [(kind, self._references_and_sizes(groups[kind])) for kind in groups]
        first, self.defaults = dict[str, int](), list[float]()
        for kind in groups:
            for variable in groups[kind]:
                first[variable.name] = len(self.defaults)
                self.defaults += self._first_values_or_zeros(variable)
        for variable, place, source in parsed:
            match = _SOURCE.fullmatch(source)
            if match is None:
                self.wrong.append(
                    f"inputs: {variable.name!r} is {source!r}: it must be BLOCK.COLUMN, or "
                    "BLOCK.COLUMN[TARGET]"
                )
                continue
            at, key = first[variable.name] + place, f"inputs.{variable.name}"
            self.sources.append(
                Source(at, match["block"], match["column"], match["which"], variable, key)
            )
        self.discrete = any(
            variable.variability != "continuous" for group in groups.values() for variable in group
        )

    def _expand_targets(self, given: Mapping[str, str]) -> list[tuple[str, str]]:
        """Return pairs of input and source, with ``BLOCK.COLUMN[*]`` as one for each target.

        Of an array these are its elements, of ``plane[*].range`` the inputs of that number.
        """
        found = []
        for name, source in given.items():
            if not source.endswith("[*]"):
                found.append((name, source))
                continue
            if not self.p.targets:
                self.wrong.append(f"inputs: {name!r} is {source!r}: targets must name them")
            numbered = name if "*" in name else f"{name}[*]"
            found += [
                (numbered.replace("*", str(k)), f"{source[:-3]}[{target}]")
                for k, target in enumerate(self.p.targets, start=1)
            ]
        return found

    def _is_input(self, name: str) -> bool:
        variable = self.model.variables.get(name)
        return variable is not None and variable.causality == "input"

    def _input_and_element_index(self, name: str) -> tuple[Variable, int]:
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
        if variable.kind in TEXT_KINDS:
            raise ValueError(f"{name!r} is text: give it as a start value")
        if not 0 <= place < self.size(variable):
            raise ValueError(f"{name!r} has the elements 1 to {self.size(variable)}")
        return variable, place

    def _first_values_or_zeros(self, variable: Variable) -> list[float]:
        try:
            return first_inputs(self.model, self.p.start, variable)
        except ValueError:  # said of the start values already
            return [0.0] * self.size(variable)

    # -- clocks --------------------------------------------------------------------------------

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
        if known and self.model.kind == "cs" and not self.model.events:
            self.wrong.append("file: it has clocks, and no event mode in which they could tick")

    # -- what the FMU's process needs to know --------------------------------------------------

    def spec(self, name: str, ticks_per_s: int, *, rewinds: bool) -> dict[str, Any]:
        """Return the description of all reads and writes that the FMU's process needs.

        Raises
        ------
        ValueError
            If a clock of a co-simulation FMU ticks between two ticks of the scene.
        """
        model = self.model
        return {
            "version": model.version, "kind": model.kind, "identifier": model.identifier,
            "token": model.token, "name": name, "events": model.events, "rewinds": rewinds,
            "discrete": self.discrete, "start": [tuple(one) for one in self.starts],
            "inputs": self.inputs, "outputs": self.outputs, "raised": self.raised,
            "clocks": [self._clock_spec(clock, ticks_per_s) for clock in model.clocks.values()],
        }  # fmt: skip

    def _clock_spec(self, clock: PartitionClock, ticks_per_s: int) -> dict[str, Any]:
        """Return when a clock ticks; a scheduled FMU's clocks are told to tick at every wake."""
        interval, shift = Fraction(0), Fraction(0)
        given = self.p.clocks.get(clock.name)
        times: list[Fraction] = []
        if self.model.kind == "cs":
            times = [] if given is None or isinstance(given, str) else list(given)
            if clock.interval_s is not None and clock.variability != "triggered":
                interval, shift = clock.interval_s, clock.shift_s
        for instant in (interval, shift, *times):
            if (instant * ticks_per_s).denominator != 1:
                raise ValueError(
                    f"clock {clock.name!r} of {self.model.path.name} ticks at {instant} s, which "
                    f"is no whole number of the scene's ticks (1/{ticks_per_s} s): a block whose "
                    f"scan_rate_hz is a multiple of {instant.denominator} makes it one"
                )
        return {
            "name": clock.name, "reference": clock.reference, "priority": clock.priority,
            "fraction": clock.fraction, "asked": clock.variability in ("countdown", "changing"),
            "interval": int(interval * ticks_per_s), "shift": int(shift * ticks_per_s),
            "times": sorted(int(time * ticks_per_s) for time in times),
        }  # fmt: skip
