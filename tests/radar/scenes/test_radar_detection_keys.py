"""Pd, thresholds, false alarms and the sweep of a radar, key by key, by closed forms."""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, RADARS, covers
from scipy.optimize import brentq
from scipy.special import chndtr, gammaincc
from wired import Row, alone, chain, decided, noise_crosses, run, sensor

PFA = 1e-4


def pd_of(snr: float, swerling: int, pfa: float = PFA) -> float:
    threshold = -math.log(pfa)
    if swerling in (0, 5):
        return float(1.0 - chndtr(2.0 * threshold, 2, 2.0 * snr))
    if swerling in (1, 2):
        return math.exp(-threshold / (1.0 + snr))
    half = 0.5 * snr
    return math.exp(-threshold / (1.0 + half)) * (1.0 + threshold * half / (1.0 + half) ** 2)


def needed_db(pd: float, swerling: int, pfa: float = PFA) -> float:
    snr = brentq(lambda s: pd_of(s, swerling, pfa) - pd, 1e-3, 1e7, xtol=1e-12)
    return 10.0 * math.log10(snr)


def weak(**keys) -> dict:
    """A radar with Pd of about a half for the crooked targets, all of whose scans are alike."""
    table = sensor("radar.swerling", power_w=2.0, false_alarm_probability=PFA, scan_rate_hz=50)
    del table["swerling"]
    return {**table, **keys}


def detected(table: dict, targets=crooked.TARGETS, duration_s: float = 1) -> list[Row]:
    still = [{**target, "speed_mps": 0.0, "climb_mps": 0.0} for target in targets]
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    scene = chain({"sensor": table}, ownship=own, targets=still, duration_s=duration_s)
    return decided(run(scene), block="sensor")


def linear(row: Row) -> float:
    return 10.0 ** (row["snr_db"] / 10.0)


@covers("swerling", "false_alarm_probability", of=("radar.swerling",))
@covers("intruders.swerling", of=("traffic.scripted",))
@pytest.mark.parametrize("model", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize("whose", ["radar", "targets"])
@pytest.mark.parametrize("pfa", [1e-4, 1e-2])
def test_pd_is_that_of_the_fluctuation_model(model, whose, pfa):
    """The radar's own model goes before the targets'."""
    others = 1 if model != 1 else 0
    targets = [
        {**target, "swerling": model if whose == "targets" else others}
        for target in crooked.TARGETS
    ]
    table = weak(false_alarm_probability=pfa, **({"swerling": model} if whose == "radar" else {}))
    found = detected(table, targets)
    assert len(found) > 10
    for row in found:
        assert row["detection_probability"] == pytest.approx(pd_of(linear(row), model, pfa))
        reference = row["snr_db"] - needed_db(0.9, model, pfa)
        assert row["confidence"] == pytest.approx(reference, abs=1e-5)
    share = len(found) / 100
    assert share == pytest.approx(np.mean([row["detection_probability"] for row in found]), abs=0.2)


@covers("reference_pd", of=("radar.swerling",))
@pytest.mark.parametrize("pd", [0.5, 0.99])
def test_the_confidence_is_zero_at_the_reference_pd(pd):
    for row in detected(weak(swerling=1, reference_pd=pd)):
        reference = row["snr_db"] - needed_db(pd, 1)
        assert row["confidence"] == pytest.approx(reference, abs=1e-5)


@covers("fluctuation", of=("radar.swerling",))
@pytest.mark.parametrize("model", [1, 3])
def test_a_sampled_rcs_is_exponential_or_chi_square_and_pd_that_of_a_steady_target(model):
    """Mean 1 and variance 1 (I) or 1/2 (III) of the RCS over 400 looks that all detect."""
    strong = weak(swerling=model, fluctuation="sampled", power_w=2e6, scan_rate_hz=400)
    found = detected(strong, targets=[crooked.ROLLING])
    mean = detected(weak(swerling=model, power_w=2e6, scan_rate_hz=400), targets=[crooked.ROLLING])
    assert len(found) > 390
    power = np.array([linear(row) for row in found]) / linear(mean[0])
    assert np.mean(power) == pytest.approx(1.0, abs=0.15)
    assert np.var(power) == pytest.approx(1.0 if model == 1 else 0.5, rel=0.35)
    for row in detected(weak(swerling=model, fluctuation="sampled"))[:20]:
        assert row["detection_probability"] == pytest.approx(pd_of(linear(row), 0))


@covers("detection", of=("radar.swerling",))
def test_ways_to_compute_pd_differ_by_what_they_say():
    """Exact, by table (below 1e-6) and by the thesis's series (below 0.03)."""
    errors = {}
    for name in ("exact", "table", "gram_charlier"):
        found = detected(weak(swerling=0, detection=name, power_w=0.5))
        wrong = [abs(row["detection_probability"] - pd_of(linear(row), 0)) for row in found]
        errors[name] = max(wrong)
    assert errors["exact"] < 1e-12 < errors["table"] < 1e-6 < errors["gram_charlier"] < 0.03


@covers("model", of=("radar.swerling",))
@covers("detection_probability", of=("[accuracy]",))
@pytest.mark.parametrize(("allowed", "table"), [(None, False), (1e-3, True), (1e-9, False)])
def test_auto_takes_the_table_where_its_error_is_allowed(allowed, table):
    sections = {} if allowed is None else {"accuracy": {"detection_probability": allowed}}
    radar = weak(swerling=0, model="auto", power_w=0.5)
    found = decided(run(chain({"sensor": radar}, **sections)), block="sensor")
    error = max(abs(row["detection_probability"] - pd_of(linear(row), 0)) for row in found)
    assert (error > 1e-12) is table


@covers("pulses", of=LINK_BUDGETS)
def test_pulses_are_summed():
    """Swerling II of four pulses: Gamma(4) crosses the threshold of Gamma(4) noise."""
    threshold = brentq(lambda t: gammaincc(4, t) - PFA, 1.0, 100.0, xtol=1e-13)
    for row in detected(weak(swerling=2, pulses=4)):
        expected = gammaincc(4, threshold / (1.0 + linear(row)))
        assert row["detection_probability"] == pytest.approx(expected, rel=1e-9)
    # A threshold radar's own threshold: SNR per pulse of Swerling I for Pd 0.9, summed.
    limits = {}
    for pulses in (1, 4):
        table = sensor("radar.threshold", power_w=2000.0, pulses=pulses)
        del table["threshold_db"]
        row = detected(table)[0]
        limits[pulses] = row["snr_db"] - row["confidence"]
    assert limits[1] == pytest.approx(needed_db(0.9, 1, 1e-6), abs=1e-5)
    # Four pulses need 3 to 6 dB less each.
    assert 3.0 < limits[1] - limits[4] < 6.1


@covers("false_alarm_probability", of=("radar.threshold",))
@pytest.mark.parametrize("pfa", [1e-3, 1e-8])
def test_fewer_false_alarms_need_a_higher_threshold(pfa):
    table = sensor("radar.threshold", power_w=2000.0, false_alarm_probability=pfa)
    del table["threshold_db"]
    row = detected(table)[0]
    needed = 10.0 * math.log10(math.log(pfa) / math.log(0.9) - 1.0)
    assert row["snr_db"] - row["confidence"] == pytest.approx(needed, abs=1e-5)


@covers("threshold_db", of=("radar.threshold",))
def test_a_threshold_parts_the_targets():
    snr = {row["target"]: row["snr_db"] for row in decided(alone("radar.threshold"))}
    assert snr["rolling"] < snr["diving"]
    for limit_db, names in (
        (snr["rolling"] - 0.01, {"rolling", "diving"}),
        (snr["rolling"] + 0.01, {"diving"}),
        (snr["diving"] + 0.01, set()),
    ):
        found = decided(alone("radar.threshold", threshold_db=limit_db))
        assert {row["target"] for row in found} == names
        for row in found:
            assert row["confidence"] == pytest.approx(row["snr_db"] - limit_db)


VIEW = {
    "azimuth_deg": [-40, 60], "elevation_deg": [-30, 10], "range_km": 3.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 100.0,
}  # fmt: skip


@covers("false_alarms", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_false_alarms_fill_the_field_of_view_at_the_rate_of_their_cells(kind):
    """50 by 10 by 30 cells from the minimum range of 0 m on, and 20 scans."""
    noisy = {**noise_crosses(kind, 1e-3), "scan_rate_hz": 20}
    assert not decided(alone(kind, **{**VIEW, **noisy, "false_alarms": False}), target=None)
    found = decided(alone(kind, **VIEW, **noisy, minimum_range_m=1.0), target=None)
    expected = 50 * 10 * 30 * 1e-3 * 20
    assert len(found) == pytest.approx(expected, abs=5 * math.sqrt(expected))
    azimuth, elevation, range_m = (
        np.array([row[key] for row in found]) for key in ("azimuth_rad", "elevation_rad", "range_m")
    )
    for values, low, high in (
        (np.degrees(azimuth), -40, 60), (np.degrees(elevation), -30, 10), (range_m, 0, 3000)
    ):  # fmt: skip
        assert low - 1e-9 <= values.min() < low + 0.06 * (high - low)
        assert high - 0.06 * (high - low) < values.max() <= high + 1e-9
        assert np.mean(values) == pytest.approx(0.5 * (low + high), abs=0.1 * (high - low))


@covers("beam_sweep", of=RADARS)
@pytest.mark.parametrize("kind", RADARS)
def test_a_beam_meets_each_target_in_the_order_of_its_sweep(kind):
    """From -90 to 70 deg of body azimuth in half a second, clockwise."""
    view = {"azimuth_deg": [-90, 70], "scan_rate_hz": 2}
    still = decided(alone(kind, **view), block="sensor")
    assert all(row["illuminated_s"] is None for row in still)
    found = decided(alone(kind, **view, beam_sweep=True), block="sensor")
    assert len(found) == 4
    for row in found:
        (target,) = (t for t in crooked.TARGETS if t["name"] == row["target"])
        lit_s = row["illuminated_s"]
        vector = crooked.body(target, lit_s)
        azimuth, _ = crooked.angles(vector)
        share = (math.degrees(azimuth) + 90.0) / 160.0
        assert lit_s - row["scan"] / 2 == pytest.approx(0.5 * share, abs=1e-6)
        assert row["true_range_m"] == pytest.approx(float(np.linalg.norm(vector)), abs=0.02)
        assert row["true_azimuth_rad"] == pytest.approx(azimuth, abs=2e-5)
