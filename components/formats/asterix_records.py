"""Records of EUROCONTROL's ASTERIX, categories 021, 034, 048 and 062, out of numbers and back.

One table says where each quantity stands, its least significant bit, how many bits it has and
whether it has a sign: writing and reading go by it. Latitudes and longitudes are in degrees,
heights in m, as everywhere here; the time of day is that since the last midnight.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.formats.text_rows import TrafficFileError
from dsa_des.errors import UsageError
from dsa_des.errors.optional_libraries import import_extra

DAY_S = 86400.0
#: Reports of a radar's own service, plots, system tracks, and ADS-B reports.
SERVICE, PLOTS, SYSTEM_TRACKS, ADS_B = 34, 48, 62, 21
NORTH_MARKER = 1

_TIME_S = 1.0 / 128.0
_LEVEL_M = 25.0 * FOOT_M
_HEIGHT_M = 6.25 * FOOT_M
_TURN_DEG = 360.0 / 2**16
_CLIMB_MPS = 6.25 * FOOT_M / 60.0


class _Field(NamedTuple):
    """How ASTERIX stores a quantity: item, its part, a bit's value, the number of bits, if signed.

    A part of a part is ``CAL/CAL``.
    """

    item: str
    part: str | None
    step: float
    bits: int
    signed: bool = False
    #: For what goes round, as angles do: all of it.
    turn: float = math.inf
    #: Whether the largest number stands for all that are larger, too.
    saturates: bool = False


#: EUROCONTROL-SPEC-0149, parts 2b (034), 4 (048), 9 (062) and 12 (021).
FIELDS: Mapping[int, Mapping[str, _Field]] = {
    SERVICE: {
        "sac": _Field("010", "SAC", 1, 8),
        "sic": _Field("010", "SIC", 1, 8),
        "message": _Field("000", None, 1, 8),
        "time_of_day_s": _Field("030", None, _TIME_S, 24, turn=DAY_S),
        "alt_m": _Field("120", "HGT", 1.0, 16, True),
        "lat_deg": _Field("120", "LAT", 180.0 / 2**23, 24, True),
        "lon_deg": _Field("120", "LON", 180.0 / 2**23, 24, True, 360.0),
    },
    PLOTS: {
        "sac": _Field("010", "SAC", 1, 8),
        "sic": _Field("010", "SIC", 1, 8),
        "time_of_day_s": _Field("140", None, _TIME_S, 24, turn=DAY_S),
        "simulated": _Field("020", "SIM", 1, 1),
        "range_m": _Field("040", "RHO", NAUTICAL_MILE_M / 256.0, 16),
        "azimuth_deg": _Field("040", "THETA", _TURN_DEG, 16, turn=360.0),
        "alt_m": _Field("110", "3DH", _LEVEL_M, 14, True),
        "flight_level_m": _Field("090", "FL", _LEVEL_M, 14, True),
        "range_rate_m_s": _Field("120", "CAL/CAL", 1.0, 10, True),
        "number": _Field("220", None, 1, 24),
        "track": _Field("161", "TRN", 1, 12),
        "code": _Field("070", "MODE3A", 1, 12),
        "name": _Field("240", None, 0, 48),
    },
    SYSTEM_TRACKS: {
        "sac": _Field("010", "SAC", 1, 8),
        "sic": _Field("010", "SIC", 1, 8),
        "time_of_day_s": _Field("070", None, _TIME_S, 24, turn=DAY_S),
        "lat_deg": _Field("105", "LAT", 180.0 / 2**25, 32, True),
        "lon_deg": _Field("105", "LON", 180.0 / 2**25, 32, True, 360.0),
        "velocity_east_m_s": _Field("185", "VX", 0.25, 16, True),
        "velocity_north_m_s": _Field("185", "VY", 0.25, 16, True),
        "velocity_up_m_s": _Field("220", None, _CLIMB_MPS, 16, True),
        "east_error_m": _Field("500", "APC/X", 0.5, 16, saturates=True),
        "north_error_m": _Field("500", "APC/Y", 0.5, 16, saturates=True),
        "alt_error_m": _Field("500", "AGA", _HEIGHT_M, 8, saturates=True),
        "velocity_east_error_m_s": _Field("500", "ATV/X", 0.25, 8, saturates=True),
        "velocity_north_error_m_s": _Field("500", "ATV/Y", 0.25, 8, saturates=True),
        "velocity_up_error_m_s": _Field("500", "ARC", _CLIMB_MPS, 8, saturates=True),
        "number": _Field("040", None, 1, 16),
        "tentative": _Field("080", "CNF", 1, 1),
        "simulated": _Field("080", "SIM", 1, 1),
        "last": _Field("080", "TSE", 1, 1),
        "coasted": _Field("080", "CST", 1, 1),
        "name": _Field("245", "CHR", 0, 48),
        "alt_m": _Field("130", None, _HEIGHT_M, 16, True),
        "flight_level_m": _Field("136", None, _LEVEL_M, 16, True),
        "barometric_m": _Field("135", "CTB", _LEVEL_M, 15, True),
    },
    ADS_B: {
        "sac": _Field("010", "SAC", 1, 8),
        "sic": _Field("010", "SIC", 1, 8),
        "time_of_day_s": _Field("073", None, _TIME_S, 24, turn=DAY_S),
        "applicable_s": _Field("071", None, _TIME_S, 24, turn=DAY_S),
        "simulated": _Field("040", "SIM", 1, 1),
        "number": _Field("080", None, 1, 24),
        "lat_deg": _Field("131", "LAT", 180.0 / 2**30, 32, True),
        "lon_deg": _Field("131", "LON", 180.0 / 2**30, 32, True, 360.0),
        "coarse_lat_deg": _Field("130", "LAT", 180.0 / 2**23, 24, True),
        "coarse_lon_deg": _Field("130", "LON", 180.0 / 2**23, 24, True, 360.0),
        "alt_m": _Field("140", None, _HEIGHT_M, 16, True),
        "flight_level_m": _Field("145", None, _LEVEL_M, 16, True),
        "speed_m_s": _Field("160", "GS", NAUTICAL_MILE_M / 2**14, 15),
        "track_deg": _Field("160", "TA", _TURN_DEG, 16, turn=360.0),
        "velocity_up_m_s": _Field("157", "GVR", _CLIMB_MPS, 15, True),
        "barometric_climb_m_s": _Field("155", "BVR", _CLIMB_MPS, 15, True),
        "name": _Field("170", None, 0, 48),
    },
}  # fmt: skip
#: In which order a file holds what is of one instant.
ORDER = {SERVICE: 0, PLOTS: 1, SYSTEM_TRACKS: 2, ADS_B: 3}


class AsterixRecord(NamedTuple):
    """One record: its category, its time since the file's first midnight, and its quantities."""

    category: int
    time_s: float
    values: Mapping[str, Any]


def callsign_from_name(name: str) -> str | None:
    """Return a name's first 8 ASCII letters and digits, upper case, as callsign; None if none."""
    plain = "".join(c for c in name.upper() if c.isascii() and c.isalnum())
    return plain[:8] or None


def encode_records(records: Sequence[AsterixRecord]) -> bytes:
    """Return records as bytes of data blocks in order of time; those of one instant share blocks.

    UsageError says which quantity does not fit into its bits.
    """
    cats = _category_definitions()
    blocks: list[tuple[tuple[int, float], list[Any]]] = []
    for record in sorted(records, key=lambda r: (r.time_s, ORDER[r.category])):
        kind = cats[record.category]
        made = kind.cv_uap.cv_record.create(_library_form_of_items(record))
        key = record.category, record.time_s
        if not blocks or blocks[-1][0] != key or len(blocks[-1][1]) >= _MOST_OF_A_BLOCK:
            blocks.append((key, []))
        blocks[-1][1].append(made)
    return b"".join(cats[key[0]].create(made).unparse().to_bytes() for key, made in blocks)


#: A block holds 65,535 bytes, and no record of ours has more than 64.
_MOST_OF_A_BLOCK = 1000


def _category_definitions() -> dict[int, Any]:
    """Return the library's newest edition of each supported ASTERIX category, by its number."""
    generated = import_extra("asterix.generated", "asterix", "ASTERIX")
    return {number: generated.manifest["CATS"][number][-1] for number in FIELDS}


_SOURCE = {"010": (("SAC", "=sac"), ("SIC", "=sic"))}
_POSITION = (("LAT", "=lat_deg"), ("LON", "=lon_deg"))
#: The items of a record as the library makes them; "=name" stands for a quantity, and an item
#: whose quantities are not all given is left out.
_ITEMS: Mapping[int, Mapping[str, Any]] = {
    SERVICE: _SOURCE | {
        "000": "=message", "030": "=time_of_day_s", "120": (("HGT", "=alt_m"), *_POSITION),
    },
    PLOTS: _SOURCE | {
        "140": "=time_of_day_s",
        # A single detection by primary radar.
        "020": ((("TYP", 1), ("SIM", "=simulated"), ("RDP", 0), ("SPI", 0), ("RAB", 0), None),),
        "040": (("RHO", "=range_m"), ("THETA", "=azimuth_deg")),
        "110": (0, ("3DH", "=alt_m")),
        "120": {"CAL": (("D", 0), 0, ("CAL", "=range_rate_m_s"))},
    },
    SYSTEM_TRACKS: _SOURCE | {
        "070": "=time_of_day_s",
        "105": _POSITION,
        "185": (("VX", "=velocity_east_m_s"), ("VY", "=velocity_north_m_s")),
        "220": "=velocity_up_m_s",
        "040": "=number",
        "080": (
            (("MON", 1), ("SPI", 0), ("MRH", 1), ("SRC", 1), ("CNF", "=tentative"), None),
            (("SIM", "=simulated"), ("TSE", "=last"), ("TSB", 0), ("FPC", 0), ("AFF", 0),
             ("STP", 0), ("KOS", 0), None),
            (("AMA", 0), ("MD4", 0), ("ME", 0), ("MI", 0), ("MD5", 0), None),
            (("CST", "=coasted"), ("PSR", 0), ("SSR", 0), ("MDS", 0), ("ADS", 0), ("SUC", 0),
             ("AAC", 0), None),
        ),
        "245": (("STI", 1), 0, ("CHR", "=name")),
        "130": "=alt_m",
        "500": {
            "APC": (("X", "=east_error_m"), ("Y", "=north_error_m")),
            "AGA": "=alt_error_m",
            "ATV": (("X", "=velocity_east_error_m_s"), ("Y", "=velocity_north_error_m_s")),
            "ARC": "=velocity_up_error_m_s",
        },
    },
    ADS_B: _SOURCE | {
        "073": "=time_of_day_s",
        "040": (
            (("ATP", 0), ("ARC", 0), ("RC", 0), ("RAB", 0), None),
            (("DCR", 0), ("GBS", 0), ("SIM", "=simulated"), ("TST", 0), ("SAA", 0), ("CL", 0), 0,
             None),
        ),
        "080": "=number",
        "131": _POSITION,
        "140": "=alt_m",
        "145": "=flight_level_m",
        "155": (("RE", 0), ("BVR", "=barometric_climb_m_s")),
        "160": (("RE", 0), ("GS", "=speed_m_s"), ("TA", "=track_deg")),
        "157": (("RE", 0), ("GVR", "=velocity_up_m_s")),
        "170": "=name",
        # Version 2 of the link, Mode S extended squitter (DO-260B).
        "210": (0, ("VNS", 0), ("VN", 2), ("LTT", 2)),
    },
}  # fmt: skip


def _library_form_of_items(record: AsterixRecord) -> dict[str, Any]:
    """Return a record's items in the form from which the asterix library builds a record."""
    values = {**record.values, "time_of_day_s": record.time_s}
    raw = {
        f"={name}": _raw_value(record, name, field, values[name])
        for name, field in FIELDS[record.category].items()
        if values.get(name) is not None
    }
    items = {}
    for item, pattern in _ITEMS[record.category].items():
        with suppress(KeyError):
            items[item] = _fill_pattern(pattern, raw)
    return items


def _fill_pattern(pattern: Any, raw: Mapping[str, Any]) -> Any:
    """Return a pattern of `_ITEMS` with quantities filled in; KeyError if one is missing."""
    if isinstance(pattern, tuple):
        return tuple(_fill_pattern(part, raw) for part in pattern)
    if isinstance(pattern, dict):
        return {name: _fill_pattern(part, raw) for name, part in pattern.items()}
    return raw[pattern] if isinstance(pattern, str) and pattern.startswith("=") else pattern


def _raw_value(record: AsterixRecord, name: str, field: _Field, value: Any) -> Any:
    """Return a quantity as the unsigned integer that its bits hold; a name stays a text."""
    if name == "name":
        return value
    steps = round(value / field.step)
    if field.turn < math.inf:
        turn = round(field.turn / field.step)
        steps = (steps + turn // 2) % turn - turn // 2 if field.signed else steps % turn
    low = -(2 ** (field.bits - 1)) if field.signed else 0
    if field.saturates:
        steps = min(steps, 2**field.bits - 1)
    if not low <= steps < low + 2**field.bits:
        raise UsageError(
            f"ASTERIX: category {record.category:03d}, time {record.time_s:g} s: {name} = "
            f"{value:g} does not fit: item {field.item} holds {low * field.step:g} to "
            f"{(low + 2**field.bits - 1) * field.step:g}"
        )
    return steps % 2**field.bits


def decode_records_with_notes(path: Path, data: bytes) -> tuple[list[AsterixRecord], list[str]]:
    """Return supported categories' records in file order, each once, and notes on the rest.

    TrafficFileError says at which byte what is no data block or no record begins.
    """
    cats, readers = _category_definitions(), _category_readers()
    records: list[AsterixRecord] = []
    left_out: dict[int, int] = {}
    now_s = math.nan
    timeless, again = 0, 0
    seen: set[tuple[int, float, bytes]] = set()  # what is sent on two addresses comes twice
    for at, category, raw in _block_start_category_bytes(path, data):
        if category not in cats:
            left_out[category] = left_out.get(category, 0) + 1
            continue
        here = 0
        while here < len(raw):
            values, begin = dict[str, Any](), here
            try:
                here = readers[category](raw, here, values)
                if here > len(raw):
                    raise ValueError("insufficient data")
            except (ValueError, IndexError) as error:
                raise _block_error(
                    path, at, f"its records are none of category {category:03d}, edition "
                    f"{'.'.join(map(str, cats[category].cv_edition))} ({error})"
                ) from None  # fmt: skip
            time_s = values.pop("time_of_day_s", values.get("applicable_s"))
            if time_s is None:
                timeless += 1
                continue
            if now_s == now_s:  # the day on which it is nearest to the record before
                time_s += DAY_S * round((now_s - time_s) / DAY_S)
            now_s = time_s
            if (key := (category, time_s, raw[begin:here])) in seen:
                again += 1
                continue
            seen.add(key)
            records.append(AsterixRecord(category, time_s, values))
    notes = [
        f"{count} data blocks of category {category:03d} were left out"
        for category, count in sorted(left_out.items())
    ]
    if timeless:
        notes.append(f"{timeless} records without a time of day were left out")
    if again:
        notes.append(f"{again} records stand there again and count once")
    return records, notes


def _block_error(path: Path, at: int, problem: str) -> TrafficFileError:
    return TrafficFileError(str(path), [f"the data block at byte {at}: {problem}"])


def _block_start_category_bytes(path: Path, data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield each data block's first byte position, its category, and its records' bytes."""
    at = 0
    if not data:
        raise TrafficFileError(str(path), ["the file is empty: data blocks of ASTERIX are needed"])
    while at < len(data):
        size = int.from_bytes(data[at + 1 : at + 3], "big")
        if size < 3 or at + 3 > len(data):
            raise _block_error(path, at, "says that it has less than 3 bytes: this is no ASTERIX")
        if at + size > len(data):
            raise _block_error(path, at, f"has {size} bytes, but the file ends at byte {len(data)}")
        yield at, data[at], data[at + 3 : at + size]
        at += size


#: Given bytes, where something begins in them, and quantities, it adds its own and says its end.
_Reader = Callable[[bytes, int, dict[str, Any]], int]
#: A quantity's name, its last bit, how many there are, and its field.
_Take = tuple[str, int, int, _Field]
_LETTERS = ["", *map(chr, range(65, 91)), *[""] * 5, " ", *[""] * 15, *"0123456789", *[""] * 6]


@cache
def _category_readers() -> dict[int, _Reader]:
    """Return a record reader for each category, built from the library's item descriptions.

    Its own objects of every bit would take 0.6 ms a record.
    """
    base = import_extra("asterix.base", "asterix", "ASTERIX")

    def takes_of(items: Any, fields: Mapping[str, Any], prefix: str, at: int) -> list[_Take]:
        found = []
        for item in items:
            if item is None:
                at += 1
                continue
            kind, size = item
            if issubclass(kind, base.Item):
                path = f"{prefix}/{kind.cv_non_spare.cv_name}"
                inner = kind.cv_non_spare.cv_rule.cv_variation
                if issubclass(inner, base.Group):
                    found += takes_of(inner.cv_items_list, fields, path, at)
                elif path in fields:
                    found.append((fields[path][0], at + size, size, fields[path][1]))
            at += size
        return found

    def reader_of(kind: Any, fields: Mapping[str, Any], path: str) -> _Reader:
        if issubclass(kind, base.Compound):
            return _compound_reader([
                one and reader_of(one.cv_rule.cv_variation, fields, f"{path}/{one.cv_name}")
                for one in kind.cv_items_list
            ])  # fmt: skip
        if issubclass(kind, base.Explicit):
            return lambda data, at, _: at + (data[at] or len(data))
        if issubclass(kind, base.Repetitive):
            return _repetition_skipper(kind.cv_rep_bytes, kind.cv_variation.cv_bit_size)
        if issubclass(kind, base.Extended):
            extents = [sum(1 if one is None else one[1] for one in part) // 8
                       for part in kind.cv_items_list]  # fmt: skip
            whole = [one for part in kind.cv_items_list for one in part]
            return _fixed_reader(extents, takes_of(whole, fields, path, 0))
        size = kind.cv_bit_size
        if issubclass(kind, base.Group):
            return _fixed_reader([size // 8], takes_of(kind.cv_items_list, fields, path, 0))
        mine = [(fields[path][0], size, size, fields[path][1])] if path in fields else []
        return _fixed_reader([size // 8], mine)

    readers = {}
    for category, kind in _category_definitions().items():
        fields = {
            "/".join(("", one.item, *filter(None, [one.part]))): (name, one)
            for name, one in FIELDS[category].items()
        }
        readers[category] = _compound_reader([
            reader_of(one.cv_non_spare.cv_rule.cv_variation, fields,
                      f"/{one.cv_non_spare.cv_name}")
            if issubclass(one, base.UapItem) else None
            for one in kind.cv_uap.cv_record.cv_items_list
        ])  # fmt: skip
    return readers


def _compound_reader(items: Sequence[_Reader | None]) -> _Reader:
    """Return a reader of a compound item, whose leading bits tell which parts are present."""

    def read(data: bytes, at: int, values: dict[str, Any]) -> int:
        begin = at
        while data[at] & 1:
            at += 1
        at += 1
        for k, byte in enumerate(data[begin:at]):
            for bit in range(7):
                if byte & 128 >> bit:
                    item = items[7 * k + bit]
                    if item is None:
                        raise ValueError("an item that is not defined")
                    at = item(data, at, values)
        return at

    return read


def _repetition_skipper(counted: int | None, bits: int) -> _Reader:
    """Return a reader that skips a repeated item, by a count or while its last bit is set."""

    def read(data: bytes, at: int, _: dict[str, Any]) -> int:
        if counted is not None:
            return at + counted + int.from_bytes(data[at : at + counted], "big") * bits // 8
        at += (bits + 1) // 8
        while data[at - 1] & 1:
            at += (bits + 1) // 8
        return at

    return read


def _fixed_reader(extents: Sequence[int], takes: Sequence[_Take]) -> _Reader:
    """Return a reader of a fixed-length item, which continues where its last bit is set."""

    def read(data: bytes, at: int, values: dict[str, Any]) -> int:
        end = at + extents[0]
        for more in extents[1:]:
            if not data[end - 1] & 1:
                break
            end += more
        if takes:
            whole, bits = int.from_bytes(data[at:end], "big"), 8 * (end - at)
            for name, last, size, field in takes:
                if last > bits:
                    continue
                steps = whole >> (bits - last) & (1 << size) - 1
                if name == "name":
                    letters = (_LETTERS[steps >> 6 * k & 63] for k in reversed(range(size // 6)))
                    values[name] = "".join(letters).strip()
                    continue
                if field.signed and steps >= 1 << (field.bits - 1):
                    steps -= 1 << field.bits
                values[name] = steps * field.step
        return end

    return read
