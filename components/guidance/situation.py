"""State of aircraft, and the volumes that guidance keeps them clear of."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.well_clear.detection import Bounds, violation_or_advisory_span
from components.well_clear.relative_motion import Span, is_surely_less
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Relative, Volume, cylinder_span
from dsa_des.arrays.types import BoolArray, FloatArray


class State(NamedTuple):
    """Where aircraft are at time 0 and how fast, arrays that broadcast against each other."""

    east_m: FloatArray  # In the ownship's plane; up is altitude
    north_m: FloatArray
    up_m: FloatArray
    east_mps: FloatArray
    north_mps: FloatArray
    climb_mps: FloatArray

    def relative_to(self, other: "State") -> Relative:
        """Return the differences of these states and others, part by part."""
        return tuple(mine - theirs for mine, theirs in zip(self, other, strict=True))

    def rows(self, which: Any) -> "State":
        """Return the states of some of the aircraft."""
        return State(*(part[which] for part in self))

    def columns(self) -> "State":
        """Return states of shape (n, 1), to be compared with n manoeuvres in each row."""
        return State(*(np.asarray(part)[:, np.newaxis] for part in self))


@dataclass(frozen=True)
class Detector:
    """A volume, or an upright cylinder, no flight must enter; arrays of the flights' shape."""

    volume: Volume | TcasAdvisory | None = None
    cylinder_m: tuple[Any, Any] | None = None  # Radius and half height, where there is no volume
    bounds: Bounds | None = None  # How far the relative states may be wrong, for the volume

    def span(self, own: State, intruder: State, begin_s: Any, end_s: Any) -> Span:
        """Return from when to when (s) flights are inside the volume."""
        relative = own.relative_to(intruder)
        if self.volume is not None:
            vertical = own.up_m, own.climb_mps
            return violation_or_advisory_span(
                self.volume, relative, vertical, self.bounds, begin_s, end_s
            )
        assert self.cylinder_m is not None
        return cylinder_span(*self.cylinder_m, relative, begin_s, end_s)


def overlaps_time(span: Span, begin_s: Any, end_s: Any) -> BoolArray:
    """Return a mask, True if a span in the volume overlaps the examined time by over an instant."""
    result = is_surely_less(np.maximum(span.begin_s, begin_s), np.minimum(span.end_s, end_s))
    return np.asarray(result & (np.asarray(begin_s) < end_s))


def contains_instant(span: Span, from_s: Any, begin_s: Any, end_s: Any) -> BoolArray:
    """Return which examined times (mask) are an instant, end at ``from_s``, lie in the span."""
    alone = np.asarray((begin_s == end_s) & (from_s == end_s))
    if not alone.any():
        return alone
    return alone & ~is_surely_less(end_s, span.begin_s) & is_surely_less(end_s, span.end_s)
