"""A sensor that is an FMU: which of its outputs are columns of detections, and the message of them.

Each communication point is a look. An output that is an array, or several of one pattern, has a
value for each of so many detections; those that are not ``detected`` are left out.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from components.aircraft.aircraft import Aircraft, Roster
from components.foreign.fmu.model import TEXT_KINDS, FmuModel
from components.foreign.reported_look import TRUE_LINE, detections_of_reports
from components.geometry import wrap_pi
from components.messages.columns import MEASURED, OWN_VELOCITY, POSE
from components.messages.detections import Detections, SensorOffer, range_and_report_interval_pairs
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.errors import did_you_mean
from dsa_des.time.clock import ClockSpec

_NEEDED = ("azimuth_rad", "elevation_rad")
_EXTRAS = ("snr_db", "detection_probability", "pixels")
#: Standard deviations, and the variances that they are the roots of.
_ERRORS = {
    "azimuth_error_rad": "azimuth_variance_rad2", "elevation_error_rad": "elevation_variance_rad2",
    "range_error_m": "range_variance_m2", "range_rate_error_m_s": "range_rate_variance_m2_s2",
}  # fmt: skip
_OF_ROWS = (*POSE, *OWN_VELOCITY)
_KNOWN = ("detected", *_NEEDED, "range_m", *MEASURED, *_ERRORS, "confidence", *_EXTRAS, *_OF_ROWS)
_ELEMENT = re.compile(r"(.*)\[(\d+)\]")


def _output_elements(value: Any, model: FmuModel) -> list[tuple[str, int | None]]:
    """Return the FMU variables a scene's value names, with element index, or None for the whole.

    Raises
    ------
    ValueError
        If the FMU has none of such a name.
    """
    if isinstance(value, list):
        return [one for part in value for one in _output_elements(part, model)]
    if not isinstance(value, str):
        return []
    if "*" in value and value not in model.variables:
        before, _, after = value.partition("*")
        pattern = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
        found = [(int(m[1]), m[0]) for m in map(pattern.fullmatch, model.variables) if m]
        if not found:
            near = {re.sub(r"\d+", "*", name) for name in model.variables}
            raise ValueError(
                f"{model.path.name} has no variables {value!r}{did_you_mean(value, sorted(near))}"
            )
        return [(name, None) for _, name in sorted(found)]
    match = _ELEMENT.fullmatch(value)
    if value not in model.variables and match and match[1] in model.variables:
        return [(match[1], int(match[2]) - 1)]
    return [(model.variable(value).name, None)]


class _Column:
    """One detection column: which of the FMU's numbers it takes, and how they are scaled."""

    def __init__(self, name: str, value: Any, wiring: Any) -> None:
        places: list[int] = []
        scales: list[tuple[float, float]] = []
        for output, element in _output_elements(value, wiring.model):
            variable = wiring.model.variables[output]
            if variable.kind in TEXT_KINDS:
                raise ValueError(f"{output!r} is no number")
            first, a, b = wiring.output_index_and_conversion(name, output)
            size = wiring.size(variable)
            if element is not None and not 0 <= element < size:
                raise ValueError(f"{output!r} has the elements 1 to {size}")
            mine = range(size) if element is None else [element]
            places += [first + i for i in mine]
            scales += [(a, b)] * len(mine)
        self.constant = None if isinstance(value, str | list) else float(value)
        self._places, self.size = places, 1 if self.constant is not None else len(places)
        self._scale: FloatArray = np.array(scales).reshape(-1, 2).T

    def values(self, numbers: FloatArray) -> FloatArray:
        """Return the column's values, (rows, detections), or (rows, 1) if one holds for all."""
        if self.constant is not None:
            return np.full((len(numbers), 1), self.constant)
        return self._scale[0] * numbers[:, self._places] + self._scale[1]


class DetectionOutputs:
    """Which FMU outputs become detections, and a list of all that is wrong with this.

    Parameters
    ----------
    given : mapping
        Output, outputs or number by column.
    targets : sequence of str
        Whose detections these are, one by one; nobody's where empty.
    wiring : Wiring
        Whose outputs are known.
    """

    def __init__(self, given: Mapping[str, Any], targets: Sequence[str], wiring: Any) -> None:
        self.wrong: list[str] = []
        self.targets = list(targets)
        self._columns: dict[str, _Column] = {}
        for name, value in given.items():
            if name not in _KNOWN:
                self.wrong.append(f"detections: there is no {name!r}{did_you_mean(name, _KNOWN)}")
                continue
            try:
                self._columns[name] = _Column(name, value, wiring)
            except ValueError as error:
                self.wrong.append(f"detections.{name}: {error}")
        #: How many detections a look has at most.
        self.count = max((c.size for c in self._columns.values()), default=0)
        self._collect_problems()

    def _collect_problems(self) -> None:
        if not self._columns and not self.wrong:
            return
        self.wrong += [
            f"detections: {name} is needed" for name in _NEEDED
            if name not in self._columns and not self.wrong
        ]  # fmt: skip
        for name, column in self._columns.items():
            wanted = 1 if name in _OF_ROWS else self.count
            if column.size not in (1, wanted):
                self.wrong.append(
                    f"detections.{name}: has {column.size} values where there are {wanted}"
                )
        for error, variance in _ERRORS.items():
            if error in self._columns and variance in self._columns:
                self.wrong.append(f"detections: {error} and {variance} say the same")
        for group in (POSE, OWN_VELOCITY):
            said = [name for name in group if name in self._columns]
            if said and len(said) < len(group):
                missing = [name for name in group if name not in said]
                self.wrong.append(f"detections: {said[0]} is of no use without {missing[0]}")
        if self.targets and len(self.targets) != self.count:
            self.wrong.append(
                f"targets: has {len(self.targets)} names where there are {self.count} detections"
            )

    def __bool__(self) -> bool:
        return bool(self._columns)

    @staticmethod
    def variable_names(given: Mapping[str, Any], model: FmuModel) -> list[str]:
        """Return the FMU variables that detections read, without entries that name none."""
        found: list[str] = []
        for value in given.values():
            try:
                found += [name for name, _ in _output_elements(value, model)]
            except ValueError:
                continue
        return found

    def needs_ownship_velocity(self) -> bool:
        """Return whether range rates are read but the FMU gives no ownship velocity with them."""
        return "range_rate_m_s" in self._columns and "own_velocity_north_m_s" not in self._columns

    def offer(self, clock: ClockSpec | None) -> SensorOffer:
        """Return the sensor's declaration of what it measures."""
        same: dict[str, Any] = {}
        for error, variance in _ERRORS.items():
            stated, rooted = self._columns.get(variance), self._columns.get(error)
            if stated is not None and stated.constant is not None:
                same[variance] = stated.constant
            elif rooted is not None and rooted.constant is not None:
                same[variance] = rooted.constant**2
        angles = [same.get(f"{angle}_variance_rad2", 0.0) for angle in ("azimuth", "elevation")]
        return SensorOffer(
            "range_m" in self._columns, math.sqrt(12.0 * max(angles)),
            "range_rate_m_s" in self._columns,
            clock=None if clock is None else lambda: clock,
            promises=()
            if clock is None else range_and_report_interval_pairs(float(clock.period_s)),
            **same,
        )  # fmt: skip

    def roster(self, known: Sequence[Roster]) -> Roster:
        """Return the scene's list of target names, or else one of the names under ``targets``.

        Raises
        ------
        ValueError
            If one that is named is not in the scene.
        """
        if not known:
            return Roster.from_pairs([(name, Aircraft()) for name in self.targets])
        for name in self.targets:
            if name not in known[0].names:
                raise ValueError(
                    f"targets: {name!r} is not in the scene{did_you_mean(name, known[0].names)}"
                )
        return known[0]

    def message(
        self, tick: IntArray, scan: IntArray, numbers: FloatArray, own: FloatArray | None,
        truth: FloatArray | None, roster: Roster,
    ) -> Detections:  # fmt: skip
        """Return rows' detections, without rows with neither a detection nor an ownship pose.

        Parameters
        ----------
        tick, scan : (rows,)
        numbers : (rows, numbers)
            Of the FMU.
        own : (9, rows), or None
            The ownship's pose and velocity (`own_pose`), where blocks upstream say it.
        truth : (3, rows, targets), or None
            True azimuth, elevation and range of the roster's targets, where a line of sight came.
        roster : Roster

        Raises
        ------
        ValueError
            If what it detected has no direction.
        """
        rows = len(tick)
        values = {
            name: np.broadcast_to(column.values(numbers), (rows, max(self.count, 1)))
            for name, column in self._columns.items()
        }
        known = np.isfinite(values["azimuth_rad"]) & np.isfinite(values["elevation_rad"])
        detected = values["detected"] > 0.5 if "detected" in values else known
        row, which = np.nonzero(detected)
        entries = {n: v[row, which] for n, v in values.items() if n not in (*_OF_ROWS, "detected")}
        steep = ~(np.abs(entries["elevation_rad"]) <= 0.5 * math.pi * (1.0 + 1e-12))
        for name, bad in (
            ("azimuth_rad", ~np.isfinite(entries["azimuth_rad"])), ("elevation_rad", steep)
        ):  # fmt: skip
            if bad.any():
                raise ValueError(
                    f"detections.{name} is {entries[name][np.argmax(bad)]:g} for what it detected"
                )
        entries["azimuth_rad"] = wrap_pi(entries["azimuth_rad"])
        if "range_m" in entries:  # none is measured where it is not above 0
            entries["range_m"] = np.where(entries["range_m"] > 0.0, entries["range_m"], np.nan)
        for error, variance in _ERRORS.items():
            if error in entries:
                entries[variance] = entries.pop(error) ** 2
        if "range_variance_m2" in entries:
            ranged = np.isfinite(entries.get("range_m", np.full(len(row), np.nan)))
            entries["range_variance_m2"] = np.where(ranged, entries["range_variance_m2"], np.nan)
        unsaid = np.full((len(_OF_ROWS), rows), np.nan)
        of_rows = dict(zip(_OF_ROWS, unsaid if own is None else own, strict=True))
        of_rows |= {name: values[name][:, 0].copy() for name in _OF_ROWS if name in values}
        places = [roster.names.index(name) for name in self.targets] or [-1] * self.count
        target = np.array(places, dtype=np.int64)[which]
        if truth is not None and self.targets:
            entries |= dict(zip(TRUE_LINE, truth[:, row, target], strict=True))
        counts = np.bincount(row, minlength=rows)
        more: dict[str, Any] = {}
        if "range_rate_m_s" in entries:
            more["own_velocity"] = {
                name: np.where(counts > 0, of_rows[name], np.nan) for name in OWN_VELOCITY
            }
        says = own is not None or "own_lat_deg" in values
        looks = {name: of_rows[name] for name in POSE} if says else {}
        found = detections_of_reports(
            tick, scan, np.concatenate(([0], np.cumsum(counts))), entries, looks,
            target, roster, **more,
        )  # fmt: skip
        # Before anybody has said where it looks from, no look at nothing says anything.
        nowhere = (counts == 0) & np.isnan(looks["own_lat_deg"]) if says else np.zeros(rows, bool)
        return found.take(np.flatnonzero(~nowhere)) if nowhere.any() else found
