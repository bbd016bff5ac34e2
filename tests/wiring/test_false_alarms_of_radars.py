"""Where in a radar's cells noise is reported, how strong it is, and what its margin is from."""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS
from scipy.special import gammainccinv
from wired import alone, rows

PFA = 1e-3
VIEW = {
    "azimuth_deg": [-40, 60], "elevation_deg": [-30, 10], "range_km": 3.0, "minimum_range_m": 1.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 100.0,
    "false_alarms": True, "false_alarm_probability": PFA, "scan_rate_hz": 20,
}  # fmt: skip


def alarms(kind: str, **keys) -> dict[str, np.ndarray]:
    found = rows(alone(kind, **{**VIEW, **keys}), target=None)
    assert len(found) > 100
    return {name: np.array([row[name] for row in found]) for name in (
        "azimuth_rad", "elevation_rad", "range_m", "snr_db", "confidence")}  # fmt: skip


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_alarms_lie_on_the_grid_and_their_places_are_independent(kind):
    found = alarms(kind)
    steps = {"azimuth_rad": math.radians(2.0), "elevation_rad": math.radians(4.0), "range_m": 100.0}
    for name, step in steps.items():
        whole = found[name] / step
        np.testing.assert_allclose(whole, np.rint(whole), atol=1e-6)
    together = np.corrcoef([found[name] for name in steps])
    assert np.max(np.abs(together - np.eye(3))) < 0.25


@pytest.mark.parametrize("pulses", [1, 10])
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_noise_crosses_the_threshold_of_so_many_pulses(kind, pulses):
    """The sum of n exponential variables beyond the point that it exceeds with PFA."""
    snr = 10.0 ** (0.1 * alarms(kind, pulses=pulses)["snr_db"])
    lowest = gammainccinv(pulses, PFA) / pulses - 1.0
    assert lowest * (1.0 - 1e-9) <= np.min(snr) < 1.05 * lowest
    # One in ten of them lies beyond the point that noise exceeds with a tenth of PFA.
    tenth = gammainccinv(pulses, 0.1 * PFA) / pulses - 1.0
    assert np.mean(snr > tenth) == pytest.approx(0.1, abs=0.06)


def test_margins_are_from_the_threshold_or_from_the_snr_of_the_reference_pd():
    found = alarms("radar.threshold", threshold_db=3.5)
    np.testing.assert_allclose(found["snr_db"] - found["confidence"], 3.5, rtol=1e-9)
    for swerling, pd in ((1, 0.9), (2, 0.6)):
        found = alarms("radar.swerling", swerling=swerling, reference_pd=pd)
        needed_db = 10.0 * math.log10(math.log(PFA) / math.log(pd) - 1.0)
        np.testing.assert_allclose(found["snr_db"] - found["confidence"], needed_db, rtol=1e-9)


@pytest.mark.parametrize("nearest_m", [1.0, 1500.0])
def test_cells_begin_at_the_minimum_range(nearest_m):
    """Of 50 by 10 by 30 cells, or by 15."""
    range_m = alarms("radar.threshold", minimum_range_m=nearest_m)["range_m"]
    assert nearest_m - 50.0 <= np.min(range_m) < nearest_m + 150.0
    assert np.max(range_m) <= 3000.0
    expected = 50 * 10 * (30 if nearest_m == 1.0 else 15) * PFA * 20
    assert len(range_m) == pytest.approx(expected, abs=4.5 * math.sqrt(expected))


def test_a_radar_that_is_off_reports_no_noise():
    found = alone("radar.threshold", **VIEW, enabled=False, targets=crooked.TARGETS)
    assert not rows(found)


@pytest.mark.parametrize("pulses", [1, 10])
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_echoes_are_as_strong_as_measured_and_spread_as_their_pulses_do(kind, pulses):
    """A strong target's SNR plus the noise of 1: gamma of as many pulses, its mean the true one."""
    keys = {"pulses": pulses, "power_w": 1e4, "swerling": 0, "scan_rate_hz": 500}
    if kind == "radar.threshold":
        keys.pop("swerling")
    view = {**VIEW, "azimuth_deg": [-180, 180], "elevation_deg": [-90, 90], **keys,
            "cell_false_alarm_probability": 1e-9}  # fmt: skip
    true, seen = (
        {row["scan"]: row["snr_db"] for row in rows(alone(kind, **keys), target="rolling")}
        for keys in ({**view, "false_alarms": False}, view)
    )
    assert len(seen) == 500 and min(true.values()) > 30.0
    share = np.array([
        (10.0 ** (0.1 * seen[scan]) + 1.0) / (10.0 ** (0.1 * true[scan]) + 1.0) for scan in seen
    ])  # fmt: skip
    spread = 1.0 / math.sqrt(pulses)
    assert abs(share.mean() - 1.0) < 2.58 * spread / math.sqrt(500)
    assert share.std() == pytest.approx(spread, rel=0.2)
