"""How far from its place a target of some size seems to be, and what a sensor states of that."""

import math

import crooked
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS, covers
from wired import chain, rows, run, sensor

#: Bodies of 2 m across and 12 m long, with a wing of 18 m.
BODY = {"front_m2": math.pi, "side_m2": 20.0, "horizontal_m2": 108.0}
EXTENT_M = np.array([12.0, 18.0, 2.0])
STILL = {"speed_mps": 0.0, "climb_mps": 0.0}
OWN = {**crooked.OWNSHIP, **STILL}
TARGET = {**crooked.ROLLING, **STILL, "eo": BODY, "ir": {**BODY, "back_m2": math.pi}}
#: So strong, or so sharp, that nothing else errs.
EXACT = {
    **{kind: {"power_w": 1e15} for kind in LINK_BUDGETS},
    **{kind: {"noise_equivalent_contrast": 1e-9} for kind in CAMERAS},
}
BEAM = {"azimuth_beamwidth_deg": 3.0, "elevation_beamwidth_deg": 3.0, "range_resolution_m": 1.0}


def seen(kind, share=0.2, lasts_s=0.01, rate_hz=5, count=4000, **keys):
    ours = {**(BEAM if kind in LINK_BUDGETS else {}), **EXACT[kind], **keys}
    block = sensor(kind, errors="signal", quantised=False, scan_rate_hz=rate_hz, glint_share=share,
                   glint_correlation_time_s=lasts_s, **ours)  # fmt: skip
    scene = chain({"sensor": block}, ownship=OWN, targets=[TARGET], duration_s=count / rate_hz)
    return rows(run(scene))


@covers("glint_share", of=(*LINK_BUDGETS, *CAMERAS))
@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_a_target_s_centre_wanders_over_its_own_body(kind):
    """Turned back into the target's axes: a share of its length, its span and its height."""
    found = seen(kind)
    true = crooked.body(TARGET, 0.0, OWN)
    away = np.linalg.norm(true)
    back = crooked.attitude(TARGET) @ crooked.attitude(OWN).T
    off = []
    for row in found:
        range_m = row["range_m"] if kind in LINK_BUDGETS else away
        line = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        off.append(back @ (range_m * line - true))
    off = np.array(off)
    if kind in CAMERAS:  # which see nothing of it along the line of sight
        line = back @ true / away
        across = np.eye(3) - np.outer(line, line)
        expected = across @ np.diag((0.2 * EXTENT_M) ** 2) @ across
    else:
        expected = np.diag((0.2 * EXTENT_M) ** 2)
    spread = np.cov(off.T)
    most = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_array_less(np.abs(spread - expected), 4.0 * most / math.sqrt(4000) + 1e-3)
    assert np.abs(off.mean(axis=0)).max() < 4.0 * 3.6 / math.sqrt(4000)


@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_what_is_stated_of_it_is_that_of_the_scene_s_aircraft(kind):
    """Its span and length as from any side, at the range or of the pixels that are measured."""
    level2, upward2 = 0.5 * (EXTENT_M[0] ** 2 + EXTENT_M[1] ** 2), EXTENT_M[2] ** 2
    for row in seen(kind, count=5):
        if kind in LINK_BUDGETS:
            over = row["range_m"]
            width2, height2 = 0.04 * level2 / over**2, 0.04 * upward2 / over**2
            assert row["range_variance_m2"] == pytest.approx(0.04 * level2, rel=1e-3)
        else:
            pixel = math.radians(360.0) / 36000.0
            share = row["pixels"] * pixel**2 / (math.pi + 2.0 / math.pi * 20.0)
            width2, height2 = 0.04 * share * level2, 0.04 * share * upward2
        level = math.cos(row["elevation_rad"])
        assert row["azimuth_variance_rad2"] == pytest.approx(width2 / level**2, rel=1e-3)
        assert row["elevation_variance_rad2"] == pytest.approx(height2, rel=1e-3)


# The pixels of a line, optical.projection, are of no area.
@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir"])
def test_a_camera_s_directions_err_by_what_it_states(kind):
    """Of level aircraft seen from all sides, by mean squares; a wing is wide, and no large area."""
    own = {**OWN, "pitch_deg": 0.0, "roll_deg": 0.0}
    level = {"pitch_deg": 0.0, "roll_deg": 0.0, "east_m": 0.0, "up_m": 0.0}
    targets = [
        {**TARGET, **level, "name": f"t{turn}", "north_m": 700.0 + 20.0 * turn, "yaw_deg": 7 + turn}
        for turn in range(0, 360, 15)
    ]
    block = sensor(kind, errors="signal", quantised=False, scan_rate_hz=5, **EXACT[kind],
                   glint_share=0.2, glint_correlation_time_s=0.01)  # fmt: skip
    found = rows(run(chain({"sensor": block}, ownship=own, targets=targets, duration_s=100)))
    assert len(found) == 500 * len(targets)
    for name in ("azimuth", "elevation"):
        range2 = np.array([row["true_range_m"] ** 2 for row in found])
        wrong = np.array([row[f"{name}_rad"] - row[f"true_{name}_rad"] for row in found])
        wrong = (wrong + math.pi) % (2.0 * math.pi) - math.pi
        stated = np.array([row[f"{name}_variance_rad2"] for row in found])
        assert np.mean(stated * range2) == pytest.approx(np.mean(wrong**2 * range2), rel=0.1)


@covers("glint_correlation_time_s", of=(*LINK_BUDGETS, *CAMERAS))
@pytest.mark.parametrize("kind", (*LINK_BUDGETS, *CAMERAS))
def test_it_lasts_as_long_as_the_scene_says(kind):
    count = 4000 if kind == "radar.threshold" else 400
    found = seen(kind, lasts_s=0.4, rate_hz=10, count=count)
    wrong = np.array([row["azimuth_rad"] - row["true_azimuth_rad"] for row in found])
    left = np.mean(wrong[2:] * wrong[:-2]) / np.mean(wrong**2)
    assert left == pytest.approx(math.exp(-0.2 / 0.4), abs=6.0 / math.sqrt(count))


def test_a_track_is_no_better_than_the_aircraft_is_large():
    """Without it a strong echo at 500 m is known to centimetres; no share of 0 is warned of."""
    near = {"count": 200, "rate_hz": 10}
    exact, floor = (seen("radar.threshold", share, **near) for share in (0.0, 0.2))
    for found, low, high in ((exact, 0.0, 0.05), (floor, 1.0, 6.0)):
        off = [row["range_m"] - row["true_range_m"] for row in found]
        assert low <= np.std(off) < high
