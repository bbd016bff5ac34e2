"""The models that a transform computes with in a scene, and what `explain` says of them."""

import math
from dataclasses import dataclass
from typing import Any

from components.aircraft.known_targets import KnownTraffic
from components.geometry.error_bounds import Envelope, ErrorBound
from components.line_of_sight.rung_choice import (
    EARTH_COST,
    REFERENCE,
    Allowance,
    angle_text,
    choose,
    name_of,
    range_text,
)
from components.messages.reach import FarthestLook, farthest_look


@dataclass(frozen=True)
class PickedModels:
    """The models a transform computes with.

    Parameters
    ----------
    earth, attitude : str
    bound : ErrorBound, optional
        Of their error over the scene, where it was asked for.
    sentences : tuple of str
        For `explain`.
    """

    earth: str
    attitude: str
    bound: ErrorBound | None = None
    sentences: tuple[str, ...] = ()


def pick_rung(transform: Any) -> PickedModels:
    """Pick a transform's models, once its consumers and producers are known.

    What the scene names is taken. Exact models, and those that are left to ``auto``, give way to
    cheaper ones where ``[accuracy]`` allows their errors: ``auto`` is judged by those of
    ``angle_deg`` and ``range_m`` that are given, an exact model only gives way if both are. What
    the error in range does to a radar's Pd counts where ``detection_probability`` is given.

    Parameters
    ----------
    transform : components.line_of_sight.transform.Transform
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
        sentence = f"geometry: {name_of(*exact)}, {because}"
        return PickedModels(*exact, sentences=(sentence,) if auto or given else ())

    if not any(free) or not (auto or len(given) == 2):
        return PickedModels(*exact)
    if transform.context.simulate_everything:
        return stay("the reference: everything is simulated")
    if not given:
        return stay("the reference: [accuracy] allows no error of angle or range")
    look = farthest_look(consumer.request for consumer in transform.context.consumers)
    if look.exact_because:
        return stay(f"the reference: {look.exact_because}")
    envelopes = _envelopes(transform, look)
    if envelopes is None:
        return stay("the reference: the traffic does not say where its targets can be")
    allowed = Allowance(
        math.radians(tolerance["angle_deg"]) if "angle_deg" in tolerance else math.inf,
        tolerance.get("range_m", math.inf),
        look.range_slack,
    )
    choice = choose(
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
    picked = f"geometry: {name_of(choice.earth, choice.attitude)}, {'; '.join(judged)}"
    return PickedModels(
        choice.earth,
        choice.attitude,
        choice.bound,
        (picked, *(f"geometry: not {reason}" for reason in choice.refused)),
    )


def _envelopes(transform: Any, look: FarthestLook) -> list[Envelope] | None:
    """Return where each sensor's lines of sight can lie, if the traffic says so."""
    offers = [producer.offer for producer in transform.context.producers]
    if len(offers) != 1 or not isinstance(offers[0], KnownTraffic):
        return None
    envelopes = []
    for range_m, steepest_rad in look.views:
        traffic = offers[0].envelope(range_m, look.lasts_s)
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
