"""Errors of measured values are the same for any window, and for replicas together or alone."""

import numpy as np
import pytest
from same_runs import replicas_of, same_as_alone

from dsa_des.library.scenes import load_scene
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

FIRST_LIGHT = "configs/first_light.toml"
ERRORS = [
    "blocks.radar.errors=signal", "blocks.radar.azimuth_beamwidth_deg=4",
    "blocks.radar.elevation_beamwidth_deg=5", "blocks.radar.measures_range_rate=true",
    "blocks.radar.range_rate_resolution_m_s=3", "blocks.radar.budget=free",
    "blocks.radar.range_error_m=12", "blocks.radar.range_correlation_time_s=7",
    "blocks.radar.range_bias_m=9", "blocks.radar.mount_azimuth_deg=20",
    "blocks.eo.errors=stated", "blocks.eo.azimuth_error_deg=0.3",
    "blocks.eo.azimuth_correlation_time_s=2", "blocks.eo.elevation_bias_deg=0.5",
    "blocks.ir.errors=signal", "blocks.ir.noise_equivalent_contrast=0.1",
]  # fmt: skip
SWEEP = ["blocks.radar.beam_sweep=true"]


def scene(*changes, duration_s="60"):
    return load_scene(FIRST_LIGHT, sets=[*ERRORS, *changes], duration_s=duration_s)


def recorded(of, **options):
    sink = MemorySink()
    Simulation(of, recorder=Recorder([sink]), **options).run()
    return sink.tables()["detections"]


@pytest.mark.parametrize("more", [[], SWEEP])
def test_replicas_together_and_alone(more):
    simulation = same_as_alone(replicas_of(scene(*more), {}, {}, {}))
    assert not simulation.timeline.split


@pytest.mark.parametrize("more", [[], SWEEP])
def test_any_window(more):
    seen = scene("blocks.traffic.intruders[0].north_m=1500", *more, duration_s="6")
    whole = recorded(seen)
    assert whole.num_rows > 100
    for window in (1, 17):
        assert recorded(seen, window=window).equals(whole)


def test_scan_rates_share_what_lasts():
    """Twice as many scans: at the instants that both have, an error that lasts is the same."""
    certain = ("blocks.eo.quantised=false", "blocks.eo.noise_equivalent_contrast=0")
    found = []
    for rate in (2, 4):
        table = recorded(scene(*certain, f"blocks.eo.scan_rate_hz={rate}", duration_s="100"))
        column = {n: table[n].to_numpy(zero_copy_only=False) for n in table.column_names}
        mine = (column["block"] == "eo") & (column["target"] == "head_on")
        off = column["azimuth_rad"][mine] - column["true_azimuth_rad"][mine]
        found.append(dict(zip(column["tick"][mine].tolist(), off.tolist(), strict=True)))
    slow, fast = found
    common = sorted(slow.keys() & fast.keys())
    assert len(common) == len(slow) > 10
    np.testing.assert_array_equal([slow[t] for t in common], [fast[t] for t in common])
