"""The outcome of an encounter, and the warning time before it (``closest_approach``,
``well_clear``).

Loss of well clear is by default that of ASTM F3442 for small unmanned aircraft, 2000 ft
horizontally and 250 ft vertically; a near mid-air collision is 500 ft and 100 ft.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydantic import Field

from components.metrics.declaration import ANY, DECLARED, DeclarationParameters, declarations
from components.metrics.flights_together import first_losses_s
from components.metrics.relative_states import first_violation_s
from components.metrics.rows import TargetMetric, sensors_of
from components.metrics.run_ends import SCANS
from components.metrics.separation import (
    RelativeFlight,
    closest,
    separations,
    traffic_block,
)
from components.metrics.steered import Told, ToldManoeuvres, flown_as_told
from components.sensor.cut_off import END, START, in_scan, said
from components.well_clear.volume import FOOT_M, PRESETS, Volume
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.component import Parameters
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result

#: Where a closest approach may be cut off, see `components.flights.closest_approach.end_of_look`.
_ENDS = ("", START, END, "the start of its flight", "the end of its flight")
#: The end of a run that a block ended before its time.
_EARLY_END = "the early end of the run"
_NOWHERE = (float("inf"), float("nan"), "")
_BEFORE = ("detection", "declaration")
_CUT_OFF, _LOSS_CUT_OFF = "closest_approach_cut_off", "well_clear_loss_cut_off"
_WELL_CLEAR, _NMAC = PRESETS["astm_f3442"], PRESETS["nmac"]


#: Of metrics of losses; ``step_s`` of None looks between samples too.
STEP: Any = Field(
    default=None,
    gt=0,
    le=10,
    description="Take distances at this spacing only, s. By default entries are found between "
    "samples too, to 1 ms.",
)


class EncounterParameters(DeclarationParameters):
    """Parameters of encounter metrics."""

    step_s: float = Field(
        default=0.1, gt=0, le=10, description="Spacing of the times at which distances are taken."
    )


class SizeParameters(Parameters):
    """What counts as a loss of well clear, and as a near mid-air collision."""

    horizontal_m: float = Field(
        default=_WELL_CLEAR.horizontal_m,
        gt=0,
        le=1e6,
        description="Horizontal distance below which well clear is lost, m.",
    )
    vertical_m: float = Field(
        default=_WELL_CLEAR.vertical_m,
        gt=0,
        le=1e6,
        description="Difference in height below which well clear is lost, m.",
    )
    tau_s: float = Field(
        default=0.0,
        ge=0,
        le=600,
        description="Modified tau below which well clear is lost too, s (DO-365: 35). 0: distances "
        "alone.",
    )
    nmac_horizontal_m: float = Field(
        default=_NMAC.horizontal_m,
        gt=0,
        le=1e6,
        description="Horizontal distance of a near mid-air collision, m.",
    )
    nmac_vertical_m: float = Field(
        default=_NMAC.vertical_m,
        gt=0,
        le=1e6,
        description="Difference in height of a near mid-air collision, m.",
    )

    @property
    def sizes_m(self) -> tuple[tuple[float, float], ...]:
        """Radius and half height of both cylinders, m."""
        return (
            (self.horizontal_m, self.vertical_m),
            (self.nmac_horizontal_m, self.nmac_vertical_m),
        )

    def losses_s(self, runs: Sequence[list[RelativeFlight]]) -> FloatArray:
        """Return when well clear is first lost, when a collision first threatens, and 0, s."""
        return losses_s(self.sizes_m, runs, self.tau_s)


class WellClearParameters(EncounterParameters, SizeParameters):
    """Parameters of loss of well clear."""

    step_s: float | None = STEP  # type: ignore[assignment]


#: What is read of runs, each a list of its flights: (values, runs).
Read = Callable[[Sequence[list[RelativeFlight]]], FloatArray]


def each_alone(read: Callable[[list[RelativeFlight]], tuple[float, ...]]) -> Read:
    """Return what reads the flights of one run after the other."""
    return lambda runs: np.array([read(flights) for flights in runs]).T


def read_flights(
    group: Group,
    step_s: float | None,
    target: str | None,
    read: Read,
    told: Mapping[int, Told] | None = None,
    *,
    to_the_end: bool = False,
) -> FloatArray:
    """Return what `read` makes of every replica's flights, shape (values, replicas).

    Flights are computed once for all replicas that share them.

    Parameters
    ----------
    group : Group
    step_s : float or None
        Spacing of the times at which distances are taken; None looks between them for losses.
    target : str or None
        Which one counts; None for all.
    read : callable
    told : mapping, optional
        What the ownship of a replica was told to fly; others fly on as they are.
    to_the_end : bool
        Look at each no longer than its run, which may have ended early; else as long as it was
        meant to last.
    """
    told = told or {}
    block = f"blocks.{traffic_block(group.scene).name}."
    runs: list[list[RelativeFlight]] = []
    places: dict[Any, int] = {}
    place, steered = np.empty(len(group), dtype=np.int64), []
    for number, replica in enumerate(group.replicas):
        mine = {k: v for k, v in replica.changes.items() if k.startswith((block, "duration_s"))}
        until_s = math.inf
        if to_the_end and group.ended_early[number]:
            until_s = float(group.duration_s[number])
        key = (until_s, *sorted((k, repr(v)) for k, v in mine.items()))
        alone = number in told
        place[number] = places.setdefault((key, number if alone else None), len(runs))
        if place[number] < len(runs):
            continue
        scene = group.scenes[number] if mine else group.scene
        make = partial(separations, scene, step_s, until_s)
        flights = group.once(("separations", step_s, key), make)
        runs.append([flight for flight in flights if target in (None, flight.name)])
        if alone and runs[-1]:
            steered.append(number)
    flown = flown_as_told(
        [runs[place[number]][0].own for number in steered], [told[number] for number in steered]
    )
    for number, own in zip(steered, flown, strict=True):
        runs[place[number]] = [flight.flown_by(own) for flight in runs[place[number]]]
    return read(runs)[:, place]


class _Encounter(TargetMetric):
    Parameters = EncounterParameters
    tables = {**DECLARED, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        traffic_block(scene)
        self.sensors = sensors_of(scene, parameters.sensors)
        self._told = ToldManoeuvres(scene)
        self.tables = {**self.tables, **self._told.tables}

    def of_flights(self, group: Group, read: Read) -> FloatArray:
        """Return what `read` makes of every replica's flights as flown, (values, replicas)."""
        return read_flights(
            group, self.p.step_s, self.p.target, read, self._told.of(group),
            to_the_end=True,
        )  # fmt: skip


class ClosestApproach(_Encounter):
    """Closest approach, and how long before it the target was detected and declared.

    Where there are several targets, the one that comes closest counts.
    """

    def results(self) -> list[Result]:
        """Return distance, time, and times from detection and declaration."""
        found = [
            Result("closest_approach_m", NUMBER, "smallest slant range, m", _CUT_OFF),
            Result("closest_approach_time_s", NUMBER, "when that is, s", _CUT_OFF),
        ]
        for name in [*self.sensors, ANY]:
            seen, declared = (f"{what}_to_closest_cut_off.{name}" for what in _BEFORE)
            found += [
                Result(
                    f"detection_to_closest_s.{name}", NUMBER, "from first detection to it, s", seen
                ),
                Result(
                    f"declaration_to_closest_s.{name}", NUMBER, "from declaration to it, s",
                    declared,
                ),
            ]  # fmt: skip
        return found

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return all of it for every replica."""
        distance, time_s, code = self.of_flights(group, each_alone(_closest))
        at = np.array([*_ENDS, _EARLY_END])[code.astype(int)]
        at[(at == END) & group.ended_early] = _EARLY_END
        found: dict[str, AnyArray] = {
            "closest_approach_m": distance,
            "closest_approach_time_s": time_s,
            _CUT_OFF: said(at, distance),
        }
        for name, first in declarations(group, self.p, self.sensors).items():
            parts = ((first.seen_s, first.seen_at_start), (first.time_s, first.at_start))
            for what, (when_s, cut) in zip(_BEFORE, parts, strict=True):
                value = time_s - when_s
                found[f"{what}_to_closest_s.{name}"] = value
                found[f"{what}_to_closest_cut_off.{name}"] = said(np.where(cut, START, at), value)
        return found


class WellClear(_Encounter):
    """Loss of well clear and near mid-air collision, and the warning before the loss."""

    Parameters = WellClearParameters

    @staticmethod
    def _said(sizes_m: tuple[float, float], standard: Volume) -> str:
        """Return what a result's description says of its cylinder."""
        horizontal_m, vertical_m = sizes_m
        name = " (ASTM F3442)" if standard is _WELL_CLEAR else ""
        if (horizontal_m, vertical_m) == (standard.horizontal_m, standard.vertical_m):
            feet = horizontal_m / FOOT_M, vertical_m / FOOT_M
            return f"within {feet[0]:.0f} ft and {feet[1]:.0f} ft{name}"
        return f"within {horizontal_m:g} m and {vertical_m:g} m"

    def results(self) -> list[Result]:
        """Return both events, when well clear is lost, and the warning per sensor."""
        tau = f", or modified tau of {self.p.tau_s:g} s" if self.p.tau_s else ""
        found = [
            Result("well_clear_lost", EVENT, self._said(self.p.sizes_m[0], _WELL_CLEAR) + tau),
            Result("nmac", EVENT, self._said(self.p.sizes_m[1], _NMAC)),
            Result("well_clear_loss_time_s", NUMBER, "when well clear is lost, s", _LOSS_CUT_OFF),
        ]
        found += [
            Result(
                f"warning_time_s.{name}", NUMBER, "from declaration to the loss, s",
                f"warning_cut_off.{name}",
            )
            for name in [*self.sensors, ANY]
        ]  # fmt: skip
        return found

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return all of it for every replica."""
        lost_s, collision_s, begun_s = self.of_flights(group, self.p.losses_s)
        lost_at_start = in_scan(lost_s, begun_s)
        found: dict[str, AnyArray] = {
            "well_clear_lost": (~np.isnan(lost_s)).astype(float),
            "nmac": (~np.isnan(collision_s)).astype(float),
            "well_clear_loss_time_s": lost_s,
            _LOSS_CUT_OFF: said(np.where(lost_at_start, START, "")),
        }
        for name, first in declarations(group, self.p, self.sensors).items():
            warning_s = lost_s - first.time_s
            found[f"warning_time_s.{name}"] = warning_s
            cut = (first.at_start | lost_at_start) & ~np.isnan(warning_s)
            found[f"warning_cut_off.{name}"] = said(np.where(cut, START, ""))
        return found


def _closest(flights: list[RelativeFlight]) -> tuple[float, ...]:
    """Return smallest range (m), its time (s), and the place in `_ENDS` of where it is cut off."""
    best = min((closest(flight) for flight in flights), default=_NOWHERE)
    if not np.isfinite(best[0]):
        return float("nan"), float("nan"), 0.0
    return best[0], best[1], float(_ENDS.index(best[2]))


def losses_s(
    sizes_m: tuple[tuple[float, float], ...],
    runs: Sequence[list[RelativeFlight]],
    tau_s: float = 0.0,
) -> FloatArray:
    """Return when well clear is first lost, when a collision first threatens, and the start, s.

    Parameters
    ----------
    sizes_m : ((horizontal, vertical) of well clear, those of a collision)
    runs : sequence of list of RelativeFlight
    tau_s : float
        Modified tau of well clear; 0 for a cylinder.

    Returns
    -------
    (3, runs)
        NaN for what never happens; the first of several flights counts.
    """
    flights = [flight for run in runs for flight in run]
    of_run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    first = first_losses_s(flights, *sizes_m)
    if tau_s > 0.0:
        volume = Volume(*sizes_m[0], horizontal_time_s=tau_s)
        first[:, 0] = [first_violation_s(flight, volume) for flight in flights]
    found = np.full((3, len(runs)), np.nan)
    for value in (0, 1):
        np.fmin.at(found[value], of_run, first[:, value])
    found[2, of_run] = 0.0
    return found
