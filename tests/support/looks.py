"""A hundred thousand looks of every sensor, in one run, and bounds of 99 % for what they give."""

import math
from collections.abc import Iterable, Mapping
from statistics import NormalDist
from typing import Any

import numpy as np
import wired
from covering import CAMERAS, LINK_BUDGETS, RADARS, RANGING

Columns = dict[str, Any]

TARGETS, SCANS, RATE_HZ = 20, 5000, 250
ANGLES = ("azimuth", "elevation")
#: Of each quantity: its column, the truth's, and that of its variance.
COLUMNS = {
    "azimuth": ("azimuth_rad", "true_azimuth_rad", "azimuth_variance_rad2"),
    "elevation": ("elevation_rad", "true_elevation_rad", "elevation_variance_rad2"),
    "range": ("range_m", "true_range_m", "range_variance_m2"),
    "range_rate": ("range_rate_m_s", "true_range_rate_m_s", "range_rate_variance_m2_s2"),
}


def ring() -> list[dict[str, Any]]:
    """Return targets all round the crooked ownship, at 2 to 6 km, flying everywhere."""
    found = []
    for i in range(TARGETS):
        bearing, distance = math.radians(17.0 + 18.0 * i), 2000.0 + 200.0 * i
        found.append({
            "name": f"t{i}", "east_m": distance * math.sin(bearing),
            "north_m": distance * math.cos(bearing), "up_m": 90.0 * (i % 7 - 3),
            "heading_deg": 77.0 * i, "speed_mps": 60.0 + 3.0 * i, "climb_mps": i % 5 - 2.0,
        })  # fmt: skip
    return found


def quantities(kind: str) -> tuple[str, ...]:
    """Return what a sensor of some type measures."""
    if kind in RADARS:
        return tuple(COLUMNS)
    return (*ANGLES, "range") if kind in RANGING else ANGLES


#: Steps so fine that a target crosses many of them between two looks.
FINE = {"azimuth_resolution_deg": 2e-6, "elevation_resolution_deg": 1e-6}
ERRORS = {
    "azimuth_error_deg": 1.5, "azimuth_bias_deg": -0.4,
    "elevation_error_deg": 0.6, "elevation_bias_deg": 0.25,
}  # fmt: skip
RANGE_ERRORS = {
    "range_error_m": 21.0, "range_bias_m": 15.0,
    "range_rate_error_m_s": 3.0, "range_rate_bias_m_s": -2.4,
}  # fmt: skip
TIMES = {"azimuth_correlation_time_s": 0.5, "elevation_correlation_time_s": 0.05}
RANGE_TIMES = {"range_correlation_time_s": 2.0, "range_rate_correlation_time_s": 0.2}
_BEAM = {
    "azimuth_beamwidth_deg": 3.0, "elevation_beamwidth_deg": 5.0, "range_resolution_m": 40.0,
    "glint_share": 0.0,
}  # fmt: skip
SIGNAL_KEYS: dict[str, dict[str, Any]] = {
    **dict.fromkeys(LINK_BUDGETS, _BEAM),
    **{kind: {"noise_equivalent_contrast": 0.02, "glint_share": 0.0} for kind in CAMERAS},
}


def modes(kind: str) -> dict[str, dict[str, Any]]:
    """Return the keys of each way in which a sensor's measured values may err."""
    radar, measured = kind in RADARS, quantities(kind)
    of_range, of_time = (
        {key: value for key, value in keys.items() if radar or "rate" not in key}
        if "range" in measured
        else {}
        for keys in (RANGE_ERRORS, RANGE_TIMES)
    )
    stated = {"errors": "stated", "biases": "fixed", **ERRORS, **of_range}
    lasts = {**TIMES, **of_time}
    coarse = {"azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 1.0}
    if "range" in measured:
        coarse["range_resolution_m"] = 50.0
    if radar:
        coarse["range_rate_resolution_m_s"] = 8.0
    found: dict[str, dict[str, Any]] = {
        "grid": {**FINE, **({"range_resolution_m": 1e-4} if "range" in measured else {})},
        "stated": {**stated, "quantised": False},
        "lasting": {**stated, **lasts, "quantised": False},
        "quantised": {**stated, **coarse},
    }
    if kind in SIGNAL_KEYS:
        found["signal"] = {"errors": "signal", "quantised": False, **SIGNAL_KEYS[kind]}
    if radar:  # where there is no step the grid has the truth
        found = {mode: {**keys, "measures_range_rate": True} for mode, keys in found.items()}
    if kind in LINK_BUDGETS:
        found["signal"]["range_rate_resolution_m_s"] = 6.0
    return found


def scene(kind: str, wanted: Iterable[str] = (), **options: Any) -> dict[str, Any]:
    """Return a scene with a sensor of one type in each mode, or those wanted, by their names."""
    sensors = {
        mode: wired.sensor(kind, scan_rate_hz=RATE_HZ, **keys)
        for mode, keys in modes(kind).items()
        if mode in wanted or not wanted
    }
    return wired.chain(sensors, **{"targets": ring(), "duration_s": SCANS / RATE_HZ, **options})


def by_block(table: Any) -> dict[str, Columns]:
    """Return the measured columns of each block, as arrays, by target and then by scan."""
    wanted = {"scan", "snr_db", "pixels", *(name for names in COLUMNS.values() for name in names)}
    columns = {name: table[name].to_numpy() for name in wanted & set(table.column_names)}
    keys = {}
    for name in ("block", "target"):
        text = table[name].combine_chunks().dictionary_encode()
        keys[name] = text.indices.to_numpy(), text.dictionary.to_pylist()
    order = np.lexsort((columns["scan"], keys["target"][0], keys["block"][0]))
    first = np.searchsorted(keys["block"][0][order], np.arange(len(keys["block"][1]) + 1))
    found = {
        name: {key: values[order[first[i] : first[i + 1]]] for key, values in columns.items()}
        for i, name in enumerate(keys["block"][1])
    }
    for mode in found:
        found[mode]["true_range_rate_m_s"] = found["grid"]["range_rate_m_s"]
    return found


def errors_of(columns: Mapping[str, Any], quantity: str) -> Any:
    """Return measured minus true, angles the short way round, shape (targets, scans)."""
    measured, true, _ = COLUMNS[quantity]
    off = columns[measured] - columns[true]
    if quantity in ANGLES:
        off = (off + math.pi) % (2.0 * math.pi) - math.pi
    return off.reshape(TARGETS, -1)


def bound(statistics: int) -> float:
    """Return the size within which each of so many normal statistics stays 99 times in 100."""
    return NormalDist().inv_cdf(1.0 - 0.005 / statistics)


def mean_is(values: Any, expected: float, statistics: int) -> bool:
    """Tell whether independent values have the expected mean, within its bound."""
    flat = np.asarray(values).ravel()
    spread = flat.std() / math.sqrt(flat.size)
    return bool(abs(flat.mean() - expected) < bound(statistics) * spread)
