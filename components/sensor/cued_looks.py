"""Cues as an effect: which targets lie in a cone of a cue, where a sensor looks harder."""

from dataclasses import replace
from typing import Any

import numpy as np

from components.estimation.frame import pose_in_frame
from components.estimation.measurement import cone_axis_in_body
from components.geometry import POSE_FIELDS
from components.messages.columns import ORIGIN, POSE, STATE
from components.messages.cues import CueCones
from components.messages.detections import Detections
from components.messages.targets import RelativeTargets
from dsa_des.arrays.column_values import take_rows
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added

#: The input over which they come.
PORT = "cues"


def believed_ownship_pose_columns(targets: RelativeTargets, rows: IntArray) -> dict[str, Any]:
    """Return the position and attitude that the ownship believes to have at each scan, as columns
    of `Detections` by name; empty if navigation is exact.
    """
    believed = targets.believed
    if believed is None:
        return {}
    return {
        field: take_rows(believed[name], rows)
        for name, field in zip(POSE_FIELDS, POSE, strict=True)
    }


class ConesAhead:
    """Finds targets in the cones that a sensor holds at its scans."""

    #: Goes on where the sensor changes (`Component.remembers`).
    remembers = ("_old",)

    def __init__(self) -> None:
        #: Of the cones at the scans of one wake: their scan, axis, and cosine of the half angle.
        self._cones: tuple[IntArray, FloatArray, FloatArray] | None = None
        #: Scans at which all cones had run out, of those that had any.
        self._old = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message to show, on how many scans per run all cues received had expired."""
        return {"the cues that it has are older than their lasts_s": self._old}

    def __call__(self, targets: RelativeTargets, rows: IntArray, wake: Wake) -> BoolArray | None:
        """Return which targets lie in a cone at each scan, (scans, targets), or None for none."""
        self._cones = None
        held = wake.held(PORT)
        if held is None:
            return None
        message, at = held
        cones: CueCones = message
        counts = np.where(at >= 0, np.diff(cones.offsets)[at], 0)
        if not counts.any():
            return None
        scan = np.repeat(np.arange(len(rows)), counts)
        first = np.cumsum(counts) - counts
        entry = np.arange(len(scan)) + (cones.offsets[at] - first)[scan]
        time_s = wake.time_s[scan]
        live = time_s <= cones.until_s[entry]
        cued = counts > 0
        old = cued & (np.bincount(scan[live], minlength=len(counts)) == 0)
        run = wake.run
        self._old = counts_with_cases_added(self._old, run[old], run[cued])
        scan, entry, time_s = scan[live], entry[live], time_s[live]
        if len(scan) == 0:
            return None
        pose = believed_ownship_pose_columns(targets, rows[scan])
        if not pose:
            raise ValueError("cues need the ownship's pose, which these targets come without")
        own = list(pose.values())
        placed = pose_in_frame(
            tuple(getattr(cones, name)[entry] for name in ORIGIN), tuple(own[:3]), tuple(own[3:])
        )
        axis = cone_axis_in_body(
            time_s - cones.state_s[entry],
            np.stack([getattr(cones, name)[entry] for name in STATE]),
            np.stack([cones.azimuth_rad[entry], cones.elevation_rad[entry]]),
            cones.has_range[entry],
            placed,
        )
        azimuth = targets.body_azimuth_rad[rows[scan]]
        elevation = targets.body_elevation_rad[rows[scan]]
        level = np.cos(elevation)
        along = axis[0][:, np.newaxis] * level * np.cos(azimuth)
        along += axis[1][:, np.newaxis] * level * np.sin(azimuth)
        along -= axis[2][:, np.newaxis] * np.sin(elevation)
        least = np.cos(cones.half_angle_rad[entry])
        self._cones = scan, axis, least
        inside = along >= least[:, np.newaxis]
        cued = np.zeros((len(rows), azimuth.shape[1]), dtype=bool)
        np.logical_or.at(cued, scan, inside)
        return cued

    def mark_cued_false_alarms(self, detections: Detections) -> Detections:
        """Return a copy with ``cued`` True also for false alarms reported in a cue cone.

        By where they are reported, as they are nowhere else.
        """
        false = np.flatnonzero(detections.target < 0)
        if self._cones is None or not len(false):
            return detections
        row = detections.row_of_entries[false]
        inside = self.is_in_cones(
            row, detections.azimuth_rad[false], detections.elevation_rad[false]
        )
        cued = detections.extras["cued"].copy()
        cued[false[inside]] = True
        return replace(detections, extras={**detections.extras, "cued": cued})

    def is_in_cones(
        self, row: IntArray, azimuth_rad: FloatArray, elevation_rad: FloatArray
    ) -> BoolArray:
        """Return which azimuths, elevations (body axes) lie in a cue cone valid at their row."""
        inside = np.zeros(len(row), dtype=bool)
        if self._cones is None:
            return inside
        scan, axis, least = self._cones
        first = np.searchsorted(scan, row, side="left")
        count = np.searchsorted(scan, row, side="right") - first
        which = np.repeat(np.arange(len(row)), count)
        cone = np.arange(len(which)) + np.repeat(first - np.cumsum(count) + count, count)
        azimuth, elevation = azimuth_rad[which], elevation_rad[which]
        level = np.cos(elevation)
        along = axis[0][cone] * level * np.cos(azimuth) + axis[1][cone] * level * np.sin(azimuth)
        along -= axis[2][cone] * np.sin(elevation)
        inside[which[along >= least[cone]]] = True
        return inside


CUE = Hook("cue", ConesAhead, "which targets lie in a cue cone at each scan")


class CuedLooks(Effect[ConesAhead]):
    """Finds the targets that lie in cue cones at each scan, by where the ownship believes to be."""

    name = "cues"
    acts_on = CUE

    def verdict(self, block: Any) -> Verdict:
        """Return whether and why cue cones are simulated: if another block cues this sensor."""
        sources = _cueing_blocks(block)
        if not sources:
            return Verdict(False, "no wire brings cues")
        return Verdict(True, f"{' and '.join(sources)} cues it")

    def build(self, block: Any) -> ConesAhead:
        """Return an object that marks, at each scan, the targets that lie in cue cones."""
        return ConesAhead()


def _cueing_blocks(block: Any) -> list[str]:
    return [one.block for one in block.context.producers if one.port == PORT]


CUED_LOOKS = CuedLooks()

_NO_THRESHOLD = "all inside its range is detected, there is no threshold to lower"


def refuse_if_cued(block: Any, because: str = _NO_THRESHOLD) -> None:
    """Raise ValueError with the given reason if a block cues this sensor, which cannot use it."""
    if sources := _cueing_blocks(block):
        raise ValueError(
            f"{sources[0]} cues it, and it takes no cues: {because}; cue a sensor that has one, or "
            "leave the wire out"
        )


def cue_warnings(block: Any) -> list[str]:
    """Return a warning if a cued sensor sets no cued_* key or an uncued one sets one, else none."""
    given = [
        name
        for name in type(block.p).model_fields
        if name.startswith("cued_") and getattr(block.p, name) not in (None, False)
    ]
    cued = bool(_cueing_blocks(block))
    if cued and not given:
        return [
            "is cued, and nothing says what it then does otherwise: give one of its cued_* keys"
        ]
    if given and not cued:
        return [f"{given[0]} is given, and no wire brings cues"]
    return []
