"""A `.conf` file of DAIDALUS: alerters with their levels, and values by key."""

import re
from os import PathLike
from pathlib import Path
from typing import Any

from components.alert_configuration.conf_keys import (
    CLASS_PREFIX,
    CLASSES,
    KEYS,
    LEVEL_KEYS,
    ONLY_OFF,
    SIGNED,
    TCAS_CLASS,
    TCAS_KEYS,
    UNITS,
    VOLUME_KEYS,
    BadValue,
    parse_value,
)
from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.formats.text_rows import MOST_OF_A_CELL, Problems, did_you_mean, read_lines
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.block.shipped_files import found_or_shipped
from dsa_des.text.safe_text import shortened

_LEVEL = re.compile(r"alert_(\d{1,3})_(\w+)")
_LEVEL_OF = re.compile(r"(.+)_alert_\d{1,3}_(\w+)")
_CLASS = "load_core_detection_"
_SPREADS = tuple(key for key in LEVEL_KEYS if key.startswith("spread_"))


class AlerterKeys:
    """Reads the keys that begin with the name of an alerter, and notes all that is wrong.

    Of each key in lower case, `lines` has the line number, the key as written and the value's text.
    """

    def __init__(self, lines: dict[str, tuple[int, str, str]], problems: Problems) -> None:
        self._lines, self._problems = lines, problems
        self._used = {key for key in lines if key in KEYS} | {"alerters"}
        self._expected: set[str] = {*KEYS, "alerters"}
        #: Alerters that the file holds and `alerters` does not name: they are ignored.
        self.left_out: tuple[str, ...] = ()

    def alerters(self) -> tuple[Alerter, ...]:
        """Return all alerters in the order in which the key ``alerters`` names them."""
        if "alerters" not in self._lines:
            self._problems.add("there is no key 'alerters': it names at least one alerter")
            self._note_unknown()
            return ()
        number, _, text = self._lines["alerters"]
        names = [name.strip() for name in text.split(",") if name.strip()]
        if not names:
            self._problems.add("alerters is empty: it names at least one alerter", line=number)
        if len({name.lower() for name in names}) < len(names):
            self._problems.add("alerters names one alerter twice", line=number)
        # The longest name first: one may be the beginning of another.
        prefixes = {name: name.lower() + "_" for name in sorted(names, key=len, reverse=True)}
        result = {name: self._alerter(name, prefix, number) for name, prefix in prefixes.items()}
        self._leave_out(tuple(prefixes.values()))
        self._note_unknown()
        return tuple(alerter for name in names if (alerter := result[name]) is not None)

    def _alerter(self, name: str, prefix: str, named_in: int) -> Alerter | None:
        of_level: dict[int, set[str]] = {}
        for key in self._lines:
            match = _LEVEL.fullmatch(key[len(prefix) :]) if key.startswith(prefix) else None
            if match and match.group(2) in LEVEL_KEYS and key not in self._used:
                of_level.setdefault(int(match.group(1)), set()).add(match.group(2))
        count = max(of_level, default=0)
        if not of_level:
            self._expected |= {f"{prefix}alert_1_{key}" for key in LEVEL_KEYS}
            self._problems.add(
                f"the alerter {shortened(name)!r} has no levels: {name}_alert_1_detector and "
                "others are needed",
                line=named_in,
            )
            return None
        levels = []
        for number in range(1, count + 1):
            if number not in of_level:
                self._problems.add(
                    f"the alerter {shortened(name)!r} has level {count} but no level {number}",
                    line=named_in,
                )
                return None
            levels.append(self._level(name, prefix, number))
        return Alerter(name, tuple(level for level in levels if level is not None))

    def _level(self, name: str, prefix: str, number: int) -> Level | None:
        begin = f"{prefix}alert_{number}_"
        values: dict[str, Any] = {}
        for key, kind in LEVEL_KEYS.items():
            needed = key in ("region", "detector", "alerting_time")
            values[key] = self._value(begin + key, kind, needed, f"{name}_alert_{number}_{key}")
        if values["detector"] is None:
            return None
        volume = self._volume(name, prefix, str(values["detector"]), begin + "detector")
        if volume is None or values["region"] is None or values["alerting_time"] is None:
            return None
        early_s = values["early_alerting_time"]
        alerting_s = float(values["alerting_time"])
        return Level(
            volume[0],
            str(values["region"]),
            alerting_s,
            alerting_s if early_s is None else float(early_s),
            volume[1],
            tuple((key.removeprefix("spread_"), values[key]) for key in _SPREADS if values[key]),
        )

    def _volume(
        self, name: str, prefix: str, detector: str, named_by: str
    ) -> tuple[Volume | TcasAdvisory, bool] | None:
        """Return the volume of a detector and whether bounds on the states count."""
        key = f"{prefix}{_CLASS}{detector.lower()}"
        self._expected.add(key)
        if key not in self._lines:
            known = [
                line[1][len(prefix + _CLASS) :]
                for other, line in self._lines.items()
                if other.startswith(prefix + _CLASS)
            ]
            self._problems.add(
                f"{self._lines[named_by][1]} is {shortened(detector)!r}: {name}_{_CLASS}"
                f"{shortened(detector)} is missing{did_you_mean(detector, known)}",
                line=self._lines[named_by][0],
            )
            return None
        self._used.add(key)
        number, _, text = self._lines[key]
        class_name = text.rpartition(".")[2]
        allowed = (*CLASSES, TCAS_CLASS)
        if text not in {CLASS_PREFIX + known for known in allowed}:
            self._problems.add(
                f"{self._lines[key][1]} is {shortened(text, 80)!r}: it must be {CLASS_PREFIX} and "
                f"one of {', '.join(allowed)}{did_you_mean(class_name, allowed)}",
                line=number,
            )
        begin = f"{prefix}{detector.lower()}_"
        if class_name == TCAS_CLASS:
            ((which, kind),) = TCAS_KEYS.items()
            shown = f"{name}_{detector}_{which}"
            return TcasAdvisory(bool(self._value(begin + which.lower(), kind, False, shown))), False
        sizes = {
            size: self._value(
                begin + size.lower(), kind, size != "WCV_TCOA", f"{name}_{detector}_{size}"
            )
            for size, kind in VOLUME_KEYS.items()
        }
        if class_name not in CLASSES or any(sizes[s] is None for s in list(VOLUME_KEYS)[:3]):
            return None
        for size in ("WCV_DTHR", "WCV_ZTHR"):
            if sizes[size] == 0.0:
                at = self._lines[begin + size.lower()]
                self._problems.add(f"{at[1]} is 0: it must be above 0", line=at[0])
                return None
        made = Volume(
            sizes["WCV_DTHR"],
            sizes["WCV_ZTHR"],
            sizes["WCV_TTHR"],
            sizes["WCV_TCOA"] or 0.0,
            CLASSES[class_name],
        )
        return made, class_name.endswith("_SUM")

    def _value(self, key: str, kind: str, needed: bool, shown: str) -> Any:
        """Return a value, or None where it is missing or wrong."""
        self._expected.add(key)
        if key not in self._lines:
            if needed:
                self._problems.add(f"the key {shortened(shown)!r} is missing")
            return None
        number, name, text = self._lines[key]
        self._used.add(key)
        try:
            return parse_value(kind, text)[0]
        except BadValue as error:
            self._problems.add(f"{name} {error}", line=number)
            return None

    def _leave_out(self, named: tuple[str, ...]) -> None:
        """Ignore the keys of whole alerters other than those with the prefixes `named`."""
        free = self._lines.keys() - self._used
        result: dict[str, str] = {}
        for key in free:
            match = _LEVEL_OF.fullmatch(key)
            if match is None or match.group(2) != "detector":
                continue
            prefix = match.group(1) + "_"
            if any(other.startswith(prefix + _CLASS) for other in free):
                result[prefix] = self._lines[key][1][: len(prefix) - 1]
        for prefix in result:
            longer = tuple(other for other in named if other.startswith(prefix))
            self._used |= {k for k in free if k.startswith(prefix) and not k.startswith(longer)}
        self.left_out = tuple(sorted(result.values()))

    def _note_unknown(self) -> None:
        for key in sorted(self._lines.keys() - self._used):
            number, name, _ = self._lines[key]
            free = self._expected - self._used
            hint = did_you_mean(key, free) or did_you_mean(key, self._expected)
            self._problems.add(
                f"the key {shortened(name, 3 * MOST_OF_A_CELL)!r} is unknown{hint}", line=number
            )


Lines = dict[str, tuple[int, str, str]]


def read_conf(path: str | PathLike[str]) -> Configuration:
    """Read a configuration.

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
        With all problems of the file (up to 20): line, key, value, what is allowed.
    """
    path = found_or_shipped(Path(path), str(path))
    problems = Problems(str(path))
    lines = _lines(path, problems)
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
    result: Lines = {}
    for number, line in read_lines(path, problems, "a text file", "lines key = value [unit]"):
        text = line.split("#", 1)[0].strip()
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            shown = shortened(text, MOST_OF_A_CELL)
            problems.add(f"{shown!r} is not 'key = value [unit]'", line=number)
        elif key.lower() in result:
            first = result[key.lower()][0]
            problems.add(f"{shortened(key)} stands in line {first} already", line=number)
        else:
            result[key.lower()] = (number, key, value)
    return result


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
