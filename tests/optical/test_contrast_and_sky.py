"""Daylight, luminance and contrast against integrals and known limits."""

import numpy as np
import pytest

from components.optical.contrast import contrast_gain, visibility_transmission
from components.optical.luminance import (
    SKIES,
    background_luminance,
    beam_illuminance,
    inherent_contrast,
    sky_illuminance,
    sky_luminance,
    target_luminance,
)

SUN = {"sun_azimuth_rad": 0.5, "sun_elevation_rad": 0.6}


def test_published_illuminances():
    # IES RP-21: clear, sun at 90 and 30 degrees; air masses 1 and 2.
    assert beam_illuminance(np.pi / 2) == pytest.approx(127_500 * np.exp(-0.21))
    assert beam_illuminance(np.pi / 6) == pytest.approx(127_500 * np.exp(-0.42))
    assert beam_illuminance(np.pi / 6, "partly_cloudy") == pytest.approx(127_500 * np.exp(-1.6))
    assert beam_illuminance(np.pi / 6, "overcast") == 0.0
    assert sky_illuminance(np.pi / 2) == pytest.approx(16_300)
    assert sky_illuminance(np.pi / 2, "partly_cloudy") == pytest.approx(45_300)
    assert sky_illuminance(np.pi / 6, "overcast") == pytest.approx(10_800)
    assert beam_illuminance(1e-320) == pytest.approx(0.0, abs=1e-80)


@pytest.mark.parametrize("sky", SKIES)
@pytest.mark.parametrize("sun_deg", [3.5, 37.5, 89.5])
def test_sky_luminance_adds_up_to_its_illuminance(sky, sun_deg):
    sun = np.radians(sun_deg)
    # With s = sin² elevation the weight cos·sin d(elevation) is ds/2: a midpoint sum over half the
    # sky, refined towards the horizon where the pattern is steep.
    edges = np.linspace(0.0, 1.0, 401) ** 2
    s = 0.5 * (edges[1:] + edges[:-1])
    azimuth = (np.arange(300) + 0.5) * np.pi / 300
    luminance = sky_luminance(azimuth[:, None], np.arcsin(np.sqrt(s)), 0.0, sun, sky)
    total = float((luminance * np.diff(edges)).sum()) * np.pi / 300
    assert total == pytest.approx(sky_illuminance(sun, sky), rel=3e-4)


def test_sky_is_brighter_round_the_sun_and_cie_ratios_hold():
    toward, away = sky_luminance([0.5, 0.5 + np.pi], 0.6, **SUN)
    assert toward > 5.0 * away
    # CIE overcast sky: the horizon has about a third of the zenith's luminance (1 : 2.99).
    zenith, horizon = sky_luminance(0.0, [np.pi / 2, 0.0], **SUN, sky="overcast")
    assert zenith / horizon == pytest.approx(1.0 + 4.0 * np.exp(-0.70), rel=1e-12)
    assert sky_luminance(0.0, -0.4, **SUN, sky="overcast") == horizon


def test_lambert_sphere_by_direct_integration():
    # Sum mu·mu0 over the disc of a sphere lit from an angle; overcast light is left out by
    # comparing two paints' beam parts through the sun's own share.
    grid = (np.arange(1500) + 0.5) / 750.0 - 1.0
    x, y = np.meshgrid(grid, grid)
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    disc = x * x + y * y < 1.0
    el = np.array([0.6, 0.6, 0.6])
    azimuth = np.array([0.5 + np.pi, 0.5 + np.pi / 2, 0.5])
    from_sun = np.arccos(
        np.sin(0.0) * np.sin(0.6) + np.cos(0.0) * np.cos(el) * np.cos(azimuth - 0.5)
    )
    lum = target_luminance(azimuth, 0.0, **SUN, paint_reflectance=1.0, ground_reflectance=0.2)
    beam = beam_illuminance(0.6)
    even = sky_illuminance(0.6) / np.pi
    ground = 0.2 * (beam * np.sin(0.6) + sky_illuminance(0.6)) / np.pi
    for value, chi in zip(lum, from_sun, strict=True):
        # Observer on +z; the sun stands pi - chi away from the observer as seen from the sphere.
        lit = np.maximum(x * np.sin(np.pi - chi) + z * np.cos(np.pi - chi), 0.0)
        expected = beam / np.pi * lit[disc].mean() + 0.5 * (even + ground)
        assert value == pytest.approx(expected, rel=2e-4)


def test_shaded_side_has_no_beam_and_black_paint_no_light():
    dark = target_luminance(0.5, 0.6, **SUN, paint_reflectance=1.0)
    lit = target_luminance(0.5 + np.pi, -0.6, **SUN, paint_reflectance=1.0)
    assert lit > 5.0 * dark > 0.0
    black = target_luminance(0.5, 0.6, **SUN, paint_reflectance=0.0)
    assert black == 0.0
    behind = background_luminance(0.5, [0.1, -0.1], **SUN)
    np.testing.assert_array_equal(inherent_contrast(black, behind), [1.0, 1.0])


def test_background_auto_is_sky_above_and_ground_below():
    el = np.array([-0.2, 0.0, 0.2])
    auto = background_luminance(1.0, el, **SUN)
    sky = background_luminance(1.0, el, **SUN, background="sky")
    ground = background_luminance(1.0, el, **SUN, background="ground")
    np.testing.assert_array_equal(auto, [ground[0], sky[1], sky[2]])
    assert ground[0] == ground[2]


def test_koschmieder_and_constant_gain():
    # 2 % of the contrast is left at the visibility (3.912 is ln 50 to four digits).
    assert visibility_transmission(10e3, 10e3) == pytest.approx(0.02, rel=1e-4)
    assert visibility_transmission([0.0, 1.7e308, 1e5], 5e-324)[0] == 1.0
    assert np.all(visibility_transmission([1.7e308, 1e5], 5e-324) == 0.0)
    assert visibility_transmission(5e-324, 1.7e308) == 1.0
    assert contrast_gain(contrast=0.7) == 0.7
    gain = contrast_gain(contrast=0.7, range_m=[0.0, 5e3], visibility_m=10e3)
    np.testing.assert_allclose(gain, [0.7, 0.7 * np.exp(-1.956)], rtol=1e-14)
    assert contrast_gain(azimuth_rad=np.zeros(3)).shape == (3,)


def test_daylight_gain_and_blinding():
    view = {"azimuth_rad": np.array([0.5, 2.0, 3.6]), "elevation_rad": 0.6, **SUN}
    gain = contrast_gain(model="daylight", **view, sun_exclusion_rad=0.1)
    target = target_luminance(**view)
    expected = inherent_contrast(target, background_luminance(**view))
    np.testing.assert_array_equal(gain, [0.0, *expected[1:]])
    assert np.all(gain[1:] > 0.0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"model": "guess"}, "model is 'guess'"),
        ({"sky": "purple"}, "sky is 'purple'.*clear"),
        ({"background": "sea"}, "background is 'sea'"),
        ({"sun_elevation_rad": -0.1}, "sun_elevation_rad is -0.1.*above 0"),
        ({"paint_reflectance": 1.2}, "paint_reflectance is 1.2"),
        ({"ground_reflectance": 0.0}, "ground_reflectance is 0"),
        ({"visibility_m": 0.0}, "visibility_m is 0"),
        ({"range_m": -5.0, "visibility_m": 1.0}, "range_m is -5"),
        ({"contrast": np.nan}, "contrast is nan"),
        ({"sun_exclusion_rad": -1.0}, "sun_exclusion_rad is -1"),
    ],
)
def test_bad_input_is_named(change, says):
    with pytest.raises(ValueError, match=says):
        contrast_gain(**{"model": "daylight", **change})
