"""The change in what a run found: first detections, detections gained and lost, fused share."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray


def compare_runs(reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return what changed from one run's tables to another's.

    Parameters
    ----------
    reference, other : mapping
        Recorded tables (``pyarrow.Table``) by name: ``detections`` and ``fused``.

    Returns
    -------
    dict
        ``detections_gained`` and ``detections_lost`` count (sensor, target, instant) that only one
        of the runs has; ``detections_reference`` is their number in the reference.
        ``first_detection_range_change_m`` and ``first_detection_time_change_s`` are those of the
        sensor and target, named in ``first_detection_of``, whose first detection moved farthest in
        range; None where no sensor saw one target in both runs. ``never_detected`` and
        ``newly_detected`` list ``sensor/target`` that only one run detects. ``fused_share`` is the
        share of fused rows with two sensors or more, ``fused_share_change`` its change.
        False alarms are left out.
    """
    before, after = _detections(reference), _detections(other)
    common = before.keys() & after.keys()
    moved: tuple[float, float] | tuple[None, None] = (None, None)
    of = None
    firsts, others = _firsts(before), _firsts(after)
    for name in sorted(firsts.keys() & others.keys()):
        change = (others[name][1] - firsts[name][1], others[name][0] - firsts[name][0])
        if moved[0] is None or abs(change[0]) > abs(moved[0]):
            moved, of = change, name
    share, changed = _fused_share(reference), _fused_share(other)
    return {
        "first_detection_of": of,
        "first_detection_range_change_m": moved[0],
        "first_detection_time_change_s": moved[1],
        "never_detected": sorted(firsts.keys() - others.keys()),
        "newly_detected": sorted(others.keys() - firsts.keys()),
        "detections_reference": len(before),
        "detections_gained": len(after) - len(common),
        "detections_lost": len(before) - len(common),
        "fused_share": changed,
        "fused_share_change": None if share is None or changed is None else changed - share,
    }


def share_that_differs(changes: Mapping[str, Any]) -> float:
    """Return detections gained and lost, of what `compare_runs` returned, per one before."""
    changed = changes.get("detections_gained", 0) + changes.get("detections_lost", 0)
    return float(changed / max(changes.get("detections_reference", 0), 1))


def _detections(tables: Mapping[str, Any]) -> dict[tuple[str, int], tuple[float, float]]:
    """Return time and true range by (sensor/target, tick)."""
    table = tables.get("detections")
    if table is None:
        return {}
    columns = [table[name].to_pylist() for name in ("block", "target", "tick", "time_s",
                                                    "true_range_m")]  # fmt: skip
    return {
        (f"{block}/{target}", tick): (time_s, range_m)
        for block, target, tick, time_s, range_m in zip(*columns, strict=True)
        if target is not None
    }


def _firsts(
    detections: Mapping[tuple[str, int], tuple[float, float]],
) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}
    for (name, _), seen in detections.items():
        if name not in found or seen[0] < found[name][0]:
            found[name] = seen
    return found


def _fused_share(tables: Mapping[str, Any]) -> float | None:
    table = tables.get("fused")
    if table is None or table.num_rows == 0:
        return None
    sensors: AnyArray = np.array(table["sensors"].to_pylist(), dtype=str)
    several: BoolArray = np.char.find(sensors, "+") >= 0
    return float(several.mean())
