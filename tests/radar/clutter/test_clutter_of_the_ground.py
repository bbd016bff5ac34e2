"""Where the beam meets terrain, and how strong the ground's echo is there."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.radar.ground_clutter import (
    BEAM_REACH_BEAMWIDTHS,
    ground_clutter_rcs_m2,
    height_above_terrain_m,
)

BEAM = {
    "gamma_db": -15.0,
    "azimuth_beamwidth_rad": math.radians(5.0),
    "elevation_beamwidth_rad": math.radians(5.0),
    "range_resolution_m": 75.0,
}


def test_constant_gamma_reflectivity_of_a_low_patch():
    # At 5 km from 100 m up: σ0 = γ h/R, patch R θ · ΔR / cos ψ, and a beam that points at it.
    distance, height = 5000.0, 100.0
    sine = height / distance
    patch = distance * math.radians(5.0) * 75.0 / math.sqrt(1 - sine**2)
    rcs = ground_clutter_rcs_m2(distance, -math.asin(sine), height, **BEAM)
    assert rcs == pytest.approx(10**-1.5 * sine * patch, rel=1e-12)


def test_half_a_beamwidth_off_the_axis_the_ground_is_6_db_down():
    distance, height = 5000.0, 100.0
    axis = -math.asin(height / distance)
    full = ground_clutter_rcs_m2(distance, axis, height, **BEAM)
    half = ground_clutter_rcs_m2(distance, axis + math.radians(2.5), height, **BEAM)
    assert half == pytest.approx(full / 4, rel=1e-12)
    assert ground_clutter_rcs_m2(distance, axis + math.radians(10.1), height, **BEAM) == 0.0


def test_no_ground_nearer_than_the_height_and_a_beam_limited_patch_below():
    assert ground_clutter_rcs_m2(99.0, -math.pi / 2, 100.0, **BEAM) == 0.0
    assert ground_clutter_rcs_m2(0.0, 0.0, 100.0, **BEAM) == 0.0
    below = ground_clutter_rcs_m2(100.0, -math.pi / 2, 100.0, **BEAM)
    assert below == pytest.approx(10**-1.5 * (100 * math.radians(5.0)) ** 2, rel=1e-12)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    height=st.floats(10, 5000),
    lowest=st.floats(-0.6, 0.3),
    width=st.floats(0.01, 0.3),
    farthest=st.floats(100, 50_000),
)
def test_a_beam_that_misses_the_terrain_has_no_clutter(height, lowest, width, farthest):
    # The flattest line to the ground that the beam can reach lies below all of its positions.
    reached = lowest - BEAM_REACH_BEAMWIDTHS * width * (1.0 + 1e-12) - 1e-12
    meets = height <= farthest and reached <= -math.asin(height / farthest)
    elevation = np.linspace(lowest, 0.9, 40)[:, np.newaxis]
    ranges = np.linspace(0.0, farthest, 60)
    rcs = ground_clutter_rcs_m2(
        ranges, elevation, height, **{**BEAM, "elevation_beamwidth_rad": width}
    )
    assert np.all(rcs >= 0.0) and np.all(np.isfinite(rcs))
    if not meets:
        assert np.all(rcs == 0.0)


def test_terrain_above_the_ownship_is_refused():
    assert height_above_terrain_m(500.0, -20.0) == 520.0
    with pytest.raises(ValueError, match=r"terrain_alt_m is 800: .*below the ownship's.*500 m"):
        height_above_terrain_m([900.0, 500.0], [100.0, 800.0])
    with pytest.raises(ValueError, match="range_resolution_m is -75"):
        ground_clutter_rcs_m2(1.0, 0.0, 1.0, **{**BEAM, "range_resolution_m": -75.0})
