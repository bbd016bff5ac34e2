"""Only dsa_des/terminal/terminal.py prints, and only dsa_des/record/drawing.py makes figures."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PRINTERS = {"dsa_des/terminal/terminal.py", "dsa_des/terminal/safe_console.py"}
FIGURES = {"dsa_des/record/drawing.py"}
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for room in ("dsa_des", "components")
    for path in (ROOT / room).rglob("*.py")
)
FORBIDDEN = {"print", "click.echo", "click.secho", "click.progressbar", "click.confirm",
             "click.echo_via_pager", "click.prompt"}  # fmt: skip


def name_of(node: ast.AST) -> str:
    if isinstance(node, ast.Name):
        return node.id
    return f"{name_of(node.value)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def printing(source: str) -> Iterator[str]:
    """Give everything in a module that reaches the terminal or a figure by itself."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = name_of(node.func)
            if name in FORBIDDEN or name.startswith(("sys.stdout.write", "sys.stderr.write")):
                yield name
        if isinstance(node, ast.ImportFrom):
            yield from (
                f"{node.module}.{alias.name}"
                for alias in node.names
                if (node.module or "").startswith(("rich.console", "rich.progress", "rich.live"))
                or (node.module == "rich" and alias.name in ("print", "get_console"))
                or (node.module == "click" and f"click.{alias.name}" in FORBIDDEN)
                or alias.name in ("Figure", "FigureCanvasAgg", "pyplot")
            )
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name in ("rich", "matplotlib.pyplot"))


def test_nothing_else_prints_or_makes_a_figure() -> None:
    for file in FILES:
        found = set(printing((ROOT / file).read_text(encoding="utf-8")))
        figures = {name for name in found if "Figure" in name}
        assert file in FIGURES or not figures, file
        assert file in PRINTERS or found <= figures, file


@pytest.mark.parametrize(
    "source",
    ["print('x')", "import click\nclick.echo('x')", "from rich.console import Console",
     "import sys\nsys.stderr.write('x')", "from matplotlib.figure import Figure",
     "from click import echo"],
)  # fmt: skip
def test_the_search_finds_what_it_looks_for(source: str) -> None:
    assert list(printing(source))
