"""Make ``stone_soup_vectors.json``: what Stone Soup's filters say after each of some updates.

Run it in an environment with ``stonesoup==1.9.1`` and ``mpmath``; the project does not need them.
The frame is north, east, up; the test turns ours into it. Positions come before velocities, since
sigma points depend on the order. Stone Soup takes derivatives by differences, good to 1e-8: here
they are taken by mpmath at 40 digits.
"""

import datetime
import json
from pathlib import Path

import mpmath
import numpy as np
from stonesoup.models.measurement.nonlinear import (
    CartesianToElevationBearing,
    CartesianToElevationBearingRange,
)
from stonesoup.models.transition.linear import LinearGaussianTransitionModel
from stonesoup.predictor.kalman import ExtendedKalmanPredictor, UnscentedKalmanPredictor
from stonesoup.types.angle import Bearing, Elevation
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater, UnscentedKalmanUpdater

START = datetime.datetime(2026, 1, 1)
#: Seconds, azimuth (rad), elevation (rad), range (m) or None, and the sensor's place (n, e, u).
LOOKS = [
    (0.2, 0.412, 0.051, 4021.0, (0, 0, 0)),
    (0.25, 0.4131, 0.0505, None, (3, 1, 0)),
    (1.25, 0.4189, 0.0541, 3965.0, (60, 12, 2)),
    (3.0, 0.4402, 0.0577, 3848.0, (180, 36, 5)),
    (3.05, 0.4399, 0.0571, None, (183, 37, 5)),
    (11.0, 0.5713, 0.0729, 3444.0, (660, 130, 20)),
    (19.5, 0.8021, 0.0922, 3101.0, (1170, 230, 35)),
    (19.5, 0.8029, 0.0929, None, (1170, 230, 35)),
]
VARIANCES = (0.0031**2, 0.0043**2, 17.0**2)  # azimuth, elevation, range
INTENSITY = 2.3
MEAN = [3700.0, 1600.0, 200.0, -20.0, 35.0, 1.0]
SPREAD = [300.0**2, 250.0**2, 280.0**2, 30.0**2, 40.0**2, 9.0**2]
#: Spread of sigma points: alpha, beta, kappa.
SIGMA = (0.5, 2.0, 1.0)


class Velocity(LinearGaussianTransitionModel):
    """Constant velocity, positions first."""

    ndim_state = 6

    def matrix(self, time_interval, **kwargs):
        return np.kron([[1.0, time_interval.total_seconds()], [0.0, 1.0]], np.eye(3))

    def covar(self, time_interval, **kwargs):
        t = time_interval.total_seconds()
        return INTENSITY * np.kron([[t**3 / 3, t**2 / 2], [t**2 / 2, t]], np.eye(3))


class Exact:
    """Derivatives at 40 digits."""

    def jacobian(self, state, **kwargs):
        mpmath.mp.dps = 40
        place = [float(v) for v in self.translation_offset[:, 0]]
        point = [float(v) for v in state.state_vector[:3, 0]]

        def seen(x, y, z):
            n, e, u = x - place[0], y - place[1], z - place[2]
            r = mpmath.sqrt(n * n + e * e + u * u)
            return [mpmath.asin(u / r), mpmath.atan2(e, n), r]

        found = np.zeros((self.ndim_meas, 6))
        for i in range(self.ndim_meas):
            for k in range(3):
                which = tuple(int(j == k) for j in range(3))
                found[i, k] = float(mpmath.diff(lambda *p, i=i: seen(*p)[i], point, which))
        return found


class Ranged(Exact, CartesianToElevationBearingRange):
    pass


class Angles(Exact, CartesianToElevationBearing):
    pass


def run(predictor, updater):
    state = GaussianState(np.array([MEAN]).T, np.diag(SPREAD), timestamp=START)
    found = []
    for time_s, azimuth, elevation, distance, place in LOOKS:
        common = {"ndim_state": 6, "mapping": (0, 1, 2)}
        common["translation_offset"] = np.array([place]).T
        if distance is None:
            measured = Angles(noise_covar=np.diag([VARIANCES[1], VARIANCES[0]]), **common)
            vector = [[elevation], [azimuth]]
        else:
            measured = Ranged(
                noise_covar=np.diag([VARIANCES[1], VARIANCES[0], VARIANCES[2]]), **common
            )
            vector = [[elevation], [azimuth], [distance]]
        when = START + datetime.timedelta(seconds=time_s)
        vector[0][0], vector[1][0] = Elevation(vector[0][0]), Bearing(vector[1][0])
        detection = Detection(np.array(vector), timestamp=when, measurement_model=measured)
        prediction = predictor.predict(state, timestamp=when)
        state = updater.update(SingleHypothesis(prediction, detection))
        found.append(
            {
                "state": [float(state.state_vector[i, 0]) for i in range(6)],
                "covariance": np.array(state.covar, dtype=float).tolist(),
            }
        )
    return found


if __name__ == "__main__":
    alpha, beta, kappa = SIGMA
    sigma = {"alpha": alpha, "beta": beta, "kappa": kappa}
    model = Velocity()
    vectors = {
        "ekf": run(ExtendedKalmanPredictor(model), ExtendedKalmanUpdater()),
        "ukf": run(UnscentedKalmanPredictor(model, **sigma), UnscentedKalmanUpdater(**sigma)),
        "looks": LOOKS, "variances": VARIANCES, "intensity": INTENSITY,
        "mean": MEAN, "spread": SPREAD, "sigma": SIGMA,
    }  # fmt: skip
    Path(__file__).with_name("stone_soup_vectors.json").write_text(json.dumps(vectors) + "\n")
