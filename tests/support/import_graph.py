"""Which module of the project imports which, at any place of a file and in any way."""

import ast
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import networkx as nx
from parsed import nodes

ROOT = Path(__file__).resolve().parents[2]
#: The engine, the blocks, and what makes the pages.
PARTS = ("dsa_des", "components", "docs.make")


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


def imported_modules(of: Sequence[ast.AST]) -> set[str]:
    """Modules of ours that a file imports, at any place and in any way, or names as text."""
    found = set()
    prose = docstrings(of)
    for node in of:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute, so that they can be searched for"
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in modules() else str(node.module) for name in full}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            name = node.value.partition(":")[0].rstrip(".")
            if id(node) not in prose and "." in name and name not in entry_point_groups():
                found.add(name)
    return found & modules().keys()


@cache
def imports() -> nx.DiGraph:
    """Return an arrow from each module to each that it imports."""
    graph = nx.DiGraph()
    graph.add_nodes_from(modules())
    graph.add_edges_from(
        (module, other) for module in modules() for other in imported_modules(nodes_of(module))
    )
    graph.remove_edges_from(list(nx.selfloop_edges(graph)))
    return graph
