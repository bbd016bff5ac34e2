"""A key that changes nothing is warned of by its name, and all that keys disagree about is said."""

import pytest
from test_avoidance_by_bands import scene as by_bands
from wired import HEARS_ALL, chain, run, sensor

import dsa_des
from dsa_des.errors import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

STATED = {"errors": "stated", "azimuth_error_deg": 1.0}
FADING = {"type": "radar.swerling", "power_w": 1e9, "threshold_db": None}


def told(table=None, **sections):
    scene = chain({"s": table or sensor("radar.range_boundary")}, **sections)
    scene["blocks"]["s"] = {k: v for k, v in scene["blocks"]["s"].items() if v is not None}
    found = notes_of_scene(Simulation(dsa_des.load_scene(scene)))
    return [line for line in found if "it has no effect" in line]


def radar(**keys):
    return {**HEARS_ALL, **keys}


def eye(**keys):
    return sensor("optical.eo", **keys)


@pytest.mark.parametrize(
    ("table", "sections", "key", "because"),
    [
        (None, {"weather": {"wind_from_deg": 305.0}}, "weather: wind_from_deg is 305", "wind_mps"),
        (None, {"weather": {"rain_top_m": 900.0}}, "weather: rain_top_m is 900", "rain_rate_mm_h"),
        (None, {"weather": {"fog_top_m": 900.0}}, "weather: fog_top_m is 900", "fog_water_g_m3"),
        (None, {"terrain": {"raster_offset_m": 12.5}}, "terrain: raster_offset_m is 12.5",
         "raster is not given"),
        (None, {"terrain": {"clutter_mean": "constant"}}, "terrain: clutter_mean is 'constant'",
         "height_m is not given"),
        (radar(quantised=False), {}, "quantised is false", "errors is 'grid'"),
        (radar(biases="fixed"), {}, "biases is 'fixed'", "errors is 'grid'"),
        (radar(**STATED, biases="fixed"), {}, "biases is 'fixed'", "none of azimuth_bias_deg"),
        (radar(filter_pulses=8), {}, "filter_pulses is 8", "moving_target_filter is 'none'"),
        (radar(moving_target_filter="double_canceller", prf_hz=9e3, filter_pulses=8), {},
         "filter_pulses is 8", "moving_target_filter is 'double_canceller'"),
        (radar(clutter_lock=False), {}, "clutter_lock is false", "moving_target_filter is 'none'"),
        (radar(angle_measurement="scan"), {}, "angle_measurement is 'scan'", "errors is 'grid'"),
        (radar(integration="noncoherent"), {}, "integration is 'noncoherent'",
         "budget is not given"),
        (radar(beam_spacing=0.8), {}, "beam_spacing is 0.8", "azimuth_beamwidth_deg is not given"),
        (radar(declare_by="place"), {}, "declare_by is 'place'", "declare_m is not given"),
        (radar(declare_m=1, declare_n=2, declare_speed_m_s=9.0), {}, "declare_speed_m_s is 9",
         "declare_by"),
        (radar(**FADING, swerling=0, fluctuation_correlation_s=2.0), {},
         "fluctuation_correlation_s is 2", "swerling is 0"),
        (sensor("radar.range_boundary", rain_rejection_db=9.0), {}, "rain_rejection_db is 9",
         "polarisation is 'slant'"),
        (eye(blur_pixels=0.7), {}, "blur_pixels is 0.7", "there is no noise"),
        (eye(marked_false_alarms=True), {}, "marked_false_alarms is true",
         "no false alarms are reported"),
        (eye(rate="thesis"), {}, "rate is 'thesis'", "dynamic_weight is 0"),
        (eye(sun_elevation_deg=10.0), {}, "sun_elevation_deg is 10", "background is 'none'"),
    ],
)  # fmt: skip
def test_a_key_that_changes_nothing_is_warned_of(table, sections, key, because):
    (line,) = told(table, **sections)
    assert key in line and because in line
    assert sections or line.startswith("blocks.s: ")


@pytest.mark.parametrize(
    ("kind", "keys", "key"),
    [
        ("tracking.ekf", {"jpda_exact_detections": 4}, "jpda_exact_detections is 4"),
        ("tracking.ekf", {"false_confirmation": 1e-3}, "false_confirmation is 0.001"),
        ("tracking.imm", {"initiation": "likelihood_ratio", "confirm_m": 2}, "confirm_m is 2"),
    ],
)
def test_keys_of_trackers_that_change_nothing_are_warned_of(kind, keys, key):
    scene = chain({"s": sensor("radar.range_boundary", errors="stated", azimuth_error_deg=1.0,
                               elevation_error_deg=1.0, range_error_m=9.0)},
                  fusion={"type": "fusion.pass_through"},
                  tracker={"type": kind, **keys})  # fmt: skip
    found = notes_of_scene(Simulation(dsa_des.load_scene(scene)))
    (line,) = (line for line in found if "it has no effect" in line)
    assert line.startswith(f"blocks.tracker: {key}")


@pytest.mark.parametrize(
    ("kind", "keys", "key"),
    [
        ("avoidance.daidalus", {"beyond_m": 50.0}, "beyond_m is 50"),
        ("avoidance.daidalus", {"manoeuvre": "climb", "beyond_deg": 5.0}, "beyond_deg is 5"),
        ("operator.stochastic", {"turn_share": 0.0, "turn_rate_deg_s": 2.0},
         "turn_rate_deg_s is 2"),
        ("operator.stochastic", {"turn_share": 1.0, "vertical_rate_mps": 5.0},
         "vertical_rate_mps is 5"),
    ],
)  # fmt: skip
def test_keys_of_manoeuvres_that_are_not_made_are_warned_of(kind, keys, key, tmp_path):
    scene = by_bands(tmp_path)
    conf = scene["blocks"]["avoidance"]["conf"]
    scene["blocks"]["avoidance"] = {"type": kind, "conf": conf, **keys}
    found = notes_of_scene(Simulation(dsa_des.load_scene(scene)))
    (line,) = (line for line in found if "it has no effect" in line)
    assert line.startswith(f"blocks.avoidance: {key}")


@pytest.mark.parametrize(
    ("key", "still_works", "in_vain", "because"),
    [
        ("offset_s", 9.9, 10, "it never scans in 10 s"),
        ("latency_s", 9.9, 10, "nothing it sends arrives in 10 s"),
        ("jitter_s", 0.15, 0.16, "scans keep within 0.45 of the time between them, 0.45 s"),
    ],
)
def test_times_that_leave_nothing_to_do_or_are_cut_are_warned_of(
    key, still_works, in_vain, because
):
    def noted(value):
        table = sensor("radar.range_boundary", scan_rate_hz=1, **{key: value})
        scene = dsa_des.load_scene({**chain({"s": table}), "duration_s": 10})
        return [line for line in notes_of_scene(Simulation(scene)) if key in line]

    assert noted(still_works) == []
    (line,) = noted(in_vain)
    assert line.startswith(f"blocks.s: {key} is {in_vain:g}: {because}")


def test_keys_that_have_an_effect_are_not_warned_of():
    assert told(radar(**STATED, quantised=False, azimuth_bias_deg=1.0, biases="fixed")) == []
    assert told(weather={"wind_mps": 5.0, "wind_from_deg": 90.0}) == []
    assert told(eye(background="sky", sun_elevation_deg=10.0)) == []


def test_all_that_keys_of_a_block_disagree_about_is_said_at_once():
    """One report: two errors of one rule, and one each of three others."""
    table = radar(azimuth_error_deg=1.0, elevation_bias_deg=0.5, declare_m=2, budget="dwell",
                  range_rate_error_m_s=2.0)  # fmt: skip
    with pytest.raises(SceneError) as caught:
        run(chain({"s": table}))
    said = [str(problem) for problem in caught.value.problems]
    for words in ("azimuth_error_deg", "elevation_bias_deg", "declare_m and declare_n belong",
                  "measures_range_rate is false", "budget is 'dwell'"):  # fmt: skip
        assert sum(words in line for line in said) >= 1, words
    assert len(said) == len(set(said)) == 6
