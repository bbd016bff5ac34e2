"""Rotations, body angles, aspect: against rotation matrices at 40 digits and by hand."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry import (
    aspect_angles,
    body_angles,
    body_angles_of_sight_line,
    body_to_ned,
    line_of_sight_in_target_axes,
    ned_to_body,
    relative_attitude,
    unit_vector,
)

fast = settings(derandomize=True, deadline=None, max_examples=100)
angle = st.floats(-np.pi, np.pi)
component = st.floats(-1e3, 1e3)
DEG = np.pi / 180


def matrix(yaw, pitch, roll):
    """NED to body, the product of three elementary rotations, 40 digits."""
    c, s = mpmath.cos, mpmath.sin
    rz = mpmath.matrix([[c(yaw), s(yaw), 0], [-s(yaw), c(yaw), 0], [0, 0, 1]])
    ry = mpmath.matrix([[c(pitch), 0, -s(pitch)], [0, 1, 0], [s(pitch), 0, c(pitch)]])
    rx = mpmath.matrix([[1, 0, 0], [0, c(roll), s(roll)], [0, -s(roll), c(roll)]])
    return rx * ry * rz


@fast
@given(component, component, component, angle, angle, angle)
def test_rotation_against_matrices(n, e, d, yaw, pitch, roll):
    with mpmath.workdps(40):
        exact = matrix(*map(mpmath.mpf, (yaw, pitch, roll))) * mpmath.matrix([n, e, d])
        got = mpmath.matrix([float(v) for v in ned_to_body(n, e, d, yaw, pitch, roll)])
        length = mpmath.norm(mpmath.matrix([n, e, d]))
        assert mpmath.norm(got - exact) <= 1e-15 * length + 1e-300
        assert abs(mpmath.norm(got) - length) <= 1e-15 * length + 1e-300


@fast
@given(component, component, component, angle, angle, angle)
def test_round_trip(n, e, d, yaw, pitch, roll):
    back = body_to_ned(*ned_to_body(n, e, d, yaw, pitch, roll), yaw, pitch, roll)
    scale = np.hypot(np.hypot(n, e), d)
    assert np.linalg.norm(np.array(back) - (n, e, d)) <= 1e-15 * scale + 1e-300


# attitude (yaw, pitch, roll) deg, vector in NED -> body: what a pilot would say
POINTING = [
    ((90, 0, 0), (0, 1, 0), (1, 0, 0)),  # heading east, target east: ahead
    ((0, 0, 0), (0, 1, 0), (0, 1, 0)),  # heading north, target east: right wing
    ((0, 90, 0), (0, 0, -1), (1, 0, 0)),  # nose straight up, target above: ahead
    ((0, 90, 0), (1, 0, 0), (0, 0, 1)),  # nose straight up, target north: under the belly
    ((0, 0, 90), (0, 0, 1), (0, 1, 0)),  # right wing down, target below: right wing
    ((0, 0, 90), (0, 1, 0), (0, 0, -1)),  # right wing down, target east: above the canopy
    ((180, 0, 180), (0, 0, 1), (0, 0, -1)),  # inverted, target below: above the canopy
]


@pytest.mark.parametrize(("attitude", "ned", "body"), POINTING)
def test_signs(attitude, ned, body):
    attitude = [a * DEG for a in attitude]
    np.testing.assert_allclose(ned_to_body(*ned, *attitude), body, atol=2e-16)
    np.testing.assert_allclose(body_to_ned(*body, *attitude), ned, atol=2e-16)


@fast
@given(angle, st.floats(-np.pi / 2, np.pi / 2))
def test_unit_vector_and_body_angles_undo_each_other(azimuth, elevation):
    vector = unit_vector(azimuth, elevation)
    assert abs(np.linalg.norm(vector) - 1) <= 4e-16
    p, q = body_angles(*vector)
    assert -np.pi < p <= np.pi
    assert abs(q - elevation) <= 4e-16
    back = unit_vector(p, q)
    assert np.linalg.norm(np.array(back) - vector) <= 1e-15


def test_straight_up_and_down():
    for z, q in ((-2.0, np.pi / 2), (2.0, -np.pi / 2)):
        for x, y in ((0.0, 0.0), (-0.0, 0.0), (-0.0, -0.0), (1e-17, -1e-17)):
            assert body_angles(x, y, z) == (0.0, q)
    assert body_angles(0.0, 0.0, 0.0) == (0.0, 0.0)
    assert body_angles(-1.0, -0.0, 0.0) == (np.pi, 0.0)
    assert body_angles_of_sight_line(1.0, np.pi / 2, 2.0, 0.0, 0.0) == (0.0, np.pi / 2)
    assert body_angles_of_sight_line(3.0, -np.pi / 2, 2.0, 0.0, 0.0) == (0.0, -np.pi / 2)


@fast
@given(st.floats(0, 6.28), st.floats(-1.5, 1.5), angle)
def test_with_the_wings_level_both_models_agree(azimuth, elevation, yaw):
    exact = unit_vector(*body_angles_of_sight_line(azimuth, elevation, yaw, 0.0, 0.0))
    small = unit_vector(
        *body_angles_of_sight_line(azimuth, elevation, yaw, 0.0, 0.0, model="small_angle")
    )
    assert np.linalg.norm(np.array(exact) - small) <= 2e-15


@fast
@given(angle, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_dead_ahead_small_angle_is_exact_in_pitch(yaw, elevation, pitch):
    # also past straight up: the direction comes down behind
    exact = unit_vector(*body_angles_of_sight_line(yaw, elevation, yaw, pitch, 0.0))
    small = unit_vector(
        *body_angles_of_sight_line(yaw, elevation, yaw, pitch, 0.0, model="small_angle")
    )
    assert np.linalg.norm(np.array(exact) - small) <= 2e-15


def test_small_angle_errs_abeam_and_astern():
    pitch = 5 * DEG
    assert body_angles_of_sight_line(np.pi / 2, 0, 0, pitch, 0)[1] == pytest.approx(0, abs=1e-16)
    assert body_angles_of_sight_line(np.pi / 2, 0, 0, pitch, 0, model="small_angle")[1] == -pitch
    assert body_angles_of_sight_line(np.pi, 0, 0, pitch, 0)[1] == pytest.approx(pitch, rel=1e-14)
    assert body_angles_of_sight_line(np.pi, 0, 0, pitch, 0, model="small_angle")[1] == -pitch


@fast
@given(st.floats(-10, 10), angle, st.floats(-10, 10), angle, angle)
def test_sensor_angles_are_valid_for_any_attitude(azimuth, elevation, yaw, pitch, roll):
    for model in ("exact", "small_angle"):
        p, q = body_angles_of_sight_line(azimuth, elevation, yaw, pitch, roll, model=model)
        assert -np.pi < p <= np.pi
        assert -np.pi / 2 <= q <= np.pi / 2


def test_unknown_model_is_named():
    with pytest.raises(ValueError, match="model is 'small': it must be 'exact' or 'small_angle'"):
        body_angles_of_sight_line(0, 0, 0, 0, 0, model="small")


def test_relative_attitude_is_equation_six_with_absolute_angles():
    psi, theta, phi = relative_attitude(350 * DEG, 0.1, 10 * DEG, 0.02, -0.3)
    assert psi == pytest.approx(20 * DEG, abs=1e-15)
    assert (theta, phi) == (0.1 - 0.02, 0.1 + 0.3)


# bearing and elevation of the line of sight, target attitude (deg) -> aspect azimuth, elevation
ASPECTS = [
    ((0, 0), (180, 0, 0), (0, 0)),  # flies straight at us: nose-on
    ((0, 0), (0, 0, 0), (180, 0)),  # flies away: tail
    ((0, 0), (90, 0, 0), (90, 0)),  # it is north of us heading east: we are off its right wing
    ((0, 0), (270, 0, 0), (-90, 0)),  # heading west: left wing
    ((0, 30), (180, 0, 0), (0, -30)),  # above us, coming on level: we see its belly
    ((0, -30), (180, 0, 0), (0, 30)),  # below us: its upper side
    ((0, 5), (180, -5, 0), (0, 0)),  # descends 5 degrees straight at us: still nose-on
    ((40, 0), (130, 0, 30), (90, 30)),  # off its right wing, which is 30 degrees down
]


@pytest.mark.parametrize(("line", "attitude", "aspect"), ASPECTS)
def test_aspect(line, attitude, aspect):
    got = aspect_angles(*(a * DEG for a in line), *(a * DEG for a in attitude))
    direction = unit_vector(*got)
    np.testing.assert_allclose(direction, unit_vector(*(a * DEG for a in aspect)), atol=4e-16)
    u = line_of_sight_in_target_axes(*(a * DEG for a in line), *(a * DEG for a in attitude))
    np.testing.assert_allclose(u, -np.array(direction), atol=4e-16)


def test_bits_do_not_depend_on_shape():
    rng = np.random.default_rng(1)
    cells = rng.uniform(-np.pi, np.pi, (5, 5000))
    for function in (
        body_angles_of_sight_line,
        aspect_angles,
        line_of_sight_in_target_axes,
        relative_attitude,
    ):
        whole = function(*cells)
        grid = function(*(c.reshape(100, 50).T for c in cells))
        for w, g in zip(whole, grid, strict=True):
            assert np.array_equal(w.reshape(100, 50).T, g)
        for i in range(0, 5000, 499):
            alone = function(*cells[:, i])
            seven = function(*cells[:, i : i + 7])
            assert all(w[i] == a for w, a in zip(whole, alone, strict=True))
            assert all(np.array_equal(w[i : i + 7], s) for w, s in zip(whole, seven, strict=True))


def test_broadcasting():
    p, q = body_angles_of_sight_line([[0.1], [0.2]], 0.0, 0.0, [0.0, 0.1, 0.2], 0.0)
    assert p.shape == q.shape == (2, 3)
    p, q = body_angles_of_sight_line(
        [[0.1], [0.2]], 0.0, 0.0, [0.0, 0.1, 2.2], [0.0], model="small_angle"
    )
    assert p.shape == q.shape == (2, 3)
    assert all(v.shape == (2,) for v in ned_to_body(1.0, 0.0, 0.0, 0.0, 0.0, [0.0, 1.0]))


def test_bad_attitude_is_named():
    with pytest.raises(ValueError, match=r"^pitch_rad is nan \(element 1\): it must be finite"):
        ned_to_body(1, 0, 0, 0, [0, np.nan], 0)
    with pytest.raises(
        ValueError, match=r"shapes do not broadcast together: x \(3,\), y \(2,\), z"
    ):
        body_angles([1, 2, 3], [1, 2], 0)


@fast
# Differences of two angles must stay within the 1e150 that is accepted.
@given(*[st.floats(min_value=-4e149, max_value=4e149)] * 6)
def test_any_finite_input_is_silent(a, b, c, yaw, pitch, roll):
    with np.errstate(all="raise"):
        body_angles(*ned_to_body(a, b, c, yaw, pitch, roll))
        body_angles_of_sight_line(a, b, yaw, pitch, roll)
        body_angles_of_sight_line(a, b, yaw, pitch, roll, model="small_angle")
        relative_attitude(a, b, yaw, pitch, roll)
