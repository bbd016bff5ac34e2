"""The echo of the ground by the geometry of a beam that a banked ownship points."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from scipy.special import chndtr
from wired import HEARS_ALL, chain, first_look

AZIMUTH_DEG, ELEVATION_DEG, DEPTH_M = 2.0, 9.0, 40.0
RADAR = {
    **HEARS_ALL,
    "azimuth_resolution_deg": AZIMUTH_DEG,
    "elevation_resolution_deg": ELEVATION_DEG,
    "range_resolution_m": DEPTH_M,
}
#: Low enough for the beam at them to meet the ground, one to the right and one to the left.
TARGETS = (
    {**crooked.DIVING, "up_m": -900.0},
    {**crooked.ROLLING, "up_m": -700.0},
)


def clutter_to_signal(target: dict, height_m: float, gamma_db: float, rcs_m2: float) -> float:
    """Clutter's RCS over the target's: patch times gamma sin(grazing) times the beam's gain."""
    line = crooked.ned(target)
    range_m = float(np.linalg.norm(line))
    _, elevation = crooked.angles(line)
    sine = height_m / range_m
    grazing = math.asin(sine)
    across = range_m * math.radians(AZIMUTH_DEG)
    width = math.radians(ELEVATION_DEG)
    along = min(DEPTH_M / math.cos(grazing), range_m * width / sine)
    gain = math.exp(-8.0 * math.log(2.0) * ((elevation + grazing) / width) ** 2)
    return 10.0 ** (gamma_db / 10.0) * sine * across * along * gain / rcs_m2


@covers("height_m", "clutter_gamma_db", of=("[terrain]",))
@pytest.mark.parametrize(
    ("ground_m", "gamma_db"), [(1300.0, -15.0), (1300.0, -5.0), (1150.0, -5.0)]
)
@pytest.mark.parametrize("rain_mm_h", [0.0, 3.0])
def test_clutter_is_that_of_the_ground_below_the_line_of_sight(ground_m, gamma_db, rain_mm_h):
    """Rain on the way weakens both echoes alike, and its own adds to the ground's."""
    weather = {"rain_rate_mm_h": rain_mm_h, "rain_top_m": 9000.0}

    def clutter_to_noise(gamma_db: float) -> dict[str, tuple[float, float]]:
        """Each target's SNR, and what stands beside it."""
        terrain = {"height_m": ground_m, "clutter_gamma_db": gamma_db}
        scene = chain({"radar": RADAR}, targets=TARGETS, terrain=terrain, weather=weather)
        found = {}
        for name, row in first_look(scene, "radar").items():
            # Confidence counts clutter as noise, the recorded SNR does not.
            lost_db = row["snr_db"] - RADAR["threshold_db"] - row["confidence"]
            found[name] = 10.0 ** (0.1 * row["snr_db"]), 10.0 ** (0.1 * lost_db) - 1.0
        return found

    seen, dark = clutter_to_noise(gamma_db), clutter_to_noise(-100.0)
    height_m = crooked.OWNSHIP["alt_m"] - ground_m
    for target in TARGETS:
        snr, cnr = seen[target["name"]]
        expected = snr * clutter_to_signal(target, height_m, gamma_db, 10.0**0.301)
        assert expected > 0.1
        assert cnr - dark[target["name"]][1] == pytest.approx(expected, rel=1e-3)
        assert (dark[target["name"]][1] > 0.01) == (rain_mm_h > 0.0)


@covers("clutter_mean", of=("[terrain]",))
@pytest.mark.parametrize("mean", ["constant", "fluctuating"])
def test_the_probability_of_detection_follows_the_clutter_s_mean(mean):
    """Against a steady target: Marcum's Q, over the phase or with the clutter as noise."""
    pfa = 1e-2
    radar = {
        **{key: RADAR[key] for key in RADAR if key != "threshold_db"},
        "type": "radar.swerling", "swerling": 0, "false_alarm_probability": pfa,
        "power_w": 0.4, "reference_pd": 0.5, "clutter_threshold": "noise",
    }  # fmt: skip
    terrain = {"height_m": 1300.0, "clutter_gamma_db": -5.0, "clutter_mean": mean}
    seen = first_look(chain({"radar": radar}, targets=TARGETS, terrain=terrain), "radar")
    assert seen
    height_m = crooked.OWNSHIP["alt_m"] - 1300.0
    for target in TARGETS:
        if target["name"] not in seen:
            continue
        row = seen[target["name"]]
        snr = 10.0 ** (row["snr_db"] / 10.0)
        cnr = snr * clutter_to_signal(target, height_m, -5.0, 10.0**0.301)
        threshold = -math.log(pfa)
        if mean == "fluctuating":
            noise = 1.0 + cnr
            expected = 1.0 - chndtr(2.0 * threshold / noise, 2, 2.0 * snr / noise)
        else:
            phase = (np.arange(400) + 0.5) * math.pi / 400
            power = snr + cnr + 2.0 * math.sqrt(snr * cnr) * np.cos(phase)
            expected = float(np.mean(1.0 - chndtr(2.0 * threshold, 2, 2.0 * power)))
        assert row["detection_probability"] == pytest.approx(expected, rel=1e-4)
