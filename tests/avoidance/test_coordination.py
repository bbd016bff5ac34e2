"""Two that avoid tell each other which side they have chosen (``address``)."""

import itertools

import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des

CONF = "configs/alerting/do365b.conf"
OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 60}
B = {"name": "b", "lat_deg": 52.08, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 180,
     "speed_mps": 60}  # fmt: skip


def head_on(addresses=(None, None), told=None, seed=1, offset_s=0, below=None, **keys):
    """Return two that meet head on at one altitude, the one the other's image, and climb."""
    wires, blocks = [], {}
    traffic = {"type": "traffic.scripted", "ownship": OWN, "intruders": [B]}
    if below is not None:  # a third one behind the first, nearer to the ground
        low, alt_m = OWN | {"name": "low", "lat_deg": 51.98, "alt_m": below[1]}, {"alt_m": below[0]}
        traffic |= {"ownship": OWN | alt_m, "intruders": [B | alt_m, low]}
    for suffix, platform, address in zip(("", "_b"), (None, "b"), addresses, strict=True):
        on = {} if platform is None else {"platform": platform}
        blocks[f"alerting{suffix}"] = {
            "type": "alerting.daidalus", "conf": CONF, "scan_rate_hz": 1, **on
        }  # fmt: skip
        if platform is None:
            blocks["alerting"]["offset_s"] = offset_s
        avoidance = {"type": "avoidance.daidalus", "conf": CONF, "manoeuvre": "climb", **keys}
        if address is not None:
            avoidance["address"] = address
        blocks[f"avoidance{suffix}"] = avoidance
        wires += [
            f"traffic -> alerting{suffix} -> avoidance{suffix}",
            {"from": f"avoidance{suffix}.manoeuvres", "to": "traffic", "delay_s": 5,
             "holds": "nothing"},
        ]  # fmt: skip
    if told is not None:
        wires += [
            {"from": "avoidance.sides", "to": "avoidance_b.told", "holds": "nothing", **told},
            {"from": "avoidance_b.sides", "to": "avoidance.told", "holds": "nothing", **told},
        ]
    return dsa_des.load_scene(
        {"title": "t", "duration_s": 75, "seed": seed, "wires": wires,
         "blocks": {"traffic": traffic, **blocks}}
    )  # fmt: skip


def three(duration_s=8, **told):
    """Return the ownship (2) head on with b (1), and c (3), which crosses the ownship's way later.

    b and c pass 1.7 km from each other, and neither is in the other's way.
    """
    tables = head_on((2, 1), told).resolved()
    blocks, wires = tables["blocks"], tables["wires"]
    place = {"north_m": 6000, "east_m": 0}, {"north_m": 4200, "east_m": -4200}
    blocks["traffic"]["intruders"] = [
        {"up_m": 0, "speed_mps": 60, "name": name, "heading_deg": heading_deg, **at}
        for name, heading_deg, at in zip("bc", (180, 90), place, strict=True)
    ]
    blocks["alerting_c"] = {**blocks["alerting_b"], "platform": "c"}
    blocks["avoidance_c"] = {**blocks["avoidance_b"], "address": 3}
    steers = {"from": "avoidance_c.manoeuvres", "to": "traffic", "delay_s": 5, "holds": "nothing"}
    wires += ["traffic -> alerting_c -> avoidance_c", steers]
    wires += [
        {
            "from": f"avoidance{one}.sides",
            "to": f"avoidance{other}.told",
            "holds": "nothing",
            **told,
        }
        for one, other in (("_c", ""), ("_c", "_b"), ("", "_c"), ("_b", "_c"))
    ]
    return dsa_des.load_scene(tables | {"duration_s": duration_s})


def test_a_side_binds_only_whom_it_is_meant_for():
    """b descends, so the ownship climbs; c, whose conflict is with the ownship alone, descends."""
    scene = three(delay_s=0.5)
    last = {row["block"]: np.sign(row["climb_m"])
            for row in tables_of(scene)[1]["manoeuvres"].to_pylist()}  # fmt: skip
    assert last == {"avoidance": 1.0, "avoidance_b": -1.0, "avoidance_c": -1.0}
    sides = tables_of(scene)[1]["sides"].to_pylist()
    told = {(row["address"], row["meant_for"]) for row in sides}
    assert told == {(1, 2), (2, 1), (2, 3), (3, 2)}
    # One for each of two at one instant.
    assert len(sides) == len({(row["time_s"], row["address"], row["meant_for"]) for row in sides})


def climbs(scene):
    found = {"avoidance": [], "avoidance_b": []}
    for row in tables_of(scene)[1]["manoeuvres"].to_pylist():
        found[row["block"]].append((row["time_s"], float(np.sign(row["climb_m"]))))
    return found


def test_without_coordination_both_choose_by_symmetry_and_with_it_one_goes_the_other_way():
    free = climbs(head_on())
    assert free["avoidance"] == free["avoidance_b"]
    begins_s, side = free["avoidance"][0]
    together = climbs(head_on((1, 2), {"delay_s": 0.5}))
    assert together["avoidance"][0] == (begins_s, side)
    # Both chose alike; told so by the lower address, the higher one turns round a second on.
    assert together["avoidance_b"][:2] == [(begins_s, side), (begins_s + 1.0, -side)]
    assert {one for _, one in together["avoidance"]} == {side}
    assert {one for _, one in together["avoidance_b"][1:]} == {-side}
    swapped = climbs(head_on((7, 3), {"delay_s": 0.5}))
    assert swapped["avoidance"] == together["avoidance_b"]
    assert swapped["avoidance_b"] == together["avoidance"]


@covers("address", of=("avoidance.daidalus",))
def test_who_chooses_later_takes_the_side_that_goes_with_what_was_told():
    """They look at other instants: neither changes what it has chosen."""
    found = climbs(head_on((1, 2), {"delay_s": 0.5}, offset_s=0.3))
    (first_s, first), (then_s, then) = sorted(of[0] for of in found.values())
    assert then_s > first_s + 0.5 and then == -first
    assert {len({side for _, side in of}) for of in found.values()} == {1}


@covers("heeds_s", of=("avoidance.daidalus",))
def test_what_is_lost_or_old_leaves_both_free():
    free = climbs(head_on())
    assert climbs(head_on((1, 2), {"delay_s": 0.5, "drop_probability": 1.0})) == free
    assert climbs(head_on((1, 2))) == free
    assert climbs(head_on((1, 2), {"delay_s": 0.5}, heeds_s=0.25)) == free


def test_who_cannot_go_the_other_way_waits_until_it_may_choose_again():
    """Under the first one flies a third: at first there is no way down for who has to descend."""
    found = climbs(head_on((1, 2), {"delay_s": 0.5}, below=(250, 90)))["avoidance_b"]
    (at_s, side), (then_s, then), *_ = found
    assert (side, then) == (1.0, -1.0) and at_s + 2.0 < then_s < at_s + 10.0
    for (before_s, one), (after_s, other) in itertools.pairwise(found):
        assert other == -one or after_s - before_s >= 10.0


def test_a_message_that_is_lost_is_told_again():
    """With a third of them lost, some higher address turns round later than at the first."""
    (begins_s, side), *_ = climbs(head_on())["avoidance"]
    turned_s = []
    for seed in range(1, 5):
        told = {"delay_s": 0.5, "drop_probability": 0.35}
        found = climbs(head_on((1, 2), told, seed=seed))["avoidance_b"]
        turned_s += [at for at, one in found if one == -side][:1]
    assert len(turned_s) >= 3 and begins_s + 1.0 in turned_s and max(turned_s) > begins_s + 1.0


def test_turns_go_together_to_one_side():
    for told in (None, {"delay_s": 0.5}):
        turns = tables_of(head_on((1, 2), told, manoeuvre="turn"))[1]["manoeuvres"].to_pylist()
        assert {np.sign(row["turn_rad"]) for row in turns} == {1.0}


def test_two_with_one_address_are_refused():
    with pytest.raises(dsa_des.SceneError, match=r"address is 4.*has the same"):
        tables_of(head_on((4, 4), {"delay_s": 0.5}))


def test_the_same_in_any_window_and_beside_others():
    same_in_any_window(three(20, delay_s=0.5, drop_probability=0.4))
    same_as_alone(replicas_of(three(20, delay_s=0.5), {}, {}))
