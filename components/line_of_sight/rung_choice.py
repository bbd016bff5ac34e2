"""The choice of a model of the line of sight: the cheapest whose proven error is allowed."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

from components.geometry.error_bounds import Envelope, ErrorBound, error_bound
from components.geometry.line_of_sight import EARTH_MODELS
from components.messages.reach import REACH_MARGIN

# CPU time per line of sight in blocks of 10,000, relative to flat earth; only the order matters.
# (The geodesic takes a hundred times as long as the exact form and is never worth it.)
EARTH_COST = {
    "flat_earth": 1.0, "local_radii": 1.05, "ellipsoid": 1.95, "daidalus_sphere": 2.0,
    "geodesic": 800.0,
}  # fmt: skip
ATTITUDE_COST = {"small_angle": 0.8, "exact": 1.5}

REFERENCE = ("ellipsoid", "exact")

# A model that puts targets so far from where they are cannot be judged by those in reach.
_LARGEST_RELATIVE_RANGE = 0.5 * (REACH_MARGIN - 1.0)


@dataclass(frozen=True)
class Allowance:
    """Errors that a scene allows its lines of sight; infinite where it does not judge.

    Parameters
    ----------
    angle_rad, range_m : float
    relative_range : float
        What sensors downstream bear (see `components.messages.reach.Reach`).
    """

    angle_rad: float = math.inf
    range_m: float = math.inf
    relative_range: float = math.inf

    def complaint(self, bound: ErrorBound) -> str:
        """Say which bound is not allowed, or nothing."""
        if bound.angle_rad > self.angle_rad:
            return (
                f"an error in angle of {angle_text(bound.angle_rad)} cannot be excluded, and "
                f"[accuracy] allows {math.degrees(self.angle_rad):g} deg"
            )
        if bound.range_m > self.range_m:
            return (
                f"an error in range of {range_text(bound.range_m)} cannot be excluded, and "
                f"[accuracy] allows {self.range_m:g} m"
            )
        if bound.relative_range > _LARGEST_RELATIVE_RANGE:
            return (
                f"ranges may be off by {_share(bound.relative_range)}, too much to tell which "
                "targets come in reach"
            )
        if bound.relative_range > self.relative_range:
            return (
                f"its error in range could change a Pd by more than [accuracy] leaves (ranges to "
                f"{_share(bound.relative_range)}, of which {_share(self.relative_range)} may be)"
            )
        return ""


@dataclass(frozen=True)
class ModelChoice:
    """What was chosen, with its bound, and why each cheaper one was not.

    Parameters
    ----------
    earth, attitude : str
    bound : ErrorBound
    refused : tuple of str
        "flat earth: …", cheapest first.
    """

    earth: str
    attitude: str
    bound: ErrorBound
    refused: tuple[str, ...]


def choose(
    earths: tuple[str, ...],
    attitudes: tuple[str, ...],
    envelopes: Sequence[Envelope],
    allowed: Allowance,
) -> ModelChoice:
    """Return the cheapest pair of models whose proven error is allowed.

    Parameters
    ----------
    earths, attitudes : tuple of str
        What there is to choose from; if nothing is good enough, the exact one of each.
    envelopes : sequence of Envelope
        One for each sensor; none where no sensor looks.
    allowed : Allowance
        The error of the two models together must stay within it.
    """
    pairs = sorted(
        ((earth, attitude) for earth in earths for attitude in attitudes),
        key=lambda pair: (EARTH_COST[pair[0]] + ATTITUDE_COST[pair[1]], pair),
    )
    refused: dict[str, str] = {}
    for earth, attitude in pairs:
        bound = _worst([error_bound(earth, envelope, attitude) for envelope in envelopes])
        complaint = allowed.complaint(bound)
        if not complaint:
            break
        # The exact attitude comes later: what it does not cure is the Earth's fault.
        refused[earth] = f"{name_of(earth, attitude)}: {complaint}"
    else:
        earth, attitude = max(earths, key=EARTH_MODELS.index), min(attitudes)
        bound = _worst([error_bound(earth, envelope, attitude) for envelope in envelopes])
    return ModelChoice(earth, attitude, bound, tuple(refused.values()))


def _worst(bounds: Sequence[ErrorBound]) -> ErrorBound:
    columns = [astuple(bound) for bound in bounds] or [(0.0,) * len(fields(ErrorBound))]
    return ErrorBound(*map(max, zip(*columns, strict=True)))


def name_of(earth: str, attitude: str = "exact") -> str:
    """Return a model's name as one would say it."""
    name = earth.replace("_", " ")
    return name if attitude == "exact" else f"{name} with {attitude.replace('_', '-')} attitude"


def angle_text(angle_rad: float) -> str:
    """Return, for example, "0.0041 deg"; an error of half a turn is any error."""
    return "any size" if angle_rad >= math.pi else f"{math.degrees(angle_rad):.2g} deg"


def range_text(range_m: float) -> str:
    """Return, for example, "5.3 m"."""
    return "any size" if math.isinf(range_m) else f"{range_m:.2g} m"


def _share(relative: float) -> str:
    return "any share" if math.isinf(relative) else f"{100.0 * relative:.2g} %"
