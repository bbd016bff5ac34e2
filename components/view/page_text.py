"""The page itself: one HTML file with style, program and data inside."""

import base64
import hashlib
import json
import re
from html import escape
from importlib.resources import files
from typing import Any

from components.view.picture import RunPicture
from dsa_des.text.safe_text import printable

#: The program's parts, in the order in which they need each other.
SCRIPTS = (
    "data.js", "symbols.js", "plan.js", "altitude.js", "timeline.js", "table.js", "app.js",
)  # fmt: skip


def page_text(picture: RunPicture) -> str:
    """Return the page of a picture.

    Its content security policy lets the browser run the one program inside and fetch nothing. Text
    of the run can carry no markup: it stands in JSON without angle brackets, and the program puts
    it on screen as text.
    """
    folder = files("components.view") / "page"

    def part(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    script = "\n".join(part(name) for name in SCRIPTS)
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    policy = (
        f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; "
        "base-uri 'none'; form-action 'none'"
    )
    contents = {
        "policy": escape(policy, quote=True),
        "title": escape(printable(picture.title)),
        "style": part("style.css"),
        "data": _json(picture.packed()),
        "script": script,
    }
    # In one pass: what is put in may hold such marks itself.
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: contents[mark[1]], part("view.html"))


def _json(content: dict[str, Any]) -> str:
    text = json.dumps(content, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
