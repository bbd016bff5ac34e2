"""Traffic read from files: units, reference point, who is the ownship, who is what."""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from wired import chain, rows, run, sensor

RADAR = sensor("radar.range_boundary", scan_rate_hz=2)
FOOT_M, KNOT_MPS = 0.3048, 1852 / 3600
TIMES = (0.0, 1.0, 2.0)


def seen(traffic: dict, duration_s: float = 2) -> dict[tuple[str, float], dict]:
    scene = chain({"radar": RADAR}, duration_s=duration_s)
    scene["blocks"]["traffic"] = traffic
    return {(row["target"], row["time_s"]): row for row in rows(run(scene))}


def csv(path, order=("own", "rolling", "diving")):
    """The crooked flights as samples, each with its attitude, across the antimeridian."""
    flights = {"own": crooked.OWNSHIP, "rolling": crooked.ROLLING, "diving": crooked.DIVING}
    lines = ["time_s,id,lat_deg,lon_deg,altitude_ft,heading_deg,pitch_deg,roll_deg"]
    for time in TIMES:
        for name in order:
            flight = flights[name]
            lat, lon, alt = crooked.geodetic(crooked.position(flight, time))
            angles = ",".join(str(flight[f"{key}_deg"]) for key in ("yaw", "pitch", "roll"))
            lines.append(f"{100 + time},{name},{lat!r},{lon!r},{alt / FOOT_M!r},{angles}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def assert_crooked(found: dict, times=(0.0, 1.0)) -> None:
    for target in crooked.TARGETS:
        for time in times:
            row = found[target["name"], time]
            vector = crooked.body(target, time)
            range_m = float(np.linalg.norm(vector))
            assert row["true_range_m"] == pytest.approx(range_m, abs=0.02)
            there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
            np.testing.assert_allclose(there, vector / range_m, atol=2e-5)


@covers("file", of=("traffic.csv",))
def test_a_csv_file_is_flown(tmp_path):
    assert_crooked(seen({"type": "traffic.csv", "file": csv(tmp_path / "flights.csv")}))


@covers("ownship", of=("traffic.csv",))
def test_the_ownship_is_the_first_named_or_the_one_told(tmp_path):
    other = csv(tmp_path / "flights.csv", ("diving", "own", "rolling"))
    first = seen({"type": "traffic.csv", "file": other})
    assert {name for name, _ in first} == {"own", "rolling"}
    assert_crooked(seen({"type": "traffic.csv", "file": other, "ownship": "own"}))


@covers("altitude", of=("traffic.csv",))
@pytest.mark.parametrize(("altitude", "apart_m"), [(None, 400), ("barometric", 100)])
def test_one_of_two_altitudes_is_flown(altitude, apart_m, tmp_path):
    path = tmp_path / "two.csv"
    path.write_text(
        "time,id,lat,lon,baro_altitude,geo_altitude\n0,own,0,0,1000,1000\n2,own,0,0,1000,1000\n"
        "0,other,0,0.0001,1100,1400\n2,other,0,0.0001,1100,1400\n"
    )
    traffic = {"type": "traffic.csv", "file": str(path)}
    found = seen(traffic if altitude is None else traffic | {"altitude": altitude})
    range_m = math.hypot(apart_m, 6_378_137 * math.radians(0.0001))
    assert found["other", 0.0]["true_range_m"] == pytest.approx(range_m, abs=0.01)


@covers("update_rate_hz", of=("traffic.csv", "traffic.daa_file"))
@pytest.mark.parametrize("kind", ["traffic.csv", "traffic.daa_file"])
def test_positions_are_held_between_updates(kind, tmp_path):
    file = csv(tmp_path / "f.csv") if kind == "traffic.csv" else daa(tmp_path / "f.daa")
    found = seen({"type": kind, "file": file, "update_rate_hz": 1})
    moving = seen({"type": kind, "file": file})
    for (name, time), row in found.items():
        assert row["true_range_m"] == moving[name, math.floor(time)]["true_range_m"]
    assert moving["rolling", 0.5]["true_range_m"] != moving["rolling", 0.0]["true_range_m"]


def daa(path) -> str:
    """Positions with feet, track, knots and feet per minute."""
    flights = {"own": crooked.OWNSHIP, "rolling": crooked.ROLLING, "diving": crooked.DIVING}
    lines = ["NAME lat lon alt trk gs vs time", "[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]"]
    for time in TIMES:
        for name, flight in flights.items():
            lat, lon, alt = crooked.geodetic(crooked.position(flight, time))
            gs, vs = flight["speed_mps"] / KNOT_MPS, flight["climb_mps"] * 60 / FOOT_M
            lines.append(
                f"{name}, {lat!r}, {lon!r}, {alt / FOOT_M!r}, {flight['heading_deg']}, {gs!r}, "
                f"{vs!r}, {time}"
            )
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


@covers("file", of=("traffic.daa_file",))
def test_a_daa_file_is_flown(tmp_path):
    """It has no attitudes: the ownship points along its path."""
    found = seen({"type": "traffic.daa_file", "file": daa(tmp_path / "flights.daa")})
    own = crooked.OWNSHIP
    pitch = math.degrees(math.atan2(own["climb_mps"], own["speed_mps"]))
    turned = crooked.rotation(own["heading_deg"], pitch, 0.0)
    for target in crooked.TARGETS:
        for time in (0.0, 0.5, 1.0, 1.5):
            vector = crooked.ned(target, time)
            row = found[target["name"], time]
            assert row["true_range_m"] == pytest.approx(float(np.linalg.norm(vector)), abs=0.05)
            there = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
            np.testing.assert_allclose(there, turned @ vector / np.linalg.norm(vector), atol=5e-4)


@covers("reference_lat_deg", "reference_lon_deg", "reference_alt_m", of=("traffic.daa_file",))
def test_an_xyz_file_is_put_at_its_reference_point(tmp_path):
    """East, north, and altitude above it; the ownship's reports say where that is."""
    lines = ["NAME sx sy sz time", "[none] [m] [m] [m] [s]"]
    for time in TIMES:
        lines += [f"own 300 -200 {50 + time} {time}", f"one -900 700 {150 + time} {time}"]
    path = tmp_path / "flights.xyz"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    reference = {
        "reference_lat_deg": -41.3, "reference_lon_deg": 179.999, "reference_alt_m": 1700.0,
    }  # fmt: skip
    scene = chain({"radar": RADAR}, navigation={"position_bias_m": [0, 0, 1e-6]})
    scene["blocks"]["traffic"] = {"type": "traffic.daa_file", "file": str(path), **reference}
    row = rows(run(scene))[0]
    assert row["true_range_m"] == pytest.approx(math.hypot(1200, 900, 100), abs=0.02)
    place = row["own_lat_deg"], row["own_lon_deg"], row["own_alt_m"]
    offset = pymap3d.geodetic2enu(*place, -41.3, 179.999, 1700.0)
    np.testing.assert_allclose(offset[:2], [300, -200], atol=1e-3)
    assert place[2] == pytest.approx(1750, abs=1e-5)
