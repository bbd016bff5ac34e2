"""How far are the cheaper rungs from the exact Pd, and what do they refuse?"""

import re

import numpy as np
import pytest

from components.radar.detection import (
    detection_probability,
    miss_probability,
    required_snr,
)
from components.radar.detection.ladder import DETECTION
from dsa_des.block.ladder import Unavailable

MODELS = [f"swerling{i}" for i in range(5)]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("pulses", "pfa"), [(1, 0.1), (1, 1e-12), (10, 1e-6), (1000, 1e-4)])
def test_table_is_within_1e_7_everywhere_and_rises(model, pulses, pfa):
    radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": model}
    snr = np.append(0.0, 10.0 ** np.linspace(-12.0, 12.0, 30_011))
    table = detection_probability(snr, method="table", **radar)
    assert np.max(np.abs(table - detection_probability(snr, **radar))) < 1e-7
    assert table[0] == pfa
    assert detection_probability(np.inf, method="table", **radar) == 1.0
    assert np.all(np.diff(table) >= 0.0)
    assert np.all((table >= pfa) & (table <= 1.0))
    np.testing.assert_array_equal(miss_probability(snr, method="table", **radar), 1.0 - table)


# Worst absolute errors of errata, numerical facts, over all SNR.
@pytest.mark.parametrize(
    ("pulses", "worst"), [(1, 0.0256), (2, 0.0105), (5, 0.0032), (10, 0.0013), (100, 5e-5)]
)
def test_gram_charlier_error(pulses, worst):
    snr = 10.0 ** np.linspace(-6.0, 6.0, 4001)
    errors = []
    for pfa in (0.1, 1e-2, 1e-4, 1e-9):
        radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": "swerling0"}
        rough = detection_probability(snr, method="gram_charlier", **radar)
        assert np.all((rough >= 0.0) & (rough <= 1.0))
        errors.append(np.max(np.abs(rough - detection_probability(snr, **radar))))
    assert 0.8 * worst < max(errors) < worst


def test_gram_charlier_covers_the_steady_target_only():
    with pytest.raises(ValueError, match=r"model is 'swerling1': .* swerling0"):
        detection_probability(1.0, false_alarm_probability=1e-3, method="gram_charlier")


def _allowed(method, **radar):
    with pytest.raises(ValueError, match=r"snr is 1e-09: it must lie in \[") as caught:
        detection_probability(1e-9, method=method, **radar)
    return tuple(map(float, re.search(r"\[(\S+), (\S+)\]", str(caught.value)).groups()))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("pulses", "pfa"), [(1, 1e-6), (10, 1e-3), (100, 1e-9)])
def test_shnidman_error_and_range(model, pulses, pfa):
    radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": model}
    low, high = _allowed("shnidman", **radar)
    snr = np.geomspace(low * (1 + 1e-5), high * (1 - 1e-5), 500)
    rough = detection_probability(snr, method="shnidman", **radar)
    assert np.all(np.diff(rough) >= 0.0)
    assert rough[0] == pytest.approx(0.1, abs=1e-4)
    assert rough[-1] == pytest.approx(0.99, abs=1e-4)
    # What this gives, rounded up. In SNR, that is up to 1.2 dB, with a published case below.
    assert np.max(np.abs(rough - detection_probability(snr, **radar))) < 0.053
    assert np.all(detection_probability(snr * 10**-0.12, **radar) <= rough)
    assert np.all(rough <= detection_probability(snr * 10**0.12, **radar))
    with pytest.raises(ValueError, match=r"snr is .*: it must lie in"):
        detection_probability(high * 1.01, method="shnidman", **radar)


def test_shnidman_of_a_published_case():
    """MathWorks, shnidman: Pd 0.9, Pfa 1e-6, 1 pulse: Swerling I needs about 21.1 dB."""
    pd = detection_probability(
        10.0**2.11, false_alarm_probability=1e-6, model="swerling1", method="shnidman"
    )
    assert pd == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pulses": 101}, "pulses is 101: it must be at most 100"),
        ({"false_alarm_probability": 1e-2}, r"false_alarm_probability is 0\.01: it must lie in"),
        ({"false_alarm_probability": 1e-10}, "false_alarm_probability is 1e-10: it must lie in"),
    ],
)
def test_shnidman_refuses(change, message):
    arguments = {"pulses": 1, "false_alarm_probability": 1e-6, **change}
    with pytest.raises(ValueError, match=message):
        detection_probability(10.0, method="shnidman", **arguments)


@pytest.mark.parametrize(("pulses", "pfa"), [(1, 1e-6), (10, 1e-3), (8096, 1e-7)])
def test_albersheim_error_and_range(pulses, pfa):
    radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": "swerling0"}
    low, high = _allowed("albersheim", **radar)
    snr = np.geomspace(low * (1 + 1e-5), high * (1 - 1e-5), 300)
    rough = detection_probability(snr, method="albersheim", **radar)
    assert np.all(np.diff(rough) >= 0.0)
    assert rough[0] == pytest.approx(0.1, abs=1e-4)
    assert rough[-1] == pytest.approx(0.9, abs=1e-4)
    assert np.max(np.abs(rough - detection_probability(snr, **radar))) < 0.12
    # At the upper end the equation is within 0.35 dB of the exact requirement.
    exact_db = 10.0 * np.log10(required_snr(0.9, **radar))
    assert abs(10.0 * np.log10(high) - exact_db) < 0.35


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pulses": 8097}, "pulses is 8097: it must be at most 8096"),
        ({"false_alarm_probability": 1e-8}, "false_alarm_probability is 1e-08: it must lie in"),
        ({"model": "swerling1"}, "model is 'swerling1': .* swerling0"),
        ({"snr": 1e6}, r"snr is 1e\+06: it must lie in .* dB, Pd 0.1 to 0.9"),
    ],
)
def test_albersheim_refuses(change, message):
    arguments = {"snr": 20.0, "false_alarm_probability": 1e-6, "model": "swerling0", **change}
    with pytest.raises(ValueError, match=message):
        detection_probability(method="albersheim", **arguments)


@pytest.mark.parametrize(
    ("block", "keys"),
    [
        ({"type": "radar.range_boundary", "range_km": 3.0}, {}),
        ({"type": "radar.swerling", "calibrate": {"range_km": 4.0}, "range_km": 9.0},
         {"range_km": 4.0}),
        ({"type": "radar.threshold", "range_km": 9.0}, {"range_km": 9.0}),
    ],
)  # fmt: skip
def test_a_boundary_lies_where_the_calibration_knows_it_else_at_the_limit(block, keys):
    (rung,) = (rung for rung in DETECTION.rungs if rung.name == "range_boundary")
    assert rung.parameters_to_set(block) == keys
    with pytest.raises(Unavailable, match=r"needs calibrate\.range_km or range_km"):
        rung.parameters_to_set({"type": "radar.threshold"})
