"""The pairs of the benchmark: the two forms differ in what they are said to differ in."""

from dataclasses import replace

import pytest

from components.benchmark.pairs import PAIRS, measure_pairs
from components.benchmark.rates import RATES
from components.benchmark.rates import measure_rate as measured_rate
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

FORMS = {pair.name: pair.forms(pair.case, False) for pair in PAIRS}


def run(scene, **options):
    memory = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([memory]), **options)
    simulation.run()
    return simulation, memory.tables()


def test_effects_that_are_not_called_for_are_gone_and_nothing_else_is():
    scene, bare = FORMS["unused_effects"]
    (with_them, tables), (without, same) = run(scene), run(bare)
    declared = [item for item in with_them.plan if not item.built]
    assert len(declared) > 20
    assert [item.effect.name for item in without.plan] == [
        item.effect.name for item in with_them.plan if item.built
    ]
    assert tables.keys() == same.keys()
    assert all(tables[name].equals(same[name]) for name in tables)


def test_the_three_sensors_share_one_processor_that_keeps_up():
    shared, plain = FORMS["shared_processor"]
    simulation, tables = run(shared)
    assert not plain.processors
    assert set(tables["processing"]["block"].to_pylist()) == {"eo", "ir", "radar"}
    assert max(tables["processing"]["queue_length"].to_pylist()) <= 2
    assert {"fusion", "tracker"} <= {n for n, node in simulation.nodes.items() if node.windowed}


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.name)
def test_a_pair_is_measured(pair):
    row = measure_pairs(pair.name, quick=True, repeats=1)
    low, high = row["times_quartiles"]
    assert 0.0 < low <= row["times"] <= high
    assert row["wanted"] == pair.wanted


def test_the_alerting_of_a_pair_sees_the_tracks_of_the_same_chain():
    alerted, plain = FORMS["alerting"]
    assert set(alerted.blocks) - set(plain.blocks) == {"alerting"}
    (_, tables), (_, same) = run(alerted), run(plain)
    assert tables["tracks"].equals(same["tracks"])
    assert tables["alerts"].num_rows > 100


def test_with_both_equipped_the_first_chain_is_as_alone_and_the_second_sees_the_ownship():
    both, plain = FORMS["both_equipped"]
    assert len(both.blocks) == 2 * len(plain.blocks) - 1
    (_, tables), (_, same) = run(both), run(plain)
    rows = tables["fused"].to_pylist()
    mine = [row for row in rows if row["block"] == "fusion"]
    assert [{**row, "platform": "ownship"} for row in same["fused"].to_pylist()] == mine
    theirs = {row["target"] for row in rows if row["block"] == "fusion_b"}
    assert "ownship" in theirs and "head_on" not in theirs


@pytest.mark.parametrize("rate", RATES, ids=lambda rate: rate.name)
def test_a_rate_is_measured(rate, monkeypatch):
    fewer = tuple(
        replace(one, count=one.count // 5, quick=one.quick // 5)
        if one.name.startswith(("loop", "risk"))
        else one
        for one in RATES
    )
    monkeypatch.setattr("components.benchmark.rates.RATES", fewer)
    row = measured_rate(rate.name, quick=True, repeats=1)
    assert row["per_s"] > 0.0
    assert ("tracker" in row["shares"]) == rate.by_block and sum(row["shares"].values()) < 1.0


def test_the_states_of_a_rate_have_alerts_and_bands():
    (bands,) = (rate for rate in RATES if rate.name == "bands")
    kinds = bands.prepare(60)()
    assert all(any(len(one.bands) > 1 for one in kind) for kind in kinds)
    assert any(one.recovery is not None for kind in kinds for one in kind)
