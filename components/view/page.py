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
from dsa_des.text.safe_text import printable

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
        """Return the picture for JSON; columns are little-endian numbers in base 64."""
        tables = {name: _pack(table) for name, table in self.tables.items()}
        eyes = {name: picture.to_json_tables() for name, picture in self.eyes.items()}
        return {**vars(self), "tables": tables, "eyes": eyes}


def _pack(table: Mapping[str, AnyArray]) -> dict[str, Any]:
    return {name: _column(name, values) for name, values in table.items()}


def _column(name: str, values: AnyArray) -> dict[str, str]:
    if values.dtype.kind in "iub":
        kind, stored = "i4", values.astype(_INDEX)
    elif name.endswith("_s"):  # instants are compared with each other
        kind, stored = "f8", values.astype(_DOUBLE)
    else:
        kind, stored = "f4", values.astype(_SINGLE)
    return {"kind": kind, "data": base64.b64encode(stored.tobytes()).decode("ascii")}


def page_text(picture: RunPicture) -> str:
    """Return the page of a picture.

    Its content security policy lets the browser run the one program inside and fetch nothing. Text
    of the run can carry no markup: it stands in JSON without angle brackets, and the program puts
    it on screen as text.
    """
    script, digest = page_program(_PACKAGE, SCRIPTS)
    contents = {
        "policy": _policy(digest),
        "title": escape(printable(picture.title)),
        "style": page_part(_PACKAGE, "style.css"),
        "data": _json(picture.to_json_tables()),
        "script": script,
    }
    return fill_page(_PACKAGE, "view.html", contents)


def page_of_several(pictures: Sequence[RunPicture]) -> str:
    """Return one page with those of several pictures beside each other, on one clock.

    Each stands in a frame of its own, as text of this page: nothing is fetched for it either.
    """
    script = page_part(_PACKAGE, "beside.js")
    _, inner = page_program(_PACKAGE, SCRIPTS)
    frames = [
        f'<iframe title="{escape(printable(one.title), quote=True)}" '
        f'srcdoc="{escape(page_text(one), quote=True)}"></iframe>'
        for one in pictures
    ]
    contents = {
        "policy": _policy(_digest(script), inner),
        "title": escape(printable(" | ".join(one.title for one in pictures))),
        "frames": "\n".join(frames),
        "script": script,
    }
    return fill_page(_PACKAGE, "beside.html", contents)


def _policy(*digests: str) -> str:
    """Return a policy that lets the browser run programs of these digests and fetch nothing."""
    programs = " ".join(f"'sha256-{digest}'" for digest in digests)
    return escape(
        f"default-src 'none'; script-src {programs}; style-src 'unsafe-inline'; "
        "base-uri 'none'; form-action 'none'",
        quote=True,
    )


def _json(content: dict[str, Any]) -> str:
    text = json.dumps(content, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def page_part(package: str, name: str) -> str:
    """Return a file of a package's folder ``page``."""
    return (files(package) / "page" / name).read_text(encoding="utf-8")


def page_program(package: str, scripts: Iterable[str]) -> tuple[str, str]:
    """Return the scripts of a page as one, after what all pages draw with, and its SHA-256.

    Scripts stand in the order in which they need each other; the digest is in base 64, as a content
    security policy has it.
    """
    parts = [page_part("components.view", name) for name in ("canvas.js", "labels.js")]
    parts += [page_part(package, name) for name in scripts]
    script = "\n".join(parts)
    return script, _digest(script)


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def fill_page(package: str, name: str, contents: Mapping[str, str]) -> str:
    """Return a page with contents in the places of its ``{{marks}}``.

    In one pass: what is put in may hold such marks itself.
    """
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: contents[mark[1]], page_part(package, name))
