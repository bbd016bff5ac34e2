"""The shipped sensors of RTCA DO-365, appendix Q, err as it states, over draws of a scene."""

import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from wired import chain

import dsa_des

SENSORS = Path(__file__).parents[2] / "configs" / "sensors"
FOOT_M, NMI_M = 0.3048, 1852.0
#: Half width of a 99.9 % interval, in standard deviations.
Z = NormalDist().inv_cdf(0.9995)
OWNSHIP = {
    "lat_deg": -42.0, "lon_deg": 179.99, "alt_m": 1500.0, "heading_deg": 217.0, "speed_mps": 60.0,
}  # fmt: skip


def around(count, distance_m, sector_deg):
    """Aircraft that fly beside the ownship, spread over a sector about its nose."""
    found = []
    for number in range(count):
        bearing = math.radians(217.0 + sector_deg * (number / (count - 1) - 0.5))
        found.append({
            "extends": str(SENSORS / "do365_equipage.toml"), "name": f"aircraft {number}",
            "east_m": distance_m * math.sin(bearing), "north_m": distance_m * math.cos(bearing),
            "up_m": 0.0, "heading_deg": 217.0, "speed_mps": 60.0,
        })  # fmt: skip
    return found


def detected(kind, seed, *, targets, duration_s, roll_deg=20.0):
    """Return the columns of what a shipped sensor detects."""
    scene = chain(
        {"sensor": {"extends": str(SENSORS / f"do365_{kind}.toml")}},
        ownship={**OWNSHIP, "roll_deg": roll_deg}, targets=targets, duration_s=duration_s,
        seed=seed,
    )  # fmt: skip
    table = dsa_des.run(scene)["detections"]
    return {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}


def off(columns, name):
    error = columns[name] - columns[f"true_{name}"]
    if name != "range_m":
        error = np.remainder(error + math.pi, 2.0 * math.pi) - math.pi
    return error


def has_deviation(sample, sigma):
    return abs(sample.std() / sigma - 1.0) < Z * (0.5 / len(sample)) ** 0.5


RADAR = {
    "range_m": (21.34, 15.24),
    "azimuth_rad": (math.radians(1.0), math.radians(0.5)),
    "elevation_rad": (math.radians(1.0), math.radians(0.5)),
}


def test_the_radar_s_errors_are_white_beside_a_bias_of_each_run():
    biases = {name: [] for name in RADAR}
    for seed in range(12):
        columns = detected("radar", seed, targets=around(8, 5000.0, 60.0), duration_s=40)
        for name, (sigma, _) in RADAR.items():
            error = off(columns, name)
            assert has_deviation(error, sigma), (seed, name)
            biases[name].append(error.mean() / sigma)
    for name, (sigma, bias) in RADAR.items():
        found = np.array(biases[name]) * sigma
        assert np.abs(found).max() < bias + Z * sigma / 320**0.5
        # Uniform: its deviation is bias / sqrt(3), known of twelve draws to within a half.
        assert 0.5 < found.std() * 3.0**0.5 / bias < 1.5


def test_the_radar_looks_110_degrees_to_the_sides_and_no_nearer_than_4000_feet():
    near = detected("radar", 1, targets=around(2, 3990.0 * FOOT_M, 10.0), duration_s=5)
    assert not len(near["range_m"])

    def sides(distance_m):
        found = detected(
            "radar", 1, targets=around(15, distance_m, 350.0), duration_s=5, roll_deg=0.0
        )
        return np.abs(np.degrees(found["true_azimuth_rad"]))

    # Of aircraft of 117 kt it acquires those at the sides within 0.43 of 6 nmi: 4778 m.
    assert 90.0 < sides(4770.0).max() < 110.0
    assert 70.0 < sides(4800.0).max() < 90.0


def test_active_surveillance_ranges_too_far_and_bears_badly():
    columns = detected("active", 3, targets=around(20, 6000.0, 300.0), duration_s=300)
    error = off(columns, "range_m")
    # Errors of range last 1 s: of looks every 5 s hardly anything is left.
    assert abs(error.mean() - 125.0 * FOOT_M) < Z * 50.0 * FOOT_M / len(error) ** 0.5
    assert has_deviation(error, 50.0 * FOOT_M)
    level = np.abs(columns["true_elevation_rad"]) < math.radians(9.0)
    bearing = off(columns, "azimuth_rad")[level]
    assert np.abs(bearing).max() <= math.radians(27.0)
    # Cut at three of its deviations, of which 0.987 are left.
    assert has_deviation(bearing, 0.9866 * math.radians(9.0))


@pytest.mark.parametrize(("nmi", "within_s"), [(5.0, 3.0), (15.0, 7.0)])
def test_ads_b_reports_come_within_3_and_7_seconds(nmi, within_s):
    columns = detected("ads_b", 4, targets=around(15, nmi * NMI_M, 340.0), duration_s=200)
    in_1_s = len(columns["scan"]) / (15 * 200)
    expected = 1.0 - 0.05 ** (1.0 / within_s)
    # Two messages a second on average, of which one has to come: between 1.5 and 2.5 of them.
    assert expected - 0.06 < in_1_s < expected + 0.02


def test_ads_b_positions_err_by_the_equipage_for_minutes():
    runs = [detected("ads_b", seed, targets=around(40, 9000.0, 340.0), duration_s=6)
            for seed in range(8)]  # fmt: skip
    across = []
    for columns in runs:
        _, first = np.unique(columns["target"], return_index=True)
        level = columns["true_range_m"] * np.cos(columns["true_elevation_rad"])
        across.append(level[first] * off(columns, "azimuth_rad")[first])
    assert has_deviation(np.concatenate(across), 185.2 / math.sqrt(-2.0 * math.log(0.05)))
    assert not len(detected("ads_b", 1, targets=around(2, 21 * NMI_M, 9.0), duration_s=9)["scan"])


def test_the_eo_ir_sensor_errs_by_a_milliradian_and_3_percent_and_sees_no_farther_than_2_5_nmi():
    columns = detected("eo_ir", 5, targets=around(9, 4600.0, 320.0), duration_s=20)
    for name in ("azimuth_rad", "elevation_rad"):
        error = off(columns, name)
        assert has_deviation(error, 1e-3)
        assert abs(error.mean()) < Z * 1e-3 / len(error) ** 0.5
    # Ranges err by 3 % of them, for 5 s: one look at each of many.
    once = detected("eo_ir", 6, targets=around(200, 3000.0, 320.0), duration_s=0.1)
    assert len(once["scan"]) == 200
    assert has_deviation(off(once, "range_m") / once["true_range_m"], 0.03)
    far = detected("eo_ir", 5, targets=around(2, 4640.0, 320.0), duration_s=2)
    assert not len(far["scan"])
