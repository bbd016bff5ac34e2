"""The ladders of the coordinate transform: the Earth's shape, the attitude, and bent rays."""

from typing import Any

import numpy as np

from components.geometry.directions import unit_vectors
from components.sensor.ladder_values import (
    angle_apart_mrad,
    over_roster,
    wrapped_apart_mrad,
)
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable
from dsa_des.block.wake import Wake

_MRAD_PER_DEG = 1e3 * np.pi / 180.0

#: Angles are the sensors' (ownship's body axes). Near the zenith of those axes azimuth means
#: little, so costs are weighed against the angle between the lines of sight.
QUANTITIES = (
    Quantity("direction", "mrad", angle_apart_mrad, "angle_deg", _MRAD_PER_DEG),
    Quantity("azimuth", "mrad", wrapped_apart_mrad),
    Quantity("elevation", "mrad", wrapped_apart_mrad),
    Quantity("range", "m", tolerance="range_m"),
)


def measure(block: Component, wake: Wake, reference: Component) -> dict[str, AnyArray]:
    """Return the lines of sight that a transform gives, in body axes."""
    seen: Any = block.run(wake)
    return {
        "direction": over_roster(
            seen, unit_vectors(seen.body_azimuth_rad, seen.body_elevation_rad)
        ),
        "azimuth": over_roster(seen, seen.body_azimuth_rad),
        "elevation": over_roster(seen, seen.body_elevation_rad),
        "range": over_roster(seen, seen.range_m),
    }


def _straight(block: Any) -> str:
    """Say that rays are straight where the scene says so; nothing where they bend."""
    terrain = block.context.sections.get("terrain")
    bends = terrain is not None and terrain.refraction != "none"
    return "" if bends else "[terrain] refraction is 'none': rays are straight"


def truth(block: Component, wake: Wake, cells: IntArray) -> dict[str, FloatArray]:
    """Return a transform's errors against the line of sight at 40 digits (needs mpmath)."""
    from components.high_precision.line_of_sight import line_of_sight_errors

    if not _straight(block):
        raise Unavailable("nothing more exact is known of bent rays")
    states, seen = wake["states"], block.run(wake)
    errors = []
    for row, target in cells.tolist():
        column = int(np.searchsorted(states.columns, target))
        own = (states.own_lat_deg[row], states.own_lon_deg[row], states.own_alt_m[row])
        other = (
            states.lat_deg[row, column],
            states.lon_deg[row, column],
            states.alt_m[row, column],
        )
        attitude = (
            states.own_yaw_rad[row],
            states.own_pitch_rad[row],
            states.own_roll_rad[row],
        )
        found: Any = seen
        given = (
            found.body_azimuth_rad[row, column],
            found.body_elevation_rad[row, column],
            found.range_m[row, column],
        )
        errors.append(line_of_sight_errors(own, other, attitude, given))
    columns = np.array(errors).reshape(-1, 4)
    columns[:, :3] *= 1e3
    names = [quantity.name for quantity in QUANTITIES]
    return {name: columns[:, place] for place, name in enumerate(names)}


EARTH = Ladder(
    "earth",
    (
        Rung("flat_earth", "111,195 m per degree (thesis eq. 1-5)", "geometry.flat_earth"),
        Rung("local_radii", "flat, with the ellipsoid's radii at the ownship",
             "geometry.local_radii"),
        Rung("daidalus_sphere", "a sphere of 1 nmi per minute, projected (alerting of DO-365)",
             "geometry.daidalus_sphere"),
        Rung("geodesic", "bearing and distance along the geodesic", "geometry.geodesic"),
        Rung("ellipsoid", "exact line of sight on WGS-84", "geometry.ellipsoid"),
    ),
    "ellipsoid",
    QUANTITIES,
    measure,
    truth,
    clears=("model",),
    map_function="components.line_of_sight.error_map:draw_error_map",
)  # fmt: skip

ATTITUDE = Ladder(
    "attitude",
    (
        Rung("small_angle", "angle by angle (thesis eq. 4-5)",
             parameters={"attitude": "small_angle"}),
        Rung("exact", "the line of sight rotated into the body axes",
             parameters={"attitude": "exact"}),
    ),
    "exact",
    QUANTITIES,
    measure,
    truth,
)  # fmt: skip


REFRACTION = Ladder(
    "refraction",
    (
        Rung("none", "straight rays", sections={"terrain": {"refraction": "none"}}),
        Rung("four_thirds", "rays as over an Earth of 4/3 its radius (ITU-R P.834)",
             sections={"terrain": {"refraction": "four_thirds"}}),
    ),
    "four_thirds",
    QUANTITIES,
    measure,
    applies=_straight,
)  # fmt: skip
