"""Altitudes on both sides of every edge, flown by small steps; and no band narrower than a step."""

import math
from dataclasses import replace

import numpy as np
import pytest

from components.alert_configuration.conf_file import read_conf
from components.guidance.bands import guidance_of_many
from components.guidance.manoeuvre_kinds import KINDS, manoeuvres_of_kind
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import Detector, State
from components.well_clear.volume import Volume, violates
from tests.alerting.conf_text import CONF
from tests.guidance.test_bands_by_flying import (
    BELOW,
    CROSSING,
    HORIZON_S,
    LOOKAHEAD_S,
    NEAR,
    OWN,
    SIZES,
    VALUES,
    one_row,
)

STEP_S = 0.01
#: Meets the ownship three quarters of a minute on, 200 m above it now.
ABOVE = State(*(np.float64(v) for v in (-4000.0, -3900.0, 1100.0, 53.0, 40.0, -3.0)))


def levelled_off(target_m, climb, up_m):
    """Heights and climb rates of a flight that accelerates, holds and brakes to an altitude."""
    most, push = VALUES["vertical_rate"], VALUES["vertical_accel"]
    heights, rates = [up_m], [climb]
    up, rate, fast = up_m, climb, max(most, abs(climb))
    for _ in range(round(LOOKAHEAD_S / STEP_S)):
        gap = target_m - up
        side = math.copysign(1.0, gap)
        stop_m = rate * rate / (2 * push)
        if abs(gap) < 0.3 and abs(rate) < 2 * push * STEP_S:
            up, rate = target_m, 0.0
        else:
            # Away from it, or as near as braking takes: brake; else faster, up to the rate.
            brakes = rate * gap < 0.0 or stop_m >= abs(gap)
            change = -math.copysign(push, rate) if brakes else side * push
            new = rate + change * STEP_S
            new = min(max(new, -fast), fast)
            up, rate = up + 0.5 * (rate + new) * STEP_S, new
        heights.append(up)
        rates.append(rate)
    return np.array(heights), np.array(rates)


@pytest.mark.parametrize("climb", [1.5, -8.0])
def test_altitudes_on_both_sides_of_every_edge_are_as_they_are_flown(climb):
    """Looked at is the climb while it is held, and the level flight for so long after it."""
    values = {**VALUES, "lookahead_time": LOOKAHEAD_S}
    own = OWN._replace(climb_mps=np.float64(climb))
    volume = Volume(*SIZES, "none")
    edges = 0
    for intruder in (CROSSING, BELOW, NEAR, ABOVE):
        made = manoeuvres_of_kind("alt", one_row(own), values)
        conflicts = made.find_conflicts(one_row(intruder).columns(), Detector(volume))
        clear = ~conflicts.is_in_or_behind_conflict(0.0, LOOKAHEAD_S)[0]
        for place in np.flatnonzero(clear[1:] != clear[:-1]):
            for at in (place, place + 1):
                heights, rates = levelled_off(made.values[0, at], climb, float(own.up_m))
                time_s = np.arange(len(heights)) * STEP_S
                flown = State(
                    own.east_mps * time_s, own.north_mps * time_s, heights,
                    own.east_mps + 0 * time_s, own.north_mps + 0 * time_s, rates,
                )  # fmt: skip
                other = State(
                    *(intruder[i] + intruder[3 + i] * time_s for i in range(3)),
                    *(intruder[3 + i] + 0 * time_s for i in range(3)),
                )
                relative = flown.relative_to(other)
                # Flown in steps, and looked at by whole seconds on the way: sizes 2 % off.
                larger, smaller = (Volume(*(s * k for s in SIZES), "none") for k in (1.02, 0.98))
                if clear[at]:
                    assert not violates(smaller, relative).any()
                else:
                    assert violates(larger, relative).any()
            edges += 1
    assert edges >= 2 and HORIZON_S < LOOKAHEAD_S


@pytest.mark.parametrize("at_once", ["vertical_rate", "vertical_accel"])
@pytest.mark.parametrize("intruder", [BELOW, ABOVE])
def test_altitudes_that_are_taken_at_once_meet_who_is_level_with_them_while_near(intruder, at_once):
    """Level all the time, so the volume is met at the heights flown through while it is near."""
    values = {**VALUES, "lookahead_time": LOOKAHEAD_S, at_once: 0.0}
    made = manoeuvres_of_kind("alt", one_row(OWN), values)
    volume = Volume(*SIZES, "none")
    conflicts = made.find_conflicts(one_row(intruder).columns(), Detector(volume))
    found = conflicts.is_in_or_behind_conflict(0.0, LOOKAHEAD_S)[0]
    time_s = np.linspace(0.0, LOOKAHEAD_S, 200_001)
    east, north, up = (float(intruder[i]) + float(intruder[3 + i]) * time_s for i in range(3))
    east -= float(OWN.east_m) + float(OWN.east_mps) * time_s
    north -= float(OWN.north_m) + float(OWN.north_mps) * time_s
    near = np.hypot(east, north) < SIZES[0]
    assert near.any()
    low, high = up[near].min() - SIZES[1], up[near].max() + SIZES[1]
    assert found.tolist() == [bool(low < at < high) for at in made.values[0]]
    assert 0 < found.sum() < len(found)


@pytest.mark.parametrize("kind", KINDS)
def test_no_band_is_narrower_than_a_step(kind, tmp_path):
    """But where a limit cuts it, or the way out of a violation is painted over it."""
    path = tmp_path / "two.conf"
    path.write_text(CONF, encoding="utf-8")
    found = read_conf(path)
    configuration = replace(found, values={**found.values, f"recovery_{kind}": False})
    draw, count = np.random.default_rng(8), 320
    zero = np.zeros(count)
    track, speed = draw.uniform(0, 2 * math.pi, count), draw.uniform(30, 90, count)
    own = State(
        zero, zero, draw.uniform(500, 900, count), speed * np.sin(track), speed * np.cos(track),
        draw.normal(0, 2, count),
    )  # fmt: skip
    intruders = []
    for _ in range(2):
        way = draw.uniform(0, 2 * math.pi, count)
        state = State(
            *draw.uniform(-5000, 5000, (2, count)), own.up_m + draw.normal(0, 120, count),
            60 * np.sin(way), 60 * np.cos(way), draw.normal(0, 2, count),
        )  # fmt: skip
        none = np.zeros(count, dtype=np.int64)
        intruders.append(GuidedIntruders(state, configuration.alerters[0], none))
    step = configuration[f"step_{kind}"]
    several = 0
    for one in guidance_of_many(kind, configuration, own, intruders):
        assert all(a.high == b.low for a, b in zip(one.bands[:-1], one.bands[1:], strict=True))
        several += len(one.bands) > 2
        inner = one.bands[1:-1]
        if kind == "hdir" and len(one.bands) > 1 and one.bands[0].region == one.bands[-1].region:
            first, last = one.bands[0], one.bands[-1]
            assert first.high - first.low + last.high - last.low > step * (1 - 1e-6)
        assert all(band.high - band.low > step * (1 - 1e-6) for band in inner)
    assert several > 20
