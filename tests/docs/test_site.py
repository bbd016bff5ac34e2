"""The docs build into one site, without warnings and without anything from the network."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
CONFIG = ROOT / "docs" / "site" / "mkdocs.yml"
#: Rooms that the reference leaves out: those of two commands.
LEFT_OUT = {"components.thesis", "components.benchmark"}
#: What a browser fetches by itself when it shows a page.
LOADED = re.compile(
    r"""<(?:script|img|iframe)[^>]*\ssrc=["']?(?:https?:)?//"""
    r"""|<link(?![^>]*rel=["']canonical)[^>]*\shref=["']?(?:https?:)?//"""
    r"""|(?:url\(|@import\s)["']?(?:https?:)?//"""
)


def test_the_reference_has_every_room() -> None:
    rooms = {
        f"{top}.{path.stem}"
        for top in ("dsa_des", "components")
        for path in (ROOT / top).iterdir()
        if (path / "__init__.py").exists()
    }
    pages = (ROOT / "docs" / "reference").glob("*.md")
    shown = {
        name
        for page in pages
        for name in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert rooms - shown == LEFT_OUT
    for name in shown:
        assert importlib.util.find_spec(name), name


def test_every_page_is_in_the_navigation() -> None:
    listed = set(re.findall(r": (\S+\.md)$", CONFIG.read_text(encoding="utf-8"), re.MULTILINE))
    docs = ROOT / "docs"
    there = {path.relative_to(docs).as_posix() for path in docs.rglob("*.md")}
    assert listed == {name for name in there if not name.startswith(("site/", "examples/"))}


@pytest.mark.slow
def test_the_site_builds_without_warnings_and_loads_nothing(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs", reason="needs the extra docs")
    pytest.importorskip("mkdocstrings_handlers.python", reason="needs the extra docs")
    site = Path(os.environ.get("DSA_DES_SITE", tmp_path / "site"))  # .ci/run has built it already
    if not site.exists():
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(CONFIG)]
        done = subprocess.run(
            [*command, "-d", str(site)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    pages = [path for path in site.rglob("*") if path.suffix in (".html", ".css")]
    assert len(pages) > 15
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not LOADED.search(text), page
        assert "::: " not in re.sub(r"<code.*?</code>", "", text, flags=re.DOTALL), page
    # What the theme lacks for those who do not see colours, or have no mouse.
    home = (site / "index.html").read_text(encoding="utf-8")
    for part in ("assets/site.css", "assets/site.js"):
        assert (site / part).is_file() and f'"{part}"' in home


@pytest.mark.parametrize(
    ("text", "loads"),
    [
        ('<script src="https://cdn.example/x.js">', True),
        ('<link rel="stylesheet" href="//fonts.example/css">', True),
        ("body { src: url(https://fonts.example/a.woff) }", True),
        ('<link rel="canonical" href="https://docs.example/">', False),
        ('<a href="https://www.mkdocs.org/">', False),
        ('<script src="js/base.js">', False),
    ],
)
def test_the_search_for_what_is_loaded(text: str, loads: bool) -> None:
    assert bool(LOADED.search(text)) == loads
