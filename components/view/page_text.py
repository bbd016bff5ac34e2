"""The page itself: one HTML file with style, program and data inside."""

import json
from html import escape
from typing import Any

from components.view.page_program import page_filled, page_part, page_program
from components.view.picture import RunPicture
from dsa_des.text.safe_text import printable

_PACKAGE = "components.view"
#: The program's parts, in the order in which they need each other.
SCRIPTS = (
    "data.js", "symbols.js", "labels.js", "plan.js", "altitude.js", "timeline.js", "table.js",
    "app.js",
)  # fmt: skip


def page_text(picture: RunPicture) -> str:
    """Return the page of a picture.

    Its content security policy lets the browser run the one program inside and fetch nothing. Text
    of the run can carry no markup: it stands in JSON without angle brackets, and the program puts
    it on screen as text.
    """
    script, digest = page_program(_PACKAGE, SCRIPTS)
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "base-uri 'none'; form-action 'none'"
    )
    contents = {
        "policy": escape(policy, quote=True),
        "title": escape(printable(picture.title)),
        "style": page_part(_PACKAGE, "style.css"),
        "data": _json(picture.packed()),
        "script": script,
    }
    return page_filled(_PACKAGE, "view.html", contents)


def _json(content: dict[str, Any]) -> str:
    text = json.dumps(content, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
