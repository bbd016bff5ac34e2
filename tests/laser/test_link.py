"""The laser's equation and scan pattern against sums over the beam and drawn patterns."""

import math

import numpy as np
import pytest

from components.laser.range_equation import (
    beam_share_on_target,
    beam_share_on_wire,
    mean_shots_on_target,
    received_laser_power_w,
    scan_detection_probability,
)

BEAM = 1.5e-3
LASER = {"peak_power_w": 5000.0, "aperture_m": 0.05, "efficiency": 0.5}


def power_by_rays(inside, range_m, reflectivity):
    """The echo of a beam of even brightness, ray by ray over its disc."""
    side = np.linspace(-0.5, 0.5, 3001) * BEAM * range_m
    x, y = np.meshgrid(side, side)
    disc = np.hypot(x, y) <= 0.5 * BEAM * range_m
    hit = np.count_nonzero(disc & inside(x, y)) / np.count_nonzero(disc)
    scattered_per_sr = LASER["peak_power_w"] * hit * reflectivity / math.pi
    aperture_sr = math.pi * (0.5 * LASER["aperture_m"]) ** 2 / range_m**2
    return scattered_per_sr * aperture_sr * LASER["efficiency"]


@pytest.mark.parametrize("range_m", [80.0, 300.0])
def test_an_echo_is_the_sum_over_the_beam_s_rays(range_m):
    for share, inside in (
        (beam_share_on_target(0.02, range_m, BEAM), lambda x, y: x * x + y * y <= 0.02 / math.pi),
        (beam_share_on_target(1e4, range_m, BEAM), lambda x, y: x == x),
        (beam_share_on_wire(0.01, range_m, BEAM), lambda x, y: np.abs(y) <= 0.005),
    ):  # fmt: skip
        found = received_laser_power_w(share, range_m, reflectivity=0.2, **LASER)
        assert found == pytest.approx(power_by_rays(inside, range_m, 0.2), rel=0.02)


@pytest.mark.parametrize(("kind", "power"), [("large", 2.0), ("wire", 3.0), ("small", 4.0)])
def test_echoes_fall_by_their_kind_s_power_of_range(kind, power):
    range_m = np.array([500.0, 1000.0])
    share = {
        "large": beam_share_on_target(1e3, range_m, BEAM),
        "wire": beam_share_on_wire(0.01, range_m, BEAM),
        "small": beam_share_on_target(0.01, range_m, BEAM),
    }[kind]
    near, far = received_laser_power_w(share, range_m, **LASER)
    assert near / far == pytest.approx(2.0**power)
    near, far = received_laser_power_w(share, range_m, extinction_per_m=1e-3, **LASER)
    assert near / far == pytest.approx(2.0**power * math.e)


def test_a_drawn_pattern_hits_as_often_and_as_much_as_the_mean_says():
    """A wire and a small disc under a lattice of shots whose phase is drawn."""
    rng = np.random.default_rng(5)
    step, length, thick = np.array([2.8e-3, 5.9e-3]), 40e-3, 1.7e-5
    lattice = np.stack(np.meshgrid(np.arange(-20, 21), np.arange(-6, 7)), axis=-1) * step
    light_of = {"wire": 0.0, "disc": 0.0}
    disc_area = 0.25 * math.pi * BEAM**2
    tries = 4000
    for _ in range(tries):
        x, y = np.moveaxis(lattice + (rng.random(2) - 0.5) * step, -1, 0)
        chord = 2.0 * np.sqrt(np.maximum((0.5 * BEAM) ** 2 - y**2, 0.0))
        light_of["wire"] += chord[np.abs(x) <= 0.5 * length].sum() * thick / disc_area
        light_of["disc"] += np.count_nonzero(np.hypot(x, y) <= 0.5 * BEAM) * 1e-9 / disc_area
    shots = {
        "wire": mean_shots_on_target(length * thick, length * 0.25 * math.pi * BEAM, step.prod())
        * beam_share_on_wire(thick, 1.0, BEAM),
        "disc": mean_shots_on_target(1e-9, disc_area, step.prod())
        * beam_share_on_target(1e-9, 1.0, BEAM),
    }
    for kind, light in light_of.items():
        assert light / tries == pytest.approx(shots[kind], rel=0.05), kind


def test_a_scan_s_probability_is_that_of_drawn_amplitudes():
    rng = np.random.default_rng(3)
    draws = 100_000
    for snr, mean, needed in ((3.0, 2.4, 1), (4.2, 3.7, 2), (4.0, 0.3, 1), (5.0, 1.5, 2)):
        count = math.floor(mean) + (rng.random(draws) < mean % 1.0)
        amplitude = snr + rng.standard_normal((draws, 5))
        crossed = (amplitude >= 4.0) & (np.arange(5) < count[:, np.newaxis])
        share = np.mean(crossed.sum(axis=1) >= needed)
        pd = scan_detection_probability(snr, mean, threshold=4.0, needed=needed)
        assert abs(share - pd) < 2.576 * math.sqrt(pd * (1.0 - pd) / draws)


def test_what_is_out_of_range_is_refused_by_name():
    for call, name in (
        (lambda: beam_share_on_wire(-0.1, 10.0, BEAM), "diameter_m"),
        (lambda: beam_share_on_target(1.0, 0.0, BEAM), "range_m"),
        (lambda: received_laser_power_w(0.1, 10.0, **{**LASER, "aperture_m": 0.0}), "aperture_m"),
        (lambda: mean_shots_on_target(1.0, 1.0, 0.0), "spacing_rad2"),
        (lambda: scan_detection_probability(math.nan, 1.0, threshold=4.0), "snr"),
    ):
        with pytest.raises(ValueError, match=name):
            call()
