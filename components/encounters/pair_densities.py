"""Densities from which miss distances of encounters are drawn, and what weights undo them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import Field

from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Parameters

_NAUTICAL_MILE_FT = 6076.115485564304


@dataclass(frozen=True, eq=False)
class StepDensity:
    """A positive function that is constant between rising edges (n + 1,), with heights (n,)."""

    edges: FloatArray
    heights: FloatArray

    def __post_init__(self) -> None:
        if len(self.edges) != len(self.heights) + 1 or not len(self.heights):
            raise ValueError(
                f"{len(self.edges)} edges need {len(self.edges) - 1} proportions; there are "
                f"{len(self.heights)}"
            )
        if not np.isfinite(self.edges).all() or (np.diff(self.edges) <= 0.0).any():
            raise ValueError("edges must be rising numbers")
        if not np.isfinite(self.heights).all() or (self.heights <= 0.0).any():
            raise ValueError("proportions must be numbers above 0")

    @property
    def _cumulative_area(self) -> FloatArray:
        return np.concatenate([[0.0], np.cumsum(self.heights * np.diff(self.edges))])

    @property
    def area(self) -> float:
        """Integral of the function from the first to the last edge."""
        return float(self._cumulative_area[-1])

    def integral_to(self, x: FloatArray) -> FloatArray:
        """Return the integral of the function from the first edge to each x."""
        return np.interp(x, self.edges, self._cumulative_area)

    def quantile_of_area(self, area: FloatArray) -> FloatArray:
        """Return the x up to which the integral from the first edge has this value."""
        return np.interp(area, self._cumulative_area, self.edges)

    def value_at(self, x: FloatArray) -> FloatArray:
        """Return the function's value at each x; outside the edges that of the outermost step."""
        index = np.searchsorted(self.edges, x, side="right") - 1
        result: FloatArray = self.heights[np.clip(index, 0, len(self.heights) - 1)]
        return result


#: Edges of miss distances: farther than any aircraft sees another.
FARTHEST_FT = 1e6


def horizontal_density(edges_ft: FloatArray, shares: FloatArray) -> StepDensity:
    """Return the density of signed horizontal miss distances (ft) with these shares by edges."""
    wide = np.diff(edges_ft) if len(edges_ft) == len(shares) + 1 else 1.0
    with np.errstate(divide="ignore", invalid="ignore"):  # steps of no width are refused
        return _density_about_zero(edges_ft, shares / wide)


def vertical_acceptance(edges_ft: FloatArray, chances: FloatArray) -> StepDensity:
    """Return the probability, by signed vertical miss distance (ft), that an encounter is accepted,
    constant between edges.
    """
    if not (chances <= 1.0).all():
        raise ValueError("chances must lie above 0 and be 1 at most")
    return _density_about_zero(edges_ft, chances)


def _density_about_zero(edges_ft: FloatArray, heights: FloatArray) -> StepDensity:
    if not (np.abs(edges_ft) <= FARTHEST_FT).all():
        raise ValueError(f"edges must lie within ±{FARTHEST_FT:g} ft")
    density = StepDensity(edges_ft, heights)
    if edges_ft[0] > 0.0 or edges_ft[-1] < 0.0:
        raise ValueError("the edges must lie about 0")
    return density


def _step_density(edges: list[float], heights: list[float]) -> StepDensity:
    return StepDensity(np.array(edges), np.array(heights))


@dataclass(frozen=True)
class PairingRules:
    """Rules that make two sampled tracks an encounter: durations, miss distances and limits.

    They last `duration_s` and are closest at `closest_s`. A vertical miss distance is accepted with
    a probability in proportion to `vertical_ft`, none outside its edges; the signed horizontal one
    is drawn from the density `horizontal_ft`. Pairs that begin nearer than both `start_*` are
    rejected, as are those whose tracks miss what was drawn by a `largest_*_error_ft`.
    """

    duration_s: int = 180
    closest_s: int = 150
    vertical_ft: StepDensity = field(
        default_factory=lambda: _step_density(
            [-1500, -500, -100, 0, 100, 500, 1500], [1 / 2, 1 / 1.5, 1, 1, 1 / 1.5, 1 / 2]
        )
    )
    horizontal_ft: StepDensity = field(
        default_factory=lambda: _step_density(
            [-18240, -1500, -500, 0, 500, 1500, 18240],
            [1 / 1.5 / 16740, 1 / 1.25 / 1000, 1 / 500, 1 / 500, 1 / 1.25 / 1000, 1 / 1.5 / 16740],
        )
    )
    start_vertical_ft: float = 800.0
    start_range_ft: float = 1.5 * _NAUTICAL_MILE_FT
    largest_horizontal_error_ft: float = 500.0
    largest_vertical_error_ft: float = 20.0

    def __post_init__(self) -> None:
        if not 0 < self.closest_s < self.duration_s:
            raise ValueError(
                f"closest_s = {self.closest_s}: must lie between 0 and duration_s = "
                f"{self.duration_s}"
            )


class MissDistances(Parameters):
    """Edges and proportions of encounters' miss distances, which the weights undo."""

    edges_ft: tuple[float, ...] = Field(description="Rising edges of steps, ft.")
    proportions: tuple[float, ...] = Field(
        description="Of each step between two edges: of horizontal distances the share of "
        "encounters in it, of vertical ones the chance (at most 1) with which they are accepted."
    )

    @property
    def edges_and_proportions(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Edges in ft, and proportions of the steps between them."""
        return self.edges_ft, self.proportions


def pairing_rules(*steps: Sequence[Sequence[float]] | None) -> PairingRules:
    """Return the standard rules, with other steps of horizontal and vertical miss if given.

    ValueError begins with which of both does not fit.
    """
    changes: dict[str, Any] = {}
    makers = {"horizontal": horizontal_density, "vertical": vertical_acceptance}
    for (name, make), given in zip(makers.items(), steps, strict=True):
        try:
            if given is not None:
                changes[f"{name}_ft"] = make(*map(np.array, given))
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return PairingRules(**changes)


#: Half the width of the cylinder over which miss distances are uniform in the airspace: 10 nmi.
REFERENCE_FT = 60761.0


def relative_speed_over_directions(
    first: FloatArray, second: FloatArray, climb: FloatArray
) -> FloatArray:
    """Return the integral of two aircraft's relative speed over course differences 0 to 2 pi.

    ∫ √(v₁² + v₂² - 2 v₁ v₂ cos ψ + Δḣ²) dψ over a full turn is 4 √A E(m) with A = (v₁ + v₂)² + Δḣ²
    and m = 4 v₁ v₂ / A, E the complete elliptic integral of the second kind of the *parameter* m.
    Upstream passes √m, the modulus, to a function that takes m: up to 8 % too low.
    """
    from scipy.special import ellipe

    largest = (first + second) ** 2 + climb**2
    result: FloatArray = 4.0 * np.sqrt(largest) * ellipe(4.0 * first * second / largest)
    return result
