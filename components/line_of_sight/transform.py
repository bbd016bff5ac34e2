"""The ladders of the coordinate transform: the Earth's shape, the attitude, and bent rays."""

import math
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from components.geometry import (
    POSE_FIELDS,
    POSITION_FIELDS,
    LineOfSight,
    unit_vectors,
    wrap_pi_unchecked,
)
from components.line_of_sight.earth_effects import (
    BENDS,
    EARTH_EFFECTS,
    HIDES,
    terrain_section,
)
from components.line_of_sight.model_choice import (
    REFERENCE,
    PickedModels,
    convert_range_to_seeming,
    pick_models,
)
from components.messages.reach import FarthestLook, combined_farthest_look
from components.messages.targets import RelativeTargets, TrafficStates
from components.navigation.errors import OWNSHIP, NavigationErrors
from components.sensor.ladder_values import (
    absolute_angle_difference_mrad,
    angle_between_vectors_mrad,
    spread_over_roster,
)
from dsa_des.arrays.column_values import first_row_if_stored_once, store_once_if_equal
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.ladder import Ladder, Quantity, Rung, Unavailable, Verified
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake

_MRAD_PER_DEG = 1e3 * np.pi / 180.0

#: Angles are the sensors' (ownship's body axes). Near the zenith of those axes azimuth means
#: little, so costs are weighed against the angle between the lines of sight.
QUANTITIES = (
    Quantity("direction", "mrad", angle_between_vectors_mrad, "angle_deg", _MRAD_PER_DEG),
    Quantity("azimuth", "mrad", absolute_angle_difference_mrad),
    Quantity("elevation", "mrad", absolute_angle_difference_mrad),
    Quantity("range", "m", tolerance="range_m"),
)


def measured_lines_of_sight(
    block: Component, wake: Wake, reference: Component
) -> dict[str, AnyArray]:
    """Transform a wake; return body direction, azimuth, elevation, range, (rows, all targets)."""
    seen: Any = block.run(wake)
    return {
        "direction": spread_over_roster(
            seen, unit_vectors(seen.body_azimuth_rad, seen.body_elevation_rad)
        ),
        "azimuth": spread_over_roster(seen, seen.body_azimuth_rad),
        "elevation": spread_over_roster(seen, seen.body_elevation_rad),
        "range": spread_over_roster(seen, seen.range_m),
    }


def _why_refraction_is_skipped(block: Any) -> str:
    """Return why refraction needs no simulation with straight rays; empty where they bend."""
    bends = terrain_section(block).refraction != "none"
    return "" if bends else "[terrain] refraction is 'none': rays are straight"


def line_of_sight_truth_errors(
    block: Component, wake: Wake, cells: IntArray
) -> dict[str, FloatArray]:
    """Return a transform's errors against the line of sight at 40 digits (needs mpmath)."""
    from components.high_precision.line_of_sight import line_of_sight_errors

    if not _why_refraction_is_skipped(block):
        raise Unavailable("nothing more exact is known of bent rays")
    states, seen = wake["states"], block.run(wake)
    errors = []
    for row, target in cells.tolist():
        column = int(np.searchsorted(states.columns, target))
        own: Any = tuple(getattr(states, f"own_{name}")[row] for name in POSE_FIELDS)
        other: Any = tuple(getattr(states, name)[row, column] for name in POSITION_FIELDS)
        lines: Any = seen
        given = (
            lines.body_azimuth_rad[row, column],
            lines.body_elevation_rad[row, column],
            lines.range_m[row, column],
        )
        errors.append(line_of_sight_errors(own[:3], other, own[3:], given))
    columns = np.array(errors).reshape(-1, 4)
    columns[:, :3] *= 1e3
    names = [quantity.name for quantity in QUANTITIES]
    return {name: columns[:, i] for i, name in enumerate(names)}


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
    measured_lines_of_sight,
    line_of_sight_truth_errors,
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
    measured_lines_of_sight,
    line_of_sight_truth_errors,
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
    measured_lines_of_sight,
    applies=_why_refraction_is_skipped,
)  # fmt: skip


# Cells worked on together: the two dozen arrays in flight then stay in the processor's cache,
# which was measured to be three times faster than whole windows.
CELLS_AT_ONCE = 8192


class TransformParameters(Parameters):
    """Parameters of a coordinate transform."""

    model: (
        Literal["auto", "flat_earth", "local_radii", "daidalus_sphere", "geodesic", "ellipsoid"]
        | None
    ) = Field(
        default=None,
        description="Model of the Earth, by default that of the block's type; 'auto' picks the "
        "cheapest whose proven error [accuracy] allows.",
    )
    attitude: Literal["exact", "small_angle", "auto"] = Field(
        default="exact",
        description="How body angles follow from the ownship's attitude: rotation of the line of "
        "sight, or angle by angle as in thesis eq. 4-5; 'auto' as for the model.",
    )


class Transform(Component):
    """Turns geodetic positions into lines of sight; subclasses choose the model of the Earth.

    Where ``[accuracy]`` allows an error of angle and range, cheaper models replace the
    exact ones, so long as the proven bounds of their errors together stay within it (`rung`).
    """

    inputs = {"states": Input(TrafficStates, "trigger", "Where all aircraft are.")}
    outputs = {"targets": Output(RelativeTargets, "Targets as seen from the ownship.")}
    Parameters = TransformParameters
    windowed = True
    lockstep = True
    rewindable = True
    hooks = (OWNSHIP, HIDES, BENDS)
    effects = (NavigationErrors(), *EARTH_EFFECTS)
    ladders = (EARTH, ATTITUDE, REFRACTION)
    #: The type's own model of the Earth.
    earth: ClassVar[str]

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.rung: PickedModels | None = None

    def setup(self) -> None:
        """Store the ownship's believed pose, and the geometry models to compute with."""
        self._beliefs = self.built(OWNSHIP)
        self._hiding = self.built(HIDES)
        self._bending = self.built(BENDS)
        self.rung = pick_models(self)
        self._line_of_sight = LineOfSight(self.rung.earth, self.rung.attitude)

    def request(self, port: str) -> FarthestLook:
        """Return one request that covers all sensors downstream, to pass to the traffic."""
        look = combined_farthest_look(consumer.request for consumer in self.context.consumers)
        earth = REFERENCE[0] if self.rung is None else self.rung.earth
        return convert_range_to_seeming(self.context, earth, look)

    def skipped_work_notes(self) -> list[str]:
        """Return a sentence for each geometry model that was picked, with the reason."""
        return [] if self.rung is None else list(self.rung.sentences)

    def report(self) -> dict[str, Any]:
        """Return the models in use for the summary; empty if ``[accuracy]`` did not decide."""
        if self.rung is None or self.rung.bound is None:
            return {}
        models = {"earth": self.rung.earth, "attitude": self.rung.attitude}
        return {"models": {self.name: models}}

    def offer(self, port: str) -> Any:
        """Return the offer of the traffic upstream unchanged; None without a producer."""
        return self.context.producers[0].offer if self.context.producers else None

    def run(self, wake: Wake) -> Message | None:
        """Transform every target at every instant."""
        states = wake["states"]
        if states is None:
            return None
        own = _broadcast_ownship(states)
        return RelativeTargets(
            tick=wake.ticks,
            state_tick=states.tick,
            own_lat_deg=states.own_lat_deg,
            own_lon_deg=states.own_lon_deg,
            own_alt_m=states.own_alt_m,
            roster=states.roster,
            columns=states.columns,
            culled=states.culled,
            believed={
                name: store_once_if_equal(v)
                for name, v in self._believed_pose_columns(states).items()
            },
            own_attitude={name: getattr(states, f"own_{name}") for name in POSE_FIELDS[3:]},
            revisit=None
            if states.flights is None
            else states.flights.with_states_transformed(self._columns_at_other_instants),
            **self._relative_target_columns(own, states, states.present),
        )

    def _relative_target_columns(
        self, own: Any, other: Any, present: BoolArray
    ) -> dict[str, AnyArray]:
        """Return the fields of `RelativeTargets` that are per row and target."""
        rows, width = present.shape
        step = max(1, CELLS_AT_ONCE // max(1, width))
        if rows <= step:
            seen = self._line_of_sight_columns(own, other, present)
        else:
            seen = {}
            for first in range(0, rows, step):
                block = slice(first, first + step)
                part = self._line_of_sight_columns(
                    _take_pose_rows(own, block), _take_pose_rows(other, block), present[block]
                )
                seen = seen or {n: np.empty(present.shape, v.dtype) for n, v in part.items()}
                for name, values in part.items():
                    seen[name][block] = values
        return {
            **seen,
            "target_pitch_rad": other.pitch_rad,
            "target_roll_rad": other.roll_rad,
            "alt_m": other.alt_m,
            "present": present,
        }

    def _line_of_sight_columns(
        self, own: Any, other: Any, present: BoolArray
    ) -> dict[str, AnyArray]:
        seen = self._line_of_sight.from_ownship(own, other)
        for bends in self._bending:
            seen = bends(own, seen, self._line_of_sight.attitude)
        heading = wrap_pi_unchecked(other.yaw_rad - seen.azimuth_rad)
        _refuse_non_finite_angles(seen.body_azimuth_rad, heading, other.pitch_rad, other.roll_rad)
        fields = {
            **seen._asdict(),
            "relative_heading_rad": heading,
        }
        if self._hiding:
            fields["hidden"] = np.logical_or.reduce(
                [hides(own, other, present) for hides in self._hiding]
            )
        return fields

    def _columns_at_other_instants(self, own: Any, other: Any) -> dict[str, Any]:
        """Return line-of-sight columns at other instants, with targets' and ownship's positions."""
        seen = self._relative_target_columns(own, other, own.present & other.present)
        return {
            **seen,
            "target": {name: getattr(other, name) for name in POSITION_FIELDS},
            "own": {name: getattr(own, name) for name in (*POSE_FIELDS, "present")},
        }

    def _believed_pose_columns(self, states: TrafficStates) -> dict[str, FloatArray]:
        """Return the ownship's believed pose by column; the true one without navigation errors."""
        for belief in self._beliefs:
            return belief(states)
        return {name: getattr(states, f"own_{name}") for name in POSE_FIELDS}


def _take_pose_rows(state: Any, rows: slice) -> SimpleNamespace:
    return SimpleNamespace(**{name: getattr(state, name)[rows] for name in POSE_FIELDS})


def _broadcast_ownship(states: TrafficStates) -> SimpleNamespace:
    """Return the ownship's position and attitude, broadcastable to the targets'."""
    own = [getattr(states, f"own_{name}") for name in POSE_FIELDS]
    if len(states) > 1:
        columns = [values[:, np.newaxis] for values in own]
        return SimpleNamespace(**dict(zip(POSE_FIELDS, columns, strict=True)))
    # Of a single row, arrays of the targets' own shape take NumPy half as long as broadcast ones.
    wide = np.empty((6, *states.lat_deg.shape))
    for row, values in zip(wide, own, strict=True):
        row[...] = values
    return SimpleNamespace(**dict(zip(POSE_FIELDS, wide, strict=True)))


def _refuse_non_finite_angles(*angles: FloatArray) -> None:
    """Raise ValueError if any of the values is not a finite number."""
    # A sum is finite only if all of it is; it stands for whatever the angles came from.
    if not math.isfinite(sum(first_row_if_stored_once(values).sum() for values in angles)):
        raise ValueError("a position or an attitude of the traffic is not a finite number")


class FlatEarth(Transform):
    """Line of sight over a flat Earth with 111,195 m per degree (thesis eq. 1-5, corrected)."""

    earth = "flat_earth"


class LocalRadii(Transform):
    """Line of sight over a flat Earth with the ellipsoid's radii at the ownship."""

    earth = "local_radii"


class DaidalusSphere(Transform):
    """Line of sight in the plane in which the alerting logic of DO-365 compares aircraft."""

    earth = "daidalus_sphere"


class Geodesic(Transform):
    """Bearing and distance along the geodesic (GeographicLib), elevation from the heights."""

    earth = "geodesic"


class Ellipsoid(Transform):
    """Exact line of sight on the WGS-84 ellipsoid."""

    earth = "ellipsoid"
    verified = (
        Verified("line of sight", "evaluation at 40 digits", "1e-12 m + 1e-13 of the range",
                 "tests/geometry/test_ellipsoid_exact.py"),
        Verified("directions in body axes of a banked ownship", "pymap3d and rotation matrices",
                 "1e-3 m across", "tests/line_of_sight/test_line_of_sight.py"),
    )  # fmt: skip
