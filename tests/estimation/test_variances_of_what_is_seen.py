"""Variances of directions and ranges against numerical derivatives, in axes that lean anyhow."""

import numpy as np
import pytest

from components.estimation.frame import pose_in_frame
from components.estimation.measurement import (
    Kind,
    azimuth_elevation_and_variances,
    cone_half_angle_rad,
    expected_measurement,
    relative_range_deviation,
)
from components.geometry.attitude import body_angles, body_to_ned, unit_vector
from components.geometry.sensor_axes import rotate_variances
from components.surveillance.believed_line import (
    OwnBelief,
    line_of_sight_variances,
    ned_to_azimuth_elevation_range,
)


def spread_of(function, at, covariance):
    """Return the variances of a function's values, by its central differences."""
    steps = 1e-6 * np.maximum(np.sqrt(np.diag(covariance)), 1e-6)
    ends = [(function(at + step), function(at - step)) for step in np.diag(steps)]
    slope = np.array([np.angle(np.exp(1j * (a - b))) for a, b in ends]).T / (2.0 * steps)
    return np.diag(slope @ covariance @ slope.T)


@pytest.fixture(params=range(25))
def random(request):
    return np.random.default_rng(request.param)


def drawn_covariance(random, size_m):
    root = random.normal(0.0, size_m, (3, 3))
    return root @ root.T


def test_of_a_mounting_s_axes_in_those_of_the_body(random):
    mounting = tuple(random.uniform(-1.5, 1.5, 3))
    angles, variances = random.uniform(-1.4, 1.4, 2), random.uniform(1e-6, 1e-4, 2)
    found = rotate_variances(*angles[:, np.newaxis], *variances[:, np.newaxis], mounting)

    def in_the_body(seen):
        return np.array(body_angles(*body_to_ned(*unit_vector(*seen), *mounting)))

    wanted = spread_of(in_the_body, angles, np.diag(variances))
    assert np.concatenate(found) == pytest.approx(wanted, rel=1e-5)


def test_of_a_position_that_a_banked_ownship_is_told(random):
    attitude = random.uniform((0.0, -0.5, -1.0), (6.28, 0.5, 1.0))
    own = OwnBelief(*np.array([[-33.9], [18.4], [900.0]]), *attitude[:, np.newaxis])
    ned, (across, along, down) = random.normal(0.0, 3000.0, 3), random.uniform(10.0, 1e4, 3)
    variances = [np.array([value]) for value in (across, along, down)]
    found = line_of_sight_variances(own, ned[:, np.newaxis], tuple(variances))
    cos, sin = ned[:2] / np.hypot(*ned[:2])
    turn = np.array([[-sin, cos, 0.0], [cos, sin, 0.0], [0.0, 0.0, 1.0]])
    covariance = turn.T @ np.diag([across, along, down]) @ turn

    def seen(offset):
        return np.concatenate(ned_to_azimuth_elevation_range(own, offset[:, np.newaxis]))

    assert np.concatenate([*found.values()]) == pytest.approx(
        spread_of(seen, ned, covariance), rel=1e-4
    )


def test_of_a_track_s_direction_and_the_cone_that_holds_it(random):
    covariance = drawn_covariance(random, 40.0)
    at = random.normal(0.0, 2000.0, 3)
    place = pose_in_frame(
        np.array([[-33.9], [18.4], [900.0]]), np.array([[-33.88], [18.43], [1400.0]]),
        random.uniform(-1.0, 1.0, (3, 1)),
    )  # fmt: skip
    away = at - place.position_m[:, 0]
    column, whole = away[:, np.newaxis], covariance[:, :, np.newaxis]
    *_, azimuth, elevation = azimuth_elevation_and_variances(column, whole)
    in_the_frame = pose_in_frame(*[np.zeros((3, 1))] * 3)

    def angles(offset):
        return expected_measurement(Kind(has_range=False), offset[:, np.newaxis], in_the_frame)[
            :, 0
        ]

    wanted = spread_of(angles, away, covariance)
    assert [float(azimuth[0]), float(elevation[0])] == pytest.approx(wanted, rel=1e-4)
    distance = np.linalg.norm(away)
    along = away / distance
    assert relative_range_deviation(column, whole)[0] == pytest.approx(
        np.sqrt(along @ covariance @ along) / distance
    )
    # Across the line of sight, whichever way the axes lean.
    flat = np.eye(3) - np.outer(along, along)
    widest = np.linalg.eigvalsh(flat @ covariance @ flat)[-1]
    found = cone_half_angle_rad(at[:, np.newaxis], whole, place, 2.5)[0]
    assert found == pytest.approx(2.5 * np.sqrt(widest) / distance, rel=1e-6)
