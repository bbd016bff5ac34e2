"""Shares of a fleet that carry equipage, and how the equipage of aircraft comes together."""

from math import sqrt
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

import dsa_des
from components.aircraft.aircraft import Aircraft, Roster
from components.aircraft.equipage import AdsBEquipage, EquipageShares, draw_equipage
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Stream

FULL = Aircraft(mode_s=True, mode_c=True, ads_b=AdsBEquipage(nacp=9))
SCENE = """\
duration_s = 1
seed = 1
wires = ["traffic -> transform -> ether"]
[blocks.traffic]
{traffic}
equipage_shares = {{ mode_s = 0.7, ads_b = {share} }}
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.ether]
type = "surveillance.ads_b"
scan_rate_hz = 1
"""
RANDOM = """type = "traffic.random"
intruders = {count}
radius_km = 30
ownship = {{ lat_deg = 52, lon_deg = 4, alt_m = 1000, speed_mps = 50 }}
aircraft = {{ mode_s = true, ads_b = {{ nacp = 9 }} }}"""


def rosters(tmp_path, traffic, share=0.4, seeds=(1,)):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(traffic=traffic, share=share), encoding="utf-8")
    for seed in seeds:
        scene = load_scene(path, seed=seed)
        yield Simulation(scene).components["traffic"].roster.equipage


def test_each_keeps_its_equipage_by_itself():
    names = [f"a{number}" for number in range(20_000)]
    shares = EquipageShares(mode_s=0.8, mode_c=0.3, ads_b=0.5)
    kept = draw_equipage(names, [FULL] * len(names), shares, Stream(1, "traffic", "equipage"))
    found = Roster.from_pairs(list(zip(names, kept, strict=True))).equipage
    assert len({id(one) for one in kept}) == 8
    z = NormalDist().inv_cdf(0.9995)
    for part, share in ((found.mode_s, 0.8), (found.mode_c, 0.3), (found.ads_b, 0.5)):
        assert abs(part.mean() - share) < z * sqrt(share * (1 - share) / len(names))
    both = (found.mode_s & found.ads_b).mean()
    assert abs(both - 0.4) < z * sqrt(0.4 * 0.6 / len(names))


def test_more_traffic_leaves_the_equipage_of_the_first_ones(tmp_path):
    few, many = (next(rosters(tmp_path, RANDOM.format(count=count))).ads_b for count in (200, 400))
    assert 0.2 < few.mean() < 0.6 and np.array_equal(few, many[:200])


def test_shares_are_drawn_anew_for_each_encounter_run(tmp_path):
    file = Path("configs/encounters/light_aircraft.parquet").resolve()
    traffic = f"""type = "traffic.encounters"
file = "{file}"
intruder = {{ mode_s = true, ads_b = {{}} }}"""
    found = [one.ads_b[0] for one in rosters(tmp_path, traffic, 0.5, range(12))]
    assert 0 < sum(found) < 12


def test_what_is_not_given_is_not_there_and_addresses_are_kept():
    some = Aircraft(mode_s=True, icao_address="4840d6")
    found = Roster.from_pairs([("a", Aircraft()), ("b", some), ("c", FULL)]).equipage
    assert found.mode_s.tolist() == [False, True, True]
    assert found.ads_b.tolist() == [False, False, True]
    assert found.address[1] == 0x4840D6 and len(set(found.address.tolist())) == 3
    assert found.nic[2] == 9 and found.position_deviation_m[2] == pytest.approx(30.0 / 2.4477, 1e-4)
    assert not any(getattr(Aircraft(), key) for key in ("mode_s", "mode_c", "ads_b"))


def test_a_share_beyond_the_whole_is_refused(tmp_path):
    with pytest.raises(dsa_des.SceneError, match=r"equipage_shares\.ads_b"):
        next(rosters(tmp_path, RANDOM.format(count=2), share=1.5))
