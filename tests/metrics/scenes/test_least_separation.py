"""How near any two aircraft come, by hand: two that cross 3 km away from the ownship."""

import math

import pytest
from covering import covers
from equipped import SURE_RADAR, TURN_AWAY, scene_of
from wired import measured

import dsa_des

KIND = ("[metric least_separation]",)
#: At 50 m/s relative to each other they are 48 m apart, and 20 m in height, at 9.28 s.
LEAST_M, LEAST_S = math.hypot(48.0, 20.0), 9.28
OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
EASTWARD = {"name": "one", "east_m": 2600, "north_m": 0, "up_m": 0, "heading_deg": 90,
            "speed_mps": 40}  # fmt: skip
NORTHWARD = {"name": "other", "east_m": 3000, "north_m": -240, "up_m": 20, "heading_deg": 0,
             "speed_mps": 30}  # fmt: skip
SITE = {"name": "below", "east_m": 3000, "north_m": 0, "alt_m": 980}


def crossing(duration_s=20, **traffic):
    tables = scene_of(OWN, [EASTWARD, NORTHWARD], {}, duration_s=duration_s).resolved()
    tables["blocks"]["traffic"] |= {"sites": [SITE], "update_rate_hz": 1, **traffic}
    return tables


def found(scene, **keys):
    return measured(scene, {"metric": "least_separation", **keys})


def test_any_two_count_and_places_on_the_ground_do_not():
    got = found(crossing())
    assert got["least_separation_m"] == pytest.approx(LEAST_M, abs=0.2)
    assert got["least_separation_time_s"] == pytest.approx(LEAST_S, abs=0.1)
    assert (got["any_well_clear_lost"], got["any_nmac"]) == (1, 1)


@covers("horizontal_m", "vertical_m", "nmac_horizontal_m", "nmac_vertical_m", of=KIND)
@pytest.mark.parametrize("name", ["", "nmac_"])
@pytest.mark.parametrize(("across_m", "half_m", "is_lost"), [(49, 21, 1), (47, 21, 0), (49, 19, 0)])
def test_a_loss_is_within_both_sizes(name, across_m, half_m, is_lost):
    sizes = {"nmac_horizontal_m": 1, "nmac_vertical_m": 1, "horizontal_m": 1, "vertical_m": 1}
    sizes |= {f"{name}horizontal_m": across_m, f"{name}vertical_m": half_m}
    got = found(crossing(), **sizes)
    assert (got["any_nmac"], got["any_well_clear_lost"]) == (
        is_lost * bool(name),
        is_lost * (not name),
    )


@covers("tau_s", of=KIND)
def test_a_time_counts_before_the_distance():
    sizes = {"horizontal_m": 60, "vertical_m": 30}
    lost = [found(crossing(5), tau_s=s, **sizes)["any_well_clear_lost"] for s in (0, 35)]
    assert lost == [0, 1]


@covers("step_s", of=KIND)
def test_distances_are_taken_so_often():
    """At 10 s they are 60 m apart on the ground."""
    got = found(crossing(sample_interval_s=50), step_s=10)
    assert got["least_separation_m"] == pytest.approx(math.hypot(60, 20), abs=0.2)
    assert got["least_separation_time_s"] == 10.0


@covers("platform", "steered", of=KIND)
def test_of_one_s_own_pairs_as_planned_and_as_all_flew():
    """The ownship and b would meet at 30 s; far from them two others come within 52 m."""
    far = [flight | {"up_m": flight["up_m"] + 2000} for flight in (EASTWARD, NORTHWARD)]
    b = {"name": "b", "east_m": 1500, "north_m": 1500, "up_m": 20, "heading_deg": 270,
         "speed_mps": 50}  # fmt: skip
    scene = scene_of(
        OWN, [b, *far], {"_b": "b"}, radar=SURE_RADAR, decider=TURN_AWAY,
        decides_by="tracker", duration_s=35,
    )  # fmt: skip
    own, planned = found(scene, platform="ownship"), found(scene, steered=False)
    assert planned["least_separation_m"] == pytest.approx(20.0, abs=2.0)
    assert found(scene)["least_separation_m"] == pytest.approx(LEAST_M, abs=0.2)
    assert own["least_separation_m"] > 200.0 and own["any_nmac"] == 0
    with pytest.raises(dsa_des.SceneError, match="there is no 'bb'; did you mean 'b'"):
        found(scene, platform="bb")
