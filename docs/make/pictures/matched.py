"""``python -m docs.make.pictures.matched``: cameras beside the filter matched to their targets."""

import argparse
import math
import sys
from typing import Any

import numpy as np
from scipy.special import j1

import dsa_des
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say_lines

BLUR_PIXELS, PIXELS, HALF_DEG = 0.5, 1024, 5.0
PIXEL_RAD = math.radians(2.0 * HALF_DEG) / PIXELS
FALSE_ALARMS = 1e-4
_SIZES = (0.2, 1.0, 3.0, 6.46, 20.0, 60.0)
_SNR, _RANGE_M = 8.0, 2000.0
#: Noise of a pixel in the target's contrast: the page's, that of a threshold of 1, and a faint
#: target's.
_NOISES = (0.05, 0.25, 0.6)
_AREA_M2 = 9.0
_KINDS = ("optical.image", "optical.eo", "optical.ir")


def matched_snr(pixels: float, noise: float) -> float:
    """Return the SNR of a disc behind the filter that is matched to it, wherever it falls.

    In the mean over places in a pixel: by the spectrum of a disc, the blur and a pixel, which
    does not know `point_filter_share`.
    """
    wave = np.linspace(-40.0, 40.0, 1601)
    across, upward = np.meshgrid(wave, wave)
    turn = np.hypot(across, upward) * math.sqrt(pixels / math.pi)
    disc = np.where(turn < 1e-9, 1.0, 2.0 * j1(turn) / np.where(turn < 1e-9, 1.0, turn))
    blur = np.exp(-0.5 * BLUR_PIXELS**2 * (across**2 + upward**2))
    pixel = np.sinc(across / (2.0 * math.pi)) * np.sinc(upward / (2.0 * math.pi))
    step = (wave[1] - wave[0]) / (2.0 * math.pi)
    return pixels / noise * step * math.sqrt(float(((disc * blur * pixel) ** 2).sum()))


def _looks(kind: str, area_m2: float, noise: float) -> Any:
    """Return the camera in use and all looks at a sphere ahead, as it drifts over the pixels."""
    bodies = {"front_m2": area_m2, "side_m2": 0.0, "horizontal_m2": 0.0}
    target = {
        "name": "sphere", "north_m": _RANGE_M, "east_m": 3.0, "up_m": 2.0, "heading_deg": 0.0,
        "speed_mps": 60.0, "eo": bodies, "ir": {**bodies, "back_m2": area_m2},
    }  # fmt: skip
    eye = {
        "type": kind, "scan_rate_hz": 20, "azimuth_deg": [-HALF_DEG, HALF_DEG],
        "elevation_deg": [-HALF_DEG, HALF_DEG], "azimuth_pixels": PIXELS,
        "elevation_pixels": PIXELS, "noise_equivalent_contrast": noise,
        "false_alarms_per_frame": FALSE_ALARMS, "false_alarms": False,
        "silhouette": "convex_hull",
    }  # fmt: skip
    own = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 900.0, "heading_deg": 0.05,
           "speed_mps": 60.0}  # fmt: skip
    scene = {
        "duration_s": 20.0, "seed": 1, "record": {"looks": True},
        "wires": ["traffic -> transform -> gate -> eye"],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": [target]},
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"}, "eye": eye,
        },
    }  # fmt: skip
    done = dsa_des.run(scene)
    return done.summary["cameras"]["eye"], done


def _crossed(used: dict[str, float]) -> float:
    return used["threshold"] / used["noise"]


def size_table() -> str:
    """Return a table of the SNR of discs in each camera over that of the matched filter."""
    from scipy.stats import norm

    text = "| pixels | matched | `optical.image` | `optical.eo` | `optical.ir` | point's noise |\n"
    text += "|---|---|---|---|---|---|\n"
    spot = 4.0 * math.pi * (BLUR_PIXELS**2 + 1.0 / 12.0)
    for pixels in _SIZES:
        area_m2 = pixels * (_RANGE_M * PIXEL_RAD) ** 2
        noise = matched_snr(pixels, 1.0) / _SNR
        found = []
        for kind in _KINDS:
            used, done = _looks(kind, area_m2, noise)
            if kind == "optical.image":
                rows = [row["snr"] for row in done["detections"].to_pylist()]
                found.append(np.mean(rows))
            else:
                said = [row["detection_probability"] for row in done["looks"].to_pylist()]
                found.append(_crossed(used) + np.mean(norm.ppf(said)))
        point = pixels / noise / math.sqrt(spot)
        text += f"| {pixels:g} | {_SNR:g} | {' | '.join(f'{one:.2f}' for one in found)} "
        text += f"| {point:.2f} |\n"
    return text


def range_table() -> str:
    """Return a table of ranges at which half of the looks detect a sphere, by noise."""
    text = "| noise | matched | `optical.image` | `optical.eo` | `optical.ir` |\n"
    text += "|---|---|---|---|---|\n"
    for noise in _NOISES:
        used, _ = _looks("optical.eo", _AREA_M2, noise)
        needed = _crossed(used)
        near, far = 0.01, 1e4
        while far / near > 1.0001:
            middle = math.sqrt(near * far)
            near, far = (near, middle) if matched_snr(middle, noise) > needed else (middle, far)
        ranges = [math.sqrt(_AREA_M2 / far) / PIXEL_RAD]
        for kind in _KINDS:
            ranges.append(_half_range_m(kind, noise, ranges[0]))
        text += f"| {noise:g} | {' | '.join(f'{one / 1000.0:.2f}' for one in ranges)} |\n"
    return text


def _half_range_m(kind: str, noise: float, about_m: float) -> float:
    """Return where half of the looks detect: bisected over ranges, the target scaled instead."""
    near, far = 0.5 * about_m, 2.0 * about_m
    while far / near > 1.005:
        middle = math.sqrt(near * far)
        area_m2 = _AREA_M2 * (_RANGE_M / middle) ** 2
        _, done = _looks(kind, area_m2, noise)
        looks = done["looks"].to_pylist()
        share = np.mean([bool(row["detected"]) for row in looks])
        near, far = (middle, far) if share > 0.5 else (near, middle)
    return math.sqrt(near * far)


def main(arguments: list[str] | None = None) -> int:
    """Print both tables."""
    argparse.ArgumentParser(description=__doc__).parse_args(arguments)
    say_lines(f"{size_table()}\n{range_table()}".rstrip())
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
