"""Detection in clutter against drawn amplitudes, mpmath and the formulas' limits."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.arguments.checks import MODELS
from components.radar.detection import detection_probability
from components.radar.detection.clutter import (
    KINDS,
    clutter_detection_probability,
    marcum_q1,
)

DRAWS = 200_000


def drawn_probability(rng, model, kind, snr, cnr, diffuse_cnr, pfa):
    """Draw target, mean clutter and noise as complex amplitudes and count the crossings."""
    power = {
        "swerling0": lambda: np.full(DRAWS, snr),
        "swerling1": lambda: snr * rng.standard_exponential(DRAWS),
        "swerling3": lambda: snr / 2 * rng.standard_gamma(2.0, DRAWS),
    }[model]()
    ground = cnr * (np.ones(DRAWS) if kind == "constant" else rng.standard_exponential(DRAWS))
    phase = rng.uniform(0.0, 2 * np.pi, DRAWS)
    noise = rng.standard_normal(DRAWS) + 1j * rng.standard_normal(DRAWS)
    amplitude = (
        np.sqrt(power) * np.exp(1j * phase)
        + np.sqrt(ground)
        + math.sqrt((1 + diffuse_cnr) / 2) * noise
    )
    return np.mean(np.abs(amplitude) ** 2 > -math.log(pfa))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", ["swerling0", "swerling1", "swerling3"])
def test_detection_in_clutter_agrees_with_drawn_amplitudes(model, kind):
    rng = np.random.Generator(np.random.PCG64([len(kind), int(model[-1])]))
    for snr, cnr, diffuse in ((10.0, 3.0, 0.0), (2.0, 8.0, 0.5), (0.0, 2.0, 0.3)):
        drawn = drawn_probability(rng, model, kind, snr, cnr, diffuse, 0.01)
        exact = clutter_detection_probability(
            snr, cnr, false_alarm_probability=0.01, model=model, clutter=kind, diffuse_cnr=diffuse
        )
        assert abs(drawn - exact) < 4.0 * math.sqrt(exact * (1 - exact) / DRAWS)


def exact_marcum(signal, threshold):
    with mpmath.workdps(60):
        a, v = mpmath.mpf(signal), mpmath.mpf(threshold)
        term, step = mpmath.exp(-a), mpmath.exp(-v)
        below, total = step, term * step
        for k in range(1, 800):
            term *= a / k
            step *= v / k
            below += step
            total += term * below
        return total


@pytest.mark.parametrize("largest", [0.7, 3.0, 27.6, 230.0])
def test_marcum_q_keeps_its_digits_on_both_sides(largest):
    for signal in (0.0, 1e-6, 0.1, 1.0, 12.0, 27.0, 100.0):
        for threshold in (0.0, 0.01 * largest, 0.3 * largest, largest):
            ours = marcum_q1(np.array([signal]), np.array([threshold]), largest)[0]
            truth = exact_marcum(signal, threshold)
            assert abs(ours - truth) <= 2e-14 * truth
            if 1 - truth > 1e-4:
                assert abs((1 - mpmath.mpf(ours)) - (1 - truth)) <= 1e-12 * (1 - truth)
    assert marcum_q1(np.array([1e6]), np.array([largest]), largest)[0] == 1.0


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("kind", KINDS)
def test_without_clutter_nothing_changes_to_the_bit(model, kind):
    snr = np.geomspace(1e-4, 1e4, 101)
    clear = detection_probability(snr, false_alarm_probability=1e-6, model=model)
    cluttered = clutter_detection_probability(
        snr, 0.0, false_alarm_probability=1e-6, model=model, clutter=kind
    )
    np.testing.assert_array_equal(cluttered, clear)
    # And it is a limit, not only a special case.
    nearly = clutter_detection_probability(
        snr, 1e-12, false_alarm_probability=1e-6, model=model, clutter=kind
    )
    np.testing.assert_allclose(nearly, clear, rtol=1e-9)


def test_fluctuating_mean_is_more_noise():
    snr, cnr = 30.0, 4.0
    expected = detection_probability(
        snr / 5, false_alarm_probability=0.01 ** (1 / 5), model="swerling3"
    )
    ours = clutter_detection_probability(snr, cnr, false_alarm_probability=0.01, model="swerling3")
    assert ours == pytest.approx(expected, rel=1e-12)
    # One look cannot tell an exponential mean from Gaussian clutter of the same power.
    diffuse = clutter_detection_probability(
        snr, 0.0, false_alarm_probability=0.01, model="swerling3", diffuse_cnr=cnr
    )
    assert ours == pytest.approx(diffuse, rel=1e-14)


@settings(derandomize=True, deadline=None, max_examples=80)
@given(
    snr=st.floats(0, 1e6),
    cnr=st.floats(0, 1e6),
    diffuse=st.floats(0, 1e6),
    pfa=st.floats(1e-12, 0.5),
    model=st.sampled_from(MODELS),
    kind=st.sampled_from(KINDS),
)
def test_probabilities_stay_probabilities(snr, cnr, diffuse, pfa, model, kind):
    with np.errstate(all="raise", under="ignore"):
        pd = clutter_detection_probability(
            snr,
            cnr,
            false_alarm_probability=pfa,
            model=model,
            clutter=kind,
            diffuse_cnr=diffuse,
        )
    assert pfa * (1 - 1e-12) <= pd <= 1.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"snr": -1.0}, "snr is -1"),
        ({"cnr": -2.0}, "cnr is -2: .*0 or more"),
        ({"diffuse_cnr": math.inf}, "diffuse_cnr is inf"),
        ({"false_alarm_probability": 1.5}, "false_alarm_probability is 1.5: .*between 0 and 1"),
        ({"false_alarm_probability": 1e-200}, "at least 1e-100"),
        ({"false_alarm_probability": [0.1, 0.2]}, "one number"),
        ({"clutter": "constnat"}, "'constant'"),
        ({"model": "swerling9"}, "model is 'swerling9'"),
    ],
)
def test_bad_input_is_named(change, words):
    good = {"snr": 1.0, "cnr": 1.0, "false_alarm_probability": 0.05}
    with pytest.raises(ValueError, match=words):
        clutter_detection_probability(**{**good, **change})
