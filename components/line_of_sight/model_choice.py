"""The cheapest models of Earth and attitude whose proven errors the scene allows."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Any

from components.aircraft.known_targets import KnownTraffic
from components.geometry import EARTH_MODELS
from components.geometry.error_bounds import Envelope, ErrorBound, error_bound
from components.messages.reach import REACH_MARGIN, FarthestLook, combined_farthest_look
from dsa_des.block.component import Context


def convert_range_to_seeming(context: Context, earth: str, look: FarthestLook) -> FarthestLook:
    """Return the request with its range, stated by a model of the Earth, as a pair in `seeming`;
    unchanged for the reference model, of infinite range without known traffic.
    """
    if earth == REFERENCE[0] or look.range_m == 0.0 or not math.isfinite(look.range_m):
        return look
    if _known_traffic_of_only_producer(context) is None:
        return replace(look, range_m=math.inf)
    return replace(look, range_m=0.0, seeming=((earth, look.range_m),))


def _known_traffic_of_only_producer(context: Context) -> KnownTraffic | None:
    """Return the only producer's `KnownTraffic`; None if several produce or it offers none."""
    offers = [producer.offer for producer in context.producers]
    return offers[0] if len(offers) == 1 and isinstance(offers[0], KnownTraffic) else None


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
    """Largest line-of-sight errors that ``[accuracy]`` allows; infinite where it sets no limit."""

    angle_rad: float = math.inf
    range_m: float = math.inf
    # What sensors downstream bear (see `components.messages.reach.Reach`)
    relative_range: float = math.inf

    def describe_excess(self, bound: ErrorBound) -> str:
        """Return a phrase naming the first error bound above its allowance; empty if none is."""
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
                f"ranges may be off by {_percent_text(bound.relative_range)}, too much to tell "
                f"which "
                "targets come in reach"
            )
        if bound.relative_range > self.relative_range:
            return (
                f"its error in range could change a Pd by more than [accuracy] leaves (ranges to "
                f"{_percent_text(bound.relative_range)}, of which "
                f"{_percent_text(self.relative_range)} may be)"
            )
        return ""


@dataclass(frozen=True)
class ModelChoice:
    """The chosen Earth and attitude models, their error bound, why cheaper ones were refused."""

    earth: str
    attitude: str
    bound: ErrorBound
    refused: tuple[str, ...]  # "flat earth: …", cheapest first


def choose_cheapest_models(
    earths: tuple[str, ...],
    attitudes: tuple[str, ...],
    envelopes: Sequence[Envelope],
    allowed: Allowance,
) -> ModelChoice:
    """Return the cheapest models (Earth, attitude) of allowed proven error, else the most exact."""
    pairs = sorted(
        ((earth, attitude) for earth in earths for attitude in attitudes),
        key=lambda pair: (EARTH_COST[pair[0]] + ATTITUDE_COST[pair[1]], pair),
    )
    refused: dict[str, str] = {}
    for earth, attitude in pairs:
        bound = _largest_bounds([error_bound(earth, envelope, attitude) for envelope in envelopes])
        complaint = allowed.describe_excess(bound)
        if not complaint:
            break
        # The exact attitude comes later: what it does not cure is the Earth's fault.
        refused[earth] = f"{model_label(earth, attitude)}: {complaint}"
    else:
        earth, attitude = max(earths, key=EARTH_MODELS.index), min(attitudes)
        bound = _largest_bounds([error_bound(earth, envelope, attitude) for envelope in envelopes])
    return ModelChoice(earth, attitude, bound, tuple(refused.values()))


def _largest_bounds(bounds: Sequence[ErrorBound]) -> ErrorBound:
    columns = [astuple(bound) for bound in bounds] or [(0.0,) * len(fields(ErrorBound))]
    return ErrorBound(*map(max, zip(*columns, strict=True)))


def model_label(earth: str, attitude: str = "exact") -> str:
    """Return a model pair's label for messages, as `flat earth with small-angle attitude`."""
    name = earth.replace("_", " ")
    return name if attitude == "exact" else f"{name} with {attitude.replace('_', '-')} attitude"


def angle_text(angle_rad: float) -> str:
    """Return an angle as text, such as `0.0041 deg`; `any size` if it is half a turn or more."""
    return "any size" if angle_rad >= math.pi else f"{math.degrees(angle_rad):.2g} deg"


def range_text(range_m: float) -> str:
    """Return, for example, "5.3 m"."""
    return "any size" if math.isinf(range_m) else f"{range_m:.2g} m"


def _percent_text(relative: float) -> str:
    return "any share" if math.isinf(relative) else f"{100.0 * relative:.2g} %"


@dataclass(frozen=True)
class PickedModels:
    """The models a transform computes with."""

    earth: str
    attitude: str
    bound: ErrorBound | None = None  # Of their error over the scene, where it was asked for
    sentences: tuple[str, ...] = ()  # For `explain`


def pick_models(transform: Any) -> PickedModels:
    """Return a transform's Earth and attitude models, once consumers and producers are known.

    What the scene names is taken. Exact models, and those that are left to ``auto``, give way to
    cheaper ones where ``[accuracy]`` allows their errors: ``auto`` is judged by those of
    ``angle_deg`` and ``range_m`` that are given, an exact model only gives way if both are. What
    the error in range does to a radar's Pd counts where ``detection_probability`` is given.
    """
    parameters, tolerance = transform.p, transform.context.tolerance
    named = parameters.model or type(transform).earth
    auto = "auto" in (named, parameters.attitude)
    exact = (
        REFERENCE[0] if named == "auto" else named,
        REFERENCE[1] if parameters.attitude == "auto" else parameters.attitude,
    )
    given = [key for key in ("angle_deg", "range_m") if key in tolerance]
    free = [
        name in ("auto", reference) for name, reference in zip(
            (named, parameters.attitude), REFERENCE, strict=True
        )
    ]  # fmt: skip

    def stay(because: str) -> PickedModels:
        sentence = f"geometry: {model_label(*exact)}, {because}"
        return PickedModels(*exact, sentences=(sentence,) if auto or given else ())

    if not any(free) or not (auto or len(given) == 2):
        return PickedModels(*exact)
    if transform.context.simulate_everything:
        return stay("the reference: everything is simulated")
    if not given:
        return stay("the reference: [accuracy] allows no error of angle or range")
    look = combined_farthest_look(consumer.request for consumer in transform.context.consumers)
    if look.exact_because:
        return stay(f"the reference: {look.exact_because}")
    envelopes = _line_of_sight_envelopes(transform, look)
    if envelopes is None:
        return stay("the reference: the traffic does not say where its targets can be")
    allowed = Allowance(
        math.radians(tolerance["angle_deg"]) if "angle_deg" in tolerance else math.inf,
        tolerance.get("range_m", math.inf),
        look.range_slack,
    )
    choice = choose_cheapest_models(
        tuple(EARTH_COST) if free[0] else (exact[0],),
        ("small_angle", "exact") if free[1] else (exact[1],),
        envelopes,
        allowed,
    )
    judged = [
        f"its error in {what} is at most {text}, and [accuracy] allows {tolerance[key]:g} {unit}"
        for key, what, text, unit in (
            ("angle_deg", "angle", angle_text(choice.bound.angle_rad), "deg"),
            ("range_m", "range", range_text(choice.bound.range_m), "m"),
        )
        if key in tolerance
    ]
    silent = [key for key in ("angle_deg", "range_m") if key not in tolerance]
    judged += [f"[accuracy] {key} is not given and not judged" for key in silent]
    picked = f"geometry: {model_label(choice.earth, choice.attitude)}, {'; '.join(judged)}"
    return PickedModels(
        choice.earth,
        choice.attitude,
        choice.bound,
        (picked, *(f"geometry: not {reason}" for reason in choice.refused)),
    )


def _line_of_sight_envelopes(transform: Any, look: FarthestLook) -> list[Envelope] | None:
    """Return each sensor's bounds in range, altitude and angle; None if traffic states none."""
    known = _known_traffic_of_only_producer(transform.context)
    if known is None:
        return None
    envelopes = []
    for range_m, steepest_rad in look.views:
        traffic = known.envelope(range_m, look.lasts_s)
        if traffic is None:
            return None
        # From the horizon to the plane of the wings is at most the sum of pitch and roll.
        tilt = traffic.pitch_rad + traffic.roll_rad
        envelopes.append(
            Envelope(
                range_max_m=traffic.range_m,
                own_lat_deg=traffic.own_lat_deg,
                own_alt_m=traffic.own_alt_m,
                target_alt_m=traffic.target_alt_m,
                steepest_rad=min(steepest_rad, traffic.elevation_rad + tilt, 0.5 * math.pi),
                pitch_rad=traffic.pitch_rad,
                roll_rad=traffic.roll_rad,
            )
        )
    return envelopes
