"""The base class of sensors: a scan clock, a reach, a grid, and a look at the cells.

A sensor subclass writes one pure function, `Sensor.look`, over *cells*: flat arrays with one
element per (scan, target) that needs its physics. How many scans those come from is the
engine's business.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from components.messages.cues import CueCones
from components.messages.detections import (
    REPORT,
    Detections,
    LastingError,
    ReportTransform,
    SensorOffer,
    range_and_report_interval_pairs,
)
from components.messages.looks import EveryLook, look_arrays_scans_by_targets
from components.messages.reach import CULLED, EVALUATE, HIDDEN, SKIP_REASONS, Reach, ReasonArray
from components.messages.targets import GatedTargets, RelativeTargets
from components.navigation.errors import (
    NavigationReport,
    lasting_navigation_errors,
    position_and_attitude_deviations,
)
from components.sensor.cued_looks import CUE, PORT, ConesAhead, believed_ownship_pose_columns
from components.sensor.declaration import DeclarationByPlace, DeclarationRule
from components.sensor.glint import APPARENT_PLACE, Glint
from components.sensor.grid import AZIMUTH, ELEVATION, VARIANCE_OF
from components.sensor.look import DECLARATION, STRENGTH, Cells, Judging, Look, Strengthening
from components.sensor.measurement_errors import (
    MEASUREMENT,
    MeasurementErrors,
    add_error_parts,
    constant_variances,
    lasting_errors,
)
from components.sensor.measuring import Measuring
from components.sensor.mounting import AXES, Mounting
from components.sensor.parameters import SensorParameters
from dsa_des.arrays.column_values import constant_column
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.component import Input, Output
from dsa_des.block.effect import Effect, Hook
from dsa_des.block.ladder import Verified
from dsa_des.block.message import Message, offsets_from_entry_rows
from dsa_des.block.wake import Wake

# Up to so many targets, counting row by row is mostly the overhead of rows.
_FEW_COLUMNS = 8


def count_evaluated_and_skipped(
    reason: ReasonArray, on_roster: int, culled: IntArray | None, hides: bool
) -> tuple[IntArray, dict[str, IntArray]]:
    """Return each scan's number of targets evaluated, and by reason the number skipped.

    Only where something `hides` targets are hidden ones looked for. Which of the culled ones the
    arrays hold, as absent, depends on the window that they came in: what is counted does not.
    """
    rows, targets = reason.shape
    if rows == 1 or targets > _FEW_COLUMNS:  # one pass instead of one for each reason
        codes = len(SKIP_REASONS) + 1
        cell = reason * np.int64(rows) + np.arange(rows)[:, np.newaxis]
        count = np.bincount(cell.reshape(-1), minlength=codes * rows).reshape(codes, rows)
        of = {code: count[code] for code in (EVALUATE, *SKIP_REASONS.values())}
    else:
        of = {
            code: _count_true_per_row(reason == code)
            for code in (EVALUATE, *SKIP_REASONS.values())
            if hides or code != HIDDEN
        }
        of.setdefault(HIDDEN, _constant_counts(0, rows))
    skipped = {name: of[code] for name, code in SKIP_REASONS.items()}
    left_out = on_roster - targets
    if culled is None:
        culled = _constant_counts(left_out, rows)
    else:
        skipped["absent"] = skipped["absent"] + (left_out - culled)
    skipped[CULLED] = culled
    return of[EVALUATE], skipped


def _count_true_per_row(mask: BoolArray) -> IntArray:
    """Return how many values are True in each row of a narrow mask, faster than a sum."""
    if not np.count_nonzero(mask):
        return _constant_counts(0, len(mask))
    total: Any = mask[:, 0].astype(np.int8)  # a sink keeps them as narrow as they are
    for column in mask.T[1:]:
        total += column
    return total


def _constant_counts(count: int, rows: int) -> IntArray:
    return constant_column(count, rows, np.int64)


#: Effects that every sensor has, after its own.
SENSOR_EFFECTS: tuple[Effect, ...] = (
    Mounting(),
    Glint(),
    MeasurementErrors(),
    DeclarationRule(),
    DeclarationByPlace(),
    NavigationReport(),
)


class Sensor(Measuring):
    """A block that looks at the targets at its own scan instants and reports detections.

    Effects that act on the ``report`` are called with the detections, the targets and the
    message's row of each scan, and return the detections that are sent.

    Extras of a look are recorded if the message of the output ``detections`` declares them; a
    sensor with extras of its own has a subclass of `Detections` there.
    """

    inputs = {"targets": Input(RelativeTargets, "sampled", "Targets as seen from the ownship.")}
    outputs = {"detections": Output(Detections, "What was detected, scan by scan.")}
    Parameters: ClassVar[Any] = SensorParameters
    verified = (
        Verified("errors of measured values", "their moments as stated, over 1e5 looks",
                 "4 standard errors; stated variances 1e-12 of the value",
                 "tests/sensor/test_errors_of_measurement.py"),
        Verified("field of view and range", "directions by matrices of rotation",
                 "0.1 deg on both sides of every edge", "tests/sensor/test_reach.py"),
    )  # fmt: skip
    also_records: ClassVar[tuple[type[Message], ...]] = (EveryLook,)
    windowed = True
    lockstep = True
    rewindable = True
    remembers: ClassVar[tuple[str, ...] | None] = ()
    hooks: ClassVar[tuple[Hook[Any], ...]] = (
        CUE, AXES, APPARENT_PLACE, STRENGTH, MEASUREMENT, DECLARATION, REPORT,
    )  # fmt: skip
    effects = SENSOR_EFFECTS
    #: Whether lines of sight are measured in body axes, so that turned into the
    #: world's by what the ownship believes of its pose they have its errors too.
    turned_by_belief: ClassVar[bool] = True

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = tuple(effect for effect in cls.effects if effect not in SENSOR_EFFECTS)
        cls.effects = own + SENSOR_EFFECTS

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        #: What a look at nothing gave; while there is still nothing, it is not repeated.
        self._idle: Look | None = None
        self._idle_run = -1

    def request(self, port: str) -> Any:
        """Return the targets this sensor needs: reach in body axes, and accuracy of range."""
        slack, because = self.relative_range_tolerance(), self.why_exact_line_of_sight()
        return replace(self._reach_in_body_axes, range_slack=slack, exact_because=because)

    def relative_range_tolerance(self) -> float:
        """Return the largest relative range error that ``[accuracy]`` allows; infinity: any.

        Infinite where nothing that ``[accuracy]`` bounds depends on the range.
        """
        return math.inf

    def why_exact_line_of_sight(self) -> str:
        """Return why the sensor needs an exact line of sight, or an empty string."""
        return ""

    def offer(self, port: str) -> Any:
        """Return what this sensor offers: quantities, variances, lasting errors, reach, clock."""
        resolution_rad = max(self.azimuth_step_rad, self.elevation_step_rad)
        constant: dict[str, Any] = constant_variances(self.p, self.grid_step_by_quantity)
        lasting = lasting_errors(self.p, self.grid_step_by_quantity)
        if Glint().verdict(self).simulated:
            lasting = add_error_parts(lasting, Glint().build(self).correlated_parts_by_quantity())
        reach = self.stated_reach
        if Mounting().verdict(self).simulated:  # turned, the angles' differ with the direction
            constant = {**constant, AZIMUTH: None, ELEVATION: None}
            reach = Mounting().build(self).reach_in_body_axes(reach)
            # In the ownship's axes each angle has some of both: the coarser stands for them.
            angles = [lasting.pop(name) for name in ("azimuth", "elevation") if name in lasting]
            if angles:
                parts = tuple(dict.fromkeys(part for one in angles for part in one.parts))
                worst = LastingError(max(one.step for one in angles), parts)
                lasting |= {"azimuth": worst, "elevation": worst}
        unstated_m2 = 0.0
        noise = position_and_attitude_deviations(self.context)
        if self.turned_by_belief and any(map(any, noise)):  # differs with the pose
            unstated_m2 = 0.0 if self.measures_range else max(noise[0]) ** 2
            lasting = add_error_parts(lasting, lasting_navigation_errors(self.context))
            constant = {**constant, AZIMUTH: None, ELEVATION: None, VARIANCE_OF["range"]: None}
        return SensorOffer(
            self.measures_range, resolution_rad, "range_rate" in self.grid_step_by_quantity,
            reach=reach,
            lasting=lasting, clock=self.p.clock_spec, unstated_across_m2=unstated_m2,
            promises=range_and_report_interval_pairs(float(1 / self.p.scan_rate_hz)), **constant,
        )  # fmt: skip

    @cached_property
    def _reach_in_body_axes(self) -> Reach:
        return self.axes.reach_in_body_axes(self.reach)

    @cached_property
    def _message(self) -> type[Detections]:
        """Return the class of sent messages: `Detections`, or a subclass with more columns."""
        message: type[Detections] = type(self).outputs["detections"].message  # type: ignore[assignment]
        return message

    @cached_property
    def _is_every_look_recorded(self) -> bool:
        """Return whether the scene asks to record every look, detected or not."""
        record = self.context.sections.get("record")
        return bool(record is not None and record.looks)

    def records(self) -> list[type[Message]]:
        """Return the message types to record: detections, and all looks if the scene asks."""
        return [self._message, EveryLook] if self._is_every_look_recorded else [self._message]

    @cached_property
    def _judgements(self) -> list[Judging]:
        return self.built(DECLARATION)

    @cached_property
    def _cue_cones(self) -> ConesAhead | None:
        return self.built_one(CUE)

    @cached_property
    def _strengths(self) -> list[Strengthening]:
        return self.built(STRENGTH)

    @cached_property
    def _report_transforms(self) -> list[ReportTransform]:
        return self.built(REPORT)

    def observed_targets_and_rows(
        self, targets: RelativeTargets, rows: IntArray, cued: BoolArray | None = None
    ) -> tuple[RelativeTargets, IntArray]:
        """Return targets as observed (unchanged; a sweep at its own instants), and each scan's row.

        `cued` (scans, targets) says which lie in a cue cone.
        """
        return targets, rows

    def look(self, cells: Cells) -> Look:
        """Return detection, confidence, signal per cell; sensor kinds put their physics here.

        A second look in a row that has no cells is not asked for.
        """
        raise TypeError(f"{type(self).__name__} has no look(cells)")

    def run(self, wake: Wake) -> Detections | None:
        """Look at every target in reach at every scan of the wake; nothing where switched off."""
        if not self.p.enabled:
            return None
        held = wake.held("targets")
        if held is None:
            return None
        cued = None if self._cue_cones is None else self._cue_cones(*held, wake)
        targets, rows = self.observed_targets_and_rows(*held, cued)
        cells, reason = self.cells(targets, rows, wake)
        if cued is not None:
            cells.cued = cued[reason == EVALUATE]
        rows = cells.message_rows
        # Where rows are of several runs, what is remembered of each may change without cells.
        run = int(wake.run[0]) if wake.instants.is_one_run else -1
        look = self._idle if run == self._idle_run else None
        if look is None or len(cells):
            look = self.look(cells)
            if not isinstance(look, Look):
                raise TypeError(f"look gave {type(look).__name__}, no Look")
            look.check(len(cells))
            for judge in self._judgements:
                look = judge(cells, look)
            self._idle, self._idle_run = None if len(cells) or run < 0 else look, run
        detected = look.detected.nonzero()[0]
        decided = look
        for measures in self._strengths:
            look = measures(cells, detected, look)
        culled = None if targets.culled is None else targets.culled[rows]
        evaluated, skipped = count_evaluated_and_skipped(
            reason, len(targets.roster), culled, targets.hidden is not None
        )
        row = cells.row[detected]
        if len(wake) == 1:
            offsets = np.array([0, len(detected)], dtype=np.int64)
        else:
            offsets = offsets_from_entry_rows(row, len(wake))
        measured: dict[str, Any] = {}
        p, q, r = (cells.body_azimuth_rad[detected], cells.body_elevation_rad[detected],
                   cells.range_m[detected])  # fmt: skip
        azimuth, elevation, range_m = p, q, r
        if len(detected):
            azimuth, elevation, range_m, measured = self._measure(cells, detected, look, p, q, r)
        detections = self._message(
            tick=wake.ticks,
            run=wake.run,
            scan=wake.scans,
            evaluated=evaluated,
            skipped=skipped,
            offsets=offsets,
            target=cells.target[detected],
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            range_m=range_m,
            confidence=look.confidence[detected],
            true_azimuth_rad=p,
            true_elevation_rad=q,
            true_range_m=r,
            **measured,
            extras={
                name: values[detected] for name, values in self._extra_columns(cells, look).items()
            },
            roster=targets.roster,
            **believed_ownship_pose_columns(targets, rows),
            looks=look_arrays_scans_by_targets(cells, decided, len(wake))
            if self._is_every_look_recorded
            else None,
        )
        detections.row_of_entries = row
        for report in self._report_transforms:
            detections = report(detections, targets, rows)
        if self._cue_cones is not None:
            detections = self._cue_cones.mark_cued_false_alarms(detections)
        return detections

    def _extra_columns(self, cells: Cells, look: Look) -> Mapping[str, Any]:
        """Return extra columns to record per cell: the look's, and ``cued`` with cues received."""
        if self._cue_cones is None:
            return look.extras
        return {**look.extras, "cued": cells.is_cued()}

    def cells(
        self, targets: RelativeTargets, rows: IntArray, wake: Wake
    ) -> tuple[Cells, ReasonArray]:
        """Return the (scan, target) pairs to evaluate; codes for all: evaluated or why skipped."""
        reason = self._reasons_of_scans(targets, rows)
        wanted = reason == EVALUATE
        cells = Cells(targets, rows, wanted, wake.scans, wake.ticks, wake.ticks_per_s, wake.run)
        return cells, reason

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message, the scans per run with cues too old; empty without cues."""
        return {} if self._cue_cones is None else self._cue_cones.failure_counts()

    def report(self) -> dict[str, Any]:
        """Return each target's first declaration (time, true range) or None; empty if no rule."""
        rule = (
            "declaration"
            if self.p.declares_by_target_or_place == "target"
            else "declaration by place"
        )
        declarations = self.context.effects.get(rule)
        if declarations is None or self.p.declare_m is None:
            return {}
        ticks_per_s = self.context.ticks_per_s
        # A window may have looked beyond an early end of the run.
        end_tick = self.context.duration_s * ticks_per_s
        first: dict[str, dict[str, float] | None] = dict.fromkeys(declarations.names)
        for target, (tick, range_m) in declarations.first_declaration_tick_and_range().items():
            if tick < end_tick:
                first[target] = {"time_s": tick / ticks_per_s, "range_m": range_m}
        return {"declarations": {self.name: first}}

    def _reasons_of_scans(self, targets: RelativeTargets, rows: IntArray) -> ReasonArray:
        """Return reason codes (scans, targets) from an upstream gate if any, else by the reach."""
        if isinstance(targets, GatedTargets) and self.name in targets.decisions:
            reason = targets.decisions[self.name].reasons_at(rows)
            if reason is not None:
                return reason
        part = targets.take(rows)
        return self._reach_in_body_axes.skip_reasons(
            part.body_azimuth_rad,
            part.body_elevation_rad,
            part.range_m,
            part.present,
            part.hidden,
        )


#: Inputs of a sensor that can be cued.
CUED_INPUTS = {
    **Sensor.inputs,
    PORT: Input(CueCones, "sampled", "Where to look more closely.", required=False),
}
