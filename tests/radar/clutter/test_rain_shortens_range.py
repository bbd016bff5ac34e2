"""What air, rain and fog do to a radar's detection range, from scene to first detection."""

import pytest

from components.atmosphere.slant_path import attenuated_range_m
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
duration_s = 90
wires = ["traffic -> transform -> radar"]
[weather]
{weather}
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.threshold"
scan_rate_hz = 5
power_w = 2.5
antenna_gain_db = 29.5
frequency_hz = 35e9
false_alarm_probability = 0.01
polarisation = "{polarisation}"
calibrate = {{ rcs_dbsm = 3.01, range_km = 6.5, pd = 0.9 }}
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52.0, lon_deg = 4.4, alt_m = 300, heading_deg = 0, speed_mps = 50 }}
[[blocks.traffic.intruders]]
name = "head_on"
east_m = 0
north_m = 7000
up_m = 0
heading_deg = 180
speed_mps = 50
"""
STEP_M = 20.0  # closing at 100 m/s, 5 scans a second


def first_range_m(tmp_path, weather="", polarisation="circular"):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(weather=weather, polarisation=polarisation), encoding="utf-8")
    memory = MemorySink()
    Simulation(load_scene(path), recorder=Recorder([memory])).run()
    return memory.tables()["detections"]["true_range_m"].to_pylist()[0]


# Weather; one-way dB/km at 35 GHz (errata, ITU-R P.838-3, P.840-8, P.676-12); range in km.
CASES = [
    ("", 0.0, 6.5),
    ("rain_rate_mm_h = 5", 1.38, 3.5),
    ("rain_rate_mm_h = 25", 5.81, 1.9),
    ("fog_water_g_m3 = 0.5", 0.40, 5.1),
    ("gas = true", 0.097, 6.0),
]


@pytest.mark.parametrize(("weather", "attenuation_db_km", "range_km"), CASES)
def test_weather_brings_a_range_of_6500_m_down(tmp_path, weather, attenuation_db_km, range_km):
    """Within a scan of Lambert's function at the tables' attenuation, and as the issue says."""
    found = first_range_m(tmp_path, weather)
    formula = attenuated_range_m(6500.0, attenuation_db_km)
    assert formula - STEP_M - 0.01 * formula < found < 1.01 * formula
    assert found / 1000 == pytest.approx(range_km, abs=0.2)


def test_more_rain_less_range_and_polarisation_matters(tmp_path):
    ranges = [first_range_m(tmp_path, f"rain_rate_mm_h = {rate}") for rate in (0, 1, 5, 25, 100)]
    assert ranges == sorted(ranges, reverse=True) and len(set(ranges)) == 5
    rain = "rain_rate_mm_h = 25"
    flat, upright = (first_range_m(tmp_path, rain, p) for p in ("horizontal", "vertical"))
    assert flat < ranges[3] < upright


def test_rain_ends_at_its_upper_edge(tmp_path):
    """An ownship at 300 m above rain that ends at 200 m sees as far as in clear air."""
    above = first_range_m(tmp_path, "rain_rate_mm_h = 25\nrain_top_m = 200")
    assert above == first_range_m(tmp_path)
