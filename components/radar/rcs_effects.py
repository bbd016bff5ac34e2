"""Fluctuation and aspect of the targets' radar cross-sections as effects."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from components.aircraft.aircraft import Aircraft
from components.aircraft.known_targets import known_targets
from components.radar.aspect_rcs import mean_rcs_m2
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Context
from dsa_des.block.effect import Effect, Verdict

#: Swerling models with the cells that each holds for.
ModelsOfCells = Callable[[Cells], list[tuple[int, Any]]]

_UNKNOWN = "the targets are not known before the run"


class RcsFluctuation(Effect):
    """Swerling fluctuation I to IV (thesis §4.1.2); without it every target is steady."""

    lockstep = True
    name = "RCS fluctuation"
    acts_on = "RCS"

    def verdict(self, block: Any) -> Verdict:
        """Ask the radar's ``swerling``, and where it has none each target's."""
        if block.p.swerling is not None:
            return Verdict(block.p.swerling not in (0, 5), f"swerling is {block.p.swerling}")
        if not known_targets(block.context):
            return Verdict(True, _UNKNOWN)
        found = [(name, craft) for name, craft in _crafts(block.context) if craft.swerling % 5]
        if not found:
            return Verdict(False, "every target has swerling 0 or 5")
        return Verdict(True, f"{_first(found)} swerling {found[0][1].swerling}{_more(found)}")

    def build(self, block: Any) -> ModelsOfCells:
        """Return what tells each cell's fluctuation model."""
        return models_of(block.p.swerling)


class AspectRcs(Effect):
    """Mean RCS from a table over the direction from which the radar sees the aircraft."""

    lockstep = True
    name = "aspect RCS"
    acts_on = "mean RCS"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``aspect_rcs``, and every target for an ``rcs_table``."""
        if not block.p.aspect_rcs:
            return Verdict(False, "aspect_rcs is false")
        if not known_targets(block.context):
            return Verdict(True, _UNKNOWN)
        found = [(name, craft) for name, craft in _crafts(block.context) if craft.rcs_table]
        if not found:
            return Verdict(False, "no target has an rcs_table")
        return Verdict(True, f"{_first(found)} an rcs_table{_more(found)}")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return each cell's mean RCS; a target without a table has its constant."""
        return mean_rcs_m2


def models_of(swerling: int | None) -> ModelsOfCells:
    """Return what tells each cell's fluctuation model: one for all, or each target its own.

    Parameters
    ----------
    swerling : int or None

    Returns
    -------
    function
        From cells to pairs of a model (5 written as 0) and the cells it holds for.
    """
    if swerling is not None:
        return lambda cells: [(swerling % 5, slice(None))]

    def models(cells: Cells) -> list[tuple[int, Any]]:
        known = cells.roster.swerling_models
        if len(known) == 1:
            return [(known[0], slice(None))]
        of_cell = cells.of_target(cells.roster.swerling)
        found = [(model, np.flatnonzero(of_cell == model)) for model in known]
        return [(model, chosen) for model, chosen in found if len(chosen)]

    return models


def steady(cells: Cells) -> list[tuple[int, Any]]:
    """Return the fluctuation model of cells that are all steady."""
    return [(0, slice(None))]


def constant_rcs_m2(cells: Cells) -> FloatArray:
    """Return each cell's RCS where no target has a table, m²."""
    rcs: FloatArray = cells.of_target(cells.roster.rcs_m2)
    return rcs


def _crafts(context: Context) -> Iterable[tuple[str, Aircraft]]:
    for roster in known_targets(context):
        yield from zip(roster.names, roster.aircraft, strict=True)


def _first(found: list[tuple[str, Aircraft]]) -> str:
    return f"target {found[0][0]!r} has"


def _more(found: list[tuple[str, Aircraft]]) -> str:
    return "" if len(found) == 1 else f" (and {len(found) - 1} more like it)"
