"""One self-contained HTML page about a study: what was asked, what came of it, how to repeat it.

It is made of the study's folder and of nothing else, as ``study show`` is: no scene is read and no
code that it names. Pictures stand in the page itself, and it loads nothing.
"""

import base64
import hashlib
from pathlib import Path
from typing import Any

from dsa_des.studies.cheapest import one_sided
from dsa_des.studies.explained import read_explained, versions
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.labels import short
from dsa_des.studies.measured_errors import read_errors
from dsa_des.studies.output import Tables, cut_off_text
from dsa_des.studies.printing import (
    ANSWER_HEADS,
    RATIO_HEADS,
    answer_cells,
    interval_text,
    ratio_cells,
)
from dsa_des.studies.report_html import page, table, text, verbatim
from dsa_des.studies.report_models import models_part
from dsa_des.studies.safe_files import read_regular
from dsa_des.studies.study import run_command

REPORT = "report.html"
_LARGEST_PICTURE = 20 * 2**20
_MOST_PICTURES, _MOST_ROWS, _MOST_PARTS = 60, 5000, 1000


def study_report(folder: StudyFolder) -> bytes:
    """Return the page of a study's folder.

    Parameters
    ----------
    folder : StudyFolder
        With results.

    Raises
    ------
    UsageError
        If the folder holds no results, or damaged ones.
    """
    tables = Tables(folder.record, folder)
    record = tables.record
    parts = [
        _head(tables),
        _asked(tables),
        _scene(tables, folder),
        models_part(
            read_explained(folder), read_errors(folder), table, text, _explain(tables.record)
        ),
        _results(tables),
        _ratios(tables),
        _requirements(tables),
        _differences(tables),
        _pictures(folder),
        _troubles(tables),
        _origin(folder),
        _repeat(tables, folder),
    ]
    return page(record.title, parts)


def _head(tables: Tables) -> str:
    record = tables.record
    rows = tables.rows
    runs = len(rows.places) + rows.failed
    said = f"{runs} runs in {record.cells} cells; {rows.failed} without result"
    return f'<h1>{text(record.title)}</h1><p class="note">{text(said)}</p>'


def _asked(tables: Tables) -> str:
    record = tables.record
    rows: list[tuple[Any, ...]] = [
        ("replicas of each cell", record.replicas),
        ("seed", record.seed),
        ("intervals", f"{100 * record.confidence:g} %, {record.interval}"),
    ]
    if record.compare is not None:
        rows.append(("compared", f"{record.compare[0]}, with {record.compare[1]}"))
    if record.stop_when is not None:
        stop = record.stop_when
        rows.append(("stopped when", f"{stop.metric} is known to ±{stop.half_width:g}"))
    rows += [("drawn", draw.key) for draw in record.draws]
    axes = [
        (
            axis.column,
            ", ".join(map(str, axis.values[:40])) + (", …" if len(axis.values) > 40 else ""),
            "a sample: its values are independent units" if axis.over else "",
        )
        for axis in record.axes
    ]
    results = [(r.name, r.kind, r.meaning) for r in tables.results]
    return (
        "<h2>What was asked</h2>"
        + table(("", ""), rows)
        + table(("axis", "values", ""), axes)
        + table(("result", "kind", "meaning"), results)
    )


def _scene(tables: Tables, folder: StudyFolder) -> str:
    record = tables.record
    changes = [("set", f"{key} = {value}") for key, value in record.sets]
    changes += [("swap", f"{block} = {name}") for block, name in record.swaps]
    found = read_explained(folder)
    whole = ""
    if found is not None and found.scene:
        whole = (
            "<details><summary>The first run's scene, every default written out</summary>"
            + verbatim(found.scene.splitlines()[:_MOST_ROWS])
            + "</details>"
        )
    return (
        f"<h2>The scene</h2><p><code>{text(record.scene)}</code></p>"
        + table(("in every cell", ""), changes)
        + whole
    )


def _explain(record: Any) -> str:
    words = run_command(record.scene, record.seed, record.swaps, record.sets)
    return words.replace("dsa-des run ", "dsa-des explain ", 1)


def _results(tables: Tables) -> str:
    axes = tables.rows.axes
    rows = [
        (
            *line.at, line.result.name, short(line.estimate.value), interval_text(line.estimate),
            line.estimate.count, line.missing, "few" if line.estimate.few else "",
            cut_off_text(line), "" if line.expected is None else short(line.expected),
        )
        for line in tables.lines[:_MOST_ROWS]
    ]  # fmt: skip
    headings = (
        *axes,
        "result",
        "value",
        "interval",
        "units",
        "no value",
        "",
        "cut off",
        "expected",
    )
    more = len(tables.lines) - _MOST_ROWS
    note = f"<p>and {more} more lines in summary.parquet</p>" if more > 0 else ""
    return (
        "<h2>Results</h2><p class='note'>Cut off: values that the beginning or the end of a run "
        "censored; the mean holds them.</p>" + table(headings, rows) + note
    )


def _ratios(tables: Tables) -> str:
    rows = [(*map(short, line.at), *ratio_cells(line)) for line in tables.ratios()[:_MOST_ROWS]]
    return (
        "<h2>Ratios of events</h2><p class='note'>Unresolved and induced add up to the ratio. "
        "Nominal, mitigated, induced: units with the event without and with the remedy, and with "
        "it alone. Effective size: Kish's, of the weights.</p>"
        + table((*tables.rows.axes, *RATIO_HEADS), rows)
        if rows
        else ""
    )


def _requirements(tables: Tables) -> str:
    if not tables.answers:
        return ""
    rows = [answer_cells(tables, answer) for answer in tables.answers[:_MOST_ROWS]]
    sure = f"{100 * one_sided(tables.record.confidence):g} %"
    return (
        f"<h2>Requirements</h2><p class='note'>The cheapest value whose interval, and that of all "
        f"dearer ones, lies within the limit; {sure} sure.</p>" + table(ANSWER_HEADS, rows)
    )


def _differences(tables: Tables) -> str:
    if not tables.compared or tables.baseline is None:
        return ""
    others = [name for name in tables.rows.axes if name != tables.baseline[0]]
    rows = [
        (
            *item.at, item.value, item.baseline, item.result.name,
            short(item.difference.paired.value), interval_text(item.difference.paired),
            item.difference.paired.count,
        )
        for item in tables.compared[:_MOST_ROWS]
    ]  # fmt: skip
    headings = (*others, tables.baseline[0], "less", "result", "difference", "interval", "pairs")
    return "<h2>Paired differences</h2>" + table(headings, rows)


def _pictures(folder: StudyFolder) -> str:
    found = []
    for path in sorted(folder.path.glob("*.png"))[:_MOST_PICTURES]:
        try:
            content = read_regular(path, _LARGEST_PICTURE)
        except OSError:
            continue  # a link, or gone
        data = base64.b64encode(content).decode()
        found.append(
            f'<figure><img alt="{text(path.stem)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{text(path.name)}</figcaption></figure>"
        )
    return "<h2>Figures</h2>" + "\n".join(found) if found else ""


def _troubles(tables: Tables) -> str:
    stored = tables.rows.stored
    rows = [
        (row["cell"], row["replica"], row["status"], row["error"], tables.record.command(row))
        for row in stored.failed
    ]
    cut = sum(many for line in tables.lines for _, many in line.cut_off)
    said = ", ".join(f"{many} {name}" for name, many in sorted(stored.status.items()))
    more = tables.rows.failed - len(rows)
    return (
        f"<h2>Failed and censored runs</h2><p>Runs: {text(said)}. Values cut off by a run's "
        f"beginning or end: {cut}.</p>"
        + table(("cell", "replica", "status", "error", "command"), rows)
        + (f"<p>and {more} more</p>" if more > 0 else "")
    )


def _origin(folder: StudyFolder) -> str:
    record = folder.record
    found = read_explained(folder)
    now = versions()
    runs = {} if found is None else found.versions
    rows = [(name, runs.get(name, ""), now.get(name, "")) for name in {**runs, **now}]
    hashes = [("study, with all that fixes its results", record.study_sha256)]
    for name in folder.part_names()[:_MOST_PARTS]:
        path: Path = folder.parts / f"{name}.parquet"
        hashes.append((path.name, hashlib.sha256(read_regular(path)).hexdigest()))
    return (
        "<h2>Seeds, versions and hashes</h2>"
        f"<p>Seed of the study: <code>{record.seed}</code>. Every run's own seed is in the column "
        "<code>seed</code> of the parts.</p>"
        + table(("package", "when the study was begun", "when this page was made"), rows)
        + table(("", "SHA-256"), hashes)
    )


def _repeat(tables: Tables, folder: StudyFolder) -> str:
    record = tables.record
    first = tables.rows.stored.first
    commands = [
        f"dsa-des study {record.study}",
        f"dsa-des study show {folder.path}",
        f"dsa-des study report {folder.path}",
        _explain(record),
        f"{record.command(first)}    # cell {first['cell']}, replica {first['replica']}",
    ]
    return (
        f"<h2>To repeat it</h2>{verbatim(commands)}<p class='note'>Any other run: the same "
        "with the seed, axes and draws that stand in its row of the parts; rows of failed runs "
        "hold it as <code>command</code>.</p>"
    )
