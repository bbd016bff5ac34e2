"""Writing plain tables as TOML (the standard library only reads it)."""

import json
from collections.abc import Mapping
from typing import Any

_BARE = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


def to_toml(tables: Mapping[str, Any]) -> str:
    """Return the tables as TOML text; values come before the tables they stand beside."""
    lines: list[str] = []
    _table(tables, (), lines)
    return "\n".join(lines).strip() + "\n"


def _table(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    nested = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    for key, value in table.items():
        if key not in nested:
            lines.append(f"{_key(key)} = {inline(value)}")
    for key, value in nested.items():
        inner = (*path, key)
        lines += ["", f"[{'.'.join(_key(part) for part in inner)}]"]
        _table(value, inner, lines)


def _key(key: str) -> str:
    return key if key and set(key) <= _BARE else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def inline(value: Any) -> str:
    """Return one value as TOML text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(str(value))
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        items = ", ".join(f"{_key(key)} = {inline(item)}" for key, item in value.items())
        return f"{{{items}}}" if items else "{}"
    if isinstance(value, list | tuple):
        texts = [inline(item) for item in value]
        if sum(map(len, texts)) > 80:
            return "[\n" + "".join(f"  {text},\n" for text in texts) + "]"
        return f"[{', '.join(texts)}]"
    raise TypeError(f"{type(value).__name__} cannot be written as TOML: {value!r}")
