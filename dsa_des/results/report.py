"""One self-contained HTML page about a study: what was asked, what came of it, how to repeat it.

It is made of the study's folder and of nothing else, as ``study show`` is: no scene is read and no
code that it names. Pictures stand in the page itself, and it loads nothing.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from dsa_des.results.folder import StudyFolder
from dsa_des.results.labels import short
from dsa_des.results.models import (
    EffectRecord,
    MeasuredErrors,
    SceneRecord,
    read_errors,
    read_explained,
    versions,
)
from dsa_des.results.printing import (
    ANSWER_HEADS,
    RATIO_HEADS,
    answer_cells,
    interval_text,
    ratio_cells,
)
from dsa_des.results.record import run_command
from dsa_des.results.sealed_files import read_regular
from dsa_des.results.summary import one_sided
from dsa_des.results.tables import Tables, cut_off_text
from dsa_des.text.safe_text import printable, shortened

REPORT = "report.html"
_LARGEST_PICTURE = 20 * 2**20
_MOST_PICTURES, _MOST_ROWS, _MOST_PARTS = 60, 5000, 1000
#: Letters of a text.
_LONGEST = 400

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" \
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'"><meta name="viewport" \
content="width=device-width,initial-scale=1"><title>{{ record.title }}</title><style>
:root{color-scheme:light dark;--ink:#1a1a1a;--paper:#fff;--soft:#f3f3f3;--line:#ddd;--note:#555}
@media(prefers-color-scheme:dark){:root{--ink:#e4e4e4;--paper:#16181b;--soft:#24272b;--line:#3a3f45;
--note:#a5abb3}figure img{background:#fff;border-radius:4px}}
body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:75em;padding:0 1em;
color:var(--ink);background:var(--paper);overflow-wrap:break-word}
h1{font-size:1.6em}h2{font-size:1.2em;margin-top:2em;border-bottom:1px solid var(--line)}
h3{font-size:1em;margin:1.2em 0 .2em}
.wide{overflow-x:auto;max-width:100%}table{border-collapse:collapse;margin:.6em 0;
width:max-content}
td,th{padding:.15em .7em;border-bottom:1px solid var(--line);text-align:left;vertical-align:top;
}td{max-width:34em}th{background:var(--soft)}code,pre{background:var(--soft);
font-size:.9em;white-space:pre-wrap;overflow-wrap:anywhere}pre{padding:.5em}figure{margin:1em 0}
img{max-width:100%;height:auto}.note{color:var(--note)}
@media(max-width:45em){body{margin:1em auto;padding:0 .7em}td{max-width:18em}}
@media print{.wide{overflow:visible}}
</style></head><body>
{% macro table(heads, rows) %}{% if rows %}
<div class='wide'><table><tr>{% for head in heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for row in rows %}
<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% endif %}{% endmacro %}
{% macro where(scene, first) %}{% if scene.where %}
<p>{{ "In the first cell" if first else "Otherwise" }}, <code>{{ scene.where }}</code>:</p>
{% endif %}{% endmacro %}
<h1>{{ record.title }}</h1><p class="note">{{ runs }} runs in {{ record.cells }} cells; \
{{ tables.rows.failed }} without result</p>
<h2>What was asked</h2>
{{ table(("", ""), asked) }}{{ table(("axis", "values", ""), axes) }}
{{ table(("result", "kind", "meaning"), results) }}
<h2>The scene</h2><p><code>{{ record.scene }}</code></p>
{{ table(("in every cell", ""), changes) }}
{% if explained and explained.scene %}
<details><summary>The first run's scene, every default written out</summary>\
{{ explained.scene.splitlines() | verbatim }}</details>
{% endif %}
{% if not explained %}
<h2>Models and effects</h2><p>This folder is of a version that kept neither. Which model each \
block uses, with its proven error, and which effects are left out and why:</p>\
<pre>{{ explain }}</pre>
{% else %}
<h2>Models and their errors</h2>
{% for scene in explained.scenes if scene.models %}
{{ where(scene, scene is sameas explained.scenes[0]) }}
{{ table(("block", "model", "what it is", "its place among models of its kind"),
         scene | models) }}
{% endfor %}
{% if bounds %}
<h3>Proven: largest influence</h3>
{{ table(("block", "effect", "largest influence", ""), bounds) }}
{% else %}
<p class='note'>No model was chosen and no effect left out within an allowed error ([accuracy]), \
so there is no bound to prove.</p>
{% endif %}
{% if not errors %}
<p class='note'>Errors of the models were not measured (a study of 100 runs or more does it by \
itself): <code>dsa-des study report FOLDER --measure</code>.</p>
{% else %}
<h3>Measured over the first run</h3>
{{ table(("block", "model", "error of", "mean", "95 %", "largest", "target-scans", "against"),
         errors | measured) }}
{% if errors.notes %}
<p class='note'>Not measured:</p><ul class='note'>\
{% for note in errors.notes %}<li>{{ note }}</li>{% endfor %}</ul>
{% endif %}
{% endif %}
<h2>Effects</h2>
{% for scene in explained.scenes if scene.effects or scene.spared %}
{{ where(scene, scene is sameas explained.scenes[0]) }}
{% for title, simulated in (("Simulated", true), ("Left out, and why", false)) %}
{% set rows = scene.effects | effects(simulated) %}
{% if rows %}<h3>{{ title }}</h3>{{ table(("where", "effect", "because"), rows) }}{% endif %}
{% endfor %}
{% if scene.spared %}
<h3>Work that is spared</h3>{{ table(("block", "what, and why"), scene.spared) }}
{% endif %}
{% endfor %}
{% endif %}
<h2>Results</h2><p class='note'>Cut off: values that the beginning or the end of a run censored; \
the mean holds them.</p>
{{ table(tables.rows.axes + ["result", "value", "interval", "units", "no value", "", "cut off",
                              "expected"], lines) }}
{% if tables.lines | length > most %}
<p>and {{ tables.lines | length - most }} more lines in summary.parquet</p>
{% endif %}
{% if ratios %}
<h2>Ratios of events</h2><p class='note'>Unresolved and induced add up to the ratio. Nominal, \
mitigated, induced: units with the event without and with the remedy, and with it alone. \
Effective size: Kish's, of the weights.</p>
{{ table(tables.rows.axes + ratio_heads, ratios) }}
{% endif %}
{% if answers %}
<h2>Requirements</h2><p class='note'>The cheapest value whose interval, and that of all dearer \
ones, lies within the limit; {{ sure }} sure.</p>
{{ table(answer_heads, answers) }}
{% endif %}
{% if differences %}
<h2>Paired differences</h2>
{{ table(others + [tables.baseline[0], "less", "result", "difference", "interval", "pairs"],
         differences) }}
{% endif %}
{% if pictures %}
<h2>Figures</h2>
{% for stem, name, data in pictures %}
<figure><img alt="{{ stem }}" src="data:image/png;base64,{{ data | plain }}">\
<figcaption>{{ name }}</figcaption></figure>
{% endfor %}
{% endif %}
<h2>Failed and censored runs</h2><p>Runs: {{ status }}. Values cut off by a run's beginning or \
end: {{ censored }}.</p>
{{ table(("cell", "replica", "status", "error", "command"), failed) }}
{% if tables.rows.failed > failed | length %}
<p>and {{ tables.rows.failed - failed | length }} more</p>
{% endif %}
<h2>Seeds, versions and hashes</h2><p>Seed of the study: <code>{{ record.seed }}</code>. Every \
run's own seed is in the column <code>seed</code> of the parts.</p>
{{ table(("package", "when the study was begun", "when this page was made"), packages) }}
{{ table(("", "SHA-256"), hashes) }}
<h2>To repeat it</h2>{{ commands | verbatim }}<p class='note'>Any other run: the same with the \
seed, axes and draws that stand in its row of the parts; rows of failed runs hold it as \
<code>command</code>.</p>
</body></html>
"""


def study_report(folder: StudyFolder) -> bytes:
    """Return the page of a study's folder.

    Raises
    ------
    UsageError
        If the folder holds no results, or damaged ones.
    """
    tables = Tables(folder.record, folder)
    record, stored, first = tables.record, tables.rows.stored, tables.rows.stored.first
    explained = read_explained(folder)
    explain = run_command(record.scene, record.seed, record.swaps, record.sets)
    explain = explain.replace("dsa-des run ", "dsa-des explain ", 1)
    begun, now = explained.versions if explained else {}, versions()
    page = _environment().from_string(_PAGE).render(
        tables=tables, record=record, explained=explained, errors=read_errors(folder),
        explain=explain, most=_MOST_ROWS, runs=len(tables.rows.places) + tables.rows.failed,
        asked=_asked(tables),
        axes=[
            (axis.column, ", ".join(map(str, axis.values[:40])) + ", …" * (len(axis.values) > 40),
             "a sample: its values are independent units" if axis.over else "")
            for axis in record.axes
        ],
        results=[(r.name, r.kind, r.meaning) for r in tables.results],
        changes=[("set", f"{key} = {value}") for key, value in record.sets]
        + [("swap", f"{block} = {name}") for block, name in record.swaps],
        bounds=[
            (e.block, e.effect, ", ".join(f"{q} {short(b)}" for q, b in sorted(e.bound.items())),
             "simulated" if e.simulated else "left out")
            for scene in (explained.scenes if explained else ()) for e in scene.effects if e.bound
        ],
        lines=[
            (*line.at, line.result.name, short(line.estimate.value), interval_text(line.estimate),
             line.estimate.count, line.missing, "few" if line.estimate.few else "",
             cut_off_text(line), "" if line.expected is None else short(line.expected))
            for line in tables.lines[:_MOST_ROWS]
        ],
        ratio_heads=list(RATIO_HEADS), answer_heads=ANSWER_HEADS,
        ratios=[(*map(short, r.at), *ratio_cells(r)) for r in tables.ratios()[:_MOST_ROWS]],
        answers=[answer_cells(tables, answer) for answer in tables.answers[:_MOST_ROWS]],
        sure=f"{100 * one_sided(record.confidence):g} %",
        others=[n for n in tables.rows.axes if tables.baseline and n != tables.baseline[0]],
        differences=[
            (*item.at, item.value, item.baseline, item.result.name,
             short(item.difference.paired.value), interval_text(item.difference.paired),
             item.difference.paired.count)
            for item in tables.compared[:_MOST_ROWS]
        ],
        pictures=_pictures(folder),
        status=", ".join(f"{many} {name}" for name, many in sorted(stored.status.items())),
        censored=sum(many for line in tables.lines for _, many in line.cut_off),
        failed=[
            (row["cell"], row["replica"], row["status"], row["error"], record.command(row))
            for row in stored.failed
        ],
        packages=[(name, begun.get(name, ""), now.get(name, "")) for name in {**begun, **now}],
        hashes=_hashes(folder),
        commands=[
            f"dsa-des study {record.study}",
            f"dsa-des study show {folder.path}",
            f"dsa-des study report {folder.path}",
            explain,
            f"{record.command(first)}    # cell {first['cell']}, replica {first['replica']}",
        ],
    )  # fmt: skip
    return page.encode()


def _environment() -> Environment:
    """Return the language of the page: whatever it is given is shown as text, on one line."""
    environment = Environment(
        autoescape=True, finalize=_text, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters.update(
        verbatim=_verbatim, plain=Markup, models=_models, measured=_measured, effects=_effects
    )
    return environment


def _text(value: Any) -> Markup:
    """Return a value as text of a page, on one line and of bounded length."""
    if isinstance(value, Markup):
        return value
    return Markup(escape(shortened(printable(str(value)), _LONGEST)))


def _verbatim(lines: Iterable[str]) -> Markup:
    """Return lines as they stand."""
    some = list(lines)[:_MOST_ROWS]
    return Markup("<pre>" + "\n".join(escape(printable(line)) for line in some) + "</pre>")


def _asked(tables: Tables) -> list[tuple[str, Any]]:
    record = tables.record
    rows: list[tuple[str, Any]] = [
        ("replicas of each cell", record.replicas),
        ("seed", record.seed),
        ("intervals", f"{100 * record.confidence:g} %, {record.interval}"),
    ]
    if record.compare is not None:
        rows.append(("compared", f"{record.compare[0]}, with {record.compare[1]}"))
    if record.stop_when is not None:
        stop = record.stop_when
        rows.append(("stopped when", f"{stop.metric} is known to ±{stop.half_width:g}"))
    return rows + [("drawn", draw.key) for draw in record.draws]


def _models(scene: SceneRecord) -> list[tuple[str, ...]]:
    return [(m.block, m.type, m.about, "; ".join(m.rungs)) for m in scene.models]


def _measured(errors: MeasuredErrors) -> list[tuple[Any, ...]]:
    return [
        (e.block, f"{e.ladder}: {e.rung}", f"{e.quantity}, {e.unit}", short(e.mean), short(e.p95),
         short(e.largest), e.target_scans,
         # Another model, or for a reference something far better.
         f"its own error, {e.against}" if e.against.startswith("measured") else e.against)
        for e in errors.rows
    ]  # fmt: skip


def _effects(effects: Sequence[EffectRecord], simulated: bool) -> list[tuple[str, str, str]]:
    """Return in which blocks each effect is simulated, or is not, for one reason."""
    together: dict[tuple[str, str], list[str]] = {}
    for e in effects:
        if e.simulated == simulated:
            together.setdefault((e.effect, e.because), []).append(e.block)
    return [(", ".join(blocks), effect, why) for (effect, why), blocks in together.items()]


def _pictures(folder: StudyFolder) -> list[tuple[str, str, str]]:
    """Return stem, name and content of the folder's figures."""
    found = []
    for path in sorted(folder.path.glob("*.png"))[:_MOST_PICTURES]:
        try:
            content = read_regular(path, _LARGEST_PICTURE)
        except OSError:
            continue  # a link, or gone
        found.append((path.stem, path.name, base64.b64encode(content).decode()))
    return found


def _hashes(folder: StudyFolder) -> list[tuple[str, str]]:
    files = [folder.parts / f"{name}.parquet" for name in folder.part_names()[:_MOST_PARTS]]
    hashes = [(file.name, hashlib.sha256(read_regular(file)).hexdigest()) for file in files]
    return [("study, with all that fixes its results", folder.record.study_sha256), *hashes]
