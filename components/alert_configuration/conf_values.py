"""One value of a `.conf` file: what is written becomes a number in SI units, a name or a region."""

import math
import re
from typing import Any

from components.alert_configuration.conf_keys import UNITS
from components.alert_configuration.configuration import REGIONS
from components.formats.text_rows import NO_UNIT, clean_token
from dsa_des.errors import nearest
from dsa_des.text.safe_text import shortened

_VALUE = re.compile(r"([^\[\]]*?)\s*(\[[^\]]*\])?")
_YES = {"true": True, "t": True, "1": True, "yes": True}
_NO = {"false": False, "f": False, "0": False, "no": False}


class BadValue(ValueError):
    """A value that cannot be used; the message says why and what is allowed."""


def parse_value(kind: str, text: str, *, negative: bool = False) -> tuple[Any, str]:
    """Return a value and the unit it is written in.

    Parameters
    ----------
    kind : str
        A key of `UNITS`, or "number", "count", "yes or no", "region", "name".
    text : str
        As after the equals sign.
    negative : bool
        Whether the number may be below 0.

    Raises
    ------
    BadValue
    """
    match = _VALUE.fullmatch(text.strip())
    if match is None:
        raise BadValue(f"{shortened(text, 40)!r} is not a value with its unit in brackets")
    plain, unit = match.group(1).strip(), clean_token(match.group(2) or "")
    if not plain:
        raise BadValue("has no value")
    if kind in UNITS:
        return _quantity(kind, plain, unit, negative)
    if unit not in NO_UNIT:
        raise BadValue(f"has the unit [{shortened(unit, 20)}]: it takes none")
    if kind == "name":
        return plain, ""
    if kind == "region":
        return _region(plain), ""
    if kind == "yes or no":
        found = {**_YES, **_NO}.get(plain.lower())
        if found is None:
            raise BadValue(f"is {shortened(plain, 40)!r}: it must be true or false")
        return found, ""
    value = _number(plain, negative)
    if kind == "count":
        if value != int(value):
            raise BadValue(f"is {plain}: a whole number is needed")
        return int(value), ""
    return value, ""


def _quantity(kind: str, plain: str, unit: str, negative: bool) -> tuple[float, str]:
    factors = UNITS[kind]
    value = _number(plain, negative)
    shown = ", ".join(factors)
    if unit in NO_UNIT:
        raise BadValue(f"has no unit: it needs one in brackets, of {shown}")
    if unit not in factors:
        close = nearest(unit, factors)
        hint = f"; did you mean [{close}]?" if close else ""
        raise BadValue(f"has the unit [{shortened(unit, 20)}]: it must be one of {shown}{hint}")
    return value * factors[unit], unit


def _region(plain: str) -> str:
    allowed = REGIONS[:4]
    if plain.upper() not in allowed:
        close = nearest(plain, allowed)
        hint = f"; did you mean {close!r}?" if close else ""
        raise BadValue(f"is {shortened(plain, 40)!r}: it must be one of {', '.join(allowed)}{hint}")
    return plain.upper()


def _number(plain: str, negative: bool) -> float:
    try:
        if "_" in plain:  # which float() takes and the format does not
            raise ValueError(plain)
        value = float(plain)
    except ValueError:
        raise BadValue(f"is {shortened(plain, 40)!r}: a number is needed") from None
    if not math.isfinite(value):
        raise BadValue(f"is {shortened(plain, 40)}: a finite number is needed")
    if value < 0.0 and not negative:
        raise BadValue(f"is {shortened(plain, 40)}: it may not be negative")
    return value
