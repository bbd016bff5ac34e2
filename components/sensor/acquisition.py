"""Acquisition range of a sensor: nearer than it keeps a target, by azimuth and target speed."""

import math
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from components.geometry import POSITION_FIELDS, north_east_up_offsets_m
from components.sensor.look import Cells
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Parameters

#: Over which a target's speed is taken, s.
STEP_S = 0.05
_Share = Annotated[float, Field(gt=0, le=1)]


class AcquisitionRange(Parameters):
    """Range at which a sensor acquires targets up to some speed."""

    below_m_s: float | None = Field(
        default=None,
        gt=0,
        description="Of targets slower than this over ground, m/s; of all others where not given.",
    )
    range_km: float = Field(gt=0, description="To which one is seen once it is acquired, km.")
    azimuth_deg: tuple[float, ...] = Field(
        default=(0.0,), min_length=1, description="Off the nose to either side, ascending, deg."
    )
    share: tuple[_Share, ...] = Field(
        default=(1.0,),
        min_length=1,
        description="Of that range, at each azimuth, within which one is acquired; linear between.",
    )

    @model_validator(mode="after")
    def _check_shares(self) -> Self:
        azimuths = self.azimuth_deg
        if len(azimuths) != len(self.share):
            raise ValueError(
                f"azimuth_deg holds {len(azimuths)} values and share {len(self.share)}: each "
                "azimuth has a share"
            )
        rises = all(one < other for one, other in pairwise(azimuths))
        if not rises or not all(0.0 <= angle <= 180.0 for angle in azimuths):
            raise ValueError("azimuth_deg must hold ascending angles from 0 to 180")
        return self


def check_ranges_cover_all_speeds(ranges: tuple[AcquisitionRange, ...]) -> None:
    """Raise ValueError unless speed limits ascend and the last acquisition range has none."""
    speeds = [math.inf if one.below_m_s is None else one.below_m_s for one in ranges]
    if speeds and (speeds[-1] != math.inf or sorted(set(speeds)) != speeds):
        raise ValueError(
            "acquisition: below_m_s must ascend, and the last has none: it is of all others"
        )


class Acquired:
    """Remembers which targets are acquired, and in which scan last."""

    #: Goes on where the sensor changes (`Component.remembers`).
    remembers = ("_last_scan",)

    def __init__(self, ranges: tuple[AcquisitionRange, ...]) -> None:
        self._ranges = ranges
        #: Of all targets of the first run, of the second, and so on; -2 where not seen.
        self._last_scan: IntArray = np.empty(0, dtype=np.int64)

    def __call__(self, cells: Cells, /) -> FloatArray:
        """Return 1 for each cell whose target is seen, else 0."""
        if not self._ranges or len(cells) == 0:
            return np.ones(len(cells))
        within, near = self._masks_in_range_and_acquirable(cells)
        width = len(cells.roster.names)
        targets = cells.run * width + cells.target
        missing = (int(cells.run.max()) + 1) * width - len(self._last_scan)
        if missing > 0:
            self._last_scan = np.append(self._last_scan, np.full(missing, -2))
        order = np.argsort(targets, kind="stable")
        targets, scan, within, near = targets[order], cells.scan[order], within[order], near[order]
        first = np.append(True, targets[1:] != targets[:-1])
        known = first & (scan == self._last_scan[targets] + 1)
        follows = ~first & (scan == np.append(-2, scan[:-1]) + 1) & np.append(False, within[:-1])
        # Seen where one was acquired since it was last missed, or gone beyond its range.
        index = np.arange(len(targets))
        since = np.maximum.accumulate(np.where(follows, 0, index))
        acquired = np.maximum.accumulate(np.where((near | known) & within, index, -1))
        seen = within & (acquired >= since)
        last = np.append(first[1:], True)
        self._last_scan[targets[last]] = np.where(seen[last], scan[last], -2)
        factor = np.zeros(len(cells))
        factor[order] = seen
        return factor

    def _masks_in_range_and_acquirable(self, cells: Cells) -> tuple[BoolArray, BoolArray]:
        """Return two masks over cells: True where the target is within the acquisition range for
        its speed, and True where it is within the share of that range that holds for its azimuth.
        """
        azimuth_deg = np.degrees(np.abs(cells.body_azimuth_rad))
        speed = np.zeros(len(cells)) if len(self._ranges) == 1 else target_ground_speed_m_s(cells)
        limit_m, share = np.zeros(len(cells)), np.zeros(len(cells))
        for one in reversed(self._ranges):
            mine = speed < (math.inf if one.below_m_s is None else one.below_m_s)
            mine |= np.isnan(speed)
            limit_m[mine] = 1000.0 * one.range_km
            share[mine] = np.interp(azimuth_deg[mine], one.azimuth_deg, one.share)
        return cells.range_m <= limit_m, cells.range_m <= share * limit_m


def target_ground_speed_m_s(cells: Cells) -> FloatArray:
    """Return each target's ground speed by cell, m/s; NaN where present too briefly to measure.

    By where it is a little later; where it is there no longer, a little before.
    """
    speed, which = np.full(len(cells), np.nan), np.arange(len(cells))
    for step_s in (STEP_S, -STEP_S):
        seen = cells.relative_target_fields_ahead(
            np.tile(which, 2), np.repeat([0.0, step_s], len(which))
        )
        now, then = (
            [seen[f"target_{name}"][part] for name in POSITION_FIELDS]
            for part in (slice(None, len(which)), slice(len(which), None))
        )
        north, east, _ = north_east_up_offsets_m(*now, *then)
        there = seen["present"].reshape(2, -1).all(axis=0)
        speed[which[there]] = np.hypot(north, east)[there] / STEP_S
        which = which[~there]
        if len(which) == 0:
            break
    return speed
