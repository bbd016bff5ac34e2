"""The container of PX4's logs (ULog): topics as arrays, by the public description of the format."""

import struct
from collections.abc import Collection, Mapping

import numpy as np

from components.formats.text_rows import Problems
from dsa_des.arrays.types import AnyArray

MAGIC = b"ULog\x01\x12\x35"
_HEADER = 16
_HEAD = struct.Struct("<HB")
_TYPES = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4",
    "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8",
    "bool": "u1", "char": "u1",
}  # fmt: skip
_KINDS = frozenset(b"ABCDFILMOPQRS")
_MOST_BYTES, _DEEPEST = 65_535, 8

#: Fields of a topic by name, one row for each message; an array of values is (rows, values).
Topic = Mapping[str, AnyArray]


def read_topics(
    problems: Problems, data: bytes, wanted: Collection[str], warnings: list[str]
) -> dict[str, Topic]:
    """Return the wanted topics of a log by name; of a topic with several instances, the first.

    A log that ends within a message is one that lost its power. Where the log is damaged, what
    comes before is read, and a warning says so.
    """
    formats: dict[str, str] = {}
    topics: dict[int, str] = {}
    instances: dict[str, int] = {}
    sizes: dict[str, int] = {}
    rows: dict[str, bytearray] = {}
    at = _HEADER
    while at + _HEAD.size <= len(data):
        size, kind = _HEAD.unpack_from(data, at)
        end = at + _HEAD.size + size
        if kind not in _KINDS:
            warnings.append(f"the log is damaged at byte {at}: what comes before is read")
            break
        if end > len(data):
            warnings.append("the log ends within a message")
            break
        if kind == ord("D"):
            name = topics.get(int.from_bytes(data[at + 3 : at + 5], "little"))
            if name is not None:
                # What pads a message at its end is not logged.
                whole = sizes[name]
                rows[name] += data[at + 5 : min(end, at + 5 + whole)].ljust(whole, b"\0")
        elif kind == ord("F"):
            name, _, fields = data[at + 3 : end].decode("latin-1").partition(":")
            formats[name] = fields
        elif kind == ord("A"):
            name = data[at + 6 : end].decode("latin-1")
            if name in wanted and instances.setdefault(name, data[at + 3]) >= data[at + 3]:
                if instances[name] > data[at + 3]:
                    topics = {number: one for number, one in topics.items() if one != name}
                    instances[name] = data[at + 3]
                topics[int.from_bytes(data[at + 4 : at + 6], "little")] = name
                rows[name] = bytearray()
                sizes[name] = _field_layout_and_length(problems, name, formats, 0)[1]
        at = end
    return {name: _topic(problems, name, formats, rows[name]) for name in rows if rows[name]}


def _topic(problems: Problems, name: str, formats: Mapping[str, str], rows: bytearray) -> Topic:
    fields, size = _field_layout_and_length(problems, name, formats, 0)
    dtype = np.dtype({
        "names": list(fields), "formats": [form for form, _ in fields.values()],
        "offsets": [offset for _, offset in fields.values()], "itemsize": size,
    })  # fmt: skip
    table = np.frombuffer(rows, dtype=dtype)
    return {field: table[field] for field in fields}


def _field_layout_and_length(
    problems: Problems, name: str, formats: Mapping[str, str], deep: int
) -> tuple[dict[str, tuple[str, int]], int]:
    """Return each field's NumPy format and byte offset in a message, and the message's length."""
    if name not in formats or deep > _DEEPEST:
        problems.fail(f"the log does not say what {name[:40]!r} holds")
    fields: dict[str, tuple[str, int]] = {}
    at = 0
    for part in formats[name].split(";"):
        if not part:
            continue
        kind, _, field = part.partition(" ")
        kind, _, count = kind.partition("[")
        times = int(count[:-1]) if count[:-1].isdigit() else 1
        form = _TYPES.get(kind)
        if form is None:
            inner, size = _field_layout_and_length(problems, kind, formats, deep + 1)
        else:
            inner, size = {}, np.dtype(form).itemsize
            fields[field] = (f"({times},){form}" if count else form), at
        for key, (one, place) in inner.items():
            fields.setdefault(f"{field}.{key}", (one, at + place))
        at += times * size
        if at > _MOST_BYTES or not field:
            problems.fail(f"what the log says of {name[:40]!r} is damaged")
    return fields, at
