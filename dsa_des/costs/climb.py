"""Climbing one ladder of one block: cost, error and effect of every rung, and which are good."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dsa_des.block.ladder import Ladder, Quantity, Unavailable
from dsa_des.costs.replay import (
    RungRun,
    Spread,
    Values,
    error_spread_by_quantity,
    errors_against_precise,
    median_and_half_iqr,
    replay_values,
    run_rung,
    time_rungs_in_turn,
)
from dsa_des.costs.variants import Choice, Variants
from dsa_des.errors import BlockFailure, SceneError, UsageError, did_you_mean
from dsa_des.running.reports import Change, Difference, Report
from dsa_des.running.simulation import Simulation

_BUDGET = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*(\S+)\s*")


def flag_points_on_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return which (cost, error) points are on the Pareto front: no other dominates them.

    A NaN error is on no front.
    """
    return [
        error == error
        and not any(
            c <= cost and e <= error and (c < cost or e < error) for c, e in points if e == e
        )
        for cost, error in points
    ]


def allowed_errors_by_unit(texts: Iterable[str], ladders: Iterable[Ladder]) -> dict[str, float]:
    """Return largest allowed errors by unit from texts such as ``0.5mrad``."""
    units = sorted({q.unit for ladder in ladders for q in ladder.quantities})
    budgets: dict[str, float] = {}
    for text in texts:
        match = _BUDGET.fullmatch(text)
        try:
            value = float(match[1]) if match else 0.0
        except ValueError:
            value = 0.0
        if match is None or not value > 0.0:
            raise UsageError(
                f"--budget {text}: must be a number above 0 with its unit, for example 0.5mrad; "
                f"units: {', '.join(units)}"
            )
        unit = {"m2": "m²", "pd": "Pd"}.get(match[2].lower(), match[2])
        if unit not in units:
            raise UsageError(f"--budget {text}: unknown unit {match[2]}{did_you_mean(unit, units)}")
        budgets[unit] = value
    return budgets


def allowed_error(
    quantity: Quantity, budgets: Mapping[str, float], tolerance: Mapping[str, float]
) -> float | None:
    """Return the largest allowed error, by the unit's budget, else ``[accuracy]``, else None."""
    if quantity.unit in budgets:
        return budgets[quantity.unit]
    if quantity.tolerance in tolerance:
        return tolerance[quantity.tolerance] * quantity.per_tolerance
    return None


_NOTHING = Difference("what differs", "share of what differs", lambda changes: 0.0)


class Comparison:
    """What all reports together say of the difference between two runs.

    Of reports that compare, the first one's `difference` counts.
    """

    def __init__(self, reports: Sequence[Report]) -> None:
        self._reports = [report for report in reports if hasattr(report, "compare")]
        #: Columns of tables.
        self.changes: tuple[Change, ...] = tuple(
            change for report in self._reports for change in getattr(report, "changes", ())
        )
        known = [report.difference for report in self._reports if hasattr(report, "difference")]
        #: The one number that is weighed against cost.
        self.difference = known[0] if known else _NOTHING

    def __call__(self, reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
        """Return what changed from one run's recorded tables to another's."""
        changes: dict[str, Any] = {}
        for report in self._reports:
            changes.update(report.compare(reference, other))
        return changes

    def describe_changes(self, changes: Mapping[str, Any]) -> list[str]:
        """Return the remarks of all reports on changes that no column of the table shows."""
        return [
            remark
            for report in self._reports
            if hasattr(report, "describe_changes")
            for remark in report.describe_changes(changes)
        ]


def format_change_value(change: Change, changes: Mapping[str, Any], none: str) -> str:
    """Return one change's value as text in the change's own format; `none` if unknown."""
    value = changes.get(change.key)
    return none if value is None else format(value, change.form)


#: Compares the recorded tables of the reference's run and of a rung's run.
Compare = Callable[[Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]
# Two costs nearer to each other than this factor come in another order in another run.
_APART = 1.1


@dataclass
class RungCost:
    """The CPU cost and the errors of one rung of a ladder."""

    block: str
    ladder: Ladder
    rung: str
    reference: str
    #: Whether the scene itself uses this rung.
    in_scene: bool = False
    #: Why the rung cannot be had in this scene; empty when it can, and then the rest is known.
    unavailable: str = ""
    #: Median over the repeats, and half the distance between the quartiles. Costs closer than 10 %
    #: count as equal: they get one value, and `tied_with` names the other rungs.
    cpu_us_per_target_scan: float = math.nan
    cpu_spread_us: float = math.nan
    tied_with: list[str] = field(default_factory=list)
    repeats: int = 0
    #: By quantity, against the reference; of the reference itself, its own error where that could
    #: be measured.
    errors: dict[str, Spread] = field(default_factory=dict)
    #: Of the reference: how its own error was measured, or why it was not.
    error_note: str = ""
    #: Changes of the run's results against the reference's.
    effect: dict[str, Any] = field(default_factory=dict)
    #: `inside_budget` is None when there is no budget.
    pareto: bool = False
    inside_budget: bool | None = None
    cheapest_inside: bool = False

    @property
    def first_quantity_error(self) -> Spread:
        """The errors in the ladder's first quantity; NaN where they are unknown."""
        unknown = Spread(math.nan, math.nan, math.nan, 0)
        return self.errors.get(self.ladder.quantities[0].name, unknown)

    def row(self) -> dict[str, Any]:
        """Return the row that ``--json`` prints."""
        first = self.ladder.quantities[0]
        row: dict[str, Any] = {
            "block": self.block,
            "ladder": self.ladder.name,
            "rung": self.rung,
            "reference": self.reference,
            "in_scene": self.in_scene,
            "unavailable": self.unavailable or None,
            "cpu_us_per_target_scan": _finite_or_none(self.cpu_us_per_target_scan),
            "cpu_spread_us": _finite_or_none(self.cpu_spread_us),
            "tied_with": self.tied_with,
            "repeats": self.repeats,
            "error_quantity": first.name,
            "error_unit": first.unit,
            "error_mean": _finite_or_none(self.first_quantity_error.mean),
            "error_p95": _finite_or_none(self.first_quantity_error.p95),
            "error_max": _finite_or_none(self.first_quantity_error.maximum),
            "error_is": "own" if self.rung == self.reference else "added",
            "error_note": self.error_note or None,
            "pareto": self.pareto,
            "inside_budget": self.inside_budget,
            "cheapest_inside": self.cheapest_inside,
            "effect": self.effect,
            "errors": {
                quantity.name: {
                    "unit": quantity.unit,
                    "mean": _finite_or_none(spread.mean),
                    "p95": _finite_or_none(spread.p95),
                    "max": _finite_or_none(spread.maximum),
                    "target_scans": spread.count,
                }
                for quantity in self.ladder.quantities
                if (spread := self.errors.get(quantity.name)) is not None
            },
        }
        return row


def _finite_or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def inapplicable_reason(variants: Variants, block: str, ladder: Ladder) -> str:
    """Return why a ladder's rungs make no difference in this scene; empty if they may."""
    if ladder.applies is None:
        return ""
    return ladder.applies(Simulation(variants.scene).components[block])


def measure_rungs(
    variants: Variants,
    block: str,
    ladder: Ladder,
    *,
    against: str | None = None,
    repeats: int = 10,
    budgets: Mapping[str, float] | None = None,
    compare: Compare | None = None,
    own: RungRun | None = None,
) -> list[RungCost]:
    """Run the scene with each rung of a ladder; return costs and errors, crude to exact.

    `budgets` are largest allowed errors by unit, else the scene's ``[accuracy]``; `against` is
    another reference than the ladder's own; `compare` returns the changes of the run's results.
    Without `repeats` nothing is timed. `own` is a run of the scene as it is, for its own rung.
    """
    reference = against or ladder.reference
    best = Choice(block, ladder, ladder.rung(reference))
    baselines = {"": _run_variant(variants, [best], block, own=own)}
    costs: list[RungCost] = []
    runs: dict[str, RungRun] = {reference: baselines[""]}
    for rung in ladder.rungs:
        cost = RungCost(block, ladder, rung.name, reference)
        costs.append(cost)
        choice = Choice(block, ladder, rung)
        try:
            if rung.name != reference:
                runs[rung.name] = _run_variant(variants, [choice], block, own=own)
            shared = str(sorted(rung.shared.items())) if rung.shared else ""
            if shared and shared not in baselines:
                baselines[shared] = _run_variant(variants, [best], block, [choice])
        except Unavailable as error:
            runs.pop(rung.name, None)
            cost.unavailable = str(error)
    time_rungs_in_turn(list(runs.values()), repeats)
    known: dict[str, Values] = {}
    for key, baseline in baselines.items():
        known[key] = replay_values(ladder, baseline, baseline)
    targets = max(_count_targets(known[""], ladder), 1)
    for cost, rung in zip(costs, ladder.rungs, strict=True):
        if cost.unavailable:
            continue
        run = runs[rung.name]
        cost.in_scene = _has_block_as_in_scene(run, variants, block)
        scale = 1e6 / max(run.instant_count() * targets, 1)
        median, spread = median_and_half_iqr(run.repeats_s)
        cost.cpu_us_per_target_scan, cost.cpu_spread_us = median * scale, spread * scale
        cost.repeats = len(run.repeats_s)
        if rung.name == reference:
            cost.errors, cost.error_note = errors_against_precise(ladder, run, known[""])
        else:
            key = str(sorted(rung.shared.items())) if rung.shared else ""
            baseline = baselines[key]
            cost.errors = error_spread_by_quantity(
                ladder, replay_values(ladder, run, baseline), known[key]
            )
            if compare is not None:
                cost.effect = compare(baseline.tables, run.tables)
    _mark_front_and_budgets(costs, budgets or {}, variants.tolerance)
    return costs


def _run_variant(
    variants: Variants,
    choices: list[Choice],
    block: str,
    shared: list[Choice] | None = None,
    own: RungRun | None = None,
) -> RungRun:
    """Run the scene with other rungs and return that run; `own` if the scene is the same.

    Whatever keeps it from running makes the rung unavailable.
    """
    try:
        scene = variants.with_rungs(choices, shared or ())
        if own is not None and scene.resolved() == own.scene.resolved():
            return replace(own, passes_s=[])
        return run_rung(scene, block)
    except SceneError as error:
        raise Unavailable("; ".join(problem.message for problem in error.problems)) from error
    except BlockFailure as error:
        if error.block != block:
            raise
        raise Unavailable(error.reason.partition(": ")[2] or error.reason) from error


def _count_targets(values: Values, ladder: Ladder) -> int:
    return int(values[1][ladder.quantities[0].name].shape[1])


def _has_block_as_in_scene(run: RungRun, variants: Variants, block: str) -> bool:
    mine, scenes = run.scene.blocks[block], variants.scene.blocks[block]
    return (
        mine.cls is scenes.cls
        and mine.parameters == scenes.parameters
        and run.scene.sections == variants.scene.sections
    )


def _equalise_tied_costs(costs: list[RungCost]) -> None:
    """Set the CPU costs of rungs within 10 % of each other to their mean; note which are tied."""
    ordered = sorted(costs, key=lambda cost: cost.cpu_us_per_target_scan)
    groups: list[list[RungCost]] = []
    for cost in ordered:
        if groups and cost.cpu_us_per_target_scan < _APART * groups[-1][0].cpu_us_per_target_scan:
            groups[-1].append(cost)
        else:
            groups.append([cost])
    for group in groups:
        common = sum(cost.cpu_us_per_target_scan for cost in group) / len(group)
        for cost in group:
            cost.cpu_us_per_target_scan = common
            cost.tied_with = [other.rung for other in group if other is not cost]


def _mark_front_and_budgets(
    costs: list[RungCost], budgets: Mapping[str, float], tolerance: Mapping[str, float]
) -> None:
    known = [cost for cost in costs if not cost.unavailable]
    _equalise_tied_costs(known)
    # A reference whose own error is unknown is on the front: nothing is known to beat it.
    points = [
        (
            c.cpu_us_per_target_scan,
            0.0 if c.rung == c.reference and not c.errors else c.first_quantity_error.p95,
        )
        for c in known
    ]
    for cost, front in zip(known, flag_points_on_front(points), strict=True):
        cost.pareto = front
        limits = {
            quantity.name: limit
            for quantity in cost.ladder.quantities
            if (limit := allowed_error(quantity, budgets, tolerance)) is not None
        }
        if limits:
            is_reference = cost.rung == cost.reference
            cost.inside_budget = all(
                cost.errors[name].maximum <= limit if name in cost.errors else is_reference
                for name, limit in limits.items()
            )
    inside = [cost for cost in known if cost.inside_budget]
    if inside:
        min(inside, key=lambda cost: cost.cpu_us_per_target_scan).cheapest_inside = True
