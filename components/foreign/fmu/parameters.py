"""What a scene says of an FMU, and when it communicates."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from pydantic import Field, PrivateAttr, model_validator

from components.foreign.fmu.model import FmuModel, read_fmu
from components.foreign.fmu.wiring import Wiring
from dsa_des.block.component import (
    NonNegativeRational,
    Parameters,
    PositiveRational,
    Rational,
    ScenePath,
)
from dsa_des.errors import Disagreements
from dsa_des.time.clock import ClockSpec


class FmuParameters(Parameters):
    """Parameters of an FMU."""

    file: ScenePath = Field(description="The FMU: FMI 2 or 3, co-simulation or, FMI 3, scheduled.")
    scan_rate_hz: PositiveRational | None = Field(
        default=None,
        description="Communication points per second. By default they are the instants at which "
        "something arrives, and without wires the FMU's own step (stepSize, or its "
        "fixedInternalStepSize).",
    )
    offset_s: NonNegativeRational = Field(
        default=Fraction(0), description="Time of the first communication point, s."
    )
    start: dict[str, Any] = Field(
        default={},
        description='Start values by variable, in its own unit or as "5 km/h"; of an enumeration '
        "also by name.",
    )
    inputs: dict[str, str] = Field(
        default={},
        description='Where inputs come from: "BLOCK.COLUMN", "BLOCK.COLUMN[TARGET]", and of '
        'another FMU "BLOCK.VARIABLE"; a whole terminal as "BLOCK" or "BLOCK[TARGET]". With '
        '"BLOCK.COLUMN[*]" an array, or "plane[*].range", takes the values of all `targets`.',
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
    detections: dict[str, float | str | list[str]] = Field(
        default={},
        description='Columns of detections (azimuth_rad, range_m, "detected") by output: an array, '
        '"plane[*].range" for all that there are, or a list has a value for each detection; a '
        "number is the same for all.",
    )
    targets: list[str] = Field(
        default=[],
        description="Names of the targets that inputs of [*] and detections are of, one by one; "
        "without, trackers decide whose detections they are.",
    )
    deadline_s: float = Field(
        default=10.0, gt=0, description="Longest time for one communication point, s."
    )
    _model: Any = PrivateAttr(None)
    _wiring: Any = PrivateAttr(None)

    @property
    def model(self) -> FmuModel:
        """Return the FMU's model description."""
        found: FmuModel = self._model
        return found

    @property
    def wiring(self) -> Wiring:
        """Return which variables of the FMU are read and set, and how."""
        found: Wiring = self._wiring
        return found

    @model_validator(mode="after")
    def _read_and_wire_model(self) -> "FmuParameters":
        try:
            self._model = read_fmu(self.file)
        except ValueError as error:
            raise Disagreements([f"file: {error}"]) from error
        wiring = Wiring(self)
        Disagreements.raise_if_any(wiring.wrong)
        self._wiring = wiring
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key that has no effect."""
        starred = any(source.endswith("[*]") for source in self.inputs.values())
        if self.detections or starred:
            return []
        return self.note_ineffective("targets", because="without detections and inputs of [*]")

    def clock_spec(self) -> ClockSpec | None:
        """Return the clock of communication points, or None if arriving messages decide them."""
        if self.model.kind == "se":
            step = _common_step(self.wiring.instants)
            return ClockSpec(1 / step) if step else None
        if self.scan_rate_hz is not None:
            return ClockSpec(self.scan_rate_hz, self.offset_s)
        if not self.wiring.sources and not self.ownship:
            return ClockSpec(1 / self._own_step_s(), self.offset_s)
        return None

    def _own_step_s(self) -> Fraction:
        """Return the FMU's own step (s): that of its default experiment if it is whole solver
        steps, else the solver's, or 0.01 s.
        """
        step, inside = self.model.step_s, self.model.internal_step_s
        if inside and (not step or (step / inside).denominator != 1):
            return inside
        return step or Fraction(1, 100)

    def step_mismatch_note(self) -> str | None:
        """Return a note if communication points are not at whole internal FMU steps, else None."""
        inside = self.model.internal_step_s
        if inside and self.scan_rate_hz is not None:
            steps = 1 / (self.scan_rate_hz * inside)
            if steps.denominator != 1:
                return (
                    f"scan_rate_hz: {float(steps):g} internal steps of the FMU "
                    f"(fixedInternalStepSize {float(inside):g} s) fit between two communication "
                    "points: whole ones are meant to"
                )
        return None


def _common_step(instants: Sequence[Fraction]) -> Fraction:
    """Return the largest step (s) of which all given times are whole multiples."""
    step = Fraction(0)
    for instant in instants:
        denominator = math.lcm(step.denominator, instant.denominator)
        step = Fraction(math.gcd(int(step * denominator), int(instant * denominator)), denominator)
    return step
