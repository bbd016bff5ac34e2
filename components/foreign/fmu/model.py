"""What an FMU says of itself: variables, units, clocks; read from its file, nothing is run."""

import math
import xml.etree.ElementTree as ElementTree
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from components.foreign.fmu.units import Scale, scale_of
from dsa_des.errors import did_you_mean
from dsa_des.files.input_files import cache_file_reads

_KINDS = {"Real": "Float64", "Integer": "Int32"}
#: Kinds whose values are no numbers.
TEXT_KINDS = ("String", "Binary")


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    Parameters
    ----------
    name, unit : str
    reference : int
        What the FMU knows it by.
    kind : str
        As FMI 3 calls types; an enumeration is a whole number.
    causality, variability : str
    dimensions : tuple of (int or str)
        Lengths, or the structural parameters that hold them.
    start : str or None
    settable : bool
        Whether a scene may give its start value.
    items : tuple of (str, int)
        Of an enumeration: its names and what they stand for.
    """

    name: str
    unit: str
    reference: int
    kind: str
    causality: str
    variability: str
    dimensions: tuple[int | str, ...] = ()
    start: str | None = None
    settable: bool = False
    alias: bool = False
    items: tuple[tuple[str, int], ...] = ()

    def enumeration_value(self, name: str) -> int:
        """Return an enumeration item's integer by name; else ValueError with the nearest name."""
        known = dict(self.items)
        if name not in known:
            raise ValueError(
                f"{self.name!r} is {name!r}: it must be one of {', '.join(known)}"
                f"{did_you_mean(name, known)}"
            )
        return known[name]


@dataclass(frozen=True)
class PartitionClock:
    """An input clock of an FMI 3 model; ``interval_s`` is None where the interval varies."""

    name: str
    reference: int
    priority: int
    variability: str
    interval_s: Fraction | None = None
    shift_s: Fraction = Fraction(0)
    fraction: bool = False


@dataclass(frozen=True, eq=False)
class FmuModel:
    """The content of an FMU's model description.

    Parameters
    ----------
    path : Path
    version : {2, 3}
    kind : {"cs", "se"}
        Co-simulation or scheduled execution.
    identifier, token : str
    rewindable, alone, varying_steps, events : bool
        Whether its state can be saved; whether a process can hold one instance only; whether steps
        may differ in length; whether it has an event mode.
    step_s, internal_step_s : Fraction or None
        Of its default experiment, and the fixed one that it takes inside.
    """

    path: Path
    version: int
    kind: str
    identifier: str
    token: str
    rewindable: bool
    alone: bool
    varying_steps: bool
    events: bool
    step_s: Fraction | None
    internal_step_s: Fraction | None
    variables: Mapping[str, Variable]
    scales: Mapping[str, Scale | None]
    clocks: Mapping[str, PartitionClock] = field(default_factory=dict)
    raised: Mapping[str, int] = field(default_factory=dict)
    terminals: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def variable(self, name: str, allowed: str = "") -> Variable:
        """Return the variable of that name, of the ``allowed`` causality if one is given;
        ValueError, with the nearest name, if there is none.
        """
        names = [v.name for v in self.variables.values() if allowed in ("", v.causality)]
        if name not in names:
            what = f"{allowed} variable" if allowed else "variable"
            raise ValueError(f"{self.path.name} has no {what} {name!r}{did_you_mean(name, names)}")
        return self.variables[name]

    def unit_factor_and_offset(self, unit: str, variable: Variable) -> tuple[float, float]:
        """Return (a, b): a value x of `unit` is a x + b in the variable's own unit.

        Raises
        ------
        ValueError
            If one cannot be made of the other. A variable without a unit takes any.
        """
        own = variable.unit
        if own in ("", unit) or not unit:
            return 1.0, 0.0
        to = self.scales.get(own) or scale_of(own)
        known = scale_of(unit)
        if known is None or to is None or known.powers != to.powers:
            raise ValueError(
                f"{variable.name!r} of {self.path.name} is in {own!r}, which {unit!r} cannot be "
                "made into"
            )
        return known.factor / to.factor, (known.offset - to.offset) / to.factor


@cache_file_reads(64)
def read_fmu(path: Path) -> FmuModel:
    """Return the model description of an FMU.

    Raises
    ------
    ValueError
        If it is no FMU that can run here: the reason, and what there is instead.
    """
    try:
        path.stat()
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None
    try:
        import fmpy
    except ImportError:
        raise ValueError("foreign.fmu needs FMPy: pip install 'dsa-des[fmi]'") from None
    try:
        said: Any = fmpy.read_model_description(str(path), validate=False)
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            terminals = _terminal_variables_by_member(archive, names)
            clocks, raised = _clocks_and_output_references(archive)
    except Exception as error:
        first = (str(error).splitlines() or [type(error).__name__])[0]
        raise ValueError(f"{path} is no FMU that can be read: {first}") from error
    version = 2 if said.fmiVersion.startswith("2.") else 3 if said.fmiVersion[0] == "3" else 0
    if not version:
        raise ValueError(f"{path} is of FMI {said.fmiVersion}: 2 and 3 are run")
    kind, interface = "cs", said.coSimulation
    if interface is None and version == 3 and said.scheduledExecution is not None:
        kind, interface = "se", said.scheduledExecution
    if interface is None:
        raise ValueError(
            f"{path} is made for model exchange only, without a solver: it must be exported for "
            "co-simulation (or, FMI 3, scheduled execution)"
        )
    wanted = fmpy.platform_tuple if version == 3 else fmpy.platform
    _check_library(path, names, wanted, interface.modelIdentifier + fmpy.sharedLibraryExtension)
    step = said.defaultExperiment.stepSize if said.defaultExperiment else None
    inside = getattr(interface, "fixedInternalStepSize", None)
    everything = said.modelVariables
    _check_variables(path, everything)
    return FmuModel(
        path, version, kind, interface.modelIdentifier,
        said.guid if version == 2 else said.instantiationToken,
        bool(interface.canGetAndSetFMUstate), bool(interface.canBeInstantiatedOnlyOncePerProcess),
        kind == "se" or bool(interface.canHandleVariableCommunicationStepSize),
        version == 3 and kind == "cs" and bool(interface.hasEventMode),
        _exact_step(step), _exact_step(inside),
        {v.name: _variable(v, version, everything) for v in everything if v.type != "Clock"},
        {unit.name: _scale(unit) for unit in said.unitDefinitions}, clocks, raised, terminals,
    )  # fmt: skip


def _exact_step(step_s: Any) -> Fraction | None:
    return None if step_s is None else Fraction(str(step_s))


def _check_library(path: Path, names: list[str], wanted: str, library: str) -> None:
    """Raise ValueError where an FMU holds no library that can run here: what it holds instead."""
    if f"binaries/{wanted}/{library}" in names:
        return
    there = [name.split("/") for name in names if name.startswith("binaries/")]
    beside = sorted({parts[2] for parts in there if parts[1] == wanted and len(parts) > 2} - {""})
    if beside:
        raise ValueError(
            f"{path} holds no binaries/{wanted}/{library}, which its description names, but "
            f"{', '.join(beside)}"
        )
    others = sorted({parts[1] for parts in there if parts[1:] != [wanted, ""]} - {"", wanted})
    raise ValueError(
        f"{path} holds no library for {wanted}, "
        + (f"only for {', '.join(others)}" if others else "nor for anything else")
    )


def _check_variables(path: Path, everything: Any) -> None:
    """Raise ValueError for two variables of one name, and for those that start at no number."""
    name, count = Counter(v.name for v in everything).most_common(1)[0] if everything else ("", 1)
    if count > 1:
        raise ValueError(f"{path} has {count} variables of the name {name!r}")
    for v in everything:
        if v.type in (*_KINDS, "Float32", "Float64") and v.start is not None:
            for word in str(v.start).split():
                if not _is_number(word):
                    raise ValueError(f"{path}: {v.name!r} starts at {word!r}, which is no number")


def _is_number(word: str) -> bool:
    try:
        return not math.isnan(float(word))
    except ValueError:
        return False


def _variable(v: Any, version: int, everything: Any) -> Variable:
    kind = _KINDS.get(v.type, v.type)
    if kind == "Enumeration":
        kind = "Int64" if version == 3 else "Int32"
    declared = v.declaredType.unit if v.declaredType is not None else None
    by_reference = {one.valueReference: one.name for one in everything if v.dimensions}
    dimensions = tuple(
        int(d.start) if d.start is not None else by_reference[d.valueReference]
        for d in v.dimensions
    )
    usual = "continuous" if kind.startswith("Float") else "discrete"
    given = v.causality in ("parameter", "structuralParameter", "input")
    settable = given or (v.start is not None and v.initial in ("exact", "approx"))
    return Variable(
        v.name, v.unit or declared or "", v.valueReference, kind, v.causality or "local",
        v.variability or usual, dimensions, v.start, settable and v.variability != "constant",
        v.alias is not None, _enumeration_items(v),
    )  # fmt: skip


def _enumeration_items(v: Any) -> tuple[tuple[str, int], ...]:
    items = (v.declaredType.items if v.type == "Enumeration" and v.declaredType else None) or ()
    return tuple((item.name, int(item.value)) for item in items)


def _scale(unit: Any) -> Scale | None:
    base = unit.baseUnit
    if base is None:
        return None
    powers = (base.m, base.s, base.rad, base.kg, base.A, base.K, base.mol, base.cd)
    return Scale(tuple(map(int, powers)), float(base.factor), float(base.offset))


def _clocks_and_output_references(
    archive: zipfile.ZipFile,
) -> tuple[dict[str, PartitionClock], dict[str, int]]:
    """Return the input clocks, and the references of the output clocks; FMPy reads neither."""
    clocks, raised = {}, {}
    for item in ElementTree.fromstring(archive.read("modelDescription.xml")).iter("Clock"):
        name, reference = item.get("name", ""), int(item.get("valueReference", 0))
        if item.get("causality") == "output":
            raised[name] = reference
        if item.get("causality") != "input":
            continue
        interval, shift, resolution = None, Fraction(0), item.get("resolution")
        if resolution and (counter := item.get("intervalCounter")):
            interval = Fraction(int(counter), int(resolution))
            shift = Fraction(int(item.get("shiftCounter", 0)), int(resolution))
        elif decimal := item.get("intervalDecimal"):
            interval, shift = Fraction(decimal), Fraction(item.get("shiftDecimal", "0"))
        clocks[name] = PartitionClock(
            name, reference, int(item.get("priority", 0)), item.get("intervalVariability", ""),
            interval, shift, item.get("supportsFraction") in ("true", "1"),
        )  # fmt: skip
    return clocks, raised


def _terminal_variables_by_member(
    archive: zipfile.ZipFile, names: list[str]
) -> dict[str, dict[str, str]]:
    """Return for each terminal of the FMU the names of its variables by member name."""
    name = "terminalsAndIcons/terminalsAndIcons.xml"
    if name not in names:
        return {}
    found: dict[str, dict[str, str]] = {}
    for terminal in ElementTree.fromstring(archive.read(name)).iter("Terminal"):
        members = found.setdefault(terminal.get("name", ""), {})
        for member in terminal.findall("TerminalMemberVariable"):
            variable = member.get("variableName", "")
            members[member.get("memberName", variable)] = variable
    return found
