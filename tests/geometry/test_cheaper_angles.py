"""The cheaper ways to an angle against high precision, and against the ways that they replace."""

import mpmath
import numpy as np
import pytest

from components.geometry import (
    body_angles_of_offsets,
    body_angles_of_sight_line,
    direction_angle,
    sine_and_cosine,
    slope_angle,
)

MP = mpmath.MPContext()
MP.dps = 40


def offsets(count, seed):
    draw = np.random.default_rng(seed)
    size = 10.0 ** draw.uniform(-9, 6, (2, count))
    return draw.choice([-1.0, 1.0], (2, count)) * size


def test_slopes_are_right_to_two_last_places():
    rise, run = offsets(2000, 1)
    run = np.abs(run)
    got = slope_angle(rise, run)
    for angle, up, along in zip(got.tolist(), rise.tolist(), run.tolist(), strict=True):
        assert abs(MP.atan2(up, along) - angle) <= 2.0 * np.spacing(abs(angle)), (up, along)


def test_directions_are_right_in_all_quadrants():
    across, along = offsets(2000, 2)
    for angle, y, x in zip(
        direction_angle(across, along).tolist(), across.tolist(), along.tolist(), strict=True
    ):
        assert abs(MP.atan2(y, x) - angle) <= 9e-16, (y, x)  # two units of the last place


def test_straight_up_and_nowhere():
    up = np.array([5.0, -5.0, 0.0, 1e-150])
    nothing = np.zeros(4)
    assert slope_angle(up, nothing).tolist() == [np.pi / 2, -np.pi / 2, 0.0, np.pi / 2]
    assert direction_angle(up, nothing).tolist() == [np.pi / 2, -np.pi / 2, 0.0, np.pi / 2]
    assert direction_angle(up, -nothing).tolist() == [np.pi / 2, -np.pi / 2, 0.0, np.pi / 2]
    assert direction_angle(np.array([0.0, -0.0]), np.array([-1.0, -1.0])).tolist() == [
        np.pi,
        -np.pi,
    ]
    level = np.zeros(3)
    p, q = body_angles_of_offsets(level, level, np.array([5.0, -5.0, 0.0]), level, level, level)
    assert p.tolist() == [0.0, 0.0, 0.0]
    assert q.tolist() == [np.pi / 2, -np.pi / 2, 0.0]


@pytest.mark.parametrize("count", [1, 7, 64, 65, 1000])
def test_many_equal_angles_give_the_bits_of_one(count):
    sine, cosine = sine_and_cosine(np.full(count, 0.3))
    one, other = sine_and_cosine(np.array([0.3]))
    assert (np.broadcast_to(sine, count) == one).all()
    assert (np.broadcast_to(cosine, count) == other).all()
    mixed = np.full(count, 0.3)
    mixed[-1] = 0.4
    assert sine_and_cosine(mixed)[0][-1] == np.sin(0.4)


@pytest.mark.parametrize("level", [True, False])
def test_offsets_give_the_angles_that_directions_give(level):
    draw = np.random.default_rng(3)
    north, east = offsets(3000, 4)
    up = offsets(3000, 5)[0]
    yaw = draw.uniform(0.0, 2.0 * np.pi, 3000)
    pitch, roll = (np.zeros(3000) if level else draw.uniform(-1.5, 1.5, 3000) for _ in range(2))
    azimuth = np.arctan2(east, north)
    elevation = np.arctan2(up, np.hypot(north, east))
    expected = body_angles_of_sight_line(azimuth, elevation, yaw, pitch, roll)
    got = body_angles_of_offsets(north, east, up, yaw, pitch, roll)

    def vector(p, q):
        return np.array([np.cos(q) * np.cos(p), np.cos(q) * np.sin(p), np.sin(q)])

    np.testing.assert_allclose(vector(*got), vector(*expected), atol=2e-15, rtol=0.0)
    # A row at a time says the same to the bit.
    for row in (0, 17, 2999):
        one = slice(row, row + 1)
        alone = body_angles_of_offsets(
            north[one], east[one], up[one], yaw[one], pitch[one], roll[one]
        )
        assert [alone[0][0], alone[1][0]] == [got[0][row], got[1][row]]
