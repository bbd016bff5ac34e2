"""Fields of view: narrow, wide, across ±180 degrees, full circle, bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import FieldOfView

GOOD = {"azimuth_rad": (-1.0, 1.0), "elevation_rad": (-0.5, 0.5)}


def seen(p_deg, low_deg, high_deg):
    """Whether an azimuth is seen; whole turns are taken off in degrees, which is exact."""
    field = FieldOfView(tuple(np.radians([low_deg, high_deg])), tuple(np.radians([-30, 30])))
    p_deg = np.asarray(p_deg, dtype=float)
    p_deg = p_deg - 360.0 * np.ceil((p_deg - 180.0) / 360.0)
    return field.holds(np.radians(p_deg), np.zeros(p_deg.shape))


# field (deg), azimuths inside, azimuths outside
FIELDS = [
    ((-10, 10), [-10, 0, 10, 350, 360, -370], [-10.001, 10.001, 180, -180]),
    ((-110, 110), [-110, -109, 0, 110, 250], [-110.001, 111, 180, -180, 249]),  # Table 2.5, 220°
    ((170, 190), [170, 180, -180, 190, -170, -175], [169.99, -169.99, 0, 90]),
    ((170, -170), [170, 180, -180, 190, -170, -175], [169.99, -169.99, 0, 90]),
    ((-190, -170), [170, 180, -180, -170, 175], [169.99, -169.99, 0]),
    ((-180, 180), [-180, 180, 0, 179.999, -0.1], []),
    ((0, 360), [-180, 180, 0, 360, -1e-15, 359], []),
    ((-180, -90), [180, -180, -90, -135], [-89.99, 0, 179.99]),
    ((90, 180), [90, 180, -180], [-179.99, 89.99]),
    ((350, 10), [350, 0, 10, -10, -5, 370], [10.01, -10.01, 180]),
    ((10, 350), [10, 180, -180, -10, 350], [0, 9.99, -9.99]),
    ((340, 339), [340, 339, 0, -21, -20, 180], [339.5, -20.5]),
    ((45, 45), [45, 405], [45.001, 44.999]),
]


@pytest.mark.parametrize(("field", "within", "outside"), FIELDS)
def test_fields(field, within, outside):
    for azimuth in within:
        assert seen(azimuth, *field), azimuth
    for azimuth in outside:
        assert not seen(azimuth, *field), azimuth


def test_bounds_without_a_turn_are_exact():
    low, high = np.radians(-50.0), np.radians(50.0)
    field = FieldOfView((low, high), (-0.5, 0.5))
    assert field.holds(np.array([low, high]), np.array([-0.5, 0.5])).all()
    azimuth = np.array([np.nextafter(low, -1), np.nextafter(high, 1), 0.0, 0.0])
    elevation = np.array([0.0, 0.0, np.nextafter(0.5, 1), np.nextafter(-0.5, -1)])
    assert not field.holds(azimuth, elevation).any()


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.integers(-1440, 1440), st.integers(-360, 360), st.integers(0, 360))
def test_against_arithmetic_in_whole_degrees(azimuth, low, width):
    high = low + width
    if high > 360:
        low, high = low - 360, high - 360
    expected = (azimuth - low) % 360 <= width
    assert seen(azimuth, low, high) == expected


def test_shapes():
    assert seen([[0.0], [60.0]], -10, 10).tolist() == [[True], [False]]
    assert seen([[0.0], [60.0]], -180, 180).shape == (2, 1)
    assert seen([], -10, 10).shape == (0,)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("azimuth_min_rad", -7.0),
        ("azimuth_max_rad", np.nan),
        ("azimuth_max_rad", 7.0),
        ("elevation_min_rad", -2.0),
        ("elevation_max_rad", 1.6),
        ("elevation_min_rad", 0.6),
    ],
)
def test_bad_bounds_are_named(name, value):
    angle, end, _ = name.split("_")
    bounds = list(GOOD[f"{angle}_rad"])
    bounds[end == "max"] = value
    with pytest.raises(ValueError, match=f"^{name} is {value}: it must"):
        FieldOfView(**(GOOD | {f"{angle}_rad": tuple(bounds)}))


def test_a_sector_of_more_than_a_turn_is_named():
    with pytest.raises(ValueError, match=r"azimuth_min_rad is 6\.2: it must be at most one turn"):
        FieldOfView((6.2, -1.0), (-0.5, 0.5))
