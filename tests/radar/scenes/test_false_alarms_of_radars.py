"""Where in a radar's cells noise is reported, how strong it is, and what its margin is from."""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS
from scipy.special import gammainccinv
from wired import alone, decided, rows

PFA = 1e-3
VIEW = {
    "azimuth_deg": [-40, 60], "elevation_deg": [-30, 10], "range_km": 3.0, "minimum_range_m": 1.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 100.0,
    "false_alarms": True, "false_alarm_probability": PFA, "scan_rate_hz": 20,
}  # fmt: skip


def crossing_db(pulses: int = 1, pfa: float = PFA) -> float:
    """The SNR that the sum of so many pulses of noise exceeds with a probability."""
    return 10.0 * math.log10(gammainccinv(pulses, pfa) / pulses - 1.0)


def alarms(kind: str, **keys) -> dict[str, np.ndarray]:
    if kind == "radar.threshold":
        keys = {"threshold_db": crossing_db(keys.get("pulses", 1)), **keys}
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


@pytest.mark.parametrize("pulses", [1, 10])
def test_noise_knows_the_threshold_that_targets_do(pulses):
    """As often, and as strong, as noise exceeds the SNR that is stated: none at 21 dB."""
    high_db = crossing_db(pulses, 0.5 * PFA)
    found = alarms("radar.threshold", threshold_db=high_db, pulses=pulses)
    assert high_db - 1e-9 <= np.min(found["snr_db"]) < high_db + 0.3
    expected = 50 * 10 * 30 * 0.5 * PFA * 20
    assert len(found["snr_db"]) == pytest.approx(expected, abs=4.5 * math.sqrt(expected))
    silent = alone("radar.threshold", **VIEW, threshold_db=21.0, pulses=pulses)
    assert not rows(silent, target=None)


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
def test_steady_echoes_are_as_strong_as_a_noncentral_sum(kind, pulses):
    """SNR plus the noise of 1: twice the sum is chi-square, noncentral by twice the SNR of all."""
    from scipy.stats import kstest, ncx2

    keys = {"pulses": pulses, "power_w": 30.0, "swerling": 0, "scan_rate_hz": 500}
    if kind == "radar.threshold":
        keys = {**keys, "threshold_db": 10.0}
        keys.pop("swerling")
    view = {**VIEW, "azimuth_deg": [-180, 180], "elevation_deg": [-90, 90], **keys,
            "false_alarm_probability": 1e-6}  # fmt: skip
    found = alone(kind, **view)
    true, seen = (
        {row["scan"]: row["snr_db"] for row in read(found, target="rolling")}
        for read in (decided, rows)
    )
    assert len(seen) == 500 and min(true.values()) > 17.0
    places = [
        ncx2.cdf(
            2.0 * pulses * (10.0 ** (0.1 * seen[scan]) + 1.0),
            2.0 * pulses,
            2.0 * pulses * 10.0 ** (0.1 * true[scan]),
        )
        for scan in seen
    ]
    assert kstest(places, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_false_alarms_change_nothing_of_what_is_measured_of_targets(kind):
    """Errors by signal follow the strength that is measured, whether noise is reported or not."""
    keys = {
        "errors": "signal", "azimuth_beamwidth_deg": 4.0, "elevation_beamwidth_deg": 4.0,
        "scan_rate_hz": 100, "power_w": 100.0, "azimuth_deg": [-180, 180],
        "elevation_deg": [-90, 90],
    }  # fmt: skip
    if kind == "radar.threshold":
        keys["threshold_db"] = 8.0
    quiet, noisy = (
        [
            {name: value for name, value in row.items() if name != "declared"}
            for row in sorted(
                rows(alone(kind, **{**VIEW, **keys, "false_alarms": asked})),
                key=lambda row: (row["scan"], row["target"] or ""),
            )
            if row["target"] is not None
        ]
        for asked in (False, True)
    )
    assert len(quiet) > 100 and quiet == noisy
    # And each row states its own: no two strengths are alike.
    assert len({row["snr_db"] for row in quiet}) == len(quiet)
