# ruff: noqa: E501 (the lines of a Markdown page)
"""The four sentences at the head of docs/accuracy-and-cost.md, from the costs of one scene."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

#: A pixel of the camera, which errors of direction are compared with.
PIXEL_DEG = 0.0358

_HEAD = """1. **Geometry**: take the exact ellipsoid. Flat Earth saves {flat_saves} µs per target-scan and errs by up to {flat_max} mrad, a tenth of the radar's degree but {flat_pixels} pixels; with the radar alone it will do. Rotate the attitude exactly: angle by angle saves {attitude_saves} µs and errs by up to {small_angle} mrad.
2. **Radar**: take the exact Pd: for one pulse the table costs {table_times} and Gram-Charlier {gram_times}. A threshold or a range boundary saves up to {boundary_saves} µs and first sees the intruder {threshold_km} to {boundary_km} km nearer{cut_off}.
3. **Camera**: take the union of the bodies ({union_us} µs). Their sum ({exact_us} µs) sees {exact_km}; a range boundary sees {boundary_eo_km}, a one-dimensional line {line_km}. A mesh costs {mesh_times} times the union and is no better.
4. **Fusion**: a window of 0.1 s is worth its {window_extra} µs: it raises the fused share from {share} to {window_share} and adds {window_range} m to the range error (95th percentile)."""


def head_lines(costs: Sequence[Any], cut_off: str) -> str:
    """Return the four sentences.

    Parameters
    ----------
    costs : list of RungCost
        Of all ladders of one scene.
    cut_off : str
        What cuts off the radar's first detection there, as `radar_sees_from` says it.
    """
    of = {(cost.block, cost.rung): cost for cost in costs}

    def us(block: str, rung: str) -> float:
        return float(of[block, rung].cpu_us_per_target_scan)

    def km(block: str, rung: str) -> float:
        return float(of[block, rung].effect["first_detection_range_change_m"]) / 1000.0

    def saved(block: str, one: str, other: str) -> str:
        return f"{us(block, other) - us(block, one):.2f}"

    def times(block: str, one: str, other: str) -> str:
        ratio = us(block, one) / us(block, other)
        return "as much" if 1 / 1.1 < ratio < 1.1 else f"{ratio:.2g} times as much"

    flat = of["transform", "flat_earth"].error.maximum
    instant, window = of["fusion", "exact_instant"], of["fusion", "window"]
    return _HEAD.format(
        flat_saves=saved("transform", "flat_earth", "ellipsoid"),
        flat_max=f"{flat:.1f}",
        flat_pixels=f"{flat / math.radians(PIXEL_DEG) / 1e3:.1f}",
        attitude_saves=saved("transform", "small_angle", "exact"),
        small_angle=f"{of['transform', 'small_angle'].error.maximum:.0f}",
        table_times=times("radar", "table", "exact"),
        gram_times=times("radar", "gram_charlier", "exact"),
        boundary_saves=saved("radar", "range_boundary", "exact"),
        threshold_km=f"{-km('radar', 'threshold'):.1f}",
        boundary_km=f"{-km('radar', 'range_boundary'):.1f}",
        cut_off=cut_off,
        union_us=f"{us('eo', 'union'):.2f}",
        exact_us=f"{us('eo', 'exact'):.2f}",
        exact_km=_early_or_late(km("eo", "exact")),
        boundary_eo_km=_early_or_late(km("eo", "range_boundary")),
        line_km=_early_or_late(km("eo", "projection")),
        mesh_times=f"{us('eo', 'mesh') / us('eo', 'union'):.0f}",
        window_extra=saved("fusion", "exact_instant", "window"),
        share=f"{window.effect['fused_share'] - window.effect['fused_share_change']:.0%}",
        window_share=f"{window.effect['fused_share']:.0%}",
        window_range=f"{window.error.p95 - instant.error.p95:.1f}",
    )


def radar_sees_from(scene: Scene) -> str:
    """Return what cuts off the first detection of a scene's radar, as the end of a sentence.

    A radar with a false alarm in twenty looks sees somewhere in its reach almost at once: where
    the scene begins, if that is inside the reach, else at the reach's edge. A coarser model's
    first detection then comes later by what the scene lets it, not by what the models differ.
    """
    sink = ColumnSink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    simulation.run()
    tables = sink.tables()

    def ours(table: str, column: str) -> AnyArray:
        block: Any = tables[table]["block"]
        here = np.array([*block.names, None])[block.codes] == "radar"
        return np.asarray(tables[table][column])[here]

    times_s, ranges_m = ours("detections", "time_s"), ours("detections", "true_range_m")
    scans_s = np.unique(ours("scans", "time_s"))
    first = int(np.argmin(times_s))
    reach_m = float(scene.blocks["radar"].parameters.model_dump()["range_km"]) * 1000.0
    return cut_off(float(times_s[first]), float(ranges_m[first]), scans_s, reach_m)


def cut_off(time_s: float, range_m: float, scans_s: Any, reach_m: float) -> str:
    """Return the end of the sentence for a first detection at a time and a range.

    Parameters
    ----------
    time_s, range_m : float
    scans_s : array
        Times of the radar's scans.
    reach_m : float
        How far the radar looks.
    """
    if time_s <= scans_s[1]:
        return f", at least: the exact radar sees it where the scene begins, at {range_m / 1000:.1f} km"
    if range_m > 0.97 * reach_m:
        return (
            f", at least: the exact radar sees it at the edge of its reach, {reach_m / 1000:g} km"
        )
    return ""


def _early_or_late(km: float) -> str:
    """Return by how much a change of the first detection's range is too early or too late."""
    return f"{abs(km):.1f} km too {'early' if km > 0.0 else 'late'}"
