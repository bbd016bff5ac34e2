"""No camera stands out more than the filter that is matched to its target, and noise brings alarms.

The oracle renders discs by brute force: shares of pixels, blurred, and their sum of squares.
"""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from scipy.ndimage import gaussian_filter
from scipy.stats import norm
from wired import chain, rows, run, sensor

PIXEL_RAD = math.radians(0.01)
FRAME = 36000 * 18000 / (4.0 * math.pi / 3.0)
NOISE = 0.2495
FINE = 15
#: Pixels that targets show, from a point to ones far larger than the blur of half a pixel.
SIZES = (0.2, 2.0, 6.46, 20.0, 60.0)


def matched(pixels: float, blur: float = 0.5) -> float:
    """SNR of a disc of contrast 1 in white noise of 1 a pixel, in the mean of nine places."""
    side = 2 * math.ceil(math.sqrt(pixels / math.pi) + 4.0 * blur + 1.0) + 1
    at = (np.arange(side * FINE) + 0.5) / FINE - 0.5 * side
    disc = (np.hypot(at, at[:, np.newaxis]) <= math.sqrt(pixels / math.pi)).astype(float)
    fine = gaussian_filter(disc * (pixels / disc.sum()), blur * FINE, truncate=6.0)
    squares = []
    for down in (0, 5, 10):
        for right in (0, 5, 10):
            moved = np.roll(fine, (down, right), axis=(0, 1))
            seen = moved.reshape(side, FINE, side, FINE).sum(axis=(1, 3))
            squares.append((seen**2).sum())
    return math.sqrt(np.mean(squares))


def spheres(needed: float):
    """Targets about the ownship that a matched filter has just above the threshold."""
    for number, pixels in enumerate(SIZES):
        bearing = math.radians(150.0 + 30.0 * number)
        range_m = 1700.0 + 150.0 * number
        area = {"front_m2": pixels * (range_m * PIXEL_RAD) ** 2, "side_m2": 0.0,
                "horizontal_m2": 0.0}  # fmt: skip
        gain = needed * NOISE / matched(pixels)
        yield {**crooked.ROLLING, "name": f"{pixels:g}", "up_m": 40.0, "contrast": gain,
               "contrast_ir": gain, "north_m": range_m * math.cos(bearing),
               "east_m": range_m * math.sin(bearing), "eo": area,
               "ir": {**area, "back_m2": area["front_m2"]}}  # fmt: skip


@covers("noise_equivalent_contrast", "threshold", of=("optical.eo", "optical.ir"))
@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir"])
@pytest.mark.parametrize("said", ["noise", "threshold"])
def test_a_target_of_many_pixels_stands_out_as_far_as_its_own_filter_has_it(kind, said):
    """Within 6 % from a point to 60 pixels; the noise of a point made it 4 times as far there."""
    crossed = norm.isf(1e-4 / FRAME)
    of_a_point = 0.3 * NOISE * math.sqrt(4.0 * math.pi / 3.0)
    keys = {"threshold": None, "noise_equivalent_contrast": NOISE}
    if said == "threshold":
        keys = {"threshold": crossed * of_a_point, "noise_equivalent_contrast": None}
    eye = sensor(kind, azimuth_deg=[-180, 180], elevation_deg=[-90, 90], **keys)
    found = rows(run(chain({"eye": eye}, targets=list(spheres(crossed + 0.3)))), "looks", scan=0)
    assert len(found) == len(SIZES)
    for row in found:
        snr = crossed + norm.ppf(row["detection_probability"])
        # The sphere is nearer or farther by centimetres than it was made for.
        assert row["pixels"] == pytest.approx(float(row["target"]), rel=0.01)
        assert snr == pytest.approx(crossed + 0.3, rel=0.06)


@covers("noise_equivalent_contrast", "false_alarms", "false_alarms_per_frame", of=("optical.eo",))
def test_a_noisier_camera_does_not_detect_more_in_silence():
    """Noise alone raises the threshold; beside a threshold that stays it brings false alarms."""
    target = {**crooked.ROLLING, "eo": {"front_m2": 0.4, "side_m2": 0.9, "horizontal_m2": 2.0}}

    def seen(**keys):
        eye = sensor("optical.eo", scan_rate_hz=100, azimuth_pixels=3600, elevation_pixels=1800,
                     **{"threshold": None, **keys})  # fmt: skip
        found = run(chain({"eye": eye}, targets=[target]))
        alarms = len(rows(found, target=None))
        return len(rows(found)) - alarms, alarms, found.summary["cameras"]["eye"]

    before = 100
    for noise in (0.001, 0.1, 1.0, 10.0):
        hits, alarms, used = seen(noise_equivalent_contrast=noise)
        assert hits <= before and alarms == 0
        assert used["false_alarms_per_frame"] == pytest.approx(1e-4)
        assert used["threshold"] / used["noise"] == pytest.approx(
            norm.isf(1e-4 * 4.0 * math.pi / 3.0 / (3600 * 1800)), rel=1e-6
        )
        before = hits
    assert before == 0
    hits, alarms, used = seen(noise_equivalent_contrast=0.4, threshold=1.0)
    expected = 100 * used["false_alarms_per_frame"]
    assert expected > 20 and abs(alarms - expected) < 3.3 * math.sqrt(expected)
    assert seen(noise_equivalent_contrast=0.4, threshold=1.0, false_alarms=False)[1] == 0
