"""Pixels covered, line-of-sight rate, confidence and detection range."""

from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import angle_between
from components.optical.signature import (
    MovingTargets,
    confidence,
    detection_range,
    line_of_sight_rate,
    pixels_covered,
    total_signature,
)

# Table 2.5: 6144 x 2048 pixels over 220 x 60 degrees.
PIXEL = {
    "pixel_azimuth_rad": np.radians(220.0) / 6144,
    "pixel_elevation_rad": np.radians(60.0) / 2048,
}
CAMERA = {**PIXEL, "sensor_pixels": 6144 * 2048}


def test_pixels_follow_the_square_of_range_up_to_the_sensor():
    distance = np.array([0.0, 1e-300, 1e-3, 1.0, 100.0, 2000.0, 4000.0, 1e200, 1.7e308])
    pixels = pixels_covered(42.0, distance, **CAMERA)
    assert np.all(pixels[:3] == 6144 * 2048)
    assert pixels[5] == pytest.approx(4.0 * pixels[6], rel=1e-14)
    footprint = 4000.0**2 * PIXEL["pixel_azimuth_rad"] * PIXEL["pixel_elevation_rad"]
    assert pixels[6] == pytest.approx(42.0 / footprint, rel=1e-14)
    assert np.all(np.diff(pixels) <= 0.0) and np.all(np.isfinite(pixels)) and pixels[-1] < 1e-100


def test_no_area_covers_no_pixel_even_at_range_zero():
    assert np.all(pixels_covered(0.0, [0.0, 1e-320, 10.0], **CAMERA) == 0.0)


directions = st.tuples(st.floats(-7.0, 7.0), st.floats(-np.pi / 2, np.pi / 2))


@settings(derandomize=True, deadline=None, max_examples=100)
@given(directions, directions, st.floats(-15.0, 0.0))
def test_angle_between_against_40_digits(first, step, exponent):
    # From half a turn down to 1e-15 rad apart.
    second = (first[0] + step[0] * 10**exponent, first[1] + 0.3 * step[1] * 10**exponent)
    with mpmath.workdps(40):
        vectors = []
        for p, q in (first, second):
            p, q = mpmath.mpf(p), mpmath.mpf(q)
            vectors.append(
                (mpmath.cos(q) * mpmath.cos(p), mpmath.cos(q) * mpmath.sin(p), mpmath.sin(q))
            )
        a, b = vectors
        cross = (
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        )
        expected = mpmath.atan2(
            mpmath.sqrt(sum(c * c for c in cross)), sum(x * y for x, y in zip(a, b, strict=True))
        )
    angle = angle_between(*first, *second)
    assert abs(angle - expected) <= 1e-15 + 1e-14 * expected
    assert angle == pytest.approx(angle_between(*second, *first), rel=1e-13, abs=1e-300)


def test_each_replica_s_targets_are_compared_with_their_own_look_before():
    """Windows of three replicas at once, against a dictionary of the last look of each target."""
    rng = np.random.default_rng(4)
    together, last, ticks_per_s = MovingTargets(1.0, "exact", 1000), {}, 1000
    scan = 1
    for scans_of_each in ([2, 1, 3], [1, 2, 2], [1, 1, 1]):
        replica = np.repeat(np.arange(3), scans_of_each)
        number = scan + np.concatenate([np.arange(n) for n in scans_of_each])
        scan += max(scans_of_each)
        tick = 50 * number + 7 * replica
        row, target = np.nonzero(rng.uniform(size=(len(replica), 4)) < 0.7)
        azimuth, elevation = rng.uniform(-3, 3, len(row)), rng.uniform(-1, 1, len(row))
        cells = SimpleNamespace(
            run_of_scan=replica, roster=range(4), row=row, target=target, scan_ticks=tick,
            azimuth_rad=azimuth, elevation_rad=elevation,
        )  # fmt: skip
        wanted = []
        for k, scanned in enumerate(replica):
            here = np.flatnonzero(row == k)
            now = {target[i]: (azimuth[i], elevation[i]) for i in here}
            before, before_tick = last.get(scanned, ({}, 0))
            for i in here:
                old = before.get(target[i])
                apart = 0.0 if old is None else angle_between(azimuth[i], elevation[i], *old)
                wanted.append(apart / (tick[k] - before_tick) * ticks_per_s)
            last[scanned] = (now, tick[k])
        np.testing.assert_allclose(together(cells), wanted, rtol=1e-12)


def test_a_signature_weighs_size_by_contrast_and_adds_speed():
    assert total_signature(10.0) == pytest.approx(3.0)
    assert total_signature(10.0, 0.5) == pytest.approx(3.0)
    weights = {"contrast_gain": 2.0, "static_weight": 0.5, "dynamic_weight": 3.0}
    found = total_signature([10.0, 1.0], [0.5, 0.1], **weights)
    assert found == pytest.approx([0.5 * 2.0 * 10.0 + 3.0 * 0.5, 1.0 + 0.3])
    assert confidence([3.0, 0.5]) == pytest.approx([2.0, -0.5])
    assert confidence(3.0, 2.5) == pytest.approx(0.5)


def test_detection_range_at_its_ends():
    assert detection_range(12.0, **PIXEL, dynamic_signature=1.0) == np.inf
    assert detection_range(12.0, **PIXEL, threshold=-1.0) == np.inf
    assert detection_range(0.0, **PIXEL) == 0.0
    assert detection_range(12.0, **PIXEL, contrast_gain=0.0) == 0.0
    # A sensor of 3 pixels can reach E = 0.9 at most: never detected, whatever the range.
    assert detection_range(12.0, **PIXEL, sensor_pixels=3) == 0.0
    assert detection_range(12.0, **PIXEL, sensor_pixels=4) == detection_range(12.0, **PIXEL)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: pixels_covered(1.0, -1.0, **CAMERA), "range_m is -1"),
        (lambda: pixels_covered([1.0, np.nan], 1.0, **CAMERA), "area_m2 is nan"),
        (lambda: pixels_covered(1.0, 1.0, **{**CAMERA, "sensor_pixels": 0}), "sensor_pixels is 0"),
        (lambda: detection_range(1.0, pixel_azimuth_rad=0.0, pixel_elevation_rad=1.0), "pixel_az"),
        (lambda: line_of_sight_rate(0.0, 0.0, 0.0, 0.0, 0.0), "interval_s is 0"),
        (lambda: line_of_sight_rate(0.0, 0.0, np.nan, 0.0, 1.0), "previous_azimuth_rad is nan"),
        (lambda: line_of_sight_rate(0.0, 0.0, 0.0, 0.0, 1.0, model="x"), "model is 'x'"),
        (lambda: total_signature(1.0, contrast_gain=-0.5), "contrast_gain is -0.5"),
        (lambda: confidence(np.nan), "signature is nan"),
    ],
)
def test_bad_input_is_named(call, says):
    with pytest.raises(ValueError, match=says):
        call()
