"""Noise, texture and spots of pictures lie within 99 % bounds of what is stated of them."""

import math
from statistics import NormalDist

import numpy as np
import pytest

import components.optical.image as image
from components.optical.flow import find_spot
from components.optical.picture import textured_background
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Stream

NORMAL = NormalDist()
#: Half width of a 99 % interval, in standard deviations.
Z = NORMAL.inv_cdf(0.995)
SCENE = "optical/pictures.toml"
#: Nothing but noise: one target has no contrast; the other, for whose sake the camera looks so
#: far, is behind.
EMPTY = [
    "blocks.traffic.intruders=["
    '{ name = "here", north_m = -1500, east_m = -1200, up_m = 60, heading_deg = 130, '
    "speed_mps = 40, contrast = 0, eo = { front_m2 = 3, side_m2 = 9, horizontal_m2 = 21 } }, "
    '{ name = "behind", north_m = 1500, east_m = 900, up_m = 5, heading_deg = 37, speed_mps = 40, '
    "eo = { front_m2 = 30, side_m2 = 90, horizontal_m2 = 210 } }]",
    "blocks.eo.texture_contrast=0", "blocks.eo.noise_equivalent_contrast=0.02",
    "blocks.eo.scan_rate_hz=25",
]  # fmt: skip


@pytest.fixture
def frames(configs, monkeypatch):
    """Return all patches that a run searches, and the camera; runs alone, or two together."""

    def pictures(seeds, window=None):
        taken = []

        def spy(picture, *rest):
            taken.append(picture[:24, :24])
            return find_spot(picture, *rest)

        monkeypatch.setattr(image, "find_spot", spy)
        scenes = [
            load_scene(configs / SCENE, sets=EMPTY, seed=seed, duration_s="10") for seed in seeds
        ]
        recorder = Recorder([MemorySink()])
        if len(scenes) == 1:
            made = Simulation(scenes[0], recorder=recorder, window=window)
        else:
            made = make_lockstep_simulation(scenes, recorder=recorder)
        made.run()
        return np.array(taken), made.components["eo"]

    return pictures


def test_noise_of_pixels_is_white_and_as_large_as_stated(frames):
    seen, camera = frames([5])
    values = seen / camera.pixel_noise
    n = values.size
    assert n > 100_000
    assert abs(values.mean()) < Z / math.sqrt(n)
    assert abs(values.var() - 1.0) < Z * math.sqrt(2.0 / n)
    tail = 2.0 * (1.0 - NORMAL.cdf(3.0))
    assert abs((np.abs(values) > 3.0).mean() - tail) < Z * math.sqrt(tail / n)
    # Neither beside nor below nor from one look to the next is there anything in common.
    for one, other in (
        (values[:, :, 1:], values[:, :, :-1]),
        (values[:, 1:], values[:, :-1]),
        (values[1:], values[:-1]),
    ):
        assert abs((one * other).mean()) < Z / math.sqrt(one.size)
    # The same in windows of three scans, and beside another seed's run.
    assert np.array_equal(frames([5], window=3)[0], seen)
    together = frames([8, 5])[0]
    assert len(together) > 1.5 * len(seen)
    mine = {picture.tobytes() for picture in together}
    assert all(picture.tobytes() in mine for picture in seen)


def along(part, fine):
    """Return the correlation of smoothed lattice noise a part of a cell apart, from places in it.

    Along one axis; worked out from the weights (1 - s, s) with s = f² (3 - 2 f), each of norm 1.
    """

    def weights(f):
        s = f * f * (3.0 - 2.0 * f)
        return np.stack([1.0 - s, s]) / np.hypot(1.0 - s, s)

    here, there = weights(fine), weights((fine + part) % 1.0)
    beyond = fine + part >= 1.0
    return np.where(beyond, here[1] * there[0], (here * there).sum(axis=0))


def test_texture_has_the_stated_deviation_and_grain():
    n, grain = 100_000, 1e-3
    rng = np.random.default_rng(3)
    # Grains of the lattice around are a whole number.
    cell = 2.0 * math.pi / round(2.0 * math.pi / grain)
    fine, azimuth_cell = rng.random(n), rng.integers(0, 6000, n)
    azimuth, elevation = (azimuth_cell + fine) * cell, rng.uniform(-1.2, 1.2, n)
    stream = Stream(4, "eo", "background")

    def normal(one, other):
        return stream.normal(one.astype(np.uint64), other)

    here = textured_background(normal, azimuth, elevation, grain)
    assert abs(here.mean()) < Z / math.sqrt(n)
    assert abs(here.var() - 1.0) < Z * math.sqrt(2.0 / n)
    for part in (0.25, 0.6, 1.0):
        there = textured_background(normal, azimuth + part * cell, elevation, grain)
        expected = along(part, fine)
        # Of normal pairs, each with its own correlation.
        spread = math.sqrt((1.0 + expected**2).mean() / n)
        assert abs((here * there - expected).mean()) < Z * spread, part
    assert abs(
        (here * textured_background(normal, azimuth + 2.5 * cell, elevation, grain)).mean()
    ) < (Z / math.sqrt(n))


@pytest.mark.parametrize(("size", "spread", "n"), [(12, 1.01, 100_000), (16, 1.4, 20_000)])
def test_a_filter_makes_standard_normal_values_of_noise(size, spread, n):
    """Where there is one filter and one place to look at: what is stated of each of them."""
    rng = np.random.default_rng(size)
    sought = np.zeros((size, size), dtype=bool)
    sought[size // 2, size // 2] = True
    found = np.array([
        find_spot(picture, sought, spread, 0.3)[0]
        for picture in 0.3 * rng.standard_normal((n, size, size))
    ])  # fmt: skip
    # One picture in some hundreds is taken for clutter, and its spot for less.
    for level in (-1.0, 0.0, 1.0, 2.0):
        p = 1.0 - NORMAL.cdf(level)
        assert abs((found > level).mean() - p) < Z * math.sqrt(p * (1.0 - p) / n) + 0.002, level


def weights_of_places(size, sought, spreads):
    """Return what each filter at each place counts each pixel of a picture, of norm 1, (n, pixels).

    Gaussians of pixels as OpenCV cuts them off and mirrors them, less the mean of the rim.
    """
    rim = np.ones((size, size))
    rim[3:-3, 3:-3] = 0.0
    found = []
    for spread in spreads:
        reach = (round(8.0 * spread + 1.0) | 1) // 2
        off = np.arange(-reach, reach + 1)
        kernel = np.exp(-0.5 * (off / spread) ** 2)
        along = np.zeros((size, size))
        for i in range(size):
            for j, value in zip(i + off, kernel / kernel.sum(), strict=True):
                mirrored = j if 0 <= j < size else (-1 - j if j < 0 else 2 * size - 1 - j)
                along[i, mirrored] += value
        for row, column in zip(*np.nonzero(sought), strict=True):
            weight = np.outer(along[row], along[column]) - rim / rim.sum()
            found.append((weight / np.sqrt((weight**2).sum())).ravel())
    return np.array(found)


def test_noise_alone_is_found_as_often_as_the_largest_of_all_filters_and_places():
    """By draws of the 208 correlated values: four filters, 52 pixels.

    Above 3 deviations that is 5 times as often as in 12 independent places: filters answer at every
    pixel, and a smooth field is above a level u at its peaks u^2 times as often as at one place of
    each cell (Adler, The Geometry of Random Fields (1981), 6.9; here less, as pixels are coarse).
    """
    n, size, spread = 3000, 32, math.sqrt(0.25 + 1.0 / 12.0)
    at = np.mgrid[:size, :size] + 0.5 - size / 2
    sought = np.hypot(*at) <= 4.0
    rng = np.random.default_rng(9)
    found = np.array([
        find_spot(picture, sought, spread, 1.0)[0]
        for picture in rng.standard_normal((n, size, size))
    ])  # fmt: skip
    values = weights_of_places(size, sought, spread * 2.0 ** np.arange(4))
    many, parts = 5000, 8
    largest = np.concatenate([
        (values @ rng.standard_normal((size * size, many))).max(axis=0) for _ in range(parts)
    ])  # fmt: skip
    for level in (2.0, 2.5, 3.0, 3.5):
        p = (largest > level).mean()
        spread_of_both = math.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / len(largest)))
        assert abs((found > level).mean() - p) < Z * spread_of_both, level
    independent = np.count_nonzero(sought) / (4.0 * math.pi * spread**2)
    alone = independent * (1.0 - NORMAL.cdf(3.0))
    assert (largest > 3.0).mean() / alone == pytest.approx(5.0, abs=0.5)
    of_one = (values[: len(values) // 4] @ rng.standard_normal((size * size, 4 * many))).max(axis=0)
    assert (of_one > 3.0).mean() / alone == pytest.approx(3.5, abs=0.5)
