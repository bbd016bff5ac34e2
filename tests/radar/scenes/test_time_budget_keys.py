"""What beams, pulses and dwell do to the energy of a look, and which scans they cannot do."""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, covers
from scipy.stats import gamma
from wired import alone, chain, decided, rows, run, sensor

import dsa_des
from dsa_des.errors import SceneError

#: 220 by 80 degrees around boresight; seven columns and three bars of 35 by 30 degrees.
VIEW = {"azimuth_deg": [-110, 110], "elevation_deg": [-40, 40], "range_km": 15.0}
BEAMS = {"azimuth_beamwidth_deg": 35.0, "elevation_beamwidth_deg": 30.0}
DWELL = {**VIEW, **BEAMS, "budget": "dwell", "prf_hz": 3000.0, "scan_rate_hz": 4}
#: The power at which a Swerling radar sees the crooked targets in most looks, one pulse each.
POWER = {"radar.threshold": {}, "radar.swerling": {"power_w": 1e7}}
TIME_KEYS = ("budget", "azimuth_beamwidth_deg", "elevation_beamwidth_deg", "beam_spacing", "prf_hz",
             "dwell_s", "pulses_per_dwell", "integration")  # fmt: skip


def snr_db(kind: str, **keys) -> dict[str, float]:
    found = decided(alone(kind, **POWER[kind], **keys), scan=0)
    return {row["target"]: row["snr_db"] for row in found}


@covers(*TIME_KEYS[:-1], of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize(
    ("changed", "gain"),
    [
        # 3000 / (4 * 21) = 35.7 pulses a beam.
        ({}, 35.0),
        ({"scan_rate_hz": 8}, 17.0),
        ({"prf_hz": 9000.0}, 107.0),
        ({"azimuth_beamwidth_deg": 20.0}, 22.0),
        ({"elevation_beamwidth_deg": 81.0}, 107.0),
        ({"beam_spacing": 0.5}, 9.0),
        ({"pulses_per_dwell": 5}, 7.0),
        ({"dwell_s": 0.002}, 35.0 / 6.0),
        # Without a PRF the energy is the dwell's, whole pulses or not.
        ({"dwell_s": 0.002, "prf_hz": None}, 1.0 / (4 * 21 * 0.002)),
        ({"budget": "free"}, 1.0),
        ({"azimuth_deg": [-70, 110]}, 41.0),
    ],
)
def test_the_energy_of_a_look_is_what_the_scan_leaves_for_it(kind, changed, gain):
    keys = {key: value for key, value in {**DWELL, **changed}.items() if value is not None}
    free, found = snr_db(kind, scan_rate_hz=4), snr_db(kind, **keys)
    assert found
    for name, value in found.items():
        assert value == pytest.approx(free[name] + 10.0 * math.log10(gain), abs=1e-9)


@covers("integration", of=LINK_BUDGETS)
def test_pulses_are_summed_in_power_instead():
    """Steady Pd of 35 pulses, by the non-central chi-square; a threshold for 35 pulses' noise."""
    from scipy.stats import ncx2

    keys = {**DWELL, "integration": "noncoherent"}
    radar = {**sensor("radar.swerling"), **keys, "swerling": 0, "power_w": 2e3,
             "false_alarm_probability": 1e-6, "scan_rate_hz": 4}  # fmt: skip
    found = decided(run(chain({"sensor": radar}, duration_s=6)), block="sensor")
    assert found
    level = gamma.isf(1e-6, 35)
    for row in found:
        snr = 10.0 ** (0.1 * row["snr_db"])
        assert row["detection_probability"] == pytest.approx(
            ncx2.sf(2 * level, 70, 70 * snr), rel=1e-6
        )
    table = {**sensor("radar.threshold"), "power_w": 2e5, **VIEW, **BEAMS, "prf_hz": 3000.0,
             "scan_rate_hz": 4}  # fmt: skip
    del table["threshold_db"]
    limits = {}
    for name, given in (
        ("free, 35 pulses", {"pulses": 35}),
        ("dwell", {"budget": "dwell", "integration": "noncoherent"}),
    ):
        row = decided(run(chain({"sensor": {**table, **given}})), block="sensor")[0]
        limits[name] = row["snr_db"], row["confidence"]
    assert limits["dwell"] == pytest.approx(limits["free, 35 pulses"], abs=1e-9)


@pytest.mark.parametrize("integration", ["coherent", "noncoherent"])
def test_a_calibration_is_that_of_the_look_it_states(integration):
    """At the scan rate that has the stated dwell Pd is the stated one; faster, it is lower."""
    target = {**crooked.ROLLING, "rcs_dbsm": 3.0, "swerling": 1}
    own = {**crooked.OWNSHIP}
    range_km = math.dist((0, 0, 0), crooked.ned(target, ownship=own)) / 1000.0
    radar = {key: value for key, value in sensor("radar.swerling").items() if key != "bandwidth_hz"}
    radar |= {**DWELL, "integration": integration, "pulses_per_dwell": 20, "swerling": 1,
              "calibrate": {"rcs_dbsm": 3.0, "range_km": range_km, "pd": 0.97}}  # fmt: skip
    pd = {}
    for rate in ("50/7", 20):
        scene = chain({"sensor": {**radar, "scan_rate_hz": rate}}, ownship=own, targets=[target])
        seen = decided(run(scene), block="sensor")
        pd[rate] = seen[0]["detection_probability"]
        assert seen[0]["scan"] == 0
    assert pd["50/7"] == pytest.approx(0.97, abs=1e-6)
    # Seven pulses instead of twenty; in amplitude: Pfa^(1/(1+SNR)).
    pfa = radar["false_alarm_probability"]
    if integration == "coherent":
        snr = math.log(pfa) / math.log(0.97) - 1.0
        assert pd[20] == pytest.approx(pfa ** (1.0 / (1.0 + snr * 7 / 20)), abs=1e-6)
    else:
        assert 0.8 < pd[20] < 0.95


def test_runs_of_many_scan_rates_at_once_are_those_of_each_alone():
    """Lock step: radars that share a block have their own energy."""
    radar = {**sensor("radar.threshold"), **DWELL, "threshold_db": 44.0}
    scene = chain({"sensor": radar}, targets=[crooked.ROLLING])
    rates = [1, 4, 11]
    study = dsa_des.study(
        scene, metrics=["first_detection"], axes={"blocks.sensor.scan_rate_hz": rates},
        replicas=1, workers=1,
    )  # fmt: skip
    seen = {
        row["sensor.scan_rate_hz"]: row["value"] > 0
        for row in study.summary.to_pylist() if row["result"] == "detected.sensor"
    }  # fmt: skip
    expected = {
        rate: snr_db("radar.threshold", **{**DWELL, "scan_rate_hz": rate})["rolling"] > 44.0
        for rate in rates
    }
    assert seen == expected == {1: True, 4: False, 11: False}


FITS = {**VIEW, **BEAMS, "dwell_s": 0.01}


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({**FITS, "scan_rate_hz": 5},
         "7 x 3 beams of 0.01 s (its dwell) take 0.21 s, and a scan has 0.2 s; it must be at most "
         "4.761"),
        ({**DWELL, "scan_rate_hz": 150},
         "one pulse interval) take 0.007 s, and a scan has 0.006667 s; it must be at most 142.8"),
        ({**VIEW, "prf_hz": 12000.0}, "unambiguous up to 12.49 km and range_km is 15; it must be "
         "at most 9993"),
        ({**VIEW, "azimuth_beamwidth_deg": 5.0}, "belong together"),
        ({**FITS, "pulses_per_dwell": 5, "prf_hz": 3000.0}, "give one of them"),
        ({**VIEW, "pulses_per_dwell": 5}, "prf_hz is not"),
        ({**VIEW, "prf_hz": 900.0, "dwell_s": 0.001}, "at least 0.00111111"),
        ({**VIEW, "budget": "dwell", "prf_hz": 3000.0}, "how many beams"),
        ({**VIEW, **BEAMS, "budget": "dwell"}, "neither prf_hz nor dwell_s"),
        ({**FITS, "budget": "dwell", "integration": "noncoherent"}, "how many pulses"),
        ({**DWELL, "prf_hz": 9000.0, "scan_rate_hz": "1/10", "integration": "noncoherent"},
         "4285 pulses"),
        ({**DWELL, "pulses": 5}, "leave pulses out"),
        ({**DWELL, "integration_gain_db": 7.0}, "has 1 pulse, which give at most 0 dB"),
        ({**DWELL, "integration": "noncoherent", "integration_gain_db": 7.0,
          "pulses_per_dwell": 5}, "same pulses twice"),
        ({**FITS, "prf_hz": 500.0, "integration_gain_db": 8.0}, "has 5 pulses, which give at most "
         "6.99 dB"),
        ({**FITS, "prf_hz": 500.0, "pulses": 6}, "has 5"),
        ({**DWELL, "bandwidth_hz": None, "calibrate": {"rcs_dbsm": 3.0, "range_km": 2.0,
          "pd": 0.9}}, "how long was the look"),
        ({**DWELL, "moving_target_filter": "filter_bank", "filter_pulses": 40},
         "adds up 40 pulses, and a look has 35"),
        ({**FITS, "prf_hz": 250.0, "moving_target_filter": "double_canceller"},
         "adds up 3 pulses, and a look has 2"),
        ({"budget": "dwel"}, "did you mean 'dwell'"),
    ],
)  # fmt: skip
def test_what_a_radar_cannot_do_is_one_clear_error(keys, said):
    table = {**sensor("radar.threshold"), **keys}
    table = {key: value for key, value in table.items() if value is not None}
    with pytest.raises(SceneError) as caught:
        dsa_des.load_scene(chain({"sensor": table}))
    assert said in str(caught.value)
    assert len(caught.value.args[0]) == 1


def test_what_fits_and_what_is_free_runs():
    for keys in (
        {**FITS, "scan_rate_hz": "100/21"},
        {**FITS, "scan_rate_hz": 5, "budget": "free"},
        {**FITS, "prf_hz": 500.0, "integration_gain_db": 7.0},
        {**VIEW, "prf_hz": 9993.0},  # c / (2 * 9993 Hz) is 15.0001 km, and range_km 15
    ):
        assert decided(alone("radar.threshold", **keys))


@covers("prf_hz", "range_km", of=("radar.swerling", "radar.threshold"))
@pytest.mark.parametrize("kind", ["radar.swerling", "radar.threshold"])
def test_without_a_range_the_reach_ends_where_the_next_pulse_leaves(kind):
    """c / 2 PRF between two targets: the nearer one alone is detected, however strong the other."""
    far = {t["name"]: float(np.linalg.norm(crooked.body(t, 0.0))) for t in crooked.TARGETS}
    near, other = sorted(far, key=far.__getitem__)
    radar = {**sensor(kind), "power_w": 1e9}
    radar.pop("range_km", None)
    targets = [{**target, "rcs_dbsm": 30.0, "swerling": 0} for target in crooked.TARGETS]
    between = 0.5 * (far[near] + far[other])
    ends = (between, {near}), (far[other] + 1.0, {near, other}), (far[near] - 1.0, set())
    for between_m, expected in ends:
        prf_hz = 299_792_458.0 / (2.0 * between_m)
        found = run(chain({"s": {**radar, "prf_hz": prf_hz}}, targets=targets, duration_s=0.5))
        assert {row["target"] for row in rows(found, block="s")} == expected
