"""A look: the cells that need a sensor's physics, and what the physics says of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from components.messages.targets import RelativeTargets
from dsa_des.arrays.column_values import is_stored_once, take_rows
from dsa_des.arrays.entries import rows_and_columns_of_true
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component
from dsa_des.block.effect import Hook
from dsa_des.time.clock import NANOSECONDS, ticks_to_nanoseconds


@dataclass(frozen=True, eq=False)
class Look:
    """Result of a look, per cell: whether detected, confidence, signal, and extra columns.

    Parameters
    ----------
    detected : (cells,) of bool
    confidence : (cells,)
    extras : dict of (cells,)
        Recorded beside the detection: ``snr_db``, ``detection_probability``, ``pixels``.
    signal : dict of (cells,)
        What errors of measurement follow from, where it is not among the extras.
    noise : (cells,) of bool, optional
        Which detections noise made, where the sensor tells them from those that the target made.
    tail : (cells,), optional
        The share of such detections that come out stronger, (0, 1], where one draw says both
        whether and how strong.
    """

    detected: BoolArray
    confidence: FloatArray
    extras: dict[str, AnyArray] = field(default_factory=dict)
    signal: dict[str, AnyArray] = field(default_factory=dict)
    noise: BoolArray | None = None
    tail: FloatArray | None = None

    def check(self, cells: int) -> None:
        """Raise ValueError or TypeError unless arrays have one value per cell, of the due type."""
        truths = {"detected": self.detected, "noise": self.noise}
        numbers = {**self.signal, "tail": self.tail}
        for table in (truths, {"confidence": self.confidence}, self.extras, numbers):
            for name, value in table.items():
                if value is None and name in ("noise", "tail"):
                    continue
                if not isinstance(value, np.ndarray) or value.shape != (cells,):
                    given = getattr(value, "shape", type(value).__name__)
                    message = f"an array of {cells} cells is needed"
                    raise ValueError(f"look gave {name} of shape or type {given}: {message}")
        for table, kinds, needed in ((truths, "b", "bool is"), (numbers, "biuf", "numbers are")):
            for name, value in table.items():
                if value is not None and value.dtype.kind not in kinds:
                    raise TypeError(f"look gave {name} of {value.dtype}: {needed} needed")


class Cells:
    """The (scan, target) pairs that need a sensor's physics, as flat contiguous arrays.

    Any field of `RelativeTargets` can be read as an attribute, (cells,): ``range_m``; the line of
    sight in body axes, ``body_azimuth_rad`` and ``body_elevation_rad``, and in the ownship's NED
    frame, ``azimuth_rad`` and ``elevation_rad``; the target's altitude ``alt_m``, and how it is
    turned: ``relative_heading_rad`` against the line of sight, ``target_pitch_rad``,
    ``target_roll_rad``. ``scan``, ``target`` and ``run`` say which scan, which index in the
    ``roster`` and which run each is of.

    Parameters
    ----------
    targets : RelativeTargets
    rows : (scans,)
        Message row of each scan; kept as ``message_rows``.
    wanted : (scans, targets) of bool
    scans : (scans,)
        Scan numbers.
    scan_ticks : (scans,), optional
        When each scan is; needed by what compares one scan with the next.
    ticks_per_s : int
    runs : (scans,), optional
        Run of each scan (`Wake.run`); by default that of its row.
    """

    def __init__(
        self,
        targets: RelativeTargets,
        rows: IntArray,
        wanted: BoolArray,
        scans: IntArray,
        scan_ticks: IntArray | None = None,
        ticks_per_s: int = NANOSECONDS,
        runs: IntArray | None = None,
    ) -> None:
        self._targets = targets
        self._ticks_per_s = ticks_per_s
        #: Run of each scan.
        self.run_of_scan = targets.run[rows] if runs is None else runs
        self.message_rows = rows
        self.roster = targets.roster
        #: Index of each cell's scan within this look.
        self.row, self._column = rows_and_columns_of_true(wanted)
        width = wanted.shape[1]
        self.scan = scans[self.row]
        self.scan_ticks = targets.tick[rows] if scan_ticks is None else scan_ticks
        self._width = width
        # Rows that only rise and are as many as there are, are all of them.
        self._everything = len(self.row) == targets.range_m.size and (
            len(rows) == 1 or bool((rows[1:] > rows[:-1]).all())
        )
        self._flat = rows.take(self.row)
        if width > 1:
            self._flat = self._flat * width + self._column
        #: And of its target in the roster.
        self.target = targets.columns[self._column]
        #: Which lie in a cone of a cue; None where none does.
        self.cued: BoolArray | None = None

    def __len__(self) -> int:
        return len(self.target)

    def is_cued(self) -> BoolArray:
        """Return a mask over cells: True where the target lies in a cue cone at this scan."""
        if self.cued is None:
            return np.zeros(len(self), dtype=bool)
        return self.cued

    def __getattr__(self, name: str) -> Any:
        if name[0] == "_":
            raise AttributeError(name)
        values = getattr(self._targets, name)
        if self._width > 1 and is_stored_once(values):  # of each target
            gathered = values[0].take(self._column)
        else:
            flat = values.reshape(-1)
            gathered = flat if self._everything else take_rows(flat, self._flat)
        self.__dict__[name] = gathered  # the next time it is a plain attribute
        return gathered

    @cached_property
    def run(self) -> IntArray:
        """Run of each cell."""
        return self.run_of_scan[self.row]

    @cached_property
    def instant_ns(self) -> IntArray:
        """Instant at which each cell is looked at, in whole ns since the start of its run.

        A cell that a sweeping beam lights is looked at when it is lit.
        """
        instant = ticks_to_nanoseconds(self.scan_ticks[self.row], self._ticks_per_s)
        if hasattr(self._targets, "offset_s"):
            instant = instant + np.rint(self.offset_s * NANOSECONDS).astype(np.int64)
        return instant

    @cached_property
    def state_ns(self) -> IntArray:
        """Instant, in ns since the start of the run, for which each cell's aircraft positions hold;
        earlier than `instant_ns` if the traffic picture is delayed.
        """
        if self._targets.state_tick is None:
            return self.instant_ns
        return ticks_to_nanoseconds(self.field_at_rows("state_tick"), self._ticks_per_s)

    def relative_target_fields_ahead(
        self, cells: IntArray, ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        """Return chosen cells' `RelativeTargets` fields, each `ahead_s` s after its own instant.

        The ownship's pose is ``own_lat_deg`` and so on, the target's position ``target_lat_deg``
        and so on; ``present`` says whether both aircraft are there then. ValueError if the targets
        can be known only at the instants of the rows.
        """
        targets = self._targets
        if targets.revisit is None:
            raise ValueError(
                "the range rate needs to know the targets at instants of its own; the traffic, or "
                "a block on the way, passes no flights on: set measures_range_rate to false, "
                "and moving_target_filter to 'none'"
            )
        row, column = np.divmod(self._flat[cells], self._width)
        time_s = targets.position_ticks[row] / self._ticks_per_s
        if hasattr(targets, "offset_s"):
            time_s = time_s + self.offset_s[cells]
        return targets.revisit.columns_of_single_targets(
            row, targets.columns[column], time_s, ahead_s
        )

    def field_at_rows(self, name: str) -> AnyArray:
        """Return, for each cell, a per-row field (such as own altitude) at the cell's row."""
        return getattr(self._targets, name).take(self._flat // self._width)

    def believed_pose_component(self, name: str) -> FloatArray:
        """Return per cell one field, by name, of the ownship's believed position and attitude."""
        believed = self._targets.believed
        if believed is None:
            raise ValueError("a block on the way does not say what the ownship believes of itself")
        return np.asarray(believed[name].take(self._flat // self._width))

    @cached_property
    def own_attitude(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """True yaw, pitch and roll of the ownship in rad, for each cell; 0 where not known."""
        attitude = self._targets.own_attitude
        if attitude is None:
            zero = np.zeros(len(self))
            return zero, zero, zero
        row = self._flat // self._width
        yaw, pitch, roll = (attitude[f"{name}_rad"].take(row) for name in ("yaw", "pitch", "roll"))
        return yaw, pitch, roll

    def column_at_targets(self, column: FloatArray) -> AnyArray:
        """Return, for each cell, a roster column (a value per aircraft) at its target."""
        return column[self.craft]

    @cached_property
    def craft(self) -> IntArray:
        """Return the index in the roster of each cell's target."""
        roster = self.roster
        return (
            self.target
            if roster.is_same_in_all_replicas
            else roster.aircraft_index(self.target, self.run)
        )

    @cached_property
    def equipage_rows(self) -> IntArray:
        """Return the roster's equipage row that holds for each cell's target at `state_ns`."""
        return self.roster.equipage_rows(self.craft, self.state_ns)

    def draws(self, stream: Any, draw: int = 0) -> FloatArray:
        """Return a number in [0, 1) per cell, fixed by stream, run, target, scan and `draw`."""
        keys = self.roster.draw_keys_of(self.target)
        return stream.of_runs(self.run, self.instant_ns).uniform(keys, self.scan, draw)


def aspect_pitch_roll_elevation_rad(
    cells: Any, chosen: Any = slice(None)
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the target's heading relative to the line of sight, its pitch and roll, and the line's
    elevation, all in rad, for chosen cells.
    """
    return (
        cells.relative_heading_rad[chosen],
        cells.target_pitch_rad[chosen],
        cells.target_roll_rad[chosen],
        cells.elevation_rad[chosen],
    )


class CellValues(Protocol):
    """Gives one number for each cell: a factor, a cross-section, an area."""

    def __call__(self, cells: Cells, /) -> FloatArray:
        """Return the values, (cells,)."""


def effect_values_of_cells(block: Component, built: CellValues, cells: Cells) -> FloatArray:
    """Return an effect's number for each cell; ValueError if its array has another length.

    Parameters
    ----------
    block : Component
    built : CellValues
        What the effect built; it is named by this.
    cells : Cells

    Returns
    -------
    ndarray
        One number for each cell, or one for all.
    """
    values = built(cells)
    if np.ndim(values) and np.shape(values) != (len(cells),):
        name = next((n for n, one in block.context.effects.items() if one is built), "?")
        raise ValueError(
            f"effect {name!r} gives an array of shape {np.shape(values)}: one number for each of "
            f"the {len(cells)} cells is needed, or one for all"
        )
    return values


class Strengthening(Protocol):
    """Protocol of an effect that gives a measure of strength for each detection."""

    def __call__(self, cells: Cells, detected: IntArray, look: Look, /) -> Look:
        """Return the look with the strength of its `detected` cells."""


class Judging(Protocol):
    """Protocol of an effect that marks which detections declare their target."""

    def __call__(self, cells: Cells, look: Look, /) -> Look:
        """Return the look with a column ``declared``."""


STRENGTH = Hook("strength", Strengthening, "look: as strong as its detections came out")
DECLARATION = Hook("declaration", Judging, "look: which detections declare their target")
