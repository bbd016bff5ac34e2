"""Places and velocities that are told of earlier instants: tracks of flights by the filter's model.

Flights are drawn exactly as the filter's model has them, and told with errors that are as stated:
whatever the noise, the ages and the errors, the mean normalised error squared is 6. Flights without
any noise have less: how much less is worked out by a recursion for each axis by itself.
"""

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from components.estimation.carried_errors import (
    CLIMB,
    EAST,
    HEIGHT,
    NORTH,
    SPEED_EAST,
    SPEED_NORTH,
    Ages,
    MotionWithErrors,
    ReportedErrors,
)
from components.estimation.estimator import Estimates, ExtendedKalmanFilter, pair_measurement
from components.estimation.frame import pose_in_frame
from components.estimation.kalman import linear_moments, update
from components.estimation.measurement import Kind
from components.estimation.motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn
from components.estimation.unscented import SigmaPoints, UnscentedKalmanFilter

KIND = Kind(True, False, True)
WAYS = (NORTH, EAST, HEIGHT, SPEED_NORTH, SPEED_EAST, CLIMB)
LASTS_S = (300.0, 300.0, np.inf, 300.0, 300.0, 0.0)
# As ADS-B of NACp 10 and NACv 3 tells.
DEVIATION = np.array([4.1, 4.1, 26.0, 0.41, 0.41, 0.87])
WHITE_M2, COUNT, LOOKS = 1e-4, 500, 20


@cache
def ages_of(look):
    return np.random.default_rng(100 + look).uniform(0.0, 0.5, 2)


def pose():
    """Banked on the southern hemisphere."""
    ones = np.ones(COUNT)
    return pose_in_frame(
        (-41.3 * ones, 173.2 * ones, 2400.0 * ones), (-41.29 * ones, 173.2 * ones, 2400.0 * ones),
        (np.radians(217.0) * ones, 0.07 * ones, -0.35 * ones),
    )  # fmt: skip


def flown_on(rng, state, intensity, for_s):
    """Return states after a time, exactly as white acceleration moves them."""
    moved, gained = state.copy(), np.sqrt(intensity * for_s) * rng.normal(size=(3, COUNT))
    apart = np.sqrt(intensity * for_s**3 / 12.0) * rng.normal(size=(3, COUNT))
    moved[:3] += for_s * state[3:] + 0.5 * for_s * gained + apart
    moved[3:] += gained
    return moved


def nees_of(estimator, intensity, flown, seed=5):
    """Return the NEES at every look, (looks, tracks)."""
    rng, place = np.random.default_rng(seed), pose()
    estimator = estimator.carrying(LASTS_S)
    lasts = np.array(LASTS_S)[:, np.newaxis]
    kept = np.exp(-1.0 / np.maximum(lasts, 1e-9))
    errors = rng.normal(size=(6, COUNT))
    true = np.zeros((6, COUNT))
    true[:3] = np.array([[90_000.0], [-50_000.0], [-3000.0]])
    true[3:] = 40.0 * rng.normal(size=(3, COUNT))
    tracks, found, now_s = None, [], 0.0
    plain = ReportedErrors((), np.zeros((0, COUNT)), np.zeros(COUNT), np.zeros(COUNT, dtype=bool))
    for look in range(LOOKS):
        end_s = look + 1.0
        ages, seen = ages_of(look), {}
        for when, what in sorted(
            [(end_s - ages[0], "place"), (end_s - ages[1], "velocity"), (end_s, "now")]
        ):
            true, now_s = flown_on(rng, true, flown, when - now_s), when
            seen[what] = true
        errors = kept * errors + np.sqrt(1.0 - kept**2) * rng.normal(size=errors.shape)
        off = DEVIATION[:, np.newaxis] * errors * np.array([[1], [1], [-1], [1], [1], [-1]])
        white = np.sqrt(WHITE_M2) * rng.normal(size=(6, COUNT))
        said = np.concatenate([seen["place"][:3], seen["velocity"][3:]]) + off + white
        said[:3] += ages[0] * (said[3:] - white[3:])
        told = ReportedErrors(
            WAYS, np.repeat(DEVIATION[:, np.newaxis], COUNT, axis=1), np.full(COUNT, ages[0]),
            np.zeros(COUNT, dtype=bool),
        )  # fmt: skip
        age = Ages(*(np.full(COUNT, one) for one in (*ages, 1.0 if look else 0.0, 0.0)))
        model = estimator.models[0]
        if tracks is None:
            tracks = begun(said, told, age, model, place)
        else:
            tracks = estimator.predict(tracks, np.ones(COUNT))
            foreseen = estimator.expect(KIND, tracks, place, told)
            foreseen = [
                age.add_age_errors(foreseen[0], model, tracks.states[0], tracks.covariances[0])
            ]
            measured = plain.expected_measurement(KIND, said, place)
            away = np.linalg.norm(said[:3] - place.position_m, axis=0)
            level = away * np.cos(measured[1])
            variance = WHITE_M2 * np.stack(
                [1 / level**2, 1 / away**2, *np.ones((4, COUNT))]
            )  # fmt: skip
            every = np.arange(COUNT)
            pairs = pair_measurement(foreseen, every, measured, variance, None, tracks.weights)
            tracks = estimator.update(tracks, every, pairs, every)
        state, covariance = tracks.states[0][:6], tracks.covariances[0][:6, :6]
        error = (state - true).T[..., np.newaxis]
        found.append(
            (error * np.linalg.solve(covariance.transpose(2, 0, 1), error)).sum(axis=(1, 2))
        )
    return np.array(found)


def begun(said, told, age, model, place):
    state, covariance = np.zeros((12, COUNT)), np.zeros((12, 12, COUNT))
    state[:6] = said
    effects = told.effects_on_reported_states(said, place)
    new = age.error_covariances(model, state, np.ones((3, COUNT)))[0]
    for i in range(6):
        new[i, i] += WHITE_M2
        covariance[6 + i, 6 + i] = 1.0
    covariance[:6, :6] = new + np.einsum("ikn,jkn->ijn", effects, effects)
    covariance[:6, 6:], covariance[6:, :6] = -effects, -effects.swapaxes(0, 1)
    return Estimates([state], [covariance], np.ones((1, COUNT)))


def inside(nees):
    """Return at which looks the mean lies within the 99.9 % bounds of independent tracks."""
    low, high = chi2.ppf([0.0005, 0.9995], 6 * COUNT) / COUNT
    mean = nees.mean(axis=1)
    return (low < mean) & (mean < high)


@pytest.mark.parametrize("intensity_m2_s3", [1.2e-5, 0.1, 4.0])
def test_tracks_of_flights_by_the_model_are_as_wrong_as_they_say(intensity_m2_s3):
    """Ages taken for errors of their own: up to 6.8 at a noise of 0.1, 6.5 to 8.3 at 4."""
    estimator = ExtendedKalmanFilter(ConstantVelocity(intensity_m2_s3))
    assert inside(nees_of(estimator, intensity_m2_s3, intensity_m2_s3)).all()


def test_so_are_those_of_sigma_points():
    estimator = UnscentedKalmanFilter(ConstantVelocity(0.1), SigmaPoints(0.1))
    assert inside(nees_of(estimator, 0.1, 0.1)).all()


def test_flights_without_noise_have_as_much_less_as_a_recursion_says():
    estimator = ExtendedKalmanFilter(ConstantVelocity(1.2e-5))
    found = nees_of(estimator, 1.2e-5, 0.0).mean(axis=1)
    level = [straight(*DEVIATION[[0, 3]], 0.0, 1.2e-5)]
    expected = 2.0 * level[0] + straight(DEVIATION[2], 0.0, DEVIATION[5], 1.2e-5)
    assert 4.9 < expected[-1] < 5.3
    np.testing.assert_allclose(found[4:], expected[4:], atol=4.0 * np.sqrt(12.0 / COUNT))


def straight(place_m, speed_m_s, climb_m_s, intensity):
    """Return E[NEES] of one axis of a flight without noise: of the filter's own gains.

    The state is place, velocity, and what lasts of the errors of both; ages are errors of their own
    here, which at so little noise is the same.
    """
    kept = np.exp(-1.0 / 300.0) if speed_m_s else 1.0
    step = np.diag([1.0, 1.0, kept, kept])
    step[0, 1] = 1.0
    believed = true = None
    found = []
    for look in range(LOOKS):
        age = ages_of(look)[0]
        slope = np.array([[1.0, 0.0, place_m, age * speed_m_s], [0.0, 1.0, 0.0, speed_m_s]])
        rough = WHITE_M2 * np.eye(2) + climb_m_s**2 * np.array([[age**2, age], [age, 1.0]])
        drift = np.diag([0.0, 0.0, 1.0 - kept**2, 1.0 - kept**2])
        if believed is None:
            effect = slope[:, 2:]
            believed = np.block([[effect @ effect.T + rough, -effect], [-effect.T, np.eye(2)]])
            true = believed
        else:
            noise = drift.copy()
            noise[:2, :2] = intensity * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
            believed = step @ believed @ step.T + noise
            true = step @ true @ step.T + drift
            gain = np.linalg.solve(slope @ believed @ slope.T + rough, slope @ believed).T
            left = np.eye(4) - gain @ slope
            believed, true = (
                left @ one @ left.T + gain @ rough @ gain.T for one in (believed, true)
            )
        found.append(np.trace(np.linalg.solve(believed[:2, :2], true[:2, :2])))
    return np.array(found)


@pytest.mark.parametrize("model", [ConstantVelocity(4.0), ConstantAcceleration(4.0)])
def test_what_a_target_did_since_is_in_what_is_told_of_earlier_by_how_old_it_is(model):
    """A position carried on for 0.4 s of its 0.9, by a velocity 1.3 s old; updated 0.7 s ago.

    By integrals over the white acceleration or jerk of so long ago, in steps: to a thousandth.
    """
    carried_s, late_s, velocity_age_s, since_s = 0.4, 0.5, 1.3, 0.7
    ages = Ages(*(np.array([one]) for one in (carried_s, velocity_age_s, since_s, late_s)))
    still, many = np.zeros((model.size, 1)), model.size // 3
    error, shared = ages.error_covariances(model, still, np.array([[0.0], [0.0], [9.0]]))
    ago_s = (np.arange(20_000) + 0.5) * 1e-4  # for how long it has acted
    # Back from now it is taken for what always was: what was told of then lacks it.
    position = np.maximum(carried_s + late_s - ago_s, 0.0)
    velocity = -1.0 * (ago_s < velocity_age_s)
    known = np.stack([ago_s, np.ones_like(ago_s)])
    if many == 3:
        position, velocity = -0.5 * position**2, np.maximum(velocity_age_s - ago_s, 0.0)
        known = np.stack([0.5 * ago_s**2, ago_s, np.ones_like(ago_s)])
    told = np.stack([position + carried_s * velocity, velocity])
    # Of the track's own errors: what was new since, by which a prediction falls short.
    known = known * (ago_s < since_s)
    for found, one in ((error, told), (shared, known)):
        wanted = 4.0 * 1e-4 * one @ told.T
        for axis in (0, 1, 2):
            rows = [axis + 3 * i for i in range(len(one))]
            both = found[rows][:, [axis, axis + 3], 0]
            if found is error:  # by how late it is times twice the velocity's deviation
                both = both - np.diag([4.0 * late_s**2 * (9.0 if axis == 2 else 0.0), 0.0])
            np.testing.assert_allclose(both, wanted, atol=3e-3)


def test_what_is_told_of_a_turn_is_expected_as_it_was():
    """A circle's chord and tangent of then, carried on; and the slope by finite differences."""
    count, speed, rate = 1, 90.0, np.radians(5.0)
    model = MotionWithErrors(CoordinatedTurn(0.1, 1e-8), (300.0,))
    ages = Ages(*(np.full(count, one) for one in (0.6, 0.9, 1.0, 0.3)))
    place, kind = pose().take(np.arange(count)), KIND
    state = np.array([4000.0, 3000.0, -2600.0, speed, 0.0, -3.0, 0.2, rate])[:, np.newaxis]
    covariance = np.diag([100.0] * 3 + [4.0] * 3 + [1.0, 1e-4])[:, :, np.newaxis]
    told = ReportedErrors((NORTH,), np.full((1, count), 3.0), ages.position, np.zeros(count, bool))

    def expected(state):
        moments = linear_moments(*told.linearise(kind, state, place), covariance)
        return ages._correct_for_past_velocity(moments, model, state, covariance)

    then, tangent = -rate * 0.9, -rate * 0.9
    radius = speed / rate
    was = state[:6, 0].copy()
    was[:3] += [radius * np.sin(then), radius * (1.0 - np.cos(then)), 3.0 * 0.9]
    was[3:] = [speed * np.cos(tangent), speed * np.sin(tangent), -3.0]
    was[:3] += 0.6 * was[3:]
    was[:3] += 0.3 * state[3:6, 0]  # by how late it is: the error that is carried says so
    reported = np.concatenate([was[:, np.newaxis], state[6:]])
    found = expected(state)
    wanted = told.expected_measurement(kind, reported, place)
    np.testing.assert_allclose(found.expected[2:], wanted[2:], atol=0.02)
    np.testing.assert_allclose(found.expected[:2], wanted[:2], atol=4e-6)
    for i in (3, 4, 7):
        step = np.zeros_like(state)
        step[i] = 1e-4 if i == 7 else 1e-2
        apart = expected(state + step).expected - expected(state - step).expected
        slope = apart / (2.0 * step[i])
        np.testing.assert_allclose(found.jacobian[3:, i], slope[3:], rtol=2e-3, atol=2e-3)
    np.testing.assert_allclose(
        found.total[..., 0], found.jacobian[..., 0] @ covariance[..., 0] @ found.jacobian[..., 0].T,
        rtol=1e-9, atol=1e-12,
    )  # fmt: skip


@pytest.mark.parametrize("known", [0.2, 0.5])
def test_a_track_that_later_looks_brought_back_keeps_a_positive_covariance(known):
    """It knows some of what changed since its last report: less than that report has in common."""
    model = MotionWithErrors(ConstantVelocity(4.0), LASTS_S)
    ones, age = np.ones(COUNT), np.linspace(0.05, 0.6, COUNT)
    covariance = model.noise(0.6 * ones)
    covariance[:6, :6] *= known
    for i in range(6):
        covariance[i, i] += 0.05
        covariance[6 + i, 6 + i] = 1.0
    state = np.zeros((12, COUNT))
    state[:6] = np.array([3000.0, -2000.0, 100.0, 60.0, -30.0, 2.0])[:, np.newaxis]
    reported = ReportedErrors(WAYS, np.tile(DEVIATION[:, np.newaxis], COUNT), age, ones < 0)
    seen, slope = reported.linearise(KIND, state, pose())
    ages = Ages(age, age, 0.6 * ones, 0.0 * ones)
    moments = ages.add_age_errors(linear_moments(seen, slope, covariance), model, state, covariance)
    variance = np.array([1e-10, 1e-10, 1e-4, 0.01, 0.01, 0.01])[:, np.newaxis] * ones
    found = moments.innovation(variance)
    _, after = update(state, covariance, found, np.zeros((6, COUNT)))
    assert np.linalg.eigvalsh(after.transpose(2, 0, 1)).min() > 0.0


def test_what_a_track_and_a_report_may_have_in_common_they_have():
    """Where nothing came since the last report all that changed is in both."""
    model = MotionWithErrors(ConstantVelocity(4.0), LASTS_S)
    ones = np.ones(COUNT)
    covariance = model.noise(0.6 * ones)
    for i in range(6):
        covariance[i, i] += 1.0
        covariance[6 + i, 6 + i] = 1.0
    state = np.zeros((12, COUNT))
    state[0] = 3000.0
    reported = ReportedErrors(WAYS, np.tile(DEVIATION[:, np.newaxis], COUNT), 0.3 * ones, ones < 0)
    seen, slope = reported.linearise(KIND, state, pose())
    ages = Ages(0.3 * ones, 0.3 * ones, 0.6 * ones, 0.0 * ones)
    before = linear_moments(seen, slope, covariance)
    _, shared = ages.error_covariances(model, state, covariance[3, 3] * np.ones((3, COUNT)))
    expected = before.cross + np.einsum("ikn,mkn->imn", shared[:, :3], slope[:, :3])
    expected += np.einsum("ikn,mkn->imn", shared[:, 3:], slope[:, 3:6])
    found = ages.add_age_errors(before, model, state, covariance).cross
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
