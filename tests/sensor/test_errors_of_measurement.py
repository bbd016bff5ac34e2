"""Errors of measured values over a hundred thousand looks of every sensor, in every mode."""

import math
from itertools import combinations

import looks
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS, RADARS, RANGING, SENSORS, covers
from looks import COLUMNS, ERRORS, RANGE_ERRORS, errors_of, mean_is, quantities
from same_runs import tables_of
from wired import run

import dsa_des

CASES = [(kind, quantity) for kind in SENSORS for quantity in quantities(kind)]
#: Statistics of each test, for the bounds of all of its cases together.
EACH = len(CASES)
STATED = {
    "azimuth": (math.radians(ERRORS["azimuth_error_deg"]), math.radians(-0.4)),
    "elevation": (math.radians(ERRORS["elevation_error_deg"]), math.radians(0.25)),
    "range": (RANGE_ERRORS["range_error_m"], RANGE_ERRORS["range_bias_m"]),
    "range_rate": (RANGE_ERRORS["range_rate_error_m_s"], RANGE_ERRORS["range_rate_bias_m_s"]),
}
TAU_S = {"azimuth": 0.5, "elevation": 0.05, "range": 2.0, "range_rate": 0.2}
STEPS = {
    "azimuth": math.radians(2.0), "elevation": math.radians(1.0), "range": 50.0, "range_rate": 8.0
}  # fmt: skip
OF_ANGLES = (
    "azimuth_error_deg", "azimuth_bias_deg", "azimuth_correlation_time_s",
    "elevation_error_deg", "elevation_bias_deg", "elevation_correlation_time_s",
)  # fmt: skip
OF_RANGE = "range_error_m", "range_bias_m", "range_correlation_time_s"
OF_RATE = (
    "measures_range_rate",
    "range_rate_error_m_s", "range_rate_bias_m_s", "range_rate_correlation_time_s",
    "range_rate_resolution_m_s",
)  # fmt: skip


@pytest.fixture(scope="module", params=SENSORS)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def detections(kind):
    only = {"looks": False, "truth": False}
    found = looks.by_block(run(looks.scene(kind, record=only))["detections"])
    assert all(len(columns["scan"]) == 100_000 for columns in found.values())
    return found


@covers("errors", "biases", "quantised", *OF_ANGLES, of=SENSORS)
@covers(*OF_RANGE, of=RANGING)
@covers(*OF_RATE, of=RADARS)
def test_stated_errors_are_white_with_the_stated_spread_and_bias(detections, kind):
    for quantity in quantities(kind):
        columns = detections["stated"]
        sigma, bias = STATED[quantity]
        error = errors_of(columns, quantity)
        new = (error - bias) / sigma
        assert mean_is(new, 0.0, 6 * EACH)
        assert mean_is(new**2, 1.0, 6 * EACH)
        assert mean_is(new**4, 3.0, 6 * EACH)
        assert mean_is(new[:, 1:] * new[:, :-1], 0.0, 6 * EACH)
        assert mean_is(new[1:] * new[:-1], 0.0, 6 * EACH)
        np.testing.assert_allclose(columns[COLUMNS[quantity][2]], sigma**2 + bias**2, rtol=1e-12)
        assert mean_is(error**2 / (sigma**2 + bias**2), 1.0, 6 * EACH)


def test_lasting_errors_forget_with_their_time(detections, kind):
    """What is new at each look, given the one before, is white."""
    for quantity in quantities(kind):
        sigma, bias = STATED[quantity]
        error = (errors_of(detections["lasting"], quantity) - bias) / sigma
        rho = math.exp(-1.0 / looks.RATE_HZ / TAU_S[quantity])
        new = (error[:, 1:] - rho * error[:, :-1]) / math.sqrt(1.0 - rho**2)
        assert mean_is(new, 0.0, 4 * EACH)
        assert mean_is(new**2, 1.0, 4 * EACH)
        assert mean_is(new[:, 1:] * new[:, :-1], 0.0, 4 * EACH)
        assert mean_is(new[:, 30:] * new[:, :-30], 0.0, 4 * EACH)


@pytest.mark.parametrize("mode", ["stated", "lasting", "signal"])
def test_the_error_of_one_quantity_tells_nothing_of_another(detections, kind, mode):
    if mode not in detections:
        pytest.skip("it has no signal")
    new = {}
    for quantity in quantities(kind):
        error = errors_of(detections[mode], quantity)
        rho = math.exp(-1.0 / looks.RATE_HZ / TAU_S[quantity]) if mode == "lasting" else 0.0
        fresh = error[:, 1:] - rho * error[:, :-1]
        variance = detections[mode][COLUMNS[quantity][2]].reshape(error.shape)[:, 1:]
        new[quantity] = (fresh - fresh.mean()) / np.sqrt(variance)
    for one, other in combinations(new, 2):
        assert mean_is(new[one] * new[other], 0.0, 5 * EACH)


def test_rounding_is_in_the_variance_of_what_is_rounded(detections, kind):
    for quantity in quantities(kind):
        columns = detections["quantised"]
        step = STEPS[quantity]
        measured, _, variance = COLUMNS[quantity]
        steps = columns[measured] / step
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
        sigma, bias = STATED[quantity]
        expected = sigma**2 + bias**2 + step**2 / 12.0
        np.testing.assert_allclose(columns[variance], expected, rtol=1e-12)
        assert mean_is(errors_of(columns, quantity) ** 2 / expected, 1.0, EACH)


def test_errors_of_the_grid_have_no_bias_and_their_variance(detections, kind):
    for quantity in set(quantities(kind)) - {"range_rate"}:
        columns = detections["grid"]
        error = errors_of(columns, quantity)
        variance = columns[COLUMNS[quantity][2]].reshape(error.shape)
        assert mean_is(error / np.sqrt(variance), 0.0, 3 * EACH)
        assert mean_is(error**2 / variance, 1.0, 3 * EACH)
        assert mean_is(error[:, 1:] * error[:, :-1] / variance[:, 1:], 0.0, 3 * EACH)


@covers("azimuth_beamwidth_deg", "elevation_beamwidth_deg", "range_resolution_m", of=LINK_BUDGETS)
@covers("noise_equivalent_contrast", of=CAMERAS)
def test_errors_by_signal_are_white_with_the_variance_they_state(detections, kind):
    if "signal" not in detections:
        pytest.skip("it has no signal")
    for quantity in quantities(kind):
        columns = detections["signal"]
        error = errors_of(columns, quantity)
        variance = columns[COLUMNS[quantity][2]].reshape(error.shape)
        assert variance.max() > 1.5 * variance.min()
        new = error / np.sqrt(variance)
        assert mean_is(new, 0.0, 4 * EACH)
        assert mean_is(new**2, 1.0, 4 * EACH)
        assert mean_is(new**4, 3.0, 4 * EACH)
        assert mean_is(new[:, 1:] * new[:, :-1], 0.0, 4 * EACH)


def test_a_radar_s_errors_follow_the_published_relations(detections, kind):
    """Barton's k_m = 1.6 of monopulse, and Curry's range resolution over the root of 2 S/N."""
    if kind not in LINK_BUDGETS:
        pytest.skip("it has no SNR")
    columns = detections["signal"]
    snr = 10.0 ** (columns["snr_db"] / 10.0)
    strong = snr > 10.0
    assert strong.mean() > 0.9
    for quantity, width in (
        ("azimuth", math.radians(3.0) / 1.6), ("elevation", math.radians(5.0) / 1.6),
        ("range", 40.0), ("range_rate", 6.0),
    ):  # fmt: skip
        sigma = np.sqrt(columns[COLUMNS[quantity][2]])
        expected = width / np.sqrt(2.0 * snr)
        np.testing.assert_allclose(sigma[strong], expected[strong], rtol=1e-9)


SLOW = [
    "blocks.eo.errors=stated", "blocks.eo.azimuth_error_deg=0.3",
    "blocks.eo.azimuth_correlation_time_s=2", "blocks.eo.quantised=false",
    "blocks.eo.noise_equivalent_contrast=0",
]  # fmt: skip


def test_scan_rates_share_what_lasts():
    """Twice as many scans: at the instants that both have, an error that lasts is the same."""
    found = []
    for rate in (2, 4):
        sets = [*SLOW, f"blocks.eo.scan_rate_hz={rate}"]
        seen = dsa_des.load_scene("first_light", sets=sets, duration_s=100)
        table = tables_of(seen)[1]["detections"]
        column = {n: table[n].to_numpy(zero_copy_only=False) for n in table.column_names}
        mine = (column["block"] == "eo") & (column["target"] == "head_on")
        off = column["azimuth_rad"][mine] - column["true_azimuth_rad"][mine]
        found.append(dict(zip(column["tick"][mine].tolist(), off.tolist(), strict=True)))
    slow, fast = found
    common = sorted(slow.keys() & fast.keys())
    assert len(common) == len(slow) > 10
    np.testing.assert_array_equal([slow[t] for t in common], [fast[t] for t in common])
