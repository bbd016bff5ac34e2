"""Public functions and classes that no code of ours names: the docs say they are for users."""

import ast
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from parsed import nodes

ROOT = Path(__file__).parents[2]
#: With what makes the pages, which calls the product as a user does.
ROOMS = ("dsa_des", "components", "docs/make")


def files() -> list[Sequence[ast.AST]]:
    return [nodes(p) for room in ROOMS for p in sorted((ROOT / room).rglob("*.py"))]


def words(of: Sequence[ast.AST]) -> Counter[str]:
    """Names, attributes and words of texts that are neither docstrings nor lists of exports."""
    left_out = {id(n.value) for n in of if isinstance(n, ast.Expr)}
    for node in of:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            left_out |= {id(part) for part in ast.walk(node)}
    found: Counter[str] = Counter()
    for node in of:
        if isinstance(node, ast.Name):
            found[node.id] += 1
        elif isinstance(node, ast.Attribute):
            found[node.attr] += 1
        elif isinstance(node, ast.Constant) and id(node) not in left_out:
            found.update(re.findall(r"\w+", str(node.value)))
    return found


def uncalled(of: Sequence[Sequence[ast.AST]], registered: str) -> set[str]:
    used = Counter(re.findall(r"\w+", registered))
    for file in of:
        used.update(words(file))
    top = [node for file in of for node in file[0].body]
    public = (ast.FunctionDef, ast.ClassDef)
    # A command of a group is called by its name on the command line.
    commands = {
        node.name
        for node in top
        if isinstance(node, ast.FunctionDef)
        and any(".command(" in ast.unparse(part) for part in node.decorator_list)
    }
    return {
        node.name
        for node in top
        if isinstance(node, public) and not node.name.startswith("_") and not used[node.name]
    } - commands


def test_what_only_tests_call_is_said_to_be_for_users():
    page = (ROOT / "docs" / "reference" / "physics.md").read_text(encoding="utf-8")
    said = set(re.findall(r"\.(\w+)`", page))
    found = uncalled(files(), (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert found <= said


def test_a_function_that_nothing_calls_is_found():
    tree = ast.parse("__all__ = ['lonely']\ndef lonely(): ...\ndef used(): ...\nused()\n")
    assert uncalled([list(ast.walk(tree))], "") == {"lonely"}
