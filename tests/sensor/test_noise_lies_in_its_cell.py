"""What noise makes of a look at a faint target lies anywhere in its cell, and says no more."""

import math

import crooked
import numpy as np
import pytest
from scipy.stats import binom, kstest, norm
from wired import chain, decided, rows, run, sensor

BEAM_DEG, CELL_M, PFA = (3.0, 5.0), 120.0, 0.04
RADAR = {
    "errors": "signal", "azimuth_beamwidth_deg": BEAM_DEG[0],
    "elevation_beamwidth_deg": BEAM_DEG[1],
    "range_resolution_m": CELL_M, "false_alarm_probability": PFA, "swerling": 1,
    "scan_rate_hz": 200, "budget": "free", "reference_pd": 0.5, "glint_share": 0.0,
}  # fmt: skip
STILL = {"speed_mps": 0.0, "climb_mps": 0.0}
OWN = {**crooked.OWNSHIP, **STILL}


def reports(rcs_dbsm: float, power_w: float, looks: int = 20_000) -> dict[str, np.ndarray]:
    target = {**crooked.ROLLING, **STILL, "rcs_dbsm": rcs_dbsm}
    radar = sensor("radar.swerling", **{**RADAR, "power_w": power_w})
    scene = chain({"radar": radar}, ownship=OWN, targets=[target], duration_s=looks / 200)
    found = rows(run(scene))
    return {name: np.array([row[name] for row in found]) for name in (
        "azimuth_rad", "elevation_rad", "range_m", "true_azimuth_rad", "true_elevation_rad",
        "true_range_m", "azimuth_variance_rad2", "elevation_variance_rad2", "range_variance_m2",
        "snr_db")}  # fmt: skip


def spread_in_cell(place: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Where each place lies in the distribution of anywhere in a cell of 1, and a normal error."""

    def summed(x):
        return x * norm.cdf(x) + norm.pdf(x)

    return deviation * (summed(place / deviation) - summed((place - 1.0) / deviation))


def test_far_below_the_noise_a_report_is_anywhere_in_the_cell():
    looks, places = 20_000, []
    found = reports(-140.0, 1.0, looks)
    low, high = binom.interval(0.99, looks, PFA)
    assert low <= len(found["range_m"]) <= high
    for name, width, variance in (
        ("azimuth_rad", math.radians(BEAM_DEG[0]), "azimuth_variance_rad2"),
        ("elevation_rad", math.radians(BEAM_DEG[1]), "elevation_variance_rad2"),
        ("range_m", CELL_M, "range_variance_m2"),
    ):
        # The cell of the truth, by its number: the same for every target in it.
        number = np.rint(found[f"true_{name}"][0] / width)
        place = found[name] / width - number + 0.5
        places.append(place)
        step = 0.0 if name != "range_m" else 1.0
        slope2 = 1.6**2 if step == 0.0 else 1.0
        # It states what any report as strong states.
        of_strength = np.minimum(0.5 / (slope2 * 10.0 ** (0.1 * found["snr_db"])), 1 / 12)
        np.testing.assert_allclose(found[variance], width**2 * (of_strength + step / 12), rtol=1e-9)
        if step == 0.0:
            inside = spread_in_cell(place, np.sqrt(of_strength))
            assert kstest(inside, "uniform").pvalue > 0.01
    assert not np.any(found["range_m"] == found["true_range_m"])
    # Where it lies across the cell tells nothing of how high up in it.
    assert abs(np.corrcoef(places[0], places[1])[0, 1]) < 2.58 / math.sqrt(len(place))


def test_what_the_ground_makes_of_a_look_lies_in_the_cell_as_well():
    """A threshold for noise alone, and ground that crosses it: nothing is where the target is."""
    target = {**crooked.DIVING, **STILL, "rcs_dbsm": -100.0}
    radar = sensor("radar.swerling", **{**RADAR, "clutter_threshold": "noise", "power_w": 1e4})
    terrain = {"height_m": 1850.0, "clutter_gamma_db": -75.0}
    scene = chain({"radar": radar}, ownship=OWN, targets=[target], duration_s=10, terrain=terrain)
    found = rows(run(scene))
    share = len(found) / 2000
    assert 3 * PFA < share < 0.9
    width = math.radians(BEAM_DEG[0])
    number = round(found[0]["true_azimuth_rad"] / width)
    place = np.array([row["azimuth_rad"] for row in found]) / width - number + 0.5
    deviation = np.sqrt([row["azimuth_variance_rad2"] for row in found]) / width
    assert kstest(spread_in_cell(place, deviation), "uniform").pvalue > 1e-3
    # As strong as what crosses: an exponential power of noise and ground, whose mean its share is.
    threshold = -math.log(PFA)
    mean = threshold / -math.log(share)
    beyond = 1.0 + 10.0 ** (0.1 * np.array([row["snr_db"] for row in found])) - threshold
    assert kstest(beyond / mean, "expon").pvalue > 1e-3


@pytest.mark.parametrize("power_w", [3.0, 30.0])
def test_the_weakest_of_a_target_s_detections_are_noise(power_w):
    """Pd = 1 - (1 - Pfa)(1 - share of the target); the others err as their strength says."""
    found = reports(0.0, power_w)
    target = {**crooked.ROLLING, **STILL, "rcs_dbsm": 0.0}
    exact = sensor("radar.swerling", **{**RADAR, "power_w": power_w, "errors": "grid"})
    (mean_db,) = {
        row["snr_db"]
        for row in decided(
            run(chain({"radar": exact}, ownship=OWN, targets=[target], duration_s=1))
        )
    }
    power = 1.0 + 10.0 ** (0.1 * mean_db)
    pd = PFA ** (1.0 / power)
    of_target = (pd - PFA) / (1.0 - PFA)
    assert 0.2 < pd < 0.999
    output = 1.0 + 10.0 ** (0.1 * found["snr_db"])
    # The tail of an exponential power of that mean, of which noise has the lower end.
    assert kstest(np.exp(-output / power) / pd, "uniform").pvalue > 1e-3
    noise = output < -power * math.log(of_target)
    low, high = binom.interval(0.99, 20_000, pd - of_target)
    assert low <= np.count_nonzero(noise) <= high
    width = math.radians(BEAM_DEG[0])
    number = np.rint(found["true_azimuth_rad"][0] / width)
    place = found["azimuth_rad"] / width - number + 0.5
    deviation = np.sqrt(found["azimuth_variance_rad2"]) / width
    inside = spread_in_cell(place[noise], deviation[noise])
    assert kstest(inside, "uniform").pvalue > 1e-3
    off = (found["azimuth_rad"] - found["true_azimuth_rad"])[~noise]
    assert kstest(off / np.sqrt(found["azimuth_variance_rad2"][~noise]), "norm").pvalue > 1e-3
