"""North turns about near a pole; what is level there is told by the plane that touches it."""

import numpy as np
import pytest

from components.geometry import rotate_to_meridian


@pytest.mark.parametrize("pole", [1.0, -1.0])
def test_near_a_pole_a_vector_stays_the_same_in_the_plane(pole):
    """Axes of the plane: to longitude 0 and to 90° east; north is towards the one pole."""
    rng = np.random.default_rng(4)
    lat, other_lat = pole * (90.0 - rng.uniform(1e-4, 1e-2, (2, 50)))
    lon, other_lon = rng.uniform(-180.0, 180.0, (2, 50))

    def in_plane(vectors, longitude_deg):
        x, y = np.cos(np.radians(longitude_deg)), np.sin(np.radians(longitude_deg))
        north, east, _ = vectors
        return np.stack([-pole * x * north - y * east, -pole * y * north + x * east])

    here = rng.standard_normal((3, 50))
    there = rotate_to_meridian(here, (lat, lon), (other_lat, other_lon))
    np.testing.assert_allclose(in_plane(there, other_lon), in_plane(here, lon), atol=1e-6)
    assert (there[2] == here[2]).all()


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 30.0])
def test_elsewhere_meridians_meet_by_the_sine_of_the_latitude(lat_deg):
    """Over the date line, too: 0.02° farther east north is 0.02° · sin(latitude) to the left."""
    north = np.array([[1.0], [0.0], [0.0]])
    east = rotate_to_meridian(north, ([lat_deg], [179.99]), ([lat_deg], [-179.99]))[1]
    assert east == pytest.approx(np.radians(0.02) * np.sin(np.radians(lat_deg)), abs=1e-9)
