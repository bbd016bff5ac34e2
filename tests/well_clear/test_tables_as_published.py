"""Tables of TCAS II and of altimeters, written again in their own units, layer by layer."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from components.well_clear.severity import collision_probability
from components.well_clear.tcas import recovery_cylinder_sizes_m, tcas_advisory_span

FOOT_M, MILE_M = 0.3048, 1852.0
#: Lowest and highest altitude, ft; TAU s, DMOD nmi, ZTHR ft of traffic and resolution advisories,
#: and the latter's HMD, ft.
LAYERS = [
    (0, 1000, (20, 0.30, 850), None),
    (1001, 2350, (25, 0.33, 850), (15, 0.20, 600, 1215)),
    (2351, 5000, (30, 0.48, 850), (20, 0.35, 600, 2126)),
    (5001, 10000, (40, 0.75, 850), (25, 0.55, 600, 3342)),
    (10001, 20000, (45, 1.00, 850), (30, 0.80, 600, 4861)),
    (20001, 42000, (48, 1.30, 850), (35, 1.10, 700, 6683)),
    (42001, 60000, (48, 1.30, 1200), (35, 1.10, 800, 6683)),
]


def due(feet, resolution, east_m=0.0, up_m=0.0, closing_mps=0.0, north_m=0.0):
    """Tell whether an intruder is an advisory now; it comes from the east."""
    relative = (-east_m, -north_m, up_m, closing_mps, 0.0, 0.0)
    states = tuple(np.array([float(part)]) for part in relative)
    own = np.array([feet * FOOT_M])
    found = tcas_advisory_span(states, own, np.zeros(1), resolution=resolution, end_s=1.0)
    return bool(found.begin_s[0] == 0.0)


@pytest.mark.parametrize("resolution", [False, True])
@pytest.mark.parametrize("layer", LAYERS)
def test_advisories_have_the_sizes_of_their_layer(layer, resolution):
    low, high, *tables = layer
    sizes = tables[resolution]
    for feet in (low, high):
        if sizes is None:
            assert not due(feet, resolution, east_m=1.0)
            continue
        tau, dmod, zthr, *hmd = sizes
        d, z = dmod * MILE_M, zthr * FOOT_M
        assert due(feet, resolution, east_m=d * 0.999)
        assert not due(feet, resolution, east_m=d * 1.001)
        assert due(feet, resolution, up_m=z * 0.999) and due(feet, resolution, up_m=-z * 0.999)
        assert not due(feet, resolution, up_m=z * 1.001)
        # Where (r² - D²) / (r v) is the time: r = v t / 2 + √((v t / 2)² + D²).
        for part, wanted in ((0.999, True), (1.001, False)):
            half = 0.5 * 130.0 * tau * part
            away = half + math.hypot(half, d)
            assert due(feet, resolution, east_m=away, closing_mps=130.0) is wanted
        if hmd:  # passes by that far
            for part, wanted in ((0.999, True), (1.001, False)):
                miss = hmd[0] * FOOT_M * part
                if miss < d:
                    ahead = math.sqrt(d * d - miss * miss) * 0.99
                    assert due(feet, True, ahead, 0.0, 90.0, miss) is wanted


@pytest.mark.parametrize("layer", LAYERS)
def test_recovery_keeps_clear_of_the_sizes_of_resolution_advisories(layer):
    sizes = layer[3] or LAYERS[1][3]  # below 1000 ft those of the next layer
    for feet in layer[:2]:
        radius, height = recovery_cylinder_sizes_m(np.array([feet * FOOT_M]))
        assert (radius[0], height[0]) == pytest.approx((sizes[3] * FOOT_M, sizes[2] * FOOT_M))


ALTIMETERS = [(2300, 35, 60, 0.391), (5000, 38, 60, 0.320), (10000, 43, 69, 0.345),
              (20000, 58, 87, 0.610), (41000, 72, 101, 0.610), (55000, 94, 101, 0.610)]  # fmt: skip


def density(x, one, other):
    """Of the difference of two Laplace errors at x, ft, by summing over the first one."""
    errors = np.arange(-3000.0, 3000.5, 1.0)
    first = np.exp(-np.abs(errors) / one) / (2 * one)
    return float(np.sum(first * np.exp(-np.abs(errors - x) / other) / (2 * other)))


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("mode_c", [(False, False), (False, True)])
def test_chance_of_a_collision_is_the_sum_over_the_errors(place, mode_c):
    top, good, poor, chance = ALTIMETERS[place]
    height_ft = 60.0
    scales = [[(1.0, good)], [(chance, good), (1.0 - chance, poor)]]
    wanted = 0.0
    for share, one in scales[mode_c[0]]:
        for other_share, other in scales[mode_c[1]]:
            gaps = np.arange(-100.0, 100.5, 2.0)
            dense = np.array([density(gap - height_ft, one, other) for gap in gaps])
            wanted += share * other_share * trapezoid(dense, gaps)
    above = (top - 1.0) * FOOT_M, top * FOOT_M
    found = collision_probability(10.0, height_ft * FOOT_M, above, mode_c)
    assert float(found) == pytest.approx(wanted, rel=2e-3)
