"""Where the targets are seen, scan by scan, from a banked and moving ownship."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from pymap3d.vincenty import vdist
from wired import chain, rows, run, sensor

import dsa_des

RADAR = sensor("radar.range_boundary", scan_rate_hz=4)
FLIGHT = ("heading_deg", "speed_mps", "climb_mps", "yaw_deg", "pitch_deg", "roll_deg")

EARTHS = ["ellipsoid", "flat_earth", "geodesic", "local_radii", "daidalus_sphere"]


def seen(scene: dict, block: str = "radar") -> dict[tuple[str, int], dict]:
    return {(row["target"], row["scan"]): row for row in rows(run(scene), block=block)}


def assert_seen(found: dict, targets, *, ownship=None, scans: int, metres: float = 0.02) -> None:
    """All of it against pymap3d: the angle between directions, and the range."""
    assert len(found) == scans * len(targets)
    for target in targets:
        for scan in range(scans):
            row = found[target["name"], scan]
            true = crooked.body(target, row["time_s"], ownship)
            range_m = float(np.linalg.norm(true))
            assert row["true_range_m"] == pytest.approx(range_m, abs=metres)
            there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
            np.testing.assert_allclose(there, true / range_m, atol=metres / range_m + 1e-9)


@covers(*(f"ownship.{key}" for key in FLIGHT), "ownship.lat_deg", "ownship.lon_deg",
        "ownship.alt_m", *(f"intruders.{key}" for key in FLIGHT), "intruders.east_m",
        "intruders.north_m", "intruders.up_m", "intruders.name",
        of=("traffic.scripted",))  # fmt: skip
@pytest.mark.parametrize("turned", [0.0, 131.0])
def test_directions_and_ranges_over_three_seconds(turned):
    """Two ownships with headings and attitudes of their own: nothing is as good as constant."""
    own = {**crooked.OWNSHIP, "yaw_deg": 222.0 + turned, "roll_deg": -27.0 - 0.5 * turned}
    scene = chain({"radar": RADAR}, ownship=own, duration_s=3)
    assert_seen(seen(scene), crooked.TARGETS, ownship=own, scans=12)


@covers("intruders.lat_deg", "intruders.lon_deg", "intruders.alt_m", of=("traffic.scripted",))
def test_starts_by_latitude_longitude_and_altitude():
    """Across the antimeridian from the ownship."""
    place = {"lat_deg": -41.308, "lon_deg": 179.985, "alt_m": 2900.0}
    target = {**place, **{key: crooked.ROLLING[key] for key in (*FLIGHT, "name")}}
    assert_seen(seen(chain({"radar": RADAR}, targets=[target])), [target], scans=4)


@covers("duration_s", of=("[scene]",))
def test_a_run_lasts_as_long_as_it_says():
    found = seen(chain({"radar": RADAR}, duration_s=1.75))
    assert max(scan for _, scan in found) == 6


@covers("model", "attitude",
        of=("geometry.daidalus_sphere", "geometry.ellipsoid", "geometry.flat_earth",
            "geometry.geodesic", "geometry.local_radii"))  # fmt: skip
@pytest.mark.parametrize("earth", EARTHS)
@pytest.mark.parametrize("named", [False, True])
def test_models_of_the_earth(earth, named):
    """By type, or by `model` of another type; each with its own way of being wrong."""
    scene = chain({"radar": RADAR}, targets=[crooked.ROLLING])
    other = "flat_earth" if earth == "ellipsoid" else "ellipsoid"
    scene["blocks"]["transform"] = (
        {"type": f"geometry.{other}", "model": earth} if named else {"type": f"geometry.{earth}"}
    )
    row = seen(scene)["rolling", 0]
    lat, lon, alt = crooked.geodetic(crooked.position(crooked.ROLLING))
    own = crooked.OWNSHIP
    up = alt - own["alt_m"]
    dlat, dlon = lat - own["lat_deg"], (lon - own["lon_deg"] + 180.0) % 360.0 - 180.0
    if earth == "flat_earth":
        north, east = 111_195.0 * dlat, 111_195.0 * dlon * math.cos(math.radians(own["lat_deg"]))
    elif earth == "local_radii":
        sine2 = math.sin(math.radians(own["lat_deg"])) ** 2
        e2 = 0.0066943799901413165
        across = 6378137.0 / math.sqrt(1.0 - e2 * sine2)
        along = across * (1.0 - e2) / (1.0 - e2 * sine2)
        north = math.radians(dlat) * (along + own["alt_m"])
        east = math.radians(dlon) * (across + own["alt_m"]) * math.cos(math.radians(own["lat_deg"]))
    elif earth == "daidalus_sphere":
        radius = 60.0 * 180.0 / math.pi * 1852.0
        a, b, c = map(math.radians, (own["lat_deg"], lat, dlon))
        east = radius * math.cos(b) * math.sin(c)
        north = radius * (math.cos(a) * math.sin(b) - math.sin(a) * math.cos(b) * math.cos(c))
    elif earth == "geodesic":
        level_m, bearing_deg = vdist(own["lat_deg"], own["lon_deg"], lat, lon)
        north = float(level_m) * math.cos(math.radians(float(bearing_deg)))
        east = float(level_m) * math.sin(math.radians(float(bearing_deg)))
    else:
        north, east, down = crooked.ned(crooked.ROLLING)
        up = -down
    vector = crooked.attitude(own) @ np.array([north, east, -up])
    range_m = float(np.linalg.norm(vector))
    # The models of a flat Earth differ from each other by 5 cm and more.
    assert row["true_range_m"] == pytest.approx(range_m, abs=1e-3)
    there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
    np.testing.assert_allclose(there, vector / range_m, atol=1e-3 / range_m)


@pytest.mark.parametrize("earth", EARTHS)
def test_small_angles_are_subtracted_one_by_one(earth):
    scene = chain({"radar": RADAR})
    scene["blocks"]["transform"] = {"type": f"geometry.{earth}", "attitude": "small_angle"}
    found = seen(scene)
    own = crooked.OWNSHIP
    for target in crooked.TARGETS:
        azimuth, elevation = crooked.angles(crooked.ned(target))
        row = found[target["name"], 0]
        turned = azimuth - math.radians(own["yaw_deg"]) - row["true_azimuth_rad"]
        assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=4e-3)
        tilted = elevation - math.radians(own["pitch_deg"])
        assert row["true_elevation_rad"] == pytest.approx(tilted, abs=4e-3)


@covers("angle_deg", "range_m", of=("[accuracy]",))
@pytest.mark.parametrize(
    ("allowed", "earth"), [(None, "ellipsoid"), ({"angle_deg": 3.0, "range_m": 500.0}, "flat"),
                           ({"angle_deg": 3.0, "range_m": 1e-6}, "ellipsoid"),
                           ({"angle_deg": 1e-7, "range_m": 500.0}, "ellipsoid")]
)  # fmt: skip
def test_allowed_errors_choose_the_model(allowed, earth):
    """Both have to be large for the crude model of the Earth, which then errs within them."""
    radar = sensor("radar.range_boundary", range_km=4.0)
    sections = {} if allowed is None else {"accuracy": allowed}
    scene = chain({"radar": radar}, targets=[crooked.ROLLING], **sections)
    scene["blocks"]["transform"] = {"type": "geometry.ellipsoid", "model": "auto"}
    row = seen(scene)["rolling", 0]
    true = crooked.body(crooked.ROLLING)
    range_m = float(np.linalg.norm(true))
    error_m = abs(row["true_range_m"] - range_m)
    if earth == "ellipsoid":
        assert error_m < 1e-6
    else:
        assert 0.1 < error_m < 500.0
        there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
        assert math.acos(float(there @ true) / range_m) < math.radians(3.0)


def test_a_range_rate_is_that_of_the_two_flights():
    """Closing speed along the line of sight, from ranges half a second apart."""
    found = seen(chain({"radar": RADAR}, duration_s=2))
    for target in crooked.TARGETS:
        before, after = (found[target["name"], scan]["true_range_m"] for scan in (3, 5))
        line = crooked.ned(target, 1.0)
        step = crooked.ned(target, 1.01) - crooked.ned(target, 0.99)
        expected = float(line @ step) / float(np.linalg.norm(line)) / 0.02
        assert (after - before) / 0.5 == pytest.approx(expected, abs=0.05)
        assert abs(expected) > 10.0


def test_scenes_are_read_from_tables_as_from_files(tmp_path):
    scene = chain({"radar": RADAR})
    path = tmp_path / "scene.toml"
    path.write_text(dsa_des.run(scene).scene, encoding="utf-8")
    again = dsa_des.run(path)
    assert again.detections.equals(dsa_des.run(scene).detections)
