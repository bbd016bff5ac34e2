"""When a sweeping beam looks at a target."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.radar.beam import illumination_offset_s

# The thesis's radar: 1 Hz over ±110°.
SWEEP = {"start_rad": math.radians(-110), "width_rad": math.radians(220), "scan_period_s": 1.0}


def test_a_one_hertz_scan_sees_each_azimuth_at_its_own_instant():
    azimuth = np.radians([-110.0, -55.0, 0.0, 55.0, 110.0])
    offsets = illumination_offset_s(azimuth, **SWEEP)
    np.testing.assert_allclose(offsets, [0.0, 0.25, 0.5, 0.75, 1.0], atol=1e-15)
    half = illumination_offset_s(azimuth, **SWEEP, sweep_fraction=0.5)
    np.testing.assert_allclose(half, offsets / 2, atol=1e-15)


def test_azimuth_is_taken_modulo_a_turn_and_outside_the_nearer_edge_counts():
    assert illumination_offset_s(2 * math.pi, **SWEEP) == pytest.approx(0.5)
    assert illumination_offset_s(math.radians(350), **SWEEP) == pytest.approx(100 / 220)
    assert illumination_offset_s(math.radians(115), **SWEEP) == pytest.approx(1.0)
    assert illumination_offset_s(math.radians(-115), **SWEEP) == 0.0
    across_south = {"start_rad": math.radians(170), "width_rad": math.radians(20)}
    assert illumination_offset_s(
        math.radians(-175), **across_south, scan_period_s=2.0
    ) == pytest.approx(1.5)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(azimuth=st.floats(-1.5, 1.5), rate=st.floats(-0.3, 0.3), period=st.floats(0.1, 5))
def test_a_moving_target_is_met_where_the_beam_is(azimuth, rate, period):
    sweep = {**SWEEP, "scan_period_s": period}
    offset = illumination_offset_s(azimuth, **sweep, azimuth_rate_rad_s=rate)
    beam = SWEEP["start_rad"] + SWEEP["width_rad"] * offset / period
    if offset < period:
        assert beam == pytest.approx(azimuth + rate * offset, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"width_rad": 0.0}, "width_rad is 0"),
        ({"width_rad": 7.0}, "width_rad is 7: .*2π"),
        ({"scan_period_s": -1.0}, "scan_period_s is -1"),
        ({"sweep_fraction": 1.2}, "sweep_fraction is 1.2"),
        (
            {"azimuth_rate_rad_s": 10.0},
            f"azimuth_rate_rad_s is 10: .*{math.radians(220):.6g} rad/s",
        ),
        ({"azimuth_rad": math.nan}, "azimuth_rad is nan"),
    ],
)
def test_bad_input_is_named(change, words):
    with pytest.raises(ValueError, match=words):
        illumination_offset_s(**{"azimuth_rad": 0.0, **SWEEP, **change})
