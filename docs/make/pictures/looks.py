"""Looks of the signature model and of pictures at the same targets, and how far each sees."""

import math
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.examples import find_example
from dsa_des.scene.scene import load_scene

SCENE = "optical/pictures"
NOISE = 0.05


def quiet(noise: float = NOISE) -> list[str]:
    """Return the settings of a camera of some noise that has no false alarms."""
    return [
        f"blocks.eo.noise_equivalent_contrast={noise}", "blocks.eo.false_alarms_per_frame=0.0001",
        "blocks.eo.false_alarms=false",
    ]  # fmt: skip


# Looks whose mean stands for Pd.
LOOKS = 50
SEEDS = range(4, 10)
#: Of the mean of so many seeds: Student's t for 95 %, over the root of their number.
HALF = 2.571 / math.sqrt(len(SEEDS))

#: What changes: its name, then what is seen, from where, and before which background.
CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("small aircraft, nose on", {}),
    ("10 times the area", {"size": 10.0}),
    ("a tenth of the area", {"size": 0.1}),
    ("contrast 0.3", {"contrast": 0.3}),
    ("contrast 3", {"contrast": 3.0}),
    ("from abeam", {"heading_deg": 90.0}),
    ("ownship turns 3 deg/s", {"turn_deg_s": 3.0}),
    ("turns 3 deg/s, exposure 20 ms", {"turn_deg_s": 3.0, "exposure_s": 0.02}),
    ("clutter of contrast 0.05", {"texture": 0.05}),
    ("clutter of contrast 0.2", {"texture": 0.2}),
)


def scene_file() -> Path:
    """Return the scene of pictures."""
    found = find_example(SCENE)
    assert found is not None
    return found


def looks(
    kind: str,
    *,
    size: float = 1.0,
    contrast: float = 1.0,
    heading_deg: float = 180.0,
    turn_deg_s: float = 0.0,
    exposure_s: float = 0.002,
    texture: float = 0.0,
    noise: float = NOISE,
    seed: int = 4,
) -> dict[str, np.ndarray]:
    """Return range, detection and confidence of every look at one target that comes nearer."""
    areas = {"front_m2": 2.0 * size, "side_m2": 8.0 * size, "horizontal_m2": 16.0 * size}
    far_m = 4500.0 * math.sqrt(size * contrast)
    duration_s = 100.0
    legs = '{ kind = "straight" }'
    if turn_deg_s:  # weaves about the target, so that it stays in view
        swing = f'{{ kind = "turn", rate_deg_s = {turn_deg_s}, duration_s = 4 }}, '
        back = f'{{ kind = "turn", rate_deg_s = {-turn_deg_s}, duration_s = 4 }}, '
        legs = (swing + back) * 13
    # The target does not fly: the camera comes to it, at the same rate whatever it is.
    speed = far_m / duration_s
    eo = ", ".join(f"{name} = {value}" for name, value in areas.items())
    target = (
        f'{{ name = "target", north_m = {far_m}, east_m = 1.0, up_m = 1.0, speed_mps = 1e-6, '
        f"heading_deg = {heading_deg}, contrast = {contrast}, eo = {{ {eo} }} }}"
    )
    more = [f"blocks.eo.exposure_s={exposure_s}", f"blocks.eo.texture_contrast={texture}"]
    scene = load_scene(
        scene_file(),
        swaps=[] if kind == "image" else ["eo=optical.eo"],
        sets=[
            f"blocks.traffic.intruders=[{target}]",
            "blocks.traffic.ownship={ lat_deg = 52, lon_deg = 4, alt_m = 900, heading_deg = 0, "
            f"speed_mps = {speed}, legs = [{legs}] }}",
            *quiet(noise),
            "blocks.eo.scan_rate_hz=10", 'blocks.eo.silhouette="convex_hull"',
            "record.looks=true", *(more if kind == "image" else []),
        ],
        duration_s=0.98 * duration_s, seed=seed,
    )  # fmt: skip
    sink = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    simulation.run()
    table = sink.tables()["looks"].to_pydict()
    known = [n for n, range_m in enumerate(table["true_range_m"]) if range_m is not None]
    names = "scan", "true_range_m", "detected", "detection_probability"
    return {name: np.array([table[name][n] or 0.0 for n in known], dtype=float) for name in names}


def half_range_m(seen: dict[str, np.ndarray]) -> float:
    """Return the range at which half of the looks detect: where their running mean first does.

    Infinite where they do from the start on, NaN where they never do.
    """
    near = np.argsort(seen["true_range_m"], kind="stable")[::-1]
    mean = np.convolve(seen["detected"][near], np.ones(LOOKS) / LOOKS, mode="valid")
    above = np.flatnonzero(mean >= 0.5)
    if len(above) and above[0] == 0:
        return math.inf
    return float(seen["true_range_m"][near][above[0] + LOOKS // 2]) if len(above) else math.nan


_BINS = np.array([1e-3, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.999, 1.01])


def calibration(
    pairs: list[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]],
) -> list[tuple[float, float, float, int]]:
    """Return stated Pd, share detected in pictures, its standard error and looks, by bins of Pd."""
    stated, seen = [], []
    for picture, signature in pairs:
        _, one, other = np.intersect1d(picture["scan"], signature["scan"], return_indices=True)
        stated.append(signature["detection_probability"][other])
        seen.append(picture["detected"][one])
    said, share = np.concatenate(stated), np.concatenate(seen)
    found = []
    for low, high in pairwise(_BINS.tolist()):
        inside = (said >= low) & (said < high)
        count, mean = int(inside.sum()), float(share[inside].mean()) if inside.any() else math.nan
        error = math.sqrt(max(mean * (1.0 - mean), 1e-9) / max(count, 1))
        found.append((float(said[inside].mean()) if count else math.nan, mean, error, count))
    return found


def factor_of(bins: list[tuple[float, float, float, int]], noise: float = NOISE) -> float:
    """Return the factor of the signature by which the stated Pd becomes the share detected."""
    camera: Any = Simulation(load_scene(scene_file(), sets=quiet(noise))).components["eo"]
    needed = camera.detector.threshold / camera.detector.noise
    normal = NormalDist()
    inner = [(one, other) for one, other, _, _ in bins if 0.05 < one < 0.999]
    ratio = [
        (needed + normal.inv_cdf(share)) / (needed + normal.inv_cdf(stated))
        for stated, share in inner
    ]
    return float(np.median(ratio))
