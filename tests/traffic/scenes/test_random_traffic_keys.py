"""Random traffic is as many, as far, as high and as fast as the scene says."""

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, measured, rows, run, sensor

COUNT = 300


def looked(duration_s: float = 1, **keys) -> dict[float, dict[str, np.ndarray]]:
    """Vectors to all intruders in NED from a level ownship that stands, by time and name."""
    own = {key: crooked.OWNSHIP[key] for key in ("lat_deg", "lon_deg", "alt_m")}
    table = {
        "type": "traffic.random", "ownship": own, "intruders": COUNT, "radius_km": 30.0, **keys,
    }  # fmt: skip
    radar = sensor("radar.range_boundary", scan_rate_hz=2, range_km=500.0)
    scene = chain({"radar": radar}, duration_s=duration_s)
    scene["blocks"]["traffic"] = table
    found: dict[float, dict[str, np.ndarray]] = {}
    for row in rows(run(scene)):
        there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
        found.setdefault(row["time_s"], {})[row["target"]] = row["true_range_m"] * there
    return found


@covers("intruders", "radius_km", of=("traffic.random",))
@pytest.mark.parametrize(("count", "radius_km"), [(COUNT, 30.0), (200, 8.0)])
def test_they_start_evenly_over_the_disc(count, radius_km):
    """Distances from the middle have a mean of 2/3 of the radius, squares of one half."""
    vectors = np.array(list(looked(intruders=count, radius_km=radius_km)[0.0].values()))
    assert len(vectors) == count
    distance_km = np.hypot(vectors[:, 0], vectors[:, 1]) / 1000.0
    assert 0.95 * radius_km < distance_km.max() <= 1.001 * radius_km
    assert np.mean(distance_km**2) == pytest.approx(0.5 * radius_km**2, rel=0.15)
    assert np.abs(np.mean(vectors[:, :2], axis=0)).max() < 120 * radius_km


@covers("altitude_spread_m", of=("traffic.random",))
@pytest.mark.parametrize("spread_m", [100.0, 900.0])
def test_altitudes_are_within_their_spread(spread_m):
    """Near enough that the Earth does not fall away: 2 m at 5 km."""
    vectors = np.array(list(looked(radius_km=5.0, altitude_spread_m=spread_m)[0.0].values()))
    up = -vectors[:, 2]
    assert -spread_m - 3 <= up.min() < -0.95 * spread_m
    assert 0.95 * spread_m < up.max() <= spread_m
    assert abs(np.mean(up)) < 0.12 * spread_m


@covers("speed_min_mps", "speed_max_mps", of=("traffic.random",))
@pytest.mark.parametrize(("slow", "fast"), [(40.0, 120.0), (100.0, 110.0)])
def test_speeds_lie_between_the_slowest_and_the_fastest(slow, fast):
    found = looked(speed_min_mps=slow, speed_max_mps=fast)
    moved = [np.linalg.norm(found[0.5][name] - found[0.0][name]) / 0.5 for name in found[0.0]]
    margin = 0.05 * (fast - slow) + 0.1
    assert slow - 0.1 <= min(moved) < slow + margin
    assert fast - margin < max(moved) <= fast + 0.1
    assert np.mean(moved) == pytest.approx(0.5 * (slow + fast), abs=2 * margin)


def test_they_fly_in_all_directions():
    """Of 300 headings each quarter of the compass has about 75, wherever they start."""
    found = looked()
    moved = np.array([found[0.5][name] - found[0.0][name] for name in found[0.0]])
    heading = np.degrees(np.arctan2(moved[:, 1], moved[:, 0])) % 360.0
    share, _ = np.histogram(heading, bins=[0, 90, 180, 270, 360])
    assert share.min() > 45
    start = np.array(list(found[0.0].values()))
    bearing = np.degrees(np.arctan2(start[:, 1], start[:, 0])) % 360.0
    assert np.histogram(bearing, bins=[0, 90, 180, 270, 360])[0].min() > 45
    for one, other in ((heading, bearing), (heading, -start[:, 2]), (bearing, -start[:, 2])):
        assert abs(np.corrcoef(one, other)[0, 1]) < 0.2


@covers("update_rate_hz", of=("traffic.random",))
def test_positions_are_held_between_updates():
    still = looked(update_rate_hz=1)
    np.testing.assert_array_equal(list(still[0.5].values()), list(still[0.0].values()))
    moving = looked()
    assert np.abs(np.array(list(moving[0.5].values())) - list(moving[0.0].values())).max() > 10


@covers("sample_interval_s", of=("traffic.random", "traffic.scripted"))
@pytest.mark.parametrize("traffic", ["random", "scripted"])
@pytest.mark.parametrize("step_s", [0.7, 1.5])
def test_closest_approaches_are_at_samples(traffic, step_s):
    scene = chain({"radar": sensor("radar.range_boundary")}, duration_s=6)
    if traffic == "random":
        scene["blocks"]["traffic"] = {
            "type": "traffic.random", "ownship": crooked.OWNSHIP, "intruders": 40, "radius_km": 1,
        }  # fmt: skip
    else:
        passing = {**crooked.ROLLING, "east_m": -150.0, "north_m": -200.0}
        scene["blocks"]["traffic"]["intruders"] = [passing]
    scene["blocks"]["traffic"]["sample_interval_s"] = step_s
    told = run(scene).info["summary"]["targets"].values()
    times = np.array([target["closest_approach"]["time_s"] for target in told])
    np.testing.assert_allclose(times / step_s, np.round(times / step_s), atol=1e-9)
    assert times.max() > 0.0


def test_a_study_of_a_closest_approach_knows_the_flights():
    """Taken at steps of 0.1 s up to the end."""
    scene = chain({"radar": sensor("radar.range_boundary")}, duration_s=3)
    found = measured(scene, {"metric": "closest_approach", "target": "diving"})
    ranges = [np.linalg.norm(crooked.ned(crooked.DIVING, 0.1 * k)) for k in range(31)]
    assert found["closest_approach_m"] == pytest.approx(min(ranges), abs=0.02)
    assert found["closest_approach_time_s"] == pytest.approx(0.1 * int(np.argmin(ranges)))
