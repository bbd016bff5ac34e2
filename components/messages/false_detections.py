"""Detections of what is not there: how they join a report, hide in it, and are left out."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from components.messages.columns import MEASURED
from components.messages.detections import FALSE_TARGET, Detections
from components.messages.fused import FusedDetections
from dsa_des.arrays.entries import offsets_from_entry_rows
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray


def sort_by_measurement(detections: Detections) -> Detections:
    """Return the report with the detections of each scan sorted by what was measured.

    Nearest first, then by azimuth, elevation and confidence: the order of a roster would tell who
    is who, and that false alarms come after targets, which is which.
    """
    row = detections.row_of_entries
    measured = (
        detections.confidence, detections.elevation_rad, detections.azimuth_rad, detections.range_m
    )  # fmt: skip
    return detections.reorder(np.lexsort((*measured, row)))


def add_false_detections(
    detections: Detections,
    row: IntArray,
    *,
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    range_m: ArrayLike = np.nan,
    confidence: ArrayLike = np.nan,
    extras: Mapping[str, ArrayLike] | None = None,
    measured: Mapping[str, ArrayLike] | None = None,
) -> Detections:
    """Return a sensor's report with false detections after the true ones of each scan.

    Parameters
    ----------
    row : (alarms,) of int
        Row of `detections` that each false one belongs to, ascending.
    azimuth_rad, elevation_rad : (alarms,)
        As reported: ownship's body axes, on the sensor's grid.
    range_m, confidence : (alarms,) or one number
        NaN where the sensor has none.
    extras, measured : mapping of (alarms,) or one number
        Columns of `Detections.extras`, and range rate and variances (`MEASURED`) as for a target;
        those not given are NaN, or False where they hold truth values.

    Returns
    -------
    Detections
        `detections` itself when there is no alarm. False ones have target `FALSE_TARGET` and NaN
        for everything true.
    """
    if len(row) == 0:
        return detections
    counts = np.diff(detections.offsets)
    rows = np.concatenate([np.repeat(np.arange(len(counts)), counts), row])
    # Stable: true detections were put first, so they stay first within each row.
    order = np.argsort(rows, kind="stable")
    given = extras or {}
    stated = measured or {}

    def joined(true: AnyArray, false: ArrayLike) -> AnyArray:
        added = np.broadcast_to(np.asarray(false, dtype=true.dtype), row.shape)
        return np.concatenate([true, added])[order]

    about: dict[str, Any] = {
        name: joined(getattr(detections, name), stated.get(name, np.nan)) for name in MEASURED
    }
    return replace(
        detections,
        offsets=np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=len(counts))))),
        target=joined(detections.target, FALSE_TARGET),
        azimuth_rad=joined(detections.azimuth_rad, azimuth_rad),
        elevation_rad=joined(detections.elevation_rad, elevation_rad),
        range_m=joined(detections.range_m, range_m),
        confidence=joined(detections.confidence, confidence),
        true_azimuth_rad=joined(detections.true_azimuth_rad, np.nan),
        true_elevation_rad=joined(detections.true_elevation_rad, np.nan),
        true_range_m=joined(detections.true_range_m, np.nan),
        **about,
        extras={
            name: joined(values, given.get(name, False if values.dtype == bool else np.nan))
            for name, values in detections.extras.items()
        },
    )


AnyDetections = TypeVar("AnyDetections", Detections, FusedDetections)


def without_false_alarms(message: AnyDetections) -> AnyDetections:
    """Return the message without false alarms, in the same rows; itself if it has none."""
    if np.count_nonzero(message.target < 0) == 0:
        return message
    kept = np.flatnonzero(message.target >= 0)
    true = message.reorder(kept)
    true.offsets = offsets_from_entry_rows(message.row_of_entries[kept], len(message))
    return true
