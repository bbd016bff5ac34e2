"""The flow of rendered targets against their true pixels, over several seeds."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.examples import find_example
from dsa_des.scene.scene import load_scene

#: Straight on, then banked at 4 deg/s: the picture moves by tens of pixels a frame.
_OWNSHIP = (
    "blocks.traffic.ownship={ lat_deg = -33.9, lon_deg = 18.4, alt_m = 900, heading_deg = 217, "
    'speed_mps = 45, legs = [{ kind = "straight", duration_s = 2 }, '
    '{ kind = "turn", rate_deg_s = 4 }] }'
)
#: North, east and up, m, heading, deg, and speed, m/s.
_TARGETS = ((-540, -480, 40, 130, 70), (-1300, -950, -70, 40, 50), (-780, -360, 20, 250, 60),
            (-960, -1200, -40, 300, 40))  # fmt: skip
_RATE_HZ = 25


def recorded(
    seed: int, noise: float, texture: float, camera: str = "optical.eo"
) -> list[dict[str, Any]]:
    """Return every look of the signature at the targets, or what a camera that renders detects."""
    pictures = camera != "optical.eo"
    turn = np.random.default_rng(seed).uniform(-25.0, 25.0, len(_TARGETS))
    targets = ", ".join(
        f'{{ name = "t{i}", north_m = {n}, east_m = {e}, up_m = {u}, speed_mps = {v}, '
        f"heading_deg = {h + turn[i]}, eo = {{ front_m2 = 3, side_m2 = 9, horizontal_m2 = 21 }} }}"
        for i, (n, e, u, h, v) in enumerate(_TARGETS)
    )
    sets = [
        f"blocks.eo.noise_equivalent_contrast={noise}", f"blocks.eo.scan_rate_hz={_RATE_HZ}",
        "blocks.eo.false_alarms_per_frame=0.0001", "blocks.eo.false_alarms=false",
        "blocks.eo.mount_azimuth_deg=7", "blocks.eo.mount_roll_deg=-12",
        'blocks.eo.silhouette="convex_hull"', f"blocks.traffic.intruders=[{targets}]", _OWNSHIP,
        "record.looks=true", *([f"blocks.eo.texture_contrast={texture}"] if pictures else []),
    ]  # fmt: skip
    path = find_example("optical/pictures")
    assert path is not None
    sink = MemorySink()
    scene = load_scene(path, sets=sets, swaps=[f"eo={camera}"], seed=seed, duration_s="4")
    Simulation(scene, recorder=Recorder([sink])).run()
    rows = sink.tables()["detections" if pictures else "looks"].to_pylist()
    return [row for row in rows if row["block"] == "eo"]


def flow_errors(seeds: Iterable[int], noise: float, texture: float) -> np.ndarray:
    """Return covered pixels, flow's error, its stated deviation and true flow, (4, looks), pixels.

    Looks are as far apart as the frames of each, so that the truth is how far the true pixel moved
    since the look before. NaN where no flow was told.
    """
    found = []
    for seed in seeds:
        covered = {
            (row["target"], row["scan"]): row["pixels"] for row in recorded(seed, noise, texture)
        }
        looks = {
            (row["target"], row["scan"]): row
            for row in recorded(seed, noise, texture, "optical.image")
        }
        for (name, scan), row in looks.items():
            before = looks.get((name, scan - 1))
            if before is None:
                continue
            moved = [row[f"true_{axis}_px"] - before[f"true_{axis}_px"] for axis in _AXES]
            told = [row[f"flow_{axis}_px"] for axis in _AXES]
            known = told[0] is not None
            off = np.hypot(told[0] - moved[0], told[1] - moved[1]) if known else np.nan
            deviation = row["flow_deviation_px"] if known else np.nan
            found.append((covered[name, scan], off, deviation, np.hypot(*moved)))
    return np.array(found).T


_AXES = ("column", "row")
#: Noise of a pixel and contrast of the background, in the target's contrast.
CASES = ((0.01, 0.0), (0.02, 0.0), (0.05, 0.0), (0.01, 0.02), (0.01, 0.05), (0.02, 0.1))
#: Deviations of each of two axes within which 95 % of flows would be.
RADIUS_95 = np.sqrt(-2.0 * np.log(0.05))
SIZES = ((3, 6), (6, 12), (12, 40), (40, np.inf))


def flow_table(seeds: Iterable[int] = range(6)) -> str:
    """Return a table of how far flows are off, by size, noise and clutter."""
    text = (
        "| pixels | noise | clutter | flows | reported | 50 % | 95 % | 99 % | largest | "
        "off / stated | in 2.45 |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|\n"
    )
    for noise, texture in CASES:
        pixels, off, deviation, _ = flow_errors(seeds, noise, texture)
        for low, high in SIZES:
            mine = (pixels >= low) & (pixels < high)
            told = mine & np.isfinite(off)
            if not told.any():
                continue
            middle, most, nearly = np.quantile(off[told], [0.5, 0.95, 0.99])
            deviations = off[told] / deviation[told]
            ratio = float(np.sqrt(0.5 * np.mean(deviations**2)))
            inside = float(np.mean(deviations <= RADIUS_95))
            size = f"{low} to {high:g}" if np.isfinite(high) else f"{low} and more"
            text += (
                f"| {size} | {noise:g} | {texture:g} | {mine.sum()} "
                f"| {100.0 * told.sum() / mine.sum():.1f} % | {middle:.3f} | {most:.3f} "
                f"| {nearly:.3f} | {off[told].max():.2f} | {ratio:.2f} "
                f"| {100.0 * inside:.1f} % |\n"
            )
    return text
