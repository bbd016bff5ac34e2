"""Measurement of lines of sight: on a sensor's grid, with its errors, in the ownship's axes."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from components.messages.reach import Reach
from components.sensor.glint import APPARENT_PLACE, Wander
from components.sensor.grid import AZIMUTH, ELEVATION, SensorGrid, constant_column
from components.sensor.look import Cells, Look
from components.sensor.measurement_errors import MEASUREMENT, ErrorModel
from components.sensor.mounting import AXES, SensorAxes
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component

_BODY_AXES = SensorAxes()

#: Values by quantity, and variances by column, in the sensor's axes.
Measured = tuple[dict[str, FloatArray], dict[str, FloatArray]]


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
        """The sensor's axes; known once the scene's effects are."""
        return self.built_one(AXES) or _BODY_AXES

    @cached_property
    def _error_model(self) -> ErrorModel | None:
        return self.built_one(MEASUREMENT)

    @cached_property
    def wander(self) -> Wander | None:
        """Where targets seem to be on themselves or None."""
        return self.built_one(APPARENT_PLACE)

    @property
    def pixel_rad(self) -> tuple[float, float] | None:
        """Width and height of a pixel, of a sensor that measures a target's size."""
        return None

    def measure(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, range_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Round a line of sight in the sensor's axes to its grid and field of view (§3.5.1)."""
        return self.grid.round(azimuth_rad, elevation_rad, range_m)

    def range_rate(self, cells: Cells, detected: IntArray) -> FloatArray | None:
        """Return the true range rates of some cells, m/s; None where they are not measured."""
        return None

    def signal_variances(self, signal: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return what `Look.signal` adds to the variances, by quantity, in the sensor's axes."""
        raise TypeError(f"{type(self).__name__} has no signal that errors follow from")

    @property
    def steps(self) -> dict[str, float]:
        """Grid step of each quantity that is measured: rad, m and m/s."""
        steps = {"azimuth": self.azimuth_step_rad, "elevation": self.elevation_step_rad}
        return {**steps, "range": self.range_step_m} if self.measures_range else steps

    @cached_property
    def grid(self) -> SensorGrid:
        """The grid of reports in the sensor's axes."""
        return SensorGrid(self.reach.azimuth_rad, self.reach.elevation_rad, self.steps)

    def _measured(
        self,
        cells: Cells,
        detected: IntArray,
        look: Look,
        azimuth_rad: FloatArray,
        elevation_rad: FloatArray,
        range_m: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return what is measured of lines of sight in body axes, and columns beside."""
        if self.wander is not None:
            line = azimuth_rad, elevation_rad, range_m
            azimuth_rad, elevation_rad, range_m = self.wander(cells, detected, *line)
        azimuth, elevation = self.axes(azimuth_rad, elevation_rad)
        true = {"azimuth": azimuth, "elevation": elevation, "range": range_m}
        if (rate := self.range_rate(cells, detected)) is not None:
            true["range_rate"] = rate
        if self._error_model is not None:
            return self._in_body(*self._error_model(cells, detected, look, true))
        return self._in_body(*self._on_grid(true))

    def report_noise(
        self,
        where: Mapping[str, FloatArray],
        signal: Mapping[str, FloatArray],
        drawn: Any = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return how something that is not there is reported, in body axes, as if it were.

        `where` is its place by quantity in the sensor's axes, `signal` as in `Look.signal`. `drawn`
        holds keys, scan, instant and run by which errors are drawn, as a target's are: without
        them a place by the edge of the field of view would never be reported beyond it. The last
        value holds the other measured columns of `Detections`.
        """
        if self._error_model is not None:
            return self._in_body(*self._error_model.of_noise(where, signal, drawn))
        return self._in_body(*self._on_grid(where))

    def _on_grid(self, true: Mapping[str, FloatArray]) -> Measured:
        """Return values on the grid, and their variances: step²/12."""
        azimuth, elevation, range_m = self.measure(
            true["azimuth"], true["elevation"], true["range"]
        )
        values = {"azimuth": azimuth, "elevation": elevation, "range": range_m}
        if "range_rate" in true:
            values["range_rate"] = self.grid.round_rate(true["range_rate"])
        count = len(azimuth)
        of_grid = self.grid.variances.items()
        return values, {name: constant_column(value, count) for name, value in of_grid}

    def _in_body(
        self, values: Mapping[str, FloatArray], variances: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return angles in body axes, ranges, and columns beside, of values in the sensor's."""
        angles = values["azimuth"], values["elevation"]
        of_angles = self.axes.variances_in_body(*angles, variances[AZIMUTH], variances[ELEVATION])
        beside = {**variances, AZIMUTH: of_angles[0], ELEVATION: of_angles[1]}
        if "range_rate" in values:
            beside["range_rate_m_s"] = values["range_rate"]
        return *self.axes.to_body(*angles), values["range"], beside
