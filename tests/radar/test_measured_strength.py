"""What a radar knows of the strength of what it reports, target or noise."""

import numpy as np
import pytest

from components.radar.detection import detection_probability
from components.radar.detection.detector_output import false_alarm_snr, measured_snr_given_detection
from components.radar.detection.threshold import detection_threshold

DRAWS = (np.arange(100_000) + 0.5) / 100_000
MODELS = [f"swerling{number}" for number in range(5)]


def pd(snr, pulses, pfa, model):
    settings = {"pulses": pulses, "false_alarm_probability": pfa, "model": model}
    return float(detection_probability(snr, **settings))


@pytest.mark.parametrize("pulses", [1, 2, 3, 40])
@pytest.mark.parametrize("model", MODELS)
def test_the_share_beyond_a_higher_threshold_is_the_pd_there_over_the_pd_here(model, pulses):
    """Against the exact series of the probability of detection, of every model."""
    here = float(detection_threshold(pulses, 1e-3))
    for snr in (1e-4, 0.05, 0.3, 2.0, 30.0):
        for pfa in (3e-4, 1e-5, 1e-8):
            share = pd(snr, pulses, pfa, model) / pd(snr, pulses, 1e-3, model)
            if share > 1.0 - 1e-9:
                continue
            found = measured_snr_given_detection(
                share, snr, threshold=here, pulses=pulses, model=model
            )
            there = float(detection_threshold(pulses, pfa))
            assert pulses * (found + 1.0) == pytest.approx(there, rel=2e-6), (snr, pfa)


@pytest.mark.parametrize("pulses", [1, 5])
@pytest.mark.parametrize("model", MODELS)
def test_echoes_far_above_the_threshold_come_out_as_they_are_drawn(model, pulses):
    """Amplitudes in noise, pulse by pulse: the two samples have one distribution."""
    from scipy.stats import ks_2samp

    draws, count, snr = np.random.default_rng(5), 4000, 200.0
    power = {
        "swerling0": np.full((count, 1), snr),
        "swerling1": snr * draws.exponential(size=(count, 1)),
        "swerling2": snr * draws.exponential(size=(count, pulses)),
        "swerling3": 0.5 * snr * draws.gamma(2.0, size=(count, 1)),
        "swerling4": 0.5 * snr * draws.gamma(2.0, size=(count, pulses)),
    }[model] * np.ones((1, pulses))
    noise = draws.normal(size=(2, count, pulses)) * np.sqrt(0.5)
    summed = ((np.sqrt(power) + noise[0]) ** 2 + noise[1] ** 2).sum(axis=1) / pulses - 1.0
    found = measured_snr_given_detection(
        draws.uniform(size=count), snr, threshold=0.0, pulses=pulses, model=model
    )
    assert ks_2samp(found, summed).pvalue > 1e-3


def test_very_strong_steady_echoes_are_normal_in_amplitude():
    """On both sides of where the form changes, the spread of the power is that of its theory."""
    for snr in (4.9e4, 5.1e4, 1e9):
        found = measured_snr_given_detection(DRAWS[2::5], snr, threshold=10.0, model="swerling0")
        assert found.mean() == pytest.approx(snr, rel=1e-4)
        assert found.std() == pytest.approx(np.sqrt(2.0 * snr + 1.0), rel=1e-3)


def test_noise_is_an_echo_of_no_strength():
    settings = {"false_alarm_probability": 1e-4, "pulses": 4}
    threshold = float(detection_threshold(4, 1e-4))
    for model in MODELS:
        np.testing.assert_array_equal(
            false_alarm_snr(DRAWS, **settings),
            measured_snr_given_detection(
                1.0 - DRAWS, 0.0, threshold=threshold, pulses=4, model=model
            ),
        )
    for wrong, said in (
        ({"snr": -1.0}, "snr is -1: it must be 0 or more"),
        ({"threshold": -1.0}, "threshold is -1: it must be 0 or more"),
        ({"tail": 1.5}, r"tail is 1.5: it must lie in \[0, 1\]"),
        ({"model": "steady"}, "steady"),
    ):
        values = {"tail": 0.5, "snr": 1.0, "threshold": 3.0, **wrong}
        with pytest.raises(ValueError, match=said):
            measured_snr_given_detection(**values)
