"""Axes of a study: lists, ranges, logarithmic ranges, swaps, files, phases, and linked values."""

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from dsa_des.block.component import to_scene_number
from dsa_des.block.source_file import absolute_type_name
from dsa_des.errors import did_you_mean
from dsa_des.scene.keys import flatten_tables
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import parse_rational

SWAP = "swap."
_SPEC_KEYS = ("from", "to", "step", "steps", "log", "files", "beat_with", "values", "set")
#: Each value is checked before anything runs, some 3 ms each.
_MOST_VALUES = 10_000
_MOST_FILES = 100_000
_LONGEST_FRACTION = 300
_FRACTION = re.compile(r"\d+/[1-9]\d*")


@dataclass(frozen=True)
class Axis:
    """One axis of a study."""

    #: A dotted key of the scene, ``swap.BLOCK``, or a free name for linked values.
    key: str
    #: What the axis is at each of its values: numbers or texts.
    labels: tuple[Any, ...]
    #: What each value sets in the scene.
    sets: tuple[tuple[tuple[str, Any], ...], ...]
    swaps: tuple[tuple[tuple[str, str], ...], ...]
    #: Whether its values are files: encounters, of which the study is a sample.
    files: bool = False

    @property
    def column(self) -> str:
        """Its column in the results: the key without ``blocks.``."""
        return self.key.removeprefix("blocks.")

    @property
    def is_numeric(self) -> bool:
        """Whether all values of the axis are numbers."""
        return all(
            isinstance(label, int | float) and not isinstance(label, bool) for label in self.labels
        )


def flatten_axes(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return dotted key → list or table that defines the axis, for all axes in nested tables."""
    return flatten_tables(
        tables, lambda v: not isinstance(v, dict) or not v or bool(set(v) & set(_SPEC_KEYS))
    )


def parse_axis(key: str, spec: Any, scene: Scene) -> Axis:
    """Return the `Axis` that an entry of a study's ``axes`` defines."""
    if isinstance(spec, list):
        values = spec
    elif not isinstance(spec, dict):
        raise ValueError(
            "must be a list of values, or a table such as {from = 1, to = 5, step = 1}"
        )
    else:
        for name in spec:
            if name not in _SPEC_KEYS:
                raise ValueError(f"unknown key {name!r} of an axis{did_you_mean(name, _SPEC_KEYS)}")
        if "files" in spec:
            return _file_axis(key, spec)
        if "set" in spec:
            return _linked_axis(key, spec)
        if "beat_with" in spec:
            values = _beat_phase_offsets_s(key, spec, scene)
        elif "values" in spec:
            values = spec["values"]
        else:
            values = _range_values(spec)
    if not isinstance(values, list) or not values:
        raise ValueError("is empty: an axis needs at least one value")
    _refuse_too_many(len(values))
    if key.startswith(SWAP):
        return _swap_axis(key, values, scene)
    labels = tuple(axis_value_label(value) for value in values)
    _refuse_duplicates(labels)
    return Axis(key, labels, tuple(((key, value),) for value in values), ((),) * len(values))


def axis_value_label(value: Any) -> Any:
    """Return an axis value's label: a number as it is, a fraction as a float, else text."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and len(value) < _LONGEST_FRACTION and _FRACTION.fullmatch(value):
        return float(Fraction(value))
    if isinstance(value, int) and abs(value) >= 2**63:
        raise ValueError("holds a whole number beyond 2^63")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"holds {value}: must be finite")
    return value if isinstance(value, int | float) else str(value)


def _refuse_duplicates(labels: tuple[Any, ...]) -> None:
    label, count = Counter(labels).most_common(1)[0]
    if count > 1:
        raise ValueError(f"holds {label!r} more than once")


def _refuse_too_many(count: int, most: int = _MOST_VALUES) -> None:
    if count > most:
        raise ValueError(f"has {count:,} values; at most {most:,} are allowed")


def _swap_axis(key: str, values: list[Any], scene: Scene) -> Axis:
    block = key.removeprefix(SWAP)
    if block not in scene.blocks:
        raise ValueError(f"the scene has no block {block!r}{did_you_mean(block, scene.blocks)}")
    if not all(isinstance(value, str) for value in values):
        raise ValueError("a swap takes types of blocks, as texts")
    labels = tuple(str(value) for value in values)
    _refuse_duplicates(labels)
    return Axis(
        key,
        labels,
        ((),) * len(labels),
        tuple(((block, absolute_type_name(value)),) for value in values),
    )


def _file_axis(key: str, spec: Mapping[str, Any]) -> Axis:
    pattern = spec["files"]
    patterns = pattern if isinstance(pattern, list) else [pattern]
    if not patterns or not all(isinstance(item, str) for item in patterns):
        raise ValueError('files must be a pattern such as "encounters/*.daa", or a list of names')
    paths: list[Path] = []
    for item in patterns:
        try:
            path = Path(item).expanduser()
        except RuntimeError as error:  # the ~ of an unknown user
            raise ValueError(f"files: {item!r}: {error}") from None
        folder = getattr(item, "folder", Path.cwd())
        base = path if path.is_absolute() else folder / path
        if any(sign in str(item) for sign in "*?["):
            start = Path(base.anchor) if base.is_absolute() else Path()
            try:
                matches = sorted(start.glob(str(base.relative_to(base.anchor))))
            except (OSError, NotImplementedError, re.error) as error:
                raise ValueError(f"files: {item!r} is no pattern of file names: {error}") from None
            if not matches:
                raise ValueError(f"no file matches {base}")
            paths += matches
        elif _holds_for_path(base, Path.is_dir):
            raise ValueError(f'{base} is a folder; say which files of it, e.g. "{item}/*.daa"')
        elif _holds_for_path(base, Path.is_file):
            paths.append(base)
        else:
            raise ValueError(f"there is no file {base}")
    _refuse_too_many(len(paths), _MOST_FILES)
    names = Counter(path.name for path in paths)
    labels = tuple(path.name if names[path.name] == 1 else str(path) for path in paths)
    _refuse_duplicates(labels)
    sets = tuple(((key, str(path.resolve())),) for path in paths)
    return Axis(key, labels, sets, ((),) * len(labels), files=True)


def _holds_for_path(path: Path, what: Callable[[Path], bool]) -> bool:
    try:
        return what(path)
    except (OSError, ValueError):  # a text that can be no path
        return False


def _linked_axis(key: str, spec: Mapping[str, Any]) -> Axis:
    labels, keys = spec.get("values"), spec["set"]
    if not isinstance(labels, list) or not labels or not isinstance(keys, dict) or not keys:
        raise ValueError(
            "linked values need values = [...], and set = {key = [...]} with as many for each key"
        )
    _refuse_too_many(len(labels))
    columns = flatten_axes(keys)
    for name, column in columns.items():
        if not isinstance(column, list) or len(column) != len(labels):
            raise ValueError(f"set: {name} must be a list of {len(labels)} values, one per value")
    shown = tuple(axis_value_label(label) for label in labels)
    _refuse_duplicates(shown)
    types = {name: column for name, column in columns.items() if name.startswith(SWAP)}
    sets, swaps = (
        tuple(tuple((name, column[i]) for name, column in of.items()) for i in range(len(labels)))
        for of in ({n: c for n, c in columns.items() if n not in types}, types)
    )
    named = tuple(
        tuple((name.removeprefix(SWAP), absolute_type_name(value)) for name, value in one)
        for one in swaps
    )
    return Axis(key, shown, sets, named)


def _range_values(spec: Mapping[str, Any]) -> list[Any]:
    if "from" not in spec or "to" not in spec or ("step" in spec) == ("steps" in spec):
        raise ValueError("a range needs from, to, and either step or steps")
    low, high = parse_rational(spec["from"]), parse_rational(spec["to"])
    log = spec.get("log", False)
    if not isinstance(log, bool):
        raise ValueError(f"log = {log!r}: must be true or false")
    if high < low:
        raise ValueError(f"the range from {spec['from']} to {spec['to']} is empty")
    if "step" in spec:
        step = parse_rational(spec["step"])
        if step <= 0 or log:
            raise ValueError("step must be greater than 0, and a logarithmic range needs steps")
        count = int((high - low) / step) + 1
    else:
        steps = spec["steps"]
        if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
            raise ValueError("steps is how many values: a whole number of 1 or more")
        count = steps
        step = (high - low) / (count - 1) if count > 1 else Fraction(0)
    _refuse_too_many(count)
    if not log:
        return [to_scene_number(low + k * step) for k in range(count)]
    if low <= 0:
        raise ValueError("a logarithmic range must start above 0")
    if count == 1:
        return [to_scene_number(low)]
    growth = math.log(high / low) / (count - 1)
    # Six digits: rates stay short fractions, so that clocks have a common tick.
    inner = [float(f"{float(low) * math.exp(growth * k):.6g}") for k in range(1, count - 1)]
    return [to_scene_number(low), *inner, to_scene_number(high)]


def _beat_phase_offsets_s(key: str, spec: Mapping[str, Any], scene: Scene) -> list[Any]:
    """Return clock offsets, s, in equal steps over the time until two clocks are in step again."""
    parts = key.split(".")
    other = str(spec["beat_with"])
    if len(parts) != 3 or parts[0] != "blocks" or parts[2] != "offset_s":
        raise ValueError("beat_with belongs to an axis blocks.BLOCK.offset_s")
    periods = []
    for name in (parts[1], other):
        block = scene.blocks.get(name)
        clock = None if block is None else block.cls.clock_of(block.parameters)
        if clock is None:
            clocked = [
                known
                for known, item in scene.blocks.items()
                if item.cls.clock_of(item.parameters) is not None
            ]
            raise ValueError(f"{name!r} is no block with a clock{did_you_mean(name, clocked)}")
        periods.append(clock.period_s)
    steps = spec.get("steps", 32)
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise ValueError("steps is how many phases: a whole number of 1 or more")
    _refuse_too_many(steps)
    return [to_scene_number(beat_period_s(*periods) * k / steps) for k in range(steps)]


def beat_period_s(first: Fraction, second: Fraction) -> Fraction:
    """Return when two clocks are in step again, s: the least common multiple of their periods."""
    return Fraction(
        math.lcm(first.numerator, second.numerator),
        math.gcd(first.denominator, second.denominator),
    )
