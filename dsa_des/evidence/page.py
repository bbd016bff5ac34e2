"""The page of a pack: one HTML file that loads nothing, made of the machine-readable evidence."""

import base64
import math
from collections import Counter
from collections.abc import Mapping
from html import escape
from typing import Any

from markupsafe import Markup

from dsa_des.evidence.inputs import DEFAULT
from dsa_des.results.labels import readable_label, short_text
from dsa_des.results.report import PAGE_HEAD, read_page_template, report_jinja_environment
from dsa_des.text.safe_text import escape_unprintable

_PAGE = PAGE_HEAD + read_page_template("evidence.html")


def evidence_html(e: Mapping[str, Any], convergence: bytes, sensitivity: bytes | None) -> bytes:
    """Return the HTML page of the evidence `e` with its two PNG figures, as bytes."""
    confidence = e["requirements"][0]["confidence"]
    lines = [*e["requirements"], *e["also"]]
    names = list(dict.fromkeys(line["result"] for line in lines if line.get("study") in
                               (None, "assessed")))  # fmt: skip
    page = report_jinja_environment().from_string(_PAGE).render(
        e=e, title=e["case"]["title"], verdict=_escape_without_shortening(e["verdict"]["line"]),
        level=f"{100 * confidence:g} %",
        requirements=[
            (r["name"], f"at {r['sense']} {r['limit']:g} {r['unit']}", _number_text(r["value"]),
             _interval_text(r), r["verdict"])
            for r in e["requirements"]
        ],
        asked=[(r["name"], r["text"], r["source"]) for r in e["requirements"]],
        ratios=[
            (readable_label(r["result"]), *(_number_text(r[k]) for k in ("value", "unresolved",
            "induced")),
             f"{r['nominal_events']}, {r['mitigated_events']}, {r['induced_events']}",
             f"{_number_text(r['effective_sample_size'])} of {r['encounters']}")
            for r in lines if "unresolved" in r
        ],
        also=[(readable_label(r["result"]), _number_text(r["value"]), _interval_text(r),
        r["meaning"])
              for r in e["also"]],
        beside_heads=("system", *map(readable_label, names)), beside=_comparison_rows(e, names),
        sample=[
            ("model", e["sample"]["model"]), ("licence", e["sample"]["licence"]),
            ("weights", e["sample"]["weights"]), ("encounters", e["sample"]["encounters"]),
            ("effective number by the weights", _number_text(e["sample"]["effective_sample_size"])),
            ("drawn for each", ", ".join(e["sample"]["drawn"])),
        ],
        settled=[
            (c["requirement"], _number_text(c["moved"]), _number_text(c["may_move"]),
             f"{c['rule_counts_from']} to {c['encounters'][-1]}",
             "holds" if r["converged"] else "does not hold")
            for c, r in zip(e["convergence"]["estimates"], e["requirements"], strict=True)
        ],
        changes=[
            (c["key"], c["as_stated"], f"{c['value']} ({c['unit']})", readable_label(c["result"]),
             _number_text(c["difference"]), _interval_text(c))
            for c in e["sensitivity"]
        ],
        convergence=base64.b64encode(convergence).decode(),
        sensitivity=base64.b64encode(sensitivity or b"").decode(),
        stated=_parameter_rows_by_block([p for p in e["parameters"] if p["written_in"] != DEFAULT]),
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


def _escape_without_shortening(text: str) -> Markup:
    """Return a text escaped for HTML and not shortened, however long it is."""
    return Markup(escape(escape_unprintable(text)))


def _parameter_rows_by_block(rows: list[Mapping[str, Any]]) -> list[tuple[Any, ...]]:
    """Return (block, main source, parameter rows) for each block; rows name only other sources."""
    by: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by.setdefault(row["key"].partition(".")[0], []).append(row)
    blocks = []
    for block, mine in by.items():
        ((usual, _),) = Counter(str(row["source"]) for row in mine).most_common(1)
        cells = [
            (row["key"].partition(".")[2], row["value"], row["meaning"],
             "" if str(row["source"]) == usual else str(row["source"]), row["written_in"])
            for row in mine
        ]  # fmt: skip
        blocks.append((block, usual, cells))
    return blocks


def _comparison_rows(e: Mapping[str, Any], names: list[str]) -> list[tuple[str, ...]]:
    """Return a table row per result for the system and each compared study; empty without these."""
    own = [r for r in (*e["requirements"], *e["also"]) if r.get("study") in (None, "assessed")]
    rows = [(e["system"]["name"], own)] + [(one["name"], one["results"]) for one in e["beside"]]
    if len(rows) == 1:
        return []
    cells_of = []
    for name, results in rows:
        known = {r["result"]: r for r in results}
        if not known.keys() & set(names):
            continue
        cells = [f"{_number_text(known[n]['value'])} ({_interval_text(known[n])})"
        if n in known else "-"
                 for n in names]  # fmt: skip
        cells_of.append((name, *cells))
    return cells_of


def _number_text(value: Any) -> str:
    known = value is not None and not (isinstance(value, float) and math.isnan(value))
    return short_text(float(f"{value:.3g}")) if known else "-"


def _interval_text(row: Mapping[str, Any]) -> str:
    return f"{_number_text(row['low'])} to {_number_text(row['high'])}"
