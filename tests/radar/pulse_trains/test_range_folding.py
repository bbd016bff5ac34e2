"""Pulses: eclipsing, folded ranges and their resolution, against plain arithmetic over the echo.

The scene's ownship is banked, heads 217 deg and crosses the antimeridian.
"""

import itertools
import math
from fractions import Fraction

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, covers
from wired import alone, chain, decided, noise_crosses, rows, run, sensor

import dsa_des
from components.radar.pulse_trains.ambiguity import (
    coincident_range_m,
    count_clear_prfs,
    mth_largest_share,
    received_share,
)
from dsa_des.errors import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

C = 299_792_458.0
#: Of the crooked targets at 2.5 and 2.0 km.
GRID = {"range_resolution_m": 1.0}


def heard(delay: Fraction, interval: Fraction, width: Fraction) -> Fraction:
    """Return the share of an echo outside all pulses sent, by intersecting them one by one."""
    start, end = delay, delay + width
    lost = Fraction(0)
    for pulse in range(-2, int(delay / interval) + 4):
        sent = pulse * interval
        lost += max(Fraction(0), min(end, sent + width) - max(start, sent))
    return (width - lost) / width


def agreed(true_m: float, prfs_hz: list[float], tolerance_m: float) -> float:
    """Return the nearest range that all PRFs allow, by unfolding the first one step by step."""
    step = C / 2.0 / prfs_hz[0]
    candidate = math.fmod(true_m, step)
    while True:
        seen = []
        for prf_hz in prfs_hz:
            length = C / 2.0 / prf_hz
            apart = math.fmod(abs(true_m - candidate), length)
            seen.append(min(apart, length - apart) <= tolerance_m + 1e-5)
        if all(seen):
            return candidate
        candidate += step


@pytest.mark.parametrize("duty", [Fraction(1, 10), Fraction(1, 2), Fraction(4, 5)])
def test_the_share_received_is_what_no_pulse_overlaps(duty):
    interval, width = Fraction(1, 10_000), duty / 10_000
    delays = [Fraction(step, 37) * interval for step in range(150)]
    ranges = [0.5 * C * float(delay) for delay in delays]
    found = received_share(ranges, prf_hz=10_000.0, pulse_width_s=float(width))
    expected = [float(heard(delay, interval, width)) for delay in delays]
    assert found == pytest.approx(expected, abs=1e-9)


def test_the_mean_share_is_one_less_the_duty_factor():
    """Uniform delays; over a half both edges eclipse at once and (1/d - 1) is left on top."""
    middle = (np.arange(100_000) + 0.5) / 100_000 * C / 2.0 / 5000.0
    for duty in (0.05, 0.25, 0.5):
        share = received_share(middle, prf_hz=5000.0, pulse_width_s=duty / 5000.0)
        assert share.mean() == pytest.approx(1.0 - duty, abs=1e-6)


def test_three_prfs_of_7_8_and_9_cells_resolve_504():
    """By the Chinese remainder theorem: the number of cells that leaves all three remainders."""
    cell_m = 150.0
    number = np.arange(0, 700)
    prfs = [C / 2.0 / (cells * cell_m) for cells in (7, 8, 9)]
    found = coincident_range_m(
        number * cell_m, prfs_hz=prfs, seen=np.ones((3, len(number)), bool), tolerance_m=75.0
    )
    whole, factors = math.prod((7, 8, 9)), (7, 8, 9)
    inverse = [whole // m * pow(whole // m, -1, m) for m in factors]
    by_remainders = [
        sum(of * (n % m) for of, m in zip(inverse, factors, strict=True)) % whole
        for n in number.tolist()
    ]
    assert by_remainders[503] == 503 and by_remainders[600] == 96
    assert found / cell_m == pytest.approx(by_remainders, abs=1e-9)
    # Two of them resolve 56, 63 and 72 cells; the third one is deaf.
    for pair in itertools.combinations(range(3), 2):
        seen = np.zeros((3, len(number)), bool)
        seen[list(pair)] = True
        two = coincident_range_m(number * cell_m, prfs_hz=prfs, seen=seen, tolerance_m=75.0)
        length = math.prod((7, 8, 9)[one] for one in pair)
        assert two / cell_m == pytest.approx(number % length, abs=1e-9)


def test_the_mth_clearest_decides():
    shares = np.array([[0.9, 0.0], [0.2, 0.1], [0.5, 1.0]])
    assert mth_largest_share(shares, 1).tolist() == [0.9, 1.0]
    assert mth_largest_share(shares, 2).tolist() == [0.5, 0.1]
    assert mth_largest_share(shares, 3).tolist() == [0.2, 0.0]


def test_blind_zones_are_pulses_and_multiples_of_the_blind_speed():
    """10 GHz, 10 kHz: blind speed 149.9 m/s, ambiguous at 14.99 km; 1 us is 150 m."""
    keys = {"pulse_width_s": 1e-6, "wavelength_m": C / 10e9, "notch_m_s": 15.0}
    ranges = [100.0, 200.0, 14_900.0, 14_800.0, 15_100.0, 15_200.0]
    found = count_clear_prfs(ranges, 60.0, prfs_hz=[10e3], **keys)
    assert found.tolist() == [0, 1, 0, 1, 0, 1]
    rates = [0.0, 14.0, 16.0, 134.0, 136.0, 150.0, -150.0, -134.0, 165.5]
    found = count_clear_prfs(5000.0, rates, prfs_hz=[10e3], **keys)
    assert found.tolist() == [0, 0, 1, 1, 0, 0, 0, 1, 1]
    assert count_clear_prfs(5000.0, 150.0, prfs_hz=[10e3, 11e3, 13e3], **keys) == 1
    half = count_clear_prfs([70.0, 80.0], 60.0, prfs_hz=[10e3], least_share=0.5, **keys)
    assert half.tolist() == [0, 1]
    # Of all delays and rates that are equally likely.
    middle = (np.arange(1000) + 0.5) / 1000
    all_m, all_m_s = middle[:, np.newaxis] * C / 2e4, middle * C / 10e9 / 2 * 10e3
    seen = count_clear_prfs(all_m, all_m_s, prfs_hz=[10e3], **keys)
    clear = (1.0 - 2.0 * 1e-6 * 10e3) * (1.0 - 2.0 * 15.0 / (C / 10e9 / 2 * 10e3))
    assert seen.mean() == pytest.approx(clear, abs=2e-3)


@covers("range_folds", "prf_hz", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_target_beyond_is_seen_at_its_folded_range(kind):
    whole = {row["target"]: row for row in rows(alone(kind, range_km=20.0, **GRID))}
    assert {row["true_range_m"] > 1900.0 for row in whole.values()} == {True}
    prf_hz = C / 2.0 / 700.0
    assert not rows(alone(kind, prf_hz=prf_hz, **GRID))
    folded = rows(alone(kind, prf_hz=prf_hz, range_km=20.0, range_folds=True, **GRID))
    assert {row["target"] for row in folded} == set(whole)
    for row in folded:
        exact = whole[row["target"]]
        assert row["true_range_m"] == exact["true_range_m"]
        assert row["azimuth_rad"] == exact["azimuth_rad"]
        assert row["range_m"] == pytest.approx(row["true_range_m"] % 700.0, abs=0.5)


@covers("pulse_width_s", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_pulse_that_is_sent_takes_its_share_of_the_echo(kind):
    keys = {"prf_hz": 70e3, "range_km": 20.0, "range_folds": True, **GRID}
    whole = decided(alone(kind, **keys))
    eclipsed = {row["target"]: row for row in decided(alone(kind, **keys, pulse_width_s=9e-6))}
    shares = []
    for row in whole:
        delay = Fraction(2.0 * row["true_range_m"] / C)
        share = float(heard(delay, Fraction(1, 70_000), Fraction(9, 1_000_000)))
        shares.append(share)
        expected = row["snr_db"] + 10.0 * math.log10(share)
        assert eclipsed[row["target"]]["snr_db"] == pytest.approx(expected, abs=1e-6)
    assert len(shares) == 2 and min(shares) < 0.9 and min(shares) > 0.01


@covers("other_prfs_hz", "prfs_needed", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize("needed", [1, 2, 3, None])
def test_several_prfs_agree_on_the_true_range_or_a_ghost(kind, needed):
    prfs, width_s, cell_m = [60e3, 71e3, 83e3], 5e-6, 20.0
    keys = {"prf_hz": prfs[0], "other_prfs_hz": prfs[1:], "range_km": 20.0, "range_folds": True,
            "pulse_width_s": width_s, **GRID, "range_cell_m": cell_m}  # fmt: skip
    whole = {row["target"]: row for row in decided(alone(kind, range_km=20.0, **GRID))}
    found = {row["target"]: row for row in decided(alone(kind, **keys, prfs_needed=needed))}
    for name, exact in whole.items():
        delay = Fraction(2.0 * exact["true_range_m"] / C)
        shares = {prf: float(heard(delay, 1 / Fraction(prf), Fraction(width_s))) for prf in prfs}
        decides = sorted(shares.values(), reverse=True)[(needed or 3) - 1]
        if decides == 0.0:
            assert name not in found
            continue
        seeing = [prf for prf in prfs if shares[prf] >= decides - 1e-12]
        row = found[name]
        expected = exact["snr_db"] + 10.0 * math.log10(decides)
        assert row["snr_db"] == pytest.approx(expected, abs=1e-5)
        range_m = agreed(exact["true_range_m"], seeing, 0.5 * cell_m)
        assert row["range_m"] == pytest.approx(range_m, abs=0.51)
        assert row["true_range_m"] == exact["true_range_m"]


@pytest.mark.parametrize(("cell_m", "folds"), [(10.0, 0), (30.0, 1), (50.0, 2)])
def test_ranges_of_two_prfs_agree_within_half_a_cell(cell_m, folds):
    """Of 700 and 710 m: one fold is 10 m apart, two 20 m."""
    keys = {"prf_hz": C / 1400.0, "other_prfs_hz": [C / 1420.0], "range_km": 20.0,
            "range_folds": True, **GRID, "range_cell_m": cell_m}  # fmt: skip
    found = rows(alone("radar.threshold", **keys))
    assert len(found) == 2
    for row in found:
        assert row["range_m"] == pytest.approx(row["true_range_m"] - 700.0 * folds, abs=0.51)


def test_targets_a_fold_apart_are_one_report():
    """Two in one line of sight, 800 m apart, a PRF of 800 m: one cell, and none of 900 m."""
    still = {key: crooked.OWNSHIP[key] for key in ("heading_deg", "speed_mps", "climb_mps")}
    line = {"east_m": -0.6, "north_m": -0.8, "up_m": 0.0}
    pair = [
        {"name": f"at {away}", **{key: away * part for key, part in line.items()}, **still}
        for away in (2000.0, 2800.0)
    ]
    cell = {"azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 3.0, "range_cell_m": 60.0,
            "resolution_cells": True, "range_km": 20.0, "range_folds": True}  # fmt: skip
    for length_m, reports in ((800.0, 1), (900.0, 2)):
        keys = {**cell, "prf_hz": C / 2.0 / length_m}
        assert len(rows(alone("radar.threshold", targets=pair, **keys))) == reports


def test_noise_lies_within_the_fold():
    view = {"azimuth_deg": [-10, 10], "elevation_deg": [-5, 5], "azimuth_resolution_deg": 2.0,
            "elevation_resolution_deg": 2.0, "range_resolution_m": 50.0, "range_km": 20.0,
            "prf_hz": C / 2.0 / 1000.0, "range_folds": True}  # fmt: skip
    noisy = {**view, **noise_crosses("radar.threshold", 1e-2), "scan_rate_hz": 10}
    found = rows(alone("radar.threshold", **noisy, duration_s=4), target=None)
    # 10 by 5 by 20 cells, 40 scans.
    assert 300 < len(found) < 500
    assert max(row["range_m"] for row in found) <= 1000.0


def test_each_prf_has_its_dwell():
    beams = {"azimuth_beamwidth_deg": 40.0, "elevation_beamwidth_deg": 30.0, "budget": "dwell",
             "azimuth_deg": [-60, 60], "elevation_deg": [-15, 15], "range_folds": True,
             "range_cell_m": 20.0, "prf_hz": 30e3, "scan_rate_hz": 10}  # fmt: skip
    report = {}
    for others in ((), (33e3,), (33e3, 37e3)):
        scene = chain({"sensor": sensor("radar.threshold", **beams, other_prfs_hz=list(others))})
        report[len(others)] = run(scene).summary["time_budgets"]["sensor"]["pulses"]
    assert report == {0: 1000, 1: 500, 2: 333}


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"range_folds": True}, "range_folds is true and prf_hz is not given"),
        ({"pulse_width_s": 1e-6}, "pulse_width_s is 1e-06 and prf_hz is not given"),
        ({"prf_hz": 1e4, "pulse_width_s": 1e-4}, "below the interval between pulses at 10000 Hz"),
        ({"prf_hz": 1e4, "prfs_needed": 1}, "other_prfs_hz is not given"),
        ({"prf_hz": 1e4, "other_prfs_hz": [9e3]}, "range_folds is false"),
        ({"prf_hz": 1e4, "other_prfs_hz": [1e4], "range_folds": True}, "one is given twice"),
        (
            {"prf_hz": 1e4, "other_prfs_hz": [9e3], "range_folds": True, "prfs_needed": 3},
            "there are 2 PRFs",
        ),
        (
            {"prf_hz": 1e4, "other_prfs_hz": [9e3], "range_folds": True, "range_resolution_m": 0},
            "range_resolution_m is 0 and other_prfs_hz",
        ),
        (
            {"prf_hz": 1e4, "other_prfs_hz": [9e3], "range_folds": True, "range_cell_m": 20,
             "moving_target_filter": "single_canceller"},
            "known for one PRF",
        ),
        ({"prf_hz": 1e4, "other_prfs_hz": [-1.0]}, "other_prfs_hz"),
    ],
)  # fmt: skip
def test_impossible_pulses_are_refused(keys, said):
    with pytest.raises(SceneError) as error:
        dsa_des.run(chain({"radar": sensor("radar.threshold", **keys)}))
    assert said in str(error.value)
    assert "radar" in str(error.value)


@pytest.mark.parametrize("tracker", ["tracking.ekf", "tracking.stub"])
def test_a_tracker_says_that_it_takes_folded_ranges_for_true(tracker):
    keys = {"prf_hz": 1e4, "range_folds": True, "range_km": 20.0, "azimuth_resolution_deg": 2.0,
            "elevation_resolution_deg": 2.0, **GRID}  # fmt: skip
    for more, folds in (
        ({}, True),
        ({"range_km": 14.0}, False),
        ({"other_prfs_hz": [9e3, 11e3]}, False),
    ):
        radar = sensor("radar.threshold", **keys | more)
        made = chain({"radar": radar}, fusion={"type": "fusion.pass_through"},
                     tracker={"type": tracker})  # fmt: skip
        said = notes_of_scene(Simulation(dsa_des.load_scene(made)))
        found = [line for line in said if "ranges of radar fold at 14.99 km" in line]
        assert len(found) == folds and all("blocks.tracker" in line for line in found)
