"""Read a DAIDALUS `.conf` file: lines of ``key = value [unit]``, comments after #."""

from os import PathLike
from pathlib import Path
from typing import Any

from components.alert_configuration.conf_alerters import AlerterKeys
from components.alert_configuration.conf_keys import KEYS, ONLY_OFF, SIGNED, UNITS
from components.alert_configuration.conf_values import BadValue, parse_value
from components.alert_configuration.configuration import Configuration
from components.formats.text_rows import MOST_OF_A_CELL, Problems, read_lines
from dsa_des.text.safe_text import shortened

Lines = dict[str, tuple[int, str, str]]


def read_conf(path: str | PathLike[str]) -> Configuration:
    """Read a configuration.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Configuration

    Raises
    ------
    TrafficFileError
        With all problems of the file (up to 20): line, key, value, what is allowed.
    """
    problems = Problems(str(path))
    lines = _lines(Path(path), problems)
    values, units = _values(lines, problems)
    keys = AlerterKeys(lines, problems)
    alerters = keys.alerters()
    _check_together(values, lines, problems)
    problems.raise_if_any()
    return Configuration(alerters, values, units, keys.left_out)


def default_values() -> tuple[dict[str, Any], dict[str, str]]:
    """Return the value of every key that belongs to no alerter, and its unit, by default."""
    values = {
        key: default * UNITS[kind][unit] if isinstance(default, float) and unit else default
        for key, (kind, default, unit) in KEYS.items()
    }
    return values, {key: unit for key, (_, _, unit) in KEYS.items() if unit}


def _lines(path: Path, problems: Problems) -> Lines:
    """Return line number, key as written and text of the value by key in lower case."""
    found: Lines = {}
    for number, line in read_lines(path, problems, "a text file", "lines key = value [unit]"):
        text = line.split("#", 1)[0].strip()
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            shown = shortened(text, MOST_OF_A_CELL)
            problems.add(f"{shown!r} is not 'key = value [unit]'", line=number)
        elif key.lower() in found:
            first = found[key.lower()][0]
            problems.add(f"{shortened(key)} stands in line {first} already", line=number)
        else:
            found[key.lower()] = (number, key, value)
    return found


def _values(lines: Lines, problems: Problems) -> tuple[dict[str, Any], dict[str, str]]:
    """Read the keys that belong to no alerter."""
    values, units = default_values()
    for key, (kind, default, _) in KEYS.items():
        if key not in lines:
            continue
        number, name, text = lines[key]
        try:
            value, unit = parse_value(kind, text, negative=key in SIGNED)
        except BadValue as error:
            problems.add(f"{name} {error}", line=number)
            continue
        if key in ONLY_OFF and value != default:
            problems.add(
                f"{name} is {shortened(text, MOST_OF_A_CELL)}: only {str(default).lower()} is "
                "supported",
                line=number,
            )
        values[key] = value
        if unit:
            units[key] = unit
    return values, units


def _check_together(values: dict[str, Any], lines: Lines, problems: Problems) -> None:
    """Note values that do not fit each other."""

    def at(key: str) -> int | None:
        return lines[key][0] if key in lines else None

    for low, high in (("min_hs", "max_hs"), ("min_vs", "max_vs"), ("min_alt", "max_alt")):
        if values[low] >= values[high]:
            problems.add(f"{low} must lie below {high}", line=at(low) or at(high))
    for key in ("step_hdir", "step_hs", "step_vs", "step_alt", "lookahead_time"):
        if values[key] == 0.0:
            problems.add(f"{key} is 0: it must be above 0", line=at(key))
    if values["alerting_m"] > values["alerting_n"]:
        problems.add(
            f"alerting_m is {values['alerting_m']}: it must be at most alerting_n, "
            f"{values['alerting_n']}",
            line=at("alerting_m"),
        )
    if not 0.0 < values["ca_factor"] < 1.0:
        problems.add(
            f"ca_factor is {values['ca_factor']:g}: it must lie between 0 and 1",
            line=at("ca_factor"),
        )
