"""Severity and probability of collision of encounters, by hand from their geometry."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from scipy.stats import laplace
from wired import HEARS_ALL, chain, measured

KIND = ("[metric severity]",)
FOOT_M = 0.3048
#: Altitudes bend away from the level plane in which the target is placed, 2 km away.
BENT_M = 2000.0**2 / (2 * 6.371e6)


def encounter(side_m, up_m, *others, samples_s=0.1, **keys):
    """From ahead at 100 m/s, passing some metres to the right and above after 20 s."""
    heading = math.radians(217.0)
    ahead_m = 20.0 * (70.0 + 30.0)
    target = {
        "name": "passing", "heading_deg": 37.0, "speed_mps": 30.0, "up_m": up_m,
        "east_m": ahead_m * math.sin(heading) + side_m * math.cos(heading),
        "north_m": ahead_m * math.cos(heading) - side_m * math.sin(heading),
        "climb_mps": crooked.OWNSHIP["climb_mps"],
    }  # fmt: skip
    scene = chain({"radar": HEARS_ALL}, targets=[target, *others], duration_s=40)
    scene["blocks"]["traffic"]["sample_interval_s"] = samples_s
    return measured(scene, {"metric": "severity", **keys})


def depth(range_share, miss_share, height_share):
    """The severity by the norm, taken twice."""

    def norm(x, y):
        return math.sqrt(x * x + (1.0 - x * x) * y * y)

    return 100.0 * (1.0 - norm(norm(range_share, miss_share), height_share))


@covers("horizontal_m", "vertical_m", "tau_s", of=KIND)
@pytest.mark.parametrize(
    ("horizontal_m", "vertical_m", "tau_s"),
    [(4000 * FOOT_M, 450 * FOOT_M, 35.0), (700.0, 450 * FOOT_M, 35.0), (700.0, 90.0, 0.0)],
)
def test_the_deepest_penetration_counts(horizontal_m, vertical_m, tau_s):
    """Largest where range over its scale is least: by a fine search over the straight passage."""
    keys = {"horizontal_m": horizontal_m, "vertical_m": vertical_m, "tau_s": tau_s}
    found = encounter(220.0, 60.0, **keys)["slowc_percent"]
    wanted = 0.0
    height = (60.0 + BENT_M) / vertical_m
    for before_s in np.linspace(-20.0, 20.0, 4_001):
        ahead_m = 100.0 * before_s
        range_m = math.hypot(ahead_m, 220.0)
        rate = -100.0 * ahead_m / range_m * tau_s
        scale = max(horizontal_m, 0.5 * (math.sqrt(rate**2 + 4 * horizontal_m**2) - rate))
        miss_m = 220.0 if before_s > 0 else range_m
        shares = [min(x, 1.0) for x in
                  (range_m / scale, miss_m / horizontal_m, height)]  # fmt: skip
        wanted = max(wanted, depth(*shares))
    assert 5.0 < wanted < 95.0
    assert found == pytest.approx(wanted, abs=0.1)


@covers("mode_c_own", "mode_c_target", "nmac_horizontal_m", "nmac_vertical_m", of=KIND)
def test_the_probability_is_that_of_the_altimeters():
    """At 7,880 and 8,060 ft: scale 43 ft; with Mode C, 0.345 of it and else 69 ft. By drawing."""
    up_ft = (55.0 + BENT_M) / FOOT_M
    random = np.random.default_rng(3)
    good = laplace(scale=43.0).rvs((2, 200_000), random)
    scale = np.where(random.random(200_000) < 0.345, 43.0, 69.0)
    poor = laplace(scale=scale).rvs(200_000, random)
    for keys, own, other, limit_ft in (
        ({}, good[0], good[1], 100.0), ({"mode_c_target": True}, good[0], poor, 100.0),
        ({"mode_c_own": True}, poor, good[0], 100.0),
        ({"nmac_vertical_m": 200 * FOOT_M}, good[0], good[1], 200.0),
    ):  # fmt: skip
        wanted = float(np.mean(np.abs(up_ft + own - other) <= limit_ft))
        found = encounter(120.0, 55.0, **keys)["pnmac"]
        assert found == pytest.approx(wanted, abs=0.004)
    assert encounter(160.0, 55.0)["pnmac"] == 0.0
    assert encounter(160.0, 55.0, nmac_horizontal_m=165.0)["pnmac"] > 0.05


@covers("target", of=KIND)
def test_the_most_severe_target_counts_or_the_one_that_is_named():
    other = {**crooked.DIVING, "name": "far", "east_m": 30_000.0}
    both = encounter(220.0, 60.0, other)
    assert both["slowc_percent"] > 10.0
    assert encounter(220.0, 60.0, other, target="passing") == both
    assert encounter(220.0, 60.0, other, target="far") == {"slowc_percent": 0.0, "pnmac": 0.0}


@covers("step_s", of=KIND)
def test_a_coarse_step_steps_over_a_short_loss():
    """Within 300 m from 18 to 22 s, which steps of 8 s do not see where there are no samples."""
    keys = {"horizontal_m": 300.0, "tau_s": 0.0, "samples_s": 100.0}
    fine, coarse = (encounter(220.0, 60.0, step_s=s, **keys) for s in (0.1, 8.0))
    assert fine["slowc_percent"] > 5.0 and coarse["slowc_percent"] == 0.0
