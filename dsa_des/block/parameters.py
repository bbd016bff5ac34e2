"""The largest numbers of a scene: far beyond anything that flies, far within a double.

Physics takes fourth powers, products and exponentials of what a scene says. Within these limits
they stay finite; a number outside them is a slip of the pen and is refused before anything runs.
"""

import os
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    ValidationInfo,
    field_validator,
)

from dsa_des.block.shipped_files import existing_or_shipped_path
from dsa_des.files.input_files import resolve_home
from dsa_des.time.clock import MOST_JITTER, ClockSpec, parse_rational

#: Numbers without a unit below: products of several, and their squares, are still finite.
LARGEST = 1e30
#: Numbers closer to 0 than this must be 0; reciprocals and squares are still finite.
SMALLEST = 1e-30

#: Largest size by the unit at the end of a name. Levels in dB become powers of ten, and several
#: of them are added first; the others keep what they are multiplied with finite.
LARGEST_BY_UNIT: Mapping[str, float] = {
    "db": 300.0,
    "dbsm": 300.0,
    "deg": 1e6,
    "rad": 1e6,
    "deg_s": 1e6,
    "km": 1e9,
    "m": 1e12,
    "m2": 1e12,
    "mps": 1e6,
    "s": 1e12,
    "w": 1e15,
    "hz": 1e18,
}
_UNITS = sorted(LARGEST_BY_UNIT, key=len, reverse=True)


def largest_allowed_value(name: str) -> float:
    """Return a quantity's largest allowed absolute value, by the unit that ends its name."""
    unit = next((unit for unit in _UNITS if name.endswith(f"_{unit}")), None)
    return LARGEST if unit is None else LARGEST_BY_UNIT[unit]


def refuse_extremes(name: str, value: Any) -> None:
    """Raise ValueError if a number, also in lists and tables, is too large or close to 0.

    The name of the quantity has its unit at the end; what is no number, list or table of numbers
    passes.
    """
    if isinstance(value, float | int):
        size = abs(value)
        if 0.0 < size < SMALLEST or size > largest_allowed_value(name):
            raise ValueError(
                f"must be 0, or from {SMALLEST:g} to {largest_allowed_value(name):g} in size: "
                f"that is "
                f"what "
                "can be computed with"
            )
    elif isinstance(value, list | tuple):
        for item in value:
            refuse_extremes(name, item)
    elif isinstance(value, Mapping):
        for item in value.values():
            refuse_extremes(name, item)


def to_scene_number(value: Fraction) -> int | float | str:
    """Return an exact number as in a scene: int, float if exact, else text such as ``1/3``."""
    if value.denominator == 1:
        return int(value)
    return float(value) if Fraction(repr(float(value))) == value else str(value)


def _describe_value(value: Any) -> str:
    """Return a parameter's value as text for use in a sentence."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    return str(to_scene_number(value)) if isinstance(value, Fraction) else repr(value)


#: An exact rate or time: a number or text such as "30000/1001".
Rational = Annotated[Fraction, BeforeValidator(parse_rational), PlainSerializer(to_scene_number)]
PositiveRational = Annotated[Rational, Field(gt=0)]
NonNegativeRational = Annotated[Rational, Field(ge=0)]


class SourcedText(str):
    """Text that remembers the folder of the file it was written in."""

    __slots__ = ("folder",)
    folder: Path

    @classmethod
    def from_text(cls, text: str, folder: Path) -> "SourcedText":
        """Return `text` as written in a file of `folder`."""
        result = cls(text)
        result.folder = folder
        return result


def _resolve_path(value: object) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise ValueError("must be a path, as text")
    path = resolve_home(str(value))
    if isinstance(value, SourcedText) and not path.is_absolute():
        path = existing_or_shipped_path(value.folder / path, str(value))
    return path


def _resolve_path_text(path: Path) -> str:
    # A run's own scene.toml lies elsewhere: what it names must be found from there too.
    return os.path.abspath(path)


#: A path; a relative one is taken from the folder of the file that holds the key. Written out, it
#: is whole.
ScenePath = Annotated[Path, BeforeValidator(_resolve_path), PlainSerializer(_resolve_path_text)]


class Parameters(BaseModel):
    """Parameters of a block: every field has its unit in its name, bounds and a description."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    #: Tables of a block whose key, not given, is what another key of the block was in the file that
    #: wrote the table first, whatever it is overridden by later: (table, its key) → that other key.
    as_written_with: ClassVar[Mapping[tuple[str, str], str]] = {}

    #: Keys that there were, each with what says the same now.
    former: ClassVar[Mapping[str, str]] = {}

    #: Keys that may change while a run lasts (``[[changes]]``), beside those of base classes.
    may_change: ClassVar[tuple[str, ...]] = ()

    @field_validator("*", mode="after")
    @classmethod
    def _computable(cls, value: Any, info: ValidationInfo) -> Any:
        """Raise ValueError for numbers too large or small to compute with; else return them."""
        refuse_extremes(info.field_name or "", value)
        return value

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence per key set without effect, with the reason; by default none."""
        return []

    def note_ineffective(self, *keys: str, because: str) -> list[str]:
        """Return a sentence, with reason `because`, per key not at its default but ineffective."""
        fields = type(self).model_fields
        return [
            f"{key} is {_describe_value(getattr(self, key))}: it has no effect, {because}"
            for key in keys
            if getattr(self, key) != fields[key].default
        ]


def nested_models(annotation: Any) -> list[type[BaseModel]]:
    """Return the pydantic models in a field's type annotation, in the order found there."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    models: list[type[BaseModel]] = []
    for argument in get_args(annotation):
        models += [model for model in nested_models(argument) if model not in models]
    return models


class ClockedParameters(Parameters):
    """Parameters of a block with a scan clock of its own."""

    may_change: ClassVar[tuple[str, ...]] = (
        "scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s",
    )  # fmt: skip

    scan_rate_hz: PositiveRational = Field(description="Scans per second; number or '30000/1001'.")
    offset_s: NonNegativeRational = Field(
        default=Fraction(0), description="Time of the first scan, s."
    )
    rate_error_ppm: Rational = Field(
        default=Fraction(0), le=1_000_000, description="Error of the scan rate, parts per million."
    )
    jitter_s: float = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of scan instants about their grid, s; "
        f"none is moved by more than {MOST_JITTER:g} of the time between scans.",
    )

    def clock_spec(self) -> ClockSpec:
        """Return the clock these parameters describe."""
        return ClockSpec(self.scan_rate_hz, self.offset_s, self.rate_error_ppm, self.jitter_s)
