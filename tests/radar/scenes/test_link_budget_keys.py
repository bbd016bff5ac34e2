"""What each key of a link budget does to the SNR, in dB by the radar equation."""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS, covers
from wired import alone, chain, decided, run, sensor

BASE = {"wavelength_m": 0.03, "integration_gain_db": 4.0, "noise_figure_db": 3.0, "losses_db": 5.0}
RANGES = {target["name"]: float(np.linalg.norm(crooked.ned(target))) for target in crooked.TARGETS}


def snr_db(kind: str, targets=crooked.TARGETS, **keys) -> dict[str, float]:
    """SNR by target; keys that are None are left out of the radar's table."""
    table = {**sensor(kind), "frequency_hz": None, **BASE, **keys}
    given = {key: value for key, value in table.items() if value is not None}
    found = decided(run(chain({"sensor": given}, targets=targets)), block="sensor")
    return {row["target"]: row["snr_db"] for row in found}


def expected_db(kind: str, range_m: float) -> float:
    """P G² λ² σ GI / ((4π)³ k T0 B F L R⁴)."""
    table = sensor(kind)
    power_db = 10.0 * math.log10(table["power_w"] * 0.03**2)
    noise_db = 10.0 * math.log10(1.380649e-23 * 290.0 * table["bandwidth_hz"])
    spread_db = 30.0 * math.log10(4.0 * math.pi) + 40.0 * math.log10(range_m)
    return power_db + 2 * table["antenna_gain_db"] + 3.01 + 4.0 - 3.0 - 5.0 - noise_db - spread_db


@covers("power_w", "antenna_gain_db", "wavelength_m", "integration_gain_db", "noise_figure_db",
        "losses_db", "bandwidth_hz", "frequency_hz", of=LINK_BUDGETS)  # fmt: skip
@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize(
    ("changed", "gained_db"),
    [
        ({}, 0.0),
        ({"power_w": 10.0}, -10.0),
        ({"antenna_gain_db": 33.5}, 7.0),
        ({"wavelength_m": 0.06}, 20.0 * math.log10(2.0)),
        ({"wavelength_m": None, "frequency_hz": 299_792_458.0 / 0.015}, -20.0 * math.log10(2.0)),
        ({"integration_gain_db": 9.0}, 5.0),
        ({"noise_figure_db": 5.0}, -2.0),
        ({"losses_db": 11.0}, -6.0),
        ({"bandwidth_hz": 1e6}, -10.0),
    ],
)
def test_decibels_of_each_quantity(kind, changed, gained_db):
    at_first = {"power_w": 100.0 if kind == "radar.threshold" else 1e9}
    if "power_w" in changed:
        changed = {"power_w": at_first["power_w"] / 10.0}
    found = snr_db(kind, **{**at_first, **changed})
    for name, range_m in RANGES.items():
        assert found[name] == pytest.approx(expected_db(kind, range_m) + gained_db, abs=1e-6)


@covers("calibrate.rcs_dbsm", "calibrate.range_km", "calibrate.pd", "calibrate.swerling",
        of=LINK_BUDGETS)  # fmt: skip
@pytest.mark.parametrize("kind", LINK_BUDGETS)
@pytest.mark.parametrize(
    ("changed", "gained_db"),
    [
        ({}, 0.0),
        ({"rcs_dbsm": 7.0}, -4.0),
        ({"range_km": 8.0}, 40.0 * math.log10(2.0)),
        # Swerling I needs ln Pfa / ln Pd - 1.
        ({"pd": 0.5}, 10.0 * math.log10((math.log(1e-6) / math.log(0.5) - 1) / (
            math.log(1e-6) / math.log(0.8) - 1))),
        # Steady and III, by their own equations solved with SciPy to nine decimals.
        ({"swerling": 0}, -5.281714216),
        ({"swerling": 3}, -2.541911293),
    ],
)  # fmt: skip
def test_decibels_of_a_calibration(kind, changed, gained_db):
    known = {"rcs_dbsm": 3.0, "range_km": 4.0, "pd": 0.8, "swerling": 1}
    found = snr_db(kind, bandwidth_hz=None, calibrate={**known, **changed})
    needed_db = 10.0 * math.log10(math.log(1e-6) / math.log(0.8) - 1.0)
    for name, range_m in RANGES.items():
        here_db = needed_db + 3.01 - 3.0 + 40.0 * math.log10(4000.0 / range_m)
        assert found[name] == pytest.approx(here_db + gained_db, abs=1e-5)


@covers("minimum_range_m", of=(*LINK_BUDGETS, "radar.range_boundary"))
@pytest.mark.parametrize("kind", (*LINK_BUDGETS, "radar.range_boundary"))
def test_nothing_is_heard_nearer_than_the_minimum_range(kind):
    far_m, near_m = RANGES["rolling"], RANGES["diving"]
    for nearest_m, seen in ((near_m - 0.1, 2), (near_m + 0.1, 1), (far_m + 0.1, 0)):
        found = decided(alone(kind, minimum_range_m=nearest_m), block="sensor")
        assert len(found) == seen, nearest_m


@covers("polarisation", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_flat_drops_take_more_of_a_horizontal_wave(kind):
    lost = {}
    for polarisation in ("horizontal", "circular", "vertical"):
        table = sensor(kind, polarisation=polarisation)
        weather = {"rain_rate_mm_h": 20.0, "rain_top_m": 9000.0}
        found = decided(run(chain({"sensor": table}, weather=weather)))
        lost[polarisation] = {row["target"]: -row["snr_db"] for row in found}
    for name in RANGES:
        horizontal, circular, vertical = (lost[key][name] for key in lost)
        assert horizontal > circular + 0.05 > vertical + 0.1


@covers("aspect_rcs", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_table_of_rcs_is_used_unless_told_not_to(kind, tmp_path):
    path = tmp_path / "rcs.csv"
    path.write_text("az_deg,el_deg,dbsm\n0,0,17\n180,0,17\n", encoding="utf-8")
    targets = [{**target, "rcs_table": str(path)} for target in crooked.TARGETS]
    with_table = {r["target"]: r["snr_db"] for r in decided(alone(kind, targets=targets))}
    off = alone(kind, targets=targets, aspect_rcs=False)
    without = {r["target"]: r["snr_db"] for r in decided(off)}
    for name in RANGES:
        assert with_table[name] - without[name] == pytest.approx(17.0 - 3.01, abs=1e-6)
