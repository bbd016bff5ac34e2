"""The keys of a `.conf` file that begin with the name of an alerter: its levels and volumes."""

import re
from difflib import get_close_matches
from typing import Any

from components.alert_configuration.conf_keys import (
    CLASS_PREFIX,
    CLASSES,
    CYLINDER_CLASS,
    CYLINDER_KEYS,
    KEYS,
    LEVEL_KEYS,
    TCAS_CLASS,
    TCAS_KEYS,
    VOLUME_KEYS,
    BadValue,
    parse_value_and_unit,
)
from components.alert_configuration.configuration import Alerter, Level
from components.alert_configuration.tcas_tables import TableKeys
from components.formats.text_rows import MOST_OF_A_CELL, Problems, did_you_mean
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.errors import nearest_name
from dsa_des.text.safe_text import shorten

#: Of each key in lower case its line number, the key as written and the text of its value.
Lines = dict[str, tuple[int, str, str]]
_LEVEL = re.compile(r"alert_(\d{1,3})_(\w+)")
_LEVEL_OF = re.compile(r"(.+)_alert_\d{1,3}_(\w+)")
_CLASS = "load_core_detection_"
#: From so alike on, one long key is another misspelt: most of them have half their letters alike.
_ALIKE = 0.9
_SPREADS = tuple(key for key in LEVEL_KEYS if key.startswith("spread_"))


class AlerterKeys:
    """Reads the keys that begin with the name of an alerter, and notes all that is wrong."""

    def __init__(self, lines: Lines, problems: Problems) -> None:
        self._lines, self._problems = lines, problems
        self._used = {key for key in lines if key in KEYS} | {"alerters"}
        #: As they are written, by the key in lower case.
        self._expected: dict[str, str] = {key: key for key in (*KEYS, "alerters")}
        #: Alerters, as their keys begin, one of whose levels names a detector that is not there.
        self._misspelt: set[str] = set()
        #: What keys of alerters and of their detectors begin with, as it is written.
        self._beginnings: dict[str, str] = {}
        #: Alerters that the file holds and `alerters` does not name: they are ignored.
        self.left_out: tuple[str, ...] = ()

    def read_alerters(self) -> tuple[Alerter, ...]:
        """Return all alerters in the order of key ``alerters``; collect their keys' problems."""
        if "alerters" not in self._lines:
            self._problems.add("there is no key 'alerters': it names at least one alerter")
            self._note_unknown_keys()
            return ()
        number, _, text = self._lines["alerters"]
        names = [name.strip() for name in text.split(",") if name.strip()]
        if not names:
            self._problems.add("alerters is empty: it names at least one alerter", line=number)
        if len({name.lower() for name in names}) < len(names):
            self._problems.add("alerters names one alerter twice", line=number)
        # The longest name first: one may be the beginning of another.
        prefixes = {name: name.lower() + "_" for name in sorted(names, key=len, reverse=True)}
        self._beginnings = {prefix: name + "_" for name, prefix in prefixes.items()}
        result = {
            name: self._read_alerter(name, prefix, number) for name, prefix in prefixes.items()
        }
        self._ignore_alerters_except(tuple(prefixes.values()))
        for name, prefix in prefixes.items():
            self._note_idle_detectors(name, prefix)
        self._note_unknown_keys()
        return tuple(alerter for name in names if (alerter := result[name]) is not None)

    def _read_alerter(self, name: str, prefix: str, named_in: int) -> Alerter | None:
        of_level: dict[int, set[str]] = {}
        for key in self._lines:
            match = _LEVEL.fullmatch(key[len(prefix) :]) if key.startswith(prefix) else None
            if match and match.group(2) in LEVEL_KEYS and key not in self._used:
                of_level.setdefault(int(match.group(1)), set()).add(match.group(2))
        count = max(of_level, default=0)
        if not of_level:
            self._problems.add(
                f"the alerter {shorten(name)!r} has no levels: {name}_alert_1_detector and "
                f"others are needed{did_you_mean(name, self._alerter_names_except(prefix))}",
                line=named_in,
            )
            return None
        levels = []
        for number in range(1, count + 1):
            if number not in of_level:
                self._problems.add(
                    f"the alerter {shorten(name)!r} has level {count} but no level {number}",
                    line=named_in,
                )
                return None
            levels.append(self._read_level(name, prefix, number))
        return Alerter(name, tuple(level for level in levels if level is not None))

    def _read_level(self, name: str, prefix: str, number: int) -> Level | None:
        begin = f"{prefix}alert_{number}_"
        values: dict[str, Any] = {}
        for key, kind in LEVEL_KEYS.items():
            needed = key in ("region", "detector", "alerting_time")
            values[key] = self._read_value(
                begin + key, kind, needed, f"{name}_alert_{number}_{key}"
            )
        if values["detector"] is None:
            return None
        volume = self._read_volume(name, prefix, str(values["detector"]), begin + "detector")
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

    def _read_volume(
        self, name: str, prefix: str, detector: str, named_by: str
    ) -> tuple[Volume | TcasAdvisory, bool] | None:
        """Return the volume (or TCAS advisory) of a detector and whether errors of the states
        enlarge it; None after adding a problem.
        """
        key = f"{prefix}{_CLASS}{detector.lower()}"
        begin = f"{prefix}{detector.lower()}_"
        self._expected[key] = f"{name}_{_CLASS}{detector}"
        self._beginnings[begin] = f"{name}_{detector}_"
        if key not in self._lines:
            of_it = {k for k in self._lines if k.startswith(begin)}
            known = [
                line[1][len(prefix + _CLASS) :]
                for other, line in self._lines.items()
                if other.startswith(prefix + _CLASS) and not of_it
            ]
            self._problems.add(
                f"{self._lines[named_by][1]} is {shorten(detector)!r}: {name}_{_CLASS}"
                f"{shorten(detector)} is missing{did_you_mean(detector, known)}",
                line=self._lines[named_by][0],
            )
            # Whichever of the two is misspelt, of its sizes there is nothing to say.
            self._used |= of_it
            self._misspelt.add(prefix)
            return None
        self._used.add(key)
        number, _, text = self._lines[key]
        class_name = text.rpartition(".")[2]
        allowed = (*CLASSES, CYLINDER_CLASS, TCAS_CLASS)
        wrong = text not in {CLASS_PREFIX + known for known in allowed}
        if wrong:
            self._problems.add(
                f"{self._lines[key][1]} is {shorten(text, 80)!r}: it must be {CLASS_PREFIX} and "
                f"one of {', '.join(allowed)}{did_you_mean(class_name, allowed)}",
                line=number,
            )
            # Its sizes are those of the class that is meant; of none there is nothing to say.
            class_name = nearest_name(class_name, allowed) or ""
        if not class_name:
            self._used |= {k for k in self._lines if k.startswith(begin)}
            return None
        if class_name == TCAS_CLASS:
            advisory = self._read_advisory(f"{name}_{detector}", begin, number)
            return None if advisory is None else (advisory, False)
        keys = CYLINDER_KEYS if class_name == CYLINDER_CLASS else VOLUME_KEYS
        sizes = {
            size: self._read_value(
                begin + size.lower(), kind, size != "WCV_TCOA", f"{name}_{detector}_{size}"
            )
            for size, kind in keys.items()
        }
        if wrong or any(sizes[s] is None for s in keys if s != "WCV_TCOA"):
            return None
        for size in list(keys)[:2]:
            if sizes[size] == 0.0:
                at = self._lines[begin + size.lower()]
                self._problems.add(f"{at[1]} is 0: it must be above 0", line=at[0])
                return None
        radius_m, half_m, *times_s = (float(sizes[size] or 0.0) for size in keys)
        if class_name == CYLINDER_CLASS:
            return Volume(radius_m, half_m), False
        made = Volume(radius_m, half_m, times_s[0], times_s[1], CLASSES[class_name])
        return made, class_name.endswith("_SUM")

    def _read_advisory(self, name: str, begin: str, line: int) -> TcasAdvisory | None:
        """Return an advisory of TCAS II; a table that is written out must be the known one."""
        ((which, kind),) = TCAS_KEYS.items()
        given = self._read_value(begin + which.lower(), kind, False, f"{name}_{which}")
        table, bad = TableKeys(), False
        start = begin + "tcas_"
        for key in [key for key in self._lines if key.startswith(start)]:
            number, shown, text = self._lines[key]
            try:
                if table.store_if_tcas_key(key[len(start) :], shown, text):
                    self._used.add(key)
            except BadValue as error:
                self._used.add(key)
                self._problems.add(f"{shown} {error}", line=number)
                bad = True
        if bad:
            return None
        differs = {resolution: table.differing_keys(resolution) for resolution in (False, True)}
        resolution = len(differs[True]) < len(differs[False]) if given is None else bool(given)
        if differs[resolution]:
            which = "resolution" if resolution else "traffic"
            others = len(differs[resolution]) - 1
            more = f" and {others} more are" if others else " is"
            self._problems.add(
                f"{shorten(differs[resolution][0], 3 * MOST_OF_A_CELL)}{more} not as in the "
                f"table of {which} advisories of TCAS II version 7.1, the only one that is used",
                line=line,
            )
            return None
        return TcasAdvisory(resolution)

    def _read_value(self, key: str, kind: str, needed: bool, shown: str) -> Any:
        """Return a key's value; None if missing or wrong, which becomes a problem if it matters."""
        self._expected[key] = shown
        if key not in self._lines:
            if needed:
                self._problems.add(f"the key {shorten(shown)!r} is missing")
            return None
        number, name, text = self._lines[key]
        self._used.add(key)
        try:
            return parse_value_and_unit(kind, text)[0]
        except BadValue as error:
            self._problems.add(f"{name} {error}", line=number)
            return None

    def _ignore_alerters_except(self, named: tuple[str, ...]) -> None:
        """Mark the keys of all alerters as ignored except those `named`, whose keys are read."""
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

    def _alerter_names_except(self, prefix: str) -> list[str]:
        """Return the names of all alerters the file seems to describe, without this prefix's."""
        found = {
            self._lines[key][1][: match.end(1)]
            for key in self._lines
            if (match := _LEVEL_OF.fullmatch(key)) and match.group(2) == "detector"
        }
        return [name for name in found if name.lower() + "_" != prefix]

    def _note_idle_detectors(self, name: str, prefix: str) -> None:
        """Add a problem for each detector of an alerter that no level names."""
        start = prefix + _CLASS
        for key in sorted(self._lines.keys() - self._used):
            if not key.startswith(start):
                continue
            begin = f"{prefix}{key.removeprefix(start)}_"
            self._used |= {key, *(k for k in self._lines if k.startswith(begin))}
            if prefix not in self._misspelt:
                number, shown, _ = self._lines[key]
                self._problems.add(
                    f"{shorten(shown, 3 * MOST_OF_A_CELL)}: no level of {shorten(name)} names "
                    "this detector",
                    line=number,
                )

    def _note_unknown_keys(self) -> None:
        """Add a problem for each unknown key that resembles a known one, and one for all others."""
        strange = []
        for key in sorted(self._lines.keys() - self._used, key=lambda key: self._lines[key][0]):
            number, name, _ = self._lines[key]
            shown = shorten(name, 3 * MOST_OF_A_CELL)
            if hint := self._nearest_key(key):
                said = f"the key {shown!r} is unknown; did you mean {hint!r}?"
                self._problems.add(said, line=number)
            else:
                strange.append((number, shown))
        if len(strange) == 1:
            self._problems.add(f"the key {strange[0][1]!r} is unknown", line=strange[0][0])
        elif strange:
            names = ", ".join(f"{shown} (line {number})" for number, shown in strange)
            self._problems.add(f"{len(strange)} keys are unknown: {names}")

    def _nearest_key(self, key: str) -> str | None:
        """Return the missing known key most like a misspelt one; None if none is close."""
        free = {k: shown for k, shown in self._expected.items() if k not in self._lines}
        for begin in sorted(self._beginnings, key=len, reverse=True):
            if key.startswith(begin):
                ends = {k[len(begin) :]: shown for k, shown in free.items() if k.startswith(begin)}
                close = nearest_name(key[len(begin) :], sorted(ends))
                return None if close is None else ends[close]
        plain = [k for k in free if k in KEYS or k == "alerters"]
        if (close := nearest_name(key, plain)) is not None:
            return close
        whole = get_close_matches(key, sorted(free), n=1, cutoff=_ALIKE)
        return free[whole[0]] if whole else None
