"""Errors of measured values: a bias, a part that lasts, one new at every look, and the signal's."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from components.geometry import wrap_pi_unchecked
from components.messages.detections import LastingError, LastingPart
from components.sensor.grid import (
    VARIANCE_OF,
    Grid,
    Measured,
    Values,
)
from components.sensor.look import Cells, Look
from components.sensor.parameters import StatedError
from dsa_des.arrays.column_values import constant_column, shared_nan_column
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.time.gauss_markov import GaussMarkov
from dsa_des.time.randomness import Stream

_NO_TARGET = np.uint64(0)
_OWN, _OF_SIGNAL = 0, 1


class QuantityError:
    """Draws the errors of one quantity, in its own unit.

    A drawn bias is uniform between minus and plus the stated one, once for each run.
    """

    def __init__(self, stated: StatedError, stream: Callable[[str], Stream], name: str) -> None:
        self._deviation, self._bias = stated.deviation, stated.bias
        self._drawn = stated.drawn_bias
        self._biases, self._looks = stream(f"bias of {name}"), stream(f"error of {name}")
        #: The biases of the first runs, as far as they were asked for.
        self._known = np.empty(0)
        self._lasting: GaussMarkov | None = None
        if stated.correlation_time_s is not None:
            lasting = stream(f"lasting error of {name}")
            self._lasting = GaussMarkov(lasting, stated.correlation_time_s)

    def __call__(
        self,
        keys: npt.ArrayLike,
        scan: IntArray,
        instant_ns: IntArray,
        run: IntArray,
        variance: FloatArray | None = None,
    ) -> FloatArray:
        """Return the errors of looks; `variance` is of what the signal adds at each."""
        error = self._bias_of(run) if self._bias else np.zeros(len(scan))
        looks = self._looks.of_runs(run, instant_ns)
        if self._lasting is not None:
            error = error + self._deviation * self._lasting(keys, instant_ns, run=run)
        elif self._deviation:
            error = error + self._deviation * looks.normal(keys, scan, _OWN)
        if variance is not None:
            error = error + np.sqrt(variance) * looks.normal(keys, scan, _OF_SIGNAL)
        return error

    def _bias_of(self, run: IntArray) -> FloatArray:
        if not self._drawn:
            return np.full(len(run), self._bias)
        if len(run) and run.max() >= len(self._known):  # the others' are as they were
            runs = np.arange(len(self._known), int(run.max()) + 1)
            keys, scan = np.full(len(runs), _NO_TARGET), np.zeros(len(runs), dtype=np.int64)
            drawn = self._biases.of_runs(runs).uniform(keys, scan)
            self._known = np.append(self._known, self._bias * (2.0 * drawn - 1.0))
        return self._known[run]


# A range that comes out below this, a millimetre, is no range.
_NEAREST_M = 1e-3
_QUARTER = 0.5 * math.pi


class ErrorModel:
    """Measures with errors; called instead of the sensor's grid."""

    def __init__(self, block: Any) -> None:
        p = block.p
        self._block, self._signal = block, p.errors == "signal"
        self._places = block.stream("noise places")
        stated: dict[str, StatedError] = p.stated_errors(block.grid_step_by_quantity)
        self._errors = {
            name: QuantityError(one, block.stream, name) for name, one in stated.items()
        }
        self._variances = {name: one.variance for name, one in stated.items()}
        #: Mean square of errors that are stated as a share of the value, by quantity.
        self._shares = {
            name: one.mean_square_without_rounding for name, one in stated.items() if one.share
        }
        self._steps = {name: one.step for name, one in stated.items()}
        self._grids = {
            "azimuth": Grid(self._steps["azimuth"]),
            "elevation": Grid(self._steps["elevation"], limit_low=-_QUARTER, limit_high=_QUARTER),
            **{name: Grid(self._steps[name]) for name in self._steps if name.startswith("range")},
        }

    def __call__(self, cells: Cells, detected: IntArray, look: Look, true: Values) -> Measured:
        """Return measured values of the `detected` cells, and their variances by column.

        `true` is the truth by quantity, in the sensor's axes.
        """
        signal = {name: all_[detected] for name, all_ in look.signal.items()}
        keys = cells.roster.draw_keys_of(cells.target[detected])
        scan, run = cells.scan[detected], cells.run[detected]
        instant_ns = cells.instant_ns[detected]
        if look.noise is not None and self._signal:
            true = self._scatter_noise_in_resolution_cells(
                true, look.noise[detected], keys, scan, run, instant_ns
            )
        return self.measure_false_alarms(true, signal, (keys, scan, instant_ns, run))

    def _scatter_noise_in_resolution_cells(
        self,
        true: Values,
        noise: BoolArray,
        keys: AnyArray,
        scan: IntArray,
        run: IntArray,
        instant_ns: IntArray,
    ) -> Values:
        """Return true values, noise detections moved at random in their target's resolution cell.

        It errs from there, and states of itself, what any report as strong does: noise does not
        say that it is noise.
        """
        if not noise.any():
            return true
        silent = {"snr": np.zeros(1)}
        places = dict(true)
        for number, (name, most) in enumerate(self._block.signal_variances(silent).items()):
            width = math.sqrt(12.0 * float(most[0]))
            drawn = self._places.of_runs(run[noise], instant_ns[noise])
            part = drawn.uniform(keys[noise], scan[noise], number)
            middle = np.rint(true[name][noise] / width) * width
            low, high = self._noise_limits.get(name, (-math.inf, math.inf))
            first = np.maximum(middle - 0.5 * width, low)
            last = np.minimum(middle + 0.5 * width, high)
            places[name] = true[name].copy()
            places[name][noise] = first + part * np.maximum(last - first, 0.0)
        return places

    @cached_property
    def _noise_limits(self) -> dict[str, tuple[float, float]]:
        """Lower, upper limit by quantity of detections by noise; none if azimuth wraps round."""
        reach = self._block.reach
        fields = {"elevation": reach.elevation_rad}
        if self._block.measures_range:
            fields["range"] = (0.0, reach.range_max_m)
        low, high = reach.azimuth_rad
        if -math.pi <= low < high <= math.pi and high - low < 2.0 * math.pi:
            fields["azimuth"] = (low, high)
        return fields

    def measure_false_alarms(self, where: Values, signal: Values, drawn: Any) -> Measured:
        """Return values (with errors, on the grid) and variances of the false alarms at `where`.

        `drawn` holds keys, scan, instant and run by which errors are drawn, or is None.
        """
        of_signal: Values = self._block.signal_variances(signal) if self._signal else {}
        if drawn is not None:
            keys, scan, instant_ns, run = drawn
            errors = {
                name: error(keys, scan, instant_ns, run, of_signal.get(name))
                for name, error in self._errors.items()
            }
            # Some are a share of the value.
            where = {
                name: where[name] + error * (where[name] if name in self._shares else 1.0)
                for name, error in errors.items()
            }
        values = self._round_and_normalise(where)
        count, columns = len(values["azimuth"]), {}
        for name, value in self._variances.items():
            if name in of_signal:
                variance = value + of_signal[name]
            else:
                variance = constant_column(value, count, np.float64)
            if name in self._shares:
                variance = variance + self._shares[name] * values[name] ** 2
            columns[VARIANCE_OF[name]] = variance
        if self._block.wander is not None:
            added = self._block.wander.added_variances_by_quantity(
                values, signal, self._block.pixel_rad
            )
            for name, more in added.items():
                columns[VARIANCE_OF[name]] = columns[VARIANCE_OF[name]] + more
        return values, columns

    def _round_and_normalise(self, values: Values) -> dict[str, FloatArray]:
        """Return values with errors as reported: angles wrapped, range positive, all on the grid.

        An elevation beyond the vertical is one on its other side; a range is above 0.
        """
        azimuth, elevation = values["azimuth"], wrap_pi_unchecked(values["elevation"])
        over = np.abs(elevation) > _QUARTER
        elevation = np.where(over, np.copysign(math.pi, elevation) - elevation, elevation)
        azimuth = np.where(over, azimuth + math.pi, azimuth)
        values = {**values, "azimuth": azimuth, "elevation": elevation}
        on_grid = {name: grid.round(values[name]) for name, grid in self._grids.items()}
        on_grid["azimuth"] = wrap_pi_unchecked(on_grid["azimuth"])
        if "range" not in on_grid:
            on_grid["range"] = shared_nan_column(len(azimuth))
        else:
            nearest = self._steps["range"] or _NEAREST_M
            on_grid["range"] = np.maximum(np.abs(on_grid["range"]), nearest)
        return on_grid


MEASUREMENT = Hook("measurement", ErrorModel, "what is measured, and its variances")


class MeasurementErrors(Effect[ErrorModel]):
    """Errors of azimuth, elevation, range and range rate, in the sensor's own axes."""

    name = "measurement errors"
    acts_on = MEASUREMENT
    builds = ErrorModel
    outside_the_proof = "without it reports are the truth on a grid"

    def verdict(self, block: Any) -> Verdict:
        """Return whether measurements have errors: needs ``errors``."""
        if block.p.errors == "grid":
            return Verdict(False, "errors is 'grid': values are rounded to the grid")
        return Verdict(True, f"errors is '{block.p.errors}'")


def constant_variances(p: Any, steps: Mapping[str, float]) -> dict[str, float]:
    """Return variances equal for all detections, by column; empty if errors follow the signal."""
    if p.errors == "signal":
        return {}
    stated = p.stated_errors(steps).items()
    return {VARIANCE_OF[name]: one.variance for name, one in stated if not one.share}


def lasting_errors(p: Any, steps: Mapping[str, float]) -> dict[str, LastingError]:
    """Return the sensor errors that last from look to look, by quantity."""
    lasting = {}
    for name, stated in p.stated_errors(steps).items():
        bias = stated.mean_square_of_bias
        parts = [LastingPart(bias)] if bias else []
        if stated.correlation_time_s is not None and stated.deviation:
            parts.append(LastingPart(stated.deviation**2, stated.correlation_time_s))
        if stated.share:  # grows with the value: a share of all the variance but rounding's
            rounding = stated.variance
            shares = [
                (one.variance / stated.mean_square_without_rounding, one.lasts_s) for one in parts
            ]
            parts = [LastingPart(-one * rounding, lasts_s, share=one) for one, lasts_s in shares]
        if stated.step or parts:
            lasting[name] = LastingError(stated.step, tuple(parts))
    return lasting


def add_error_parts(
    errors: Mapping[str, LastingError], parts: Mapping[str, Iterable[LastingPart]]
) -> dict[str, LastingError]:
    """Return the lasting errors by quantity, with the given correlated parts appended."""
    joined = dict(errors)
    for name, more in parts.items():
        known = joined.get(name, LastingError())
        joined[name] = replace(known, parts=(*known.parts, *more))
    return joined
