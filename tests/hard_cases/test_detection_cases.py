"""Hard cases of radar detection, row by row, each with its source.

Reference values are our own, 50 digits by two methods (tests/radar/make_pd_table.py), unless the
source says otherwise.
"""

import math

import numpy as np
import pytest

from components.radar.detection import detection_probability, miss_probability
from components.radar.link_budget import LinkBudget


def db(value):
    return 10.0 ** (value / 10.0)


# what, source, model, pulses, Pfa, SNR, Pd, relative tolerance
CASES = [
    (
        "large n·SNR: naive eq. 32 is inf times 0",
        "errata, numerical facts",
        ("swerling1", 1000, 1e-6, db(-60)),
        # Pd = Pfa + n·SNR·g(n) to first order; checked to what first order carries.
        (1.0001644e-6, 1e-7),
    ),
    (
        "one pulse: eq. 32 has Gamma(V, 0)",
        "errata 16",
        ("swerling1", 1, 1e-6, db(10)),
        (1e-6 ** (1.0 / 11.0), 1e-14),
    ),
    (
        "eq. 27 as printed gives 1.00745",
        "errata 15",
        ("swerling0", 5, 1e-4, db(8)),
        (0.99578, 1e-5),
    ),
    (
        "Gram-Charlier gives 0.0022",
        "errata 15",
        ("swerling0", 1, 1e-4, db(0)),
        (0.0037, 0.02),
    ),
    (
        "no echo at all",
        "issue: Pd at the left end",
        ("swerling3", 30, 1e-9, 0.0),
        (1e-9, 0.0),
    ),
    (
        "no echo worth the name",
        "errata: Pd falls to Pfa from above, not to 0",
        ("swerling4", 100, 1e-12, 1e-30),
        (1e-12, 1e-15),
    ),
]


@pytest.mark.parametrize(
    ("what", "source", "radar", "expected"), CASES, ids=[row[0] for row in CASES]
)
def test_detection_probability(what, source, radar, expected):
    model, pulses, pfa, snr = radar
    value, tolerance = expected
    pd = detection_probability(snr, pulses=pulses, false_alarm_probability=pfa, model=model)
    assert abs(pd - value) <= tolerance * value


# what, source, model, pulses, Pfa, SNR, 1 - Pd
MISSES = [
    (
        "a miss that 1 - Pd rounds to nothing",
        "issue: 1 - Pd computed as itself",
        ("swerling1", 1, 0.1, 1e18),
        -math.log(0.1) * 1e-18,
    ),
    (
        "60 dB, 2 pulses of Swerling II: V²/2 / SNR²",
        "issue: SNR up to +60 dB; series of P(2, V/(1+SNR))",
        ("swerling2", 2, 1e-6, 1e12),
        None,
    ),
]


@pytest.mark.parametrize(
    ("what", "source", "radar", "expected"), MISSES, ids=[row[0] for row in MISSES]
)
def test_miss_probability(what, source, radar, expected):
    model, pulses, pfa, snr = radar
    miss = miss_probability(snr, pulses=pulses, false_alarm_probability=pfa, model=model)
    if expected is None:
        from components.radar.detection import detection_threshold

        expected = float(detection_threshold(pulses, pfa)) ** 2 / 2.0 / snr**2
    assert miss == pytest.approx(expected, rel=1e-10)


def test_both_sides_to_the_ends_of_the_contract():
    """Issue: pulses 1 … 1000, Pfa 1e-1 … 1e-12, SNR -60 … +60 dB: in [0, 1], no warning, no NaN."""
    snr = 10.0 ** np.linspace(-6.0, 6.0, 61)
    with np.errstate(all="raise"):
        for model in ("swerling0", "swerling1", "swerling2", "swerling3", "swerling4"):
            for pulses in (1, 1000):
                for pfa in (1e-1, 1e-12):
                    radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": model}
                    pd, miss = detection_probability(snr, **radar), miss_probability(snr, **radar)
                    assert np.all((pd >= pfa) & (pd <= 1.0))
                    assert np.all((miss >= 0.0) & (miss <= 1.0 - pfa))


def test_echo_at_range_zero():
    """Issue: R = 0 is finite: closer than the minimum range no echo is processed."""
    budget = LinkBudget(power_w=2.5, antenna_gain_db=29.5, bandwidth_hz=486.0, frequency_hz=35e9)
    assert budget.snr(0.0, 5.0) == 0.0
    assert detection_probability(budget.snr(0.0, 5.0), false_alarm_probability=0.05) == 0.05


# argument, value, source
REFUSED = [
    ("snr", -1e-3, "issue: SNR negative"),
    ("snr", math.nan, "issue: NaN"),
    ("false_alarm_probability", 0.0, "issue: Pfa 0"),
    ("false_alarm_probability", 1.0, "issue: Pfa 1"),
    ("pulses", 0, "issue: pulses 0"),
    ("pulses", 1.5, "issue: pulses 1.5"),
]


@pytest.mark.parametrize(("argument", "value", "source"), REFUSED)
def test_refused(argument, value, source):
    arguments = {"snr": 1.0, "false_alarm_probability": 0.1, argument: value}
    with pytest.raises(ValueError, match=f"^{argument} is {value:g}: it must"):
        detection_probability(**arguments)
