"""Hand-made cases of guidance: horizons in recovery, and what counts as one place."""

import math

import numpy as np
import pytest

from components.alert_configuration.conf_file import default_values_and_units
from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.guidance.bands import GuidedIntruder, guidance, nearest_values_outside_red
from components.guidance.intervals import FULL_TURN, Band, clear_intervals
from components.guidance.memory import BandMemory, ResolutionMemory
from components.guidance.recovery import Recovery
from components.guidance.situation import State
from components.well_clear.volume import Volume

DEG = math.pi / 180.0
VALUES = {
    **default_values_and_units()[0], "corrective_region": "MID", "lookahead_time": 180.0,
    "min_alt": 100.0,
    "max_alt": 4000.0, "step_alt": 30.0, "vertical_rate": 2.5, "vertical_accel": 2.5,
    "horizontal_nmac": 150.0, "vertical_nmac": 30.0,
}  # fmt: skip


def state(*numbers):
    return State(*(np.float64(number) for number in numbers))


@pytest.mark.parametrize(
    ("radius_m", "half_m", "stable_s", "gaps"),
    [
        # Inside from 81.8 s to 89.8 s: to 74.5 m away it is level 50 s before that.
        (800.0, 130.0, 3.0, [(-900, -150), (-60, 60), (150, 3000)]),
        # From 219.5 m on it is level only after that.
        (800.0, 1000.0, 3.0, [(-900, -240), (-60, 60), (240, 3000)]),
        # Inside from 55.8 s to 115.8 s: from 284.5 m on.
        (6000.0, 1000.0, 10.0, [(-900, -300), (300, 3000)]),
    ],
)
def test_who_only_counts_for_manoeuvres_counts_as_far_as_its_alerting_time(
    radius_m, half_m, stable_s, gaps
):
    """Head-on at 200 m/s, the volume is met 50.8 s from now, alerted 50 s before.

    No level-off leads clear of it: at 2.5 m/s it is 126 m away at most after the 51 s that count.
    Beyond 50 s, so the search says (probes 180, 90, 45 ... 50.27), only the cylinder is asked for,
    for 50 s after each part of a level-off; it takes 2 s and 1 s for each 2.5 m.
    """
    values = {
        **VALUES, "min_horizontal_recovery": radius_m, "min_vertical_recovery": half_m,
        "recovery_stability_time": stable_s,
    }  # fmt: skip
    volume = Volume(1000.0, 140.0, 30.0, 0.0, "time_to_entry")
    alerter = Alerter("head on", (Level(volume, "MID", 50.0, 50.0),))
    own = state(0.0, 0.0, 1000.0, 0.0, 100.0, 0.0)
    other = state(0.0, 17160.0, 1000.0, 0.0, -100.0, 0.0)
    configuration = Configuration((alerter,), values, {})
    found = guidance("alt", configuration, own, [GuidedIntruder(other, alerter)])
    assert found.recovery == Recovery(50.2734375 + stable_s, (radius_m, half_m), 0)
    ways = [(b.low - 1000.0, b.high - 1000.0) for b in found.bands if b.region == "RECOVERY"]
    assert ways == gaps
    assert {band.region for band in found.bands} == {"MID", "RECOVERY"}


def test_a_clear_stretch_of_which_the_limit_leaves_one_place_is_none():
    """2^40 doubles below 100 are 0.0156: what is left of 99.99 to 100 is no interval."""
    values = np.array([60.0, 80.0, 99.99, 119.99])
    assert clear_intervals(values, np.array([False, False, True, True]), 0.0, 100.0, False) == []
    kept = clear_intervals(values - 0.02, np.array([False, False, True, True]), 0.0, 100.0, False)
    assert kept == [(99.97, 100.0)]


def bands(*edges):
    """Return bands from (place in deg, region above it), up to a full turn."""
    ends = [*(edge * DEG for edge, _ in edges[1:]), FULL_TURN]
    lows = [edge * DEG for edge, _ in edges]
    lows[0] = 0.0
    return [Band(low, high, r) for low, high, (_, r) in zip(lows, ends, edges, strict=True)]


SLIVER = [(45.0, "NONE"), (45.009, "NEAR"), (90.0, "NONE")]


@pytest.mark.parametrize(
    ("own_deg", "line", "way"),
    [
        # Red from 300 over north: beyond it 405 and 405.009 are one place, 45 and 45.009 are not.
        (350.0, bands((0.0, "NEAR"), *SLIVER, (300.0, "NEAR")), (300.0, 90.0)),
        (20.0, bands((0.0, "NEAR"), *SLIVER, (300.0, "NEAR")), (300.0, 90.0)),
        (70.0, bands((0.0, "NEAR"), *SLIVER, (300.0, "NEAR")), (300.0, 90.0)),
        (20.0, bands((0.0, "NEAR"), *SLIVER), (0.0, 45.0)),
        (70.0, bands((0.0, "NEAR"), *SLIVER), (45.009, 90.0)),
    ],
)
def test_a_sliver_beyond_north_is_lost_to_the_wider_tolerance_there(own_deg, line, way):
    found = nearest_values_outside_red(line, own_deg * DEG, "NEAR", True)
    assert (found.low, found.high) == pytest.approx((way[0] * DEG, way[1] * DEG), abs=1e-12)


@pytest.mark.parametrize(("own_deg", "way"), [(359.9, (300.0, 40.0)), (359.97, (-math.inf, 40.0))])
def test_an_own_direction_a_hair_left_of_north_lies_in_the_first_band(own_deg, way):
    """2^40 doubles below 360 deg are 0.056 deg."""
    line = bands((0.0, "NEAR"), (40.0, "NONE"), (300.0, "NEAR"))
    found = nearest_values_outside_red(line, own_deg * DEG, "NEAR", True)
    assert (found.low, found.high) == pytest.approx((way[0] * DEG, way[1] * DEG), abs=1e-12)
    assert found.prefers_high
    free = bands((0.0, "NONE"), (40.0, "NEAR"), (300.0, "NEAR"))
    assert (nearest_values_outside_red(free, own_deg * DEG, "NEAR", True) is None) == (
        own_deg == 359.97
    )


MEMORY = {
    **default_values_and_units()[0], "hysteresis_time": 5.0, "persistence_time": 4.0,
    "persistence_preferred_hdir": 15.0 * DEG, "persistence_preferred_alt": 250.0,
    "bands_persistence": True, "alerting_m": 2, "alerting_n": 2, "corrective_region": "NEAR",
}  # fmt: skip


@pytest.mark.parametrize(("off_deg", "kept"), [(14.99, True), (14.998, False)])
def test_a_way_out_is_near_an_earlier_one_only_beyond_the_tolerance(off_deg, kept):
    """2^40 doubles below 15 deg are 0.0035 deg."""
    memory = ResolutionMemory(MEMORY, "hdir")

    def shown(now_s, edge_deg):
        line = bands((0.0, "NEAR"), (edge_deg, "NONE"), (250.0, "NEAR"))
        way = nearest_values_outside_red(line, 0.3 * DEG, "NEAR", True)
        return memory.step(now_s, way, line, 0.3 * DEG, None).high

    for now_s in range(6):
        assert shown(float(now_s), 60.0) == 60.0 * DEG
    other = 60.0 - off_deg
    assert shown(6.0, other) == (60.0 * DEG if kept else other * DEG)


@pytest.mark.parametrize(("behind_deg", "kept"), [(179.9, True), (179.98, False)])
def test_a_remembered_direction_lies_on_its_side_up_to_nearly_half_a_turn(behind_deg, kept):
    """2^40 doubles below 180 deg are 0.028 deg."""
    memory = ResolutionMemory(MEMORY, "hdir")
    line = bands((0.0, "NONE"), (80.0, "NEAR"), (200.0, "NONE"))
    way = nearest_values_outside_red(line, 150.0 * DEG, "NEAR", True)
    assert memory.step(0.0, way, line, 150.0 * DEG, None).high == 200.0 * DEG
    own = (200.0 - behind_deg) * DEG
    turned = bands((0.0, "NEAR"), (100.0, "NONE"), (300.0, "NEAR"))
    way = nearest_values_outside_red(turned, own, "NEAR", True)
    shown = memory.step(1.0, way, turned, own, None).high
    assert shown == pytest.approx((200.0 if kept else 100.0) * DEG, abs=1e-12)


def test_persistence_paints_on_the_places_that_were_there():
    """A place of the line at which its colour does not change stands for one beside it."""
    memory = BandMemory(MEMORY, False)

    def step(now_s, *edges):
        ends = [*(edge for edge, _ in edges[1:]), 4000.0]
        line = [Band(low, high, r) for (low, r), high in zip(edges, ends, strict=True)]
        return memory.step(now_s, line, 1000.0, None)

    # Remembered: red from 900 to 1100.
    step(0.0, (0.0, "FAR"), (900.0, "NEAR"), (1100.0, "FAR"))
    # 1100.1 is the same place, and stands for it.
    found = step(1.0, (0.0, "FAR"), (1100.1, "FAR"))
    assert [(band.low, band.high, band.region) for band in found] == [
        (0.0, 900.0, "FAR"), (900.0, 1100.1, "NEAR"), (1100.1, 4000.0, "FAR"),
    ]  # fmt: skip
