"""Names of classes: one name means one thing, in the engine and in the components."""

import ast
from collections import defaultdict
from pathlib import Path

from parsed import nodes

ROOT = Path(__file__).parents[2]


def classes(*folders: Path) -> dict[str, list[str]]:
    """Where the classes that are not a file's own business stand, by name."""
    found = defaultdict(list)
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            for node in nodes(path):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(f"{path.relative_to(folder.parent)}:{node.lineno}")
    return found


def repeated(found: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: places for name, places in found.items() if len(places) > 1}


def test_no_two_classes_share_a_name():
    assert repeated(classes(ROOT / "dsa_des", ROOT / "components", ROOT / "docs" / "make")) == {}


def test_a_name_that_stands_twice_is_found(tmp_path):
    for room in ("one", "two"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "file.py").write_text("if True:\n    class Same: ...\n")
    places = repeated(classes(tmp_path / "one", tmp_path / "two"))
    assert places == {"Same": ["one/file.py:2", "two/file.py:2"]}
