"""The keys of a radar's pulses."""

from dataclasses import replace
from typing import Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from components.messages.reach import Reach
from components.radar.pulse_trains.ambiguity import (
    mth_largest_share,
    received_share,
    unambiguous_range_m,
)
from components.sensor.parameters import SensorParameters
from dsa_des.arrays.types import FloatArray


class PulseTrainParameters(SensorParameters):
    """Parameters of a radar's pulses."""

    prf_hz: float | None = Field(
        default=None,
        gt=0,
        description="Pulse repetition frequency, Hz; targets whose echo comes after the next pulse "
        "are not looked at, unless range_folds.",
    )
    pulse_width_s: float | None = Field(
        default=None,
        gt=0,
        description="Length of a pulse, s: echoes that arrive while one is sent are lost, in part "
        "or whole (eclipsing). The link budget, and a range that calibrates it, are of whole "
        "echoes. By default none is lost.",
    )
    range_folds: bool = Field(
        default=False,
        description="Whether echoes from beyond c / 2PRF are seen, at the range that they seem to "
        "come from: modulo c / 2PRF, or what other_prfs_hz make of it.",
    )
    other_prfs_hz: tuple[PositiveFloat, ...] = Field(
        default=(),
        description="PRFs beside prf_hz, Hz, each with a dwell of its own on every beam: a range "
        "is where all that see the target agree within half a range cell, the nearest of several.",
    )
    prfs_needed: int | None = Field(
        default=None,
        ge=1,
        description="How many of the PRFs must see a target for a report (M of N); by default all.",
    )

    @model_validator(mode="after")
    def _check_pulse_keys(self) -> Self:
        for key, value in (
            ("pulse_width_s", self.pulse_width_s),
            ("range_folds", self.range_folds),
        ):
            if value and self.prf_hz is None:
                said = "true" if value is True else f"{value:g}"
                raise ValueError(f"{key} is {said} and prf_hz is not given: when is a pulse sent?")
        if (width_s := self.pulse_width_s) is not None and width_s * max(self.prfs_hz) >= 1.0:
            raise ValueError(
                f"pulse_width_s is {width_s:g}: it must be below the interval between pulses at "
                f"{max(self.prfs_hz):g} Hz, {1.0 / max(self.prfs_hz):.4g}"
            )
        if self.other_prfs_hz:
            self._check_several_prfs()
        elif self.prfs_needed is not None:
            raise ValueError(
                f"prfs_needed is {self.prfs_needed} and other_prfs_hz is not given: of which PRFs?"
            )
        return self

    def _check_several_prfs(self) -> None:
        given = f"other_prfs_hz is {list(self.other_prfs_hz)}"
        if not self.range_folds:
            raise ValueError(f"{given} and range_folds is false: no range is ambiguous; set it")
        if len(set(self.prfs_hz)) < len(self.prfs_hz):
            raise ValueError(f"{given} beside prf_hz {self.prf_hz:g}: one is given twice")
        if self.prfs_needed is not None and self.prfs_needed > len(self.prfs_hz):
            raise ValueError(
                f"prfs_needed is {self.prfs_needed}: there are {len(self.prfs_hz)} PRFs, it must "
                "be at most that"
            )
        if not (getattr(self, "range_cell_m", None) or getattr(self, "range_resolution_m", 0)):
            raise ValueError(
                "range_resolution_m is 0 and other_prfs_hz is given: ranges of several PRFs agree "
                "within half a cell, it must be above 0"
            )
        for key, off in (("moving_target_filter", "none"), ("range_rate_folds", False)):
            if getattr(self, key, off) != off:
                raise ValueError(
                    f"{given} and {key} is {getattr(self, key)!r}: that is known for one PRF; "
                    "leave one of them out"
                )

    @property
    def prfs_hz(self) -> tuple[float, ...]:
        """All PRFs; none where prf_hz is not given."""
        return () if self.prf_hz is None else (self.prf_hz, *self.other_prfs_hz)

    @property
    def farthest_report_m(self) -> float:
        """Largest reported range, m: the unambiguous if ranges fold with one PRF, else infinite."""
        if self.range_folds and len(self.prfs_hz) == 1:
            return unambiguous_range_m(self.prfs_hz[0])
        return float("inf")

    def reach(self) -> Reach:
        """Return the reach; it ends at the unambiguous range if none is given and none folds."""
        reach = super().reach()
        if self.prf_hz is None or self.range_km is not None or self.range_folds:
            return reach
        return replace(reach, range_max_m=unambiguous_range_m(self.prf_hz))

    def received_shares(self, range_m: FloatArray) -> FloatArray:
        """Return the share of an echo that each PRF receives, (prfs, targets)."""
        if (width_s := self.pulse_width_s) is None:
            return np.ones((len(self.prfs_hz), len(range_m)))
        return np.stack(
            [received_share(range_m, prf_hz=prf_hz, pulse_width_s=width_s)
             for prf_hz in self.prfs_hz]
        )  # fmt: skip

    def decisive_share(self, shares: FloatArray) -> FloatArray:
        """Return the share received by at least as many PRFs as must see a target, (targets,)."""
        return mth_largest_share(shares, self.prfs_needed or len(self.prfs_hz))
