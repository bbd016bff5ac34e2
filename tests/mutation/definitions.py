"""Finds a class, function or constant by its name, whatever file it is in, and code in it.

A name is a method's with its class (``Fading.drawn``), a function's or a constant's; where several
are called alike, with as much of the module before it as tells them apart (``radar.echo.margin``).
"""

import ast
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
_PRODUCT = ("dsa_des", "components")
Code = ast.expr | list[ast.stmt]


class Definition(NamedTuple):
    """A definition: its whole name, the file it stands in, and where; a property may be several."""

    name: str
    file: str
    nodes: tuple[ast.AST, ...]


def definition(name: str) -> Definition:
    """Return the one definition of the project whose name is this one or ends with it.

    Raises
    ------
    ValueError
        If there is none, or more than one.
    """
    last = name.rpartition(".")[2]
    found = [each for each in _files_of().get(last, {}) if f".{each}".endswith(f".{name}")]
    if len(found) != 1:
        several = f"is ambiguous; say which: {', '.join(found)}"
        raise ValueError(f"{name} {several if found else 'is defined nowhere'}")
    file = _files_of()[last][found[0]]
    return Definition(found[0], file, tuple(_definitions(file)[found[0]]))


def parsed(source: str, *, statements: bool = False) -> Code:
    """Return code in any layout: an expression if it is one, unless statements are wanted."""
    if not statements:
        try:
            return ast.parse(f"({source}\n)", mode="eval").body
        except SyntaxError:
            pass
    return ast.parse(source).body


def replaced(there: Definition, old: Code, new: Code) -> str:
    """Return the text of a definition's file with the one place that reads `old` made `new`.

    Raises
    ------
    ValueError
        If there is no such place, or more than one.
    """
    places = _places(there, old)
    if len(places) != 1:
        raise ValueError(f"{there.name} in {there.file} holds {len(places)} times: {shown(old)}")
    first, last = places[0][0], places[0][-1]
    written = f"({shown(new)})"
    if isinstance(new, list):
        written = ("\n" + " " * first.col_offset).join(shown(new).splitlines())
    return spliced(_texts()[there.file], first, last, written)


def spliced(text: str, first: ast.AST, last: ast.AST, written: str) -> str:
    """Return a text with what stands from one node to another replaced."""
    lines = [line.encode() for line in text.splitlines(True)]
    begin = sum(map(len, lines[: first.lineno - 1])) + first.col_offset
    end = sum(map(len, lines[: last.end_lineno - 1])) + last.end_col_offset
    whole = b"".join(lines)
    return (whole[:begin] + written.encode() + whole[end:]).decode()


def shown(code: Code) -> str:
    """Return code as Python writes it, the same in whatever layout it was."""
    return ast.unparse(code if isinstance(code, ast.expr) else ast.Module(code, []))


@cache
def _texts() -> dict[str, str]:
    return {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for part in _PRODUCT
        for path in sorted((ROOT / part).rglob("*.py"))
    }


@cache
def _files_of() -> dict[str, dict[str, str]]:
    """Return the file of each whole name, by the last part of the name."""
    found: dict[str, dict[str, str]] = defaultdict(dict)
    for file in _texts():
        for name in _definitions.__wrapped__(file):  # trees that are kept slow down the collector
            found[name.rpartition(".")[2]][name] = file
    return found


@cache
def _definitions(file: str) -> dict[str, list[ast.AST]]:
    """Return the nodes of a file's definitions by their whole names."""
    found = defaultdict(list)
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    for name, node in _named(ast.parse(_texts()[file]), module):
        found[name].append(node)
    return found


def _named(node: ast.AST, outer: str, *, local: bool = False) -> Iterator[tuple[str, ast.AST]]:
    """Yield classes and functions below a node, and what modules and classes assign to a name."""
    for each in ast.iter_child_nodes(node):
        match each:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                name = f"{outer}.{each.name}"
                yield name, each
                yield from _named(each, name, local=not isinstance(each, ast.ClassDef))
            case ast.Assign(targets=[target]) | ast.AnnAssign(target=target) if not local:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from ((f"{outer}.{n.id}", each) for n in names if isinstance(n, ast.Name))
            case ast.stmt() | ast.ExceptHandler():
                yield from _named(each, outer, local=local)


def _places(there: Definition, old: Code) -> list[Sequence[ast.AST]]:
    """Return what reads like `old`: one expression each, or statements that follow each other."""
    nodes = [node for top in there.nodes for node in _below(top)]
    if isinstance(old, ast.expr):
        kind, like = type(old), ast.dump(old)
        return [[node] for node in nodes if type(node) is kind and ast.dump(node) == like]
    blocks = [[top] for top in there.nodes]
    blocks += [value for node in nodes for _, value in ast.iter_fields(node) if _is_block(value)]
    kinds, like = [type(each) for each in old], [ast.dump(each) for each in old]
    runs = [block[k : k + len(old)] for block in blocks for k in range(len(block))]
    return [
        run
        for run in runs
        if [type(each) for each in run] == kinds and [ast.dump(each) for each in run] == like
    ]


def _is_block(value: object) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], ast.stmt)


def _below(node: ast.AST) -> Iterator[ast.AST]:
    """Yield nodes, but not values in a text: Python 3.11 does not say where in it they stand."""
    yield node
    if not isinstance(node, ast.JoinedStr):
        for each in ast.iter_child_nodes(node):
            yield from _below(each)


def checked(text: str) -> str:
    """Return Python source, if it is that; ValueError if it is not."""
    with warnings.catch_warnings(action="ignore"):
        try:
            compile(text, "faulty", "exec")
        except SyntaxError as error:
            raise ValueError(str(error)) from None
    return text
