"""Sensors in one scene see what each of them sees alone, whatever the keys of the others."""

import crooked
import pytest
from wired import chain, rows, run, sensor

ODD = {
    "a": sensor("radar.threshold", scan_rate_hz=5, threshold_db=27.0, range_km=2.4),
    "b": sensor("radar.threshold", scan_rate_hz=2.5, threshold_db=20.0, frequency_hz=20e9,
                azimuth_deg=[0, 90], azimuth_resolution_deg=2.0),
    "c": sensor("radar.swerling", scan_rate_hz=20, power_w=2.0, pulses=3, swerling=1),
    "d": sensor("radar.swerling", scan_rate_hz=20, power_w=1.0, false_alarm_probability=1e-3,
                swerling=3, offset_s=0.02),
    "e": sensor("radar.range_boundary", range_km=2.0, scan_rate_hz=8, mount_azimuth_deg=40),
    "f": sensor("radar.range_boundary", range_km=9.0, scan_rate_hz=4, beam_sweep=True,
                azimuth_deg=[-80, 70]),
    "g": sensor("optical.eo", scan_rate_hz=10, threshold=30.0, dynamic_weight=20.0,
                background="auto", sun_azimuth_deg=70),
    "h": sensor("optical.eo", scan_rate_hz=5, threshold=3.0, static_weight=0.1,
                silhouette="thesis", elevation_deg=[-8, 5]),
    "i": sensor("optical.ir", scan_rate_hz=4, threshold=2.0, plume=True, declare_m=2, declare_n=4),
    "j": sensor("optical.ir", scan_rate_hz=16, rate="thesis", dynamic_weight=7.0,
                misalignment_deg=[1, 2, 3]),
    "k": sensor("optical.projection", scan_rate_hz=2, band="ir", azimuth_pixels=900),
    "l": sensor("optical.range_boundary", scan_rate_hz=2, range_km=2.2),
}  # fmt: skip
SECTIONS = {
    "weather": {"gas": True, "rain_rate_mm_h": 3.0, "visibility_km": 9.0},
    "navigation": {"attitude_bias_deg": [1, 2, 3], "attitude_noise_deg": [0.1, 0.2, 0.3]},
}
TARGETS = [
    {**crooked.ROLLING, "engine": "turbojet", "contrast_ir": 0.4},
    {**crooked.DIVING, "swerling": 3, "rcs_dbsm": 6.0},
]


@pytest.fixture(scope="module")
def together():
    return run(chain(ODD, targets=TARGETS, duration_s=2, **SECTIONS))


@pytest.mark.parametrize("name", list(ODD))
def test_a_sensor_sees_beside_others_what_it_sees_alone(together, name):
    # All rates divide a billion ticks a second: errors of navigation are drawn by the tick.
    alone = run(chain({name: ODD[name]}, targets=TARGETS, duration_s=2, **SECTIONS))
    assert rows(together, block=name) == rows(alone) != []
    # Who is left out, and why, may differ: others look farther.
    looks = [
        [(row["tick"], row["scan"], row["evaluated"], row["detected"]) for row in found]
        for found in (rows(together, "scans", block=name), rows(alone, "scans"))
    ]
    assert looks[0] == looks[1]


def test_none_of_them_sees_what_another_sees(together):
    """Else two might be taken for each other."""
    seen = {
        name: [(row["tick"], row["confidence"], row["azimuth_rad"])
               for row in rows(together, block=name)]
        for name in ODD
    }  # fmt: skip
    assert len({str(rows) for rows in seen.values()}) == len(ODD)
