"""The ownship's believed position and attitude."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from components.navigation.errors import add_navigation_variances, displaced_lat_lon_alt


@settings(derandomize=True, deadline=None, max_examples=100)
@given(
    lat=st.floats(-89.99, 89.99),
    lon=st.floats(-180, 180),
    north=st.floats(-30, 30),
    east=st.floats(-30, 30),
    down=st.floats(-30, 30),
)
def test_position_is_displaced_as_pymap3d_says(lat, lon, north, east, down):
    ours = displaced_lat_lon_alt(lat, lon, 1000.0, north, east, down)
    truth = pymap3d.ned2geodetic(north, east, down, lat, lon, 1000.0)
    apart = pymap3d.geodetic2ned(*ours, *truth)
    # The tangent plane lies e²/2R above the ellipsoid, 0.14 mm for 42 m.
    # Sideways, the vertical drop is taken into account by the tangent plane and not by us.
    assert np.hypot(*apart[:2]) < np.hypot(north, east) * abs(down) / 6.3e6 + 2e-6
    assert abs(apart[2]) < 1.5e-4


def test_position_across_the_pole():
    lat, lon, alt = displaced_lat_lon_alt(90 - 1e-4, 20.0, 0.0, 30.0, 0.0, 0.0)
    assert lon % 360 == pytest.approx(200.0)
    assert 90 - lat == pytest.approx(30.0 / 111_694 - 1e-4, abs=1e-9)
    assert alt == 0.0
    at_pole = displaced_lat_lon_alt(90.0, 0.0, 0.0, 0.0, 30.0, 0.0)
    assert at_pole[:2] == pytest.approx((90 - 30.0 / 111_694, 90.0), abs=1e-9)


@dataclass(frozen=True)
class Reports:
    """Directions and ranges with their variances, and the poses they were measured from."""

    azimuth_rad: Any
    elevation_rad: Any
    range_m: Any
    pose: Any
    azimuth_variance_rad2: Any = 1e-6
    elevation_variance_rad2: Any = 4e-6
    range_variance_m2: Any = 9.0

    @property
    def target(self):
        return self.azimuth_rad

    def pose_columns(self):
        names = ("heading", "pitch", "roll")
        return {f"own_{name}_rad": one for name, one in zip(names, self.pose, strict=True)}


def seen(from_ned, pose):
    """Azimuth, elevation and range in body axes, (3, n), by SciPy's rotations."""
    body = Rotation.from_euler("ZYX", pose.T).apply(from_ned, inverse=True)
    range_m = np.linalg.norm(body, axis=1)
    return np.arctan2(body[:, 1], body[:, 0]), np.arcsin(-body[:, 2] / range_m), range_m


@pytest.mark.parametrize(
    ("position_m", "attitude_rad"),
    [((5.0, 11.0, 23.0), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.02, 0.03, 0.05)),
     ((5.0, 11.0, 23.0), (0.02, 0.03, 0.05))],
)  # fmt: skip
def test_a_report_errs_by_what_it_moves_if_the_pose_is_another(position_m, attitude_rad):
    """Each part by the difference of what is seen from poses a millionth of it apart."""
    draw = np.random.default_rng(12)
    pose = draw.uniform([[0.0], [-0.6], [-1.2]], [[6.3], [0.6], [1.2]], (3, 40))
    away = draw.normal(0.0, 900.0, (40, 3))
    azimuth, elevation, range_m = seen(away, pose)
    # Along a tenth of them no range is measured.
    range_m[:4] = np.nan
    found = add_navigation_variances(
        Reports(azimuth, elevation, range_m, pose), position_m, attitude_rad
    )
    tiny, expected = 1e-6, np.array([[1e-6], [4e-6], [9.0]]) + np.zeros((3, 40))
    for k in range(3):
        moved, turned = np.zeros(3), np.zeros((3, 1))
        moved[k], turned[k] = tiny, tiny
        here = np.array(seen(away, pose))
        shifted = (np.array(seen(away + moved, pose)) - here) / tiny
        shifted[:2, :4] = 0.0  # how far a place shifts a direction is not known without a range
        expected += (position_m[k] * shifted) ** 2
        expected += (attitude_rad[k] * (np.array(seen(away, pose + turned)) - here) / tiny) ** 2
    expected[2, :4] = found.range_variance_m2[:4]
    names = "azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2"
    for name, wanted in zip(names, expected, strict=True):
        np.testing.assert_allclose(getattr(found, name), wanted, rtol=1e-4)


def test_without_error_every_bit_stays():
    rng = np.random.Generator(np.random.PCG64(8))
    truth = (rng.uniform(-90, 90, 99), rng.uniform(-720, 720, 99), rng.uniform(-100, 1e4, 99))
    for true, believed in zip(truth, displaced_lat_lon_alt(*truth, 0.0, 0.0, 0.0), strict=True):
        np.testing.assert_array_equal(true, believed)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: displaced_lat_lon_alt(91.0, 0.0, 0.0, 0.0, 0.0, 0.0), "lat_deg is 91"),
        (lambda: displaced_lat_lon_alt(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0), "lat_deg is nan"),
        (lambda: displaced_lat_lon_alt(0.0, 0.0, 0.0, 0.0, math.inf, 0.0), "east_m is inf"),
        (
            lambda: displaced_lat_lon_alt(0.0, 0.0, 0.0, 0.0, 1e6, 0.0),
            "position error is 1000000.0",
        ),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()


@pytest.mark.parametrize("down_m", [1500.0, -1500.0])
def test_a_displacement_is_as_long_at_the_height_it_leads_to(down_m):
    """Against the tangent plane: metres to the north and east span fewer degrees farther up."""
    pymap3d = pytest.importorskip("pymap3d")
    here = (-41.3, -179.9, 2400.0)
    north_m, east_m = 900.0, -1100.0
    lat, lon, alt = displaced_lat_lon_alt(*here, north_m, east_m, down_m)
    east, north, up = pymap3d.geodetic2enu(float(lat), float(lon), float(alt), *here)
    assert (east, north) == pytest.approx((east_m, north_m), abs=0.05)
    assert up == pytest.approx(-down_m, abs=0.2)
