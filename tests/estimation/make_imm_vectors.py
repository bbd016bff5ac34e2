"""Make ``imm_vectors.json``: interacting models at 40 digits, after each of some looks.

Nothing here is computed by the project. Transitions and noise are exponentials of matrices (Van
Loan), the turn is the exponential of its differential equation, derivatives are differences with
half of the digits to spare, and the mixing is written out model by model (Blom, Bar-Shalom 1988;
unequal states as Granström et al. 2015: what a model has alone it keeps).

The frame is north, east, down; the sensor's axes are those of the frame. Needs ``mpmath``.
"""

import json
from pathlib import Path

from mpmath import mp, mpf

mp.dps = 40
STEP = mpf(10) ** -13
#: Seconds, azimuth, elevation (rad), range (m) or None, and the sensor's place (n, e, d), of a
#: target that flies straight and then turns by 3 deg/s.
LOOKS = [
    (0.2, 0.4124, 0.0507, 4021.0, (0, 0, 0)),
    (0.25, 0.4129, 0.0509, None, (3, 1, 0)),
    (1.2, 0.4187, 0.0519, 3949.0, (60, 12, -2)),
    (2.2, 0.4229, 0.0533, 3872.0, (110, 24, -4)),
    (2.25, 0.4233, 0.0531, None, (113, 25, -4)),
    (4.2, 0.4151, 0.0561, 3771.0, (220, 48, -8)),
    (6.2, 0.3876, 0.0577, 3741.0, (330, 72, -12)),
    (8.2, 0.3487, 0.0572, 3781.0, (440, 96, -16)),
    (12.2, 0.2702, 0.0541, 3968.0, (650, 140, -24)),
]  # fmt: skip
VARIANCES = (0.0031**2, 0.0043**2, 17.0**2)  # azimuth, elevation, range
MEAN = [3680.0, 1610.0, -205.0, -20.0, 35.0, -1.0]
SPREAD = [300.0**2, 250.0**2, 280.0**2, 30.0**2, 40.0**2, 9.0**2]
#: What models have besides, with its variance.
TURN, ACCELERATION = (0.01, 0.05**2), (0.2, 3.0**2)
#: Of each model in turn: velocity, turn, acceleration.
PROBABILITIES = [0.5, 0.3, 0.2]
RATES = [[0.0, 0.05, 0.02], [0.1, 0.0, 0.03], [0.07, 0.04, 0.0]]
INTENSITY, TURN_INTENSITY, TURN_RATE_INTENSITY, JERK_INTENSITY = 0.7, 0.4, 1.5e-4, 0.3
SIZES = [6, 7, 9]


def chained(size, dt, intensity):
    """Transition and noise of a chain of integrators driven by white noise, by Van Loan."""
    drift, gain = mp.zeros(size), mp.zeros(size)
    for i in range(size - 3):
        drift[i, i + 3] = 1
    for i in range(size - 3, size):
        gain[i, i] = mpf(intensity)
    block = mp.zeros(2 * size)
    block[:size, :size], block[:size, size:] = -drift, gain
    block[size:, size:] = drift.T
    whole = mp.expm(block * dt)
    step = whole[size:, size:].T
    return step, step * whole[:size, size:]


def turned(state, dt):
    generator = mp.zeros(6)
    generator[0, 3] = generator[1, 4] = generator[2, 5] = 1
    generator[3, 4], generator[4, 3] = -state[6], state[6]
    moved = mp.expm(generator * dt) * state[:6]
    return mp.matrix([*moved, state[6]])


def derivative(function, state):
    columns = []
    for k in range(len(state)):
        ends = []
        for sign in (1, -1):
            near = state.copy()
            near[k] += sign * STEP
            ends.append(function(near))
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    found = mp.zeros(len(columns[0]), len(columns))
    for k, column in enumerate(columns):
        found[:, k] = column
    return found


def predicted(model, state, spread, dt):
    if model == 1:
        step = derivative(lambda s: turned(s, dt), state)
        noise = mp.zeros(7)
        noise[:6, :6] = chained(6, dt, TURN_INTENSITY)[1]
        noise[6, 6] = mpf(TURN_RATE_INTENSITY) * dt
        return turned(state, dt), step * spread * step.T + noise
    step, noise = chained(SIZES[model], dt, INTENSITY if model == 0 else JERK_INTENSITY)
    return step * state, step * spread * step.T + noise


def seen(state, place, ranged):
    n, e, d = (state[i] - mpf(place[i]) for i in range(3))
    r = mp.sqrt(n * n + e * e + d * d)
    return mp.matrix([mp.atan2(e, n), mp.asin(-d / r), *([r] if ranged else [])])


def mixed(states, spreads, weights, dt):
    many = range(len(SIZES))
    generator = mp.matrix(RATES)
    for i in many:
        generator[i, i] = -sum(generator[i, j] for j in many)
    steps = mp.expm(generator * dt)
    before = [sum(steps[i, j] * weights[i] for i in many) for j in many]
    new_states, new_spreads = [], []
    for j in many:
        given = []
        for i in many:
            state, spread = states[j].copy(), spreads[j].copy()
            if i == j:
                given.append((state, spread))
                continue
            state[:6] = states[i][:6]
            spread[:6, :6] = spreads[i][:6, :6]
            for a in range(6):
                for b in range(6, SIZES[j]):
                    spread[a, b] = spread[b, a] = 0
            given.append((state, spread))
        shares = [steps[i, j] * weights[i] / before[j] for i in many]
        mean = mp.zeros(SIZES[j], 1)
        for share, (state, _) in zip(shares, given, strict=True):
            mean += share * state
        whole = mp.zeros(SIZES[j])
        for share, (state, spread) in zip(shares, given, strict=True):
            whole += share * (spread + (state - mean) * (state - mean).T)
        new_states.append(mean)
        new_spreads.append(whole)
    return new_states, new_spreads, before


def updated(state, spread, look):
    _, azimuth, elevation, distance, place = look
    ranged = distance is not None
    value = mp.matrix([mpf(azimuth), mpf(elevation), *([mpf(distance)] if ranged else [])])
    by_state = derivative(lambda s: seen(s, place, ranged), state)
    apart = value - seen(state, place, ranged)
    noise = mp.diag([mpf(v) for v in VARIANCES[: len(value)]])
    whole = by_state * spread * by_state.T + noise
    inverse = whole**-1
    gain = spread * by_state.T * inverse
    log = -((apart.T * inverse * apart)[0] + mp.log(mp.det(2 * mp.pi * whole))) / 2
    rest = mp.eye(len(state)) - gain * by_state
    return state + gain * apart, rest * spread, log


def plain(matrix):
    rows = [[float(matrix[i, j]) for j in range(matrix.cols)] for i in range(matrix.rows)]
    return [row[0] for row in rows] if matrix.cols == 1 else rows


def run():
    own = [[], [TURN], [ACCELERATION] * 3]
    states = [mp.matrix([*map(mpf, MEAN), *(mpf(m) for m, _ in more)]) for more in own]
    spreads = [mp.diag([*map(mpf, SPREAD), *(mpf(v) for _, v in more)]) for more in own]
    weights = [mpf(w) for w in PROBABILITIES]
    last, found = mpf(0), []
    for look in LOOKS:
        dt = mpf(look[0]) - last
        last = mpf(look[0])
        states, spreads, weights = mixed(states, spreads, weights, dt)
        moved = [predicted(m, x, p, dt) for m, (x, p) in enumerate(zip(states, spreads))]  # noqa: B905
        after = [updated(x, p, look) for x, p in moved]
        states, spreads = [x for x, _, _ in after], [p for _, p, _ in after]
        likely = [w * mp.exp(log) for w, (_, _, log) in zip(weights, after, strict=True)]
        weights = [value / sum(likely) for value in likely]
        mean = mp.zeros(6, 1)
        for w, x in zip(weights, states, strict=True):
            mean += w * x[:6]
        whole = mp.zeros(6)
        for w, x, p in zip(weights, states, spreads, strict=True):
            whole += w * (p[:6, :6] + (x[:6] - mean) * (x[:6] - mean).T)
        found.append(
            {
                "states": [plain(x) for x in states],
                "covariances": [plain(p) for p in spreads],
                "probabilities": [float(w) for w in weights],
                "state": plain(mean),
                "covariance": plain(whole),
            }
        )
    return found


if __name__ == "__main__":
    vectors = {
        "after": run(), "looks": LOOKS, "variances": VARIANCES, "mean": MEAN, "spread": SPREAD,
        "turn": TURN, "acceleration": ACCELERATION, "probabilities": PROBABILITIES, "rates": RATES,
        "intensities": [INTENSITY, TURN_INTENSITY, TURN_RATE_INTENSITY, JERK_INTENSITY],
    }  # fmt: skip
    Path(__file__).with_name("imm_vectors.json").write_text(json.dumps(vectors) + "\n")
