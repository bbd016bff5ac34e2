"""Noise reports as often as its probability says: 1e5 looks of every sensor that has any."""

import crooked
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS
from scipy.stats import binom, chi2
from wired import chain, noise_crosses, sensor

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

PFA, PER_FRAME = 2e-4, 0.03
#: 20 by 5 by 10 cells, in the sensor's own axes, askew on a banked ownship.
CELLS = 1000
RADAR = {
    "azimuth_deg": [-15, 25], "elevation_deg": [-12, 8], "range_km": 2.0, "minimum_range_m": 500.0,
    "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0, "range_resolution_m": 150.0,
    "mount_azimuth_deg": 30.0, "mount_roll_deg": 25.0, "misalignment_deg": [1.0, 0.0, 0.0],
}  # fmt: skip
CAMERA = {"azimuth_deg": [-15, 25], "range_km": 2.0, "false_alarms_per_frame": PER_FRAME,
          "threshold": 1.0, "noise_equivalent_contrast": None}  # fmt: skip
FAR = [{**crooked.ROLLING, "north_m": -60_000.0}]


def noisy(rate_hz: int) -> dict:
    sensors = {
        kind.replace(".", "_"): sensor(
            kind, scan_rate_hz=rate_hz, **RADAR, **noise_crosses(kind, PFA)
        )
        for kind in LINK_BUDGETS
    }
    for kind in CAMERAS:
        sensors[kind.replace(".", "_")] = sensor(kind, scan_rate_hz=rate_hz, **CAMERA)
    return sensors


def counts(tables, block: str) -> np.ndarray:
    scans = tables["scans"].filter(np.array(tables["scans"]["block"]) == block)
    return np.asarray(scans["detected"])


def recorded(simulate, **options):
    memory = MemorySink()
    simulate(recorder=Recorder([memory]), **options).run()
    return memory.tables()


@pytest.fixture(scope="module")
def looks():
    scene = {**chain(noisy(1000), targets=FAR, duration_s=100), "seed": 4}
    return recorded(lambda **options: Simulation(dsa_des.load_scene(scene), **options))


@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_alarms_come_as_often_as_their_probability_says(looks, kind):
    found = counts(looks, kind.replace(".", "_"))
    assert len(found) == 100_000
    trials, p = (CELLS, PFA) if kind in LINK_BUDGETS else (1, PER_FRAME)
    low, high = binom.interval(0.99, trials * len(found), p)
    assert low <= found.sum() <= high
    # Not only the mean: how many scans have none, one, two.
    expected = binom.pmf(np.arange(3), trials, p) * len(found)
    seen = np.array([np.count_nonzero(found == k) for k in range(3)])
    kept = expected > 5.0
    assert np.sum((seen - expected)[kept] ** 2 / expected[kept]) < chi2.ppf(0.99, 3)
    # One scan knows nothing of the one before.
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 2.58 / np.sqrt(len(found))
