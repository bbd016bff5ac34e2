"""Keys and values of a `.conf` file that belong to no alerter: kinds, units and defaults."""

import math
import re
from collections.abc import Mapping
from typing import Any

from components.alert_configuration.configuration import REGIONS, VERSIONS, VERSIONS_BETWEEN
from components.arguments.units import FOOT_M, STANDARD_GRAVITY_M_S2
from components.formats.text_rows import (
    ANGLE_DEG,
    LENGTH_M,
    NO_UNIT,
    SPEED_MPS,
    TIME_S,
    clean_token,
)
from dsa_des.errors import nearest_name
from dsa_des.text.safe_text import shorten

#: Units by kind of value, each with its factor to SI units (radians for angles).
UNITS: Mapping[str, Mapping[str, float]] = {
    "time": TIME_S,
    "length": LENGTH_M,
    "speed": SPEED_MPS,
    "angle": {unit: math.radians(factor) for unit, factor in ANGLE_DEG.items()},
    "turn rate": {"deg/s": math.radians(1.0), "rad/s": 1.0},
    "acceleration": {"m/s^2": 1.0, "g": STANDARD_GRAVITY_M_S2, "ft/s^2": FOOT_M},
}

#: Kind, default and its unit of each key.
KEYS: Mapping[str, tuple[str, object, str]] = {
    "lookahead_time": ("time", 180.0, "s"),
    "left_hdir": ("angle", 180.0, "deg"),
    "right_hdir": ("angle", 180.0, "deg"),
    "min_hs": ("speed", 10.0, "knot"),
    "max_hs": ("speed", 700.0, "knot"),
    "min_airspeed": ("speed", 10.0, "knot"),
    "min_vs": ("speed", -6000.0, "fpm"),
    "max_vs": ("speed", 6000.0, "fpm"),
    "min_alt": ("length", 100.0, "ft"),
    "max_alt": ("length", 50000.0, "ft"),
    "below_relative_hs": ("speed", 0.0, "knot"),
    "above_relative_hs": ("speed", 0.0, "knot"),
    "below_relative_vs": ("speed", 0.0, "fpm"),
    "above_relative_vs": ("speed", 0.0, "fpm"),
    "below_relative_alt": ("length", 0.0, "ft"),
    "above_relative_alt": ("length", 0.0, "ft"),
    "step_hdir": ("angle", 1.0, "deg"),
    "step_hs": ("speed", 5.0, "knot"),
    "step_vs": ("speed", 100.0, "fpm"),
    "step_alt": ("length", 100.0, "ft"),
    "turn_rate": ("turn rate", 3.0, "deg/s"),
    "bank_angle": ("angle", 0.0, "deg"),
    "horizontal_accel": ("acceleration", 2.0, "m/s^2"),
    "vertical_accel": ("acceleration", 0.25, "g"),
    "vertical_rate": ("speed", 500.0, "fpm"),
    "min_horizontal_recovery": ("length", 0.0, "nmi"),
    "min_vertical_recovery": ("length", 0.0, "ft"),
    "recovery_hdir": ("yes or no", True, ""),
    "recovery_hs": ("yes or no", True, ""),
    "recovery_vs": ("yes or no", True, ""),
    "recovery_alt": ("yes or no", True, ""),
    "recovery_stability_time": ("time", 3.0, "s"),
    "ca_bands": ("yes or no", False, ""),
    "ca_factor": ("number", 0.1, ""),
    "horizontal_nmac": ("length", 500.0, "ft"),
    "vertical_nmac": ("length", 100.0, "ft"),
    "hysteresis_time": ("time", 0.0, "s"),
    "persistence_time": ("time", 0.0, "s"),
    "bands_persistence": ("yes or no", False, ""),
    "persistence_preferred_hdir": ("angle", 0.0, "deg"),
    "persistence_preferred_hs": ("speed", 0.0, "knot"),
    "persistence_preferred_vs": ("speed", 0.0, "fpm"),
    "persistence_preferred_alt": ("length", 0.0, "ft"),
    "alerting_m": ("count", 0, ""),
    "alerting_n": ("count", 0, ""),
    "h_pos_z_score": ("number", 0.0, ""),
    "h_vel_z_score_min": ("number", 0.0, ""),
    "h_vel_z_score_max": ("number", 0.0, ""),
    "h_vel_z_distance": ("length", 0.0, "nmi"),
    "v_pos_z_score": ("number", 0.0, ""),
    "v_vel_z_score": ("number", 0.0, ""),
    "corrective_region": ("region", "NEAR", ""),
    "ownship_centric_alerting": ("yes or no", True, ""),
    "bands_add_time_to_maneuver": ("yes or no", False, ""),
    "conflict_crit": ("yes or no", False, ""),
    "recovery_crit": ("yes or no", False, ""),
    "hdir_bands_below_min_as": ("count", 0, ""),
    "contour_thr": ("angle", 180.0, "deg"),
    "dta_logic": ("count", 0, ""),
    "dta_latitude": ("angle", 0.0, "deg"),
    "dta_longitude": ("angle", 0.0, "deg"),
    "dta_radius": ("length", 0.0, "nmi"),
    "dta_height": ("length", 0.0, "ft"),
    "dta_alerter": ("count", 0, ""),
    "daidalus_version": ("version", "2.0.4", ""),
}

#: Keys that only their default may be given for, since what they switch on is not there.
ONLY_OFF = ("conflict_crit", "recovery_crit", "hdir_bands_below_min_as", "dta_logic")
#: Keys that may be negative.
SIGNED = ("min_vs", "max_vs", "min_alt", "max_alt", "dta_latitude", "dta_longitude", "dta_logic")

#: Keys of one level, after ``<alerter>_alert_<level>_``; `early_alerting_time` and spreads may be
#: left out.
LEVEL_KEYS: Mapping[str, str] = {
    "region": "region",
    "detector": "name",
    "alerting_time": "time",
    "early_alerting_time": "time",
    "spread_hdir": "angle",
    "spread_hs": "speed",
    "spread_vs": "speed",
    "spread_alt": "length",
}
#: Keys of one volume, after ``<alerter>_<detector>_``.
VOLUME_KEYS: Mapping[str, str] = {
    "WCV_DTHR": "length",
    "WCV_ZTHR": "length",
    "WCV_TTHR": "time",
    "WCV_TCOA": "time",
}
#: Keys of the class TCAS3D: its tables are fixed, and one key says which of them.
TCAS_KEYS: Mapping[str, str] = {"TCAS3D_RA": "yes or no"}
TCAS_CLASS = "TCAS3D"
#: Time variable by class of volume.
CLASSES: Mapping[str, str] = {
    "WCV_TAUMOD": "modified_tau",
    "WCV_TCPA": "time_to_closest",
    "WCV_TEP": "time_to_entry",
    "WCV_TAUMOD_SUM": "modified_tau",
}
#: A cylinder: its radius and half its height.
CYLINDER_CLASS = "CDCylinder"
CYLINDER_KEYS: Mapping[str, str] = {"D": "length", "H": "length"}
CLASS_PREFIX = "gov.nasa.larcfm.ACCoRD."


_VALUE = re.compile(r"([^\[\]]*?)\s*(\[[^\]]*\])?")
_YES = {"true": True, "t": True, "1": True, "yes": True}
_NO = {"false": False, "f": False, "0": False, "no": False}


class BadValue(ValueError):
    """A value that cannot be used; the message says why and what is allowed."""


def parse_value_and_unit(kind: str, text: str, *, negative: bool = False) -> tuple[Any, str]:
    """Return a text's value, in SI units or as its kind demands, and its unit, empty for none."""
    match = _VALUE.fullmatch(text.strip())
    if match is None:
        raise BadValue(f"{shorten(text, 40)!r} is not a value with its unit in brackets")
    plain, unit = match.group(1).strip(), clean_token(match.group(2) or "")
    if not plain:
        raise BadValue("has no value")
    if kind in UNITS:
        return _parse_quantity(kind, plain, unit, negative)
    if unit not in NO_UNIT:
        raise BadValue(f"has the unit [{shorten(unit, 20)}]: it takes none")
    if kind == "name":
        return plain, ""
    if kind == "region":
        return _parse_region(plain), ""
    if kind == "version":
        plain = plain.strip("\"'")
        if plain not in (*VERSIONS, *VERSIONS_BETWEEN):
            close = nearest_name(plain, VERSIONS)
            hint = f"; did you mean {close}?" if close else ""
            allowed = " or ".join(VERSIONS)
            raise BadValue(
                f"is {shorten(plain, 40)!r}: it must be {allowed}, whose rules are known, or a "
                f"release between them{hint}"
            )
        return plain, ""
    if kind == "yes or no":
        result = {**_YES, **_NO}.get(plain.lower())
        if result is None:
            raise BadValue(f"is {shorten(plain, 40)!r}: it must be true or false")
        return result, ""
    value = _parse_number(plain, negative)
    if kind == "count":
        if value != int(value):
            raise BadValue(f"is {plain}: a whole number is needed")
        return int(value), ""
    return value, ""


def _parse_quantity(kind: str, plain: str, unit: str, negative: bool) -> tuple[float, str]:
    factors = UNITS[kind]
    value = _parse_number(plain, negative)
    shown = ", ".join(factors)
    if unit in NO_UNIT:
        raise BadValue(f"has no unit: it needs one in brackets, of {shown}")
    if unit not in factors:
        close = nearest_name(unit, factors)
        hint = f"; did you mean [{close}]?" if close else ""
        raise BadValue(f"has the unit [{shorten(unit, 20)}]: it must be one of {shown}{hint}")
    return value * factors[unit], unit


def _parse_region(plain: str) -> str:
    allowed = REGIONS[:4]
    if plain.upper() not in allowed:
        close = nearest_name(plain, allowed)
        hint = f"; did you mean {close!r}?" if close else ""
        raise BadValue(f"is {shorten(plain, 40)!r}: it must be one of {', '.join(allowed)}{hint}")
    return plain.upper()


def _parse_number(plain: str, negative: bool) -> float:
    try:
        if "_" in plain:  # which float() takes and the format does not
            raise ValueError(plain)
        value = float(plain)
    except ValueError:
        raise BadValue(f"is {shorten(plain, 40)!r}: a number is needed") from None
    if not math.isfinite(value):
        raise BadValue(f"is {shorten(plain, 40)}: a finite number is needed")
    if value < 0.0 and not negative:
        raise BadValue(f"is {shorten(plain, 40)}: it may not be negative")
    return value
