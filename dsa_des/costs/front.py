"""The rungs that none beats on both axes, and the cheapest that is good enough."""

import re
from collections.abc import Iterable, Mapping, Sequence

from dsa_des.block.ladder import Ladder, Quantity
from dsa_des.errors import UsageError, did_you_mean

_BUDGET = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(\S+)\s*")


def on_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return which (cost, error) no other point beats: none is as good on both and better on one.

    A NaN error is on no front.
    """
    return [
        error == error
        and not any(
            c <= cost and e <= error and (c < cost or e < error) for c, e in points if e == e
        )
        for cost, error in points
    ]


def parse_budgets(texts: Iterable[str], ladders: Iterable[Ladder]) -> dict[str, float]:
    """Return largest allowed errors by unit from texts such as ``0.5mrad``.

    Raises
    ------
    UsageError
        If one is no number with a unit of these ladders.
    """
    units = sorted({q.unit for ladder in ladders for q in ladder.quantities})
    found: dict[str, float] = {}
    for text in texts:
        match = _BUDGET.fullmatch(text)
        try:
            value = float(match[1]) if match else 0.0
        except ValueError:
            value = 0.0
        if match is None or not value > 0.0:
            raise UsageError(
                f"--budget {text}: must be a number above 0 with its unit, for example 0.5mrad; "
                f"units: {', '.join(units)}"
            )
        unit = {"m2": "m²", "pd": "Pd"}.get(match[2].lower(), match[2])
        if unit not in units:
            raise UsageError(f"--budget {text}: unknown unit {match[2]}{did_you_mean(unit, units)}")
        found[unit] = value
    return found


def allowed_error(
    quantity: Quantity, budgets: Mapping[str, float], tolerance: Mapping[str, float]
) -> float | None:
    """Return the largest error that `--budget`, or else ``[accuracy]``, allows; None for any."""
    if quantity.unit in budgets:
        return budgets[quantity.unit]
    if quantity.tolerance in tolerance:
        return tolerance[quantity.tolerance] * quantity.per_tolerance
    return None
