"""The scanning laser in scenes: its statistics, whatever the window and the company."""

import math

import numpy as np
import pytest

from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "configs/laser/power_line.toml"
# Banked, off north and south of the equator, after a latency.
CROOKED = [
    "blocks.traffic.ownship.lat_deg=-41", "blocks.traffic.ownship.heading_deg=217",
    "blocks.traffic.ownship.roll_deg=11", "blocks.traffic.ownship.pitch_deg=3",
    "blocks.laser.latency_s=0.13", "blocks.laser.mount_elevation_deg=-2",
    "blocks.traffic.wires.0.posts=[{east_m=-400,north_m=-800,up_m=-20},"
    "{east_m=-700,north_m=-500,up_m=8}]",
]  # fmt: skip


def tables_of(scene, runner=Simulation, **options):
    sink = MemorySink()
    runner(scene, recorder=Recorder([sink]), **options).run()
    return sink.tables()


def a_hundred_at(range_m, **laser):
    """A hundred alike targets at one range from an ownship at rest, in a field of ±12 deg."""
    angles = np.radians(np.linspace(-12.0, 12.0, 100))
    places = ",".join(
        f"{{name='t{i}',east_m={range_m * math.sin(a)},north_m={range_m * math.cos(a)},"
        f"up_m={range_m**2 / 2 / 6.39e6},laser={{area_m2=0.004,reflectivity=0.3}}}}"
        for i, a in enumerate(angles.tolist())
    )
    return [
        "blocks.traffic.wires=[]", f"blocks.traffic.intruders=[{places}]",
        "blocks.traffic.ownship.speed_mps=0",
        *(f"blocks.laser.{k}={v}" for k, v in laser.items()),
    ]  # fmt: skip


def test_share_of_detections_and_errors_are_those_that_are_stated():
    range_m = 520.0
    sets = a_hundred_at(range_m, hits_needed=1, range_bias_m=0.4, biases="'fixed'")
    still = ["tracker=tracking.hold_last"]
    scene = load_scene(SCENE, swaps=still, sets=[*sets, "record.looks=true"], duration_s="334")
    tables = tables_of(scene)
    looks = tables["looks"].num_rows
    assert looks > 100_000
    # By hand: a small target, and the pattern of 200 x 95 shots in 32 x 32 deg.
    share = 0.004 / (math.pi * (1.5e-3 * range_m) ** 2 / 4.0)
    power_w = 5000.0 * 0.5 * share * 0.3 * (0.025 / range_m) ** 2
    one = 0.5 * math.erfc((5.9978070150 - power_w / 2e-9) / math.sqrt(2.0))
    shots = math.pi / 4.0 * 1.5e-3**2 / (math.radians(32.0) ** 2 / 200.0 / 95.0)
    pd = shots * one
    assert 0.01 < pd < 0.2 and shots < 1.0
    found = tables["detections"].to_pydict()
    count = len(found["range_m"])
    assert abs(count / looks - pd) < 2.576 * math.sqrt(pd * (1.0 - pd) / looks)
    for name, unit, bias in (
        ("azimuth", "rad", 0.0), ("elevation", "rad", 0.0), ("range", "m", 0.4),
    ):  # fmt: skip
        error = np.subtract(found[f"{name}_{unit}"], found[f"true_{name}_{unit}"]) - bias
        variance = np.array(found[f"{name}_variance_{unit}2"]) - bias**2
        scaled = error / np.sqrt(variance)
        assert abs(scaled.mean()) < 2.576 / math.sqrt(count), name
        assert abs(scaled.var() - 1.0) < 2.576 * math.sqrt(2.0 / count), name
    # Echoes that passed are as strong as Gaussian noise about the mean makes them.
    amplitude = 10.0 ** (np.array(found["snr_db"]) / 20.0)
    above = np.array([0.5 * math.erfc((a - power_w / 2e-9) / math.sqrt(2.0)) for a in amplitude])
    uniform = np.sort(above / one)
    rank = (np.arange(count) + 0.5) / count
    assert np.abs(uniform - rank).max() < 1.63 / math.sqrt(count)
    assert not {"detection_probability"} & {n for n, v in found.items() if v[0] is not None}


def test_a_sweep_dates_each_piece_by_its_column():
    scene = load_scene(SCENE, sets=[*CROOKED, "blocks.laser.beam_sweep=true"], duration_s="12")
    found = tables_of(scene)["detections"].to_pydict()
    # The mount looks down: the sensor's azimuth is the body's, but for a few hundredths of a deg.
    part = (np.degrees(found["azimuth_rad"]) + 16.0) / 32.0
    # Scans of 1/3 s; a latency dates the report, not the look.
    since = np.array(found["illuminated_s"]) % (1.0 / 3.0)
    assert np.abs(since - part / 3.0).max() < 0.004


def test_fog_takes_more_and_clear_air_nothing():
    counts = [
        tables_of(load_scene(SCENE, sets=sets))["detections"].num_rows
        for sets in ([], ["weather.visibility_km=23"], ["weather.visibility_km=0.5"])
    ]
    assert counts[0] >= counts[1] > 3 * counts[2] > 0


def test_impossible_lasers_are_refused_with_what_is_allowed():
    for sets, words in (
        (["blocks.laser.range_km=5"], "unambiguous to 2.63 km"),
        (["blocks.laser.divergence_mrad=0"], "divergence_mrad"),
        (["blocks.laser.azimuth_deg=[10,-10]"],
         r"azimuth_deg is \[10, -10\]: .* is 340 deg wide; allowed: \[-10, 10\], or \[10, 350\]"),
        (["blocks.traffic.intruders=[{name='a',east_m=1,north_m=9,laser={wire_diameter_mm=3}}]"],
         "belong together"),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=words):
            load_scene(SCENE, sets=sets)
