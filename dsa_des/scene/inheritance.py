"""Merging the keys of a file over those of the files it extends.

Table by table, own keys win. What more there is to it: keys that ``remove`` takes away, and with a
block its wires; items of a list that are changed by their ``name``; and parameters that came from a
block of another type.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsa_des.block.registry import with_source_folder
from dsa_des.errors import Problem, did_you_mean
from dsa_des.scene.keys import (
    Key,
    dotted_key,
    explain_no_item,
    is_new_item,
    item_index,
    item_names,
    step_into_key,
    unquote_key,
)

REMOVE, BLOCKS, WIRES = "remove", "blocks", "wires"


@dataclass(eq=False)
class Removal:
    """One key that a table removes from what it inherits, and whether it was there."""

    #: Dotted, from the table that says it.
    text: str
    #: The file.
    source: str
    found: bool = False
    #: What the table does inherit.
    known: tuple[str, ...] = ()


class Removals(list[Removal]):
    """Placeholder of ``remove = [...]`` while files are merged."""


class Inheritance:
    """Merges tables over those that they inherit from, and removes what ``remove`` names."""

    def __init__(self, sources: dict[Key, str], problems: list[Problem]) -> None:
        self.of_other_type: dict[Key, str] = {}
        self.beside: dict[Key, dict[str, Any]] = {}
        self.replaced: dict[Key, list[str]] = {}
        self._sources = sources
        self._problems = problems
        self._any_removals = False

    def parse_removals(self, names: Any, source: str) -> Any:
        """Return the `Removals` for ``remove``; what is not a list of texts stays unchanged."""
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            return names
        self._any_removals = True
        return Removals(Removal(str(name), source) for name in names)

    def merge_in_place(
        self, base: dict[str, Any], over: Mapping[str, Any], at: Key
    ) -> dict[str, Any]:
        """Merge `over` into `base` in place, table by table, and return `base`."""
        removals = over.get(REMOVE)
        blocks = set(base[BLOCKS]) if not at and isinstance(base.get(BLOCKS), dict) else set()
        if isinstance(removals, Removals):
            for removal in removals:
                self._remove(base, removal, at)
            base[REMOVE] = Removals([*base.get(REMOVE, ()), *removals])
        if len(at) == 2 and at[0] == "blocks":
            self._note_keys_of_other_type(base, over, at)
        for key, value in over.items():
            mine = base.get(key)
            if isinstance(value, Removals):
                continue
            if isinstance(value, dict) and isinstance(mine, dict):
                self.merge_in_place(mine, value, (*at, key))
            elif isinstance(value, dict) and isinstance(mine, list) and item_names(mine):
                self._merge_items(mine, value, (*at, key))
            else:
                lost = _names_of_lost_items(mine, value)
                if lost:
                    self.replaced[(*at, key)] = lost
                base[key] = value
        if blocks and WIRES not in over and (gone := blocks - set(base[BLOCKS])):
            self._leave_out_wires(base, gone)
        return base

    def _leave_out_wires(self, base: dict[str, Any], gone: set[str]) -> None:
        """Remove the inherited wires from and to blocks that were removed."""
        if not isinstance(base.get(WIRES), list):
            return
        kept = [
            (old, piece)
            for old, entry in enumerate(base[WIRES])
            for piece in _wire_parts_without_blocks(entry, gone)
        ]
        sources = {k: v for k, v in self._sources.items() if k[:1] == (WIRES,) and len(k) > 1}
        for key in sources:
            del self._sources[key]
        for new, (old, _) in enumerate(kept):
            inside = {key: file for key, file in sources.items() if key[1] == old}
            self._sources |= {(WIRES, new, *key[2:]): file for key, file in inside.items()}
        base[WIRES] = [piece for _, piece in kept]

    def note_sibling_values(
        self, own: Mapping[str, Any], merged: Mapping[str, Any], at: Key
    ) -> None:
        """Record plain values beside each table in a block, from the file that first writes it."""
        for key, value in own.items():
            inherited = merged.get(key)
            if not (isinstance(value, dict) and isinstance(inherited, dict)):
                continue
            if len(at) == 2 and at[0] == "blocks":
                values = {k: v for k, v in merged.items() if not isinstance(v, dict | list)}
                self.beside.setdefault((*at, key), values)
            elif len(at) < 2 and (at or key == "blocks"):
                self.note_sibling_values(value, inherited, (*at, key))

    def strip_and_report_removals(self, tables: dict[str, Any], at: Key) -> dict[str, Any]:
        """Strip ``remove``'s placeholders, report useless ones, and return a file's tables."""
        if self._any_removals:
            self._strip_removal_placeholders(tables, at)
        return tables

    def _note_keys_of_other_type(
        self, base: dict[str, Any], over: Mapping[str, Any], at: Key
    ) -> None:
        old = base.get("type")
        if isinstance(old, str) and "type" in over and over["type"] != old:
            for key in base:
                if key not in over and key != REMOVE:
                    self.of_other_type.setdefault((*at, key), str(old))

    def _merge_items(self, items: list[Any], over: Mapping[str, Any], at: Key) -> None:
        """Merge changes, keyed by item name or number, into the items of a list."""
        removals = over.get(REMOVE)
        if isinstance(removals, Removals):
            for removal in removals:
                self._remove(items, removal, at)
        for name, value in over.items():
            if isinstance(value, Removals):
                continue
            index = item_index(items, name)
            if index is None and is_new_item(items, name, value):
                index = len(items)
                items.append({"name": name})
            if index is None:
                source = self._sources.get((*at, name), "")
                message = explain_no_item(items, name)
                self._problems.append(Problem(source, dotted_key((*at, name)), message))
                continue
            self._move_sources((*at, name), (*at, index))
            if isinstance(value, dict) and isinstance(items[index], dict):
                self.merge_in_place(items[index], value, (*at, index))
            else:
                items[index] = value
        if isinstance(removals, Removals):
            self._report_unmatched_removals(removals, at)

    def _remove(self, container: Any, removal: Removal, at: Key) -> None:
        rest = unquote_key(removal.text)
        removal.known = tuple(map(str, container)) if isinstance(container, dict) else ()
        while isinstance(container, dict | list):
            index: Any
            index, _, rest = step_into_key(container, rest)
            if index is None or (isinstance(container, dict) and index not in container):
                return
            if not rest:
                del container[index]
                removal.found = True
                self._forget_source(container, (*at, index))
                return
            container, at = container[index], (*at, index)

    def _forget_source(self, container: Any, key: Key) -> None:
        """Forget which file wrote a removed key, and renumber later items' keys in its list."""
        self.beside.pop(key, None)
        for known in [known for known in self._sources if known[: len(key)] == key]:
            del self._sources[known]
        if isinstance(container, list):
            around, index = key[:-1], int(key[-1])
            for number in range(index, len(container)):
                self._move_sources((*around, number + 1), (*around, number))

    def _move_sources(self, old: Key, new: Key) -> None:
        for known in [known for known in self._sources if known[: len(old)] == old]:
            self._sources[(*new, *known[len(old) :])] = self._sources.pop(known)

    def _strip_removal_placeholders(self, value: Any, at: Key) -> None:
        if isinstance(value, list):
            for number, item in enumerate(value):
                self._strip_removal_placeholders(item, (*at, number))
        if not isinstance(value, dict):
            return
        if isinstance(value.get(REMOVE), Removals):
            self._report_unmatched_removals(value.pop(REMOVE), at)
        for key, item in value.items():
            self._strip_removal_placeholders(item, (*at, key))

    def _report_unmatched_removals(self, removals: Removals, at: Key) -> None:
        for removal in removals:
            if not removal.found:
                message = (
                    f"nothing of this name is inherited{did_you_mean(removal.text, removal.known)}"
                )
                key = dotted_key((*at, REMOVE))
                self._problems.append(Problem(removal.source, key, message, removal.text))


def _wire_parts_without_blocks(entry: Any, gone: set[str]) -> list[Any]:
    """Return what remains of an entry of ``wires`` without hops from and to blocks in `gone`."""
    if isinstance(entry, dict):
        ends = [str(entry.get(end)).partition(".")[0].strip() for end in ("from", "to")]
        return [] if gone & set(ends) else [entry]
    if not isinstance(entry, str):
        return [entry]
    pieces: list[list[str]] = [[]]
    for end in entry.split("->"):
        if end.partition(".")[0].strip() in gone:
            pieces.append([])
        else:
            pieces[-1].append(end)
    return [entry] if len(pieces) == 1 else [
        with_source_folder("->".join(piece).strip(), getattr(entry, "folder", Path()))
        for piece in pieces if len(piece) > 1
    ]  # fmt: skip


def _names_of_lost_items(old: Any, new: Any) -> list[str]:
    """Return the names of items in the old list that the new list in its place lacks."""
    if not (isinstance(old, list) and isinstance(new, list)):
        return []
    return [name for name in item_names(old) if name not in item_names(new)]
