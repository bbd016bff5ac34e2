"""Tables of alerts and bands of an encounter, with the columns of DAIDALUS."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.alerting.encounter import Encounter
from components.alerting.levels import Alerts
from components.formats.text_rows import LENGTH_M, SPEED_MPS
from components.guidance.bands import guidance_of_many
from components.guidance.intervals import Band
from components.guidance.manoeuvre_kinds import KINDS
from components.guidance.memory import GuidanceMemory
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from components.well_clear.detection import select_bounds
from components.well_clear.separation import present_and_projected_separation
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


def remove_hysteresis(configuration: Configuration) -> Configuration:
    """Return a configuration without hysteresis, so that every row is judged independently."""
    values = dict(configuration.values)
    values.update(hysteresis_time=0.0, persistence_time=0.0, alerting_m=0, alerting_n=0)
    return replace(configuration, values=values)


def alert_table_csv(
    configuration: Configuration, encounter: Encounter, alerts: Alerts, decimals: int = DECIMALS
) -> str:
    """Return the table of an encounter as comma-separated text with two rows of headings."""
    units = _unit_and_factor_by_kind(configuration)
    shown = _separation_columns(configuration)
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
    lines += _csv_rows(configuration, encounter, alerts, row, column, decimals)
    return "\n".join(lines) + "\n"


def _unit_and_factor_by_kind(configuration: Configuration) -> dict[str, tuple[str, float]]:
    """Return the unit's name and its factor to SI for each kind of quantity in a table, as the
    configuration gives its recovery sizes and steps.
    """
    result = {"time": ("s", 1.0)}
    for kind, key, factors in (
        ("horizontal", "min_horizontal_recovery", LENGTH_M),
        ("vertical", "min_vertical_recovery", LENGTH_M),
        ("horizontal rate", "step_hs", SPEED_MPS),
        ("vertical rate", "step_vs", SPEED_MPS),
    ):
        unit = configuration.units[key]
        result[kind] = unit, factors[unit]
    return result


def _separation_columns(configuration: Configuration) -> tuple[tuple[str, str, str], ...]:
    """Return name, key and kind of the columns on separation; modified tau is left out where the
    first alerter uses a TCAS advisory.
    """
    first = configuration.first_corrective_level(configuration.alerters[0])
    advisory = first is not None and isinstance(first.volume, TcasAdvisory)
    return _SEPARATION[:-1] if advisory else _SEPARATION


def _csv_rows(
    configuration: Configuration,
    encounter: Encounter,
    alerts: Alerts,
    row: IntArray,
    column: IntArray,
    decimals: int,
) -> list[str]:
    cells = row, column
    first = configuration.first_corrective_level(configuration.alerters[0])
    volume = None if first is None else first.volume
    distance_m = volume.horizontal_m if isinstance(volume, Volume) else np.nan
    result = present_and_projected_separation(
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
    units = _unit_and_factor_by_kind(configuration)
    for _, key, kind in _separation_columns(configuration):
        texts.append(number_texts(result[key] / units[kind][1], decimals))
    return [", ".join(parts) for parts in zip(*texts, strict=True)]


def number_texts(values: FloatArray, decimals: int) -> list[str]:
    """Return numbers as texts, rounded, without trailing zeros; NaN empty, infinity ``infty``."""
    result = []
    for value in values.tolist():
        if value != value:
            result.append("")
        elif value == np.inf:
            result.append("infty")
        else:
            text = f"{value:.{decimals}f}".rstrip("0") if decimals else f"{value:.0f}."
            text += "0" if text.endswith(".") else ""
            result.append("0.0" if text == "-0.0" else text)
    return result


#: Factor to SI units and radians of each kind's values in a table: deg, knot, ft/min, ft.
TABLE_UNITS = {
    "hdir": np.pi / 180.0,
    "hs": SPEED_MPS["knot"],
    "vs": SPEED_MPS["fpm"],
    "alt": LENGTH_M["ft"],
}


class BandsOverTime(NamedTuple):
    """Bands of one kind at the instants of an encounter."""

    time_s: FloatArray  # (instants,): as in the file
    own_value: FloatArray  # (instants,): of the ownship, in SI units and radians
    bands: list[list[Band]]  # Those of each instant, as remembered


def bands_over_time(
    kind_name: str, configuration: Configuration, encounter: Encounter, alerts: Alerts
) -> BandsOverTime:
    """Return the guidance bands of one kind at every instant of an encounter, after hysteresis."""
    pairs = encounter.pairs
    assert pairs.own is not None
    count = len(encounter.time_s)
    zero = np.zeros(count)
    own = State(zero, zero, *encounter.own_state)
    intruders = []
    for target in range(len(encounter.targets)):
        state = State(
            *(mine - part[:, target] for mine, part in zip(own, pairs.relative, strict=True))
        )
        for number, alerter in enumerate(configuration.alerters):
            there = encounter.present[:, target] & (encounter.alerter[:, target] == number)
            if there.any():
                early = alerts.early_level[:, target]
                bounds = select_bounds(pairs.bounds, (slice(None), target))
                intruders.append(GuidedIntruders(state, alerter, early, there, bounds))
    memory = GuidanceMemory(configuration, kind_name)
    result = guidance_of_many(kind_name, configuration, own, intruders)
    bands = [
        memory.step(now_s, one).bands
        for now_s, one in zip(encounter.time_s.tolist(), result, strict=True)
    ]
    return BandsOverTime(encounter.time_s, np.array([one.own_value for one in result]), bands)


def bands_table_csv(
    configuration: Configuration, encounter: Encounter, alerts: Alerts, decimals: int
) -> str:
    """Return the bands of all four kinds as comma-separated text, a row per band.

    Columns are ``time_s,kind,low,up,region``, from the least to the largest value of each kind, in
    deg, knot, ft/min and ft.
    """
    kinds = {kind: bands_over_time(kind, configuration, encounter, alerts) for kind in KINDS}
    lines = ["time_s,kind,low,up,region"]
    for row, now_s in enumerate(number_texts(encounter.time_s, decimals)):
        for kind, over_time in kinds.items():
            bands = over_time.bands[row]
            edges = np.array([(band.low, band.high) for band in bands]) / TABLE_UNITS[kind]
            low, high = (number_texts(edge, decimals) for edge in edges.T)
            for index, band in enumerate(bands):
                lines.append(f"{now_s},{kind},{low[index]},{high[index]},{band.region}")
    return "\n".join(lines) + "\n"
