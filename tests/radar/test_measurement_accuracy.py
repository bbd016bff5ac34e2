"""The accuracy relations of radars against simulated receivers, and where they end."""

import math

import numpy as np
import pytest

from components.radar.measurement import (
    angle_variance,
    range_rate_variance,
    range_variance,
)

LOOKS = 200_000


def noise(rng, count):
    """Return complex noise of power 1."""
    return (rng.standard_normal(count) + 1j * rng.standard_normal(count)) / math.sqrt(2.0)


@pytest.mark.parametrize("snr_db", [13.0, 20.0, 30.0])
def test_a_monopulse_receiver_has_the_stated_accuracy(snr_db):
    """Difference over sum, each in noise of its own, of a target on the axis."""
    rng = np.random.default_rng(1)
    amplitude, beam = 10.0 ** (snr_db / 20.0), math.radians(3.0)
    ratio = (noise(rng, LOOKS) / (amplitude + noise(rng, LOOKS))).real
    measured = np.std(ratio * beam / 1.6)
    stated = np.sqrt(angle_variance(beam, np.array([10.0 ** (snr_db / 10.0)])))[0]
    assert stated == pytest.approx(measured, rel=0.05)


def test_pulses_average_a_monopulse_receiver():
    rng = np.random.default_rng(2)
    amplitude, pulses = 10.0 ** (13.0 / 20.0), 8
    difference, total = (noise(rng, 8 * 20_000).reshape(-1, 8) for _ in range(2))
    total = total + amplitude
    ratio = (difference * total.conj()).real.sum(axis=1) / (np.abs(total) ** 2).sum(axis=1)
    stated = np.sqrt(angle_variance(1.0, np.array([pulses * amplitude**2])))[0]
    assert stated == pytest.approx(np.std(ratio) / 1.6, rel=0.05)


@pytest.mark.parametrize("snr_db", [15.0, 25.0])
def test_a_pulse_s_delay_is_found_as_well_as_its_resolution_says(snr_db):
    """A matched filter's peak, of a Gaussian pulse whose half-power width is the resolution."""
    rng = np.random.default_rng(3)
    looks, step = 4000, 0.05
    time = np.arange(-3.0, 3.0, step)
    # What it finds lies below: the relation has no pulse shape, and pays for a weighted receiver.
    spread = 0.5 / math.sqrt(math.log(2.0))
    kernel = np.exp(-0.5 * (time / spread) ** 2)
    filtered = np.array([
        np.convolve(noise(rng, len(time)), kernel, mode="same") for _ in range(looks)
    ])  # fmt: skip
    filtered /= np.sqrt((kernel**2).sum())
    peak = 10.0 ** (snr_db / 20.0) * np.exp(-((time / spread) ** 2) / 4.0)
    found = time[np.argmax(np.abs(filtered + peak), axis=1)]
    stated = math.sqrt(range_variance(1.0, np.array([10.0 ** (snr_db / 10.0)]))[0])
    assert 0.5 < np.std(found) / stated < 1.05


def test_scanning_and_monopulse_differ_by_their_constants():
    ratio = np.array([20.0, 2000.0])
    scan, pair = (angle_variance(0.1, ratio, method=m) for m in ("scan", "monopulse"))
    np.testing.assert_allclose(scan / pair, 1.33 * (1.6 / 1.66) ** 2, rtol=1e-12)
    np.testing.assert_allclose(pair, (0.1 / 1.6) ** 2 / (2.0 * ratio), rtol=1e-12)
    np.testing.assert_allclose(range_rate_variance(3.0, ratio), 9.0 / (2.0 * ratio), rtol=1e-12)


@pytest.mark.parametrize("variance", [angle_variance, range_variance, range_rate_variance])
def test_no_error_is_larger_than_its_cell(variance):
    ratio = np.array([0.0, 1e-9, 0.5, 2.0, 10.0, 1e6])
    found = variance(2.0, ratio)
    assert (np.diff(found) <= 0.0).all()
    assert found[0] == found[1] == pytest.approx(4.0 / 12.0)
    assert found[-1] < 1e-5


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: angle_variance(0.0, np.ones(1)), "beamwidth_rad"),
        (lambda: angle_variance(0.1, -np.ones(1)), "energy_ratio"),
        (lambda: angle_variance(0.1, np.ones(1), method="lobing"), "method is 'lobing'"),
        (lambda: range_variance(-1.0, np.ones(1)), "range_resolution_m"),
    ],
)
def test_bad_arguments_are_named(call, said):
    with pytest.raises(ValueError, match=said):
        call()
