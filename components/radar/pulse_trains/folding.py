"""A scene's pulses: their keys, and eclipsing and range folding as effects."""

from dataclasses import replace
from typing import Any, Protocol, Self

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from components.messages.reach import Reach
from components.radar.pulse_trains.ambiguity import (
    coincident_range_m,
    decisive_share,
    received_share,
    unambiguous_range_m,
)
from components.radar.resolution import ResolutionParameters, cell_size
from components.radar.weather import SNR
from components.sensor.look import Cells, CellValues
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict


class PulseTrainParameters(ResolutionParameters):
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
    def _pulses(self) -> Self:
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
            self._check_several()
        elif self.prfs_needed is not None:
            raise ValueError(
                f"prfs_needed is {self.prfs_needed} and other_prfs_hz is not given: of which PRFs?"
            )
        return self

    def _check_several(self) -> None:
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
        if not cell_size(self)[2]:
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
        """The range that no report is beyond, by the pulses: where one PRF folds."""
        if self.range_folds and len(self.prfs_hz) == 1:
            return unambiguous_range_m(self.prfs_hz[0])
        return float("inf")

    def reach(self) -> Reach:
        """Return the reach, which ends where echoes come after the next pulse."""
        reach = super().reach()
        if self.prf_hz is None or self.range_km is not None or self.range_folds:
            return reach
        return replace(reach, range_max_m=unambiguous_range_m(self.prf_hz))

    def shares(self, range_m: FloatArray) -> FloatArray:
        """Return the share of an echo that each PRF receives, (prfs, targets)."""
        if (width_s := self.pulse_width_s) is None:
            return np.ones((len(self.prfs_hz), len(range_m)))
        return np.stack(
            [received_share(range_m, prf_hz=prf_hz, pulse_width_s=width_s)
             for prf_hz in self.prfs_hz]
        )  # fmt: skip

    def decisive_share(self, shares: FloatArray) -> FloatArray:
        """Return the share that decides whether enough PRFs see each target."""
        return decisive_share(shares, self.prfs_needed or len(self.prfs_hz))


class Eclipsing(Effect[CellValues]):
    """No echo is received while a pulse is sent: the SNR is that of the share that is.

    Of several PRFs the one counts by which just enough see the target.
    """

    name = "eclipsing"
    acts_on = SNR

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``pulse_width_s``."""
        width_s = block.p.pulse_width_s
        if width_s is None:
            return Verdict(False, "pulse_width_s is not given")
        return Verdict(True, f"pulse_width_s is {width_s:g}")

    def build(self, block: Any) -> CellValues:
        """Return the factor on every cell's SNR."""
        p = block.p
        if p.pulse_width_s is None:
            return lambda cells: np.ones(len(cells))

        def factor(cells: Cells) -> FloatArray:
            decisive: FloatArray = p.decisive_share(p.shares(np.asarray(cells.range_m)))
            return decisive

        return factor


class SeemingRange(Protocol):
    """Gives the ranges that echoes seem to come from."""

    def __call__(self, range_m: FloatArray, /) -> FloatArray:
        """Return them for true ones, m."""


SEEMING_RANGE = Hook("seeming range", SeemingRange, "range that an echo seems to come from, m")


class RangeFolding(Effect[SeemingRange]):
    """Echoes of earlier pulses are taken for those of the last one.

    Of several PRFs those see a target that receive as much of it as the one that decides; the range
    is where they agree. Echoes of ground and rain fold too: these are left out, and so are ghosts
    between the echoes of two targets.
    """

    name = "range folding"
    acts_on = SEEMING_RANGE
    outside_the_proof = "without it nothing is seen beyond c / 2PRF"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``range_folds``, and say which PRFs resolve it."""
        p = block.p
        if not p.range_folds:
            return Verdict(False, "range_folds is false")
        if not p.other_prfs_hz:
            return Verdict(True, f"range_folds is true: at {p.farthest_report_m / 1000:.4g} km")
        count = len(p.prfs_hz)
        return Verdict(True, f"range_folds is true: {p.prfs_needed or count} of {count} PRFs")

    def build(self, block: Any) -> SeemingRange:
        """Return what gives the seeming ranges of true ones."""
        p = block.p
        if not p.range_folds:
            return lambda range_m: range_m

        def seeming(range_m: FloatArray) -> FloatArray:
            shares = p.shares(range_m)
            return coincident_range_m(
                range_m,
                prfs_hz=p.prfs_hz,
                seen=shares >= p.decisive_share(shares),
                tolerance_m=0.5 * cell_size(p)[2],
            )

        return seeming


def folded_clutter(block: Any) -> list[str]:
    """Say that echoes of ground and rain do not fold, where there are some and a target's do."""
    terrain, weather = (block.context.sections.get(name) for name in ("terrain", "weather"))
    ground = terrain is not None and terrain.height_m is not None
    rain = weather is not None and weather.rain_rate_mm_h > 0
    if not (block.p.range_folds and (ground or rain)):
        return []
    return [
        "range_folds: echoes of ground and rain do not fold, clutter is that of a target's true "
        "range: over ground nearer than that this radar sees too much"
    ]
