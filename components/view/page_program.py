"""The program inside a page, and the digest by which a browser knows it."""

import base64
import hashlib
import re
from collections.abc import Iterable, Mapping
from importlib.resources import files


def page_part(package: str, name: str) -> str:
    """Return a file of a package's folder ``page``."""
    return (files(package) / "page" / name).read_text(encoding="utf-8")


def page_program(package: str, scripts: Iterable[str]) -> tuple[str, str]:
    """Return the scripts of a page as one, after what all pages draw with, and the SHA-256.

    Parameters
    ----------
    package : str
    scripts : iterable of str
        In the order in which they need each other.

    Returns
    -------
    tuple of (str, str)
        The program, and its digest in base 64 as a content security policy has it.
    """
    parts = [page_part("components.view", "canvas.js")]
    parts += [page_part(package, name) for name in scripts]
    script = "\n".join(parts)
    return script, base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def page_filled(package: str, name: str, contents: Mapping[str, str]) -> str:
    """Return a page with contents in the places of its ``{{marks}}``.

    In one pass: what is put in may hold such marks itself.
    """
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: contents[mark[1]], page_part(package, name))
