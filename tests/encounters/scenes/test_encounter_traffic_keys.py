"""Traffic of encounters: which one is flown, where, how, and what damaged ones do."""

import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pymap3d
import pytest
from click.testing import CliRunner
from covering import covers
from wired import chain, rows, run, sensor

import dsa_des
from components.encounters.command import encounters
from tests.encounters.test_pairing import GAS, TURNS

RADAR = sensor("radar.range_boundary", scan_rate_hz=1)
BOTH = ("traffic.encounters", "traffic.encounter_model")
AT = {"lat_deg": -41.3, "lon_deg": 179.9997}


def events(path, **changes) -> str:
    """Two encounters of straight flights and one turn; the ownship heads 217 degrees."""
    own = math.radians(217)
    columns = {
        "encounter": [4, 4, 9, 9],
        "weight": [2.0, 2.0, 0.5, 0.5],
        "aircraft": ["own", "one", "own", "other"],
        "north_m": [300.0, -900.0, 0.0, 2000.0],
        "east_m": [-200.0, 700.0, 0.0, 0.0],
        "altitude_m": [2000.0, 2100.0, 2000.0, 1900.0],
        "speed_mps": [50.0, 60.0, 50.0, 70.0],
        "heading_rad": [own, 1.0, own, math.pi],
        "duration_s": [20.0] * 4,
        "time_s": [[0.0], [0.0, 3.0], [0.0], [0.0]],
        "climb_mps": [[0.0], [2.0, 0.0], [0.0], [0.0]],
        "turn_rad_s": [[0.0], [0.0, 0.1], [0.0], [0.0]],
        "acceleration_mps2": [[0.0], [0.0, 0.0], [0.0], [0.0]],
    }
    pq.write_table(pa.table({**columns, **changes}), path)
    return str(path)


def seen(traffic: dict, duration_s: float = 10, **parts) -> dict[float, dict]:
    scene = chain({"radar": RADAR}, duration_s=duration_s, **parts)
    scene["blocks"]["traffic"] = traffic
    return {row["time_s"]: row for row in rows(run(scene))}


@covers("file", "encounter", of=("traffic.encounters",))
def test_the_encounter_of_a_number_is_flown(tmp_path):
    file = events(tmp_path / "set.parquet")
    found = seen({"type": "traffic.encounters", "file": file, "encounter": 4})
    assert {row["target"] for row in found.values()} == {"one"}
    for t in (0, 2):  # before the turn: straight lines by hand, one climbing
        own = (
            300 + 50 * t * math.cos(math.radians(217)),
            -200 + 50 * t * math.sin(math.radians(217)),
        )
        one = -900 + 60 * t * math.cos(1), 700 + 60 * t * math.sin(1)
        apart = math.hypot(own[0] - one[0], own[1] - one[1], 100 + 2 * t)
        assert found[float(t)]["true_range_m"] == pytest.approx(apart, abs=1.0)
    other = seen({"type": "traffic.encounters", "file": file, "encounter": 9})
    assert other[0.0]["true_range_m"] == pytest.approx(math.hypot(2000, 100), abs=1.0)


def test_a_run_tells_the_number_and_the_weight_of_its_encounter(tmp_path):
    scene = chain({"radar": RADAR})
    scene["blocks"]["traffic"] = {
        "type": "traffic.encounters", "file": events(tmp_path / "set.parquet"), "encounter": 9,
    }  # fmt: skip
    assert run(scene).info["summary"]["encounter"] == {"number": 9, "weight": 0.5}


@covers("lat_deg", "lon_deg", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
def test_the_origin_is_put_where_it_is_said(kind, tmp_path):
    file = tmp_path / "set.parquet"
    if kind == "traffic.encounters":
        traffic = {"type": kind, "file": events(file), "encounter": 9}
        offset = np.zeros(2)
    else:
        traffic = {"type": kind, "file": model(tmp_path), "encounter": 3}
        offset = None
    biased = {"navigation": {"position_bias_m": [0, 0, 1e-6]}}
    row = seen({**traffic, **AT}, **biased)[0.0]
    there = pymap3d.geodetic2enu(
        row["own_lat_deg"], row["own_lon_deg"], 0.0, AT["lat_deg"], AT["lon_deg"], 0.0
    )
    other = seen({**traffic, "lat_deg": 10.0, "lon_deg": 20.0}, **biased)[0.0]
    elsewhere = pymap3d.geodetic2enu(other["own_lat_deg"], other["own_lon_deg"], 0.0, 10.0, 20.0, 0)
    assert there[:2] == pytest.approx(elsewhere[:2], abs=0.01)
    if offset is not None:
        assert there[:2] == pytest.approx(offset, abs=0.01)


@covers("dynamics", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
def test_a_point_mass_rolls_into_its_turns(kind, tmp_path):
    """An Euler track turns at once; a point mass banks first, and so is elsewhere."""
    file = tmp_path / "set.parquet"
    if kind == "traffic.encounters":
        traffic = {"type": kind, "file": events(file), "encounter": 4}
    else:
        traffic = {"type": kind, "file": model(tmp_path), "encounter": turning(tmp_path)}
    ranges = [
        [row["true_range_m"] for row in seen({**traffic, "dynamics": d}, 10).values()]
        for d in ("euler", "point_mass")
    ]
    assert len(ranges[0]) == len(ranges[1]) == 10
    assert ranges[0][0] == pytest.approx(ranges[1][0], abs=1e-6)
    apart = np.abs(np.subtract(*ranges))
    assert 0.1 < apart[-1] < 200.0


@covers("skip_damaged", of=("traffic.encounters",))
def test_a_set_with_a_damaged_encounter(tmp_path):
    file = events(tmp_path / "set.parquet", weight=[None, None, 0.5, 0.5])
    traffic = {"type": "traffic.encounters", "file": file, "encounter": 9}
    with pytest.raises(Exception, match=r"set\.parquet: encounter 4: weight is missing"):
        seen(traffic)
    assert seen({**traffic, "skip_damaged": True})


def model(folder, name: str = "model.txt", text: str = TURNS) -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def turning(folder) -> int:
    """Return the number of a pair in which somebody turns within the first seconds."""
    from components.encounters.model_file import read_model
    from components.encounters.pair_densities import PairingRules
    from components.encounters.pairing import PairSampler

    read = read_model(folder / "model.txt")
    pairs = PairSampler(read, read, 0, PairingRules()).sample_pairs(range(40))
    turned = np.abs(np.diff(pairs.turn_rad_s[:, :6], axis=1)).max(axis=(0, 1))
    return int(np.argmax(turned))


@covers("file", "intruder_file", "encounter", "model_seed", of=("traffic.encounter_model",))
def test_a_model_gives_the_encounter_of_its_number(tmp_path):
    traffic = {"type": "traffic.encounter_model", "file": model(tmp_path)}
    first = seen({**traffic, "encounter": 1}, 2)
    assert first == seen({**traffic, "encounter": 1}, 2)
    assert first != seen({**traffic, "encounter": 2}, 2)
    assert first != seen({**traffic, "encounter": 1, "model_seed": 5}, 2)
    # A slow intruder's speed: its range cannot change faster than both fly.
    slow = model(tmp_path, "slow.txt", TURNS.replace("60 70 110 160", "5 6 10 12"))
    pair = {**traffic, "intruder_file": slow, "file": slow, "encounter": 1}
    apart = [row["true_range_m"] for row in seen(pair, 4).values()]
    assert np.abs(np.diff(apart)).max() <= 2 * 12 * 1852 / 3600
    mixed = seen({**traffic, "intruder_file": slow, "encounter": 1}, 4)
    assert [row["true_range_m"] for row in mixed.values()] != apart
    assert mixed != seen({**traffic, "encounter": 1}, 4)


@covers("update_rate_hz", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
def test_positions_are_held_between_updates(kind, tmp_path):
    file = events(tmp_path / "set.parquet") if kind == BOTH[0] else model(tmp_path)
    traffic = {"type": kind, "file": file, "encounter": 4}
    held = seen({**traffic, "update_rate_hz": "1/2"}, 6)
    moving = seen(traffic, 6)
    for time, row in held.items():
        assert row["true_range_m"] == moving[2.0 * (time // 2)]["true_range_m"]
    assert moving[1.0]["true_range_m"] != moving[0.0]["true_range_m"]


FLIGHT = ("alt_m", "heading_deg", "speed_mps", "airspeed_mps", "climb_mps", "yaw_deg", "pitch_deg",
          "roll_deg", "lat_deg", "lon_deg")  # fmt: skip
LEG = ("kind", "duration_s", "speed_mps", "climb_mps")
LEGS = (
    *(f"straight.{key}" for key in (*LEG, "heading_deg")),
    *(f"turn.{key}" for key in (*LEG, "rate_deg_s", "radius_m", "angle_deg")),
    *(f"climb.{key}" for key in (*LEG, "to_alt_m")), "stationary.kind", "stationary.duration_s",
    "waypoints.kind", "waypoints.speed_mps",
    *(f"waypoints.points.{key}" for key in ("lat_deg", "lon_deg", "alt_m", "east_m", "north_m",
                                            "up_m", "speed_mps")),
)  # fmt: skip
START = {"lat_deg": -41.3, "lon_deg": 179.9997, "alt_m": 2400.0, "heading_deg": 217.0}
OWN_FLIGHTS = (
    {**START, "airspeed_mps": 70.0, "climb_mps": 3.0, "yaw_deg": 222.0, "pitch_deg": 8.0,
     "roll_deg": -27.0},
    {**START, "speed_mps": 60.0, "legs": [
        {"kind": "straight", "duration_s": 2, "heading_deg": 200, "speed_mps": 65, "climb_mps": 2},
        {"kind": "turn", "rate_deg_s": -4, "angle_deg": 10, "speed_mps": 61, "climb_mps": -1},
        {"kind": "turn", "radius_m": 900, "duration_s": 2},
        {"kind": "climb", "climb_mps": 5, "to_alt_m": 2406, "speed_mps": 66},
        {"kind": "climb", "climb_mps": -2, "duration_s": 1},
        {"kind": "stationary", "duration_s": 2}]},
    {**START, "speed_mps": 60.0, "legs": [{"kind": "waypoints", "speed_mps": 80.0, "points": [
        {"lat_deg": -41.302, "lon_deg": -179.999, "alt_m": 2410.0},
        {"east_m": 100.0, "north_m": -700.0, "up_m": 60.0, "speed_mps": 90.0}]}]},
)  # fmt: skip


@covers(
    *(f"scripted_ownship.{key}" for key in FLIGHT),
    *(f"scripted_ownship.legs.{key}" for key in LEGS),
    of=BOTH,
)
@pytest.mark.parametrize("own", OWN_FLIGHTS)
@pytest.mark.parametrize("kind", BOTH)
def test_a_scripted_ownship_flies_as_in_scripted_traffic(kind, own, tmp_path):
    """Where it is and where its nose points are those of the same flight without encounters."""
    set_of = events(tmp_path / "set.parquet") if kind == BOTH[0] else model(tmp_path)
    traffic = {"type": kind, "file": set_of, "encounter": 4, **AT, "scripted_ownship": own}
    found = []
    for block in (traffic, {"type": "traffic.scripted", "ownship": own}):
        scene = chain({"radar": RADAR}, duration_s=10, record={"truth": True},
                      weather={"wind_mps": 9.0, "wind_from_deg": 100.0})  # fmt: skip
        scene["blocks"]["traffic"] = block
        found.append([row for row in rows(run(scene), "truth") if row["target"] is None])
    mine, plain = found
    assert len(mine) == len(plain) > 9
    for one, other in zip(mine, plain, strict=True):
        assert one == other


def test_each_aircraft_of_a_generated_set_flies_by_the_model_of_its_own(tmp_path):
    """Speeds as in the ownship's file and in the intruder's, whose classes do not overlap."""
    slow, fast = tmp_path / "slow.txt", tmp_path / "fast.txt"
    slow.write_text(GAS, encoding="utf-8")
    fast.write_text(GAS.replace("70 80 100 140 160", "270 280 300 340 360"), encoding="utf-8")
    out = tmp_path / "set.parquet"
    words = ["generate", "--model", slow, "--intruder-model", fast, "--count", 2, "--first", 5,
             "--at", AT["lat_deg"], AT["lon_deg"], "--out", out]  # fmt: skip
    done = CliRunner().invoke(encounters, [str(w) for w in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    scene = chain({"radar": RADAR}, record={"truth": True})
    scene["blocks"]["traffic"] = {"type": "traffic.encounters", "file": str(out), "encounter": 6}
    found = rows(run(scene), "truth")
    for row in found:
        way = [row[f"velocity_{axis}_m_s"] * 3600.0 / 1852.0 for axis in ("north", "east", "down")]
        least, most = (70.0, 160.0) if row["target"] is None else (270.0, 360.0)
        assert least - 1.0 < math.hypot(*way) < most + 1.0
    assert len({row["target"] for row in found}) == 2


def test_intruders_stay_where_the_encounter_has_them(tmp_path):
    file = events(tmp_path / "set.parquet")
    own = {"lat_deg": 0.0, "lon_deg": 0.0, "alt_m": 2000.0}
    traffic = {"type": "traffic.encounters", "file": file, "encounter": 9, "scripted_ownship": own}
    row = seen(traffic)[3.0]
    assert row["target"] == "other"
    apart = math.hypot(2000 - 3 * 70, 100)  # it heads south, towards the origin, where we stand
    assert row["true_range_m"] == pytest.approx(apart, abs=1.0)


def test_an_ownship_on_another_continent_is_refused(tmp_path):
    """5,500 km: a scene's own start, and a set whose plane still touches at 0, 0."""
    own = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 2000.0}
    traffic = {"type": "traffic.encounters", "file": events(tmp_path / "set.parquet"),
               "encounter": 9, "scripted_ownship": own}  # fmt: skip
    with pytest.raises(Exception, match=r"scripted_ownship: starts 5\d\d\d km from the encounter"):
        seen(traffic)
    assert seen({**traffic, "lat_deg": 52.0, "lon_deg": 4.4})


@pytest.mark.parametrize("swapped", [False, True])
def test_the_encounters_own_ownship_flies_in_a_scene_that_had_another(swapped, tmp_path):
    """Whatever the scripted traffic was told before an encounter took its place."""
    file = events(tmp_path / "set.parquet")
    settings = [f"blocks.traffic.file={file}", "blocks.traffic.encounter=9", "duration_s=1"]
    if swapped:
        scene = dsa_des.load_scene(
            "first_light", sets=settings, swaps=["traffic=traffic.encounters"]
        )
    else:
        mine = tmp_path / "mine.toml"
        mine.write_text('extends = "first_light"\n[blocks.traffic]\ntype = "traffic.encounters"\n')
        scene = dsa_des.load_scene(str(mine), sets=settings)
    [first, *_] = [r for r in dsa_des.run(scene).truth.to_pylist() if r["target"] is None]
    assert (first["lat_deg"], first["lon_deg"]) == pytest.approx((0.0, 0.0), abs=1e-6)


def misses(traffic: dict, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return signed horizontal and vertical miss distances of encounters, and their weights."""
    from components.encounters.encounter_traffic import ModelTraffic, encounter_of_parameters

    ModelTraffic.prepare([ModelTraffic.Parameters(**traffic, encounter=k) for k in range(count)])
    found = []
    for k in range(count):
        one, place = encounter_of_parameters(
            ModelTraffic, ModelTraffic.Parameters(**traffic, encounter=k)
        )
        found.append([float(one.extra[n][place]) for n in ("horizontal_miss_m", "vertical_miss_m")]
                     + [float(one.weights[place])])  # fmt: skip
    table = np.array(found)
    return table[:, :2] / 0.3048, table[:, 2]


@covers(
    *(f"{way}.{key}" for way in ("horizontal", "vertical") for key in ("edges_ft", "proportions")),
    of=("traffic.encounter_model",),
)
def test_miss_distances_are_drawn_as_asked_and_weights_undo_it(tmp_path):
    file = model(tmp_path)
    near = {
        "horizontal": {"edges_ft": (-3000, -200, 400, 6000), "proportions": (1, 6, 3)},
        "vertical": {"edges_ft": (-300, 100, 1500), "proportions": (1, 0.25)},
    }
    miss, weight = misses({"file": file, **near}, 400)
    share = np.histogram(miss[:, 0], (-3000, -200, 400, 6000))[0] / 400
    assert np.abs(share - (0.1, 0.6, 0.3)).max() < 4 * 0.5 / 20
    assert (miss[:, 1] >= -300).all() and (miss[:, 1] <= 1500).all()
    # By hand: the weight is in inverse proportion to the density of both, at one relative speed.
    density = np.select([miss[:, 0] < -200, miss[:, 0] < 400], (1 / 2800, 6 / 600), 3 / 5600)
    chance = np.where(miss[:, 1] < 100, 1.0, 0.25)
    alone, _ = misses({"file": file}, 40)
    speeds = weight * density * chance
    assert speeds.min() / speeds.max() > 0.2 and weight.max() / weight.min() > 20
    assert np.abs(alone).max() > 6000
    flown = {"type": "traffic.encounter_model", "file": file, "encounter": 3}
    assert seen({**flown, "horizontal": near["horizontal"]}, 2) != seen(flown, 2)
    with pytest.raises(Exception, match=r"traffic: vertical: 2 edges need 1 proportions"):
        seen({**flown, "vertical": {"edges_ft": [-1, 1], "proportions": [1, 1]}})
