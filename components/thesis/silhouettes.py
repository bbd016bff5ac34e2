"""Figs 4.8 to 4.10 and Table 4.3: the aircraft model against silhouettes over rotation."""

from functools import cache
from pathlib import Path
from typing import Any

from components.optical.silhouette import visible_area
from components.thesis import measured_tables
from components.thesis.basis import predicted
from components.thesis.made import Made, Picture
from components.thesis.printed import printed
from components.thesis.project_files import aircraft
from components.thesis.row import Row
from components.thesis.silhouette_comparison import (
    AXES,
    RotationComparison,
    Silhouette,
    compare_silhouettes,
    draw_comparison,
)

NAMES = {"beech_99": "Beech 99", "f_16": "F-16", "boeing_787": "Boeing 787"}
_KINDS = ("mean", "maximum")
_BECAUSE = (
    "its FlightGear images are not to be had: our reference is the exact union of the model's "
    "own bodies"
)
_MISPRINT = f"82 is misprinted for 8.2 (errata 22), and {_BECAUSE}"
_CAPTION = (
    "Signature of the {} over half turns about the three axes, as a share of its maximum: the "
    "thesis's equations 9 to 13, the exact projection, and as reference the exact silhouette of "
    "the three bodies together, in place of the thesis's images."
)
_WHY = "Cameras every 10°, each signature as a share of its own maximum; thesis's eq. 9-13."
_NOT_MADE = (
    f"Measured on {measured_tables.MEASURED_ON} with the command below; not made again here, the "
    "table belongs to others."
)


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
    """Return mean and maximum errors of the thesis's equations, against two references."""
    rows = []
    for file in NAMES:
        bodies = predicted("Table 3.1's areas against the union of its bodies",
                           f"aircraft/{file}.toml:eo")  # fmt: skip
        table = predicted(f"Table 3.1's areas against the measured {measured_tables.SOURCE}",
                          f"aircraft/{file}.toml:eo")  # fmt: skip
        for axis in AXES:
            one = _of(_comparisons(file), "thesis", axis)
            texts = [printed("table-4.3", f"{file} {axis} {kind}") for kind in _KINDS]
            name = f"error, {NAMES[file]}, rotation about {axis}"
            for kind, value, text in zip(_KINDS, (one.mean_error, one.max_error), texts,
                                         strict=True):  # fmt: skip
                rows.append(Row(f"{kind} {name}", 100.0 * value, "%", _WHY, text, None,
                                _MISPRINT if text == "82" else _BECAUSE, bodies))  # fmt: skip
            for kind, value, text in zip(_KINDS, measured_tables.ERRORS.get(file, {}).get(axis, ()),
                                         texts, strict=False):  # fmt: skip
                rows.append(Row(f"{kind} {name}, against a measured table", 100.0 * value, "%",
                                _NOT_MADE, text, None, measured_tables.DIFFER[file], table,
                                again=f"{kind} {name}"))  # fmt: skip
    data = {
        "aircraft": [NAMES[file] for file in NAMES for _ in AXES],
        "axis": [axis for _ in NAMES for axis in AXES],
        **{
            f"printed_{kind}_percent": [
                printed("table-4.3", f"{file} {axis} {kind}") for file in NAMES for axis in AXES
            ]
            for kind in _KINDS
        },
        **{
            f"{model}_{kind}_percent": [
                100.0 * getattr(_of(_comparisons(file), model, axis), f"{kind}_error")
                for file in NAMES
                for axis in AXES
            ]
            for model in ("thesis", "exact")
            for kind in ("mean", "max")
        },
    }
    note = (
        "Against a measured table, here or with one of your own: "
        f"`{measured_tables.COMMAND.format(aircraft='beech_99', table='be99.csv')}`. The tables of "
        "the Beech 99 and the F-16 are be99.csv and f16.csv of "
        f"[{measured_tables.SOURCE}](https://github.com/{measured_tables.SOURCE}), projected areas "
        "every 15°; of the Boeing 787 there is none."
    )
    return Made(rows, data={"table_4_3": data}, note=note)


@cache
def _comparisons(file: str) -> list[RotationComparison]:
    models = {"thesis": _silhouette(file, "thesis"), "exact": _silhouette(file, "exact")}
    return compare_silhouettes(models, {"union of the bodies": _silhouette(file, "convex_hull")})


def _silhouette(file: str, model: str) -> Silhouette:
    areas = aircraft(file).eo.model_dump(exclude={"silhouette_table", "made_for"})
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
