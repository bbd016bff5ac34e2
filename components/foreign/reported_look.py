"""Looks of a sensor out of columns of numbers, of which some may be missing."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import MEASURED, POSE
from components.messages.detections import EXTRAS, Detections
from components.messages.reach import CULLED, SKIP_REASONS
from dsa_des.arrays.types import IntArray

TRUE_LINE = ("true_azimuth_rad", "true_elevation_rad", "true_range_m")


def detections_of_reports(
    tick: IntArray,
    scan: IntArray,
    offsets: IntArray,
    entries: Mapping[str, Any],
    looks: Mapping[str, Any],
    target: IntArray,
    roster: Roster,
    **more: Any,
) -> Detections:
    """Return a `Detections` message of several looks, a row each, from reported columns.

    Parameters
    ----------
    tick, scan : (rows,)
    offsets : (rows + 1,)
    entries : mapping of (entries,)
        Columns of ``detections``.
    looks : mapping of (rows,)
        The ownship's pose, by column, where it is known.
    target : (entries,) of int
    roster : Roster
    **more
        Other fields.
    """
    count, zero = len(target), np.zeros(len(tick), dtype=np.int64)
    nothing = np.full(count, np.nan)
    return Detections(
        tick=tick,
        scan=scan,
        evaluated=zero,
        skipped=dict.fromkeys((*SKIP_REASONS, CULLED), zero),
        offsets=offsets,
        target=target,
        azimuth_rad=entries["azimuth_rad"],
        elevation_rad=entries["elevation_rad"],
        range_m=entries.get("range_m", nothing),
        confidence=entries.get("confidence", nothing),
        **{name: entries.get(name, nothing) for name in (*TRUE_LINE, *MEASURED)},
        extras={name: entries[name] for name in EXTRAS if name in entries},
        roster=roster,
        **{name: looks[name] for name in POSE if name in looks},
        **more,
    )
