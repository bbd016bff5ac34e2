"""Random draws of a study: each value is a function of (seed, key, replica) and of nothing else.

The same replica has the same draws in every cell of a study, so cells compare on common random
numbers. Members of a sample (`member_seed`) have a seed each: axes over which a study averages
(`Study.over`) are a sample, and what chance does in one member must say nothing about another.
Times (``_s``) are rounded to nanoseconds and rates (``_hz``) to millihertz: clocks stay exact.
"""

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.errors import nearest_name
from dsa_des.scene.keys import flatten_tables
from dsa_des.studies.axes import Axis
from dsa_des.time.randomness import key_of

#: No normal draw lies farther out: the smallest probability is 2^-54.
_MOST_SIGMA = 9.0
KINDS = ("uniform", "normal", "choice", "latin_hypercube", "sequence")


@dataclass(frozen=True)
class Draw:
    """How the value of one scene key is chosen for each replica, at random or in sequence."""

    #: Dotted key of the scene.
    key: str
    kind: str
    #: Lowest and highest; mean and standard deviation; what to choose from; or the value of the
    #: first replica and the step to the next.
    values: tuple[Any, ...]
    #: Whether replicas share the range out among themselves (Latin hypercube).
    stratified: bool = False

    @property
    def is_numeric(self) -> bool:
        """Whether all values that may be drawn are numbers."""
        return all(isinstance(value, int | float) for value in self.values)

    def value(self, seed: int, replica: int, batch: int) -> Any:
        """Return the value drawn for one replica.

        `seed` is the study's, or that of a member of its sample; a Latin hypercube covers `batch`
        consecutive replicas together.
        """
        if self.kind == "sequence":
            first, step = self.values
            return first + step * replica
        u = uniform_of_replica(seed, self.key, replica)
        if self.stratified:
            block, index = divmod(replica, batch)
            u = (int(_shuffled_strata(seed, self.key, block, batch)[index]) + u) / batch
        if self.kind == "choice":
            return self.values[min(int(u * len(self.values)), len(self.values) - 1)]
        low, high = self.values
        if self.kind == "normal":
            return round_for_exact_clock(
                self.key, low + high * NormalDist().inv_cdf(max(u, 2.0**-54))
            )
        return round_for_exact_clock(self.key, low + (high - low) * u)


def round_for_exact_clock(key: str, value: float) -> float | Fraction:
    """Return a drawn time (s) or frequency (Hz) as a fraction, to ns or mHz; others unchanged."""
    for ending, unit in (("_s", 10**9), ("_hz", 1000)):
        if key.endswith(ending) and not key.endswith("deg_s"):
            return Fraction(round(value * unit), unit)
    return value


def replica_seed(seed: int, replica: int) -> int:
    """Return the seed of a replica's run, the same in every cell with the study's seed."""
    return key_of(seed, "study replica", replica) >> 1


def uniform_of_replica(seed: int, key: str, replica: int) -> float:
    """Return a uniform number in [0, 1) that depends on the seed, the key and the replica only."""
    return (key_of(seed, "study draw", key, replica) >> 11) * 2.0**-53


@lru_cache(maxsize=64)
def _shuffled_strata(seed: int, key: str, block: int, batch: int) -> IntArray:
    generator = np.random.Generator(np.random.Philox(key_of(seed, "study strata", key, block)))
    return np.asarray(generator.permutation(batch), dtype=np.int64)


def flatten_draws(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return dotted key → definition of the draw, for all draws in nested tables."""

    def is_draw(value: Any) -> bool:
        return (
            not isinstance(value, dict)
            or bool(set(value) & set(KINDS))
            or not any(isinstance(item, dict) for item in value.values())
        )

    return flatten_tables(tables, is_draw)


def parse_draw(key: str, table: Any) -> Draw:
    """Return the `Draw` that a table of a study defines, for example ``{uniform = [0, 0.2]}``."""
    form = "must be one of {uniform = [low, high]}, {normal = [mean, standard deviation]}, " \
        "{choice = [...]}, {latin_hypercube = [low, high]}, {sequence = [first, step]}"  # fmt: skip
    if not isinstance(table, dict) or len(table) != 1:
        raise ValueError(form)
    ((kind, values),) = table.items()
    if kind not in KINDS or not isinstance(values, list | dict):
        close = None if kind in KINDS else nearest_name(str(kind), KINDS)
        raise ValueError(form + (f"; did you mean {close!r}?" if close else ""))
    if kind == "latin_hypercube" and isinstance(values, dict):
        inner = parse_draw(key, values)
        return Draw(key, inner.kind, inner.values, stratified=True)
    if kind == "choice":
        if not values:
            raise ValueError("choice is empty: give at least one value")
        if any(isinstance(value, int) and abs(value) >= 2**63 for value in values):
            raise ValueError("choice holds a whole number beyond 2^63")
        return Draw(key, kind, tuple(values))
    if kind == "sequence":
        whole = [isinstance(v, int) and not isinstance(v, bool) for v in values]
        if isinstance(values, dict) or len(values) != 2 or not all(whole):
            raise ValueError("sequence takes two whole numbers: [first value, step]")
        if any(abs(value) >= 2**40 for value in values):
            raise ValueError("sequence holds a whole number beyond 2^40")
        return Draw(key, kind, tuple(values))
    low, high = _two_numbers(kind, values)
    if kind == "normal":
        if high < 0:
            raise ValueError(f"normal: the standard deviation is {high}: it must be 0 or more")
        _check_size(key, kind, low - _MOST_SIGMA * high, low + _MOST_SIGMA * high)
        return Draw(key, kind, (low, high))
    if high < low:
        raise ValueError(f"{kind}: the range [{low}, {high}] is empty; the lower bound comes first")
    _check_size(key, kind, low, high)
    return Draw(key, "uniform", (low, high), stratified=kind == "latin_hypercube")


def _check_size(key: str, kind: str, low: float, high: float) -> None:
    """Raise ValueError for a range whose ends are too large for floating-point numbers."""
    try:
        spans = math.isfinite(high - low)
        round_for_exact_clock(key, low), round_for_exact_clock(key, high)
    except (OverflowError, ValueError):
        spans = False
    if not spans:
        raise ValueError(f"{kind}: values from {low:g} to {high:g} are too large for numbers")


def _two_numbers(kind: str, values: Any) -> tuple[float, float]:
    if len(values) != 2 or any(
        isinstance(value, bool) or not isinstance(value, int | float) for value in values
    ):
        raise ValueError(f"{kind} takes two numbers")
    try:
        low, high = map(float, values)
    except OverflowError:
        raise ValueError(f"{kind}: holds a whole number that is too large") from None
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(f"{kind} = {values}: must be finite")
    return low, high


def member_seed(seed: int, members: Iterable[tuple[Axis, int]]) -> int:
    """Return the seed of all runs of one member (combination of values) of a sample.

    It depends on the values alone: not on their places, nor on what other values there are.

    Members are values, by their index, of axes that are a sample, in any order; without any the
    study's seed stays.
    """
    parts = sorted((axis.key, *axis_value_identity(axis, index)) for axis, index in members)
    return (
        key_of(seed, "study sample", *(text for part in parts for text in part)) if parts else seed
    )


def axis_value_identity(axis: Axis, index: int) -> tuple[str, ...]:
    """Return texts that identify an axis value: a file's name and content hash, or its label.

    A file is known by its name, without its folder, and its content: it keeps its draws wherever
    it lies, copies under other names are other encounters, and so are files of the same name in
    other folders, unless they hold the same. Other values identify themselves; 1 and 1.0 are
    the same.
    """
    if not axis.files:
        return (_label_text(axis.labels[index]),)
    path = Path(axis.sets[index][0][1])
    try:
        return path.name, file_sha256(path)
    except OSError:  # its runs say what is wrong with it
        return path.name, ""


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content; a file that has not changed is read only once."""
    state = path.stat()
    return _sha256_of_file(str(path), state.st_mtime_ns, state.st_size, state.st_ino)


@lru_cache(maxsize=1 << 17)
def _sha256_of_file(path: str, *state: int) -> str:
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _label_text(label: Any) -> str:
    if isinstance(label, float) and label.is_integer():
        label = int(label)
    return repr(label) if isinstance(label, int | float) else f"text {label}"
