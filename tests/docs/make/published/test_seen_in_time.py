"""Who is seen along encounters: against a closed form, by hand, and the block of a banked scene."""

import math
from dataclasses import replace

import numpy as np
import pytest

import dsa_des
from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules
from components.encounters.pairing import Pairs, PairSampler
from components.visual.acquisition import VISUAL_RANGE_DEPTH, integrated_acquisition_rate
from docs.make.published import eyes
from docs.make.published.seen_in_time import Eyes, opportunity, unseen
from docs.make.published.volumes import MODELS

FOOT_M = 0.3048
#: A sphere, so that no aspect matters.
BALL = Eyes(area_m2=(12.0, 0.0, 0.0), smallest_arcmin=0.0)


def straight(own, other, seconds=100):
    """A pair that flies straight: position, ft, and velocity, ft/s, of each (north, east, up)."""
    time = np.arange(seconds + 1.0)[:, np.newaxis]
    paths = {
        f"{axis}_ft": np.stack([p[k] + v[k] * time for p, v in (own, other)])
        for k, axis in enumerate(("north", "east", "up"))
    }
    shape = (2, seconds + 1, 1)
    heading = [math.atan2(v[1], v[0]) for _, v in (own, other)]
    speed = [math.sqrt(sum(x * x for x in v)) for _, v in (own, other)]
    one, none = np.ones(1), np.zeros(shape)
    return Pairs(
        numbers=np.zeros(1, dtype=int), weight=one, horizontal_ft=one, vertical_ft=one,
        course_rad=one, attempts=np.zeros(1, dtype=int), **paths,
        heading_rad=np.broadcast_to(np.reshape(heading, (2, 1, 1)), shape).copy(),
        speed_ft_s=np.broadcast_to(np.reshape(speed, (2, 1, 1)), shape).copy(), climb_ft_s=none,
        turn_rad_s=none, acceleration_ft_s2=none,
    )  # fmt: skip


def test_head_on_it_is_the_closed_form():
    pairs = straight(
        ((0.0, 0.0, 0.0), (200.0, 0.0, 0.0)), ((60000.0, 0.0, 0.0), (-300.0, 0.0, 0.0))
    )
    found = opportunity(pairs, BALL, 0)
    extinction = VISUAL_RANGE_DEPTH / (20.0 * 1852.0)
    for second in (20, 60, 90):
        expected = integrated_acquisition_rate(
            12.0, 500.0 * FOOT_M, from_m=60000.0 * FOOT_M,
            to_m=(60000.0 - 500.0 * second) * FOOT_M, extinction_per_m=extinction,
        )  # fmt: skip
        assert found[second, 0] == pytest.approx(expected, rel=2e-3)
    # The other one sees as much; half as often half as much; and so long before, so little.
    assert opportunity(pairs, BALL, 1) == pytest.approx(found, rel=1e-9)
    assert opportunity(pairs, replace(BALL, looking=0.5), 0) == pytest.approx(0.5 * found)
    assert unseen(found, 100.0, 40.0)[0] == pytest.approx(math.exp(-found[60, 0]))
    assert unseen(found, 100.0, 39.5)[0] == pytest.approx(math.exp(-found[60:62, 0].mean()))
    assert unseen(found, 100.0, 200.0)[0] == 1.0


def test_an_aircraft_that_is_too_small_or_out_of_view_is_not_seen():
    behind = straight(
        ((0.0, 0.0, 0.0), (200.0, 0.0, 0.0)), ((-9000.0, 0.0, 0.0), (260.0, 0.0, 0.0))
    )
    assert opportunity(behind, BALL, 0)[-1, 0] == 0.0 < opportunity(behind, BALL, 1)[-1, 0]
    # Left of the tail by 70 deg shows to who sits on the left, right of it does not.
    for side, shown in ((-1.0, True), (1.0, False)):
        abeam = straight(
            ((0.0, 0.0, 0.0), (200.0, 0.0, 0.0)),
            ((-1000.0, side * 3000.0, 0.0), (200.0, 0.0, 0.0)),
        )
        assert bool(opportunity(abeam, BALL, 0)[-1, 0] > 0.0) is shown
    # Too high for the roof, or for one who climbs less.
    high = straight(
        ((0.0, 0.0, 0.0), (200.0, 0.0, 0.0)), ((3000.0, 0.0, 2500.0), (200.0, 0.0, 0.0))
    )
    assert opportunity(high, BALL, 0)[-1, 0] == 0.0
    climbs = straight(
        ((0.0, 0.0, 0.0), (200.0, 0.0, 40.0)), ((3000.0, 0.0, 2500.0), (200.0, 0.0, 40.0))
    )
    assert opportunity(climbs, BALL, 0)[-1, 0] > 0.0
    # A disc of 12 m² is 1' from 13.4 km on.
    far = straight(((0.0, 0.0, 0.0), (200.0, 0.0, 0.0)), ((60000.0, 0.0, 0.0), (-300.0, 0.0, 0.0)))
    limited = opportunity(far, replace(BALL, smallest_arcmin=1.0), 0)[:, 0]
    begins_s = (60000.0 - 13437.0 / FOOT_M) / 500.0
    assert int(np.flatnonzero(limited)[0]) - 1 == pytest.approx(begins_s, abs=1.0)


def test_the_block_has_as_much_in_flights_that_turn(tmp_path):
    known = read_model(MODELS / "light_aircraft.txt")
    pairs = PairSampler(known, known, 1, PairingRules()).sample_pairs(range(120))
    turning = np.abs(pairs.turn_rad_s[0, :140]).mean(axis=0)
    seen = opportunity(pairs, Eyes(), 0)
    some = pairs.take(np.argsort(-np.where(seen[140] > 0.3, turning, 0.0))[:3])
    # Banked by 10 deg and more on the way.
    speed, rate = some.speed_ft_s[0, 10:140], some.turn_rad_s[0, 10:140]
    assert (np.degrees(np.arctan(speed * np.abs(rate) / 32.2)).max(axis=0) > 10.0).all()
    file, _ = eyes.sets_of_both(tmp_path, some)
    for number in range(3):
        scene = dsa_des.load_scene(
            eyes.SCENE,
            swaps=["traffic=traffic.encounters"],
            sets=[
                f"blocks.traffic.file={file}", f"blocks.traffic.encounter={number}",
                "record.looks=true", "blocks.avoidance.level=4",
            ],
        )  # fmt: skip
        looks = dsa_des.run(scene)["looks"]
        at_s, chance = looks["time_s"].to_numpy(), looks["detection_probability"].to_numpy()
        before = at_s <= 120.0
        theirs = -np.log1p(-np.nan_to_num(chance[before])).sum()
        (ours,) = opportunity(some.take(np.array([number])), Eyes(), 0)[120]
        assert theirs == pytest.approx(ours, rel=0.08, abs=0.01)
