"""Any aircraft may carry a chain: what it sees, how it is steered, and what is refused."""

import numpy as np
import pyarrow.compute as pc
import pytest
from covering import covers
from equipped import CONF, PILOT, RADAR, TURN_AWAY, blocks_of, scene_of, wires_of
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from dsa_des import SceneError
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 0, "speed_mps": 50}
B = {"name": "b", "east_m": 5200, "north_m": 4100, "up_m": 20, "heading_deg": 268, "speed_mps": 60,
     "rcs_dbsm": 8}  # fmt: skip
C = {"name": "c", "east_m": -3000, "north_m": 2000, "up_m": 50, "heading_deg": 60, "speed_mps": 40}
BOTH = {"": None, "_b": "b"}


def of_block(table, name):
    return table.filter(pc.equal(table["block"].cast("string"), name))


def test_each_sees_the_other_and_not_itself():
    tables = tables_of(scene_of(OWN, [B, C], BOTH, radar=RADAR, duration_s=30))[1]
    looks = tables["detections"]
    mine = {(row["time_s"], row["target"]) for row in of_block(looks, "radar").to_pylist()}
    theirs = {(row["time_s"], row["target"]) for row in of_block(looks, "radar_b").to_pylist()}
    assert {target for _, target in mine} - {None} == {"b", "c"}
    assert {target for _, target in theirs} - {None} == {"ownship", "c"}


def positions(tables, target, times):
    truth = tables["truth"]
    rows = truth.filter(pc.is_null(truth["target"])) if target is None else truth.filter(
        pc.equal(truth["target"].cast("string"), target)
    )  # fmt: skip
    known = {row["time_s"]: row for row in rows.to_pylist()}
    return [known[time_s] for time_s in times]


def test_a_view_measures_what_the_truth_says():
    """By the range of two points on the ellipsoid, from their Cartesian positions."""
    scene = scene_of(OWN, [B, C], BOTH, duration_s=20)
    tables = tables_of(scene)[1]
    seen = of_block(tables["detections"], "radar_b").to_pylist()
    assert len(seen) > 30
    for row in seen:
        ends = [
            cartesian(*positions(tables, who, [row["time_s"]]))
            for who in ("b", None if row["target"] == "ownship" else row["target"])
        ]
        # The radar reports centres of cells of 50 m.
        assert abs(row["range_m"] - np.linalg.norm(ends[0] - ends[1])) <= 25.0 + 1e-6


def cartesian(row):
    lat, lon = np.radians([row["lat_deg"], row["lon_deg"]])
    e2 = 6.69437999014e-3
    n = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    level = (n + row["alt_m"]) * np.cos(lat)
    return np.array(
        [level * np.cos(lon), level * np.sin(lon), (n * (1.0 - e2) + row["alt_m"]) * np.sin(lat)]
    )


def test_a_chain_on_another_aircraft_changes_nothing_of_the_first():
    alone = tables_of(scene_of(OWN, [B, C], {"": None}))[1]
    both = tables_of(scene_of(OWN, [B, C], BOTH))[1]
    only_own = [w for w in wires_of("_b") if not isinstance(w, dict)]
    blocks = blocks_of("_b", "b")
    scene = scene_of(OWN, [B, C], {"": None})
    tables = scene.resolved()
    tables["wires"] += only_own
    tables["blocks"] |= {name: block for name, block in blocks.items() if name != "decider_b"}
    tables["wires"] = [w for w in tables["wires"] if "decider_b" not in str(w)]
    unsteered = tables_of(dsa_des.load_scene(tables))[1]
    for name, table in alone.items():
        mine = unsteered[name].drop_columns("platform")
        kept = [not str(block).endswith("_b") for block in mine["block"]]
        assert mine.filter(kept).combine_chunks().equals(table), name
    assert not both["truth"].equals(alone["truth"])


def test_the_same_bytes_in_any_window_and_beside_other_runs():
    assert_the_same_bytes(duration_s=70)


def test_the_same_bytes_of_a_sweeping_beam_and_a_pilot():
    assert_the_same_bytes(radar=RADAR | {"beam_sweep": True}, decider=PILOT, duration_s=100)


def assert_the_same_bytes(**how):
    scene = scene_of(OWN, [B, C], BOTH, **how)
    tables = same_in_any_window(scene)
    steered = {str(block) for block in tables["manoeuvres"]["block"]}
    assert steered == {"decider", "decider_b"}
    changes = [{}, {"blocks.traffic.intruders[0].east_m": 5600.0},
               {"blocks.traffic.ownship.rcs_dbsm": -3.0}]  # fmt: skip
    simulation = same_as_alone(replicas_of(scene, *changes))
    assert "traffic" in simulation.timeline.together and not simulation.timeline.split


def test_in_any_order_of_blocks():
    scene = scene_of(OWN, [B, C], BOTH, duration_s=100)
    whole = tables_of(scene)[1]
    for shuffle in (1, 2):
        other = tables_of(scene, shuffle_ties=shuffle)[1]
        assert all(other[name].equals(table) for name, table in whole.items())


def test_an_intruder_flies_what_its_own_decider_says():
    """A turn of 30 deg at once: the track after it, from positions, against the sum by hand."""
    how = {"decider": {**TURN_AWAY, "direction": "left", "pause_s": 1000}, "decides_by": "tracker"}
    scene = scene_of(OWN, [B], {"_b": "b"}, duration_s=90, **how)
    tables = tables_of(scene)[1]
    (turn,) = tables["manoeuvres"].to_pylist()
    assert turn["turn_rad"] == pytest.approx(-np.radians(30.0))
    after = turn["time_s"] + 5.0 + 15.0
    times = [t for t in tables["truth"]["time_s"].to_pylist() if t >= after]
    b = positions(tables, "b", times[:1])[0]
    own = positions(tables, None, times[:1])[0]
    track = np.arctan2(b["velocity_east_m_s"], b["velocity_north_m_s"])
    assert np.degrees(track) % 360.0 == pytest.approx(268.0 - 30.0, abs=0.1)
    assert own["heading_rad"] == pytest.approx(0.0, abs=1e-9)


_DECIDES = ("alert", "decid")


def test_sensors_look_no_farther_than_before_and_the_far_are_not_moved():
    """The least range within which each platform looks culls for itself, and nothing else."""
    tables = scene_of(OWN, [B, C | {"east_m": -60_000}], {}, duration_s=20).resolved()
    for suffix, platform in BOTH.items():
        blocks = blocks_of(suffix, platform)
        tables["blocks"] |= {name: of for name, of in blocks.items() if name[:5] not in _DECIDES}
        tables["wires"].append(wires_of(suffix)[0].partition(" -> alerting")[0])
    scene = dsa_des.load_scene(tables)
    culled = tables_of(scene)[1]
    every = tables_of(scene, simulate_everything=True)[1]
    assert sum(culled["scans"]["skipped_culled"].to_pylist()) > 0
    assert culled["detections"].equals(every["detections"])
    assert culled["tracks"].equals(every["tracks"])


MISTAKES = {
    "a name that is none": (
        {"_b": "bb"},
        {},
        "blocks.transform_b.platform = 'bb': there is no such aircraft or place; did you mean 'b'?",
    ),
    "two deciders of one aircraft": (
        {"": None, "_b": None},
        {},
        "decider and decider_b both steer 'ownship': one block decides for each aircraft",
    ),
    "one of the first chain's blocks in the second": (
        BOTH,
        {"radar -> fusion_b": None},
        "blocks.fusion_b: is carried by 'b', as radar_b feeds it, and radar on 'ownship' feeds it",
    ),
    "the traffic itself on a platform": (
        {"": None},
        {"traffic": "b"},
        "blocks.traffic.platform = 'b': it moves all platforms and is on none",
    ),
    "a block's own word against its chain": (
        {"": None},
        {"tracker": "b"},
        "blocks.tracker: is carried by 'b', as its key platform says, and fusion on 'ownship' "
        "feeds it too: a block looks from one place; give each platform one of its own, and say "
        "which at the first block of its chain",
    ),
}


@covers("[blocks].platform")
@pytest.mark.parametrize("name", MISTAKES)
def test_the_likeliest_mistakes_are_said(name):
    chains, on, said = MISTAKES[name]
    tables = scene_of(OWN, [B], {}).resolved() | {"wires": []}
    for suffix, platform in chains.items():
        tables["wires"] += wires_of(suffix)
        tables["blocks"] |= blocks_of(suffix, platform)
    for block, platform in on.items():
        if platform is None:
            tables["wires"].append(block)
        else:
            tables["blocks"][block]["platform"] = platform
    with pytest.raises(SceneError) as refused:
        Simulation(dsa_des.load_scene(tables))
    assert said in str(refused.value)


@covers("name", of=("traffic.scripted.ownship", "traffic.random.ownship"))
def test_others_know_the_ownship_by_its_name():
    scene = scene_of(OWN | {"name": "mine"}, [B], {"_b": "b"}, duration_s=5)
    assert set(tables_of(scene)[1]["detections"]["target"].to_pylist()) == {"mine"}
    scene = scene_of(OWN, [B | {"name": "ownship"}, C], {"_c": "c"}, duration_s=5)
    with pytest.raises(SceneError, match="a target has the ownship's name"):
        Simulation(scene)


def test_alerting_by_the_truth_says_whose_it_is():
    """Behind the traffic alone nothing says on which platform a block is, but its own key."""
    alone = {"type": "alerting.daidalus", "conf": CONF, "scan_rate_hz": 1}
    tables = scene_of(OWN, [B], {"": None}).resolved()
    tables["wires"] += ["traffic -> truth_of_b"]
    tables["blocks"]["truth_of_b"] = alone | {"platform": "b"}
    alerts = of_block(tables_of(dsa_des.load_scene(tables))[1]["alerts"], "truth_of_b")
    assert set(alerts["target"].to_pylist()) == {"ownship"}


def test_a_recorded_aircraft_that_is_steered_has_its_closest_approach_where_the_truth_says():
    how = {"decider": {**TURN_AWAY, "pause_s": 1000}, "decides_by": "tracker", "duration_s": 110}
    tables = scene_of(OWN, [B], {"_b": "INTRUDER"}, **how).resolved()
    file = {"type": "traffic.daa_file", "file": "configs/encounters/crossing.daa"}
    tables["blocks"]["traffic"] = file
    simulation, recorded = tables_of(dsa_des.load_scene(tables))
    assert len(recorded["manoeuvres"]) == 1
    found = simulation.components["traffic"].report()["targets"]["INTRUDER"]["closest_approach"]
    from_there = simulation.components["traffic"].closest_approaches("INTRUDER")
    assert from_there == {"ownship": {"closest_approach": pytest.approx(found, abs=1e-6)}}
    ends = [recorded["truth"].filter(pc.equal(pc.fill_null(recorded["truth"]["target"], ""), name))
            for name in ("", "INTRUDER")]  # fmt: skip
    own, other = (np.array([cartesian(row) for row in end.to_pylist()]) for end in ends)
    nearest = np.linalg.norm(own - other, axis=1).min()
    assert found["range_m"] == pytest.approx(nearest, abs=3.0) and nearest > 100.0


def test_tables_say_on_which_platform_a_block_is_where_there_are_several():
    tables = tables_of(scene_of(OWN, [B, C], BOTH, duration_s=20))[1]
    for name in ("scans", "detections", "tracks", "truth"):
        rows = {(row["block"], row["platform"]) for row in tables[name].to_pylist()}
        kinds = {block.removesuffix("_b") for block, _ in rows}
        (kind,) = kinds
        on = {(kind, "ownship"), (f"{kind}_b", "b")}
        assert rows == ({("traffic", None)} if kind == "traffic" else on)
    # And where all are on one that is not the ownship, whose poses would be another's.
    alone = tables_of(scene_of(OWN, [B], {"_b": "b"}, duration_s=5))[1]
    assert {*alone["scans"]["platform"].to_pylist()} == {"b"}
    own = tables_of(scene_of(OWN, [B], {"": None}, duration_s=5))[1]
    assert not any("platform" in table.column_names for table in own.values())


def test_a_platform_that_was_forgotten_and_a_chain_that_ends_in_nothing_are_noted():
    chain = " -> ".join(("traffic", "transform_b", "gate_b", "radar_b", "fusion_b"))
    tables = scene_of(OWN, [B], {"": None}, duration_s=5).resolved()
    blocks = {name: of for name, of in blocks_of("_b", None).items() if f"{name} ->" in chain}
    tables["blocks"] |= blocks | {"fusion_b": {"type": "fusion.pass_through"}}
    wires = tables["wires"]

    def noted(**platform):
        tables["blocks"]["transform_b"] = {"type": "geometry.ellipsoid", **platform}
        notes = notes_of_scene(Simulation(dsa_des.load_scene(tables)))
        return [note for note in notes if "_b: " in note]

    tables["wires"] = [*wires, chain]
    assert noted(platform="b") == []
    (note,) = noted()
    assert note == (
        "blocks.transform_b: is as transform, and both are on 'ownship': platform = NAME puts it, "
        "and what it feeds, on another aircraft"
    )
    tables["wires"] = [*wires, "traffic -> transform_b -> gate_b", "gate -> radar_b -> fusion_b"]
    assert noted(platform="b") == [
        "blocks.gate_b: what it sends goes nowhere: no wire begins at it"
    ]
