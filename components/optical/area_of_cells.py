"""The area that each cell's target shows, by the camera's choice of silhouette."""

from typing import Any

import numpy as np

from components.aircraft.aircraft import Roster
from components.optical.infrared_area import infrared_area
from components.optical.sampled_silhouette import body_mesh, sampled_table
from components.optical.silhouette import visible_area
from components.optical.tabulated_area import area_by_table, table_of_targets
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray

# Cells worked on together, so that what is in flight stays in the processor's cache.
CELLS_AT_ONCE = 8192

_BODIES = ("front_m2", "side_m2", "horizontal_m2")


def check_silhouette(roster: Roster, band: str, silhouette: str) -> None:
    """Check that every target has what a camera's silhouette needs.

    Parameters
    ----------
    roster : Roster
    band, silhouette
        As for `area_of_cells`.

    Raises
    ------
    ValueError
        If a target lacks it.
    """
    if silhouette == "aspect_table":
        table_of_targets(roster, f"{band}.silhouette_table")
    elif silhouette == "mesh":
        for name, craft in zip(roster.names, roster.aircraft, strict=True):
            of: Any = getattr(craft, band)
            for key in _BODIES:
                if getattr(of, key) <= 0.0:
                    raise ValueError(
                        f"{band}.{key} of target {name!r} is 0: silhouette 'mesh' needs every body"
                    )
            if band == "ir" and of.back_m2 != of.front_m2:
                raise ValueError(
                    f"target {name!r} has ir.back_m2 {of.back_m2:g} and ir.front_m2 "
                    f"{of.front_m2:g}: silhouette 'mesh' needs them alike, a mesh has one shape"
                )


def fitted_otherwise(roster: Roster, band: str, silhouette: str) -> list[str]:
    """Say which targets a camera adds the bodies of, though they were fitted to show their union.

    Parameters
    ----------
    roster : Roster
    band, silhouette
        As for `area_of_cells`.
    """
    if silhouette not in ("exact", "thesis"):
        return []
    names = [
        name
        for name, craft in zip(roster.names, roster.aircraft, strict=True)
        if getattr(craft, band).made_for is not None
    ]
    if not names:
        return []
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return [
        f"the areas of {names[0]!r}{more} were fitted for silhouette 'convex_hull' and silhouette "
        f"is {silhouette!r}: from above and below they show too much"
    ]


def area_of_cells(cells: Cells, band: str, silhouette: str) -> FloatArray:
    """Return each cell's area.

    Parameters
    ----------
    cells : Cells
    band : {"eo", "ir"}
        Whose areas of the aircraft; ``ir`` has a back of its own.
    silhouette : str
        A model of `components.optical.silhouette.visible_area`, ``sampled_table`` or ``mesh``.

    Returns
    -------
    (cells,) array, m²

    Raises
    ------
    ValueError
        If a target lacks what the silhouette needs, whether in sight or not.
    """
    if silhouette == "aspect_table":
        tables = table_of_targets(cells.roster, f"{band}.silhouette_table")
        return area_by_table(cells, {"table": tables}, "aspect_table")
    names = (*_BODIES, "back_m2") if band == "ir" else _BODIES
    areas = {name: cells.roster.column(f"{band}.{name}") for name in names}
    if silhouette == "sampled_table":
        tables = [sampled_table(*map(float, row)) for row in zip(*areas.values(), strict=True)]
        return area_by_table(cells, {"table": tables}, "aspect_table")
    if silhouette == "mesh":
        check_silhouette(cells.roster, band, silhouette)
        bodies = zip(*(areas[key] for key in _BODIES), strict=True)
        meshes = [body_mesh(*map(float, body)) for body in bodies]
        return area_by_table(cells, {"mesh": meshes}, "convex_hull")
    compute: Any = infrared_area if band == "ir" else visible_area
    view = (
        cells.relative_heading_rad,
        cells.target_pitch_rad,
        cells.target_roll_rad,
        cells.elevation_rad,
    )
    shown = {name: cells.of_target(column) for name, column in areas.items()}
    if len(cells) <= CELLS_AT_ONCE:
        small: FloatArray = compute(*view, model=silhouette, validate=False, **shown)
        return small
    area = np.empty(len(cells))
    for start in range(0, len(cells), CELLS_AT_ONCE):
        block = slice(start, start + CELLS_AT_ONCE)
        area[block] = compute(
            *(angle[block] for angle in view),
            model=silhouette,
            validate=False,
            **{name: values[block] for name, values in shown.items()},
        )
    return area
