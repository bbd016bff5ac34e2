"""What a radar knows of the strength of what it reports, target or noise."""

import numpy as np
import pytest

from components.radar.detection import detection_probability
from components.radar.false_alarms import false_alarm_snr, measured_snr
from components.radar.threshold import detection_threshold

DRAWS = (np.arange(100_000) + 0.5) / 100_000


@pytest.mark.parametrize("pulses", [1, 6])
@pytest.mark.parametrize("snr", [0.0, 0.3, 20.0])
def test_it_is_the_tail_beyond_the_threshold(pulses, snr):
    """Swerling 2: the share beyond a higher threshold is the Pd there over the Pd here."""
    found = measured_snr(DRAWS, snr, false_alarm_probability=1e-3, pulses=pulses)
    assert found.min() >= detection_threshold(pulses, 1e-3) / pulses - 1.0 - 1e-9

    def pd(pfa):
        return float(
            detection_probability(
                snr, pulses=pulses, false_alarm_probability=pfa, model="swerling2"
            )
        )

    for pfa in (3e-4, 1e-5):
        share = np.mean(found >= detection_threshold(pulses, pfa) / pulses - 1.0)
        assert share == pytest.approx(pd(pfa) / pd(1e-3), abs=2e-5)


def test_noise_is_an_echo_of_no_strength():
    settings = {"false_alarm_probability": 1e-4, "pulses": 4}
    np.testing.assert_array_equal(
        false_alarm_snr(DRAWS, **settings), measured_snr(DRAWS, 0.0, **settings)
    )
    with pytest.raises(ValueError, match="snr is -1: it must be 0 or more"):
        measured_snr(0.5, -1.0, **settings)
