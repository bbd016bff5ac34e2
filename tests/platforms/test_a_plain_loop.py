"""A pair that avoids by `avoidance.mvp`, beside the OpenCDaRR campaign's rules in plain numbers."""

import math

import numpy as np

import dsa_des
from components.geometry import line_of_sight_ned
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.running.simulation import Simulation

#: Of the scene: heard and decided each second, told 0.1 s later.
LATE_S, MOST_MPS2, MOST_MPS, RADIUS_M, WIDER_M = 0.1, 5.0, 18.0, 50.0, 52.5


def push_of_pair(r, u, t, c):
    """What the second is pushed by, and the first the other way; 0 where there is no conflict."""
    half_s = math.sqrt(max(RADIUS_M**2 - abs(c) ** 2, 0.0)) / abs(u)
    if not (abs(c) < RADIUS_M and t - half_s < 120.0 and t + half_s > 0.0):
        return 0.0
    c = c if abs(c) > 0.1 else -0.1j * r / abs(r)
    gain_m = WIDER_M - abs(c)
    if abs(r) > max(WIDER_M, abs(c)):
        touches = math.asin(WIDER_M / abs(r)) - math.asin(abs(c) / abs(r))
        gain_m = WIDER_M / math.cos(touches) - abs(c)
    return gain_m / (max(abs(t), 1e-6) * abs(c)) * c


def fly_pair(place, velocity, errors):
    """Return where two are each second, east + i north, m, by the errors of their fixes."""
    place, velocity, path, active = [*place], [*velocity], [], False
    nominal, told = [*velocity], [*velocity]
    for of_places, of_velocities in errors:
        path.append([*place])
        fixes = [p + error for p, error in zip(place, of_places, strict=True)]
        speeds = [v + error for v, error in zip(velocity, of_velocities, strict=True)]
        r, u = fixes[1] - fixes[0], speeds[1] - speeds[0]
        dot = (r.conjugate() * u).real
        push = push_of_pair(r, u, t := -dot / abs(u) ** 2, r + u * t)
        between = abs(math.remainder(np.angle(speeds[1]) - np.angle(speeds[0]), 2 * math.pi))
        beside = between < math.radians(30) and abs(r) < WIDER_M
        active = push != 0.0 or (active and not (dot > 0 and abs(r) >= RADIUS_M and not beside))
        wanted = [speeds[0] - push, speeds[1] + push] if active else nominal
        wanted = [w * min(1.0, MOST_MPS / max(abs(w), 1e-9)) for w in wanted]
        for lasts_s, commanded in ((LATE_S, told), (1.0 - LATE_S, wanted)):
            for k in (0, 1):
                change = commanded[k] - velocity[k]
                ramp_s = min(abs(change) / MOST_MPS2, lasts_s)
                a = MOST_MPS2 * change / max(abs(change), 1e-12)
                place[k] += velocity[k] * lasts_s + a * ramp_s * (lasts_s - ramp_s / 2)
                velocity[k] += a * ramp_s
        told = wanted
    return np.array(path)


def test_a_noisy_pair_flies_as_a_plain_loop_does():
    """On the same errors, for 82 s; they come within 66 m. Meridians that meet turn it by 0.5 m."""
    simulation = Simulation(
        replica_scene(
            dsa_des.load_scene("configs/platforms/velocities.toml"), Replica(4, {"duration_s": 120})
        )
    )
    drawn = {}
    for name in ("exchange", "exchange_b"):
        exchange = simulation.nodes[name].component

        def tapped(wake, keys, draw=exchange._position_and_velocity_errors):
            both = [east + 1j * north for east, north in draw(wake, keys)]
            drawn.update(zip(wake.ticks.tolist(), zip(*both, strict=True), strict=True))
            return draw(wake, keys)

        exchange._position_and_velocity_errors = tapped
    simulation.run()
    times_s = np.arange(float(len(drawn)))
    traffic, ours = simulation.nodes["traffic"].component, []
    for flight in (traffic.own, traffic.targets[0]):
        there = flight.at(times_s)
        north, east, _ = line_of_sight_ned(52.0, 4.0, 100.0, *list(there.arrays())[:3])
        ours.append(east + 1j * north)
    starts = ours[0][0], ours[1][0]
    plain = fly_pair(starts, (10.2889j, 10.2889), [drawn[tick] for tick in sorted(drawn)]).T
    apart_m = abs(plain[1] - plain[0])
    assert len(drawn) == 82 and 60.0 < apart_m.min() < 70.0
    np.testing.assert_allclose(np.abs(ours[1] - ours[0]), apart_m, rtol=0, atol=0.2)
    np.testing.assert_allclose(ours, plain, rtol=0, atol=1.0)
