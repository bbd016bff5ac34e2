"""Moving-target filters: their weights applied to drawn echoes, blind speeds, published factors."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from components.radar.doppler import FILTERS, MovingTargetFilter, folded_range_rate
from components.radar.ground_clutter import platform_range_rate_spread_m_s

PRF_HZ, WAVELENGTH_M = 5000.0, 0.03
BLIND_M_S = 75.0


def made(kind, **keys):
    return MovingTargetFilter(kind, PRF_HZ, WAVELENGTH_M, **keys)


def response(kind, range_rate_m_s, tuned_hz=0.0, pulses=16):
    """|sum of weights times echoes|² over that of noise, or of pulses in phase, pulse by pulse."""
    doppler_hz = -2.0 * range_rate_m_s / WAVELENGTH_M
    weights = {
        "single_canceller": np.array([1.0, -1.0]),
        "double_canceller": np.array([1.0, -2.0, 1.0]),
        "filter_bank": 0.54 - 0.46 * np.cos(2 * np.pi * np.arange(pulses) / (pulses - 1)),
    }[kind]
    time_s = np.arange(len(weights)) / PRF_HZ
    echoes = np.exp(2j * np.pi * (doppler_hz - tuned_hz) * time_s)
    over = np.sum(weights**2) * (pulses if kind == "filter_bank" else 1.0)
    return abs(np.sum(weights * echoes)) ** 2 / over


@pytest.mark.parametrize("kind", ["single_canceller", "double_canceller"])
@pytest.mark.parametrize("spread_m_s", [0.4, 6.0])
def test_cancellers_let_through_what_their_weights_do(kind, spread_m_s):
    for rate in (0.0, 1.0, -9.0, 30.0, 74.0, 160.0):
        target, clutter = made(kind).target_and_clutter_gains(rate, 2.0, spread_m_s)
        assert target == pytest.approx(response(kind, rate), abs=1e-12)
        expected, _ = quad(
            lambda v: response(kind, v)
            * math.exp(-0.5 * ((v - 2.0) / spread_m_s) ** 2)
            / (spread_m_s * math.sqrt(2 * math.pi)),
            2.0 - 9 * spread_m_s, 2.0 + 9 * spread_m_s, epsabs=1e-13,
        )  # fmt: skip
        assert clutter == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("pulses", [8, 9, 16])
def test_a_bank_seeks_in_the_nearest_filter_outside_the_notch(pulses):
    notch_m_s = 17.0
    bank = made("filter_bank", pulses=pulses, notch_m_s=notch_m_s)
    centres = [k * BLIND_M_S / pulses for k in range(-(pulses // 2), pulses // 2 + 1)]
    centres = [v for v in centres if abs(v) >= notch_m_s]
    for rate in (20.0, -20.0, 33.0, -30.0, 71.0 + 2.0 * BLIND_M_S, 3.0):
        folded = (rate + BLIND_M_S / 2) % BLIND_M_S - BLIND_M_S / 2
        distance = [min(abs(folded - v), BLIND_M_S - abs(folded - v)) for v in centres]
        tuned_hz = -2.0 * centres[int(np.argmin(distance))] / WAVELENGTH_M
        target, clutter = bank.target_and_clutter_gains(rate, 1.0, 0.0)
        assert target == pytest.approx(response("filter_bank", rate, tuned_hz, pulses), rel=1e-9)
        expected = response("filter_bank", 1.0, tuned_hz, pulses)
        assert clutter == pytest.approx(expected, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("kind", FILTERS)
def test_blind_speeds_are_multiples_of_half_a_wavelength_by_prf(kind):
    found = made(kind)
    assert found.blind_speed_m_s == pytest.approx(BLIND_M_S)
    assert found.unambiguous_range_rate_m_s == pytest.approx(BLIND_M_S / 2)
    rates = np.linspace(0.0, BLIND_M_S, 301)
    here, _ = found.target_and_clutter_gains(rates)
    again, _ = found.target_and_clutter_gains(rates - 3 * BLIND_M_S)
    np.testing.assert_allclose(again, here, atol=1e-10)
    assert here[0] < 4e-3 and here[-1] < 4e-3
    assert here[150] == max(here[100:200]) or kind == "filter_bank"
    # A target of unknown speed keeps its power on average; the bank loses by window and scallops.
    mean = np.mean(found.target_and_clutter_gains((np.arange(1000) + 0.5) * BLIND_M_S / 1000)[0])
    assert mean == pytest.approx(1.0, abs=1e-9) if kind != "filter_bank" else 0.4 < mean < 0.75


def test_improvement_factors_as_published():
    """Skolnik, section 3.7: 2 (PRF / 2 pi s)² and 2 (PRF / 2 pi s)⁴, s in Hz."""
    spread_m_s = 0.3
    over = PRF_HZ / (2.0 * math.pi * 2.0 * spread_m_s / WAVELENGTH_M)
    assert made("single_canceller").improvement_factor(spread_m_s) == pytest.approx(
        2 * over**2, rel=2e-3
    )
    assert made("double_canceller").improvement_factor(spread_m_s) == pytest.approx(
        2 * over**4, rel=4e-3
    )
    bank = made("filter_bank").improvement_factor(spread_m_s)
    assert bank > 1e3


def test_the_spread_of_a_moving_platform_is_that_of_its_beam():
    """Range rates drawn across a Gaussian beam, seen twice."""
    speed, off, beam = 70.0, math.radians(50.0), math.radians(2.0)
    angle = np.linspace(-4 * beam, 4 * beam, 20_001)
    gain = np.exp(-8.0 * math.log(2.0) * (angle / beam) ** 2)
    rate = -speed * np.cos(off + angle)
    mean = np.average(rate, weights=gain)
    expected = math.sqrt(np.average((rate - mean) ** 2, weights=gain))
    found = platform_range_rate_spread_m_s(speed, -speed * math.cos(off), beam)
    assert found == pytest.approx(expected, rel=1e-3)
    # Abeam 0.6 V θ / λ in Hz (Skolnik, section 3.7).
    abeam = 2.0 / WAVELENGTH_M * platform_range_rate_spread_m_s(speed, 0.0, beam)
    assert abeam == pytest.approx(0.6 * speed * beam / WAVELENGTH_M, rel=2e-3)
    assert platform_range_rate_spread_m_s(speed, -speed, beam) == 0.0


def test_range_rates_fold():
    found = folded_range_rate([0.0, 10.0, 37.5, -37.5, -38.0, 100.0], 37.5)
    np.testing.assert_allclose(found, [0.0, 10.0, -37.5, -37.5, 37.0, 25.0])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"kind": "triple"}, "triple"),
        ({"prf_hz": 0.0}, "prf_hz"),
        ({"wavelength_m": -1.0}, "wavelength_m"),
        ({"pulses": 4}, "pulses is 4"),
        ({"notch_m_s": 38.0}, "notch_m_s is 38: it leaves no filter"),
        ({"notch_m_s": -1.0}, "notch_m_s"),
    ],
)
def test_bad_filters_are_named(keys, message):
    given = {"kind": "filter_bank", "prf_hz": PRF_HZ, "wavelength_m": WAVELENGTH_M, **keys}
    with pytest.raises(ValueError, match=message):
        MovingTargetFilter(**given)
