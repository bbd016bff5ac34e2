"""The alerting table: a row per time and target, with the columns of DAIDALUS."""

from dataclasses import replace

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.alerting.encounter import Encounter
from components.alerting.levels import Alerts
from components.alerting.separation import separation
from components.formats.text_rows import LENGTH_M, SPEED_MPS
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from dsa_des.arrays.types import FloatArray, IntArray

#: Decimals of numbers, unless said otherwise.
DECIMALS = 6

_SEPARATION = (
    ("Horizontal Separation", "horizontal_m", "horizontal"),
    ("Vertical Separation", "vertical_m", "vertical"),
    ("Horizontal Closure Rate", "horizontal_mps", "horizontal rate"),
    ("Vertical Closure Rate", "vertical_mps", "vertical rate"),
    ("Projected HMD", "miss_horizontal_m", "horizontal"),
    ("Projected VMD", "miss_vertical_m", "vertical"),
    ("Projected TCPA", "time_to_closest_s", "time"),
    ("Projected DCPA", "closest_m", "horizontal"),
    ("Projected TCOA", "time_to_level_s", "time"),
    ("Projected TAUMOD (WCV*)", "modified_tau_s", "time"),
)


def without_memory(configuration: Configuration) -> Configuration:
    """Return a configuration in which every row stands by itself."""
    values = dict(configuration.values)
    values.update(hysteresis_time=0.0, persistence_time=0.0, alerting_m=0, alerting_n=0)
    return replace(configuration, values=values)


def alert_table(
    configuration: Configuration, encounter: Encounter, alerts: Alerts, decimals: int = DECIMALS
) -> str:
    """Return the table of an encounter as comma-separated text with two rows of headings.

    Parameters
    ----------
    configuration : Configuration
    encounter : Encounter
    alerts : Alerts
        Of the encounter.
    decimals : int
        Of every number; trailing zeros are left out.
    """
    units = _units(configuration)
    shown = _shown(configuration)
    names = ["Time", "Ownship", "Traffic", "Alerter", "Alert Level"]
    heading_units = ["[s]", "", "", "", ""]
    for number in range(1, configuration.most_levels + 1):
        names.append(f"Time to Volume of Alert({number})")
        heading_units.append(" [s]")
    for name, _, kind in shown:
        names.append(name)
        heading_units.append(f" [{units[kind][0]}]")
    lines = [" " + ", ".join(names), ",".join(heading_units)]
    row, column = np.nonzero(encounter.present)
    lines += _rows(configuration, encounter, alerts, row, column, decimals)
    return "\n".join(lines) + "\n"


def _units(configuration: Configuration) -> dict[str, tuple[str, float]]:
    """Return unit and factor to SI by kind of quantity: those of recovery sizes and steps."""
    found = {"time": ("s", 1.0)}
    for kind, key, factors in (
        ("horizontal", "min_horizontal_recovery", LENGTH_M),
        ("vertical", "min_vertical_recovery", LENGTH_M),
        ("horizontal rate", "step_hs", SPEED_MPS),
        ("vertical rate", "step_vs", SPEED_MPS),
    ):
        unit = configuration.units[key]
        found[kind] = unit, factors[unit]
    return found


def _shown(configuration: Configuration) -> tuple[tuple[str, str, str], ...]:
    """Return the columns of separation: without modified tau where the first alerter has none."""
    first = configuration.corrective_level(configuration.alerters[0])
    advisory = first is not None and isinstance(first.volume, TcasAdvisory)
    return _SEPARATION[:-1] if advisory else _SEPARATION


def _rows(
    configuration: Configuration,
    encounter: Encounter,
    alerts: Alerts,
    row: IntArray,
    column: IntArray,
    decimals: int,
) -> list[str]:
    cells = row, column
    first = configuration.corrective_level(configuration.alerters[0])
    volume = None if first is None else first.volume
    distance_m = volume.horizontal_m if isinstance(volume, Volume) else np.nan
    found = separation(
        tuple(part[cells] for part in encounter.relative),
        configuration["lookahead_time"],
        np.full(len(row), distance_m),
    )._asdict()
    texts = [
        number_texts(encounter.time_s[row], decimals),
        [encounter.ownship] * len(row),
        [encounter.targets[number] for number in column.tolist()],
        [str(number + 1) for number in encounter.alerter[cells].tolist()],
        [str(number) for number in alerts.level[cells].tolist()],
    ]
    for number in range(configuration.most_levels):
        texts.append(number_texts(alerts.violation_s[cells][:, number], decimals))
    units = _units(configuration)
    for _, key, kind in _shown(configuration):
        texts.append(number_texts(found[key] / units[kind][1], decimals))
    return [", ".join(parts) for parts in zip(*texts, strict=True)]


def number_texts(values: FloatArray, decimals: int) -> list[str]:
    """Return numbers as text: rounded, without trailing zeros; infinite ones as ``infty``."""
    found = []
    for value in values.tolist():
        if value != value:
            found.append("")
        elif value == np.inf:
            found.append("infty")
        else:
            text = f"{value:.{decimals}f}".rstrip("0") if decimals else f"{value:.0f}."
            text += "0" if text.endswith(".") else ""
            found.append("0.0" if text == "-0.0" else text)
    return found
