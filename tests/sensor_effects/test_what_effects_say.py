"""Every effect says in one sentence whether it is simulated, and why: each sentence as a whole."""

import pytest
from wired import chain

import dsa_des
from dsa_des.running.simulation import Simulation

RADAR = {
    "type": "radar.swerling", "scan_rate_hz": 1, "power_w": 100.0, "antenna_gain_db": 30.0,
    "frequency_hz": 35e9, "bandwidth_hz": 1e5, "false_alarm_probability": 1e-6, "range_km": 10.0,
    "azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 50.0,
}  # fmt: skip
CAMERA = {"type": "optical.ir", "scan_rate_hz": 1, "azimuth_pixels": 640, "elevation_pixels": 480}
OF_ALL = """
weather cells: not simulated, [weather] has no cells
cues: not simulated, no wire brings cues
mounting: not simulated, it looks along the nose and misalignment_deg is 0
glint: not simulated, errors is 'grid'
measurement errors: not simulated, errors is 'grid': values are rounded to the grid
declaration: not simulated, declare_m and declare_n are not given
declaration by place: not simulated, declare_m and declare_n are not given
navigation: not simulated, [navigation] has no bias and no noise
"""
OF_RADARS = """
range rate: not simulated, measures_range_rate is false
RCS fluctuation: simulated, target 'rolling' has swerling 1 (and 1 more like it)
lasting fluctuation: not simulated, fluctuation_correlation_s and scintillation_extent_m are not \
given
exact Pd: simulated, with 1 pulse and Swerling I or II it is a closed form
aspect RCS: not simulated, no target has an rcs_table
gas attenuation: not simulated, [weather] gas is false
rain: not simulated, [weather] rain_rate_mm_h is 0
fog: not simulated, [weather] fog_water_g_m3 is 0
blind range: not simulated, minimum_range_m is not given
eclipsing: not simulated, pulse_width_s is not given
range folding: not simulated, range_folds is false
beam shape: not simulated, beam_shape_loss is false
ground clutter: not simulated, [terrain] height_m is not given
folded clutter: not simulated, range_folds is false
multipath: not simulated, [terrain] height_m is not given
rain echo: not simulated, [weather] rain_rate_mm_h is 0
sidelobe clutter: not simulated, sidelobe_level_db is not given
moving target filter: not simulated, moving_target_filter is 'none'
CFAR: not simulated, cfar_reference_cells is not given
resolution cells: not simulated, resolution_cells is false
measured strength: simulated, a radar measures strength as it measures places
false alarms: not simulated, false_alarms is false
clutter false alarms: not simulated, false_alarms is false
time budget: not simulated, beams and dwell are not given, a scan takes no time
beam sweep: not simulated, beam_sweep is false
own velocity: not simulated, measures_range_rate is false
"""
OF_CAMERAS = """
plume: not simulated, plume is false
extinction in the band: not simulated, extinction_band is 'visible'
dynamic signature: not simulated, dynamic_weight is 0
visibility: not simulated, [weather] has no visibility_km, no rain and no fog
false alarms: not simulated, neither false_alarms nor false_alarms_per_frame is given
"""
RAIN = {"weather": {"rain_rate_mm_h": 4.0, "fog_water_g_m3": 0.05, "gas": True}}
STATED = {"errors": "stated", "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5,
          "range_error_m": 20.0, "quantised": False}  # fmt: skip
#: What differs from the sensor above, other sections, and what is said otherwise.
SAID = {
    "radar": (RADAR, {}, {}, ""),
    "off": (RADAR, {"enabled": False, "false_alarms": True, "aspect_rcs": False}, {}, """
aspect RCS: not simulated, aspect_rcs is false
measured strength: not simulated, enabled is false
false alarms: not simulated, enabled is false
clutter false alarms: not simulated, enabled is false
"""),
    "keys": (RADAR, {
        "swerling": 1, "fluctuation_correlation_s": 3.0, "scintillation_extent_m": 10.0,
        "resolution_cells": True, "minimum_range_m": 150.0, "mount_azimuth_deg": 5.0,
        "mount_elevation_deg": -2.0, "misalignment_deg": [0.1, 0.0, -0.2], "declare_m": 2,
        "sidelobe_level_db": -30.0, "declare_n": 3, "false_alarms": True,
    }, {}, """
RCS fluctuation: simulated, swerling is 1
lasting fluctuation: simulated, fluctuation_correlation_s is 3: the power of looks 1.5 s apart is \
correlated with 0.368; scintillation_extent_m is 10: aspects 0.025 deg apart fade each by itself
exact Pd: simulated, detection is 'exact'
blind range: simulated, minimum_range_m is 150
sidelobe clutter: not simulated, there is neither [terrain] height_m nor rain
resolution cells: simulated, resolution_cells is true
false alarms: simulated, false_alarms is true
clutter false alarms: not simulated, [terrain] height_m is not given, and rain has no echo
mounting: simulated, mount_azimuth_deg is 5 and mount_elevation_deg is -2 and \
misalignment_deg is [0.1, 0.0, -0.2]
declaration: not simulated, places are declared, not targets
declaration by place: simulated, the sensor has false alarms, and declare_by is not 'target'
"""),
    "ground": (RADAR, {
        "false_alarms": True, "clutter_threshold": "noise", "sidelobe_level_db": -30.0,
        "declare_by": "place", "declare_m": 2, "declare_n": 3, "declare_speed_m_s": 100.0,
    }, {"terrain": {"height_m": -250.0}, "weather": {"rain_rate_mm_h": 0.5}}, """
multipath: not simulated, [terrain] roughness_m is not given
rain: simulated, [weather] rain_rate_mm_h is 0.5
ground clutter: simulated, [terrain] height_m is -250
rain echo: simulated, [weather] rain_rate_mm_h is 0.5
sidelobe clutter: simulated, sidelobe_level_db is -30
false alarms: simulated, false_alarms is true
clutter false alarms: simulated, clutter_threshold is 'noise'
declaration: not simulated, places are declared, not targets
declaration by place: simulated, declare_by is 'place'
"""),
    "adaptive": (RADAR, {"false_alarms": True, "swerling": 0, "declare_m": 3,
                          "declare_n": 5, "declare_by": "target"} | STATED, RAIN, """
RCS fluctuation: not simulated, swerling is 0
exact Pd: simulated, detection is 'exact'
gas attenuation: simulated, [weather] gas is true
rain: simulated, [weather] rain_rate_mm_h is 4
fog: simulated, [weather] fog_water_g_m3 is 0.05
rain echo: simulated, [weather] rain_rate_mm_h is 4
resolution cells: simulated, errors is 'stated', and resolution_cells not false
false alarms: simulated, false_alarms is true
clutter false alarms: not simulated, clutter_threshold is 'adaptive': they are as many as of noise
glint: not simulated, errors is 'stated'
measurement errors: simulated, errors is 'stated'
declaration: simulated, declare_m is 3 and declare_n is 5
declaration by place: not simulated, declare_by is 'target'
"""),
    "camera": (CAMERA, {}, {}, ""),
    "plume": (CAMERA, {
        "plume": True, "extinction_band": "lwir", "dynamic_weight": 0.5,
        "false_alarms_per_frame": 0.25,
    }, RAIN, """
plume: not simulated, plume is true, but no target's engine has one
extinction in the band: simulated, extinction_band is 'lwir'
dynamic signature: simulated, dynamic_weight is 0.5
visibility: not simulated, extinction_band is 'lwir': the air takes what it takes there
false alarms: simulated, false_alarms_per_frame is 0.25
"""),
    "fog": (CAMERA, {"false_alarms_per_frame": 0.0, "enabled": False}, RAIN, """
visibility: simulated, [weather] rain_rate_mm_h is 4 and fog_water_g_m3 is 0.05
false alarms: not simulated, enabled is false
"""),
    "seen": (CAMERA, {"false_alarms_per_frame": 0.0}, {
        "weather": {"visibility_km": 12.5, "rain_rate_mm_h": 4.0},
        "navigation": {"attitude_noise_deg": [0.1, 0.2, 0.3], "attitude_bias_deg": [0.0, 1.0, 0.0]},
    }, """
visibility: simulated, [weather] visibility_km is 12.5
navigation: simulated, [navigation] attitude_bias_deg is [0.0, 1.0, 0.0] and attitude_noise_deg is \
[0.1, 0.2, 0.3]
false alarms: not simulated, false_alarms_per_frame is 0
"""),
}  # fmt: skip


def sentences(text: str) -> dict[str, str]:
    return dict(line.split(": ", 1) for line in text.splitlines() if line)


@pytest.mark.parametrize("name", SAID)
def test_effects_say_whether_and_why_they_are_simulated(name: str) -> None:
    block, keys, sections, said = SAID[name]
    scene = chain({"s": {**block, **keys}}, **sections)
    planned = Simulation(dsa_des.load_scene(scene)).plans[0]
    found = dict(p.sentence().split(": ", 1) for p in planned if p.block == "s")
    known = sentences(OF_ALL + (OF_RADARS if block is RADAR else OF_CAMERAS))
    assert found == known | sentences(said)
