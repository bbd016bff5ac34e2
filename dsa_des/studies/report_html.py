"""The HTML of a study's report: text that is safe to show, tables, and the page around them."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from dsa_des.text.safe_text import printable, shortened

_LONGEST = 400
_STYLE = """
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
"""


def page(title: str, parts: Iterable[str]) -> bytes:
    """Return a page that loads nothing, of a title and parts that are HTML already."""
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "img-src data:; style-src 'unsafe-inline'\">"
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{text(title)}</title><style>{_STYLE}</style></head><body>\n"
    )
    return (head + "\n".join(filter(None, parts)) + "\n</body></html>\n").encode()


def text(value: Any) -> str:
    """Return a value as text of a page, on one line and of bounded length."""
    return escape(shortened(printable(str(value)), _LONGEST))


def verbatim(lines: Iterable[str]) -> str:
    """Return lines as they stand."""
    return "<pre>" + "\n".join(escape(printable(line)) for line in lines) + "</pre>"


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table; nothing where there are no rows."""

    def line(cells: Sequence[Any], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{text(cell)}</{tag}>" for cell in cells) + "</tr>"

    body = "\n".join(line(row, "td") for row in rows)
    if not body:
        return ""
    return f"<div class='wide'><table>{line(headings, 'th')}\n{body}</table></div>"
