"""The page that replays a run: one HTML file with style, program and data inside."""

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dsa_des.arrays.types import AnyArray
from dsa_des.text.safe_text import escape_unprintable

_PACKAGE = "components.view"
#: The program's parts, in the order in which they need each other.
SCRIPTS = (
    "data.js", "symbols.js", "plan.js", "altitude.js", "timeline.js", "table.js",
    "app.js",
)  # fmt: skip
#: Number of the table's row, in 32 bits.
_INDEX = np.dtype("<i4")
_SINGLE, _DOUBLE = np.dtype("<f4"), np.dtype("<f8")


@dataclass
class RunPicture:
    """A run as the page shows it: names, and columns of numbers by table.

    A sensor has ``name``, ``colour``, ``marker``, and where known ``azimuth_deg`` and ``range_m``;
    of a beam that sweeps clockwise over them ``sweep_s``, how long it takes from each scan on.
    Tables are ``own``, ``truth``, ``scans``, ``detections``, ``fused``, ``tracks``, ``alerts``,
    ``manoeuvres`` and ``bands``. Of several platforms ``eyes`` has what each has, by name.
    """

    title: str
    facts: dict[str, Any]
    duration_s: float
    start_s: float = 0.0
    sensors: list[dict[str, Any]] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)
    trackers: list[str] = field(default_factory=list)
    tables: dict[str, dict[str, AnyArray]] = field(default_factory=dict)
    eyes: "dict[str, RunPicture]" = field(default_factory=dict)

    def to_json_tables(self) -> dict[str, Any]:
        """Return a dictionary for JSON, with each column as little-endian numbers in base 64."""
        tables = {name: _encode_columns(table) for name, table in self.tables.items()}
        eyes = {name: picture.to_json_tables() for name, picture in self.eyes.items()}
        return {**vars(self), "tables": tables, "eyes": eyes}


def _encode_columns(table: Mapping[str, AnyArray]) -> dict[str, Any]:
    return {name: _encode_column(name, values) for name, values in table.items()}


def _encode_column(name: str, values: AnyArray) -> dict[str, str]:
    if values.dtype.kind in "iub":
        kind, stored = "i4", values.astype(_INDEX)
    elif name.endswith("_s"):  # instants are compared with each other
        kind, stored = "f8", values.astype(_DOUBLE)
    else:
        kind, stored = "f4", values.astype(_SINGLE)
    return {"kind": kind, "data": base64.b64encode(stored.tobytes()).decode("ascii")}


def page_html(picture: RunPicture) -> str:
    """Return the HTML page that shows a run.

    Its content security policy lets the browser run the one program inside and fetch nothing. Text
    of the run can carry no markup: it stands in JSON without angle brackets, and the program puts
    it on screen as text.
    """
    script, digest = page_script_and_digest(_PACKAGE, SCRIPTS)
    contents = {
        "policy": _content_security_policy(digest),
        "title": escape(escape_unprintable(picture.title)),
        "style": read_page_file(_PACKAGE, "style.css"),
        "data": _json(picture.to_json_tables()),
        "script": script,
    }
    return fill_page_template(_PACKAGE, "view.html", contents)


def page_html_of_several(pictures: Sequence[RunPicture]) -> str:
    """Return one HTML page that shows several runs side by side on one clock.

    Each stands in a frame of its own, as text of this page: nothing is fetched for it either.
    """
    script = read_page_file(_PACKAGE, "beside.js")
    _, inner = page_script_and_digest(_PACKAGE, SCRIPTS)
    frames = [
        f'<iframe title="{escape(escape_unprintable(one.title), quote=True)}" '
        f'srcdoc="{escape(page_html(one), quote=True)}"></iframe>'
        for one in pictures
    ]
    contents = {
        "policy": _content_security_policy(_digest(script), inner),
        "title": escape(escape_unprintable(" | ".join(one.title for one in pictures))),
        "frames": "\n".join(frames),
        "script": script,
    }
    return fill_page_template(_PACKAGE, "beside.html", contents)


def _content_security_policy(*digests: str) -> str:
    """Return a policy (CSP) to run only scripts with these SHA-256 digests and fetch nothing."""
    programs = " ".join(f"'sha256-{digest}'" for digest in digests)
    return escape(
        f"default-src 'none'; script-src {programs}; style-src 'unsafe-inline'; "
        "base-uri 'none'; form-action 'none'",
        quote=True,
    )


def _json(content: dict[str, Any]) -> str:
    text = json.dumps(content, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def read_page_file(package: str, name: str) -> str:
    """Return the text of a file in the folder ``page`` of a package."""
    return (files(package) / "page" / name).read_text(encoding="utf-8")


def page_script_and_digest(package: str, scripts: Iterable[str]) -> tuple[str, str]:
    """Return the page's scripts joined after the shared ones, and their SHA-256 in base 64.

    Scripts stand in the order in which they need each other; the digest is in base 64, as a content
    security policy has it.
    """
    parts = [read_page_file("components.view", name) for name in ("canvas.js", "labels.js")]
    parts += [read_page_file(package, name) for name in scripts]
    script = "\n".join(parts)
    return script, _digest(script)


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def fill_page_template(package: str, name: str, contents: Mapping[str, str]) -> str:
    """Return a package's page template with each ``{{mark}}`` replaced by its content.

    In one pass: what is put in may hold such marks itself.
    """
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: contents[mark[1]], read_page_file(package, name))
