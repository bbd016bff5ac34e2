"""Public functions and classes that no code of ours names: the docs say they are for users."""

import ast
import re
from collections import Counter
from pathlib import Path

from parsed import parsed

ROOT = Path(__file__).parents[2]
#: With what makes the pages, which calls the product as a user does.
ROOMS = ("dsa_des", "components", "docs/make")


def trees() -> dict[Path, ast.Module]:
    paths = [p for room in ROOMS for p in sorted((ROOT / room).rglob("*.py"))]
    return {path: parsed(path) for path in paths}


def words(tree: ast.Module) -> Counter[str]:
    """Names, attributes and words of texts that are neither docstrings nor lists of exports."""
    left_out = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            left_out |= {id(part) for part in ast.walk(node)}
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found[node.id] += 1
        elif isinstance(node, ast.Attribute):
            found[node.attr] += 1
        elif isinstance(node, ast.Constant) and id(node) not in left_out:
            found.update(re.findall(r"\w+", str(node.value)))
    return found


def uncalled(of: dict[Path, ast.Module], registered: str) -> set[str]:
    used = Counter(re.findall(r"\w+", registered))
    for tree in of.values():
        used.update(words(tree))
    public = (ast.FunctionDef, ast.ClassDef)
    # A command of a group is called by its name on the command line.
    commands = {
        node.name
        for tree in of.values()
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(".command(" in ast.unparse(part) for part in node.decorator_list)
    }
    return {
        node.name
        for tree in of.values()
        for node in tree.body
        if isinstance(node, public) and not node.name.startswith("_") and not used[node.name]
    } - commands


def test_what_only_tests_call_is_said_to_be_for_users():
    page = (ROOT / "docs" / "reference" / "physics.md").read_text(encoding="utf-8")
    said = set(re.findall(r"\.(\w+)`", page))
    found = uncalled(trees(), (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert found <= said


def test_a_function_that_nothing_calls_is_found():
    tree = ast.parse("__all__ = ['lonely']\ndef lonely(): ...\ndef used(): ...\nused()\n")
    assert uncalled({Path("one.py"): tree}, "") == {"lonely"}
