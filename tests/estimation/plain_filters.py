"""Textbook filters of one track at a time, in plain loops: what the array code must come to."""

import itertools

import numpy as np
from scipy.linalg import expm

TWO_PI = 2.0 * np.pi


def seen(x, own, own_velocity, turn, ranged, rated):
    """Azimuth, elevation, range and range rate of a state, as asked for."""
    away = x[:3] - own
    b, r = turn @ away, np.linalg.norm(away)
    found = [np.arctan2(b[1], b[0]), np.arcsin(-b[2] / r)]
    return np.array(found + [r] * ranged + [away @ (x[3:6] - own_velocity) / r] * rated)


def slope(f, x, step=1e-5):
    """The derivative of a function of a vector, by central differences of fourth order."""
    scale = np.maximum(np.abs(x), 1.0) * step * 10.0
    columns = []
    for i in range(len(x)):
        d = np.zeros(len(x))
        d[i] = scale[i]
        columns.append((8 * (f(x + d) - f(x - d)) - (f(x + 2 * d) - f(x - 2 * d))) / 12 / scale[i])
    return np.array(columns).T


def move(x, t):
    """Straight on with 6 components, round a level turn with 7, accelerated with 9."""
    size = len(x)
    a = np.zeros((size, size))
    a[:3, 3:6] = np.eye(3)
    if size == 7:
        a[3, 4], a[4, 3] = -x[6], x[6]
    if size == 9:
        a[3:6, 6:9] = np.eye(3)
    return expm(a * t) @ x


def noise(size, t, intensity, turn=0.0):
    """What white acceleration (jerk with 9 components) adds, and of the rate of a turn."""
    q = np.zeros((size, size))
    order = 3 if size == 9 else 2
    for a, b in itertools.product(range(order), repeat=2):
        power = 2 * order - 1 - a - b
        f = [1, 1, 2]
        value = t**power / power / f[order - 1 - a] / f[order - 1 - b]
        q[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += intensity * value * np.eye(3)
    if size == 7:
        q[6, 6] = turn * t
    return q


def wrapped(e):
    """Differences of measurements, angles between minus and plus half a turn."""
    e = e.copy()
    e[:2] = (e[:2] + np.pi) % TWO_PI - np.pi
    return e


def corrected(x, p, h, z, r):
    """Extended Kalman filter: state, covariance, NIS, and likelihood of the measurement."""
    jacobian = slope(h, x)
    s = jacobian @ p @ jacobian.T + np.diag(r)
    gain, e = p @ jacobian.T @ np.linalg.inv(s), wrapped(z - h(x))
    nis = e @ np.linalg.solve(s, e)
    likelihood = np.exp(-0.5 * nis) / np.sqrt(np.linalg.det(TWO_PI * s))
    return x + gain @ e, p - gain @ s @ gain.T, nis, likelihood


def sigma_points(x, p, alpha, beta, kappa):
    """Points, weights of the mean and weights of the covariance (Julier, Uhlmann; Wan, Merwe)."""
    n = len(x)
    whole = alpha**2 * (n + kappa)
    root = np.linalg.cholesky(whole * p)
    points = [x, *(x + c for c in root.T), *(x - c for c in root.T)]
    mean = np.full(2 * n + 1, 0.5 / whole)
    mean[0] = 1.0 - n / whole
    spread = mean.copy()
    spread[0] += 1.0 - alpha**2 + beta
    return np.array(points), mean, spread


def unscented(x, p, h, z, r, shape):
    """Unscented correction: state, covariance, NIS."""
    points, mean, spread = sigma_points(x, p, *shape)
    each = np.array([h(point) for point in points])
    z0 = mean @ each
    z0[:2] = [np.arctan2(mean @ np.sin(a), mean @ np.cos(a)) for a in each.T[:2]]
    apart = np.array([wrapped(one - z0) for one in each])
    s = (spread[:, None] * apart).T @ apart + np.diag(r)
    gain = (spread[:, None] * (points - x)).T @ apart @ np.linalg.inv(s)
    e = wrapped(z - z0)
    return x + gain @ e, p - gain @ s @ gain.T, e @ np.linalg.solve(s, e)


def mixed(xs, ps, mu, rates, t, fresh):
    """Interaction of models whose rates of leaving are per second."""
    generator = np.array(rates, dtype=float)
    np.fill_diagonal(generator, 0.0)
    np.fill_diagonal(generator, -generator.sum(axis=1))
    step = expm(generator * t)
    ahead = mu @ step
    states, spreads = [], []
    for j, own in enumerate(xs):
        n = len(own)
        given, within = [], []
        for x, p in zip(xs, ps, strict=True):
            y, q = np.zeros(n), fresh[j] * np.eye(n)
            k = n if len(x) == n else 6
            y[:k], q[:k, :k] = x[:k], p[:k, :k]
            q[:k, k:] = q[k:, :k] = 0.0
            given.append(y)
            within.append(q)
        w = step[:, j] * mu / ahead[j]
        mean = sum(a * y for a, y in zip(w, given, strict=True))
        states.append(mean)
        spreads.append(sum(a * (q + np.outer(y - mean, y - mean))
                           for a, y, q in zip(w, given, within, strict=True)))  # fmt: skip
    return states, spreads, ahead


def shares(weights):
    """JPDA: the probability of each pair, by going through all joint events."""
    tracks, detections = weights.shape
    found, total = np.zeros(weights.shape), 0.0
    for event in itertools.product(range(-1, detections), repeat=tracks):
        taken = [d for d in event if d >= 0]
        if len(set(taken)) < len(taken):
            continue
        w = np.prod([weights[i, d] for i, d in enumerate(event) if d >= 0])
        total += w
        for i, d in enumerate(event):
            if d >= 0:
                found[i, d] += w
    return found / total
