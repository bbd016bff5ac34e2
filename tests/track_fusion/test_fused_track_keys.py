"""Every key of the fusion of tracks reaches what it says; one fused state is computed by hand."""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from scipy.optimize import minimize_scalar
from wired import HEARS_ALL, SEES_ALL, chain, rows, run

KIND = "fusion.covariance_intersection"
FINE = {**HEARS_ALL, "azimuth_resolution_deg": 0.3, "elevation_resolution_deg": 0.2,
        "range_resolution_m": 5.0}  # fmt: skip
#: A radar that errs otherwise, looks otherwise often, and starts later, in a frame of its own.
OTHER = {**FINE, "scan_rate_hz": 0.75, "offset_s": 0.4, "range_resolution_m": 40.0,
         "azimuth_resolution_deg": 0.1}  # fmt: skip
CAMERA = {**SEES_ALL, "azimuth_pixels": 3600, "elevation_pixels": 1800, "scan_rate_hz": 2}
#: A tracker that takes what it sees without a range to be about where it is.
NEAR = {"assumed_range_m": 2500.0, "start_speed_m_s": 150.0}
#: Some 300 m from the pole: frames of two instants are turned against each other.
BY_THE_POLE = {**crooked.OWNSHIP, "lat_deg": -89.997}
_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_ORIGIN = ("origin_lat_deg", "origin_lon_deg", "origin_alt_m")


def distributed(sensors, *, targets=(crooked.ROLLING,), duration_s=6, tracker=None,
                ownship=crooked.OWNSHIP, delays=None, **keys):  # fmt: skip
    """A scene in which every sensor has a tracker of its own, and their tracks are fused."""
    scene = chain(sensors, ownship=ownship, targets=targets, duration_s=duration_s)
    scene["blocks"]["fused"] = {"type": KIND, **keys}
    for name in sensors:
        scene["blocks"][f"{name}_looks"] = {"type": "fusion.pass_through"}
        scene["blocks"][f"{name}_tracks"] = {
            "type": "tracking.ekf", "confirm_m": 2, "confirm_n": 3, **(tracker or {})
        }  # fmt: skip
        scene["wires"].append(f"{name} -> {name}_looks -> {name}_tracks")
        late_s = (delays or {}).get(f"{name}_tracks", 0.0)
        scene["wires"].append({"from": f"{name}_tracks", "to": "fused", "delay_s": late_s})
    return rows(run(scene), "state_tracks")


def of(found, block, **wanted):
    return [r for r in found if r["block"] == block and all(r[k] == v for k, v in wanted.items())]


def state(row):
    return np.array([row[name] for name in _STATE])


def covariance(row):
    found = np.empty((6, 6))
    for name, value in row.items():
        if name.startswith("covariance_"):
            i, j = int(name[11]), int(name[12])
            found[i, j] = found[j, i] = value
    return found


def in_frame(row, origin):
    """A row's state and covariance at another origin, by pymap3d."""
    here = [row[name] for name in _ORIGIN]
    x, p = state(row), covariance(row)
    zero = np.array(pymap3d.ecef2ned(*pymap3d.ned2ecef(0, 0, 0, *here), *origin))
    turn = np.array(
        [np.array(pymap3d.ecef2ned(*pymap3d.ned2ecef(*axis, *here), *origin)) - zero
         for axis in 1e6 * np.eye(3)]
    ).T / 1e6  # fmt: skip
    turned = np.kron(np.eye(2), turn)
    moved = turned @ x
    moved[:3] += zero
    return moved, turned @ p @ turned.T


def carried(x, p, dt_s, q):
    step = np.kron([[1.0, dt_s], [0.0, 1.0]], np.eye(3))
    noise = np.kron([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]], np.eye(3))
    return step @ x, step @ p @ step.T + q * noise


def weighed(x, p, pull, b, rule):
    """Covariance intersection with information b, by minimising; pull is b times the difference."""
    a = np.linalg.inv(p)
    if rule == "independent":
        return x + np.linalg.inv(a + b) @ pull, np.linalg.inv(a + b)

    def cost(w):
        if rule == "determinant":
            return -np.linalg.slogdet(w * a + (1 - w) * b)[1]
        return np.trace(np.linalg.inv(w * a + (1 - w) * b)[:3, :3])

    w = minimize_scalar(cost, bounds=(0, 1), method="bounded", options={"xatol": 1e-11}).x
    mixed = np.linalg.inv(w * a + (1 - w) * b)
    return x + (1 - w) * (mixed @ pull), mixed


def direction(row):
    return crooked.direction(row["azimuth_rad"], row["elevation_rad"])


def by_direction(x, when_s, row, origin):
    """What a direction told in axes of its own says of a state: information, pull on it."""
    own = np.array([row[f"own_{name}"] for name in _STATE[:3]])
    home = [row[name] for name in _ORIGIN]

    def seen(state):
        place = state[:3] + (row["state_s"] - when_s) * state[3:]
        away = np.array(pymap3d.ecef2ned(*pymap3d.ned2ecef(*place, *origin), *home)) - own
        return np.array(crooked.angles(away))

    slope = np.array([seen(x + step) - seen(x - step) for step in np.eye(6)]).T / 2.0
    apart = np.array([row["azimuth_rad"], row["elevation_rad"]]) - seen(x)
    apart = (apart + math.pi) % (2 * math.pi) - math.pi
    spread = np.array([row["azimuth_variance_rad2"], row["elevation_variance_rad2"]])
    return slope.T / spread @ apart, slope.T / spread @ slope


@covers("acceleration_intensity_m2_s3", "rule", of=(KIND,))
@pytest.mark.parametrize("rule", ["determinant", "trace", "independent"])
def test_a_fused_state_is_that_of_a_computation_by_hand(rule):
    """Beside the pole, where axes turn by tens of degrees; one tracker's tracks come late."""
    sensors = {"fast": FINE, "slow": OTHER,
               "camera": {**CAMERA, "scan_rate_hz": 0.8, "offset_s": 0.7}}  # fmt: skip
    late_s = {"slow_tracks": 0.5}
    found = distributed(
        sensors, rule=rule, acceleration_intensity_m2_s3=2.5, ownship=BY_THE_POLE, delays=late_s,
        tracker=NEAR, stay_factor=20.0,
    )  # fmt: skip
    fused = [r for r in of(found, "fused") if r["contributors"] == "fast+slow+camera"]
    # Some come when newer ones are known, and change no instant.
    assert any(0.001 < r["time_s"] - r["state_s"] < 0.499 for r in fused)
    names = ("fast_tracks", "slow_tracks", "camera_tracks")
    for row in fused[::2]:
        origin = [row[name] for name in _ORIGIN]
        assert origin == [of(found, "fast_tracks")[0][name] for name in _ORIGIN]
        told = [
            [r for r in of(found, n) if r["time_s"] + late_s.get(n, 0.0) <= row["time_s"] + 1e-9]
            [-1] for n in names
        ]  # fmt: skip
        when = max(r["state_s"] for r in told)
        held = [carried(*in_frame(r, origin), when - r["state_s"], 2.5) for r in told[:2]]
        (x, p), (y, q) = held
        b = np.linalg.inv(q)
        x, p = weighed(x, p, b @ (y - x), b, rule)
        x, p = weighed(x, p, *by_direction(x, when, told[2], origin), rule)
        assert row["state_s"] == when
        np.testing.assert_allclose(state(row), x, rtol=1e-4, atol=1e-2)
        np.testing.assert_allclose(covariance(row), p, rtol=1e-3, atol=1e-2)
        assert row["existence"] == max(r["existence"] for r in told)
        assert row["updated_s"] == max(r["updated_s"] for r in told)
        last = [r for r in told if r["updated_s"] == row["updated_s"]]
        assert row["updated_by"] == "+".join(r["updated_by"] for r in last)
        assert row["age_s"] == pytest.approx(when - of(found, "fused")[0]["state_s"])
        own = crooked.position(BY_THE_POLE, when, BY_THE_POLE)
        wanted = pymap3d.ecef2ned(*own, *origin)
        assert [row[f"own_{n}"] for n in _STATE[:3]] == pytest.approx(wanted, abs=0.5)


def test_directions_alone_are_those_of_the_newest_in_the_axes_of_the_first():
    other = {**CAMERA, "scan_rate_hz": 0.8, "offset_s": 0.7, "elevation_pixels": 900}
    sensors = {"one": {**CAMERA, "scan_rate_hz": 1}, "two": other}
    found = distributed(sensors, ownship=BY_THE_POLE, tracker=NEAR, bearing_rate_deg_s=10.0,
                        delays={"two_tracks": 0.1})  # fmt: skip
    fused = [r for r in of(found, "fused") if r["contributors"] == "one+two"]
    assert {r["track"] for r in fused} == {1}
    seen = set()
    for row in fused:
        told = [
            [r for r in of(found, n) if r["time_s"] + late_s <= row["time_s"] + 1e-9][-1]
            for n, late_s in (("one_tracks", 0.0), ("two_tracks", 0.1))
        ]
        newest = max(told, key=lambda r: r["state_s"])
        seen.add(newest["block"])
        home = [newest[name] for name in _ORIGIN]
        origin = [row[name] for name in _ORIGIN]
        ends = [
            np.array(pymap3d.ecef2ned(*pymap3d.ned2ecef(*(1e4 * along), *home), *origin))
            for along in (np.zeros(3), direction(newest))
        ]
        assert direction(row) == pytest.approx((ends[1] - ends[0]) / 1e4, abs=1e-6)
        assert row["state_s"] == newest["state_s"]
        for name in ("azimuth_variance_rad2", "elevation_variance_rad2"):
            assert row[name] == newest[name]
        own = crooked.position(BY_THE_POLE, row["state_s"], BY_THE_POLE)
        wanted = pymap3d.ecef2ned(*own, *origin)
        assert [row[f"own_{n}"] for n in _STATE[:3]] == pytest.approx(wanted, abs=0.5)
    assert seen == {"one_tracks", "two_tracks"}


def test_frames_differ_and_the_fused_track_is_where_the_target_is():
    found = distributed({"fast": FINE, "slow": OTHER})
    frames = {name: of(found, name)[0]["origin_lat_deg"] for name in ("fast_tracks", "slow_tracks")}
    assert frames["fast_tracks"] != frames["slow_tracks"]
    last = of(found, "fused")[-1]
    assert {r["track"] for r in of(found, "fused")} == {1}
    place = crooked.position(crooked.ROLLING, last["state_s"])
    origin = [last[name] for name in _ORIGIN]
    apart = state(last)[:3] - np.array(pymap3d.ecef2ned(*place, *origin))
    assert np.linalg.norm(apart) < 30.0
    own = crooked.position(crooked.OWNSHIP, last["state_s"])
    wanted = pymap3d.ecef2ned(*own, *origin)
    assert [last[f"own_{a}_m"] for a in ("north", "east", "down")] == pytest.approx(wanted, abs=0.5)


def test_a_camera_s_direction_narrows_a_radar_s_track():
    sensors = {"radar": {**FINE, "azimuth_resolution_deg": 2.0}, "camera": CAMERA}
    found = distributed(sensors, duration_s=8, tracker=NEAR)
    last = of(found, "fused")[-1]
    assert last["contributors"] == "radar+camera"
    assert last["has_range"]
    assert {r["track"] for r in of(found, "fused", has_range=True)} == {last["track"]}
    radar = of(found, "radar_tracks")[-1]
    assert last["azimuth_variance_rad2"] < 0.3 * radar["azimuth_variance_rad2"]
    camera = distributed({"camera": CAMERA}, duration_s=2, tracker=NEAR)
    (told,), (mine,) = (of(camera, name, time_s=1.5) for name in ("fused", "camera_tracks"))
    for name in ("azimuth_rad", "elevation_rad", "azimuth_variance_rad2"):
        assert told[name] == pytest.approx(mine[name], rel=1e-12), name
    assert told["has_range"] is False and told["north_m"] is None


def test_a_direction_is_compared_at_its_own_instant():
    """A camera that looks seldom: the line of sight turns by degrees until the next look."""
    sensors = {"radar": {**FINE, "scan_rate_hz": 4}, "camera": {**CAMERA, "scan_rate_hz": 0.5}}
    near = {**NEAR, "confirm_m": 1, "confirm_n": 1}
    found = of(distributed(sensors, duration_s=6, tracker=near, stay_factor=1.0), "fused")
    both = [row for row in found if row["contributors"] == "radar+camera"]
    assert both[-1]["time_s"] == 5.75
    assert {row["track"] for row in found if row["time_s"] > 2.0} == {both[-1]["track"]}


@covers("gate_probability", "stay_factor", of=(KIND,))
def test_tracks_beyond_the_gate_are_two_and_stay_one_within_the_wider():
    sensors = {"fast": FINE, "slow": OTHER}

    def numbers(**keys):
        return len({r["track"] for r in of(distributed(sensors, **keys), "fused")})

    assert numbers() == 1
    assert numbers(gate_probability=1e-9) == 2
    # Once together, only the wider gate counts.
    assert numbers(gate_probability=0.5, stay_factor=1.0) == 2
    assert numbers(gate_probability=0.5, stay_factor=2.0) == 1


@covers("tentative", "drop_after_s", of=(KIND,))
def test_who_takes_part():
    sensors = {"fast": FINE}
    assert of(distributed(sensors), "fused")[0]["track_status"] == "confirmed"
    assert of(distributed(sensors, tentative=True), "fused")[0]["track_status"] == "tentative"
    away = {**crooked.ROLLING, "speed_mps": 150.0, "heading_deg": 250.0}
    near = {**FINE, "range_km": 3.0}
    keep = {"delete_misses": 50, "delete_after_s": 50.0, "delete_above_m": 1e6}

    def ends(**keys):
        found = of(distributed({"fast": near}, targets=[away], duration_s=12, tracker=keep, **keys),
                   "fused")  # fmt: skip
        (gone,) = [r["time_s"] for r in found if r["track_status"] == "deleted"] or (math.inf,)
        return gone - max(r["updated_s"] for r in found)

    assert ends(drop_after_s=2.0) == 3.0
    assert ends(drop_after_s=30.0) == math.inf


@covers("bearing_rate_deg_s", of=(KIND,))
def test_directions_of_two_instants_may_differ_by_the_rate():
    fast = {**crooked.ROLLING, "east_m": -700.0, "north_m": -300.0, "speed_mps": 150.0}
    sensors = {"one": CAMERA, "other": {**CAMERA, "scan_rate_hz": 1, "offset_s": 0.25}}

    def numbers(rate):
        found = distributed(
            sensors, targets=[fast], duration_s=4, bearing_rate_deg_s=rate, stay_factor=1.0,
            tracker={**NEAR, "assumed_range_m": 900.0},
        )  # fmt: skip
        return {r["track"] for r in of(found, "fused")}

    assert numbers(40.0) == {1}
    assert len(numbers(0.0)) > 1
    assert len(numbers(0.7)) > 1  # 40 deg are 0.7 rad


def test_who_was_not_seen_since_is_told_as_of_then():
    """Two cameras, each with a target of its own: what one sees makes the other's no newer."""

    def towards(target, **keys):
        azimuth = math.degrees(crooked.angles(crooked.body(target))[0])
        return {**CAMERA, "azimuth_deg": [azimuth - 10.0, azimuth + 10.0], **keys}

    sensors = {"one": towards(crooked.ROLLING, scan_rate_hz=1),
               "two": towards(crooked.DIVING, scan_rate_hz=1, offset_s=0.4)}  # fmt: skip
    found = distributed(sensors, targets=crooked.TARGETS, tracker=NEAR, duration_s=4)
    for name in sensors:
        late = [r for r in of(found, "fused", contributors=name) if r["updated_s"] < r["time_s"]]
        assert late
        for row in late:
            assert row["state_s"] == row["updated_s"]
            own = crooked.position(crooked.OWNSHIP, row["state_s"])
            wanted = pymap3d.ecef2ned(*own, *(row[n] for n in _ORIGIN))
            assert [row[f"own_{n}"] for n in _STATE[:3]] == pytest.approx(wanted, abs=0.5)


def test_who_helped_is_remembered_and_who_helped_last_is_told():
    away = {**crooked.ROLLING, "speed_mps": 150.0, "heading_deg": 250.0}
    sensors = {"fast": FINE, "near": {**OTHER, "range_km": 3.0}}
    found = distributed(sensors, targets=[away], duration_s=10, drop_after_s=2.0)
    last = of(found, "fused")[-1]
    assert (last["contributors"], last["updated_by"]) == ("fast+near", "fast")
    scene = chain({"fast": FINE, "slow": OTHER}, targets=(crooked.ROLLING,), duration_s=4)
    scene["blocks"]["looks"] = {"type": "fusion.pass_through"}
    scene["blocks"]["tracker"] = {"type": "tracking.ekf"}
    scene["wires"] += ["fast -> looks -> tracker", "slow -> looks"]
    scene["blocks"]["fused"] = {"type": KIND}
    scene["wires"].append("tracker -> fused")
    fused = of(rows(run(scene), "state_tracks"), "fused", contributors="fast+slow")
    assert {r["updated_by"] for r in fused} == {"fast", "slow"}


def test_a_coarse_direction_lies_in_a_wide_gate():
    sensors = {"radar": FINE, "camera": {**CAMERA, "azimuth_pixels": 36, "elevation_pixels": 18}}
    found = of(distributed(sensors, duration_s=4, tracker=NEAR), "fused")
    assert {r["track"] for r in found} == {1}
    assert found[-1]["contributors"] == "radar+camera"
