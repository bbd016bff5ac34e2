"""Where the thesis is in error or silent, row by row: what it comes to in numbers.

Errata 1-4, 8-12, 23 and 26 are in the geometry and optical tables beside this file, 15 and 16 also
in the detection table.
"""

import math
import tomllib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from components.aircraft.aspect_tables import RcsTable, dbsm_to_m2
from components.geometry import FieldOfView
from components.radar.detection import (
    detection_probability,
    detection_threshold,
    miss_probability,
)
from components.radar.link_budget import LinkBudget, calibrated_bandwidth, with_bandwidth
from components.radar.rcs import fluctuating_rcs
from components.radar.swerling import SwerlingParameters
from dsa_des.time.clock import ClockSpec, ScanClock, common_ticks_per_second, parse_rational

CONFIGS = Path(__file__).parents[2] / "configs"
DEG = math.pi / 180.0

# Table 2.2.
OASYS = {
    "power_w": 2.5,
    "antenna_gain_db": 29.5,
    "wavelength_m": 8.57e-3,
    "integration_gain_db": 7.0,
    "noise_figure_db": 6.0,
}
BUDGET = LinkBudget(**OASYS, bandwidth_hz=1.0)


def bandwidth(rcs_dbsm, range_km, pd):
    return calibrated_bandwidth(
        BUDGET, rcs_dbsm=rcs_dbsm, range_km=range_km, pd=pd, false_alarm_probability=0.05
    )


def pd(bandwidth_hz, rcs_m2, range_km):
    snr = with_bandwidth(BUDGET, bandwidth_hz).snr(1000.0 * range_km, rcs_m2)
    return detection_probability(snr, false_alarm_probability=0.05)


def gain_without(name):
    """dB lost when one term of the link budget is left out."""
    bare = LinkBudget(**{**OASYS, name: 0.0}, bandwidth_hz=1.0)
    return 10.0 * math.log10(BUDGET.snr(5e3, 1.0) / bare.snr(5e3, 1.0))


def printed_snr():
    """Eq. 7 with errata 5, written out for 5 m² at 5.6 km in 486 Hz."""
    gain, integration, noise = 10**2.95, 10**0.7, 10**0.6
    echo = 2.5 * gain**2 * 8.57e-3**2 * 5.0 * integration / ((4 * math.pi) ** 3 * 5600.0**4)
    return echo / (1.380649e-23 * 290.0 * noise * 486.0)


def worst_gram_charlier(pulses):
    snr = 10.0 ** np.arange(-4.0, 3.0, 0.01)
    worst = 0.0
    for pfa in (1e-1, 1e-2, 1e-4):
        radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": "swerling0"}
        series = detection_probability(snr, method="gram_charlier", **radar)
        worst = max(worst, np.max(np.abs(series - detection_probability(snr, **radar))))
    return worst


def meetings(first, second, seconds):
    """Scans of two clocks at one instant."""
    specs = [ClockSpec(parse_rational(rate)) for rate in (first, second)]
    ticks = common_ticks_per_second(
        [time for spec in specs for time in spec.times_needing_whole_ticks()]
    )
    scans = [ScanClock(spec, ticks).scans_between(0, seconds * ticks)[1] for spec in specs]
    return np.intersect1d(scans[0], scans[1]).size


def config(file, *keys):
    value = tomllib.loads((CONFIGS / f"{file}.toml").read_text(encoding="utf-8"))
    for key in keys:
        value = value[key]
    return value


STEADY = {"false_alarm_probability": 1e-4, "model": "swerling0"}
SMALL, MEDIUM, LARGE = (float(dbsm_to_m2(x)) for x in (1.76, 3.01, 6.99))

# source, what, computed, expected, absolute tolerance
ROWS = [
    ("errata 4b", "of 10 instants in 1 s a 1 Hz sensor runs at one", meetings(10, 1, 1), 1, 0),
    ("errata 5", "G_I adds 7 dB", gain_without("integration_gain_db"), 7.0, 1e-12),
    ("errata 5", "F takes 6 dB", gain_without("noise_figure_db"), -6.0, 1e-12),
    ("errata 5", "eq. 7 written out", with_bandwidth(BUDGET, 486.0).snr(5600.0, 5.0)
     / printed_snr(), 1.0, 1e-12),
    ("errata 6", "flight test: 486 Hz", bandwidth(1.76, 6.91, 0.9114), 486.0, 1.0),
    ("errata 6", "specification: 4283 Hz", bandwidth(10 * math.log10(5), 5.6, 0.9), 4283.0, 2.0),
    ("errata 6", "486 Hz against the specification", pd(486.0, 5.0, 5.6), 0.988, 5e-4),
    ("errata 6", "4283 Hz against the flight test", pd(4283.0, SMALL, 6.91), 0.52, 5e-3),
    ("errata 7", "nautical miles: 2386 Hz", bandwidth(10 * math.log10(5), 6.48, 0.9), 2386.0, 3.0),
    ("errata 7", "the two kinds of mile, dB",
     10 * math.log10(BUDGET.snr(5.63e3, 1.0) / BUDGET.snr(6.48e3, 1.0)), 2.4, 0.05),
    ("errata 13", "exponential in power: e⁻¹ of the echoes are above the mean",
     fluctuating_rcs(1.0, 1.0 - math.exp(-1.0), "swerling1"), 1.0, 1e-15),
    ("errata 14", "one pulse: the threshold is -ln Pfa", detection_threshold(1, 1e-6),
     6.0 * math.log(10.0), 1e-14),
    ("errata 14", "two pulses: (1 + V) exp(-V) is Pfa",
     (1 + detection_threshold(2, 0.01)) * np.exp(-detection_threshold(2, 0.01)), 0.01, 1e-15),
    ("errata 15", "series at 1 pulse, 0 dB",
     detection_probability(1.0, method="gram_charlier", **STEADY), 0.0022, 5e-5),
    ("errata 15", "exact at 1 pulse, 0 dB", detection_probability(1.0, **STEADY), 0.0037, 5e-5),
    ("numerical facts", "worst of the series, 1 pulse", worst_gram_charlier(1), 0.025, 1e-3),
    ("numerical facts", "worst of the series, 2 pulses", worst_gram_charlier(2), 0.010, 1e-3),
    ("numerical facts", "worst of the series, 5 pulses", worst_gram_charlier(5), 0.003, 5e-4),
    ("numerical facts", "worst of the series, 10 pulses", worst_gram_charlier(10), 0.001, 5e-4),
    ("numerical facts", "worst of the series, 100 pulses", worst_gram_charlier(100), 4e-5, 1e-5),
    ("numerical facts", "Pd falls to Pfa, not to 0",
     detection_probability(1e-300, false_alarm_probability=1e-9), 1e-9, 1e-23),
    ("errata 17", "medium class at its unrounded mean, 35.5/9 NM",
     pd(486.0, MEDIUM, 35.5 / 9 * 1.852), 0.9170, 5e-4),
    ("errata 17", "large class: printed 0.8668", pd(486.0, LARGE, 9.75), 0.896, 1e-3),
    ("errata 18", "one pulse: II is I",
     detection_probability(3.0, false_alarm_probability=0.05, model="swerling2")
     - detection_probability(3.0, false_alarm_probability=0.05), 0.0, 1e-16),
    ("errata 19", "Beech 99 front from Table 4.4, abeam", 30.0 / ((6.2 / 3.3) ** 2 - 1.0),
     config("aircraft/beech_99", "eo", "front_m2"), 0.2),
    ("errata 19", "... and from the Convair", 90.0 * (3.3 / 9.1) ** 2,
     config("aircraft/beech_99", "eo", "front_m2"), 0.2),
    ("errata 19", "F-16 as printed", config("aircraft/f_16", "eo", "horizontal_m2"), 250.0, 0),
    ("errata 19", "F-16 real", config("aircraft/f_16_realistic", "eo", "horizontal_m2"), 69.0, 0),
    ("errata 20", "fighter front", config("aircraft/small_fighter", "ir", "front_m2"), 7.0, 0),
    ("errata 21", "fighter side, refined",
     config("aircraft/small_fighter_refined", "ir", "side_m2"), 7.0, 0),
    ("errata 21", "general aviation side, refined as printed",
     config("aircraft/general_aviation_refined", "ir", "side_m2"), 6.0, 0),
    ("errata 21", "transport side, refined as printed",
     config("aircraft/commercial_transport_refined", "ir", "side_m2"), 110.0, 0),
    ("errata 23b", "pixel width, deg", 220.0 / config("sensors/afrl_eo", "azimuth_pixels"),
     0.0358, 5e-5),
    ("errata 23b", "pixel height, deg", 60.0 / config("sensors/afrl_eo", "elevation_pixels"),
     0.0293, 5e-5),
    ("errata 23c", "the back is doubled once: first and refined set agree",
     config("aircraft/commercial_transport_refined", "ir", "back_m2"),
     config("aircraft/commercial_transport", "ir", "back_m2"), 0),
    ("errata 25", "5 and 2 Hz meet every second: half of the IR scans", meetings(5, 2, 3600),
     3600, 0),
    ("numerical facts", "29.97 as text meets 10 Hz every 100 s", meetings(29.97, 10, 3600), 36, 0),
    ("numerical facts", "29.97 from the binary float never meets it again",
     (Fraction(29.97) / 10).numerator > 1e14, True, 0),
    ("numerical facts", "5 Hz in steps of 0.1 s lose none", meetings(5, 10, 1000), 5000, 0),
]  # fmt: skip


@pytest.mark.parametrize(
    ("source", "what", "computed", "expected", "tolerance"),
    ROWS,
    ids=[f"{row[0]}: {row[1]}" for row in ROWS],
)
def test_errata(source, what, computed, expected, tolerance):
    assert abs(float(computed) - float(expected)) <= tolerance


def test_seven_decibels_are_the_five_pulses():
    # errata 6: never both
    radar = {**OASYS, "scan_rate_hz": 1, "bandwidth_hz": 486.0, "pulses": 5}
    with pytest.raises(ValidationError, match="integration_gain_db and pulses > 1 would count"):
        SwerlingParameters(**radar)


# source, field of view in azimuth (deg), inside, outside
FIELDS = [
    ("issue: wider than 180°", (-110, 110), (-110, -91, 0, 110), (-111, 180, 111)),
    ("issue: wider than 180°, not about the nose", (-20, 250), (0, 180, -110, -20), (-21, -109)),
    ("issue: across ±180°", (150, -150), (150, 180, -180, -150), (149, 0, -149)),
    ("issue: across ±180°, the long way", (10, 0), (10, 180, -1, 0), (1, 9)),
    ("all round", (-180, 180), (-180, 0, 180, 77), ()),
]


@pytest.mark.parametrize(("source", "field", "seen", "unseen"), FIELDS)
def test_field_of_view(source, field, seen, unseen):
    looked = FieldOfView((field[0] * DEG, field[1] * DEG), (-0.5, 0.5))
    # A bearing of -180 is that of 180: azimuths are in (-180, 180].
    azimuth = np.array([180 if deg == -180 else deg for deg in (*seen, *unseen)]) * DEG
    inside = looked.holds(azimuth, np.zeros(len(azimuth)))
    assert inside.tolist() == [True] * len(seen) + [False] * len(unseen)


TABLE = RcsTable.from_rows([350, 10, 350, 10], [0, 0, 90, 90], [0.0, 10.0, 20.0, 20.0])
# source, azimuth, elevation (deg), dBsm
RCS = [
    ("issue: interpolated in dB with wrap, across 0", 0.0, 0.0, 5.0),
    ("issue: ... from below 0", -5.0, 0.0, 2.5),
    ("issue: ... 360° further", 365.0, 0.0, 7.5),
    ("issue: ... the long way round", 180.0, 0.0, 5.0),
    ("issue: ... half-way up", 0.0, 45.0, 12.5),
]


@pytest.mark.parametrize(("source", "azimuth", "elevation", "expected"), RCS)
def test_rcs_table(source, azimuth, elevation, expected):
    assert TABLE.dbsm(azimuth * DEG, elevation * DEG) == pytest.approx(expected, abs=1e-12)


LOOK = {"false_alarm_probability": 1e-4}
# source, call, message
REFUSED = [
    ("issue: table with a hole", lambda: RcsTable.from_rows([0, 90, 0], [0, 0, 9], [1, 1, 1]),
     "the table has a hole: no value at az_deg 90, el_deg 9"),
    ("issue: NaN", lambda: RcsTable.from_rows([0, 90], [0, 0], [1, math.nan]), "dbsm is nan"),
    ("issue: NaN", lambda: miss_probability([1.0, math.nan], **LOOK), "snr is nan: it must"),
    ("issue: NaN", lambda: detection_threshold(math.nan, 0.1), "pulses is nan: it must"),
    ("issue: NaN", lambda: BUDGET.snr(math.nan, 1.0), "range_m is nan: it must"),
    ("issue: pulses, in full", lambda: detection_threshold(1.0000001, 0.1),
     "pulses is 1.0000001: it must be a whole number"),
    ("issue: Albersheim's validity", lambda: detection_probability(
        1e-6, method="albersheim", model="swerling0", **LOOK), "snr is 1e-06: it must lie in"),
    ("issue: Shnidman's validity", lambda: detection_probability(
        1e-6, method="shnidman", **LOOK), "snr is 1e-06: it must lie in"),
    ("errata 5", lambda: LinkBudget(**{**OASYS, "power_w": 0.0}, bandwidth_hz=1.0), "power_w is 0"),
    ("errata 6: Pd below Pfa", lambda: bandwidth(3.0, 5.0, 0.01), "pd is 0.01: it must be above"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "call", "message"), REFUSED)
def test_refused(source, call, message):
    with pytest.raises(ValueError) as caught:
        call()
    assert message in str(caught.value)
