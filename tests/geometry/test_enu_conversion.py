"""East-north-up offsets against pymap3d and back again."""

import numpy as np
import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry.ellipsoid import enu_to_geodetic, line_of_sight, line_of_sight_ned

offset = st.floats(-200e3, 200e3)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(offset, offset, st.floats(-500, 20e3), st.floats(-90, 90), st.floats(-180, 180))
def test_offsets_survive_the_round_trip(east, north, up, lat0, lon0):
    reference = {"reference_lat_deg": lat0, "reference_lon_deg": lon0, "reference_alt_m": 300.0}
    place = enu_to_geodetic(east, north, up, **reference)
    n, e, d = line_of_sight_ned(lat0, lon0, 300.0, *place)
    # Longitude beyond 90 degrees resolves 3e-9 m at the equator.
    assert np.abs(np.subtract((e, n, -d), (east, north, up))).max() < 4e-9


@pytest.mark.parametrize("lat0, lon0", [(45, -75), (90, 10), (-90, 0), (0, 180), (-33, 179.9999)])
def test_agrees_with_pymap3d(lat0, lon0):
    east, north, up = np.random.default_rng(3).uniform(-1e5, 1e5, (3, 50))
    up *= 0.02  # pymap3d's own latitude is off by 1e-6 m at 100 km of altitude
    ours = enu_to_geodetic(
        east, north, up, reference_lat_deg=lat0, reference_lon_deg=lon0, reference_alt_m=500.0
    )
    theirs = pymap3d.enu2geodetic(east, north, up, lat0, lon0, 500.0)
    assert line_of_sight(*ours, *theirs)[2].max() < 1e-8


def test_flat_offset_rises_with_the_curvature():
    """10 km along the tangent plane is d²/2R = 7.85 m above the ellipsoid."""
    alt = enu_to_geodetic(0, 10e3, 0, reference_lat_deg=45, reference_lon_deg=0, reference_alt_m=0)[
        2
    ]
    assert alt == pytest.approx(10e3**2 / (2 * 6367382.0), abs=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 6e6])
def test_bad_offset_is_named(bad):
    with pytest.raises(ValueError, match="north_m is"):
        enu_to_geodetic(0, bad, 0, reference_lat_deg=45, reference_lon_deg=0, reference_alt_m=0)
