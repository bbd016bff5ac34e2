"""Measurement of lines of sight: on a sensor's grid, with its errors, in the ownship's axes."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from components.messages.reach import Reach
from components.sensor.glint import APPARENT_PLACE, Wander
from components.sensor.grid import AZIMUTH, ELEVATION, SensorGrid
from components.sensor.look import Cells, Look
from components.sensor.measurement_errors import MEASUREMENT, ErrorModel
from components.sensor.mounting import AXES, SensorAxes
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component

_BODY_AXES = SensorAxes()


class Measuring(Component):
    """A block that measures where targets are, in axes and on a grid of its own."""

    #: Whether detections carry a range.
    measures_range = False

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        #: As the scene states it, and as it is used: work that can give nothing may be left out.
        self.stated_reach: Reach = parameters.reach()
        self.reach = self.stated_reach
        self.azimuth_step_rad = math.radians(parameters.azimuth_resolution_deg)
        self.elevation_step_rad = math.radians(parameters.elevation_resolution_deg)
        self.range_step_m = float(getattr(parameters, "range_resolution_m", 0.0))

    @cached_property
    def axes(self) -> SensorAxes:
        """Orientation of the sensor relative to the ownship's body axes."""
        return self.built_one(AXES) or _BODY_AXES

    @cached_property
    def _measurement_model(self) -> ErrorModel | SensorGrid:
        """Return the model of measured values and variances: with errors, or on the grid alone."""
        return self.built_one(MEASUREMENT) or self.grid

    @cached_property
    def wander(self) -> Wander | None:
        """Effect that shifts the apparent position over the target's extent (glint), or None."""
        return self.built_one(APPARENT_PLACE)

    @property
    def pixel_rad(self) -> tuple[float, float] | None:
        """Width and height of a pixel, rad, if the sensor measures a target's size; else None."""
        return None

    def range_rate(self, cells: Cells, detected: IntArray) -> FloatArray | None:
        """Return the true range rates of some cells, m/s; None where they are not measured."""
        return None

    def apparent_range_m(self, range_m: FloatArray) -> FloatArray:
        """Return the range reported without errors: the true one, or folded if ambiguous."""
        return range_m

    def signal_variances(self, signal: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return, by quantity, error variances from each detection's signal, in sensor axes."""
        raise TypeError(f"{type(self).__name__} has no signal that errors follow from")

    @property
    def grid_step_by_quantity(self) -> dict[str, float]:
        """Grid step to which each measured quantity is rounded, by name, in rad, m and m/s."""
        steps = {"azimuth": self.azimuth_step_rad, "elevation": self.elevation_step_rad}
        return {**steps, "range": self.range_step_m} if self.measures_range else steps

    @cached_property
    def grid(self) -> SensorGrid:
        """Grid, in sensor axes, to which azimuth, elevation, range and range rate are rounded."""
        return SensorGrid(
            self.reach.azimuth_rad, self.reach.elevation_rad, self.grid_step_by_quantity
        )

    def _measure(
        self,
        cells: Cells,
        detected: IntArray,
        look: Look,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        range_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return azimuths, elevations, ranges in body axes and a dict of variances, range rates."""
        if self.wander is not None:
            line = azimuth_rad, elevation_rad, range_m
            azimuth_rad, elevation_rad, range_m = self.wander(cells, detected, *line)
        azimuth, elevation = self.axes(azimuth_rad, elevation_rad)
        true = {"azimuth": azimuth, "elevation": elevation, "range": self.apparent_range_m(range_m)}
        if (rate := self.range_rate(cells, detected)) is not None:
            true["range_rate"] = rate
        return self._to_body_axes(*self._measurement_model(cells, detected, look, true))

    def report_false_alarms(
        self,
        where: Mapping[str, FloatArray],
        signal: Mapping[str, FloatArray],
        drawn: Any = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return false alarms' azimuths, elevations, ranges (body axes) and variances at `where`.

        `where` is its position by quantity in the sensor's axes, `signal` as in `Look.signal`.
        `drawn` holds keys, scan, instant and run by which errors are drawn, as a target's are:
        without them a position by the edge of the field of view would never be reported beyond it.
        The last value holds the other measured columns of `Detections`.
        """
        return self._to_body_axes(
            *self._measurement_model.measure_false_alarms(where, signal, drawn)
        )

    def _to_body_axes(
        self, values: Mapping[str, FloatArray], variances: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return azimuths, elevations (body axes), ranges, and variance and range-rate columns."""
        angles = values["azimuth"], values["elevation"]
        of_angles = self.axes.variances_in_body(*angles, variances[AZIMUTH], variances[ELEVATION])
        beside = {**variances, AZIMUTH: of_angles[0], ELEVATION: of_angles[1]}
        if "range_rate" in values:
            beside["range_rate_m_s"] = values["range_rate"]
        return *self.axes.believed_direction_in_body(*angles), values["range"], beside
