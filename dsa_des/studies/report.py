"""One self-contained HTML page about a study: what was asked, what came of it, how to repeat it.

It is made of the study's folder and of nothing else, as ``study show`` is: no scene is read and no
code that it names. Pictures stand in the page itself, and it loads nothing.
"""

import base64
import hashlib
import platform
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dsa_des.record.version import __version__
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.labels import short
from dsa_des.studies.output import Tables, cut_off_text
from dsa_des.studies.printing import interval_text
from dsa_des.studies.safe_files import read_regular
from dsa_des.studies.study import run_command
from dsa_des.text.safe_text import printable, shortened

REPORT = "report.html"
_PACKAGES = ("numpy", "scipy", "pyarrow", "simpy", "networkx", "pydantic")
_LARGEST_PICTURE = 20 * 2**20
_MOST_PICTURES, _MOST_RUNS, _MOST_ROWS, _MOST_PARTS = 60, 50, 5000, 1000
_LONGEST = 400
_STYLE = """
body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em;color:#1a1a1a}
h1{font-size:1.6em}h2{font-size:1.2em;margin-top:2em;border-bottom:1px solid #ccc}
table{border-collapse:collapse;margin:.6em 0}td,th{padding:.15em .7em;border-bottom:1px solid #ddd;
text-align:left;vertical-align:top}th{background:#f3f3f3}code,pre{background:#f3f3f3;
font-size:.9em;white-space:pre-wrap;word-break:break-word}img{max-width:100%}.note{color:#555}
"""


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
        _scene(tables),
        _results(tables),
        _differences(tables),
        _pictures(folder),
        _troubles(tables, folder),
        _origin(folder),
        _repeat(tables, folder),
    ]
    title = _text(record.title)
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "img-src data:; style-src 'unsafe-inline'\">"
        f"<title>{title}</title><style>{_STYLE}</style></head><body>\n"
    )
    return (page + "\n".join(filter(None, parts)) + "\n</body></html>\n").encode()


def _text(value: Any) -> str:
    return escape(shortened(printable(str(value)), _LONGEST))


def _table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    def line(cells: Sequence[Any], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{_text(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "\n".join(line(row, "td") for row in rows)
    return f"<table>{line(headings, 'th')}\n{body}</table>" if body else ""


def _head(tables: Tables) -> str:
    record = tables.record
    rows = tables.rows
    runs = len(rows.places) + rows.failed
    said = f"{runs} runs in {record.cells} cells; {rows.failed} without result"
    return f'<h1>{_text(record.title)}</h1><p class="note">{_text(said)}</p>'


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
        + _table(("", ""), rows)
        + _table(("axis", "values", ""), axes)
        + _table(("result", "kind", "meaning"), results)
    )


def _scene(tables: Tables) -> str:
    record = tables.record
    changes = [("set", f"{key} = {value}") for key, value in record.sets]
    changes += [("swap", f"{block} = {name}") for block, name in record.swaps]
    command = _explain(record)
    return (
        f"<h2>The scene</h2><p><code>{_text(record.scene)}</code></p>"
        + _table(("in every cell", ""), changes)
        + "<p>The page is made of the results alone. Which model each block uses, with its proven "
        f"error, and which effects are left out and why:</p><pre>{_text(command)}</pre>"
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
        "censored; the mean holds them.</p>" + _table(headings, rows) + note
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
    return "<h2>Paired differences</h2>" + _table(headings, rows)


def _pictures(folder: StudyFolder) -> str:
    found = []
    for path in sorted(folder.path.glob("*.png"))[:_MOST_PICTURES]:
        try:
            content = read_regular(path, _LARGEST_PICTURE)
        except OSError:
            continue  # a link, or gone
        data = base64.b64encode(content).decode()
        found.append(
            f'<figure><img alt="{_text(path.stem)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{_text(path.name)}</figcaption></figure>"
        )
    return "<h2>Figures</h2>" + "\n".join(found) if found else ""


def _troubles(tables: Tables, folder: StudyFolder) -> str:
    table = folder.results()
    status = Counter(table["status"].to_pylist())
    rows = [
        (row["cell"], row["replica"], row["status"], row["error"], tables.record.command(row))
        for row in table.filter(table["error"].is_valid()).slice(0, _MOST_RUNS).to_pylist()
    ]
    cut = sum(many for line in tables.lines for _, many in line.cut_off)
    said = ", ".join(f"{many} {name}" for name, many in sorted(status.items()))
    more = tables.rows.failed - len(rows)
    return (
        f"<h2>Failed and censored runs</h2><p>Runs: {_text(said)}. Values cut off by a run's "
        f"beginning or end: {cut}.</p>"
        + _table(("cell", "replica", "status", "error", "command"), rows)
        + (f"<p>and {more} more</p>" if more > 0 else "")
    )


def _origin(folder: StudyFolder) -> str:
    record = folder.record
    rows = [("dsa_des (this page)", __version__), ("Python", platform.python_version())]
    for name in _PACKAGES:
        try:
            rows.append((name, version(name)))
        except PackageNotFoundError:
            continue
    hashes = [("study, with all that fixes its results", record.study_sha256)]
    for name in folder.part_names()[:_MOST_PARTS]:
        path: Path = folder.parts / f"{name}.parquet"
        hashes.append((path.name, hashlib.sha256(read_regular(path)).hexdigest()))
    return (
        "<h2>Versions and hashes</h2>"
        + _table(("package", "version"), rows)
        + _table(("", "SHA-256"), hashes)
    )


def _repeat(tables: Tables, folder: StudyFolder) -> str:
    record = tables.record
    first = folder.results().slice(0, 1).to_pylist()[0]
    lines = [
        f"dsa-des study {record.study}",
        f"dsa-des study show {folder.path}",
        f"{record.command(first)}    # cell {first['cell']}, replica {first['replica']}",
    ]
    shown = "\n".join(escape(printable(line)) for line in lines)
    return (
        f"<h2>To repeat it</h2><pre>{shown}</pre><p class='note'>The column <code>command</code> "
        "of the parts repeats each single run.</p>"
    )
