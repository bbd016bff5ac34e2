"""Areas of the three bodies whose union shows what was measured from nose, side and above.

The thesis takes an aircraft's areas as measured for those of sphere, cylinder and plate and adds
them: a Beech 99 of 90 m² from above shows 132. Here the bodies are made so that their union
(`components.optical.silhouette`) shows the totals themselves. ``python -m
docs.make.fitted_areas FRONT,ABEAM,ABOVE`` prints them; the files
``configs/aircraft/*_fitted.toml`` were made so.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence

from components.optical.silhouette import visible_area
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

# Halvings of the bracket around the plate's area: down to the last bit.
_STEPS = 80


def fitted_areas(
    front_m2: float, abeam_m2: float, above_m2: float, back_m2: float | None = None
) -> dict[str, float]:
    """Find the bodies whose union shows the given totals from three sides.

    From the nose only the sphere is seen; abeam the cylinder with its two half spheres, the plate
    on its edge; from above all three, where cylinder and plate overlap. With `back_m2`, for
    infrared, the sphere abeam is the mean of front and back.
    """
    ball_m2 = front_m2 if back_m2 is None else 0.5 * (front_m2 + back_m2)
    for name, value, least, why in (
        ("front_m2", min(front_m2, ball_m2), 0.0, ""),
        ("abeam_m2", abeam_m2, ball_m2, ", what the sphere shows"),
        ("above_m2", above_m2, abeam_m2, ", what is seen abeam"),
    ):
        if not value > least:
            raise ValueError(f"{name} is {value:g}: it must be above {least:g}{why}")
    side_m2 = abeam_m2 - ball_m2

    def from_above_m2(plate_m2: float) -> float:
        shown = visible_area(
            0.5 * math.pi,
            0.0,
            0.0,
            -0.5 * math.pi,
            front_m2=front_m2,
            side_m2=side_m2,
            horizontal_m2=plate_m2,
            back_m2=back_m2,
            model="convex_hull",
        )
        return float(shown)

    low, high = 0.0, above_m2
    while from_above_m2(high) < above_m2:
        high *= 2.0
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if from_above_m2(middle) < above_m2 else (low, middle)
    found = {"front_m2": front_m2, "side_m2": side_m2, "horizontal_m2": high}
    return found if back_m2 is None else {**found, "back_m2": back_m2}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the bodies for totals on the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.fitted_areas",
        description="Areas of sphere, cylinder and plate whose union shows measured totals.",
    )
    parser.add_argument("totals", metavar="FRONT,ABEAM,ABOVE[,BACK]", help="totals in m²")
    totals = parser.parse_args(arguments).totals
    try:
        values = [float(text) for text in totals.split(",")]
        if len(values) not in (3, 4) or not all(map(math.isfinite, values)):
            raise ValueError(f"{totals!r} must be three or four numbers, FRONT,ABEAM,ABOVE[,BACK]")
        found = fitted_areas(*values)
    except ValueError as error:
        say(f"error: {error}", err=True)
        return 2
    for name, value in found.items():
        say(f"{name} = {value:.2f}")
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
