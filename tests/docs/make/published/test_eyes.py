"""The section of eyes: Morris's table in closed form and flown, and the rows of the risk."""

import math

import numpy as np
import pytest

from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules
from components.encounters.pairing import PairSampler
from components.formats.set_file import read_set
from docs.make.published import eyes
from docs.make.published.seen_in_time import Eyes, shares_unseen
from docs.make.published.volumes import MODELS, VOLUMES, violates


def test_the_closed_form_gives_all_of_the_table():
    for speed_kt, published in eyes.MORRIS.items():
        for looking, number in zip(eyes.SHARES.values(), published, strict=True):
            found = eyes.in_closed_form(speed_kt, looking)
            assert number <= round(found, 4) < number + 0.01
    # Twice as large an aircraft shows from twice as far: by hand, 2 · 9059 kt s / 400 kt - 12.5 s.
    assert eyes.in_closed_form(400, 1.0, 80.0) == pytest.approx((45.26 - 12.5) / 36.0, abs=2e-3)
    assert eyes.in_closed_form(700, 1.0) == pytest.approx(0.0122, abs=5e-3)
    assert eyes.in_closed_form(900, 1.0) == 0.0


@pytest.mark.parametrize(("speed_kt", "looking"), [(200, 1.0), (300, 1.0 / 3.0)])
def test_flights_see_as_many(speed_kt, looking):
    share, low, high = eyes.flown(speed_kt, looking, runs=400)
    expected = eyes.in_closed_form(speed_kt, looking)
    assert low < share < high
    assert abs(share - expected) < 2.6 * math.sqrt(expected * (1.0 - expected) / 400)


def test_a_rate_gives_another_table():
    found = [eyes.by_rate(speed_kt, 420.0, 6.2) for speed_kt in eyes.MORRIS]
    assert found == sorted(found, reverse=True)
    assert (
        max(abs(f - all_[0]) for f, all_ in zip(found, eyes.MORRIS.values(), strict=True)) > 0.015
    )


@pytest.fixture(scope="module")
def few():
    return eyes.chosen_pairs(MODELS / "light_aircraft.txt", 300)


def test_all_nmacs_are_flown_and_some_of_the_others_weigh_as_much(few):
    pairs, hit = few
    known = read_model(MODELS / "light_aircraft.txt")
    every = PairSampler(known, known, 1, PairingRules()).sample_pairs(range(300))
    nmac, lost = violates(VOLUMES["nmac"], every), violates(eyes._LOST, every)
    assert sum(len(some.weight) for some in hit) == nmac.sum() > 4
    assert violates(VOLUMES["nmac"], pairs).sum() == nmac.sum()
    assert len(pairs.weight) < 60 < lost.sum()
    # Weights of those that were taken stand for all.
    taken = np.isin(every.horizontal_ft, pairs.horizontal_ft)
    assert taken.sum() == len(pairs.weight)
    times = pairs.weight / every.weight[taken]
    expected = np.where(nmac, 1, np.where(lost, eyes.LOST_EVERY, eyes.OTHERS_EVERY))[taken]
    assert times == pytest.approx(expected)


def test_either_aircraft_of_an_encounter_may_be_the_one_that_is_steered(tmp_path, few):
    pairs = few[0].take(np.arange(5))
    files = eyes.sets_of_both(tmp_path, pairs)
    either = [eyes.flags_of(file, 5, 3, 1) for file in files]
    for name in ("nmac_nominal", "well_clear_lost_nominal", "encounter_weight"):
        assert either[0][name].tolist() == either[1][name].tolist(), name
    own, other = (read_set(file) for file in files)
    assert own.state["north_m"][::2].tolist() == other.state["north_m"][1::2].tolist()
    assert own.state["speed_mps"][1] == other.state["speed_mps"][0] != own.state["speed_mps"][0]


def test_other_assumptions_reach_the_flights(few, monkeypatch):
    # Who never looks out prevents nothing; one who takes half a minute to turn, less than one who
    # turns in half a second; and another block may decide.
    pairs = few[0].take(np.flatnonzero(violates(VOLUMES["nmac"], few[0]))[:3])
    changes = {
        "blind": ("blocks.pilot.left_looking=0",),
        "quick": ("wires[4].delay_s=0.5",),
        "ground": ("avoidance=operator.stochastic", "wires[4].delay_s=0.1"),
    }
    monkeypatch.setattr(eyes, "_ASSUMED", changes)
    found = eyes.flown_otherwise(pairs, 1)
    ratio = {said: ratios[0].ratio for said, ratios in found.items()}
    assert all(ratios[2].ratio <= ratios[0].ratio for ratios in found.values())
    assert ratio["blind"] == 1.0
    assert ratio["quick"] < 0.7 and ratio["quick"] <= ratio["ground"] <= 1.0


def test_the_time_that_the_published_numbers_leave(few):
    _, hit = few
    one_s, both_s = eyes.needed_s(hit)
    found = shares_unseen(hit, Eyes(), 150, [one_s, both_s])
    assert found[0, 0] == pytest.approx(eyes.ONE[0], abs=0.01)
    assert found[1, 1] == pytest.approx(eyes.BOTH[0], abs=0.01)
    shares = [
        [float(cell) for cell in line.split(" | ")[1:-1]]
        for line in eyes.not_seen(hit).splitlines()[2:]
    ]
    assert all(row == sorted(row) for row in shares)
    # Each pair of rows: by neither no more than by one; seldom looking, more than always.
    assert all(both <= one for i in (0, 2, 4) for one, both in zip(*shares[i : i + 2], strict=True))
    assert shares[4][2] > shares[0][2] > shares[2][2]


def test_the_rows_of_the_risk_stand_in_their_order():
    weight = np.array([3.0, 1.0, 2.0])
    flags = [
        {"nmac_nominal": [1.0, 1.0, 0.0], "nmac_mitigated": [1.0, 0.0, 0.0],
         "well_clear_lost_nominal": [1.0, 1.0, 1.0], "well_clear_lost_mitigated": [1.0, 0.0, 1.0]},
        {"nmac_nominal": [1.0, 1.0, 0.0], "nmac_mitigated": [0.0, 0.0, 1.0],
         "well_clear_lost_nominal": [1.0, 1.0, 1.0], "well_clear_lost_mitigated": [1.0, 1.0, 0.0]},
    ]  # fmt: skip
    either = [{name: np.array(one) for name, one in each.items()} for each in flags]
    ratios = eyes.ratios_of([{**each, "encounter_weight": weight} for each in either])
    rows = eyes.risk_rows(ratios)
    assert [row.published for row in rows] == [*eyes.ONE, *eyes.BOTH]
    # By hand: of NMAC 3 of 4 by the one and 2 of 4 by the other; neither leaves what both do.
    expected = [5.0 / 8.0, 9.0 / 12.0, 0.0, 3.0 / 6.0]
    assert [row.ours for row in rows] == pytest.approx(expected)
    assert all(row.interval[0] <= row.ours <= row.interval[1] for row in rows)
    shown = eyes.other_pilots({"somehow": ratios}).splitlines()[-1].split(" | ")
    assert shown[0] == "| somehow" and shown[2].startswith("**0.75 (") and len(shown) == 5
