"""Tracks from directions alone: derivatives by differences, and ranges that are not made up."""

import numpy as np
import pytest

from components.estimation.frame import SensorPose
from components.estimation.kalman import innovation, update
from components.estimation.measurement import Kind, expected_measurement, linearise, residual
from components.estimation.modified_polar import apply_correction_in_polar
from components.estimation.motion import ConstantVelocity, predict
from components.tracking.association import is_arc_bent

RNG = np.random.default_rng(6)


def polar(state, sensor):
    """Modified polar coordinates in the frame: azimuth, elevation, 1/r, velocity by range."""
    away, velocity = state[:3] - sensor, state[3:6]
    distance = np.linalg.norm(away)
    azimuth, elevation = np.arctan2(away[1], away[0]), np.arcsin(away[2] / distance)
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    axes = np.array([[ce * ca, ce * sa, se], [-sa, ca, 0.0], [-se * ca, -se * sa, ce]])
    return np.array([azimuth, elevation, 1.0 / distance, *(axes @ velocity / distance)])


def derivative(state, sensor):
    step = np.array([1e-2] * 3 + [1e-3] * 3)
    return np.stack(
        [(polar(state + h * e, sensor) - polar(state - h * e, sensor)) / (2.0 * h)
         for h, e in zip(step, np.eye(6), strict=True)], axis=1,
    )  # fmt: skip


def test_a_covariance_goes_into_polar_coordinates_before_and_comes_back_after():
    """With small corrections any two polar coordinates agree."""
    sensor = np.array([[30.0], [-20.0], [5.0]])
    root = RNG.normal(size=(6, 6))
    covariance = root @ root.T
    for line in ([800.0, 300.0, -200.0], [-50.0, 400.0, 350.0], [100.0, -200.0, 500.0]):
        before = np.concatenate([np.array(line), [40.0, -35.0, 3.0]])[:, None]
        before[:3] += sensor
        after = before + RNG.normal(size=(6, 1)) * 1e-4
        state, found = apply_correction_in_polar(before, after, covariance[:, :, None], sensor)
        np.testing.assert_allclose(state, after, atol=1e-6)
        one, other = derivative(before[:, 0], sensor[:, 0]), derivative(state[:, 0], sensor[:, 0])
        step = np.linalg.solve(other, one)
        np.testing.assert_allclose(found[:, :, 0], step @ covariance @ step.T, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("axes", [(0, 1), (2, 0), (1, 2)])
def test_a_direction_that_turns_turns_the_uncertainty_with_it(axes):
    """Half a degree across a line of sight 5 km long: a Cartesian one would stay behind."""
    first, second = axes  # straight ahead, straight down, to the right
    angle, identity = np.radians(0.5), np.eye(3)
    before, after = np.zeros((6, 1)), np.zeros((6, 1))
    before[first] = after[first] = 5000.0
    after[second] = 5000.0 * angle
    spread = np.eye(6)[:, :, None].copy()
    spread[first, first] = 2000.0**2
    state, found = apply_correction_in_polar(before, after, spread, np.zeros((3, 1)))
    line = np.cos(angle) * identity[first] + np.sin(angle) * identity[second]
    np.testing.assert_allclose(state[:3, 0], 5000.0 * line, atol=1e-9)
    assert np.isclose(line @ found[:3, :3, 0] @ line, 2000.0**2, rtol=1e-6)
    across = np.cos(angle) * identity[second] - np.sin(angle) * identity[first]
    assert np.isclose(across @ found[:3, :3, 0] @ across, 1.0, rtol=1e-3)


def test_ranges_are_not_made_up_from_directions():
    """Ownship straight, then across: errors of 1/r are what is said; a Cartesian one is lost."""
    count, hz, kind, model = 300, 5, Kind(False), ConstantVelocity(1e-4)
    deviation = np.full((2, count), np.radians(0.05))
    inverse = 1.0 / 5000.0 * (1.0 + 0.45 * np.clip(RNG.normal(size=count), -1.9, 1.9))
    around = RNG.uniform(0.0, 2.0 * np.pi, count)
    truth = np.stack([np.cos(around) / inverse, np.sin(around) / inverse, np.full(count, -100.0),
                      *RNG.normal(size=(3, count)) * np.array([[50.0], [50.0], [5]])])  # fmt: skip
    own, axes = np.zeros((3, count)), np.repeat(np.eye(3)[:, :, None], count, axis=2)
    found = {}
    for way in ("polar", "cartesian"):
        rng, target, own = np.random.default_rng(3), truth, np.zeros((3, count))
        for k in range(30 * hz + 1):
            place = SensorPose(own, axes)
            seen = (
                expected_measurement(kind, target, place) + rng.normal(size=(2, count)) * deviation
            )
            if k == 0:
                line = np.stack([np.cos(seen[1]) * np.cos(seen[0]),
                                 np.cos(seen[1]) * np.sin(seen[0]), -np.sin(seen[1])])  # fmt: skip
                along = line[:, None] * line[None]
                spread = np.zeros((6, 6, count))
                cross = np.eye(3)[:, :, None] - along
                spread[:3, :3] = 2250.0**2 * along + (5000.0 * deviation[0]) ** 2 * cross
                for i in range(3, 6):
                    spread[i, i] = 50.0**2
                state = np.concatenate([5000.0 * line, np.zeros((3, count))])
            else:
                state, spread = predict(model, state, spread, np.full(count, 1.0 / hz))
                known = innovation(*linearise(kind, state, place), spread, deviation**2)
                new = update(state, spread, known, residual(seen, known.expected))
                state, spread = (
                    new if way == "cartesian" else apply_correction_in_polar(state, *new, own)
                )
            if k == 30 * hz:
                break
            target = model.move(target, np.full(count, 1.0 / hz))
            course = np.array([60.0, 0.0, 0.0] if k < 15 * hz else [0.0, 60.0, 0.0])
            own = own + course[:, None] / hz
        away, aim = state[:3] - place.position_m, target[:3] - own
        distance = np.linalg.norm(away, axis=0)
        line = away / distance
        variance = np.einsum("in,ijn,jn->n", line, spread[:3, :3], line) / distance**4
        error = 1.0 / np.linalg.norm(aim, axis=0) - 1.0 / distance
        found[way] = float(np.mean(error**2 / variance))
    assert 0.6 < found["polar"] < 1.5
    assert found["cartesian"] > 10.0


@pytest.mark.parametrize("bearing_deg", [0.0, 37.0, 200.0])
def test_a_track_is_bent_where_its_arc_leaves_the_line_by_a_third_of_its_depth(bearing_deg):
    """At two deviations across, the sagitta of the arc is 2 s²/r: 0.3 of 20 m along at 122.5 m."""
    across_m = np.array([30.0, 122.0, 123.0, 900.0])
    way = np.radians(bearing_deg)
    along, across = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    state, spread = np.zeros((6, 4)), np.zeros((6, 6, 4))
    state[:3] = np.array([100.0, -50.0, 7.0])[:, None]
    state[:2] += 5000.0 * along[:, None]
    spread[:2, :2] = (20.0**2 * np.outer(along, along))[:, :, None]
    spread[:2, :2] += across_m**2 * np.outer(across, across)[:, :, None]
    place = SensorPose(
        np.array([100.0, -50.0, 7.0])[:, None] + np.zeros((3, 4)), np.zeros((3, 3, 4))
    )

    class Tracks:
        def __len__(self):
            return 4

        def states_by_model(self):
            return [state]

        def covariances_by_model(self):
            return [spread]

    assert is_arc_bent(Tracks(), place).tolist() == [False, False, True, True]
