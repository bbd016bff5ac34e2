"""Steps along a dotted key: keys of tables, and items of lists by number or by their ``name``."""

import re
from collections.abc import Callable, Mapping
from typing import Any

from dsa_des.errors import did_you_mean, nearest_name

Key = tuple[str | int, ...]

INDEX = re.compile(r"[0-9]{1,9}")
#: A part between quotes is what is in them.
_QUOTED = re.compile(r""""([^"]*)"|(?<![^.\[])'([^']*)'(?![^.\]])""")


def dotted_key(key: Key) -> str:
    """Return ``blocks.traffic.intruders[1].name`` for a key path."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def unquote_key(text: str) -> str:
    """Return a dotted key without the quotes around its parts."""
    return _QUOTED.sub(lambda match: match[1] if match[2] is None else match[2], text).replace(
        '"', ""
    )


def flatten_tables(
    tables: Mapping[str, Any],
    is_value: Callable[[Any], bool] = lambda value: not isinstance(value, dict),
    prefix: str = "",
) -> dict[str, Any]:
    """Return dotted key → value of nested tables."""
    values: dict[str, Any] = {}
    for name, value in tables.items():
        if is_value(value):
            values[f"{prefix}{name}"] = value
        else:
            values |= flatten_tables(value, is_value, f"{prefix}{name}.")
    return values


def step_into_key(container: Any, rest: str) -> tuple[str | int | None, str, str]:
    """Return (key or index of the next step, the step as written, rest of the dotted key).

    A name that is already there is found whole, dots and brackets included: a study has axes of
    names such as ``wires[4].drop_probability``. The step into a list is None where it has no such
    item; `explain_no_item` says what it has.
    """
    if isinstance(container, list):
        return _step_into_list(container, rest)
    part = _longest_match([str(name) for name in container], rest)
    part = rest.partition(".")[0] if part is None else part
    return part, part, rest[len(part) :].removeprefix(".")


def _step_into_list(items: list[Any], rest: str) -> tuple[int | None, str, str]:
    bracket = rest.startswith("[")
    names = item_names(items)
    inside = rest[1:] if bracket else rest
    part = _longest_match([f"{name}]" for name in names] if bracket else names, inside)
    if part is None:
        part = re.match(r"[^\[\]]*" if bracket else r"[^.\[\]]*", inside)[0]  # type: ignore[index]
    else:
        part = part.removesuffix("]") if bracket else part
    tail = inside[len(part) :]
    tail = (tail.removeprefix("]") if bracket else tail).removeprefix(".")
    return item_index(items, part), part, tail


def item_index(items: list[Any], part: str) -> int | None:
    """Return the index of the item that a number or name means; None if none or several match."""
    if INDEX.fullmatch(part):
        return int(part) if int(part) < len(items) else None
    places = [number for number, item in enumerate(items) if _item_name(item) == part]
    return places[0] if len(places) == 1 else None


def explain_no_item(items: list[Any], part: str) -> str:
    """Return a message that a list has no such item, or several, and which items it has."""
    names = item_names(items)
    if names.count(part) > 1:
        return f"{names.count(part)} items of the list are called {part!r}: give a number, from 0"
    message = f"there is no item {part!r}: the list has {len(items)} (from 0)"
    if not names:
        return message
    return message + did_you_mean(part, names)


def is_new_item(items: list[Any], name: str, value: Any) -> bool:
    """Return whether a table under an unknown name is a new list item, not a misspelt old one.

    One of nearly a known name that lacks what all items have is meant to change that one.
    """
    if not isinstance(value, dict) or INDEX.fullmatch(name) or item_names(items).count(name):
        return False
    if not all(isinstance(item, dict) for item in items):
        return False
    common = set.intersection(*map(set, items)) if items else set()
    return nearest_name(name, item_names(items)) is None or common <= {"name", *value}


def item_names(items: list[Any]) -> list[str]:
    """Return the names of the tables of a list that have one."""
    return [name for item in items if (name := _item_name(item))]


def readable_key(tables: Any, text: str) -> str:
    """Return a dotted key with list items by name, for messages; empty if it has no list item.

    ``wires[4].delay_s`` is ``wire from radar to fusion:.delay_s``.
    """
    words: list[str] = []
    named = False
    for part in parse_key_path(tables, text):
        inside = isinstance(part, int) and isinstance(tables, list) and part < len(tables)
        if isinstance(part, int):
            kind = words.pop() if words else ""
            ends = _blocks_of_wire(tables[part]) if inside else None
            name = (
                f"from {ends[0]} to {ends[-1]}:"
                if ends
                else _item_name(tables[part])
                if inside
                else ""
            )
            words.append(f"{kind.removesuffix('s')} {name or part + 1}".strip())
            named = True
        else:
            words.append(part)
            inside = isinstance(tables, dict) and part in tables
        tables = tables[part] if inside else {}
    return ".".join(words) if named else ""


def _blocks_of_wire(item: Any) -> list[str]:
    """Return the names of the blocks that an entry of ``wires`` connects; none if no wire."""
    if isinstance(item, str) and "->" in item:
        ends = item.split("->")
    elif isinstance(item, dict) and {"from", "to"} <= set(item):
        ends = [str(item["from"]), str(item["to"])]
    else:
        return []
    return [end.partition(".")[0].strip() for end in ends]


def _item_name(item: Any) -> str:
    name = item.get("name") if isinstance(item, dict) else getattr(item, "name", None)
    return str(name) if isinstance(name, str) else ""


def _longest_match(names: list[str], rest: str) -> str | None:
    there = [name for name in names if rest == name or rest.startswith((f"{name}.", f"{name}["))]
    return max(there, key=len, default=None)


def parse_key_path(tables: Any, text: str) -> Key:
    """Return the path of keys and item numbers that a dotted key means in the given tables.

    What the tables do not hold stays as it was written.
    """
    path: list[str | int] = []
    rest = unquote_key(text)
    while rest:
        index, part, rest = step_into_key(tables, rest)
        path.append(part if index is None else index)
        inside = index is not None if isinstance(tables, list) else index in tables
        tables = tables[index] if inside else {}
        if not isinstance(tables, dict | list):
            tables = {}
    return tuple(path)
