"""Labels of a study's figures: ``Radar scan rate (Hz)`` for ``blocks.radar.scan_rate_hz``."""

import math
import re

from dsa_des.record.drawing import figure_text
from dsa_des.text.safe_text import shorten

#: How units at the end of a name are written.
_UNITS = {
    "s": "s", "m": "m", "km": "km", "hz": "Hz", "deg": "°", "rad": "rad", "mps": "m/s", "m2": "m²",
    "db": "dB", "dbsm": "dBsm", "dbm": "dBm", "ppm": "ppm", "w": "W", "k": "K", "ft": "ft",
    "px": "px", "pixels": "pixels", "percent": "%", "mrad": "mrad", "mm": "mm",
}  # fmt: skip
#: Units of two words, such as ``mm_per_h``.
_PER = re.compile(r"_([a-z]+2?)_per_([a-z]+)$")
#: Words of two letters that are none but words.
_WORDS = {"at", "by", "in", "is", "no", "of", "on", "or", "to", "up"}
#: Abbreviations that hold vowels.
_ABBREVIATIONS = {"nees", "ospa", "gospa", "nmac", "siap"}
_CONSONANTS = re.compile(r"[bcdfghjklmnpqrstvwxz]{2,4}")


class AxisName(str):
    """The column name of an axis, with words for messages if its key passes through list items."""

    words: str

    def __new__(cls, column: str, words: str = "") -> "AxisName":
        """Return the column; without `words` it is called what it is."""
        name = super().__new__(cls, column)
        name.words = words or column
        return name


def unit_of(name: str) -> str:
    """Return the unit in a column's name: ``m`` in ``declaration_range_m.radar``; empty if none."""
    return _split_unit(name.partition(".")[0])[1]


def readable_label(name: str) -> str:
    """Return ``Declaration range, radar (m)`` for ``declaration_range_m.radar``."""
    words, _, who = name.partition(".")
    words, unit = _split_unit(words)
    what = _capitalise(_readable_words(words)) + (f", {_readable_words(who)}" if who else "")
    return figure_text(f"{what} ({unit})" if unit else what, 60)


def axis_label(key: str) -> str:
    """Return ``Radar scan rate (Hz)`` for ``radar.scan_rate_hz``, ``Type of fusion`` for a swap."""
    if key.startswith("swap."):
        return figure_text(f"Type of {_readable_words(key.removeprefix('swap.'))}", 60)
    key = key.words if isinstance(key, AxisName) else key
    words, unit = _split_unit(key.removeprefix("blocks."))
    label = _capitalise(_readable_words(words.replace(".", " ")))
    return figure_text(f"{label} ({unit})" if unit else label, 60)


def value_label(axis: str, value: object) -> str:
    """Return the label of an axis value: ``radar scan rate 5 Hz`` for a number, a text as it is."""
    if not isinstance(value, int | float):
        return figure_text(value)
    words, unit = _split_unit(axis.words if isinstance(axis, AxisName) else axis)
    name = _readable_words(words.replace(".", " "))
    # However long the name is, the value stands behind it.
    return f"{figure_text(name, 50)} {value:g}{'' if unit in ('', '°') else ' '}{unit}"


def short_text(value: object) -> str:
    """Return a value as table text: five significant digits, NaN as a dash, long texts cut."""
    if isinstance(value, float):
        return "-" if value != value else f"{value:.5g}"
    return shorten(value)


def texts_rounded_to_interval(half: float, *numbers: float) -> list[str]:
    """Return numbers as texts, rounded to the second significant digit of the half-width `half`."""
    places = 1 - math.floor(math.log10(half))
    return [f"{round(number, places) + 0.0:,.{max(places, 0)}f}" for number in numbers]


def format_with_interval(value: float, half: float) -> str:
    """Return a difference as ``+1.24 ± 0.13`` (half-width), or three digits without interval."""
    sign = "+" if value > 0 else ""
    if not 0.0 < half < math.inf:
        return sign + (f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}")
    return sign + " ± ".join(texts_rounded_to_interval(half, value, half))


def _split_unit(name: str) -> tuple[str, str]:
    """Return (name without unit, unit as printed): ``speed`` and ``m/s`` for ``speed_m_s``."""
    match = _PER.search(name)
    if match:
        above, below = (_UNITS.get(part, part) for part in match.groups())
        return name[: match.start()], f"{above}/{below}"
    rest, _, ending = name.rpartition("_")
    if rest.endswith("_m") and ending == "s":
        return rest.removesuffix("_m"), "m/s"
    return (rest, _UNITS[ending]) if rest and ending in _UNITS else (name, "")


#: An item of a list in a key, as ``wires[4]``.
_ITEM = re.compile(r"(\w+?)s?\[(\d+)\]")


def _readable_words(name: str) -> str:
    name = _ITEM.sub(lambda match: f"{match[1]} {int(match[2]) + 1}", name)
    words = name.replace("_", " ").split(" ")
    return " ".join(word.upper() if _is_abbreviation(word) else word for word in words)


def _is_abbreviation(word: str) -> bool:
    """Return whether a word is an abbreviation: IR, RCS, SNR."""
    two = len(word) == 2 and word.isalpha() and word not in _WORDS
    return two or word in _ABBREVIATIONS or bool(_CONSONANTS.fullmatch(word))


def _capitalise(text: str) -> str:
    return text[:1].upper() + text[1:]
