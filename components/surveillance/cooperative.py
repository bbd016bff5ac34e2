"""What cooperative sensors have in common: their parameters, and instants between scans."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.known_targets import offered_rosters
from components.atmosphere.pressure_altitude import Air, scene_air
from components.geometry import POSITION_FIELDS, line_of_sight_ned
from components.messages.reach import Reach
from components.sensor.look import Cells
from components.sensor.palette import COOPERATIVE
from components.sensor.parameters import SensorParameters
from components.sensor.sensor import Sensor
from components.surveillance.reports import CooperativeReports
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Output
from dsa_des.errors import Disagreements, did_you_mean
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added

#: Half of the time between positions that a velocity is of; a power of two.
STEP_S = 1.0 / 64.0

#: What one who is heard lacks where no code has its altitude.
NO_CODE = (
    "those that it hears send no altitude that it takes (no code has one below -1,200 ft or above "
    "126,700 ft), and are not placed"
)

#: Keys of sensors that measure lines of sight; a report that an aircraft makes has none of them.
_MEASURED_KEYS = (
    "errors", "azimuth_error_deg", "azimuth_bias_deg", "azimuth_correlation_time_s",
    "elevation_error_deg", "elevation_bias_deg", "elevation_correlation_time_s",
    "azimuth_resolution_deg", "elevation_resolution_deg", "mount_azimuth_deg",
    "mount_elevation_deg", "mount_roll_deg", "misalignment_deg", "quantised", "biases",
)  # fmt: skip


def _tuple_if_list(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


class CooperativeParameters(SensorParameters):
    """Parameters of what cooperative sensors share."""

    heights: Literal["reported", "by_own_altimeter"] = Field(
        default="reported",
        description="What reported pressure altitudes are taken for: heights as they are, or "
        "heights once the difference between the ownship's own pressure altitude and its height "
        "by navigation is taken off; its own altimeter has no error.",
    )
    pressure_deviation_m: float = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of what reported pressure altitudes are from heights, as "
        "stated to trackers: those that carry errors of each aircraft estimate it, m.",
    )

    leaves_out: list[str] = Field(
        default=[],
        description="Names of aircraft whose reports are left out, known by their address: those "
        "to which the tracks go, from another platform.",
    )

    @model_validator(mode="before")
    @classmethod
    def _refuse_measurement_keys(cls, given: Any) -> Any:
        # Before the checks of sensors that measure, which would ask for more such keys.
        fields = SensorParameters.model_fields
        Disagreements.raise_if_any(
            [
                f"{key} is given: a cooperative sensor has no axes and no grid of its own; "
                "leave it out"
                for key in _MEASURED_KEYS
                if key in given and _tuple_if_list(given[key]) != fields[key].default
            ]
        )
        return given

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence per key without effect, except keys that the sensor refuses anyway."""
        return [
            said for said in super().ineffective_key_notes() if not said.startswith(_MEASURED_KEYS)
        ]


class CooperativeSensor(Sensor):
    """A sensor that receives what aircraft broadcast or answer; its axes are the ownship's."""

    mark = COOPERATIVE
    measures_range = True
    #: Where an aircraft says that it is, it is, however the ownship believes to be turned.
    turned_by_belief = False
    outputs: ClassVar[Any] = {"detections": Output(CooperativeReports, "What was received.")}
    Parameters: ClassVar[Any] = CooperativeParameters
    #: What of its equipage lets an aircraft be heard, any of these.
    hears_of: ClassVar[tuple[str, ...]] = ()

    def request(self, port: str) -> Any:
        """Return a request for targets with flights: messages are sent between scans."""
        reach = super().request(port)
        return replace(reach, lasts_s=4.0 * STEP_S) if self.p.enabled else reach

    @cached_property
    def _air(self) -> Air | None:
        """The scene's atmosphere, or None if it is the standard one."""
        return scene_air(self.context.sections)

    def pressure_altitude_m(self, height_m: FloatArray) -> FloatArray:
        """Return pressure altitude (m) without errors: the height in the standard atmosphere."""
        if self._air is None:
            return height_m
        return np.asarray(self._air.pressure_altitude_m(height_m))

    def heights_from_altitudes_m(
        self, cells: Cells, which: AnyArray, altitude_m: FloatArray
    ) -> FloatArray:
        """Return heights (m) of pressure altitudes: as reported or relative to the ownship's."""
        if self.p.heights == "reported":
            return altitude_m
        own_m = self.pressure_altitude_m(cells.field_at_rows("own_alt_m")[which])
        return altitude_m - (own_m - cells.believed_pose_component("alt_m")[which])

    def _pressure_height_notes(self) -> list[str]:
        """Return a sentence on the error of pressure altitudes that are used as heights."""
        if self._air is None or self.p.heights == "geometric":
            return []
        at_m = np.array([0.0, 1000.0, 1300.0, 3000.0])
        low_m, here_m, above_m, high_m = self.pressure_altitude_m(at_m) - at_m
        stated, left_m = self.p.pressure_deviation_m, above_m - here_m
        told = f"stated with a deviation of {stated:g} m" if stated else "nobody is told"
        if self.p.heights == "by_own_altimeter":
            said = f"300 m above the ownship {left_m:+.0f} m are left, and {told}"
            return [f"heights is 'by_own_altimeter': {said}"] if abs(left_m) > 5.0 else []
        return [
            f"heights is 'reported': pressure altitudes, off by {low_m:+.0f} m at 0 m and "
            f"{high_m:+.0f} m at 3,000 m in the air of [weather] (qnh_hpa, temperature_offset_c), "
            f"are compared with heights as if they were such, and {told}; 'by_own_altimeter' takes "
            "that off"
        ]

    def warnings(self) -> list[str]:
        """Return a warning if no target is equipped, and a note on pressure altitude as height."""
        rosters = offered_rosters(self.context)
        heard = [getattr(one.equipage, name).any() for one in rosters for name in self.hears_of]
        said = [*super().warnings(), *self._pressure_height_notes()]
        if not rosters or any(heard):
            return said
        needed = " or ".join(self.hears_of)
        return [*said, f"no target's equipage has {needed}: it hears of nobody"]

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self._unplaced = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message, receptions per run from aircraft that sent no altitude."""
        return {**super().failure_counts(), NO_CODE: self._unplaced}

    def setup(self) -> None:
        """Refuse to leave out whom there is not."""
        super().setup()
        names = [name for roster in offered_rosters(self.context) for name in roster.names]
        for name in self.p.leaves_out if names else ():
            if name not in names:
                raise ValueError(f"leaves_out: there is no {name!r}{did_you_mean(name, names)}")

    def is_heard_and_not_excluded(
        self, cells: Cells, heard: BoolArray, address: IntArray
    ) -> BoolArray:
        """Return which cells have a received message and no address to leave out (mask)."""
        roster = cells.roster
        for name in self.p.leaves_out:
            craft = np.full(len(cells), roster.names.index(name))
            craft = (
                craft if roster.is_same_in_all_replicas else roster.aircraft_index(craft, cells.run)
            )
            heard = heard & (address != roster.equipage.address[craft])
        return heard

    def has_position_counting_others(
        self, cells: Cells, heard: IntArray, altitude_m: FloatArray
    ) -> BoolArray:
        """Return which received cells have a known altitude (mask); the others add to a count.

        An altitude that no code has is not available (NaN).
        """
        there = np.isfinite(altitude_m)
        run = cells.run[heard]
        self._unplaced = counts_with_cases_added(self._unplaced, run[~there], run)
        return there

    @cached_property
    def _reach_in_body_axes(self) -> Reach:
        return self.reach


def own_velocity(cells: Cells, which: IntArray) -> FloatArray:
    """Return the ownship's true velocity (north, east, down), (3, n), m/s, at cells' instants."""
    now = np.zeros(len(which))
    return velocity_ned_from_positions(
        cells, which, now, cells.relative_target_fields_ahead(which, now), "own"
    )


def velocity_ned_from_positions(
    cells: Cells, which: IntArray, ahead_s: FloatArray, here: Any, whose: str
) -> FloatArray:
    """Return north, east, down velocity (3, n), m/s, from positions 1/64 s before and after."""
    positions = [here[f"{whose}_{name}"] for name in POSITION_FIELDS]
    moved, span_s = [], np.zeros(len(which))
    for step_s in (-STEP_S, STEP_S):
        then = cells.relative_target_fields_ahead(which, ahead_s + step_s)
        there = then["present"]
        way = line_of_sight_ned(
            *positions, *(then[f"{whose}_{name}"] for name in POSITION_FIELDS), validate=False
        )
        moved.append(np.where(there, np.stack(way), 0.0))
        span_s = span_s + np.where(there, STEP_S, 0.0)
    return np.asarray((moved[1] - moved[0]) / np.maximum(span_s, STEP_S))
