"""Cell-averaging CFAR: closed forms, integrals, and averages that are drawn."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammaincc
from scipy.stats import binom, gamma

from components.radar.detection import detection_probability
from components.radar.detection.cfar import (
    cfar_detection_probability,
    cfar_loss_db,
    cfar_multiplier,
    cfar_required_snr,
)


def drawn(rng, model, snr, pulses, cells, pfa, looks):
    """Counts complex Gaussian samples that exceed the scaled sum of the cells around."""

    def powers(shape):
        voltage = rng.normal(size=(2, *shape)) * math.sqrt(0.5)
        return voltage[0] + 1j * voltage[1]

    noise = np.abs(powers((looks, pulses * cells))) ** 2
    if model == 0:
        rcs = np.ones((looks, 1))
    elif model == 1:
        rcs = rng.exponential(size=(looks, 1))
    elif model == 2:
        rcs = rng.exponential(size=(looks, pulses))
    else:
        rcs = rng.gamma(2.0, 0.5, size=(looks, 1 if model == 3 else pulses))
    echo = np.sqrt(snr * rcs) * np.exp(2j * np.pi * rng.random((looks, pulses)))
    cell = np.sum(np.abs(echo + powers((looks, pulses))) ** 2, axis=1)
    factor = cfar_multiplier(cells, pfa, pulses=pulses)
    return int(np.count_nonzero(cell > factor * noise.sum(axis=1)))


@pytest.mark.parametrize("pulses", [1, 3])
@pytest.mark.parametrize("model", range(5))
def test_cells_that_are_drawn_and_averaged(model, pulses):
    looks, cells, pfa = 20_000, 8, 0.02
    rng = np.random.default_rng([model, pulses])
    for snr in (0.0, 2.0):
        count = drawn(rng, model, snr, pulses, cells, pfa, looks)
        pd = cfar_detection_probability(
            snr, reference_cells=cells, false_alarm_probability=pfa, pulses=pulses,
            model=f"swerling{model}",
        )  # fmt: skip
        low, high = binom.interval(0.999, looks, pd)
        assert low <= count <= high


def test_gandhi_and_kassam_s_closed_form_and_published_losses():
    """Eq. 12-13 of 1988; 16 cells at Pfa 1e-6 lose about 2 dB at Pd 0.5 (Richards, fig. 6.19)."""
    for cells in (4, 16, 200):
        for pfa in (1e-2, 1e-6, 1e-12):
            snr = np.array([0.0, 0.3, 5.0, 300.0])
            expected = (1.0 + (pfa ** (-1.0 / cells) - 1.0) / (1.0 + snr)) ** -cells
            found = cfar_detection_probability(
                snr, reference_cells=cells, false_alarm_probability=pfa
            )
            np.testing.assert_allclose(found, expected, rtol=1e-11)
    loss = cfar_loss_db(0.5, reference_cells=16, false_alarm_probability=1e-6)
    assert 1.8 < loss < 2.1
    assert cfar_loss_db(0.5, reference_cells=32, false_alarm_probability=1e-6) < 0.55 * loss


@pytest.mark.parametrize(("model", "pulses"), [(0, 1), (0, 5), (1, 5), (3, 1), (3, 4), (4, 2)])
def test_sums_against_the_integral_over_the_reference_cells(model, pulses):
    """The mean over the reference cells of Pd at the threshold that they set."""
    cells, pfa, snr = 6, 1e-3, 4.0
    a = cfar_multiplier(cells, pfa, pulses=pulses)
    weighed = gamma(pulses * cells)

    def at(g):
        pd = detection_probability_beyond(a * g, snr, pulses, model)
        return weighed.pdf(g) * pd

    expected, _ = quad(at, 0.0, 6.0 * pulses * cells, limit=200, epsabs=1e-11)
    found = cfar_detection_probability(
        snr, reference_cells=cells, false_alarm_probability=pfa, pulses=pulses,
        model=f"swerling{model}",
    )  # fmt: skip
    assert found == pytest.approx(expected, rel=1e-7)


def detection_probability_beyond(threshold, snr, pulses, model):
    """Pd of a fixed threshold, whose false alarm probability is that of the noise beyond it."""
    pfa = float(gammaincc(pulses, threshold))
    if not 0.0 < pfa < 1.0:
        return 1.0 - float(pfa == 0.0)
    return float(
        detection_probability(
            snr, pulses=pulses, false_alarm_probability=pfa, model=f"swerling{model}"
        )
    )


@pytest.mark.parametrize("model", range(5))
def test_many_cells_are_as_good_as_a_threshold_that_is_known(model):
    snr = np.geomspace(0.1, 1e3, 9)
    name = f"swerling{model}"
    known = detection_probability(snr, pulses=2, false_alarm_probability=1e-4, model=name)
    before = 1.0
    for cells in (4, 30, 1000):
        found = cfar_detection_probability(
            snr, reference_cells=cells, false_alarm_probability=1e-4, pulses=2, model=name
        )
        assert np.all(found <= known + 1e-12)
        off = np.max(np.abs(found - known))
        assert off < before
        before = off
    assert before < 3e-3


@pytest.mark.parametrize("model", range(5))
@pytest.mark.parametrize("pulses", [1, 4])
def test_required_snr_inverts_and_nothing_depends_on_who_stands_beside(model, pulses):
    keys = {"reference_cells": 12, "false_alarm_probability": 1e-5, "pulses": pulses,
            "model": f"swerling{model}"}  # fmt: skip
    for pd in (1e-3, 0.5, 0.95):
        snr = cfar_required_snr(pd, **keys)
        assert cfar_detection_probability(snr, **keys) == pytest.approx(pd, rel=1e-9)
    snr = np.concatenate([np.linspace(0, 60, 300), [1e9, np.inf]])
    whole = cfar_detection_probability(snr, **keys)
    assert np.all(np.diff(whole) >= -1e-15) and whole[-1] == 1.0
    assert whole[0] == pytest.approx(1e-5, rel=1e-6)
    for step in (1, 7):
        parts = [
            cfar_detection_probability(snr[i : i + step], **keys) for i in range(0, len(snr), step)
        ]
        assert np.array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"reference_cells": 3}, "reference_cells is 3"),
        ({"reference_cells": 2.5}, "reference_cells is 2.5"),
        ({"false_alarm_probability": 1.0}, "false_alarm_probability"),
        ({"model": "swerling9"}, "swerling9"),
        ({"snr": -1.0}, "snr"),
    ],
)
def test_bad_arguments_are_named(change, message):
    keys = {"snr": 1.0, "reference_cells": 16, "false_alarm_probability": 1e-6, **change}
    with pytest.raises(ValueError, match=message):
        cfar_detection_probability(keys.pop("snr"), **keys)
