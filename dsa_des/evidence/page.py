"""The page of a pack: one HTML file that loads nothing, made of the machine-readable evidence."""

import base64
import math
from collections import Counter
from collections.abc import Mapping
from html import escape
from typing import Any

from markupsafe import Markup

from dsa_des.evidence.inputs import DEFAULT
from dsa_des.results.labels import readable, short
from dsa_des.results.report import PAGE_HEAD, page_environment
from dsa_des.text.safe_text import printable

_PAGE = (
    PAGE_HEAD
    + """<style>table{width:auto}td{min-width:4em}</style>
<header><h1>{{ title }}</h1>
<p class="verdict"><strong>{{ verdict }}</strong></p>
<p>{{ e.case.description }}</p>
<p class="note">Assessed: {{ e.system.name }}, version {{ e.system.version }}. Made by dsa_des \
{{ e.versions.dsa_des }}. The same in numbers: <code>evidence.json</code>.</p>\
</header>
<nav><a href="#requirements">Requirements</a> <a href="#beside">Beside it</a> \
<a href="#encounters">Encounters</a> <a href="#convergence">Convergence</a> \
<a href="#sensitivity">Sensitivity</a> <a href="#parameters">Parameters</a> \
<a href="#models">Models</a> <a href="#left_out">Left out</a> \
<a href="#repeat">To repeat it</a></nav><main>
<h2 id="system">The system</h2><p>{{ e.system.description }}</p>
<h2 id="requirements">Requirements and evidence</h2>
{{ table(("requirement", "asked", "found", level + " interval", "verdict"), requirements) }}
{{ table(("requirement", "in words", "as asked by"), asked) }}
<p class="note">met: the whole interval lies within the limit. not met: the whole interval lies \
beyond it. not shown: the interval holds the limit. not converged: no verdict is given.</p>
{% if ratios %}
<h3>Parts of the ratios</h3>
{{ table(("result", "ratio", "unresolved", "induced", "events without, with, induced", \
"effective size"), ratios) }}
<p class="note">Unresolved: what happens without the system and with it. Induced: what happens \
with it alone. They add up to the ratio.</p>
{% endif %}
{% if also %}
<h3>Further results</h3>{{ table(("result", "found", level + " interval", "meaning"), also) }}
{% endif %}
<h2 id="beside">Beside it</h2>
{% if beside %}
{{ table(beside_heads, beside) }}
{% for one in e.beside %}<p class="note">{{ one.name }}: {{ one.about }} \
({{ one.encounters }} encounters)</p>{% endfor %}
{% else %}<p>The case names nothing to stand beside the system.</p>{% endif %}
<h2 id="encounters">The encounters</h2>
{{ table(("", ""), sample) }}
<h2 id="convergence">Convergence</h2><p>The rule: {{ e.convergence.rule }}.</p>
{{ table(("requirement", "moved by up to", "may move", "over encounters", ""), settled) }}
<figure><img alt="running estimates" src="data:image/png;base64,{{ convergence | plain }}">\
<figcaption>Running estimates over the number of encounters.</figcaption></figure>
<h2 id="sensitivity">Sensitivity</h2>
{% if changes %}
<p>One parameter at a time, on the same {{ e.sensitivity_encounters }} encounters; the parameter \
that matters most stands first.</p>
<figure><img alt="sensitivity" src="data:image/png;base64,{{ sensitivity | plain }}">\
<figcaption>Paired differences with their {{ level }} intervals.</figcaption></figure>
<details><summary>In numbers</summary>
{{ table(("parameter", "as stated", "changed to", "result", "difference", level + " interval"),
         changes) }}</details>
{% else %}<p>The case names no parameter to change.</p>{% endif %}
<h2 id="parameters">Parameters and their sources</h2>
{% for block, source, rows in stated %}
<h3>{{ block }}</h3><p>{{ source }}</p>
<details><summary>{{ rows | length }} stated</summary>
{{ table(("parameter", "value", "meaning", "source", "written in"), rows) }}</details>
{% endfor %}
<details><summary>Parameters at the default of their model ({{ defaults | length }})</summary>
{{ table(("parameter", "value", "meaning"), defaults) }}</details>
<h2 id="models">The models and what they were held against</h2>
{{ table(("block", "model", "what", "against", "agrees to", "by the test"), verified) }}
<h2 id="left_out">What is left out, and why</h2>
{{ table(("left out", "why"), left_out) }}
{% if effects %}<details><summary>Effects of the models that the scene does not call for \
({{ effects | length }})</summary>{{ table(("block", "effect", "because"), effects) }}</details>
{% endif %}
<h2 id="repeat">To repeat it</h2>
<p>In the folder that holds this page:</p>{{ [e.command] | verbatim }}
<p>The inputs lie in <code>inputs/</code>, the results of every run in <code>studies/</code>: \
<code>dsa-des study show studies/assessed</code>. Another run gives the same \
<code>evidence.json</code> on processors of one class.</p>
{{ table(("study", "seed", "runs", "without result", "SHA-256 of all rows"), results) }}
<details><summary>Inputs and versions</summary>
{{ table(("input", "SHA-256"), inputs) }}{{ table(("package", "version"), versions) }}</details>
</main></body></html>
"""
)


def evidence_page(e: Mapping[str, Any], convergence: bytes, sensitivity: bytes | None) -> bytes:
    """Return the page of some evidence and its two pictures."""
    confidence = e["requirements"][0]["confidence"]
    lines = [*e["requirements"], *e["also"]]
    names = list(dict.fromkeys(line["result"] for line in lines if line.get("study") in
                               (None, "assessed")))  # fmt: skip
    page = page_environment().from_string(_PAGE).render(
        e=e, title=e["case"]["title"], verdict=_whole(e["verdict"]["line"]),
        level=f"{100 * confidence:g} %",
        requirements=[
            (r["name"], f"at {r['sense']} {r['limit']:g} {r['unit']}", _number(r["value"]),
             _interval(r), r["verdict"])
            for r in e["requirements"]
        ],
        asked=[(r["name"], r["text"], r["source"]) for r in e["requirements"]],
        ratios=[
            (readable(r["result"]), *(_number(r[k]) for k in ("value", "unresolved", "induced")),
             f"{r['nominal_events']}, {r['mitigated_events']}, {r['induced_events']}",
             f"{_number(r['effective_sample_size'])} of {r['encounters']}")
            for r in lines if "unresolved" in r
        ],
        also=[(readable(r["result"]), _number(r["value"]), _interval(r), r["meaning"])
              for r in e["also"]],
        beside_heads=("", *map(readable, names)), beside=_beside(e, names),
        sample=[
            ("model", e["sample"]["model"]), ("licence", e["sample"]["licence"]),
            ("weights", e["sample"]["weights"]), ("encounters", e["sample"]["encounters"]),
            ("effective number by the weights", _number(e["sample"]["effective_sample_size"])),
            ("drawn for each", ", ".join(e["sample"]["drawn"])),
        ],
        settled=[
            (c["requirement"], _number(c["moved"]), _number(c["may_move"]),
             f"{c['rule_counts_from']} to {c['encounters'][-1]}",
             "holds" if r["converged"] else "does not hold")
            for c, r in zip(e["convergence"]["estimates"], e["requirements"], strict=True)
        ],
        changes=[
            (c["key"], c["as_stated"], f"{c['value']} ({c['unit']})", readable(c["result"]),
             _number(c["difference"]), _interval(c))
            for c in e["sensitivity"]
        ],
        convergence=base64.b64encode(convergence).decode(),
        sensitivity=base64.b64encode(sensitivity or b"").decode(),
        stated=_stated([p for p in e["parameters"] if p["written_in"] != DEFAULT]),
        defaults=[(p["key"], p["value"], p["meaning"])
                  for p in e["parameters"] if p["written_in"] == DEFAULT],
        verified=[
            (m["block"], m["type"], *(v[k] for k in ("what", "oracle", "tolerance", "test")))
            for m in e["models"]
            for v in m["verified"] or [dict.fromkeys(("oracle", "tolerance", "test"), "")
                                       | {"what": "nothing is stated"}]
        ],
        left_out=[(one["what"], one["why"]) for one in e["left_out"]["stated"]],
        effects=[(f["block"], f["effect"], f["because"]) for f in e["left_out"]["effects"]],
        results=[(r["study"], e["seeds"][r["study"]], r["runs"], r["failed"], r["rows_sha256"])
                 for r in e["results"]],
        inputs=[(one["file"], one["sha256"]) for one in e["inputs"]],
        versions=list(e["versions"].items()),
    )  # fmt: skip
    return page.encode()


def _whole(text: str) -> Markup:
    """Return a text as it is, however long: what does not pass is not cut."""
    return Markup(escape(printable(text)))


def _stated(rows: list[Mapping[str, Any]]) -> list[tuple[Any, ...]]:
    """Return block, the source of most of its values, and its rows, whose own source may differ."""
    by: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by.setdefault(row["key"].partition(".")[0], []).append(row)
    found = []
    for block, mine in by.items():
        ((usual, _),) = Counter(str(row["source"]) for row in mine).most_common(1)
        cells = [
            (row["key"].partition(".")[2], row["value"], row["meaning"],
             "" if str(row["source"]) == usual else str(row["source"]), row["written_in"])
            for row in mine
        ]  # fmt: skip
        found.append((block, usual, cells))
    return found


def _beside(e: Mapping[str, Any], names: list[str]) -> list[tuple[str, ...]]:
    """Return a row for the system and for each study beside it, with a column per result."""
    own = [r for r in (*e["requirements"], *e["also"]) if r.get("study") in (None, "assessed")]
    rows = [(e["system"]["name"], own)] + [(one["name"], one["results"]) for one in e["beside"]]
    if len(rows) == 1:
        return []
    found = []
    for name, results in rows:
        known = {r["result"]: r for r in results}
        if not known.keys() & set(names):
            continue
        cells = [f"{_number(known[n]['value'])} ({_interval(known[n])})" if n in known else "-"
                 for n in names]  # fmt: skip
        found.append((name, *cells))
    return found


def _number(value: Any) -> str:
    known = value is not None and not (isinstance(value, float) and math.isnan(value))
    return short(float(f"{value:.3g}")) if known else "-"


def _interval(row: Mapping[str, Any]) -> str:
    return f"{_number(row['low'])} to {_number(row['high'])}"
