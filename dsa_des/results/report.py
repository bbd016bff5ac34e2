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
from dsa_des.results.labels import axis_label, readable, short, value_label
from dsa_des.results.models import (
    EffectRecord,
    MeasuredErrors,
    SceneRecord,
    read_errors,
    read_explained,
    versions,
)
from dsa_des.results.printing import RATIO_HEADS, interval_text, ratio_cells, rounded
from dsa_des.results.record import EVENT, FRACTION, NUMBER, RATIO, run_command
from dsa_des.results.sealed_files import read_regular
from dsa_des.results.summary import Answer, Line, one_sided
from dsa_des.results.tables import Tables, cut_off_text
from dsa_des.text.safe_text import printable, shortened

REPORT = "report.html"
_LARGEST_PICTURE = 20 * 2**20
_MOST_PICTURES, _MOST_ROWS, _MOST_PARTS = 60, 5000, 1000
#: Letters of a text.
_LONGEST = 400
_MOST_SHOWN = 60

#: The beginning of a page that loads nothing, up to its body, and how its tables are written.
PAGE_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" \
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'"><meta name="viewport" \
content="width=device-width,initial-scale=1"><title>{{ title }}</title><style>
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
nav{position:sticky;top:0;background:var(--paper);padding:.4em 0;
border-bottom:1px solid var(--line)}
nav a{margin-right:.8em;color:inherit;display:inline-block;padding:.25em 0}
details{margin:.6em 0}summary{cursor:pointer}
h2{scroll-margin-top:3em}
@media(max-width:45em){body{margin:1em auto;padding:0 .7em}td{max-width:18em}
table{width:auto;font-size:.8em}td,th{padding:.15em .3em}}
@media print{.wide{overflow:visible}}
</style></head><body>
{% macro table(heads, rows) %}{% if rows %}
<div class='wide' tabindex='0'><table>
{% if heads | join %}
<tr>{% for head in heads %}{% if head %}<th scope='col'>{{ head }}</th>{% else %}<td></td>\
{% endif %}{% endfor %}</tr>
{% endif %}
{% for row in rows %}
<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% endif %}{% endmacro %}
"""

_PAGE = (
    PAGE_HEAD
    + """{% macro where(scene, first) %}{% if scene.where %}
<p>{{ "In the first cell" if first else "Otherwise" }}, <code>{{ scene.where }}</code>:</p>
{% endif %}{% endmacro %}
<header><h1>{{ record.title }}</h1><p class="note">{{ runs }} runs in {{ record.cells }} cells; \
{{ tables.rows.failed }} without result; made by dsa_des {{ version }}</p>\
</header>
<nav><a href="#question">Question</a> <a href="#answer">Answer</a>
{% if ratios %} <a href="#risk">Risk</a>{% endif %}
{% if differences %} <a href="#differences">Differences</a>{% endif %}
{% if others_drawn %} <a href="#figures">Figures</a>{% endif %} <a href="#models">Models</a> \
<a href="#effects">Effects</a> <a href="#results">All results</a> <a href="#runs">Runs</a> \
<a href="#repeat">To repeat it</a></nav><main>
<h2 id="question">The question</h2>
{{ table(("axis", "values", ""), axes) }}{{ table(("", ""), asked) }}
<h2 id="answer">The answer</h2>
{% for title, heads, rows in pivots %}
<h3>{{ title }}</h3>{{ table(heads, rows) }}
{% endfor %}
{% if pivots %}
<p class='note'>The cheapest value whose interval, and that of all dearer ones, lies within the \
limit; {{ sure }} sure. "none": not even the dearest does. The value by the estimate alone, which \
is sure of nothing, stands in brackets where it differs.</p>
{% endif %}
{% for stem, name, data in answering %}
<figure><img alt="{{ stem }}" src="data:image/png;base64,{{ data | plain }}">\
<figcaption>{{ name }}</figcaption></figure>
{% endfor %}
{% if shown %}
{{ table(heads, shown) }}
<p class='note'>{{ level }} intervals: {{ methods }}. Rounded to two digits of half an \
interval.{% if few %} "few": too few values to rely on it.{% endif %}</p>
{% endif %}
{% if ratios %}
<h2 id="risk">Ratios of events</h2>{{ table(axis_heads + ratio_heads, ratios) }}
<p class='note'>Unresolved and induced add up to the ratio. Nominal, mitigated, induced: units \
with the event without and with the remedy, and with it alone. Effective size: Kish's, of the \
weights.</p>
{% endif %}
{% if differences %}
<h2 id="differences">Paired differences</h2>
{{ table(others + [tables.baseline[0] | axis, "less", "result", "difference", "interval", "pairs"],
         differences) }}
{% endif %}
{% if others_drawn %}
<h2 id="figures">Further figures</h2>
{% for stem, name, data in others_drawn %}
<figure><img alt="{{ stem }}" src="data:image/png;base64,{{ data | plain }}">\
<figcaption>{{ name }}</figcaption></figure>
{% endfor %}
{% endif %}
{% if not explained %}
<h2 id="models">Models and effects</h2><p id="effects">This folder is of a version that kept \
neither. Which model each block uses, with its proven error, and which effects are left out and \
why:</p><pre>{{ explain }}</pre>
{% else %}
<h2 id="models">Models and their errors</h2>
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
{% if bounds %}
<h3>Proven: largest influence</h3>
{{ table(("block", "effect", "largest influence", ""), bounds) }}
{% else %}
<p class='note'>No model was chosen and no effect left out within an allowed error ([accuracy]), \
so there is no bound to prove.</p>
{% endif %}
<details><summary>The model of each block, and its place among those of its kind</summary>
{% for scene in explained.scenes if scene.models %}
{{ where(scene, scene is sameas explained.scenes[0]) }}
{{ table(("block", "model", "what it is", "its place among models of its kind"),
         scene | models) }}
{% endfor %}
</details>
<h2 id="effects">Effects</h2>
<details><summary>Which are simulated, which are left out, and why</summary>
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
</details>
{% endif %}
<h2 id="results">All results</h2>
<details><summary>{{ tables.lines | length }} values with their intervals</summary>
<p class='note'>Cut off: values that the beginning or the end of a run censored; the mean holds \
them.</p>
{{ table(heads, lines) }}
{% if tables.lines | length > most %}
<p>and {{ tables.lines | length - most }} more lines in summary.parquet</p>
{% endif %}
</details>
<details><summary>What each result means</summary>
{{ table(("result", "kind", "meaning"), results) }}
</details>
<h2>The scene</h2><p><code>{{ record.scene }}</code></p>
{{ table(("in every cell", ""), changes) }}
{% if explained and explained.scene %}
<details><summary>The first run's scene, every default written out</summary>\
{{ explained.scene.splitlines() | verbatim }}</details>
{% endif %}
<h2 id="runs">Failed and censored runs</h2><p>Runs: {{ status }}. Values cut off by a run's \
beginning or end: {{ censored }}.</p>
{{ table(("cell", "replica", "status", "error", "command"), failed) }}
{% if tables.rows.failed > failed | length %}
<p>and {{ tables.rows.failed - failed | length }} more</p>
{% endif %}
<h2>Seeds, versions and hashes</h2><p>Seed of the study: <code>{{ record.seed }}</code>. Every \
run's own seed is in the column <code>seed</code> of the parts.</p>
<details><summary>Packages, and digests of the parts</summary>
{{ table(("package", "when the study was begun", "when this page was made"), packages) }}
{{ table(("", "SHA-256"), hashes) }}
</details>
<h2 id="repeat">To repeat it</h2>{{ commands | verbatim }}<p class='note'>Any other run: the same \
with the seed, axes and draws that stand in its row of the parts; rows of failed runs hold it as \
<code>command</code>.</p>
</main></body></html>
"""
)


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
    pictures = _pictures(folder)
    answering = [one for one in pictures if "map" in one[0] or "requirement" in one[0]]
    answering = answering or pictures[:1]
    page = page_environment().from_string(_PAGE).render(
        title=record.title,
        tables=tables, record=record, explained=explained, errors=read_errors(folder),
        explain=explain, most=_MOST_ROWS, runs=len(tables.rows.places) + tables.rows.failed,
        version=begun.get("dsa_des", now.get("dsa_des", "")), asked=_asked(tables),
        axes=[
            (axis_label(axis.column), ", ".join(map(_value, axis.values[:40]))
             + ", …" * (len(axis.values) > 40),
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
        heads=[*map(axis_label, tables.rows.axes), "result", "value", "interval", "units",
               "no value", "", "cut off", "expected"],
        shown=[_line(line) for line in tables.shown_lines()[:_MOST_SHOWN]],
        lines=[_line(line, exact=True) for line in tables.lines[:_MOST_ROWS]],
        few=any(line.estimate.few for line in tables.lines),
        level=f"{100 * record.confidence:g} %", methods=_methods(tables),
        axis_heads=list(map(axis_label, tables.rows.axes)),
        ratio_heads=list(RATIO_HEADS), pivots=_pivots(tables),
        ratios=[(*map(_value, r.at), *ratio_cells(r)) for r in tables.ratios()[:_MOST_ROWS]],
        sure=f"{100 * one_sided(record.confidence):g} %",
        others=[axis_label(n) for n in tables.rows.axes
                if tables.baseline and n != tables.baseline[0]],
        differences=[
            (*map(_value, item.at), _value(item.value), _value(item.baseline),
             readable(item.result.name), *rounded(item.difference.paired),
             item.difference.paired.count)
            for item in tables.compared[:_MOST_ROWS]
            if item.result in {line.result for line in tables.shown_lines()}
        ],
        answering=answering, others_drawn=[one for one in pictures if one not in answering],
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


def page_environment() -> Environment:
    """Return the language of the page: whatever it is given is shown as text, on one line."""
    environment = Environment(
        autoescape=True, finalize=_text, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters.update(
        verbatim=_verbatim,
        plain=Markup,
        axis=axis_label,
        models=_models,
        measured=_measured,
        effects=_effects,
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


def _line(line: Line, exact: bool = False) -> tuple[Any, ...]:
    """Return one line of the summary as the cells of a row: rounded, or with the table's name."""
    e = line.estimate
    said = (readable(line.result.name), *rounded(e))
    if exact:
        said = (line.result.name, short(e.value), interval_text(e))
    return (
        *map(_value, line.at), *said, e.count, line.missing, "few" if e.few else "",
        cut_off_text(line), "" if line.expected is None else short(line.expected),
    )  # fmt: skip


def _value(value: Any) -> str:
    return short(value) if isinstance(value, float) else str(value)


def _methods(tables: Tables) -> str:
    """Return which interval belongs to which kind of result."""
    kinds = {line.result.kind for line in tables.lines}
    means = "studentised bootstrap" if tables.record.interval == "bootstrap" else "Student's t"
    known = {EVENT: "shares by Wilson's score", FRACTION: "fractions by Wilson's score",
             NUMBER: f"means by {means}"}  # fmt: skip
    known[RATIO] = "ratios of events by a gamma interval or by drawing units again, as they say"
    found = [text for kind, text in known.items() if kind in kinds]
    if any(line.result.quantile is not None for line in tables.lines):
        found.append("quantiles by order statistics")
    return ", ".join(found)


def _pivots(tables: Tables) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return a table for each requirement, with the values of the last other axis side by side."""
    found = []
    for requirement in tables.record.requirements:
        mine = [one for one in tables.answers if one.requirement == requirement][:_MOST_ROWS]
        if not mine:
            continue
        others = [name for name in tables.rows.axes if name != requirement.axis]
        title = f"{axis_label(requirement.axis)} for {requirement.text()}"
        if not others:
            found.append((title, ["cheapest"], [[_cheapest(mine[0])]]))
            continue
        columns = list(dict.fromkeys(one.at[-1] for one in mine))
        rows: dict[tuple[Any, ...], dict[Any, str]] = {}
        for one in mine:
            rows.setdefault(one.at[:-1], {})[one.at[-1]] = _cheapest(one)
        heads = [axis_label(name) for name in others[:-1]]
        heads += [value_label(others[-1], column) for column in columns]
        found.append((title, heads, [
            [*map(_value, at), *(cells.get(column, "") for column in columns)]
            for at, cells in rows.items()
        ]))  # fmt: skip
    return found


def _cheapest(answer: Answer) -> str:
    """Return the cheapest value that meets a requirement, and the one by the estimate alone."""
    sure = "none" if answer.value is None else _value(answer.value)
    alone = "none" if answer.estimated is None else _value(answer.estimated)
    notes = [f"({alone})"] if alone != sure else []
    notes += ["few"] if answer.line.estimate.few else []
    notes += ["uneven"] if answer.uneven else []
    return " ".join([sure, *notes])


def _asked(tables: Tables) -> list[tuple[str, Any]]:
    record = tables.record
    rows: list[tuple[str, Any]] = [
        ("replicas of each cell", record.replicas),
        ("seed", record.seed),
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
