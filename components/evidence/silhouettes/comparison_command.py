"""``python -m components.evidence.silhouettes.comparison_command``: section 4.2.1 for an aircraft.

The simple model of sphere, cylinder and plate against a measured table, a mesh, or both: mean and
maximum error of each half turn as in Table 4.3, and a figure of three panels as in Figs 4.8-4.10.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from components.evidence.silhouettes.comparison import (
    SCALES,
    RotationComparison,
    Silhouette,
    compare_silhouettes,
    comparison_table,
    draw_comparison,
)
from components.evidence.silhouettes.turned_table import turned_table_warning
from components.optical.silhouette import visible_area
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.input_files import InputFileError
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import named
from dsa_des.record.run_folder import write_run_json
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.terminal.interruption import plain_ending
from dsa_des.terminal.terminal import say, say_lines

_AREAS = ("front_m2", "side_m2", "horizontal_m2")
_MODELS = ("exact", "thesis", "convex_hull")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, or 2 when it cannot use what it was given."""
    options = _parser().parse_args(arguments)
    try:
        out = OutputFolder(named(options.out))
        with out.writing() as folder:
            try:
                comparisons = _compare(options)
            except OSError as error:  # of what is read, not of what is written
                raise ValueError(str(error)) from error
            say_lines(comparison_table(comparisons))
            _write_errors(comparisons, folder / "errors.csv")
            _write_curves(comparisons, folder / "curves.csv")
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
        prog="python -m components.evidence.silhouettes.comparison_command",
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
    models = {}
    for name in options.models.split(","):
        if name not in _MODELS:
            raise ValueError(f"--models has {name!r}: it must be of {', '.join(_MODELS)}")
        models[name] = _silhouette(model=name, **areas)
    references: dict[str, Silhouette] = {}
    if options.reference is not None:
        from components.aircraft.aspect_tables import read_aspect_table

        try:
            table = read_aspect_table(options.reference)
        except InputFileError as error:
            raise ValueError(f"--reference {options.reference}: {error}") from None
        references["table"] = _silhouette(model="aspect_table", table=table)
        if warning := turned_table_warning(areas, table):
            say(f"warning: --reference {options.reference}: {warning}", err=True)
    if options.mesh is not None:
        from components.optical.mesh import load_mesh

        mesh = load_mesh(options.mesh, unit_m=options.mesh_unit_m, axes=options.mesh_axes)
        references["mesh"] = _silhouette(model="convex_hull", mesh=mesh)
    if not references:
        raise ValueError("--reference and --mesh are missing: at least one of them must be given")
    return compare_silhouettes(models, references, step_deg=options.step_deg, scale=options.scale)


def _areas(options: argparse.Namespace) -> dict[str, float]:
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
    assert isinstance(table, dict)
    return {name: float(table[name]) for name in _AREAS}


def _silhouette(**known: Any) -> Silhouette:
    return lambda heading, pitch, roll, elevation: visible_area(
        heading, pitch, roll, elevation, **known
    )


def _write_errors(comparisons: Sequence[RotationComparison], path: Path) -> None:
    rows = [("model", "reference", "axis", "mean_error", "max_error")]
    rows += [
        (one.model, one.reference, one.axis, f"{one.mean_error:.6f}", f"{one.max_error:.6f}")
        for one in comparisons
    ]
    _write(rows, path)


def _write_curves(comparisons: Sequence[RotationComparison], path: Path) -> None:
    rows = [("model", "reference", "axis", "angle_deg", "model_share", "reference_share")]
    for one in comparisons:
        for angle, model, reference in zip(
            one.angle_deg, one.model_share, one.reference_share, strict=True
        ):
            rows.append((one.model, one.reference, one.axis, f"{angle:g}", f"{model:.6f}",
                         f"{reference:.6f}"))  # fmt: skip
    _write(rows, path)


def _write(rows: Sequence[Sequence[str]], path: Path) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
