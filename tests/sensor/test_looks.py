"""The table ``looks``: what was looked at and not detected stands there too."""

from types import SimpleNamespace

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, SEES_ALL, chain, rows, run, sensor

import dsa_des
from components.sensor.declaration import DeclarationByPlace, DeclarationRule
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

ON = {"looks": True}
#: A radar that fades out over the flight of a target that goes away.
FADING = {"type": "radar.swerling", "scan_rate_hz": 100, "power_w": 1e4, "antenna_gain_db": 22.0,
          "frequency_hz": 35e9, "bandwidth_hz": 1e5, "false_alarm_probability": 1e-6}  # fmt: skip


def tables(scene, **options):
    sink = MemorySink()
    Simulation(dsa_des.load_scene(scene), recorder=Recorder([sink]), **options).run()
    return sink.tables()


def test_simulating_everything_adds_looks_in_vain_and_changes_no_other():
    """Of a camera that cannot see as far as the target is, at first."""
    loaded = dsa_des.load_scene("first_light", duration_s=40, sets=["record.looks=true"])
    spared, whole = (
        dsa_des.run(loaded, simulate_everything=everything)["looks"].to_pylist()
        for everything in (False, True)
    )
    assert [row["detected"] for row in spared] == [row["detected"] for row in whole]
    added = [two for one, two in zip(spared, whole, strict=True) if one != two]
    alone = [one for one, two in zip(spared, whole, strict=True) if one != two]
    assert added and all(row["evaluated"] and not row["detected"] for row in added)
    assert not any(row["evaluated"] for row in alone)
    assert any(row["evaluated"] and not row["detected"] for row in spared)


@covers("looks", of=("[record]",))
def test_every_sensor_looks_at_every_target_and_says_what_came_of_it():
    blind = sensor("radar.range_boundary", azimuth_deg=[100, 101], scan_rate_hz=2)
    off = {**SEES_ALL, "enabled": False}
    sensors = {"radar": {**HEARS_ALL, "scan_rate_hz": 2}, "blind": blind, "off": off}
    found = run(chain(sensors, duration_s=1, record=ON))
    looks = rows(found, "looks")
    assert len(looks) == 2 * 2 * 2
    for row in looks:
        assert row["evaluated"] == row["detected"] == (row["block"] == "radar")
        (flight,) = (t for t in crooked.TARGETS if t["name"] == row["target"])
        true_m = float(np.linalg.norm(crooked.ned(flight, row["time_s"])))
        if row["evaluated"]:
            assert row["true_range_m"] == pytest.approx(true_m, abs=0.02)
            assert row["snr_db"] is not None
            expected = crooked.angles(crooked.body(flight, row["time_s"]))
            found_rad = row["true_azimuth_rad"], row["true_elevation_rad"]
            assert found_rad == pytest.approx(expected, abs=1e-5)
        else:
            assert row["true_range_m"] is None
    # A sensor that is switched off fills no rows anywhere.
    assert {row["block"] for row in rows(found, "scans")} == {"radar", "blind"}
    assert "looks" not in dsa_des.run(chain(sensors, duration_s=1)).tables


def away(seed):
    target = {**crooked.DIVING, "name": "away", "north_m": -3000.0, "speed_mps": 300.0,
              "heading_deg": 180.0, "climb_mps": 0.0}  # fmt: skip
    scene = chain({"radar": FADING}, targets=[target], duration_s=40, record=ON)
    return {**scene, "seed": seed}


def test_a_curve_of_pd_from_a_folder_lies_within_the_bounds_of_the_model():
    """Shares of detections by range against the model's probability, 99 % over all bins."""
    from scipy.stats import binom

    looks = tables(away(7))["looks"]
    range_m, p, hit = (
        np.array(looks[name]) for name in ("true_range_m", "detection_probability", "detected")
    )
    edges = np.quantile(range_m, np.linspace(0, 1, 9))
    bins = np.clip(np.searchsorted(edges, range_m, side="right") - 1, 0, 7)
    curve = []
    for k in range(8):
        inside = bins == k
        n, mean = int(inside.sum()), float(p[inside].mean())
        low, high = binom.interval(1 - 0.01 / 8, n, mean)
        assert n >= 400 and low <= hit[inside].sum() <= high
        curve.append(mean)
    assert curve[0] > 0.9 and curve[-1] < 0.3 and curve == sorted(curve, reverse=True)


@pytest.mark.parametrize("kind", ["radar.swerling", "radar.threshold"])
def test_a_look_at_what_gives_no_echo_has_no_snr_and_no_chance(kind):
    """Closer than the minimum range; of an SNR of 0 dB, or of noise, it would have had some."""
    radar = {**FADING, "type": kind, "scan_rate_hz": 2, "minimum_range_m": 3500.0}
    radar["false_alarm_probability"] = 0.3
    scene = chain({"radar": radar}, targets=away(1)["blocks"]["traffic"]["intruders"],
                  duration_s=4, record=ON)  # fmt: skip
    near = [row for row in tables(scene)["looks"].to_pylist() if row["true_range_m"] < 3500.0]
    far = [row for row in tables(scene)["looks"].to_pylist() if row["true_range_m"] > 3500.0]
    assert len(near) >= 2 and all(row["evaluated"] and not row["detected"] for row in near)
    assert {(row["snr_db"], row["confidence"]) for row in near} == {(None, None)}
    assert {row["detection_probability"] or 0.0 for row in near} == {0.0}
    assert far and all(row["snr_db"] is not None for row in far)


def test_a_value_of_neither_kind_is_one_problem():
    scene = chain({"radar": HEARS_ALL}, record={"truth": "maybe"})
    with pytest.raises(dsa_des.SceneError, match=r"'maybe': must be true or false or 'auto'$"):
        dsa_des.load_scene(scene)


@pytest.mark.parametrize(
    ("m", "by", "asked", "place", "target"),
    [
        (None, "place", None, "declare_m and declare_n are not given", None),
        (2, "place", None, "the sensor has false alarms", "places are declared"),
        (2, "target", None, "without false alarms all", "declare_m is 2 and declare_n is 3"),
        (2, "target", "target", "declare_by is 'target'", "declare_m is 2 and declare_n is 3"),
    ],
)
def test_what_declares_says_why(m, by, asked, place, target):
    p = SimpleNamespace(declare_m=m, declare_n=3, declares_by_target_or_place=by, declare_by=asked)
    for effect, wanted, applies in (
        (DeclarationByPlace, place, m is not None and by == "place"),
        (DeclarationRule, target or place, m is not None and by == "target"),
    ):
        said = effect().verdict(SimpleNamespace(p=p))
        assert said.simulated is applies and wanted in said.because
