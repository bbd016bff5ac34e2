"""Targets are reported as often as the model says: 1e5 looks in each mode, in lock step too.

Swerling I at one SNR: Pd = Pfa^(1 / (1 + SNR)). Other sensors leave nothing to chance.
"""

import math

import crooked
import numpy as np
import pytest
from scipy.stats import binom
from wired import chain, rows, run, sensor

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation

PFA, SCANS, COUNT = 1e-3, 2000, 50
BEAM = {
    "azimuth_beamwidth_deg": 2.0, "elevation_beamwidth_deg": 2.0, "range_resolution_m": 50.0,
    "budget": "free", "scan_rate_hz": 200,
}  # fmt: skip
MODES = {
    "grid": {},
    "stated": {"errors": "stated", "azimuth_error_deg": 1.0},
    "signal": {"errors": "signal"},
}
#: Beside the ownship, and all as far from it, so that they stay where they are; each in a cell.
RING = [
    {"name": f"t{n}", "east_m": 2500 * math.sin(a), "north_m": 2500 * math.cos(a), "up_m": 0.0,
     **{key: crooked.OWNSHIP[key] for key in ("heading_deg", "speed_mps", "climb_mps")}}
    for n, a in enumerate(np.arange(COUNT) * 2.0 * math.pi / COUNT)
]  # fmt: skip


def scene(seed: int) -> dict:
    radar = {**BEAM, "power_w": 3.0, "swerling": 1, "false_alarm_probability": PFA}
    sensors = {mode: sensor("radar.swerling", **radar, **keys) for mode, keys in MODES.items()}
    record = {"truth": False}
    made = chain(sensors, targets=RING, duration_s=SCANS / BEAM["scan_rate_hz"], record=record)
    return {**made, "seed": seed}


def counted(simulate, **options) -> dict:
    memory = MemorySink()
    wanted = {"scans": ("tick", "block", "detected")}
    simulate(recorder=Recorder([memory], wanted=wanted), **options).run()
    return memory.tables()["scans"]


def mean_snr(mode: str) -> np.ndarray:
    """What a look hears on average, the same at the end of the run as at its beginning."""
    short = {**scene(3), "duration_s": 0.01, "record": {"looks": True}}
    return np.array(
        [10.0 ** (0.1 * row["snr_db"]) for row in rows(run(short), "looks", block=mode)]
    )


@pytest.mark.parametrize("together", [False, True])
def test_targets_are_detected_as_often_as_the_model_says(together):
    if together:
        scenes = [dsa_des.load_scene(scene(seed)) for seed in (5, 6)]
        scans = counted(lambda **options: make_lockstep_simulation(scenes, **options))
    else:
        scans = counted(lambda **options: Simulation(dsa_des.load_scene(scene(4)), **options))
    looks = SCANS * COUNT * (2 if together else 1)
    for mode in MODES:
        snr = mean_snr(mode)
        assert np.ptp(snr) < 1e-3 * snr[0]
        pd = PFA ** (1.0 / (1.0 + snr.mean()))
        assert 0.3 < pd < 0.8
        low, high = binom.interval(0.99, looks, pd)
        detected = np.asarray(scans["detected"])[np.asarray(scans["block"]) == mode]
        assert low <= detected.sum() <= high, mode
