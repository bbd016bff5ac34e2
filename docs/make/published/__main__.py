"""``python -m docs.make.published [SECTION ...]``: make docs/published.md, or some of its sections.

Every module beside this one that has a ``TITLE`` is a section: an ``ORDER`` on the page, and a
function ``section(images)`` that runs what it shows, draws its figures into a folder and returns
the text below the title. Sections that are not named keep what the page says.
"""

import argparse
import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

import docs.make.published as package
from docs.make.stamp import stamped
from dsa_des.files.output_file import write_file
from dsa_des.terminal.interruption import exit_plainly_on_signal

PAGE = Path(__file__).parents[2] / "published.md"
_BEGIN, _END = "<!-- section: {} -->", "<!-- end -->"

HEAD = """# Published results

Does the whole chain give what others have published?

> `dsa-des run published/degas`

Each section has published results beside those of our scenes and studies. Made by
`python -m docs.make.published` (in a working copy; with names of sections, those alone). Nothing
was tuned to a number; each section states the choices made, its inputs, their licence, and what
is not open. A row is *equal* if both differ by no more than stated, *inside* if the published
value lies in our interval, and else *outside*.
"""


def sections() -> dict[str, ModuleType]:
    """Return the modules of all sections by name, in the order of the page."""
    names = [module.name for module in pkgutil.iter_modules(package.__path__)]
    every = {
        name: importlib.import_module(f"{package.__name__}.{name}")
        for name in names
        if name != "__main__"
    }
    found = {name: module for name, module in every.items() if hasattr(module, "TITLE")}
    return dict(sorted(found.items(), key=lambda item: item[1].ORDER))


def kept(page: str) -> dict[str, str]:
    """Return what a page says, by section."""
    found = {}
    for name in sections():
        _, begun, rest = page.partition(_BEGIN.format(name) + "\n")
        if begun:
            found[name] = rest.partition(_END)[0].strip("\n")
    return found


def joined(texts: dict[str, str]) -> str:
    """Return the page of the sections' texts."""
    parts = [
        f"{_BEGIN.format(name)}\n\n## {module.TITLE}\n\n{texts[name]}\n\n{_END}\n"
        for name, module in sections().items()
        if name in texts
    ]
    return "\n".join([HEAD, *parts])


def main(arguments: list[str] | None = None) -> None:
    """Make the page again, or some of its sections."""
    parser = argparse.ArgumentParser(description="Make docs/published.md.")
    parser.add_argument("sections", nargs="*", metavar="SECTION")
    parser.add_argument("--page", type=Path, default=PAGE)
    given = parser.parse_args(arguments)
    if unknown := sorted({*given.sections} - {*sections()}):
        parser.error(f"no section {', '.join(unknown)}; there are {', '.join(sections())}")
    old = kept(given.page.read_text(encoding="utf-8")) if given.page.exists() else {}
    texts = {name: _without_title(text) for name, text in old.items()}
    for name, module in sections().items():
        if name in given.sections or not given.sections:
            text = module.section(given.page.parent / "images").strip("\n")
            texts[name] = stamped(text, f"python -m docs.make.published {name}").rstrip("\n")
    write_file(given.page, joined(texts).encode("utf-8"))


def _without_title(text: str) -> str:
    return text.partition("\n")[2].strip("\n") if text.startswith("## ") else text


if __name__ == "__main__":
    with exit_plainly_on_signal():
        main()
