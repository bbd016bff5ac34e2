"""``dsa-des encounters risk``: the risk ratio of a table of paired encounters."""

import math
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from components.encounters.table_file import EncounterTable, kept_rows, numbers, read_table
from components.metrics.risk import RiskRatio, risk_ratio, risk_ratios_by_class
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.errors import UsageError
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import console, say, say_json

_CLASSES = 200


def show_risk(
    table: str,
    nominal: str,
    mitigated: str,
    weight: str | None,
    cluster: str | None,
    by: str | None,
    edges: str | None,
    confidence: float,
    method: str,
    resamples: int,
    seed: int,
    skip_damaged: bool,
    as_json: bool,
) -> None:
    """Print the risk ratio of a table, and one per class where that is asked for.

    Raises
    ------
    UsageError
        If the table, a row or a column cannot be used, or nothing can be said of it.
    """
    if edges is not None and by is None:
        raise UsageError("--edges belongs to --by COLUMN: which column has these edges?")
    content = read_table(table)
    n, wrong_n = numbers(content, nominal, "--nominal", flag=True)
    m, wrong_m = numbers(content, mitigated, "--mitigated", flag=True)
    w, wrong_w = np.ones(len(n)), dict[int, str]()
    if weight is not None:
        w, wrong_w = numbers(content, weight, "--weight", flag=False)
    together = None
    if cluster is not None:
        together = np.array([str(cell) for cell in content.column(cluster, "--cluster")])
    labels, wrong_by = _labels(content, by, edges)
    kept = kept_rows(content, [wrong_n, wrong_m, wrong_w, wrong_by], skip_damaged)
    n, m, w, labels = n[kept], m[kept], w[kept], labels[kept]
    together = None if together is None else together[kept]
    options: dict[str, Any] = {
        "confidence": confidence, "method": method, "resamples": resamples, "seed": seed,
    }  # fmt: skip
    whole = risk_ratio(n, m, w, cluster=together, **options)
    if whole.reason:
        raise UsageError(f"{content.path}: there is no risk ratio: {whole.reason}")
    classes = {}
    if by is not None:
        classes = risk_ratios_by_class(n, m, w, labels, together, **options)
    skipped = int((~kept).sum())
    if as_json:
        found: dict[str, Any] = {"skipped": skipped, "confidence": confidence, **asdict(whole)}
        if by is not None:
            found["classes"] = {name: asdict(one) for name, one in classes.items()}
        say_json(found)
        return
    for line in _told(whole, confidence, skipped):
        say(line)
    if by is not None:
        _show_classes(by, classes, confidence)


def _labels(
    content: EncounterTable, by: str | None, edges: str | None
) -> tuple[AnyArray, dict[int, str]]:
    """Return the class of every row, and what is wrong with single ones."""
    if by is None:
        return np.zeros(len(content.lines), dtype=np.int64), {}
    if edges is None:
        each = [content.column(name.strip(), "--by") for name in by.split(",")]
        labels = np.array(
            [", ".join("" if cell is None else str(cell) for cell in row)
             for row in zip(*each, strict=True)]
        )  # fmt: skip
        if len(np.unique(labels)) > _CLASSES:
            raise UsageError(
                f"{content.path}: --by {by}: has more than {_CLASSES} values; give the edges of "
                "classes, --edges A,B,..."
            )
        return labels, {}
    bounds = _edges(edges)
    cells = content.column(by, "--by")
    values, wrong = np.full(len(cells), np.nan), {}
    for row, cell in enumerate(cells):
        try:
            values[row] = float(cell)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            wrong[row] = f"{by} is no number"
    # Numbered, so that classes stand in the order of their edges.
    inner = (f"{low:g} to {high:g}" for low, high in pairwise(bounds))
    names = [f"below {bounds[0]:g}", *inner, f"{bounds[-1]:g} and above"]
    place = np.searchsorted(bounds, np.nan_to_num(values), side="right")
    width = len(str(len(names)))
    return np.array([f"{k + 1:0{width}d}: {name}" for k, name in enumerate(names)])[place], wrong


def _edges(text: str) -> FloatArray:
    try:
        bounds = np.array([float(part) for part in text.split(",")])
    except ValueError:
        bounds = np.array([math.nan])
    if not np.isfinite(bounds).all() or (np.diff(bounds) <= 0).any():
        raise UsageError(f"--edges {text}: must be rising numbers with commas between them")
    return bounds


def _told(found: RiskRatio, confidence: float, skipped: int) -> list[str]:
    low, high = found.interval
    alone = found.clusters == found.encounters
    clusters = "" if alone else f" in {found.clusters} clusters"
    lines = [
        f"{found.encounters} encounters{clusters}, {found.nominal_events} with the event "
        f"nominally, {found.mitigated_events} mitigated ({found.induced_events} of them induced)",
        f"probability nominal     {found.nominal_probability:.15g}",
        f"probability mitigated   {found.mitigated_probability:.15g}",
        f"risk ratio              {found.ratio:.15g}",
        f"  unresolved            {found.unresolved:.15g}",
        f"  induced               {found.induced:.15g}",
        f"standard error          {found.standard_error:.8g} ({found.method}, paired)",
        f"  nominal taken as known  {found.unpaired_error:.8g}",
        f"{100 * confidence:g} % interval           {low:.6g} to {high:.6g}",
        f"effective sample size   {found.effective_sample_size:.2f}",
    ]
    if found.few:
        lines.append("few: fewer than 20 mitigated events, in effect, carry the interval")
    if skipped:
        lines.append(f"{skipped} damaged encounters were skipped")
    return lines


def _show_classes(by: str, classes: dict[str, RiskRatio], confidence: float) -> None:
    rows = []
    for name, one in classes.items():
        told = [name or "(none)", str(one.encounters), str(one.nominal_events)]
        told.append(str(one.mitigated_events))
        if one.reason:
            rows.append([*told, "-", "-", "-", "-", one.reason])
            continue
        low, high = one.interval
        values = (one.ratio, one.unresolved, one.induced)
        interval = f"{low:.4g} to {high:.4g}"
        rows.append([*told, *(f"{v:.4g}" for v in values), interval, "few" if one.few else ""])
    headings = [by, "encounters", "nominal", "mitigated", "ratio", "unresolved", "induced",
                f"{100 * confidence:g} % interval", "note"]  # fmt: skip
    print_table(console(), "", headings, rows, right=range(1, 7), below=8)
