"""When a sweeping beam looks at a target."""

import math

import numpy as np
import pytest

from components.radar.beam import illumination_offset_s

# The thesis's radar: 1 Hz over ±110°.
SWEEP = {"start_rad": math.radians(-110), "width_rad": math.radians(220), "scan_period_s": 1.0}


def test_a_one_hertz_scan_sees_each_azimuth_at_its_own_instant():
    azimuth = np.radians([-110.0, -55.0, 0.0, 55.0, 110.0])
    offsets = illumination_offset_s(azimuth, **SWEEP)
    np.testing.assert_allclose(offsets, [0.0, 0.25, 0.5, 0.75, 1.0], atol=1e-15)


def test_azimuth_is_taken_modulo_a_turn_and_outside_the_nearer_edge_counts():
    assert illumination_offset_s(2 * math.pi, **SWEEP) == pytest.approx(0.5)
    assert illumination_offset_s(math.radians(350), **SWEEP) == pytest.approx(100 / 220)
    assert illumination_offset_s(math.radians(115), **SWEEP) == pytest.approx(1.0)
    assert illumination_offset_s(math.radians(-115), **SWEEP) == 0.0
    across_south = {"start_rad": math.radians(170), "width_rad": math.radians(20)}
    assert illumination_offset_s(
        math.radians(-175), **across_south, scan_period_s=2.0
    ) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"width_rad": 0.0}, "width_rad is 0"),
        ({"width_rad": 7.0}, "width_rad is 7: .*2π"),
        ({"scan_period_s": -1.0}, "scan_period_s is -1"),
        ({"azimuth_rad": math.nan}, "azimuth_rad is nan"),
    ],
)
def test_bad_input_is_named(change, words):
    with pytest.raises(ValueError, match=words):
        illumination_offset_s(**{"azimuth_rad": 0.0, **SWEEP, **change})
