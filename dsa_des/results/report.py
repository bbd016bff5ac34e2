"""One self-contained HTML page about a study: what was asked, what came of it, how to repeat it.

It is made of the study's folder and of nothing else, as ``study show`` is: no scene is read and no
code that it names. Pictures stand in the page itself, and it loads nothing.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from dsa_des.files.sealed_files import read_regular_file
from dsa_des.record.failure_counts import failure_sentences
from dsa_des.results.folder import StudyFolder
from dsa_des.results.labels import AxisName, axis_label, readable_label, short_text, value_label
from dsa_des.results.models import (
    EffectRecord,
    MeasuredErrors,
    SceneRecord,
    package_versions,
    read_explained,
    read_model_errors,
)
from dsa_des.results.printing import (
    RATIO_HEADS,
    interval_text,
    ratio_cells,
    rounded_value_and_interval,
)
from dsa_des.results.record import EVENT, FRACTION, NUMBER, RATIO
from dsa_des.results.summary import Answer, Line, one_sided_confidence
from dsa_des.results.tables import Tables, cut_off_text
from dsa_des.text.run_commands import shell_command_of_run
from dsa_des.text.safe_text import escape_unprintable, shorten

REPORT = "report.html"
_LARGEST_PICTURE = 20 * 2**20
_MOST_PICTURES, _MOST_ROWS, _MOST_PARTS = 60, 5000, 1000
#: Letters of a text.
_LONGEST = 400
_MOST_SHOWN = 60


def read_page_template(name: str) -> str:
    """Return the text of one of the report's HTML template files."""
    return (files("dsa_des.results") / "page" / name).read_text(encoding="utf-8")


#: The beginning of a page that loads nothing, up to its body, and how its tables are written.
PAGE_HEAD = read_page_template("head.html")


def study_report(folder: StudyFolder) -> bytes:
    """Return the HTML report of a study's folder, encoded as UTF-8."""
    tables = Tables(folder.record, folder)
    record, stored, first = tables.record, tables.rows.stored, tables.rows.stored.first
    explained = read_explained(folder)
    explain = shell_command_of_run(record.scene, record.seed, record.swaps, record.sets)
    explain = explain.replace("dsa-des run ", "dsa-des explain ", 1)
    begun, now = explained.versions if explained else {}, package_versions()
    pictures = _base64_png_figures(folder)
    answering = [one for one in pictures if "map" in one[0] or "requirement" in one[0]]
    answering = answering or pictures[:1]
    template = PAGE_HEAD + read_page_template("study.html")
    page = report_jinja_environment().from_string(template).render(
        title=record.title,
        tables=tables, record=record, explained=explained, errors=read_model_errors(folder),
        explain=explain, most=_MOST_ROWS, runs=len(tables.rows.places) + tables.rows.failed,
        version=begun.get("dsa_des", now.get("dsa_des", "")), asked=_study_settings_rows(tables),
        axes=[
            (axis_label(AxisName(axis.column, axis.words)), ", ".join(map(_value_text,
            axis.values[:40]))
             + ", …" * (len(axis.values) > 40),
             "a sample: its values are independent units" if axis.over else "")
            for axis in record.axes
        ],
        results=[(r.name, r.kind, r.meaning) for r in tables.results],
        changes=[("set", f"{key} = {value}") for key, value in record.sets]
        + [("swap", f"{block} = {name}") for block, name in record.swaps],
        bounds=[
            (e.block, e.effect, ", ".join(f"{q} {short_text(b)}" for q,
            b in sorted(e.bound.items())),
             "simulated" if e.simulated else "left out")
            for scene in (explained.scenes if explained else ()) for e in scene.effects if e.bound
        ],
        heads=[*map(axis_label, tables.rows.axes), "result", "value", "interval", "units",
               "no value", "note", "cut off", "expected"],
        shown=[_summary_cells(line) for line in tables.shown_lines()[:_MOST_SHOWN]],
        lines=[_summary_cells(line, exact=True) for line in tables.lines[:_MOST_ROWS]],
        few=any(line.estimate.few for line in tables.lines),
        level=f"{100 * record.confidence:g} %", methods=_interval_methods_text(tables),
        axis_heads=list(map(axis_label, tables.rows.axes)),
        ratio_heads=list(RATIO_HEADS), pivots=_requirement_tables(tables),
        ratios=[(*map(_value_text, r.at),
        *ratio_cells(r)) for r in tables.ratio_lines()[:_MOST_ROWS]],
        sure=f"{100 * one_sided_confidence(record.confidence):g} %",
        others=[axis_label(n) for n in tables.rows.axes
                if tables.baseline and n != tables.baseline[0]],
        differences=[
            (*map(_value_text, item.at), _value_text(item.value), _value_text(item.baseline),
             readable_label(item.result.name), *rounded_value_and_interval(item.difference.paired),
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
        undone=failure_sentences(folder.failure_counts()),
        packages=[(name, begun.get(name, ""), now.get(name, "")) for name in {**begun, **now}],
        hashes=_labelled_sha256_hashes(folder),
        commands=[
            record.repeat or f"dsa-des study {record.study}",
            f"dsa-des study show {folder.path}",
            f"dsa-des study report {folder.path}",
            explain,
            f"{record.command(first)}    # cell {first['cell']}, replica {first['replica']}",
        ],
    )  # fmt: skip
    return page.encode()


def report_jinja_environment() -> Environment:
    """Return the Jinja environment of reports, which escapes values and shows each on one line."""
    environment = Environment(
        autoescape=True, finalize=_escaped_text, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters.update(
        verbatim=_preformatted_lines,
        filled=_drop_empty_columns,
        plain=Markup,
        axis=axis_label,
        models=_model_rows,
        measured=_error_rows,
        effects=_effect_rows,
    )
    return environment


def _escaped_text(value: Any) -> Markup:
    """Return a value as text of a page, on one line and of bounded length."""
    if isinstance(value, Markup):
        return value
    return Markup(escape(shorten(escape_unprintable(str(value)), _LONGEST)))


def _drop_empty_columns(
    table: tuple[Iterable[Any], Iterable[Any]],
) -> tuple[list[Any], list[list[Any]]]:
    """Return (headings, rows) of a table without the columns whose cells are all empty."""
    heads, rows = list(table[0]), [list(row) for row in table[1]]
    kept = [k for k in range(len(heads)) if any(str(row[k]) for row in rows)]
    return [heads[k] for k in kept], [[row[k] for k in kept] for row in rows]


def _preformatted_lines(lines: Iterable[str]) -> Markup:
    """Return lines, escaped, as an HTML ``pre`` element."""
    some = list(lines)[:_MOST_ROWS]
    return Markup("<pre>" + "\n".join(escape(escape_unprintable(line)) for line in some) + "</pre>")


def _summary_cells(line: Line, exact: bool = False) -> tuple[Any, ...]:
    """Return label and values rounded to the interval, or if `exact`, name and five digits."""
    e = line.estimate
    said = (readable_label(line.result.name), *rounded_value_and_interval(e))
    if exact:
        said = (line.result.name, short_text(e.value), interval_text(e))
    return (
        *map(_value_text, line.at), *said, e.count, line.missing, "few" if e.few else "",
        cut_off_text(line), "" if line.expected is None else short_text(line.expected),
    )  # fmt: skip


def _value_text(value: Any) -> str:
    return short_text(value) if isinstance(value, float) else str(value)


def _interval_methods_text(tables: Tables) -> str:
    """Return a text that says which interval method each kind of result in the tables has."""
    kinds = {line.result.kind for line in tables.lines}
    means = "studentised bootstrap" if tables.record.interval == "bootstrap" else "Student's t"
    known = {EVENT: "shares by Wilson's score", FRACTION: "fractions by Wilson's score",
             NUMBER: f"means by {means}"}  # fmt: skip
    known[RATIO] = "ratios of events by a gamma interval or by drawing units again, as they say"
    methods = [text for kind, text in known.items() if kind in kinds]
    if any(line.result.quantile is not None for line in tables.lines):
        methods.append("quantiles by order statistics")
    return ", ".join(methods)


def _requirement_tables(tables: Tables) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return (title, headings, rows) for each requirement, with one column for each value of the
    last of the axes other than the one that is searched.
    """
    pivots = []
    for requirement in tables.record.requirements:
        mine = [one for one in tables.answers if one.requirement == requirement][:_MOST_ROWS]
        if not mine:
            continue
        others = [name for name in tables.rows.axes if name != requirement.axis]
        along = tables.rows.axes[tables.rows.axes.index(requirement.axis)]
        title = f"{axis_label(along)} for {requirement.text()}"
        if not others:
            pivots.append((title, ["cheapest"], [[_cheapest_value_text(mine[0])]]))
            continue
        columns = list(dict.fromkeys(one.at[-1] for one in mine))
        rows: dict[tuple[Any, ...], dict[Any, str]] = {}
        for one in mine:
            rows.setdefault(one.at[:-1], {})[one.at[-1]] = _cheapest_value_text(one)
        heads = [axis_label(name) for name in others[:-1]]
        heads += [value_label(others[-1], column) for column in columns]
        pivots.append((title, heads, [
            [*map(_value_text, at), *(cells.get(column, "") for column in columns)]
            for at, cells in rows.items()
        ]))  # fmt: skip
    return pivots


def _cheapest_value_text(answer: Answer) -> str:
    """Return the cheapest value that meets a requirement as text, with the one by the estimate
    alone in brackets if it differs.
    """
    sure = "none" if answer.value is None else _value_text(answer.value)
    alone = "none" if answer.estimated is None else _value_text(answer.estimated)
    notes = [f"({alone})"] if alone != sure else []
    notes += ["few"] if answer.line.estimate.few else []
    notes += ["uneven"] if answer.uneven else []
    return " ".join([sure, *notes])


def _study_settings_rows(tables: Tables) -> list[tuple[str, Any]]:
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


def _model_rows(scene: SceneRecord) -> list[tuple[str, ...]]:
    return [(m.block, m.type, m.about, "; ".join(m.rungs)) for m in scene.models]


def _error_rows(errors: MeasuredErrors) -> list[tuple[Any, ...]]:
    return [
        (e.block, f"{e.ladder}: {e.rung}", f"{e.quantity}, {e.unit}", short_text(e.mean),
        short_text(e.p95),
         short_text(e.largest), e.target_scans,
         # Another model, or for a reference something far better.
         f"its own error, {e.against}" if e.against.startswith("measured") else e.against)
        for e in errors.rows
    ]  # fmt: skip


def _effect_rows(effects: Sequence[EffectRecord], simulated: bool) -> list[tuple[str, str, str]]:
    """Return (blocks, effect, reason) rows of effects simulated or not, blocks joined by reason."""
    together: dict[tuple[str, str], list[str]] = {}
    for e in effects:
        if e.simulated == simulated:
            together.setdefault((e.effect, e.because), []).append(e.block)
    return [(", ".join(blocks), effect, why) for (effect, why), blocks in together.items()]


def _base64_png_figures(folder: StudyFolder) -> list[tuple[str, str, str]]:
    """Return (stem, file name, base64 content) of each PNG figure in the folder."""
    pictures = []
    for path in sorted(folder.path.glob("*.png"))[:_MOST_PICTURES]:
        try:
            content = read_regular_file(path, _LARGEST_PICTURE)
        except OSError:
            continue  # a link, or gone
        pictures.append((path.stem, path.name, base64.b64encode(content).decode()))
    return pictures


def _labelled_sha256_hashes(folder: StudyFolder) -> list[tuple[str, str]]:
    files = [folder.parts / f"{name}.parquet" for name in folder.part_names()[:_MOST_PARTS]]
    hashes = [(file.name, hashlib.sha256(read_regular_file(file)).hexdigest()) for file in files]
    return [("study, with all that fixes its results", folder.record.study_sha256), *hashes]
