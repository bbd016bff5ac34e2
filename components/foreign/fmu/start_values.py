"""Start values of an FMU's variables as a scene gives them, and how long its arrays are."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from components.foreign.fmu.model import TEXT_KINDS, FmuModel, Variable

_MOST_ELEMENTS = 100_000


class StartValue(NamedTuple):
    """What a variable is set to before the FMU starts."""

    kind: str
    reference: int
    values: list[Any]
    structural: bool


def value_count(model: FmuModel, start: Mapping[str, Any], variable: Variable) -> int:
    """Return a variable's number of values; array sizes are those the scene sets at the start.

    Raises
    ------
    ValueError
        If they are more than can be.
    """
    size = 1
    for length in variable.dimensions:
        if isinstance(length, str):
            given = start.get(length, model.variables[length].start)
            length = int(given) if isinstance(given, int | str) else 1
        size *= length
    if not 0 <= size <= _MOST_ELEMENTS:
        raise ValueError(f"{variable.name!r} has {size} values: at most {_MOST_ELEMENTS}")
    return size


def start_value(model: FmuModel, start: Mapping[str, Any], name: str) -> StartValue:
    """Return a variable's start value from the scene, converted to its type and unit.

    Raises
    ------
    ValueError
        If the FMU has no such variable, or the variable cannot start with that.
    """
    variable = model.variable(name)
    if not variable.settable:
        raise ValueError(f"{name!r} is a {variable.causality} of which no start is given")
    size, values = value_count(model, start, variable), _flat(start[name])
    if len(values) != size:
        raise ValueError(f"{name!r} has {len(values)} values where it needs {size}")
    structural = variable.causality == "structuralParameter"
    typed = [_convert_value(model, variable, one) for one in values]
    return StartValue(variable.kind, variable.reference, typed, structural)


def first_inputs(model: FmuModel, start: Mapping[str, Any], variable: Variable) -> list[float]:
    """Return an input's first values: those the scene sets at the start, or else the FMU's."""
    size = value_count(model, start, variable)
    if variable.name in start:
        return [float(value) for value in start_value(model, start, variable.name).values]
    numbers = [_number(word) for word in (variable.start or "").split()]
    return numbers if len(numbers) == size else [numbers[0] if numbers else 0.0] * size


def _convert_value(model: FmuModel, variable: Variable, value: Any) -> Any:
    kind, said = variable.kind, f"{variable.name!r} is {value!r}"
    if kind in TEXT_KINDS:
        return _text(kind, said, value)
    if kind == "Boolean":
        if isinstance(value, bool):
            return value
        raise ValueError(f"{said}: true or false is needed")
    if kind.startswith("Float"):
        if isinstance(value, str) and " " in value.strip():
            number, unit = value.strip().split(None, 1)
            a, b = model.unit_factor_and_offset(unit, variable)
            try:
                found = a * float(number) + b
            except ValueError:
                found = math.nan
            if math.isnan(found):
                raise ValueError(f"{said}: a number and a unit are needed")
            return found
        if isinstance(value, int | float) and not isinstance(value, bool):
            if math.isnan(value):
                raise ValueError(f"{said}: a number is needed")
            return float(value)
        raise ValueError(f"{said}: a number is needed")
    if isinstance(value, str) and variable.items:
        return variable.enumeration_value(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{said}: a whole number is needed")
    bounds = np.iinfo(kind.lower())
    if not bounds.min <= value <= bounds.max:
        raise ValueError(f"{said}: it must be from {bounds.min} to {bounds.max}")
    return value


def _text(kind: str, said: str, value: Any) -> str | bytes:
    if kind == "String":
        if isinstance(value, str):
            return str(value)
        raise ValueError(f"{said}: text is needed")
    try:
        return bytes.fromhex(value)
    except (TypeError, ValueError):
        raise ValueError(f"{said}: hexadecimal digits are needed") from None


def _flat(value: Any) -> list[Any]:
    return [one for item in value for one in _flat(item)] if isinstance(value, list) else [value]


def _number(word: str) -> float:
    return float({"true": 1, "false": 0}.get(word, word))
