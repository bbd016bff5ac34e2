"""The ground crosses a threshold that was set for noise; one that follows it keeps Pfa.

The cells of a banked ownship are gone through one by one, each with its own line of sight.
"""

import math

import crooked
import numpy as np
import pytest
from covering import LINK_BUDGETS
from scipy.stats import binom, chi2, kstest, ncx2, norm
from wired import alone, chain, noise_crosses, rows, run, sensor

PFA, GROUND_M, GAMMA_DB = 1e-3, 1500.0, -22.0
STILL = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
RADAR = {
    "azimuth_deg": [-20, 20], "elevation_deg": [-24, 0], "range_km": 4.0, "minimum_range_m": 1000.0,
    "azimuth_resolution_deg": 4.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 150.0,
    "scan_rate_hz": 50, "power_w": 0.1,
}  # fmt: skip
OFTEN = noise_crosses("radar.threshold", PFA)
TERRAIN = {"height_m": GROUND_M, "clutter_gamma_db": GAMMA_DB}


def expected_cells() -> dict[tuple[int, int, int], float]:
    """How often each cell is reported by ground or noise: exp(-V / (1 + CNR))."""
    height = STILL["alt_m"] - GROUND_M
    wavelength = 299_792_458.0 / 35e9
    gain = 10.0**3.0
    noise = 1.380649e-23 * 290.0 * 1e5
    found = {}
    for i in range(10):
        for k in range(6):
            look = crooked.attitude(STILL).T @ crooked.direction(
                math.radians(-18.0 + 4.0 * i), math.radians(-22.0 + 4.0 * k)
            )
            elevation = math.asin(-look[2])
            for j in range(20):
                range_m = 1075.0 + 150.0 * j
                cnr = 0.0
                if range_m >= height:
                    grazing = math.asin(height / range_m)
                    off = (elevation + grazing) / math.radians(4.0)
                    along = min(150.0 / math.cos(grazing),
                                range_m * math.radians(4.0) / math.sin(grazing))  # fmt: skip
                    area = range_m * math.radians(4.0) * along
                    if abs(off) <= 2.0:
                        sigma = 10 ** (0.1 * GAMMA_DB) * math.sin(grazing) * area
                        sigma *= math.exp(-8.0 * math.log(2.0) * off**2)
                        echo = 0.1 * gain**2 * wavelength**2 * sigma
                        cnr = echo / ((4 * math.pi) ** 3 * range_m**4 * noise)
                found[i, k, j] = PFA ** (1.0 / (1.0 + cnr))
    return found


@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_the_ground_is_reported_where_it_crosses_and_no_more_where_the_threshold_follows(kind):
    scans, expected = 100, expected_cells()
    scene = {"ownship": STILL, "targets": [{**crooked.ROLLING, "north_m": 90_000.0}],
             "terrain": TERRAIN, "duration_s": scans / 50}  # fmt: skip
    often = {**RADAR, **noise_crosses(kind, PFA)}
    found = {
        mode: rows(run(chain({"r": sensor(kind, **often, clutter_threshold=mode)}, **scene)))
        for mode in ("noise", "adaptive")
    }
    low, high = binom.interval(0.99, len(expected) * scans, PFA)
    assert low <= len(found["adaptive"]) <= high
    mean = sum(expected.values()) * scans
    deviation = math.sqrt(sum(p * (1.0 - p) for p in expected.values()) * scans)
    assert mean > 3.0 * high
    assert abs(len(found["noise"]) - mean) < norm.ppf(0.995) * deviation
    # By range: where the ground is.
    range_m = np.array([row["range_m"] for row in found["noise"]])
    depth = np.clip((range_m - 1000.0 + 1e-6) // 150.0, 0, 19).astype(int)
    by_depth = np.bincount(depth, minlength=20)
    wanted = np.array([sum(p for (_, _, j), p in expected.items() if j == d) for d in range(20)])
    assert np.corrcoef(by_depth, wanted)[0, 1] > 0.9
    assert all(row["target"] is None for row in found["noise"])


#: Beams that are no multiple of the grid, unlike in the two axes, on a radar mounted askew.
ASKEW = {
    "type": "radar.threshold", "scan_rate_hz": 100, "power_w": 0.2, "antenna_gain_db": 30.0,
    "frequency_hz": 35e9, "bandwidth_hz": 1e5, "clutter_threshold": "noise",
    # Noise is over it with a probability of 0.02.
    "threshold_db": 10.0 * math.log10(-math.log(0.02) - 1.0),
    "azimuth_deg": [-10, 20], "elevation_deg": [-24, 0], "range_km": 3.0, "minimum_range_m": 1200.0,
    "azimuth_beamwidth_deg": 3.0, "elevation_beamwidth_deg": 6.0, "range_resolution_m": 300.0,
    "budget": "free", "errors": "stated", "quantised": False,
    "mount_azimuth_deg": 25.0, "mount_elevation_deg": -22.0, "mount_roll_deg": -15.0,
    "misalignment_deg": [4.0, -3.0, 2.0], "false_alarms": True,
}  # fmt: skip
COUNTS = (10, 4, 6)


def ratios() -> np.ndarray:
    """CNR of each cell of the radar mounted askew, where it truly looks."""
    mounted = crooked.rotation(25.0, -22.0, -15.0) @ crooked.attitude(STILL)
    height, noise = STILL["alt_m"] - GROUND_M, 1.380649e-23 * 290.0 * 1e5
    found = np.zeros(COUNTS)
    for i, k, j in np.ndindex(*COUNTS):
        place = math.radians(-8.5 + 3.0 * i), math.radians(-21.0 + 6.0 * k)
        elevation = math.asin(-(mounted.T @ crooked.direction(*place))[2])
        range_m = 1350.0 + 300.0 * j
        grazing = math.asin(height / range_m)
        off = (elevation + grazing) / math.radians(6.0)
        along = min(300.0 / math.cos(grazing), range_m * math.radians(6.0) / math.sin(grazing))
        sigma = 10 ** (0.1 * GAMMA_DB) * math.sin(grazing) * range_m * math.radians(3.0) * along
        sigma *= math.exp(-8.0 * math.log(2.0) * off**2) * (abs(off) <= 2.0)
        echo = 0.2 * 1e6 * (299_792_458.0 / 35e9) ** 2 * sigma
        found[i, k, j] = echo / ((4 * math.pi) ** 3 * range_m**4 * noise)
    return found


@pytest.mark.parametrize("mean", ["fluctuating", "constant"])
def test_each_cell_of_a_radar_mounted_askew_reports_its_own_ground(mean):
    """Where it truly looks decides, what it believes of its mounting only where that is said."""
    scans, pfa, cnr = 300, 0.02, ratios()
    crossing = pfa ** (1.0 / (1.0 + cnr))
    if mean == "constant":  # a steady echo in noise
        crossing = ncx2.sf(-2.0 * math.log(pfa), 2, 2.0 * np.maximum(cnr, 1e-12))
    ground = (crossing - pfa) / (1.0 - pfa)
    expected = scans * (pfa + ground)
    variance = scans * (pfa * (1.0 - pfa) + ground * (1.0 - ground))
    found = rows(run(chain(
        {"r": ASKEW}, ownship=STILL, targets=[{**crooked.ROLLING, "north_m": 90_000.0}],
        terrain={**TERRAIN, "clutter_mean": mean}, duration_s=scans / 100,
    )))  # fmt: skip
    believed = crooked.rotation(29.0, -25.0, -13.0)
    seen, beyond, within = np.zeros(COUNTS), [], []
    for row in found:
        line = believed @ crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        azimuth, elevation = np.degrees(crooked.angles(line))
        cell = (azimuth + 10.0) / 3.0, (elevation + 24.0) / 6.0, row["range_m"] / 300.0 - 4.0
        seen[tuple(int(number) for number in cell)] += 1
        within.append([number % 1.0 for number in cell])
        beyond.append(10.0 ** (0.1 * row["snr_db"]) + 1.0 + math.log(pfa))
    assert expected.max() > 20.0 * expected.min()
    off = np.sum((seen - expected) ** 2 / variance)
    assert chi2.ppf(0.005, seen.size) < off < chi2.ppf(0.995, seen.size)
    assert min(beyond) > -1e-9
    # Anywhere in their cells, not on the beam's axis.
    for places in np.transpose(within):
        assert kstest(places, "uniform").pvalue > 0.001
    if mean == "fluctuating":
        # What is beyond the threshold of an exponential power has the mean of that power.
        wanted = scans * np.sum(pfa + ground * (1.0 + cnr))
        spread = math.sqrt(scans * np.sum(2.0 * pfa + 2.0 * ground * (1.0 + cnr) ** 2))
        assert abs(sum(beyond) - wanted) < 2.58 * spread


def test_a_wrong_belief_moves_no_ground():
    """Errors of navigation change what the ownship makes of a report, not what is reported."""
    found = {}
    for bias_deg in (0.0, 9.0):
        done = run(chain(
            {"r": sensor("radar.threshold", **RADAR, **OFTEN, clutter_threshold="noise")},
            ownship=STILL, terrain=TERRAIN, duration_s=0.2,
            navigation={"attitude_bias_deg": [3.0, bias_deg, -bias_deg]},
        ))  # fmt: skip
        found[bias_deg] = done["detections"].select(["scan", "azimuth_rad", "range_m", "snr_db"])
    assert found[0.0].num_rows > 20 and found[0.0].equals(found[9.0])


def test_a_radar_that_is_off_reports_no_ground():
    assert not rows(alone("radar.threshold", **{**RADAR, **OFTEN, "enabled": False}))
