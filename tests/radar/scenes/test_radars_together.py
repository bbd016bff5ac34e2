"""Keys of a radar that act together: pulses, calibration, clutter, weather and false alarms."""

import math

import crooked
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import gammaincc
from wired import alone, chain, decided, first_look, noise_crosses, run, sensor

STILL = {"speed_mps": 0.0, "climb_mps": 0.0}
OWN = {**crooked.OWNSHIP, **STILL}
LOW = [{**crooked.DIVING, **STILL, "up_m": -900.0}, {**crooked.ROLLING, **STILL, "up_m": -700.0}]
CELL = {
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 9.0, "range_resolution_m": 40.0,
}  # fmt: skip
TERRAIN = {"height_m": 1300.0, "clutter_gamma_db": -5.0}


def threshold_of(pulses: int, pfa: float) -> float:
    return brentq(lambda t: gammaincc(pulses, t) - pfa, 1e-6, 200.0, xtol=1e-13)


def swerling_2(snr: float, pulses: int, pfa: float) -> float:
    return float(gammaincc(pulses, threshold_of(pulses, pfa) / (1.0 + snr)))


@pytest.mark.parametrize("pulses", [1, 6])
@pytest.mark.parametrize("pfa", [1e-6, 1e-3])
def test_a_calibration_is_of_the_radar_s_own_pulses_and_false_alarms(pulses, pfa):
    calibrate = {"rcs_dbsm": 3.01, "range_km": 2.6, "pd": 0.7, "swerling": 2}
    radar = sensor(
        "radar.swerling", calibrate=calibrate, pulses=pulses, false_alarm_probability=pfa,
        swerling=2, scan_rate_hz=20,
    )  # fmt: skip
    del radar["bandwidth_hz"]
    row = decided(run(chain({"radar": radar}, targets=[crooked.ROLLING])))[0]
    needed = brentq(lambda s: swerling_2(s, pulses, pfa) - 0.7, 1e-3, 1e5, xtol=1e-12)
    nearer_db = 40.0 * math.log10(2600.0 / row["true_range_m"])
    assert row["snr_db"] == pytest.approx(10.0 * math.log10(needed) + nearer_db, abs=1e-4)
    snr = 10.0 ** (row["snr_db"] / 10.0)
    assert row["detection_probability"] == pytest.approx(swerling_2(snr, pulses, pfa), rel=1e-6)
    threshold = {**radar, "type": "radar.threshold"}
    del threshold["swerling"]
    other = decided(run(chain({"radar": threshold}, targets=[crooked.ROLLING])))[0]
    assert other["confidence"] == pytest.approx(nearer_db, abs=1e-4)


@pytest.mark.parametrize(
    ("model", "pulses", "variance"), [(2, 1, 1.0), (2, 8, 1 / 8), (4, 8, 1 / 16)]
)
def test_a_sampled_rcs_from_pulse_to_pulse_is_steadier_the_more_there_are(model, pulses, variance):
    keys = {"swerling": model, "fluctuation": "sampled", "pulses": pulses, "scan_rate_hz": 300}
    still = [{**crooked.ROLLING, **STILL}]
    found = decided(run(chain({"r": sensor("radar.swerling", **keys)}, ownship=OWN, targets=still)))
    power = np.array([10.0 ** (row["snr_db"] / 10.0) for row in found])
    assert len(power) > 290
    assert np.var(power) / np.mean(power) ** 2 == pytest.approx(variance, rel=0.35)


@pytest.mark.parametrize("weather", [{"gas": True},
                                     {"fog_water_g_m3": 1.0, "fog_top_m": 9000.0}])  # fmt: skip
def test_the_air_takes_from_the_ground_what_it_takes_from_the_target(weather):
    """Clutter over signal is the same in any weather that has no echo of its own."""
    radar = sensor("radar.threshold", **CELL)

    def ratio(**sections) -> dict[str, float]:
        seen = first_look(
            chain({"radar": radar}, targets=LOW, terrain=TERRAIN, **sections), "radar"
        )
        found = {}
        for name, row in seen.items():
            lost_db = row["snr_db"] + 250.0 - row["confidence"]
            found[name] = (10.0 ** (lost_db / 10.0) - 1.0) / 10.0 ** (row["snr_db"] / 10.0)
        return found

    assert ratio(weather=weather) == pytest.approx(ratio(), rel=1e-6)


@pytest.mark.parametrize("threshold", ["noise", "adaptive"])
@pytest.mark.parametrize("model", [1, 3])
def test_a_fluctuating_target_in_clutter(model, threshold):
    """As noise raised by the clutter."""
    pfa = 1e-2
    radar = sensor(
        "radar.swerling", **CELL, swerling=model, false_alarm_probability=pfa, power_w=0.4,
        reference_pd=0.5, scan_rate_hz=20,
        clutter_threshold=threshold,
    )  # fmt: skip
    plain = sensor("radar.threshold", **CELL, power_w=0.4)
    # Where the threshold rises with it, clutter as strong as that leaves nothing to be seen.
    gamma_db = -5.0 if threshold == "noise" else -30.0
    terrain = {**TERRAIN, "clutter_gamma_db": gamma_db}
    sections = {"ownship": OWN, "targets": LOW, "terrain": terrain}
    clutter = {}
    for name, row in first_look(chain({"radar": plain}, **sections), "radar").items():
        lost_db = row["snr_db"] + 250.0 - row["confidence"]
        clutter[name] = (10.0 ** (lost_db / 10.0) - 1.0) / 10.0 ** (row["snr_db"] / 10.0)
    found = decided(run(chain({"radar": radar}, **sections)))
    assert {row["target"] for row in found} == {"rolling", "diving"}
    for row in found:
        snr = 10.0 ** (row["snr_db"] / 10.0)
        noise = 1.0 + snr * clutter[row["target"]]
        over = -math.log(pfa) / (noise if threshold == "noise" else 1.0)
        if model == 1:
            expected = math.exp(-over / (1.0 + snr / noise))
        else:
            half = 0.5 * snr / noise
            expected = math.exp(-over / (1.0 + half))
            expected *= 1.0 + over * half / (1.0 + half) ** 2
        assert row["detection_probability"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("kind", ["radar.threshold", "radar.swerling"])
@pytest.mark.parametrize(("pulses", "pfa"), [(1, 1e-3), (10, 1e-3), (1, 1e-4)])
def test_noise_that_crosses_the_threshold_is_as_strong_as_that_takes(kind, pulses, pfa):
    """The sum over the pulses starts at the threshold of the cell: its SNR per pulse follows."""
    keys = {
        **noise_crosses(kind, pfa, pulses), "pulses": pulses,
        "range_km": 3.0, "range_resolution_m": 30.0, "azimuth_resolution_deg": 2.0,
        "elevation_resolution_deg": 2.0, "azimuth_deg": [-40, 40], "elevation_deg": [-10, 10],
        "scan_rate_hz": 3 if pfa == 1e-3 else 30,
    }  # fmt: skip
    found = decided(alone(kind, **keys), block="sensor", target=None)
    assert len(found) > 60
    least = threshold_of(pulses, pfa) / pulses - 1.0
    snr = np.array([10.0 ** (row["snr_db"] / 10.0) for row in found])
    assert snr.min() == pytest.approx(least, rel=0.05)
    assert snr.min() >= least * (1.0 - 1e-9)
    zero = {row["snr_db"] - row["confidence"] for row in found}
    true = decided(alone(kind, **keys), block="sensor", target="rolling", scan=0)
    expected = [row["snr_db"] - row["confidence"] for row in true]
    assert max(zero) - min(zero) < 1e-9
    assert max(zero) == pytest.approx(expected[0], abs=1e-9)


@pytest.mark.parametrize(
    ("allowed", "range_km", "left_out"),
    [(None, 3.0, False), (0.05, 3.0, True), (1e-6, 3.0, False), (0.05, 300.0, False)],
)
def test_an_allowed_error_of_pd_leaves_drizzle_out_where_it_is_small(allowed, range_km, left_out):
    """0.02 mm/h cost 0.06 dB to 3 km and back, a hundred times that to 300 km."""
    radar = sensor("radar.swerling", range_km=range_km)
    accuracy = {} if allowed is None else {"accuracy": {"detection_probability": allowed}}
    drizzle = {"rain_rate_mm_h": 0.02, "rain_top_m": 9000.0}
    dry = first_look(chain({"radar": radar}), "radar")
    wet = first_look(chain({"radar": radar}, weather=drizzle, **accuracy), "radar")
    for name, row in dry.items():
        lost_db = row["snr_db"] - wet[name]["snr_db"]
        assert 0.0 <= lost_db < 0.06
        assert (lost_db == 0.0) is left_out
