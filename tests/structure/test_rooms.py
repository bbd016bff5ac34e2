"""Two rooms, one arrow: who may import whom, and what the engine may know by name.

Every import counts: at the top of a file, inside a function, under ``TYPE_CHECKING``, and the
name of a module written as text, as for a lookup on first use. None of them needs an exception.
"""

import ast
import dataclasses
import importlib
import re
from collections.abc import Sequence
from pathlib import Path

import networkx as nx
import pytest
from import_graph import ROOT, docstrings, imports, modules, nodes_of
from parsed import parsed

from dsa_des.block.message import Message

ENGINE, BLOCKS, MAKERS = "dsa_des", "components", "docs.make"
MOST_FILES = 16

#: Words of messages that mean something to an engine without sensors, too.
COMMON_WORDS = {
    "target",  # the receiving end of a wire
    "scan", "scans", "offsets",  # what a clock counts, and how entries belong to rows
    "columns",  # what tables have, and messages about targets
    "skipped",  # what becomes of a message at a busy processor
    "ticks_per_s",  # of the clock
    "confidence",  # of an interval
    "pixels",  # a unit
    "truth",  # what a ladder compares with
}  # fmt: skip


def folder_of(module: str) -> str:
    return module if modules()[module].name == "__init__.py" else module.rpartition(".")[0]


def circles(graph: nx.DiGraph) -> list[list[str]]:
    return [sorted(ring) for ring in nx.strongly_connected_components(graph) if len(ring) > 1]


def test_files_import_each_other_in_no_circle():
    assert circles(imports()) == []


def test_folders_import_each_other_in_no_circle():
    folders = nx.DiGraph()
    why: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for source, target in imports().edges:
        arrow = folder_of(source), folder_of(target)
        if arrow[0] != arrow[1]:
            folders.add_edge(*arrow)
            why.setdefault(arrow, []).append((source, target))
    rings = circles(folders)
    ties = {
        arrow: files
        for ring in rings
        for arrow, files in why.items()
        if arrow[0] in ring and arrow[1] in ring
    }
    assert rings == [], ties


def test_the_engine_imports_no_block():
    assert [edge for edge in imports().edges if edge[0].split(".")[0] == ENGINE
            and edge[1].split(".")[0] == BLOCKS] == []  # fmt: skip
    text = re.compile(r"^\s*(from|import)\s+components\b", re.MULTILINE)
    found = [
        m for m, p in modules().items() if m.split(".")[0] == ENGINE and text.search(p.read_text())
    ]
    assert found == []


@pytest.mark.parametrize("room", [f"{BLOCKS}.thesis", f"{BLOCKS}.benchmark", MAKERS])
def test_nothing_imports_what_makes_the_pages(room):
    """Nothing of the product imports the rooms of two commands, and nothing the makers of pages."""
    inside = {module for module in modules() if f"{module}.".startswith(f"{room}.")}
    assert inside
    may = inside | {module for module in modules() if module.startswith(f"{MAKERS}.")}
    assert [edge for edge in imports().edges if edge[1] in inside and edge[0] not in may] == []


def test_geometry_is_imported_by_its_face():
    """One name for each function, whatever file it is in; the proofs of error bounds apart."""
    room = f"{BLOCKS}.geometry"
    files = {module for module in modules() if module.startswith(f"{room}.")}
    assert len(files) > 5
    assert [
        (source, target)
        for source, target in imports().edges
        if target in files - {f"{room}.error_bounds"} and not source.startswith(room)
    ] == []


def folders_of_code() -> list[Path]:
    """All folders, at any depth, that hold Python files of the product, its tests or its pages."""
    tops = (ENGINE, BLOCKS, "tests", "docs")
    return sorted({path.parent for top in tops for path in (ROOT / top).rglob("*.py")})


def test_no_folder_holds_more_files_than_one_sees_at_a_glance():
    many = {
        folder.relative_to(ROOT).as_posix(): len(files)
        for folder in folders_of_code()
        if len(files := [path for path in folder.iterdir() if path.suffix == ".py"]) > MOST_FILES
    }
    assert many == {}
    assert len(folders_of_code()) > 60


def test_every_package_says_what_it_is_in_a_sentence_of_its_own():
    said = {
        module: ast.get_docstring(parsed(path)) or ""
        for module, path in modules().items()
        if path.name == "__init__.py"
    }
    assert [
        module for module, text in said.items() if not text.partition("\n")[0].endswith(".")
    ] == []
    assert len(set(said.values())) == len(said)


def messages_of(room: str) -> list[type[Message]]:
    """Messages that a room defines; other rooms may be imported already, and do not count."""
    for module in modules():
        if module.startswith(f"{room}."):
            importlib.import_module(module)
    found, todo = [], [Message]
    while todo:
        message = todo.pop()
        todo += message.__subclasses__()
        found.append(message)
    return [message for message in found if f"{message.__module__}.".startswith(f"{room}.")]


def words_of(messages: list[type[Message]]) -> set[str]:
    """Tables, columns and fields of messages."""
    words = set()
    for message in messages:
        words |= {field.name for field in dataclasses.fields(message)}
        for table, columns in message.recorded.items():
            words |= {table, *columns}
    return words


def mentioned(of: Sequence[ast.AST]) -> set[str]:
    """Identifiers in the texts of a file, without what is prose, and the attributes it reads."""
    prose = docstrings(of)
    found = set()
    for node in of:
        if isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose
        ):
            # A sentence for people may say "detections"; a key of a table is a word by itself.
            found |= {w for w in re.findall(r"\w+", node.value) if "_" in w} | {node.value}
    return found


def test_the_engine_names_no_column_of_a_message_of_components():
    sensors = words_of(messages_of(f"{BLOCKS}.messages"))
    sensors -= (
        words_of(messages_of(f"{ENGINE}.block") + messages_of(f"{ENGINE}.running")) | COMMON_WORDS
    )
    assert {"azimuth_rad", "detections", "snr_db", "true_range_m"} <= sensors
    found = {
        module: sorted(mentioned(nodes_of(module)) & sensors)
        for module in modules()
        if module.split(".")[0] == ENGINE and mentioned(nodes_of(module)) & sensors
    }
    assert found == {}
