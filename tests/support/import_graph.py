"""Which module of the project imports which, at any place of a file and in any way."""

import ast
import re
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import networkx as nx
from parsed import nodes

ROOT = Path(__file__).resolve().parents[2]
#: The engine, the blocks, and what makes the pages.
PARTS = ("dsa_des", "components", "docs.make")
_IMPORT = re.compile(
    r"^[ \t]*(?:from ([\w.]+) import (\([^)]*\)|[^\n]*)|import ([\w., ]+))", re.MULTILINE
)
_NAME, _COMMENT = re.compile(r"(\w+)(?: as \w+)?"), re.compile("#.*")
_TEXT = re.compile(r"""["']([A-Za-z_]\w*(?:\.\w+)+)[.:"']""")


@cache
def modules() -> dict[str, Path]:
    """All modules by dotted name; a package stands for its ``__init__.py``."""
    found = {}
    for part in PARTS:
        for path in sorted((ROOT / part.replace(".", "/")).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def nodes_of(module: str) -> tuple[ast.AST, ...]:
    """Return all nodes of a module's tree."""
    return nodes(modules()[module])


def docstrings(of: Sequence[ast.AST]) -> set[int]:
    """The nodes of docstrings and of other bare strings, which are for people."""
    return {
        id(node.value)
        for node in of
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }


@cache
def entry_point_groups() -> set[str]:
    """Names such as ``dsa_des.embed``, which as text mean a group and no module."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        return set(tomllib.load(file)["project"]["entry-points"])


def imported_modules(text: str) -> set[str]:
    """Modules of ours that a file imports, at any place and in any way, or names as text.

    Found by pattern: to parse all files takes twenty times as long.
    """
    found = set()
    for source, names, plain in _IMPORT.findall(text):
        assert not source.startswith("."), "imports are absolute, so that they can be searched for"
        found |= {name.split()[0] for name in plain.split(",") if name.strip()}
        full = {f"{source}.{name}" for name in _NAME.findall(_COMMENT.sub("", names))}
        found |= {name if name in modules() else source for name in full}
    return (found | set(_TEXT.findall(text)) - entry_point_groups()) & modules().keys()


@cache
def imports() -> nx.DiGraph:
    """Return an arrow from each module to each that it imports."""
    graph = nx.DiGraph()
    graph.add_nodes_from(modules())
    graph.add_edges_from(
        (module, other)
        for module, path in modules().items()
        for other in imported_modules(path.read_text("utf-8"))
    )
    graph.remove_edges_from(list(nx.selfloop_edges(graph)))
    return graph
