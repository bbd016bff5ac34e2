"""``python -m components.thesis.silhouette_comparison``: section 4.2.1 for an aircraft.

The simple model of sphere, cylinder and plate against a measured table, a mesh, or both: mean and
maximum error of each half turn as in Table 4.3, and a figure of three panels as in Figs 4.8-4.10.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from components.aircraft.aspect_tables import SilhouetteTable
from components.arguments.checks import FloatArray
from components.optical.silhouette import visible_area
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.input_files import InputFileError
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import user_path
from dsa_des.record.drawing import draw_to_png, figure_text
from dsa_des.record.run_folder import write_run_json
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say, say_lines

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
    {"marker": marker, "linestyle": line, "markersize": size, "fillstyle": "none"}
    for marker, line, size in (("s", "--", 7.0), ("^", ":", 4.5), ("d", "-.", 3.0))
]
_REFERENCE: dict[str, Any] = {"marker": "o", "linestyle": "-", "markersize": 3.5}


@dataclass(frozen=True, eq=False)
class RotationComparison:
    """Hold one model against one reference over a half turn about one body axis."""

    #: One of `AXES`.
    axis: str
    model: str
    reference: str
    #: (n,)
    angle_deg: FloatArray
    #: (n,), signatures as a share of the maximum (see `compare_silhouettes`).
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


def camera_angles_over_half_turn(
    axis: str, step_deg: float = 10.0
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Return angles to 180° about an axis; relative heading, pitch, roll, camera elevation, rad.

    x: from the right wing over the top to the left wing. y: from the nose over the top to the
    tail. z: from the nose past the right wing to the tail. The target stays level; only the line
    of sight turns.
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
    """Return a comparison per model, reference and body axis, over half turns of the camera."""
    if scale not in SCALES:
        raise ValueError(f"scale is {scale!r}: it must be one of {', '.join(SCALES)}")
    cameras = {axis: camera_angles_over_half_turn(axis, step_deg) for axis in AXES}

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
            comparisons += [
                RotationComparison(
                    axis, model, reference, cameras[axis][0], model_areas[axis] / divisor,
                    reference_areas[axis] / reference_largest,
                )
                for axis in AXES
            ]  # fmt: skip
    return comparisons


def comparison_table_text(comparisons: Sequence[RotationComparison]) -> str:
    """Return the mean and maximum errors as a text table like Table 4.3."""
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
    """Draw three panels like figs 4.8-4.10, one per axis of rotation, into an image file."""
    with draw_to_png(7.0, 9.0, Path(path), dpi=150) as figure:
        figure.set_layout_engine("constrained")
        panels = figure.subplots(3, 1, sharex=True, sharey=True)
        for panel, axis in zip(panels, AXES, strict=True):
            shown = [one for one in comparisons if one.axis == axis]
            drawn = {one.reference: (one, one.reference_share, _REFERENCE) for one in shown}
            models = {f"{one.model} model": (one, one.model_share) for one in shown}
            styles = zip(models.items(), cycle(_STYLES))
            drawn |= {name: (*curve, style) for (name, curve), style in styles}
            for name, (one, share, style) in drawn.items():
                panel.plot(one.angle_deg, share, label=figure_text(name), linewidth=1.2, **style)
            panel.set_title(f"Rotation about {axis}: {_STARTS[axis]}", fontsize=9)
            panel.set_ylabel("Signature\n[share of maximum]")
            panel.grid(True, alpha=0.3)
        panels[0].set_ylim(bottom=0.0)
        panels[0].legend(fontsize=8)
        panels[-1].set_xlabel("Camera angle about the axis (deg)")
        panels[-1].set_xticks(np.arange(0.0, 181.0, 30.0))
        if title:
            figure.suptitle(figure_text(title, 80))


# Light aircraft show up to a fifth more from the nose than abeam, or less: only what is clearly the
# other way round than the model is spoken of.
_CLEARLY = 1.25


def turned_table_warning(areas: Mapping[str, float], table: SilhouetteTable) -> str | None:
    """Return a warning if a table seems turned 90° in azimuth to the model's areas, or None.

    A fuselage shows more abeam than from the nose. Where the three bodies say so by more than a
    quarter and the table says the opposite by as much, its azimuths most likely count from a wing.
    """
    from_nose = float(np.mean(table.area(np.radians([0.0, 180.0]), 0.0)))
    abeam = float(np.mean(table.area(np.radians([90.0, 270.0]), 0.0)))
    model_nose, model_abeam = areas["front_m2"], areas["front_m2"] + areas["side_m2"]
    longer = model_abeam > _CLEARLY * model_nose and from_nose > _CLEARLY * abeam
    if not longer:
        return None
    return (
        f"the table looks turned by 90 degrees: along az_deg 0 and 180 it shows {from_nose:.1f} "
        f"m², along 90 and 270 only {abeam:.1f}, where the model shows {model_nose:.1f} from the "
        f"nose and {model_abeam:.1f} abeam; az_deg 0 must be the nose, 90 the right wing"
    )


_AREAS = ("front_m2", "side_m2", "horizontal_m2")
_MODELS = ("exact", "thesis", "convex_hull")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, or 2 when it cannot use what it was given."""
    options = _parser().parse_args(arguments)
    try:
        out = OutputFolder(user_path(options.out))
        with out.write_then_rename() as folder:
            try:
                comparisons = _compare(options)
            except OSError as error:  # of what is read, not of what is written
                raise ValueError(str(error)) from error
            say_lines(comparison_table_text(comparisons))
            _write_tables(comparisons, folder)
            draw_comparison(comparisons, folder / "silhouettes.png", title=options.title or "")
            write_run_json(folder, {"title": options.title or "", "models": options.models})
    except (ImportError, UsageError, ValueError) as error:
        say(f"error: {error}", err=True)
        return 2
    except OutputError as error:
        say(f"error: {error}", err=True)
        return 1
    say()
    say(f"{out.path}: errors.csv, curves.csv, silhouettes.png")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m components.thesis.silhouette_comparison",
        description="Compare the simple aircraft model with measured or meshed silhouettes over "
        "half turns about the three body axes (thesis section 4.2.1).",
    )
    areas = parser.add_mutually_exclusive_group(required=True)
    areas.add_argument("--areas", metavar="FRONT,SIDE,HORIZONTAL", help="areas of the model, m²")
    areas.add_argument(
        "--aircraft",
        type=Path,
        metavar="FILE",
        help="aircraft file with a table [eo], such as configs/aircraft/beech_99.toml",
    )
    parser.add_argument(
        "--reference", type=Path, metavar="TABLE", help="CSV with az_deg, el_deg and an area"
    )
    parser.add_argument("--mesh", type=Path, metavar="FILE", help="closed mesh, STL or OBJ")
    parser.add_argument(
        "--mesh-unit-m", type=float, default=1.0, help="length of one unit of the mesh, m"
    )
    parser.add_argument(
        "--mesh-axes", default="frd", help="where its x, y, z point, e.g. flu: forward, left, up"
    )
    parser.add_argument(
        "--models", default="exact,thesis", help=f"of {', '.join(_MODELS)}; default exact,thesis"
    )
    parser.add_argument("--step-deg", type=float, default=10.0, help="camera step; default 10")
    parser.add_argument(
        "--scale",
        choices=SCALES,
        default="own_maximum",
        help="own_maximum compares shapes, as the thesis does; reference_maximum sizes as well",
    )
    parser.add_argument("--title", help="name of the aircraft, above the figure")
    parser.add_argument("--out", required=True, help="folder for tables and figure")
    return parser


def _compare(options: argparse.Namespace) -> list[RotationComparison]:
    areas = _areas(options)
    models: dict[str, Silhouette] = {}
    for name in options.models.split(","):
        if name not in _MODELS:
            raise ValueError(f"--models has {name!r}: it must be of {', '.join(_MODELS)}")
        models[name] = partial(visible_area, model=name, **areas)
    references: dict[str, Silhouette] = {}
    if options.reference is not None:
        from components.aircraft.aspect_tables import read_silhouette_table

        try:
            table = read_silhouette_table(options.reference)
        except InputFileError as error:
            raise ValueError(f"--reference {options.reference}: {error}") from None
        references["table"] = partial(visible_area, model="aspect_table", table=table)
        if warning := turned_table_warning(areas, table):
            say(f"warning: --reference {options.reference}: {warning}", err=True)
    if options.mesh is not None:
        from components.optical.mesh import load_mesh

        mesh = load_mesh(options.mesh, unit_m=options.mesh_unit_m, axes=options.mesh_axes)
        references["mesh"] = partial(visible_area, model="convex_hull", mesh=mesh)
    if not references:
        raise ValueError("--reference and --mesh are missing: at least one of them must be given")
    return compare_silhouettes(models, references, step_deg=options.step_deg, scale=options.scale)


def _areas(options: argparse.Namespace) -> dict[str, Any]:
    if options.areas is not None:
        try:
            values = [float(text) for text in options.areas.split(",")]
        except ValueError:
            values = []
        if len(values) != len(_AREAS):
            raise ValueError(
                f"--areas is {options.areas!r}: it must be three numbers, FRONT,SIDE,HORIZONTAL"
            )
        return dict(zip(_AREAS, values, strict=True))
    # With all that it extends: most files of configs/aircraft hold a few keys over another's.
    try:
        content = read_scene_file(options.aircraft).data
    except UsageError as error:
        raise ValueError(f"--aircraft: {error}") from None
    eo = content.get("eo")
    table: dict[str, Any] = eo if isinstance(eo, dict) else {}
    for name in _AREAS:
        value = table.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{options.aircraft} has no number eo.{name}: --aircraft needs it")
    return {name: float(table[name]) for name in _AREAS}


def _write_tables(comparisons: Sequence[RotationComparison], folder: Path) -> None:
    names = ("model", "reference", "axis")
    tables: dict[str, list[Sequence[str]]] = {
        "errors": [(*names, "mean_error", "max_error")],
        "curves": [(*names, "angle_deg", "model_share", "reference_share")],
    }
    for one in comparisons:
        of = one.model, one.reference, one.axis
        tables["errors"].append((*of, f"{one.mean_error:.6f}", f"{one.max_error:.6f}"))
        shares = zip(one.angle_deg, one.model_share, one.reference_share, strict=True)
        tables["curves"] += [(*of, f"{a:g}", f"{m:.6f}", f"{r:.6f}") for a, m, r in shares]
    for name, rows in tables.items():
        with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
