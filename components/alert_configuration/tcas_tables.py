"""Tables of TCAS II as a `.conf` file may write them out, held against those that are known."""

import math
import re
from collections.abc import Callable
from typing import Any

from components.alert_configuration.conf_keys import parse_value_and_unit
from components.well_clear.tcas import (
    FIRST_LEVEL,
    LEVEL_TOPS_M,
    RESOLUTION_ADVISORY,
    TRAFFIC_ADVISORY,
    Thresholds,
)

#: What follows ``<alerter>_<detector>_TCAS_``, in lower case.
_KEY = re.compile(r"(hmdfilter)|(level|tau|tcoa|dmod|zthr|hmd)_(\d)")
#: Kind of value by quantity.
_KINDS = {"tau": "time", "tcoa": "time"}
#: What each quantity of a table is of `Thresholds`; the time to co-altitude counts as tau does.
_FIELDS: dict[str, Callable[[Thresholds], float]] = {
    "tau": lambda sizes: sizes.tau_s,
    "tcoa": lambda sizes: sizes.tau_s,
    "dmod": lambda sizes: sizes.distance_m,
    "zthr": lambda sizes: sizes.height_m,
    "hmd": lambda sizes: sizes.miss_m,
}


class TableKeys:
    """Collects a written-out TCAS table's keys: miss-distance filter, altitude levels and sizes."""

    def __init__(self) -> None:
        self._filter: tuple[str, bool] | None = None
        self._tops: dict[int, tuple[str, float]] = {}
        self._sizes: list[tuple[str, str, int, float]] = []

    def store_if_tcas_key(self, key: str, shown: str, text: str) -> bool:
        """Store the value of a TCAS table's key and return True; return False for any other key."""
        match = _KEY.fullmatch(key)
        if match is None:
            return False
        quantity, level = match.group(2), int(match.group(3) or 0)
        if quantity is None:
            self._filter = shown, parse_value_and_unit("yes or no", text)[0]
            return True
        value = float(parse_value_and_unit(_KINDS.get(quantity, "length"), text)[0])
        if quantity == "level":
            self._tops[level] = shown, value
        else:
            self._sizes.append((shown, quantity, level, value))
        return True

    def differing_keys(self, resolution: bool) -> list[str]:
        """Return the keys whose values differ from the known TCAS II table, RA or TA."""
        result = [
            shown
            for (_, (shown, value)), top_m in zip(
                sorted(self._tops.items()), [*LEVEL_TOPS_M, *[math.inf] * 10], strict=False
            )
            if not (math.isclose(value, top_m) or math.isinf(top_m))
        ]
        if self._filter is not None and self._filter[1] != resolution:
            result.append(self._filter[0])
        table: tuple[Any, ...] = RESOLUTION_ADVISORY if resolution else TRAFFIC_ADVISORY
        for shown, quantity, level, value in self._sizes:
            if quantity == "hmd" and not resolution:
                continue  # without the filter nobody asks for it
            known = 0 <= level - FIRST_LEVEL < len(table)
            sizes = table[level - FIRST_LEVEL] if known else None
            wanted = 0.0 if sizes is None else _FIELDS[quantity](sizes)
            if not math.isclose(value, wanted):
                result.append(shown)
        return result
