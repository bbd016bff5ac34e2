"""The section of volumes: which encounters violate one, against times looked at one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from components.encounters.model import LAYERS_FT, Bins
from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules
from components.encounters.pairing import PairSampler
from docs.make.published.volumes import (
    CYLINDERS,
    EVEN,
    GAS,
    MODELS,
    UNCREWED,
    VOLUMES,
    altitude_edges_ft,
    gas_share,
    height_share,
    layers,
    sampled,
    uncrewed_at,
    variants,
)

CREWED = MODELS / "light_aircraft.txt"
COUNT = 300


@pytest.fixture(scope="module")
def pairs():
    sampler = PairSampler(read_model(UNCREWED), read_model(CREWED), 0, PairingRules())
    return sampler.sample_pairs(range(COUNT))


def looked_at(pairs, radius_ft, half_ft, factor):
    """Which pairs are inside at one of 20 times a second, of a cylinder so much larger."""
    found = np.zeros(COUNT, dtype=bool)
    for part in np.arange(20) / 20.0:
        north, east, up = (
            (1.0 - part) * apart[:-1] + part * apart[1:]
            for apart in (getattr(pairs, f"{a}_ft")[1] - getattr(pairs, f"{a}_ft")[0]
                          for a in ("north", "east", "up"))
        )  # fmt: skip
        inside = (np.hypot(north, east) < factor * radius_ft) & (np.abs(up) < factor * half_ft)
        found |= inside.any(axis=0)
    return found


@pytest.mark.parametrize(
    ("name", "radius_ft", "half_ft"),
    [
        ("nmac", 500.0, 100.0),
        ("2000 ft by 250 ft", 2000.0, 250.0),
        ("0.5 nmi", 3038.06, 1000.0),
    ],
)
def test_who_violates_a_cylinder_is_inside_at_some_time(pairs, name, radius_ft, half_ft):
    volume = {**VOLUMES, **CYLINDERS}[name]
    found = sampled(UNCREWED, CREWED, COUNT, {name: volume}).violated[name]
    inside, nearly = (looked_at(pairs, radius_ft, half_ft, factor) for factor in (0.98, 1.02))
    assert inside.sum() > 3 and nearly.sum() < COUNT
    assert not (inside & ~found).any() and not (found & ~nearly).any()


def test_the_share_is_of_weights_and_larger_volumes_hold_smaller_ones():
    found = sampled(UNCREWED, CREWED, COUNT, VOLUMES)
    nmac, lost = found.violated["nmac"], found.violated["2000 ft by 250 ft"]
    assert not (nmac & ~lost).any()
    share = found.share("nmac", "2000 ft by 250 ft")
    assert share.ratio == pytest.approx(found.weight[nmac].sum() / found.weight[lost].sum())
    assert share.interval[0] < 0.1 < share.interval[1]


def test_the_uncrewed_aircraft_flies_straight_and_level_at_its_speeds(tmp_path, pairs):
    speed_kt = pairs.speed_ft_s[0] / 1.687810
    assert speed_kt.min() >= 30.0 and speed_kt.max() <= 60.0
    assert np.ptp(speed_kt, axis=0).max() < 1e-9
    assert np.ptp(pairs.up_ft[0], axis=0).max() == np.ptp(pairs.heading_rad[0], axis=0).max() == 0.0
    fast = PairSampler(read_model(uncrewed_at(tmp_path, "80 120")), read_model(CREWED), 0, EVEN)
    some = fast.sample_pairs(range(20))
    assert some.speed_ft_s[0].min() / 1.687810 >= 80.0
    # Drawn alike, weights differ by the speeds of the two alone.
    assert some.weight.max() / some.weight.min() < 4.0


def test_a_gas_flows_into_both_volumes():
    for radius_nmi, published in GAS.items():
        radius_ft = radius_nmi * 6076.115
        level = gas_share(radius_ft, 300.0, 0.0)
        assert level == pytest.approx(500.0 * 100.0 / (radius_ft * 1000.0))
        assert level == pytest.approx(published, abs=5.1e-4)
    # Into lids alone by their areas.
    assert gas_share(1000.0, 0.0, 5.0) == pytest.approx(0.25)
    assert math.isclose(gas_share(500.0, 200.0, 5.0) * (4e8 + math.pi * 1.25e6),
                        4e7 + math.pi * 1.25e6)  # fmt: skip


def test_the_table_says_what_the_share_depends_on():
    lines = variants(CREWED, 60).splitlines()
    assert len(lines) == 2 + 9 and lines[0].count("|") == lines[2].count("|") == 6
    for line in lines[2:]:
        shares = [float(cell.split()[0]) for cell in line.split(" | ")[1:] if "to" in cell]
        # Two of them are larger in every way than the first.
        assert len(shares) == 3 and all(0.0 <= share <= 1.0 for share in shares)
        assert shares[0] >= shares[2]


def with_layers(counts):
    """A model with other counts of aircraft by layer."""
    model = read_model(CREWED)
    place = model.labels.index("L")
    node = replace(model.initial.nodes[place], counts=np.array([counts], dtype=float))
    bins = (*model.bins[:place], Bins(np.array(LAYERS_FT), 4), *model.bins[place + 1 :])
    network = replace(model.initial, nodes={**model.initial.nodes, place: node})
    return replace(model, initial=network, bins=bins)


def test_heights_by_the_counts_of_a_model():
    # By hand: with as many aircraft per foot all around, a tenth; of an ownship at 4500 ft and all
    # others between 3000 and 5000, 200 ft of 1500.
    gas = with_layers(np.diff(LAYERS_FT))
    assert height_share(gas, (6000.0, 17000.0)) == pytest.approx(0.1)
    crowd = with_layers([0.0, 0.0, 7.0, 0.0])
    assert height_share(crowd, (4500.0, 4500.0)) == pytest.approx(200.0 / 1500.0)
    shown = layers(gas).splitlines()
    assert len(shown) == 6 and shown[-1].startswith("| 5000 to 18000 ft | 10.")
    assert altitude_edges_ft(read_model(CREWED))[0] > 0.0


def test_heights_by_counts_are_those_of_encounters():
    found = sampled(UNCREWED, CREWED, 1500, {"0.5 nmi": CYLINDERS["0.5 nmi"]})
    inside = found.apart_ft < 1000.0
    share = np.average(found.apart_ft[inside] < 100.0, weights=found.weight[inside])
    expected = height_share(read_model(CREWED), (1200.0, 3000.0))
    assert share == pytest.approx(expected, abs=0.03)
