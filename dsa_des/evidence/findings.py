"""The verdicts of a case by requirement, with their confidence."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.evidence.case import (
    AS_STATED,
    ASSESSED,
    CHANGED,
    SENSITIVITY,
    CaseRequirement,
    EvidenceCase,
    format_case_value,
)
from dsa_des.results.record import Result
from dsa_des.results.statistics import Estimate
from dsa_des.results.summary import Line
from dsa_des.results.tables import Tables

#: What a requirement came to.
MET, NOT_MET, NOT_SHOWN, NOT_KNOWN = "met", "not met", "not shown", "not converged"
# Counts of units at which the running estimate is taken: on the way, and over the last stretch.
_ON_THE_WAY, _AT_THE_END = 16, 25


@dataclass(frozen=True)
class Convergence:
    """A running estimate over the number of units."""

    counts: list[int]
    #: With as many units.
    estimates: list[Estimate]
    #: Units from which on the rule counts.
    last_from: int
    #: Largest distance from the final estimate since, and what the rule allows.
    moved: float
    allowed: float

    @property
    def is_converged(self) -> bool:
        """Whether the estimate moved no more than the rule allows over the last encounters."""
        return self.moved <= self.allowed


@dataclass(frozen=True)
class Finding:
    """A requirement with the estimate of its result and whether that estimate has converged."""

    requirement: CaseRequirement
    line: Line
    convergence: Convergence

    @property
    def verdict(self) -> str:
        """One of ``met``, ``not met``, ``not shown`` (the interval contains the limit), or not
        known (not converged, or without an interval).
        """
        e, asked = self.line.estimate, self.requirement
        if not self.convergence.is_converged or math.isnan(e.low) or math.isnan(e.high):
            return NOT_KNOWN
        if asked.is_met(e.low, e.high):
            return MET
        far = e.low if asked.most is not None else e.high
        return NOT_SHOWN if asked.is_met(far, far) else NOT_MET


@dataclass(frozen=True)
class ParameterChange:
    """The change of a result with another value of one parameter, paired run by run."""

    key: str
    unit: str
    stated: str
    value: str
    result: str
    difference: Estimate
    #: Size of the difference in limits of the requirement.
    in_limits: float


def findings_of(case: EvidenceCase, tables: Mapping[str, Tables]) -> list[Finding]:
    """Return the finding for every requirement."""
    findings = []
    for one in case.tables.requirements:
        mine = tables[one.study]
        (line,) = [line for line in mine.lines if line.result.name == one.result]
        result = case.results[one.study][one.result]
        findings.append(Finding(one, line, convergence_of(case, mine, result, one)))
    return findings


def convergence_of(
    case: EvidenceCase, tables: Tables, result: Result, asked: CaseRequirement
) -> Convergence:
    """Return a result's estimates for growing replica numbers, and how far the last ones moved."""
    rule, rows, record = case.tables.convergence, tables.rows, tables.record
    ((_, chosen),) = list(rows.row_indices_by_axis_values())
    counts, start = unit_counts_and_settling_start(len(chosen), rule.over_last)

    def estimate(many: int) -> Estimate:
        some: IntArray = chosen[:many]
        return rows.estimate(result, some, record.confidence, "t")[0]

    estimates = [estimate(many) for many in counts]
    final = estimates[-1].value
    last = [e.value for many, e in zip(counts, estimates, strict=True) if many >= start]
    apart = np.abs(np.array(last) - final)
    moved = math.inf if np.isnan(apart).any() else float(apart.max())
    whole = abs(final) if rule.of == "estimate" else abs(asked.limit)
    return Convergence(counts, estimates, start, moved, rule.share * whole)


def unit_counts_and_settling_start(units: int, over_last: float) -> tuple[list[int], int]:
    """Return ascending unit counts to estimate from, and that from which they must stay settled.

    The way there is spaced evenly in the logarithm, the last stretch evenly.
    """
    start = max(1, math.ceil(units * (1.0 - over_last)))
    way = np.geomspace(min(20, start), start, _ON_THE_WAY)
    end = np.linspace(start, units, _AT_THE_END)
    counts = sorted({round(float(n)) for n in (*way, *end)})
    return counts, start


def parameter_changes_of(case: EvidenceCase, tables: Mapping[str, Tables]) -> list[ParameterChange]:
    """Return all parameter changes' effects on required results, the strongest parameter first."""
    if SENSITIVITY not in tables:
        return []
    mine = tables[SENSITIVITY]
    asked = {one.result: one for one in case.tables.requirements if one.study == ASSESSED}
    labels = {label: (key, value) for key, value, label in case.sensitivity}
    stated = _stated_values(case)
    changes = []
    for item in mine.compared:
        if item.result.name not in asked or item.value not in labels:
            continue
        key, _ = labels[item.value]
        difference = item.difference.paired
        changes.append(
            ParameterChange(
                key.key, key.unit, stated[key.key], str(item.value).partition(" = ")[2],
                item.result.name, difference,
                abs(difference.value) / abs(asked[item.result.name].limit or 1.0),
            )
        )  # fmt: skip
    largest: dict[str, float] = {}
    for one in changes:
        size = 0.0 if math.isnan(one.in_limits) else one.in_limits
        largest[one.key] = max(largest.get(one.key, 0.0), size)
    return sorted(changes, key=lambda one: -largest[one.key])


def _stated_values(case: EvidenceCase) -> dict[str, str]:
    """Return key → stated value, as text, of every parameter that the sensitivity study changes."""
    study = case.studies[SENSITIVITY]
    (axis,) = [axis for axis in study.axes if axis.key == CHANGED]
    index = axis.labels.index(AS_STATED)
    return {key: format_case_value(value) for key, value in axis.sets[index]}


def verdict_line(findings: Sequence[Finding]) -> str:
    """Return the verdict as text: what is not known, if any; else what fails, then what passes."""
    by: dict[str, list[Finding]] = {}
    for one in findings:
        by.setdefault(one.verdict, []).append(one)
    if NOT_KNOWN in by:
        return (
            "No verdict: " + "; ".join(_reason_for_no_verdict(one) for one in by[NOT_KNOWN]) + "."
        )
    parts = []
    if fails := [*by.get(NOT_MET, []), *by.get(NOT_SHOWN, [])]:
        parts.append("Does not pass: " + "; ".join(map(_describe_finding, fails)) + ".")
    if passes := by.get(MET, []):
        parts.append("Passes: " + "; ".join(map(_describe_finding, passes)) + ".")
    return " ".join(parts)


def _describe_finding(one: Finding) -> str:
    e, asked = one.line.estimate, one.requirement
    shown = ", not shown: the interval holds the limit" if one.verdict == NOT_SHOWN else ""
    interval = f"{e.value:.3g} ({e.low:.3g} to {e.high:.3g})"
    return f"{asked.name} {interval}, asked {asked.describe_limit()}{shown}"


def _reason_for_no_verdict(one: Finding) -> str:
    c, asked = one.convergence, one.requirement
    if math.isnan(one.line.estimate.value):
        ratio = one.line.ratio
        why = f": {ratio.reason}" if ratio is not None and ratio.reason else ""
        return f"{asked.name} has no estimate after {c.counts[-1]:,} encounters{why}"
    if not c.is_converged:
        return (
            f"{asked.name} has not converged: over the encounters from {c.last_from:,} to "
            f"{c.counts[-1]:,} it moved by up to {c.moved:.2g}, {c.allowed:.2g} is allowed; more "
            "encounters are needed"
        )
    return f"{asked.name} has an estimate without an interval"


def result_line_as_dict(line: Line) -> dict[str, Any]:
    """Return all numbers of a result's line as a dict, in the form of ``evidence.json``."""
    e = line.estimate
    numbers: dict[str, Any] = {
        "result": line.result.name, "meaning": line.result.meaning, "value": e.value, "low": e.low,
        "high": e.high, "count": e.count, "without_value": line.missing, "few": e.few,
    }  # fmt: skip
    if (ratio := line.ratio) is not None:
        numbers |= {
            "unresolved": ratio.unresolved, "induced": ratio.induced,
            "encounters": ratio.encounters, "nominal_events": ratio.nominal_events,
            "mitigated_events": ratio.mitigated_events, "induced_events": ratio.induced_events,
            "effective_sample_size": ratio.effective_sample_size, "interval": ratio.method,
        }  # fmt: skip
        if line.other is not None:
            numbers["other_interval"] = [line.other.method, *line.other.interval]
    return numbers
