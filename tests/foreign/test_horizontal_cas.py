"""HorizontalCAS: `.nnet` text, which network is asked about what, and the turns that come of it."""

import math
import os

import numpy as np
import pytest
from covering import covers

import dsa_des
from components.foreign.horizontal_cas import TAUS, time_to_co_altitude
from components.foreign.nnet_file import read_nnet
from dsa_des.errors import UsageError

OWN = {"lat_deg": -33.9, "lon_deg": 179.99, "alt_m": 300.0, "heading_deg": 217.0, "speed_mps": 50.0}


def nnet(layers, least=(-6e4, -6e4, -3.15), greatest=(6e4, 6e4, 3.15)):
    """A network as text, with remarks, commas at the ends, means and ranges."""
    sizes = [len(layers[0][0][0]), *(len(biases) for _, biases in layers)]
    lines = [
        "// by hand", f"{len(layers)},{sizes[0]},{sizes[-1]},{max(sizes)},",
        ",".join(map(str, sizes)) + ",", "0,",
        ",".join(map(repr, least)) + ",", ",".join(map(repr, greatest)) + ",",
        "100.0,-50.0,0.25,7.0,", "1000.0,2000.0,2.0,3.0,",
    ]  # fmt: skip
    for weights, biases in layers:
        lines += [",".join(map(repr, map(float, row))) + "," for row in weights]
        lines += [f"{float(bias)!r}," for bias in biases]
    return "\n".join(lines) + "\n"


def away_from_its_side(weak):
    """Turns away from the side on which the intruder is ahead: strongly, or weakly."""
    left, right = ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0])
    ahead = [1.0, 0.0, 0.0]
    out = np.zeros((5, 3))
    out[1 if weak else 3, 1] = out[2 if weak else 4, 0] = 1.0
    return nnet([([left, right, ahead], [0.0, 0.0, 0.0]), (out, [0.02, 0.0, 0.0, 0.0, 0.0])])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("networks")
    for before in range(5):
        for tau in TAUS:
            text = away_from_its_side(weak=tau > 0)
            (made / f"HCAS_rect_v6_pra{before}_tau{tau:02d}_25HU_3000.nnet").write_text(text)
    return made


def scene(folder, side=1, up_m=20.0, climb_mps=0.0, **keys):
    """An aircraft from one side that is where the ownship is after a minute."""
    nose = math.radians(217.0)
    across = nose + side * math.pi / 2
    conf = os.path.abspath("configs/alerting/do365b.conf")
    other = {"name": "one", "up_m": up_m, "speed_mps": 60.0, "climb_mps": climb_mps,
             "heading_deg": 217.0 - side * 90.0,
             "east_m": 3000 * math.sin(nose) + 3600 * math.sin(across),
             "north_m": 3000 * math.cos(nose) + 3600 * math.cos(across)}  # fmt: skip
    return {
        "duration_s": 20, "seed": 1, "record": {"truth": True},
        "wires": [
            "traffic -> alerting -> avoidance",
            {"from": "avoidance", "to": "traffic", "delay_s": 0.5, "holds": "nothing"},
        ],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": OWN, "intruders": [other]},
            "alerting": {"type": "alerting.daidalus", "scan_rate_hz": 1, "conf": conf},
            "avoidance": {"type": "avoidance.horizontal_cas", "networks": str(folder), **keys},
        },
    }  # fmt: skip


def turned_deg(run, time_s=19.0):
    """How far the ownship's course has turned to the right."""
    (row,) = (r for r in run.truth.to_pylist() if r["target"] is None and r["time_s"] == time_s)
    course = math.degrees(math.atan2(row["velocity_east_m_s"], row["velocity_north_m_s"]))
    return (course - 217.0 + 180.0) % 360.0 - 180.0


def test_a_network_is_the_sum_that_its_lines_say(tmp_path):
    random = np.random.default_rng(3)
    layers = [(random.normal(size=(n, m)), random.normal(size=n)) for m, n in ((3, 4), (4, 5))]
    path = tmp_path / "n.nnet"
    path.write_text(nnet(layers))
    network = read_nnet(path, 3, 5)
    for given in ([200.0, -3000.0, 1.0], [9e9, 0.0, -9.0]):
        x, y, psi = (max(low, min(high, v)) for low, high, v in
                     zip((-6e4, -6e4, -3.15), (6e4, 6e4, 3.15), given, strict=True))  # fmt: skip
        norm = [(x - 100.0) / 1000.0, (y + 50.0) / 2000.0, (psi - 0.25) / 2.0]
        (w1, b1), (w2, b2) = layers
        hidden = [max(0.0, sum(w * v for w, v in zip(row, norm, strict=True)) + b)
                  for row, b in zip(w1, b1, strict=True)]  # fmt: skip
        expected = [3.0 * (sum(w * v for w, v in zip(row, hidden, strict=True)) + b) + 7.0
                    for row, b in zip(w2, b2, strict=True)]  # fmt: skip
        assert network.outputs(np.array(given)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2,3,5,5,", "2,3,5,", r"line 2: .*3 values, not 4"),
        ("2,3,5,5,", "2,3,x,5,", "line 2: .*something else than numbers"),
        ("3,3,5,", "3,3,4,", "has 3 inputs and 4 outputs: 3 and 5 are needed"),
        ("1000.0,", "0.0,", "a range is not above 0"),
        ("0.02,\n", "", "ends before biases of layer 2"),
        ("// by hand", "", ""),
    ],
)
def test_what_is_no_network_is_said(tmp_path, old, new, said):
    path = tmp_path / "n.nnet"
    text = away_from_its_side(False)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    if not said:
        assert read_nnet(path, 3, 5).layers[1][1][0] == 0.02
        return
    with pytest.raises(UsageError, match=said):
        read_nnet(path, 3, 5)
    path.write_text(text + "1.0,\n")
    with pytest.raises(UsageError, match="line 25: goes on after the last layer"):
        read_nnet(path, 3, 5)


@covers("networks", "step_s", of=("avoidance.horizontal_cas",))
@pytest.mark.parametrize("side", [1, -1])
def test_the_ownship_turns_as_the_networks_advise(folder, side):
    """At one height: 3 deg/s away from the side on which it is."""
    run = dsa_des.run(scene(folder, side))
    told = run.manoeuvres.to_pylist()
    turns = [row["turn_rad"] for row in told]
    assert turns == pytest.approx([-side * math.radians(3.0)] * len(told))
    first_s = told[0]["time_s"] + 0.5
    assert turned_deg(run) == pytest.approx(-side * 3.0 * (19.0 - first_s), abs=0.2)
    half = dsa_des.run(scene(folder, side, step_s=0.5))
    assert turned_deg(half) == pytest.approx(-side * 1.5 * (19.0 - first_s), abs=1.0)


@covers("height_m", of=("avoidance.horizontal_cas",))
def test_the_time_to_co_altitude_chooses_the_network(folder):
    """Outside the height and closing it is another network's time, and else nobody's."""
    far_up = dsa_des.run(scene(folder, up_m=100.0))
    assert far_up.manoeuvres.num_rows == 0
    sinking = dsa_des.run(scene(folder, up_m=150.0, climb_mps=-4.0))
    rates = sinking.manoeuvres["rate_rad_s"].to_pylist()
    assert rates and rates == pytest.approx([math.radians(1.5)] * len(rates))
    near = dsa_des.run(scene(folder, up_m=100.0, height_m=120.0))
    assert near.manoeuvres["rate_rad_s"][0].as_py() == pytest.approx(math.radians(3.0))


def test_times_to_co_altitude_by_hand():
    assert time_to_co_altitude(20.0, 5.0, 30.0) == 0.0
    assert time_to_co_altitude(-130.0, 4.0, 30.0) == 25.0
    assert time_to_co_altitude(130.0, -4.0, 30.0) == 25.0
    assert time_to_co_altitude(130.0, 4.0, 30.0) == time_to_co_altitude(99.0, 0.0, 9.0) == math.inf


def test_networks_that_are_missing_are_named(tmp_path, folder):
    (tmp_path / "x_pra0_tau00_y.nnet").write_text("")
    with pytest.raises(Exception, match=r"39 of 40 networks are missing \(pra0_tau05, pra0_tau10"):
        dsa_des.run(scene(tmp_path))
