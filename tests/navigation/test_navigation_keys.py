"""What the ownship believes of itself moves its reports by the same, in the horizon's axes."""

import math
from types import SimpleNamespace

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from wired import SENSORS, chain, rows, run, sensor

from components.environment.tables import Navigation
from components.navigation.errors import NavigationErrors
from dsa_des.block.component import Context
from dsa_des.time.randomness import Streams

#: New at every instant.
WHITE = {"position_correlation_time_s": 0.0, "attitude_correlation_time_s": 0.0}

OWN = crooked.geodetic(crooked.position(crooked.OWNSHIP))
ATTITUDE = np.array([crooked.OWNSHIP[f"{name}_deg"] for name in ("yaw", "pitch", "roll")])


def believed(kind: str = "radar.range_boundary", *, rate: float = 1, **navigation):
    scene = chain({"sensor": sensor(kind, scan_rate_hz=rate)}, navigation=navigation)
    return rows(run(scene), block="sensor")


@covers("position_bias_m", of=("[navigation]",))
@pytest.mark.parametrize("bias", [(300.0, 0, 0), (0, 300.0, 0), (0, 0, 300.0), (-50, 70, -90)])
def test_the_believed_position_is_off_to_north_east_and_down(bias):
    for row in believed(position_bias_m=list(bias)):
        off = pymap3d.geodetic2ned(row["own_lat_deg"], row["own_lon_deg"], row["own_alt_m"], *OWN)
        np.testing.assert_allclose(off, bias, atol=0.02)


@covers("attitude_bias_deg", of=("[navigation]",))
@pytest.mark.parametrize("kind", list(SENSORS))
@pytest.mark.parametrize("bias", [(5.0, 0, 0), (0, 5.0, 0), (0, 0, 5.0)])
def test_reports_in_ned_follow_from_the_believed_attitude(kind, bias):
    found = believed(kind, attitude_bias_deg=list(bias))
    assert len(found) == 2
    rotation = crooked.rotation(*(ATTITUDE + np.array(bias)))
    for row in found:
        measured = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        there = crooked.direction(row["ned_azimuth_rad"], row["ned_elevation_rad"])
        np.testing.assert_allclose(there, rotation.T @ measured, atol=1e-9)
        (target,) = (t for t in crooked.TARGETS if t["name"] == row["target"])
        true = crooked.ned(target)
        apart = math.acos(float(there @ true) / float(np.linalg.norm(true)))
        assert math.radians(0.3) < apart < math.radians(5.05)
        # Where the ownship is, it knows.
        assert row["own_lat_deg"] == pytest.approx(OWN[0], abs=1e-12)
        assert row["own_alt_m"] == pytest.approx(OWN[2], abs=1e-6)


@covers("position_noise_m", of=("[navigation]",))
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_noise_of_a_position_is_of_its_own_axis(axis):
    sigma = [0.0, 0.0, 0.0]
    sigma[axis] = 8.0
    off = []
    for row in believed(rate=200, position_noise_m=sigma, **WHITE):
        own = crooked.geodetic(crooked.position(crooked.OWNSHIP, row["time_s"]))
        place = row["own_lat_deg"], row["own_lon_deg"], row["own_alt_m"]
        off.append(pymap3d.geodetic2ned(*place, *own))
    spread = np.std(off, axis=0)
    assert spread[axis] == pytest.approx(8.0, rel=0.2)
    assert np.delete(spread, axis).max() < 0.02
    assert abs(np.mean(off, axis=0)[axis]) < 2.0


def attitude_of(pair: list) -> tuple[float, float, float]:
    """Return the believed yaw, pitch and roll that two lines of sight in both frames tell."""
    body = [crooked.direction(r["azimuth_rad"], r["elevation_rad"]) for r in pair]
    level = [crooked.direction(r["ned_azimuth_rad"], r["ned_elevation_rad"]) for r in pair]
    frames = [np.column_stack([a, b, np.cross(a, b)]) for a, b in (body, level)]
    matrix = frames[0] @ np.linalg.inv(frames[1])  # NED to body
    yaw = math.atan2(matrix[0, 1], matrix[0, 0])
    pitch = -math.asin(matrix[0, 2])
    roll = math.atan2(matrix[1, 2], matrix[2, 2])
    return yaw, pitch, roll


@covers("attitude_noise_deg", of=("[navigation]",))
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_noise_of_an_attitude_is_of_its_own_angle(axis):
    """The believed attitude is found back from two lines of sight, as yaw, pitch and roll."""
    sigma = [0.0, 0.0, 0.0]
    sigma[axis] = 2.0
    by_scan: dict[int, list] = {}
    for row in believed(rate=100, attitude_noise_deg=sigma, **WHITE):
        by_scan.setdefault(row["scan"], []).append(row)
    off = []
    for pair in by_scan.values():
        yaw, pitch, roll = attitude_of(pair)
        wrong = np.degrees([yaw, pitch, roll]) - ATTITUDE
        off.append((wrong + 180.0) % 360.0 - 180.0)
    spread = np.std(off, axis=0)
    assert spread[axis] == pytest.approx(2.0, rel=0.25)
    assert np.delete(spread, axis).max() < 1e-6
    assert abs(np.mean(off, axis=0)[axis]) < 0.7


def test_what_is_measured_does_not_depend_on_what_is_believed():
    columns = ("azimuth_rad", "elevation_rad", "range_m", "true_azimuth_rad", "confidence")
    plain = [[row[c] for c in columns] for row in believed(rate=10)]
    biased = believed(rate=10, position_bias_m=[500, 500, 500], attitude_bias_deg=[9, 9, 9])
    assert [[row[c] for c in columns] for row in biased] == plain


def test_the_noises_of_position_and_attitude_have_nothing_to_do_with_each_other():
    """Six series of 150 draws: any two correlate by less than a third."""
    by_scan: dict[int, list] = {}
    noise = {"position_noise_m": [8, 8, 8], "attitude_noise_deg": [2, 2, 2], **WHITE}
    for row in believed(rate=150, **noise):
        by_scan.setdefault(row["scan"], []).append(row)
    errors = []
    for pair in by_scan.values():
        own = crooked.geodetic(crooked.position(crooked.OWNSHIP, pair[0]["time_s"]))
        place = pair[0]["own_lat_deg"], pair[0]["own_lon_deg"], pair[0]["own_alt_m"]
        yaw, pitch, roll = attitude_of(pair)
        wrong = (np.degrees([yaw, pitch, roll]) - ATTITUDE + 180.0) % 360.0 - 180.0
        errors.append([*pymap3d.geodetic2ned(*place, *own), *wrong])
    correlation = np.corrcoef(np.array(errors).T) - np.eye(6)
    assert np.abs(correlation).max() < 0.33


@covers("position_correlation_time_s", "attitude_correlation_time_s", of=("[navigation]",))
def test_noise_lasts_as_long_as_the_scene_says():
    """What is left of an error 1 s later is exp(-1 / correlation time) of it."""
    lasts = {"position_correlation_time_s": 2.0, "attitude_correlation_time_s": 0.5}
    noise = {"position_noise_m": [0, 0, 5.0], "attitude_noise_deg": [0, 0, 1.0], **lasts}
    block = sensor("radar.range_boundary", scan_rate_hz=4)
    still = {"climb_mps": 0.0, "speed_mps": 0.0}
    scene = chain(
        {"sensor": block}, navigation=noise, ownship={**crooked.OWNSHIP, **still},
        targets=[{**crooked.ROLLING, **still}], duration_s=1200,
    )  # fmt: skip
    found = rows(run(scene))
    alt = np.array([row["own_alt_m"] for row in found]) - OWN[2]
    roll = np.degrees([row["own_roll_rad"] for row in found]) - ATTITUDE[2]
    for wrong, sigma, lasts_s in ((alt, 5.0, 2.0), (roll, 1.0, 0.5)):
        # As good as 300 independent numbers, at three deviations and more.
        assert np.mean(wrong**2) / sigma**2 == pytest.approx(1.0, abs=0.3)
        for later in (2, 4):
            left = np.mean(wrong[later:] * wrong[:-later]) / np.mean(wrong**2)
            assert left == pytest.approx(math.exp(-0.25 * later / lasts_s), abs=0.15)


@pytest.mark.parametrize(
    ("mount", "attitude_deg"),
    [({}, [1.5, 0.6, 0.9]), ({"mount_azimuth_deg": 70.0, "mount_roll_deg": 25.0}, [0.0, 1.5, 0.0])],
)
def test_variances_have_the_pose_that_navigation_knows(mount, attitude_deg):
    """By brute force: where a place in space lies in body axes for many poses as believed."""
    noise = {"position_noise_m": [9.0, 4.0, 6.0], "attitude_noise_deg": attitude_deg}
    stated = {"errors": "stated", "azimuth_error_deg": 0.7, "range_error_m": 3.0,
              "quantised": False, **mount}  # fmt: skip
    plain, known = (
        rows(run(chain({"sensor": sensor("radar.range_boundary", **stated)}, **sections)))
        for sections in ({}, {"navigation": noise})
    )
    draws = np.random.default_rng(8).normal(size=(4000, 6))
    for before, row in zip(plain, known, strict=True):
        assert (before["azimuth_rad"], before["range_m"]) == (row["azimuth_rad"], row["range_m"])
        pose = [row[f"own_{name}_rad"] for name in ("heading", "pitch", "roll")]
        line = crooked.direction(row["azimuth_rad"], row["elevation_rad"]) * row["range_m"]
        place = crooked.rotation(*np.degrees(pose)).T @ line
        found = []
        for draw in draws:
            turned = crooked.rotation(*(np.degrees(pose) + draw[3:] * noise["attitude_noise_deg"]))
            there = turned @ (place + draw[:3] * noise["position_noise_m"])
            found.append([*crooked.angles(there), np.linalg.norm(there)])
        spread = np.var(found, axis=0)
        for name, more in zip(
            ("azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2"), spread,
            strict=True,
        ):  # fmt: skip
            assert row[name] - before[name] == pytest.approx(more, rel=0.12), name


def test_the_noise_of_a_late_instant_is_its_own():
    """Instants beyond 48 bits of ticks draw other numbers than those they would wrap to."""
    context = Context(Streams(1), sections={"navigation": Navigation(position_noise_m=(0, 0, 9))})
    believed = NavigationErrors().build(SimpleNamespace(context=context))
    ticks = np.array([7, 7 + 2**48, 7 + 2**50, 7])
    zeros = np.zeros(4)
    names = ("lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad", "roll_rad")
    states = SimpleNamespace(
        tick=ticks, run=np.zeros(4, int), **{f"own_{name}": zeros for name in names}
    )
    alt = believed(states)["alt_m"]
    assert alt[0] == alt[3] and len(set(alt.tolist())) == 3
