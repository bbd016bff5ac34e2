"""Replicas in feedback loops go side by side and record what each would record by itself."""

from dataclasses import replace
from fractions import Fraction

import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from dsa_des.replicas.lockstep import NotInLockStep, make_lockstep_simulation
from dsa_des.running.loops import longest_delay_cut_edges
from dsa_des.scene.graph import build_graph
from dsa_des.scene.scene import load_scene

CROSSING = "configs/avoidance/crossing.toml"
PILOT = "configs/avoidance/crossing_pilot.toml"
TURNS = "configs/benchmark/manoeuvres.toml"
FLIGHTS = (
    {},
    {"blocks.traffic.intruders[0].heading_deg": 250.0, "blocks.eo.offset_s": Fraction(3, 10)},
    {"blocks.traffic.ownship.speed_mps": 55.0, "blocks.traffic.intruders[0].up_m": -40.0},
)


NEARER = ["blocks.traffic.intruders[0].east_m=2600", "blocks.traffic.intruders[0].north_m=2000"]


def test_an_avoidance_that_turns_each_ownship_by_itself():
    scene = load_scene(CROSSING, duration_s="40", sets=NEARER)
    simulation = same_as_alone(replicas_of(scene, *FLIGHTS), window=9)
    _, tables = tables_of(replicas_of(scene, *FLIGHTS))
    assert len(simulation.runs.going) > 1
    assert len(set(tables["manoeuvres"]["replica"].to_pylist())) > 1


def test_a_pilot_in_the_loop():
    sets = [*NEARER, "blocks.pilot.coordination_s=0", "blocks.pilot.initial_delay_s=1"]
    scene = load_scene(PILOT, duration_s="40", sets=sets)
    same_as_alone(replicas_of(scene, *FLIGHTS))
    _, tables = tables_of(replicas_of(scene, *FLIGHTS))
    assert tables["manoeuvres"].num_rows > 0


def test_drawn_clocks_and_wires_in_the_loop():
    sets = [*NEARER, "blocks.radar.jitter_s=0.05", "blocks.eo.rate_error_ppm=900"]
    scene = load_scene(CROSSING, duration_s="30", sets=sets)
    wires = [
        replace(wire, drop_probability=0.2, jitter_s=Fraction(1, 2), latency_s=Fraction(3, 10))
        if wire.source in ("radar", "avoidance", "fusion")
        else wire
        for wire in scene.wires
    ]
    same_as_alone(replicas_of(replace(scene, wires=wires), *FLIGHTS))


def test_a_loop_is_opened_where_it_takes_longest():
    scene = load_scene(CROSSING)
    for latency_s, edge in ((3, ("avoidance", "traffic")), (7, ("alerting", "avoidance"))):
        wires = [
            replace(wire, latency_s=Fraction(latency_s)) if wire.source == "alerting" else wire
            for wire in scene.wires
        ]
        graph = build_graph(list(scene.blocks), wires)
        assert longest_delay_cut_edges(replace(scene, wires=wires, graph=graph)) == {edge}


def test_a_loop_that_comes_back_at_once_is_left_to_runs_one_by_one():
    scene = load_scene(CROSSING)
    wires = [
        replace(w, delay_s=Fraction(1, 10**6)) if w.source == "avoidance" else w
        for w in scene.wires
    ]
    scene = replace(scene, wires=wires)
    with pytest.raises(NotInLockStep, match="comes back after 1e-06 s"):
        make_lockstep_simulation([scene, scene])
