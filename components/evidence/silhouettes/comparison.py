"""The simple aircraft model compared with measured or meshed silhouettes (thesis §4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from components.arguments.checks import FloatArray
from dsa_des.record.drawing import drawing, figure_text

# Called with relative heading, pitch, roll and elevation in radians (flat arrays), gives m²:
# `visible_area` with its areas, table or mesh filled in.
Silhouette = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], Any]

AXES = ("x", "y", "z")
SCALES = ("own_maximum", "reference_maximum")

_STARTS = {
    "x": "from the right wing (0) over the top (90) to the left wing (180)",
    "y": "from the nose (0) over the top (90) to the tail (180)",
    "z": "from the nose (0) past the right wing (90) to the tail (180)",
}

# Hollow marks of falling size, so that curves that coincide are all seen.
_STYLES: list[dict[str, Any]] = [
    {"marker": "s", "linestyle": "--", "markersize": 7.0},
    {"marker": "^", "linestyle": ":", "markersize": 4.5},
    {"marker": "d", "linestyle": "-.", "markersize": 3.0},
]


@dataclass(frozen=True, eq=False)
class RotationComparison:
    """Hold one model against one reference over a half turn about one body axis.

    Parameters
    ----------
    axis : {"x", "y", "z"}
    model, reference : str
        Names of the two.
    angle_deg : (n,) array, degrees
        Camera angle about the axis.
    model_share, reference_share : (n,) arrays
        Signatures as a share of the maximum (see `compare_silhouettes`).
    """

    axis: str
    model: str
    reference: str
    angle_deg: FloatArray
    model_share: FloatArray
    reference_share: FloatArray

    @property
    def error(self) -> FloatArray:
        """Signed error of the model at each angle, as a share of the maximum signature."""
        return self.model_share - self.reference_share

    @property
    def mean_error(self) -> float:
        """Mean of the error's magnitude, as a share of the maximum signature."""
        return float(np.abs(self.error).mean())

    @property
    def max_error(self) -> float:
        """Largest magnitude of the error, as a share of the maximum signature."""
        return float(np.abs(self.error).max())


def camera_rotation(
    axis: str, step_deg: float = 10.0
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Move the camera half a turn about one of the target's body axes.

    x: from the right wing over the top to the left wing. y: from the nose over the top to the
    tail. z: from the nose past the right wing to the tail. The target stays level; only the line
    of sight turns.

    Parameters
    ----------
    axis : {"x", "y", "z"}
    step_deg : float
        Divides 180.

    Returns
    -------
    angle_deg : (n,) array
        0 ... 180.
    (relative_heading_rad, pitch_rad, roll_rad, elevation_rad) : (n,) arrays
        As `visible_area` takes them. An elevation beyond -pi/2 goes on round the circle.

    Raises
    ------
    ValueError
        If the axis is unknown or the step does not divide 180.
    """
    if axis not in AXES:
        raise ValueError(f"axis is {axis!r}: it must be one of {', '.join(AXES)}")
    steps = round(180.0 / step_deg) if step_deg > 0.0 else 0
    if steps < 1 or abs(steps * step_deg - 180.0) > 1e-9:
        raise ValueError(f"step_deg is {step_deg}: it must be above 0 and divide 180")
    angle_deg = np.linspace(0.0, 180.0, steps + 1)
    turned = np.radians(angle_deg)
    level = np.zeros_like(turned)
    if axis == "x":
        # A target whose right wing we see crosses to the right: relative heading +90 degrees.
        return angle_deg, (np.full_like(turned, 0.5 * np.pi), level, level, -turned)
    if axis == "y":
        return angle_deg, (np.full_like(turned, np.pi), level, level, -turned)
    return angle_deg, (np.pi - turned, level, level, level)


def compare_silhouettes(
    models: Mapping[str, Silhouette],
    references: Mapping[str, Silhouette],
    *,
    step_deg: float = 10.0,
    scale: str = "own_maximum",
) -> list[RotationComparison]:
    """Compare every model with every reference over half turns about the three body axes.

    Parameters
    ----------
    models, references : mapping of name to function
        Functions of (relative heading, pitch, roll, elevation) in radians giving m².
    step_deg : float
        Camera step, 10 degrees in the thesis.
    scale : {"own_maximum", "reference_maximum"}
        ``own_maximum`` divides each signature by its own maximum over the three rotations, as the
        thesis does with its pixel counts: shapes are compared, not sizes. ``reference_maximum``
        divides both by the reference's maximum: an error in size counts as well.

    Returns
    -------
    list of RotationComparison
        For each model and reference, axes x, y, z.

    Raises
    ------
    ValueError
        If the scale is unknown, or a signature is nowhere above 0.
    """
    if scale not in SCALES:
        raise ValueError(f"scale is {scale!r}: it must be one of {', '.join(SCALES)}")
    cameras = {axis: camera_rotation(axis, step_deg) for axis in AXES}

    def signatures(name: str, silhouette: Silhouette) -> tuple[dict[str, FloatArray], float]:
        areas = {axis: np.asarray(silhouette(*view)) for axis, (_, view) in cameras.items()}
        largest = max(float(area.max()) for area in areas.values())
        if not largest > 0.0:
            raise ValueError(f"{name} has no area from any side: it must be above 0 somewhere")
        return areas, largest

    measured = {name: signatures(name, function) for name, function in references.items()}
    comparisons: list[RotationComparison] = []
    for model, function in models.items():
        model_areas, model_largest = signatures(model, function)
        for reference, (reference_areas, reference_largest) in measured.items():
            divisor = model_largest if scale == "own_maximum" else reference_largest
            comparisons.extend(
                RotationComparison(
                    axis,
                    model,
                    reference,
                    cameras[axis][0],
                    model_areas[axis] / divisor,
                    reference_areas[axis] / reference_largest,
                )
                for axis in AXES
            )
    return comparisons


def comparison_table(comparisons: Sequence[RotationComparison]) -> str:
    """Lay the mean and maximum errors out as a text table like Table 4.3.

    Parameters
    ----------
    comparisons : sequence of RotationComparison

    Returns
    -------
    str
        One line per model, reference and axis; errors in per cent of the maximum signature.
    """
    names = [("model", "reference"), *((one.model, one.reference) for one in comparisons)]
    first, second = (max(len(pair[column]) for pair in names) for column in (0, 1))
    lines = [f"{'model':<{first}}  {'reference':<{second}}  axis  mean error  max error"]
    lines += [
        f"{one.model:<{first}}  {one.reference:<{second}}  {one.axis:<4}  "
        f"{100.0 * one.mean_error:8.1f} %  {100.0 * one.max_error:7.1f} %"
        for one in comparisons
    ]
    return "\n".join(lines)


def draw_comparison(
    comparisons: Sequence[RotationComparison], path: str | PathLike[str], *, title: str = ""
) -> None:
    """Draw three panels like figs 4.8-4.10, one per axis of rotation, into an image file.

    Parameters
    ----------
    comparisons : sequence of RotationComparison
        Of one aircraft.
    path : path
        PNG to write.
    title : str
        The aircraft's name, for example.
    """
    with drawing(7.0, 9.0, Path(path), dpi=150) as figure:
        figure.set_layout_engine("constrained")
        panels = figure.subplots(3, 1, sharex=True, sharey=True)
        _draw_panels(panels, comparisons)
        if title:
            figure.suptitle(figure_text(title, 80))


def _draw_panels(panels: Any, comparisons: Sequence[RotationComparison]) -> None:
    for panel, axis in zip(panels, AXES, strict=True):
        shown = [one for one in comparisons if one.axis == axis]
        curves = {one.reference: (one.angle_deg, one.reference_share) for one in shown}
        for name, (angle_deg, share) in curves.items():
            panel.plot(
                angle_deg, share, "o-", label=figure_text(name), markersize=3.5, linewidth=1.2
            )
        curves = {f"{one.model} model": (one.angle_deg, one.model_share) for one in shown}
        for (name, (angle_deg, share)), style in zip(curves.items(), cycle(_STYLES)):
            panel.plot(
                angle_deg, share, label=figure_text(name), fillstyle="none", linewidth=1.2, **style
            )
        panel.set_title(f"Rotation about {axis}: {_STARTS[axis]}", fontsize=9)
        panel.set_ylabel("Signature\n[share of maximum]")
        panel.grid(True, alpha=0.3)
    panels[0].set_ylim(bottom=0.0)
    panels[0].legend(fontsize=8)
    panels[-1].set_xlabel("Camera angle about the axis [deg]")
    panels[-1].set_xticks(np.arange(0.0, 181.0, 30.0))
