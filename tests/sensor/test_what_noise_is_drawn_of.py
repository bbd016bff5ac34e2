"""Noise in reports: each of its values by itself, and how far a place may be off."""

import math

import crooked
import numpy as np
import pytest
from test_false_alarms_look_like_targets import CROWD, noisy
from wired import SEES_ALL, chain, noise_crosses, rows, run, sensor

from components.sensor import declaration
from components.sensor.declaration import SeenPlaces, count_scans_with_neighbour


def test_where_and_how_strong_noise_of_a_camera_is_are_drawn_each_by_itself():
    eye = {
        **SEES_ALL, "scan_rate_hz": 500, "threshold": 2.0, "false_alarms_per_frame": 0.5,
        "azimuth_deg": [-70, 40], "elevation_deg": [-12, 31],
    }  # fmt: skip
    found = rows(run(chain({"eye": eye}, duration_s=4)), target=None)
    values = np.array([[row[name] for row in found]
                       for name in ("azimuth_rad", "elevation_rad", "confidence")])  # fmt: skip
    assert 900 < values.shape[1] < 1100
    for angles, ends in zip(np.degrees(values[:2]), ((-70, 40), (-12, 31)), strict=True):
        assert ends[0] <= angles.min() < ends[0] + 1.5
        assert ends[1] - 1.5 < angles.max() <= ends[1]
    assert (np.abs(np.corrcoef(values)[np.triu_indices(3, 1)]) < 0.12).all()


def test_detections_of_one_pixel_stand_by_their_confidence():
    """Where place tells nothing, an order of targets before noise would tell who is who."""
    eye = {**SEES_ALL, "scan_rate_hz": 20, "false_alarms_per_frame": 1.0, "azimuth_pixels": 1,
           "elevation_pixels": 1}  # fmt: skip
    crowd = [{**one, "contrast": gain} for one, gain in zip(CROWD, (0.01, 1e8) * 3, strict=False)]
    found = rows(run(chain({"eye": eye}, targets=crowd, duration_s=4)))
    place = np.array([[row[name] for row in found]
                      for name in ("scan", "azimuth_rad", "elevation_rad")])  # fmt: skip
    same = (np.diff(place) == 0).all(axis=0)
    confidence = np.array([row["confidence"] for row in found])
    false = np.array([row["target"] is None for row in found])
    assert (np.diff(confidence)[same] >= 0.0).all()
    assert (false[:-1] & ~false[1:] & same).sum() > 5


@pytest.mark.parametrize("kind", ["radar.threshold", "radar.swerling"])
def test_echoes_have_crossed_the_threshold_of_a_cell(kind):
    """What is hardly stronger than noise is as strong as noise that has crossed it."""
    keys = {"scan_rate_hz": 20, **noise_crosses(kind, 0.05)}
    # A threshold detects what is stronger on average.
    power_w = 1.0 if kind == "radar.threshold" else 1e-9
    found = rows(run(chain(
        {"radar": noisy(kind, "grid", power_w=power_w, **keys)},
        targets=CROWD, duration_s=4,
    )))  # fmt: skip
    strengths = [[row["snr_db"] for row in found if (row["target"] is None) == false]
                 for false in (False, True)]  # fmt: skip
    assert min(map(len, strengths)) > 20
    assert min(strengths[0]) == pytest.approx(min(strengths[1]), abs=0.7)


def test_each_echo_is_measured_about_its_own_strength():
    """On the mean of many looks, of which `looks` has the strength that decided."""
    far = [{**target, "east_m": target["east_m"] * k, "north_m": target["north_m"] * k}
           for k, target in zip((1.0, 1.7), crooked.TARGETS, strict=True)]  # fmt: skip
    keys = {"swerling": 0, "power_w": 3e5, "scan_rate_hz": 25, "range_km": 12.0}
    scene = chain({"radar": noisy("radar.swerling", "grid", **keys)}, duration_s=4,
                  targets=far, record={"looks": True})  # fmt: skip
    found = run(scene)
    expected = {(row["scan"], row["target"]): row["snr_db"] for row in rows(found, "looks")}
    means = []
    for target in ("rolling", "diving"):
        mine = rows(found, target=target)
        off_db = np.array([row["snr_db"] - expected[row["scan"], target] for row in mine])
        assert 0.7 < (10.0 ** (0.1 * off_db)).mean() < 1.4
        means.append(np.mean([expected[row["scan"], target] for row in mine]))
    assert abs(means[0] - means[1]) > 4.0 and min(means) > 15.0


def places(first, second, apart_s=0.5, angle_variance=(0.0, 0.0), range_variance=(0.0, 0.0)):
    """Two detections at (angle rad, range m) in two scans."""
    angles = np.array([first[0], second[0]])
    return SeenPlaces(
        np.zeros(2, dtype=int), np.array([3, 4]), np.array([1.0, 1.0 + apart_s]),
        np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1),
        np.array([first[1], second[1]]), np.array(angle_variance), np.array(range_variance),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("second", "variances", "gates"),
    [
        # What moves at 40 m/s and 0.02 rad/s for half a second.
        ((0.0, 1020.0), {}, (20.0, None)),
        ((0.01, 1000.0), {}, (None, 0.01)),
        # And three deviations of the difference, whose variances add up.
        ((0.0, 1035.0), {"range_variance": (9.0, 16.0)}, (35.0, None)),
        ((0.016, 1000.0), {"angle_variance": (3.2e-6, 8e-7)}, (None, 0.016)),
    ],
)
def test_a_place_is_the_same_within_motion_and_three_deviations(second, variances, gates):
    for factor, scans in ((0.999, 2), (1.001, 1)):
        near = (second[0] * factor, 1000.0 + (second[1] - 1000.0) * factor)
        found = count_scans_with_neighbour(
            places((0.0, 1000.0), near, **variances), np.array([1]), 3,
            speed_m_s=40.0, rate_rad_s=0.02,
        )  # fmt: skip
        assert found.tolist() == [scans], gates


def test_places_of_a_scene_are_as_wrong_as_their_detections(monkeypatch):
    """High up an error of azimuth moves less: by the cosine of the elevation."""
    seen, judged = [], declaration.count_scans_with_neighbour

    def kept(found, *given, **keys):
        seen.append(found)
        return judged(found, *given, **keys)

    monkeypatch.setattr(declaration, "count_scans_with_neighbour", kept)
    high = {**crooked.ROLLING, "up_m": 2900.0}
    radar = sensor("radar.range_boundary", errors="stated", azimuth_error_deg=1.5,
                   elevation_error_deg=0.4, range_error_m=12.0, quantised=False,
                   declare_m=1, declare_n=2, declare_by="place")  # fmt: skip
    found = rows(run(chain({"radar": radar}, targets=[high, crooked.DIVING], duration_s=2)))
    new = seen[-1].take(np.arange(len(seen[-1]) - len(found), len(seen[-1])))
    assert np.abs(np.degrees([row["elevation_rad"] for row in found])).max() > 25.0
    for place, row in enumerate(found):
        across = math.radians(1.5) * math.cos(row["elevation_rad"])
        assert new.angle_variance_rad2[place] == pytest.approx(across**2 + math.radians(0.4) ** 2)
        assert new.range_variance_m2[place] == pytest.approx(144.0)
        ours = crooked.attitude(crooked.OWNSHIP).T @ crooked.direction(
            row["azimuth_rad"], row["elevation_rad"]
        )
        assert new.direction[place] == pytest.approx(ours, abs=1e-6)
        assert (new.scan[place], new.time_s[place]) == (row["scan"], row["time_s"])


@pytest.mark.parametrize("kind", ["radar.threshold", "radar.swerling"])
def test_ground_stands_among_the_rest_and_has_crossed_the_threshold_of_a_cell(kind):
    """Output over noise less 1: at least -ln(Pfa) - 1."""
    from test_clutter_false_alarms import RADAR, STILL, TERRAIN

    keys = {**RADAR, "clutter_threshold": "noise", **noise_crosses(kind, 1e-3)}  # fmt: skip
    scene = chain({"r": sensor(kind, **keys)}, ownship=STILL, terrain=TERRAIN, duration_s=1,
                  targets=[{**crooked.ROLLING, "north_m": 90_000.0}])  # fmt: skip
    found = rows(run(scene))
    least = 10.0 * math.log10(-math.log(1e-3) - 1.0)
    strength = [row["snr_db"] for row in found]
    assert len(found) > 300 and least <= min(strength) < least + 0.3
    names = ("confidence", "elevation_rad", "azimuth_rad", "range_m", "scan")
    measured = [[row[name] for row in found] for name in names]
    assert np.array_equal(np.lexsort(np.array(measured)), np.arange(len(found)))


@pytest.mark.parametrize("sweeps", [False, True])
def test_of_many_detections_only_neighbours_are_compared(monkeypatch, sweeps):
    """Three runs of four scans with 700 each: 490,000 pairs of two, and what all would say."""
    rng = np.random.default_rng(7)
    scans, each = 12, 700
    run, scan = np.repeat(np.arange(scans) // 4, each), np.repeat(np.arange(scans) % 4, each)
    azimuth, elevation = rng.uniform(-0.9, 0.9, len(scan)), rng.uniform(-0.4, 0.4, len(scan))
    some = np.flatnonzero(scan > 0)[::5]  # where somebody was one scan before, nearly
    azimuth[some], elevation[some] = azimuth[some - each] + 2e-3, elevation[some - each]
    range_m = rng.uniform(100.0, 3000.0, len(scan))
    range_m[some] = range_m[some - each]
    direction = np.column_stack([
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)
    ])  # fmt: skip
    time_s = scan / 20.0 + (rng.uniform(0.0, 0.05, len(scan)) if sweeps else 0.0)
    variance = rng.uniform(0.5, 1.0, len(scan)) * 1e-6
    places = SeenPlaces(
        run, scan, time_s, direction, range_m, variance,
        np.full(len(scan), 400.0),
    )  # fmt: skip
    asked = np.flatnonzero(scan >= 1)
    compared, near = [], declaration._is_same_place

    def counted(places, one, other, *rest):
        compared.append(len(one))
        return near(places, one, other, *rest)

    monkeypatch.setattr(declaration, "_is_same_place", counted)
    gates = {"speed_m_s": 100.0, "rate_rad_s": 0.02}
    found = count_scans_with_neighbour(places, asked, 4, **gates)
    few = sum(compared)
    compared.clear()
    monkeypatch.setattr(declaration, "_FEW_PAIRS", 10**12)
    assert np.array_equal(found, count_scans_with_neighbour(places, asked, 4, **gates))
    assert np.count_nonzero(found > 1) > 300
    assert sum(compared) == 3 * 6 * each**2 and few < 0.01 * sum(compared)
