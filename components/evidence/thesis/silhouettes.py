"""Figs 4.8 to 4.10 and Table 4.3: the aircraft model against silhouettes over rotation."""

from functools import cache
from pathlib import Path
from typing import Any

from components.evidence.silhouettes.comparison import (
    AXES,
    RotationComparison,
    Silhouette,
    compare_silhouettes,
    draw_comparison,
)
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.project_files import aircraft
from components.evidence.thesis.row import Row
from components.optical.silhouette import visible_area

NAMES = {"beech_99": "Beech 99", "f_16": "F-16", "boeing_787": "Boeing 787"}
#: Mean and maximum errors as printed, per cent, axes x, y, z (8.2 is printed 82, errata 22).
TABLE_4_3 = {
    "beech_99": (("3.5", "10"), ("11.5", "18.8"), ("6.2", "12")),
    "f_16": (("2.2", "4.9"), ("9.2", "22.2"), ("5.9", "16.3")),
    "boeing_787": (("1.3", "3.4"), ("7.6", "14.2"), ("2.1", "8.2")),
}
_BECAUSE = (
    "its FlightGear images are not to be had: our reference is the exact union of the model's "
    "own bodies"
)
_CAPTION = (
    "Signature of the {} over half turns about the three axes, as a share of its maximum: the "
    "thesis's equations 9 to 13, the exact projection, and as reference the exact silhouette of "
    "the three bodies together, in place of the thesis's images."
)
_WHY = "Cameras every 10°, each signature as a share of its own maximum; thesis's eq. 9-13."


def beech_99() -> Made:
    """Return the curves of the Beech 99."""
    return _figure("beech_99", "fig_4_8")


def f_16() -> Made:
    """Return the curves of the F-16."""
    return _figure("f_16", "fig_4_9")


def boeing_787() -> Made:
    """Return the curves of the Boeing 787."""
    return _figure("boeing_787", "fig_4_10")


def errors() -> Made:
    """Return mean and maximum errors of the thesis's equations."""
    rows = []
    for file, printed in TABLE_4_3.items():
        for axis, (mean, most) in zip(AXES, printed, strict=True):
            one = _of(_comparisons(file), "thesis", axis)
            for kind, value, text in (
                ("mean", one.mean_error, mean),
                ("maximum", one.max_error, most),
            ):
                rows.append(Row(f"{kind} error, {NAMES[file]}, rotation about {axis}",
                                100.0 * value, "%", _WHY, text, None, _BECAUSE))  # fmt: skip
    data = {
        "aircraft": [NAMES[file] for file in TABLE_4_3 for _ in AXES],
        "axis": [axis for _ in TABLE_4_3 for axis in AXES],
        "printed_mean_percent": [mean for cells in TABLE_4_3.values() for mean, _ in cells],
        "printed_maximum_percent": [most for cells in TABLE_4_3.values() for _, most in cells],
        **{
            f"{model}_{kind}_percent": [
                100.0 * getattr(_of(_comparisons(file), model, axis), f"{kind}_error")
                for file in TABLE_4_3
                for axis in AXES
            ]
            for model in ("thesis", "exact")
            for kind in ("mean", "max")
        },
    }
    note = (
        "With a measured table or a mesh in place of the images: "
        "`python -m components.evidence.silhouettes.comparison_command --aircraft "
        "configs/aircraft/beech_99.toml --reference AREAS.csv --out DIR`."
    )
    return Made(rows, data={"table_4_3": data}, note=note)


@cache
def _comparisons(file: str) -> list[RotationComparison]:
    models = {"thesis": _silhouette(file, "thesis"), "exact": _silhouette(file, "exact")}
    return compare_silhouettes(models, {"union of the bodies": _silhouette(file, "convex_hull")})


def _silhouette(file: str, model: str) -> Silhouette:
    areas = aircraft(file).eo.model_dump(exclude={"silhouette_table"})
    return lambda *view: visible_area(*view, **areas, model=model)


def _of(found: list[RotationComparison], model: str, axis: str) -> RotationComparison:
    return next(one for one in found if one.model == model and one.axis == axis)


def _figure(file: str, figure: str) -> Made:
    found = _comparisons(file)
    rows = [
        Row(f"shown share at {int(one.angle_deg[index])}°, rotation about {axis}, exact",
            float(one.model_share[index]), "", "Share of the model's own maximum.")
        for axis, index in (("x", 0), ("y", 0), ("z", 9))
        for one in [_of(found, "exact", axis)]
    ]  # fmt: skip
    data: dict[str, Any] = {"angle_deg": found[0].angle_deg}
    for axis in AXES:
        for model in ("thesis", "exact"):
            data[f"{model}_{axis}"] = _of(found, model, axis).model_share
        data[f"union_{axis}"] = _of(found, "exact", axis).reference_share

    def draw(path: Path) -> None:
        draw_comparison(found, path, title=NAMES[file])

    return Made(rows, [Picture(figure, _CAPTION.format(NAMES[file]), draw)], {figure: data})
