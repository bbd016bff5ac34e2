"""A `.conf` file of DAIDALUS: alerters with their levels, and values by key."""

import re
from os import PathLike
from pathlib import Path
from typing import Any

from components.alert_configuration.alerter_keys import AlerterKeys, Lines
from components.alert_configuration.conf_keys import (
    KEYS,
    ONLY_OFF,
    SIGNED,
    UNITS,
    BadValue,
    parse_value_and_unit,
)
from components.alert_configuration.configuration import Configuration
from components.formats.text_rows import MOST_OF_A_CELL, Problems, read_lines
from dsa_des.block.shipped_files import existing_or_shipped_path
from dsa_des.text.safe_text import shorten

#: A file of DAIDALUS 1 has one alerter, without a name, and says track and ground speed.
_OF_RELEASE_1 = re.compile(
    r"(left|right|min|max|step)_(trk|gs)|(trk|gs)_step|recovery_(trk|gs)|alert_\d+_\w+"
    r"|load_core_detection_\w+"
)
#: All problems of a file are said at once; a file with more is no configuration.
_MOST_PROBLEMS = 1000


def read_conf(path: str | PathLike[str]) -> Configuration:
    """Return a DAIDALUS file's configuration, or raise one error with all problems of the file.

    Parameters
    ----------
    path : path-like
        Such as ``mine.conf``, or that of a shipped one: ``alerting/do365b.conf``.

    Returns
    -------
    Configuration

    Raises
    ------
    TrafficFileError
        With all problems of the file: line, key, value, what is allowed.
    """
    path = existing_or_shipped_path(Path(path), str(path))
    problems = Problems(str(path), most=_MOST_PROBLEMS)
    lines = _read_lines_by_key(path, problems)
    _refuse_daidalus_1(lines, path)
    values, units = _read_common_values_and_units(lines, problems)
    keys = AlerterKeys(lines, problems)
    alerters = keys.read_alerters()
    _check_contradictions(values, lines, problems)
    problems.raise_if_any()
    return Configuration(alerters, values, units, keys.left_out)


def _refuse_daidalus_1(lines: Lines, path: Path) -> None:
    """Raise an error if the file is a configuration of DAIDALUS 1, whose keys are not read."""
    old = [name for key, (_, name, _) in lines.items() if _OF_RELEASE_1.fullmatch(key)]
    if old and "alerters" not in lines:
        problems = Problems(str(path))
        problems.fail(
            f"this is a configuration of DAIDALUS 1 ({', '.join(map(shorten, old[:3]))} ...): "
            "files of release 2 are read, which name their alerters (alerters = ...) and begin the "
            "keys of each with its name; directions and speeds are hdir and hs there, trk and gs "
            "here"
        )


def default_values_and_units() -> tuple[dict[str, Any], dict[str, str]]:
    """Return the value of every key that belongs to no alerter, and its unit, by default."""
    values = {
        key: default * UNITS[kind][unit] if isinstance(default, float) and unit else default
        for key, (kind, default, unit) in KEYS.items()
    }
    return values, {key: unit for key, (_, _, unit) in KEYS.items() if unit}


def _read_lines_by_key(path: Path, problems: Problems) -> Lines:
    """Return every line's number, key as written and value's text, by key in lower case."""
    result: Lines = {}
    for number, line in read_lines(path, problems, "a text file", "lines key = value [unit]"):
        text = line.split("#", 1)[0].strip()
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            shown = shorten(text, MOST_OF_A_CELL)
            problems.add(f"{shown!r} is not 'key = value [unit]'", line=number)
        elif key.lower() in result:
            first = result[key.lower()][0]
            problems.add(f"{shorten(key)} stands in line {first} already", line=number)
        else:
            result[key.lower()] = (number, key, value)
    return result


def _read_common_values_and_units(
    lines: Lines, problems: Problems
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return values and units, by key, of keys that belong to no alerter; defaults if missing."""
    values, units = default_values_and_units()
    for key, (kind, default, _) in KEYS.items():
        if key not in lines:
            continue
        number, name, text = lines[key]
        try:
            value, unit = parse_value_and_unit(kind, text, negative=key in SIGNED)
        except BadValue as error:
            problems.add(f"{name} {error}", line=number)
            continue
        if key in ONLY_OFF and value != default:
            problems.add(
                f"{name} is {shorten(text, MOST_OF_A_CELL)}: only {str(default).lower()} is "
                "supported",
                line=number,
            )
        values[key] = value
        if unit:
            units[key] = unit
    if values["daidalus_version"] == "2.0.1":
        # It has no such key: its horizons count from now.
        key = "bands_add_time_to_maneuver"
        if key in lines and not values[key]:
            problems.add(
                f"{key} is false and daidalus_version is 2.0.1, whose horizons count from now: "
                "leave one of them out",
                line=lines[key][0],
            )
        values[key] = True
    return values, units


def _check_contradictions(values: dict[str, Any], lines: Lines, problems: Problems) -> None:
    """Add a problem for each pair of values that contradict each other."""

    def line_number_of(key: str) -> int | None:
        return lines[key][0] if key in lines else None

    for low, high in (("min_hs", "max_hs"), ("min_vs", "max_vs"), ("min_alt", "max_alt")):
        if values[low] >= values[high]:
            problems.add(
                f"{low} must lie below {high}", line=line_number_of(low) or line_number_of(high)
            )
    for key in ("step_hdir", "step_hs", "step_vs", "step_alt", "lookahead_time"):
        if values[key] == 0.0:
            problems.add(f"{key} is 0: it must be above 0", line=line_number_of(key))
    if values["alerting_m"] > values["alerting_n"]:
        problems.add(
            f"alerting_m is {values['alerting_m']}: it must be at most alerting_n, "
            f"{values['alerting_n']}",
            line=line_number_of("alerting_m"),
        )
    if not 0.0 < values["ca_factor"] < 1.0:
        problems.add(
            f"ca_factor is {values['ca_factor']:g}: it must lie between 0 and 1",
            line=line_number_of("ca_factor"),
        )
