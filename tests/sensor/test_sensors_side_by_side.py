"""Sensors of one scene see what each of them sees alone, however the scene is run.

Every kind of sensor is there, and with them every effect that draws, remembers or sweeps.
"""

import crooked
import pytest
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of
from wired import chain, noise_crosses, rows, run, sensor

import dsa_des

MOUNTED = {"mount_azimuth_deg": -15, "mount_elevation_deg": 4, "mount_roll_deg": 10,
           "misalignment_deg": [0.2, -0.1, 0.3]}  # fmt: skip
CELLS = {"azimuth_deg": [-90, 30], "elevation_deg": [-24, 12], "range_km": 4.0,
         "azimuth_resolution_deg": 4.0, "elevation_resolution_deg": 4.0,
         "range_resolution_m": 150.0}  # fmt: skip
BEAM = {"azimuth_beamwidth_deg": 4.0, "elevation_beamwidth_deg": 4.0}
SWERLING = {"kind": "radar.swerling", "power_w": 10.0, "scan_rate_hz": 10}
ODD = {
    "a": sensor("radar.threshold", scan_rate_hz=5, threshold_db=27.0, range_km=2.4),
    "b": sensor("radar.threshold", scan_rate_hz=2.5, threshold_db=20.0, frequency_hz=20e9,
                azimuth_deg=[0, 90], azimuth_resolution_deg=2.0),
    "c": sensor("radar.swerling", scan_rate_hz=20, power_w=2.0, pulses=3, swerling=1),
    "d": sensor("radar.swerling", scan_rate_hz=20, power_w=1.0, false_alarm_probability=1e-3,
                swerling=3, offset_s=0.02),
    "e": sensor("radar.range_boundary", range_km=2.0, scan_rate_hz=8, mount_azimuth_deg=40),
    "f": sensor("radar.range_boundary", range_km=9.0, scan_rate_hz=4, beam_sweep=True,
                azimuth_deg=[-80, 70], minimum_range_m=500.0),
    "g": sensor("optical.eo", scan_rate_hz=10, threshold=30.0, dynamic_weight=20.0,
                background="auto", sun_azimuth_deg=70),
    "h": sensor("optical.eo", scan_rate_hz=5, threshold=3.0, static_weight=0.1,
                silhouette="thesis", elevation_deg=[-8, 5]),
    "i": sensor("optical.ir", scan_rate_hz=4, threshold=2.0, plume=True, declare_m=2, declare_n=4),
    "j": sensor("optical.ir", scan_rate_hz=16, rate="thesis", dynamic_weight=7.0,
                misalignment_deg=[1, 2, 3]),
    "k": sensor("optical.projection", scan_rate_hz=2, band="ir", azimuth_pixels=900),
    "l": sensor("optical.range_boundary", scan_rate_hz=2, range_km=2.2),
    # Fluctuation that is drawn by pulse and target, noise, a beam that sweeps, all mounted askew.
    "m": sensor(**SWERLING, **CELLS, **BEAM, **MOUNTED, swerling=None, fluctuation="sampled",
                pulses=3, beam_sweep=True, minimum_range_m=900.0, budget="free",
                **noise_crosses("radar.swerling", 1e-3)),
    "n": sensor("radar.threshold", **CELLS, scan_rate_hz=5, minimum_range_m=1000.0,
                **noise_crosses("radar.threshold", 1e-3)),
    "p": sensor("radar.threshold", **CELLS, scan_rate_hz=10, resolution_cells=True,
                mount_roll_deg=12.0),
    "q": sensor(**SWERLING, swerling=3, fluctuation_correlation_s=0.7, beam_sweep=True,
                scintillation_extent_m=5.0),
    "r": sensor(**SWERLING, **CELLS, **BEAM, errors="signal", measures_range_rate=True,
                range_rate_resolution_m_s=3, range_error_m=12, range_correlation_time_s=0.7,
                range_bias_m=9, budget="free", declare_m=3, declare_n=5),
    "s": sensor("optical.eo", scan_rate_hz=10, errors="stated", azimuth_error_deg=0.3,
                azimuth_correlation_time_s=2, elevation_bias_deg=0.5, latency_s=0.3),
    "t": sensor("optical.ir", scan_rate_hz=8, **MOUNTED, false_alarms_per_frame=0.5,
                threshold=5.0, declare_m=2, declare_n=3, declare_by="place",
                silhouette="convex_hull"),
    "u": sensor("optical.eo", scan_rate_hz=8, false_alarms_per_frame=0.2, threshold=None,
                noise_equivalent_contrast=0.1, errors="signal"),
    "v": sensor("laser.scanning", scan_rate_hz=5, beam_sweep=True, latency_s=0.13),
    "w": sensor("visual.acquisition", scan_rate_hz=5, search="random", right_looking=0.5,
                looking="spells", beta_per_sr_s=1e5),
    "x": {"type": "surveillance.ads_b", "scan_rate_hz": 4, "reception": "fitted"},
    "z": sensor(**SWERLING, fluctuation_correlation_s=0.7),
    "y": {"type": "surveillance.active", "scan_rate_hz": 4, "elevation_deg": [-90, 90],
          "near_s": 0.0, "far_every": 2},
}  # fmt: skip
#: Those that the ground beneath would hide or be refused by are not over it.
OVER_GROUND = {
    **{name: ODD[name] for name in "npr"},
    # Where the ground crosses a threshold that was set for noise.
    "g": sensor(
        "radar.threshold",
        **CELLS,
        scan_rate_hz=10,
        power_w=0.1,
        clutter_threshold="noise",
        **noise_crosses("radar.threshold", 1e-3),
    ),
    "o": sensor(**SWERLING, **CELLS, **BEAM, prf_hz=6000.0, moving_target_filter="filter_bank"),
}
SECTIONS = {
    "weather": {"gas": True, "rain_rate_mm_h": 3.0, "visibility_km": 9.0},
    "navigation": {"attitude_bias_deg": [1, 2, 3], "attitude_noise_deg": [0.1, 0.2, 0.3],
                   "position_noise_m": [8, 8, 12]},
}  # fmt: skip
TARGETS = [
    {**crooked.ROLLING, "engine": "turbojet", "contrast_ir": 0.4, "mode_s": True,
     "ads_b": {"nacp": 9}},
    {**crooked.DIVING, "swerling": 3, "rcs_dbsm": 6.0, "mode_s": True, "ads_b": {"nacp": 9}},
]  # fmt: skip
GROUND = {"terrain": {"height_m": 1300.0, "clutter_gamma_db": -25.0}}
SCENES = [
    (sensors, dsa_des.load_scene(chain(sensors, targets=TARGETS, duration_s=1, **sections)))
    for sensors, sections in ((ODD, SECTIONS), (OVER_GROUND, {**SECTIONS, **GROUND}))
]
ANY_SCENE = pytest.mark.parametrize(("sensors", "scene"), SCENES, ids=["clear", "over ground"])


@pytest.fixture(scope="module")
def together():
    return run(chain(ODD, targets=TARGETS, duration_s=2, **SECTIONS))


@pytest.mark.parametrize("name", list(ODD))
def test_a_sensor_sees_beside_others_what_it_sees_alone(together, name):
    # All rates divide a billion ticks a second: errors of navigation are drawn by the tick.
    alone = run(chain({name: ODD[name]}, targets=TARGETS, duration_s=2, **SECTIONS))
    expected = rows(alone)
    # Others may have columns of their own.
    seen = [{key: row[key] for key in expected[0]} for row in rows(together, block=name)]
    assert seen == expected
    # Who is left out, and why, may differ: others look farther.
    looks = [
        [(row["tick"], row["scan"], row["evaluated"], row["detected"]) for row in found]
        for found in (rows(together, "scans", block=name), rows(alone, "scans"))
    ]
    assert looks[0] == looks[1]


def test_a_target_is_seen_as_it_is_whoever_else_is_there_and_comes_first(together):
    """Another one, far away, is there as well, and the rest come in the other order."""
    far = {**crooked.ROLLING, "name": "far", "east_m": 2e5, "mode_s": True}
    other = run(chain(ODD, targets=[*TARGETS[::-1], far], duration_s=2, **SECTIONS))
    found = [
        sorted((r for r in rows(each) if r["target"] != "far"), key=lambda r: str([*r.values()]))
        for each in (together, other)
    ]
    assert found[0] == found[1]


def test_none_of_them_sees_what_another_sees(together):
    """Else two might be taken for each other."""
    seen = {
        name: [(row["tick"], row["confidence"], row["azimuth_rad"])
               for row in rows(together, block=name)]
        for name in ODD
    }  # fmt: skip
    assert len({str(rows) for rows in seen.values()}) == len(ODD)


@ANY_SCENE
def test_it_is_the_same_in_any_window(sensors, scene):
    found = same_in_any_window(scene, (1, 7), shuffle_ties=3)["detections"].to_pylist()
    assert {row["block"] for row in found} == set(sensors)
    noisy = {row["block"] for row in found if row["target"] is None}
    assert noisy == {"m", "n", "t", "u"} & set(sensors) | ({"g"} if "o" in sensors else set())


@ANY_SCENE
def test_simulating_every_effect_is_the_same(sensors, scene):
    """Scans say what was evaluated, which is what is saved."""
    spared, whole = (tables_of(scene, simulate_everything=each)[1] for each in (False, True))
    assert all(spared[name].equals(whole[name]) for name in spared if name != "scans")


@ANY_SCENE
def test_runs_together_are_those_alone(sensors, scene):
    simulation = same_as_alone(replicas_of(scene, {}, {}, {}))
    assert not simulation.timeline.split
