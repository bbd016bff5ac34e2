"""Hard cases of geometry, row by row, each with its source."""

import math

import mpmath
import numpy as np
import pytest

from components.geometry import FieldOfView, ellipsoid
from components.geometry.angles import longitude_difference_deg
from components.geometry.attitude import body_angles, relative_attitude
from components.geometry.earth_models import EARTH_MODELS, LineOfSight
from components.geometry.sensor_axes import body_angles_of_sight_line

DEG = math.pi / 180


def ned_40_digits(lat1, lon1, alt1, lat2, lon2, alt2):
    """WGS-84 NED offsets from ECEF coordinates at 40 digits; call within workdps(40)."""
    f = 1 / mpmath.mpf("298.257223563")
    e2 = f * (2 - f)

    def ecef(lat, lon, alt):
        lat, lon = mpmath.radians(mpmath.mpf(lat)), mpmath.radians(mpmath.mpf(lon))
        n = 6378137 / mpmath.sqrt(1 - e2 * mpmath.sin(lat) ** 2)
        level = (n + alt) * mpmath.cos(lat)
        return mpmath.matrix(
            [level * mpmath.cos(lon), level * mpmath.sin(lon), (n - n * e2 + alt) * mpmath.sin(lat)]
        )

    offset = ecef(lat2, lon2, mpmath.mpf(alt2)) - ecef(lat1, lon1, mpmath.mpf(alt1))
    lat, lon = mpmath.radians(mpmath.mpf(lat1)), mpmath.radians(mpmath.mpf(lon1))
    sp, cp, sl, cl = mpmath.sin(lat), mpmath.cos(lat), mpmath.sin(lon), mpmath.cos(lon)
    return (
        mpmath.matrix([[-sp * cl, -sp * sl, cp], [-sl, cl, 0], [-cp * cl, -cp * sl, -sp]]) * offset
    )


# what, source, own lat lon alt, target lat lon alt
LINES = [
    ("1 mm north", "issue: 1 mm to 20,000 km", (51, 4, 100), (51 + 9e-9, 4, 100)),
    ("1 mm east at 89 N", "issue: 1 mm, poles", (89, 4, 100), (89, 4 + 5e-7, 100)),
    ("1 mm up", "issue: 1 mm", (51, 4, 40_000), (51, 4, 40_000.001)),
    ("from the north pole", "issue: poles", (90, 30, 0), (89.99, 75, 10)),
    ("to the south pole", "issue: poles", (-89.999999, -60, -400), (-90, 11, 40_000)),
    ("1 m across the pole", "issue: across the pole", (90 - 4.5e-6, 0, 0), (90 - 4.5e-6, 180, 0)),
    ("across the pole, far", "issue: across the pole", (70, 20, 0), (80, -160, 12_000)),
    ("antimeridian", "issue: antimeridian", (10, 179.9999, 500), (10.0001, -179.9999, 510)),
    ("359.9 against -0.1", "issue: 359.9; errata 1", (45, 359.9, 0), (45.001, -0.1, 0)),
    ("540 against -180", "issue: 540", (45, 540, 0), (45.001, -180, 0)),
    ("540 against 179.9", "issue: 540, two-sum", (45, 540, 0), (45, 179.9, 0)),
    ("antipodes", "issue: antipodes", (33, 44, 0), (-33, 224, 0)),
    ("nearly antipodes", "issue: antipodes", (33, 44, 0), (-33 + 1e-9, -136 + 1e-9, 40_000)),
    ("pole to pole", "issue: antipodes, poles", (90, 0, 0), (-90, 123, 0)),
    ("below sea level", "issue: -400 m … 40 km", (31.5, 35.5, -400), (31.6, 35.4, 40_000)),
    ("a quarter of the Earth", "issue: 20,000 km", (0, 0, 0), (0, 90, 0)),
]


@pytest.mark.parametrize(("what", "source", "own", "target"), LINES, ids=[x[0] for x in LINES])
def test_line_of_sight(what, source, own, target):
    azimuth, elevation, slant_range = map(float, ellipsoid.line_of_sight(*own, *target))
    with mpmath.workdps(40):
        truth = ned_40_digits(*map(float, own), *map(float, target))
        level = slant_range * mpmath.cos(elevation)
        got = mpmath.matrix(
            [
                level * mpmath.cos(azimuth),
                level * mpmath.sin(azimuth),
                -slant_range * mpmath.sin(elevation),
            ]
        )
        allowed = mpmath.mpf("1e-12") + mpmath.mpf("1e-13") * mpmath.norm(truth)
        assert mpmath.norm(got - truth) <= allowed
        # and what the difference form reaches in fact
        assert mpmath.norm(got - truth) <= mpmath.mpf("1e-15") + 5e-15 * mpmath.norm(truth)
    assert 0.0 <= azimuth < 2 * math.pi


# rung, what, source, own, target, azimuth, elevation, range exactly
EXACT = [
    ("ellipsoid", "same point", "issue: same point", (52, 4, 9), (52, 4, 9), (0, 0, 0)),
    ("ellipsoid", "same point at the pole", "issue", (90, 4, 9), (90, -77, 9), (0, 0, 0)),
    ("ellipsoid", "same point, 540", "issue", (52, 180, 9), (52, 540, 9), (0, 0, 0)),
    ("ellipsoid", "same point, -0", "issue", (-0.0, -0.0, 0), (0.0, 360, -0.0), (0, 0, 0)),
    ("ellipsoid", "overhead", "design", (52, 4, 0), (52, -356, 7), (0, math.pi / 2, 7)),
    ("ellipsoid", "below, at the pole", "issue", (-90, 4, 7), (-90, 0, 0), (0, -math.pi / 2, 7)),
    ("flat_earth", "same point", "issue", (52, 4, 9), (52, 364, 9), (0, 0, 0)),
    ("flat_earth", "asin(h/R) with R = h", "errata 3", (52, 4, 0), (52, 4, 1), (0, math.pi / 2, 1)),
    ("flat_earth", "east, not north", "errata 1", (0, 0, 0), (0, 1, 0), (math.pi / 2, 0, 111195)),
    ("flat_earth", "north", "errata 1", (60, 0, 0), (61, 0, 0), (0, 0, 111195)),
    ("flat_earth", "across 180", "errata 1", (0, 180, 0), (0, -179, 0), (math.pi / 2, 0, 111195)),
    ("local_radii", "same point", "issue", (52, 4, 9), (52, 364, 9), (0, 0, 0)),
    ("geodesic", "same point", "issue", (52, 4, 9), (52, 364, 9), (0, 0, 0)),
    ("geodesic", "overhead", "issue", (52, 4, 0), (52, 4, 50), (0, math.pi / 2, 50)),
]


@pytest.mark.parametrize(("rung", "what", "source", "own", "target", "expected"), EXACT)
def test_exact_results(rung, what, source, own, target, expected):
    with np.errstate(all="raise"):
        assert LineOfSight(rung).in_ned(*own, *target) == expected


# argument, its value, the six arguments
BAD = [
    ("own_lat_deg", "91.0", (91, 0, 0, 0, 0, 0)),  # issue, "It is done when" 4
    ("lat_deg", "-90.00000000000001", (0, 0, 0, -90.00000000000001, 0, 0)),
    ("lat_deg", "nan", (0, 0, 0, math.nan, 0, 0)),
    ("own_lon_deg", "nan", (0, math.nan, 0, 0, 0, 0)),
    ("lon_deg", "inf", (0, 0, 0, 0, math.inf, 0)),
    ("own_alt_m", "nan", (0, 0, math.nan, 0, 0, 0)),
    ("alt_m", "-inf", (0, 0, 0, 0, 0, -math.inf)),
    ("lat_deg", "91.0 (element 2)", (0, 0, 0, [0, 1, 91, 92], 0, 0)),
    ("lat_deg", "'x'", (0, 0, 0, "x", 0, 0)),
]


@pytest.mark.parametrize("rung", EARTH_MODELS)
@pytest.mark.parametrize(("argument", "value", "arguments"), BAD)
def test_bad_positions(rung, argument, value, arguments):
    with pytest.raises(ValueError) as caught:
        LineOfSight(rung).in_ned(*arguments)
    assert str(caught.value).startswith(f"{argument} is {value}: it must")


# lon1, lon2, exact rounded difference, source
DIFFERENCES = [
    (359.9, -0.1, 2.2737367544323206e-14, "issue: 359.9 (the double is not 359.9 exactly)"),
    (-180.0, 180.0, 0.0, "issue: antimeridian"),
    (0.0, 180.0, -180.0, "interval [-180, 180)"),
    (540.0, 180.0, 0.0, "issue: 540"),
    (0.1, 540.0, 179.9, "GeographicLib's AngDiff; naive remainder gives 179.89999999999998"),
]


@pytest.mark.parametrize(("lon1", "lon2", "expected", "source"), DIFFERENCES)
def test_longitude_differences(lon1, lon2, expected, source):
    difference, error = longitude_difference_deg(lon1, lon2)
    assert difference == pytest.approx(expected, rel=1e-3 if expected < 1e-10 else 1e-15, abs=0)
    assert abs(error) <= 1.5e-14


# azimuth, elevation, yaw, pitch, roll (deg) -> p, q (deg); source
SENSOR = [
    ((10, 0, 350, 0, 0), (20, 0), "errata 2: wrapped p"),
    ((190, 0, 10, 0, 0), (180, 0), "errata 2: into (-pi, pi]"),
    ((0, 0, 0, 5, 0), (0, -5), "errata 4: dead ahead pitch is subtracted"),
    ((180, 0, 0, 5, 0), (180, 5), "errata 4: astern it is added"),
    ((90, 0, 0, 5, 0), (90, 0), "errata 4: abeam it does nothing"),
    ((90, 0, 0, 0, 30), (90, 30), "errata 4: ownship roll matters"),
    ((0, 90, 123, 0, 0), (0, 90), "issue: straight up"),
    ((77, -90, 123, 0, 0), (0, -90), "issue: straight down"),
    ((33, 0, 33, -90, 0), (0, 90), "issue: straight up in body axes"),
]


@pytest.mark.parametrize(("angles", "expected", "source"), SENSOR)
def test_sensor_angles(angles, expected, source):
    got = body_angles_of_sight_line(*(a * DEG for a in angles))
    np.testing.assert_allclose(np.degrees(got), expected, rtol=0, atol=1e-13)


def test_zenith_has_no_domain_error():
    # errata 3: asin(h/R) loses half the digits near 90 degrees
    p, q = body_angles(1e-9, 0.0, -1.0)
    assert p == 0.0
    assert math.pi / 2 - q == pytest.approx(1e-9, rel=1e-6)
    assert math.asin(1.0 / math.hypot(1e-9, 1.0)) == math.pi / 2


def test_aspect_does_not_depend_on_our_own_heading():
    # errata 4: eq. 6 as printed takes p and q, which contain the ownship's attitude
    psi, _, _ = relative_attitude(350 * DEG, 0.0, 350 * DEG, 0.0, 0.0)
    assert psi == 0.0  # it flies away from us


def test_afrl_field_of_view_is_220_degrees():
    # errata 23b: 220 degrees (±110), wider than a half turn
    p = np.array([-111, -110, -90, 0, 110, 111, 180]) * DEG
    field = FieldOfView((-110 * DEG, 110 * DEG), (-30 * DEG, 30 * DEG))
    got = field.holds(p, np.zeros(len(p)))
    assert got.tolist() == [False, True, True, True, True, False, False]
