"""Rain and fog within moving circles: chords by hand, what planning leaves out, and changes.

Two aircraft fly north side by side, level, 8 km apart; cells cross the way between them.
"""

import math

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window
from scipy.stats import norm
from wired import HEARS_ALL, SEES_ALL, SENSORS, chain, rows, run, sensor

import dsa_des
from components.atmosphere.attenuation import rain_coefficients
from components.environment.weather_cells import disc_entry_and_exit_shares
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation

LAT, LON, ALT_M, SPEED_MPS, APART_M = 52.0, 4.0, 1000.0, 50.0, 8000.0
OWN = {"lat_deg": LAT, "lon_deg": LON, "alt_m": ALT_M, "heading_deg": 0, "speed_mps": SPEED_MPS}
BESIDE = {"name": "beside", "east_m": APART_M, "north_m": 0, "up_m": 0, "heading_deg": 0,
          "speed_mps": SPEED_MPS, "rcs_dbsm": 0}  # fmt: skip
RADIUS_M, RATE_MM_H, MOVES_MPS = 1500.0, 20.0, 70.0
SLOW = {"scan_rate_hz": 0.2}
#: One shot at the whole of a target 8 km away, whose echo is a few times the noise.
LASER = {"pattern": "one_shot", "peak_power_w": 2e5, "range_km": 10.0, "azimuth_deg": [-180, 180],
         "divergence_mrad": 0.1, "noise_equivalent_power_w": 8e-8, "aperture_mm": 100.0,
         "azimuth_shots": 10, "elevation_shots": 10}  # fmt: skip
EYE = {
    "between_scans": "as_at_scan",
    "azimuth_deg": [-170, 170],
    "smallest_arcmin": 0,
    "beta_per_sr_s": 1e5,
}


def metres_per_deg(lat_deg=LAT, alt_m=ALT_M):
    """Metres of a degree of latitude and of longitude, by the ellipsoid's two radii."""
    a, e2, sine = 6378137.0, 0.00669437999014, math.sin(math.radians(lat_deg))
    w2 = 1.0 - e2 * sine**2
    north = a * (1.0 - e2) / w2**1.5 + alt_m
    east = (a / math.sqrt(w2) + alt_m) * math.cos(math.radians(lat_deg))
    return math.radians(1.0) * north, math.radians(1.0) * east


def cell(north_m, east_m, **keys):
    north, east = metres_per_deg()
    return {"lat_deg": LAT + north_m / north, "lon_deg": LON + east_m / east,
            "radius_km": RADIUS_M / 1000.0, "rain_rate_mm_h": RATE_MM_H, **keys}  # fmt: skip


def scene(sensors, *cells, duration_s=60, **sections):
    weather = {"cells": list(cells), **sections.pop("weather", {})}
    sections = (
        {**sections, "weather": weather} if weather["cells"] or len(weather) > 1 else sections
    )
    return chain(sensors, ownship=OWN, targets=[BESIDE], duration_s=duration_s, **sections)


def by_time(made, column):
    return {row["time_s"]: row[column] for row in rows(run(made), "looks")}


def chord_m(time_s, north_m, east_m, moves=(0.0, 0.0)):
    """How much of the way east lies in a circle that moves, by Pythagoras."""
    off = north_m + moves[0] * time_s - SPEED_MPS * time_s
    off += east_m**2 * math.tan(math.radians(LAT)) / (2.0 * 6.38e6)  # a parallel bends northward
    half = math.sqrt(max(RADIUS_M**2 - off**2, 0.0))
    middle = east_m + moves[1] * time_s
    return max(0.0, min(middle + half, APART_M) - max(middle - half, 0.0))


#: Marshall and Palmer's drops, π N0 Λ⁻³ with Λ = 4.1 R^-0.21 per mm.
RAIN_PER_M = math.pi * 8e-3 / 4.1**3 * RATE_MM_H**0.63
TOWARDS = math.radians(60.0)
MOVES = MOVES_MPS * math.cos(TOWARDS), MOVES_MPS * math.sin(TOWARDS)


@covers(
    *(f"cells.{key}" for key in ("lat_deg", "lon_deg", "radius_km", "speed_mps", "towards_deg")),
    "cells",
    "cells.rain_rate_mm_h",
    of=("[weather]",),
)
def test_a_radar_loses_what_the_chord_through_a_moving_circle_takes():
    dry = by_time(scene({"radar": {**HEARS_ALL, **SLOW}}), "snr_db")
    moving = cell(1700.0, 500.0, speed_mps=MOVES_MPS, towards_deg=60.0)
    wet = by_time(scene({"radar": {**HEARS_ALL, **SLOW}}, moving), "snr_db")
    level = rain_coefficients(35e9).specific_attenuation_db_km(np.array([RATE_MM_H]), np.zeros(1))
    chords = {t: chord_m(t, 1700.0, 500.0, MOVES) for t in dry}
    assert sum(0.0 < chord < 2.0 * RADIUS_M for chord in chords.values()) > 5
    for time_s, chord in chords.items():
        # Meridians meet: in a minute the way between them is five metres shorter.
        lost = dry[time_s] - wet[time_s]
        assert lost == pytest.approx(2.0 * float(level[0]) * chord / 1000.0, abs=0.1)
    assert min(chords.values()) == 0.0 and max(chords.values()) > 2000.0


@pytest.mark.parametrize(
    ("kind", "keys", "weather", "per_m"),
    [
        ("optical.eo", {}, {}, RAIN_PER_M),
        ("optical.eo", {}, {"rain_rate_mm_h": 0.0, "fog_water_g_m3": 0.01},
         3.912 / (1002.0 * (0.01 * 200.0) ** -0.6473)),
        ("optical.ir", {"extinction_band": "lwir"},
         {}, RAIN_PER_M),
    ],
)  # fmt: skip
@covers("cells.fog_water_g_m3", of=("[weather]",))
def test_a_camera_loses_contrast_over_the_chord(kind, keys, weather, per_m):
    camera = {**SEES_ALL, **keys, "type": kind, **SLOW}
    high = {"fog_top_m": 9000.0}
    dry = by_time(scene({"camera": camera}, weather=high), "confidence")
    wet = by_time(
        scene({"camera": camera}, cell(1030.0, 4000.0, **weather), weather=high), "confidence"
    )
    for time_s, before in dry.items():
        kept = (wet[time_s] - 1.0) / (before - 1.0)  # what is above a threshold of -1
        assert kept == pytest.approx(math.exp(-per_m * chord_m(time_s, 1030.0, 4000.0)), abs=6e-3)


@pytest.mark.parametrize("kind", ["laser.scanning", "visual.acquisition", "integral"])
def test_a_laser_and_an_eye_lose_light_over_the_chord(kind):
    keys = {"laser.scanning": LASER, "visual.acquisition": EYE}
    keys["integral"] = {**EYE, "between_scans": "integral"}
    name = kind if kind in SENSORS else "visual.acquisition"
    made = {"sensor": sensor(name, **{**keys[kind], **SLOW})}
    dry = by_time(scene(made), "detection_probability")
    drizzle = cell(1030.0, 4000.0, rain_rate_mm_h=0.4)
    wet = by_time(scene(made, drizzle), "detection_probability")
    assert verdicts(scene(made, drizzle))[0].simulated
    per_m = RAIN_PER_M * (0.4 / RATE_MM_H) ** 0.63

    def left(time_s, ways=1.0):
        return math.exp(-ways * per_m * chord_m(time_s, 1030.0, 4000.0))

    for time_s, before in dry.items():
        if kind == "laser.scanning":  # a threshold of 6 deviations of the noise, there and back
            kept = (6.0 - norm.isf(wet[time_s])) / (6.0 - norm.isf(before))
            assert kept == pytest.approx(left(time_s, 2.0), abs=0.01)
        elif time_s:  # of a search that began with the run
            kept = math.log1p(-wet[time_s]) / math.log1p(-before)
            over_s = [0.0] if kind in SENSORS else np.linspace(-4.95, -0.05, 50)
            want = np.mean([left(time_s + ahead_s) for ahead_s in over_s])
            assert kept == pytest.approx(want, abs=6e-3)


@pytest.mark.parametrize(
    "kind", ["radar.swerling", "optical.ir", "laser.scanning", "visual.acquisition"]
)
def test_a_cell_that_holds_everything_is_weather_everywhere(kind):
    radar = {"range_cell_m": 90.0, "azimuth_beamwidth_deg": 6.0, "elevation_beamwidth_deg": 4.0,
             "frequency_hz": 9.4e9, "power_w": 1e5, "swerling": 1}  # fmt: skip
    keys = {"radar.swerling": radar, "laser.scanning": LASER, "visual.acquisition": EYE}
    made = {"sensor": sensor(kind, **keys.get(kind, {}))}
    rain = {"rain_rate_mm_h": 15.0, "fog_water_g_m3": 0.02}
    if kind in ("laser.scanning", "visual.acquisition"):  # whose light is gone in more
        rain = {"rain_rate_mm_h": 0.03, "fog_water_g_m3": 1e-5}
    tops = {"rain_top_m": 9000.0, "fog_top_m": 9000.0}
    everywhere = run(scene(made, weather={**rain, **tops}, duration_s=3))["looks"]
    within = run(scene(made, cell(0, 0, radius_km=500.0, **rain), weather=tops, duration_s=3))[
        "looks"
    ]
    names = {"radar.swerling": ["snr_db", "detection_probability"], "optical.ir": ["confidence"]}
    for name in names.get(kind, ["detection_probability"]):
        want = everywhere[name].to_numpy()
        assert np.isfinite(want).all() and (want != 0.0).any()
        assert within[name].to_numpy() == pytest.approx(want, rel=1e-9)


def verdicts(made):
    plan = Simulation(dsa_des.load_scene(made)).plan
    return [one.verdict for one in plan if one.effect.name == "weather cells"]


def test_no_cell_near_any_line_of_sight_costs_nothing():
    both = {"radar": HEARS_ALL, "camera": SEES_ALL}
    far = scene(both, cell(-40e3, 0.0), cell(60e3, 0.0, speed_mps=20.0), duration_s=20)
    found, same = verdicts(far)
    assert not found.simulated and same.because == found.because
    # 40 km, less its radius, the range to the target and a margin of 1 %.
    assert found.because.startswith("no cell comes near any line of sight: the nearest stays 30.")
    planned = run(far)
    everything = dsa_des.run({**far, "record": {"looks": True}}, simulate_everything=True)
    assert planned["looks"].equals(everything["looks"])
    near = scene(
        both, cell(-40e3, 0.0), cell(60e3, 0.0, speed_mps=150.0, towards_deg=180.0), duration_s=400
    )
    for found in verdicts(near):
        assert (found.simulated, found.because) == (
            True,
            "[weather] cells 1 may meet lines of sight",
        )


def test_cells_that_change_and_move_give_the_same_bytes_in_any_window_and_beside_others():
    begins = {"at_s": 6, "set": {"weather.cells": [cell(500.0, 3000.0, speed_mps=30.0)]}}
    made = scene({"radar": {**HEARS_ALL, "scan_rate_hz": 2}}, cell(0.0, 2e3), cell(0.0, 6e3),
                 duration_s=20, changes=[begins], record={"looks": True})  # fmt: skip
    loaded = dsa_des.load_scene(made)
    same_in_any_window(loaded, windows=(1, 5))
    farther = {"blocks.traffic.intruders[0].east_m": 9000.0}
    same_as_alone(replicas_of(loaded, {}, farther), window=7)
    snr = by_time(made, "snr_db")
    dry = by_time(scene({"radar": {**HEARS_ALL, "scan_rate_hz": 2}}, duration_s=20), "snr_db")
    level = rain_coefficients(35e9).specific_attenuation_db_km(np.array([RATE_MM_H]), np.zeros(1))
    for time_s in (0.0, 5.5, 6.0, 19.5):
        if time_s < 6.0:
            chord = chord_m(time_s, 0.0, 2e3) + chord_m(time_s, 0.0, 6e3)
        else:
            chord = chord_m(time_s, 500.0, 3e3, (30.0, 0.0))
        lost = 2.0 * float(level[0]) * chord / 1000.0
        assert dry[time_s] - snr[time_s] == pytest.approx(lost, abs=0.06)


def test_a_path_straight_up_lies_in_a_circle_or_not():
    none = np.zeros(2)
    within = disc_entry_and_exit_shares(none, none, np.array([50.0, 150.0]), none, 100.0)
    assert [each.tolist() for each in within] == [[0.0, 0.0], [1.0, 0.0]]


def test_wrong_cells_are_said():
    for keys, said in (
        ({"rain_rate_mm_h": 0}, "a cell has rain_rate_mm_h, fog_water_g_m3 or both"),
        ({"radius_km": 0}, "radius_km"),
        ({"rain": 3}, "allowed: fog_water_g_m3"),
    ):
        with pytest.raises(SceneError, match="cells") as wrong:
            dsa_des.load_scene(scene({"radar": HEARS_ALL}, cell(0, 0, **keys)))
        assert said in str(wrong.value)
