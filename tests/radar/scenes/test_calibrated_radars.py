"""A calibrated radar has the stated Pd at the stated range, by the model it was stated for."""

import math
from pathlib import Path

import pytest
from covering import covers
from scipy.optimize import brentq
from scipy.special import chndtr
from wired import Row, chain, decided, run

import dsa_des
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

PFA = 1e-3
OWN = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400, "heading_deg": 217, "roll_deg": -27}
RADAR = {
    "scan_rate_hz": 20, "power_w": 50.0, "antenna_gain_db": 28.0, "wavelength_m": 0.03,
    "false_alarm_probability": PFA,
}  # fmt: skip


def pd_of(snr: float, swerling: int) -> float:
    """Pd of one pulse in closed form (steady: Marcum's Q; I, II: Rayleigh; III, IV: chi-square)."""
    threshold = -math.log(PFA)
    if swerling in (0, 5):
        return float(1.0 - chndtr(2.0 * threshold, 2, 2.0 * snr))
    if swerling in (1, 2):
        return math.exp(-threshold / (1.0 + snr))
    half = 0.5 * snr
    return math.exp(-threshold / (1.0 + half)) * (1.0 + threshold * half / (1.0 + half) ** 2)


def needed_db(pd: float, swerling: int) -> float:
    return 10.0 * math.log10(brentq(lambda snr: pd_of(snr, swerling) - pd, 1e-3, 1e6, xtol=1e-12))


def at(range_m: float, rcs_dbsm: float, swerling: int) -> dict:
    """A target to the south-west at a slant range; its bearing is close to the nose's."""
    east_m, north_m, up_m = -0.6 * range_m, -0.64 * range_m, 0.48 * range_m
    scale = range_m / math.hypot(east_m, north_m, up_m)
    return {
        "name": "one", "east_m": east_m * scale, "north_m": north_m * scale, "up_m": up_m * scale,
        "rcs_dbsm": rcs_dbsm, "swerling": swerling,
    }  # fmt: skip


def seen(scene: dict) -> Row | None:
    """The first detection in 20 scans; nothing moves, so all look the same."""
    found = decided(run(scene))
    return found[0] if found else None


@pytest.mark.parametrize("swerling", [0, 1, 2, 3, 4, 5])
def test_pd_at_the_stated_range(swerling):
    """The target fluctuates as the calibration says: Pd there is the stated one."""
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.83, "swerling": swerling}
    radar = {**RADAR, "type": "radar.swerling", "calibrate": calibrate}
    scene = chain({"radar": radar}, ownship=OWN, targets=[at(4200, 5.0, swerling)])
    row = seen(scene)
    assert row is not None
    assert row["detection_probability"] == pytest.approx(0.83, abs=1e-6)
    assert row["snr_db"] == pytest.approx(needed_db(0.83, swerling), abs=1e-5)


@pytest.mark.parametrize("calibrated", [0, 1, 3])
@pytest.mark.parametrize("target", [0, 1, 3])
def test_another_target_has_its_own_pd_at_the_calibrated_snr(calibrated, target):
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.83, "swerling": calibrated}
    radar = {**RADAR, "type": "radar.swerling", "calibrate": calibrate}
    nearer = 10.0 ** (-4.0 / 40.0)  # 4 dB less RCS have the same SNR so much nearer
    scene = chain({"radar": radar}, ownship=OWN, targets=[at(4200 * nearer, 1.0, target)])
    row = seen(scene)
    assert row is not None
    assert row["snr_db"] == pytest.approx(needed_db(0.83, calibrated), abs=1e-5)
    expected = pd_of(10.0 ** (row["snr_db"] / 10.0), target)
    assert row["detection_probability"] == pytest.approx(expected, rel=1e-9)
    reference = row["snr_db"] - needed_db(0.9, target)
    assert row["confidence"] == pytest.approx(reference, abs=1e-5)


@pytest.mark.parametrize("swerling", [0, 1, 3])
@pytest.mark.parametrize(("range_m", "detected"), [(4195, True), (4205, False)])
def test_a_threshold_radar_s_limit_is_the_calibrated_range(swerling, range_m, detected):
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.4, "swerling": swerling}
    radar = {**RADAR, "type": "radar.threshold", "calibrate": calibrate}
    scene = chain({"radar": radar}, ownship=OWN, targets=[at(range_m, 5.0, 1)])
    row = seen(scene)
    assert (row is not None) is detected
    if row is not None:
        margin = 40.0 * math.log10(4200 / range_m)
        assert row["confidence"] == pytest.approx(margin, abs=1e-5)
        assert row["snr_db"] == pytest.approx(needed_db(0.4, swerling) + margin, abs=1e-5)


def test_without_a_calibration_the_threshold_is_that_of_pd_0_9():
    radar = {**RADAR, "type": "radar.threshold", "bandwidth_hz": 1e4}
    scene = chain({"radar": radar}, ownship=OWN, targets=[at(1000, 5.0, 0)])
    row = seen(scene)
    assert row is not None
    assert row["snr_db"] - row["confidence"] == pytest.approx(needed_db(0.9, 1), abs=1e-5)


@pytest.mark.parametrize("pulses", [1, 8])
@pytest.mark.parametrize("swerling", [1, 4])
def test_the_stated_pd_is_that_of_all_pulses(pulses, swerling):
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.83, "swerling": swerling}
    radar = {**RADAR, "type": "radar.swerling", "calibrate": calibrate, "pulses": pulses}
    scene = chain({"radar": radar}, ownship=OWN, targets=[at(4200, 5.0, swerling)])
    row = seen(scene)
    assert row is not None
    assert row["detection_probability"] == pytest.approx(0.83, abs=1e-6)


def test_each_target_fluctuates_by_its_own_model():
    """Five targets at one place: none has another one's Pd."""
    radar = {**RADAR, "type": "radar.swerling", "bandwidth_hz": 2e6, "power_w": 30.0}
    targets = [{**at(3600, 5.0, model), "name": f"swerling{model}"} for model in range(5)]
    found = {row["target"]: row for row in decided(run(chain({"radar": radar}, ownship=OWN,
             targets=targets)))}  # fmt: skip
    snr = 10.0 ** (0.1 * next(iter(found.values()))["snr_db"])
    assert 3.0 < snr < 100.0
    for model in range(5):
        row = found[f"swerling{model}"]
        assert row["detection_probability"] == pytest.approx(pd_of(snr, model), rel=1e-6)


#: A sensor's own file: Pd 0.83 of Swerling I at 4.2 km with its own threshold, here 1e-3.
OWN_FILE = """type = "radar.swerling"
scan_rate_hz = 20
power_w = 50
antenna_gain_db = 28
wavelength_m = 0.03
calibrate = { rcs_dbsm = 5, range_km = 4.2, pd = 0.83 }
"""


def pd_and_snr_db(scene: dsa_des.Scene) -> tuple[float, float]:
    """Of a steady place in the scene: the probability and the SNR of the first detection."""
    row = decided(dsa_des.run(scene.set({"record.looks": True})))[0]
    return row["detection_probability"], row["snr_db"]


def lowered(path: Path, how: str, own_pfa: str) -> dsa_des.Scene:
    """A scene whose threshold is set for 0.01, by one of the ways in which a scene says so."""
    (path / "sensor.toml").write_text(f"{own_pfa}{OWN_FILE}")
    lower = "false_alarm_probability = 0.01\n"
    scene = path / "scene.toml"
    scene.write_text(
        f"""duration_s = 1
wires = ["traffic -> transform -> gate -> radar"]
[blocks]
transform = {{ type = "geometry.ellipsoid" }}
gate = {{ type = "gate" }}
[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = -41.3, lon_deg = 174, alt_m = 2400, heading_deg = 217, roll_deg = -27 }}
[[blocks.traffic.intruders]]
name = "one"
east_m = -2520
north_m = -2688
up_m = 2016
rcs_dbsm = 5
swerling = 1
[blocks.radar]
extends = "sensor.toml"
{lower if how == "scene" else ""}"""
    )
    if how == "extending scene":
        scene = path / "outer.toml"
        scene.write_text(f'extends = "scene.toml"\n[blocks.radar]\n{lower}')
    found = dsa_des.load_scene(scene)
    if how == "set":
        found = found.set({"blocks.radar.false_alarm_probability": 0.01})
    if how == "swapped":
        found = found.swap(radar="radar.threshold").swap(radar="radar.swerling")
        found = found.set({"blocks.radar.false_alarm_probability": 0.01})
    if how == "other range":  # the range is another's, and still stated for the file's own Pfa
        found = found.set({"blocks.radar.calibrate": {"rcs_dbsm": 5, "range_km": 4.2, "pd": 0.83},
                           "blocks.radar.false_alarm_probability": 0.01})  # fmt: skip
    if how == "written out":
        found = found.set({"blocks.radar.false_alarm_probability": 0.01})
        return dsa_des.load_scene(found.resolved())
    return found


@covers("calibrate.false_alarm_probability", of=("radar.swerling", "radar.threshold"))
@pytest.mark.parametrize(
    "how",
    ["scene", "extending scene", "set", "swapped", "other range", "written out"],
)
@pytest.mark.parametrize(
    ("own_pfa", "stated"), [("false_alarm_probability = 1e-3\n", 1e-3), ("", 0.05)]
)
def test_whoever_moves_the_threshold_keeps_the_hardware(tmp_path, how, own_pfa, stated):
    """The SNR is that of the file's own Pfa, or of the default where it gives none."""
    pd, snr_db = pd_and_snr_db(lowered(tmp_path, how, own_pfa))
    needed = math.log(stated) / math.log(0.83) - 1.0
    assert snr_db == pytest.approx(10.0 * math.log10(needed), abs=1e-4)
    assert pd == pytest.approx(0.01 ** (1.0 / (1.0 + needed)), rel=1e-5)


@pytest.mark.parametrize("kind", ["radar.swerling", "radar.threshold"])
def test_a_calibration_may_say_at_which_false_alarm_probability_it_holds(kind):
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.83, "false_alarm_probability": 0.05}
    radar = {**RADAR, "type": kind, "calibrate": calibrate}
    row = seen(chain({"radar": radar}, ownship=OWN, targets=[at(2000, 5.0, 1)]))
    assert row is not None
    needed = math.log(0.05) / math.log(0.83) - 1.0
    expected_db = 10.0 * math.log10(needed) + 40.0 * math.log10(4200 / 2000)
    assert row["snr_db"] == pytest.approx(expected_db, abs=1e-4)
    scene = dsa_des.load_scene(chain({"radar": radar}, ownship=OWN, targets=[at(2000, 5.0, 1)]))
    (said,) = [text for text in notes_of_scene(Simulation(scene)) if "calibrate holds" in text]
    assert f"{PFA ** (1.0 / (1.0 + needed)):.3g} instead of 0.83" in said


def test_a_study_over_thresholds_is_one_of_one_radar():
    """A threshold radar's limit goes with the fourth root of what its threshold needs."""
    calibrate = {"rcs_dbsm": 5.0, "range_km": 4.2, "pd": 0.83}
    radar = {**RADAR, "type": "radar.threshold", "calibrate": calibrate}
    target = {"name": "one", "north_m": 6000, "east_m": 0, "up_m": 0, "speed_mps": 100,
              "heading_deg": 180, "rcs_dbsm": 5}  # fmt: skip
    scene = chain({"radar": radar}, ownship={"lat_deg": -41, "lon_deg": 174, "alt_m": 900},
                  targets=[target], duration_s=45)  # fmt: skip
    axes = {"blocks.radar.false_alarm_probability": [1e-2, PFA, 1e-5]}
    found = dsa_des.study(scene, axes=axes, replicas=1, workers=1, metrics=["first_detection"])
    known = math.log(PFA) / math.log(0.83) - 1.0
    for row in found.runs.to_pylist():
        needed = math.log(row["radar.false_alarm_probability"]) / math.log(0.83) - 1.0
        limit_m = 4200.0 * (known / needed) ** 0.25
        assert row["first_detection_range_m.radar"] == pytest.approx(limit_m - 2.5, abs=3)
