"""A split block is asked through its own face; replicas whose clocks differ keep theirs."""

from fractions import Fraction

import numpy as np
import pytest
from same_runs import replicas_of, same_as_alone, tables_of

from components.alerting.daidalus import DaidalusAlerting
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.component import Component
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import NotInLockStep, make_lockstep_simulation
from dsa_des.replicas.replicas import Recorded, reason_against_lock_step, run_replicas
from dsa_des.replicas.split_block import SplitBlock, _wake_of_replica
from dsa_des.scene.scene import load_scene

FIRST_LIGHT = "configs/first_light.toml"
COINCIDENCE = "blocks.fusion.coincidence_s"
TARGET = "blocks.traffic.intruders[0].heading_deg"
HEADING = "blocks.traffic.ownship.heading_deg"


def near(*sets, duration_s="40"):
    """First light with a target in reach from the start."""
    sets = ["blocks.traffic.intruders[0].north_m=4000", *sets]
    return load_scene(FIRST_LIGHT, sets=sets, duration_s=duration_s)


def test_a_split_block_is_no_block():
    """It has nothing that the engine could ask in the place of the block itself."""
    assert not issubclass(SplitBlock, Component)
    scenes = replicas_of(near(), {COINCIDENCE: 0}, {COINCIDENCE: Fraction(1, 5)})
    simulation = make_lockstep_simulation(scenes)
    for name, node in simulation.nodes.items():
        assert type(node.component) is scenes[0].blocks[name].cls
        assert node.component is simulation.components[name]
    assert simulation.nodes["fusion"].runner is simulation.timeline.split["fusion"]
    public = {name for name in dir(SplitBlock) if not name.startswith("_")}
    assert public == {"run", "close_instances"}


@pytest.mark.parametrize("rates", [("0.1", "0.1"), ("1.5", "3")])
def test_positions_are_published_at_their_rate_when_the_traffic_is_flown_together(rates):
    scene = near(f"blocks.traffic.update_rate_hz={rates[0]}", "blocks.radar.beam_sweep=true")
    changes = [
        {HEADING: turn, TARGET: 180 + 30 * turn, "blocks.traffic.update_rate_hz": Fraction(rate)}
        for turn, rate in zip((0.5, -0.5), rates, strict=True)
    ]
    assert not same_as_alone(replicas_of(scene, *changes)).timeline.split


def test_the_publishing_rate_itself_can_be_drawn():
    rates = [{"blocks.traffic.update_rate_hz": Fraction(n, 10)} for n in (5, 25, 8)]
    same_as_alone(replicas_of(near("blocks.traffic.update_rate_hz=1"), *rates))


def test_a_clock_in_some_replicas_only_is_run_one_by_one():
    scene, rate = near(), {"blocks.traffic.update_rate_hz": 2}
    for changes in ([{}, rate], [rate, {}]):
        with pytest.raises(NotInLockStep, match="in some replicas only"):
            make_lockstep_simulation(replicas_of(scene, *changes))
    replicas = [Replica(20), Replica(21, rate)]
    outcomes = run_replicas(scene, replicas)
    assert all(isinstance(outcome, Recorded) for outcome in outcomes)
    _, alone = tables_of(replica_scene(scene, replicas[1]))
    got, wanted = outcomes[1].tables["detections"]["tick"], alone["detections"]["tick"]
    assert got.tolist() == wanted.to_pylist()
    assert "in some replicas only" in reason_against_lock_step(scene, replicas)


DELAYED = (
    "wires=['traffic -> transform -> gate', 'gate -> eo', 'gate -> ir', "
    "{from='gate', to='radar', delay='2 scans'}, 'radar -> fusion', 'eo -> fusion', "
    "'ir -> fusion', 'fusion -> tracker']"
)


def test_a_delay_in_scans_follows_the_replicas_own_clock():
    scene = near(DELAYED)
    rates = [{"blocks.radar.scan_rate_hz": rate} for rate in (4, 5)]
    with pytest.raises(NotInLockStep, match="scans that differ"):
        make_lockstep_simulation(replicas_of(scene, *rates))
    offsets = [{"blocks.radar.offset_s": Fraction(n, 100)} for n in (0, 5, 13)]
    same_as_alone(replicas_of(scene, *offsets))


@pytest.mark.parametrize(
    "sets",
    [
        ["blocks.traffic.latency_s=0.1"],
        ["blocks.transform.latency_s=0.1", "blocks.fusion.latency_s=0.3"],
        ["blocks.traffic.latency_s=0.1", "blocks.traffic.update_rate_hz=2"],
        [DELAYED],
    ],
)
@pytest.mark.parametrize(
    ("changes", "window"), [(({}, {}), None), (({HEADING: 0.5}, {HEADING: -0.5}), 7)]
)
def test_delays_on_the_way_from_the_traffic(sets, changes, window):
    same_as_alone(replicas_of(near(*sets, duration_s="15"), *changes), window=window)


CLOCKS = [{"rate_error_ppm": 100}, {"jitter_s": 0.01}, {"scan_rate_hz": 4}, {"offset_s": 0.125}]


@pytest.mark.parametrize("change", CLOCKS)
def test_one_instance_serves_clocks_that_differ_but_in_their_rates(change):
    """How long a scan lasts, blocks read themselves."""
    changes = {f"blocks.radar.{name}": value for name, value in change.items()}
    simulation = same_as_alone(replicas_of(near(duration_s="15"), {}, changes, changes))
    assert list(simulation.timeline.split) == (["radar"] if "scan_rate_hz" in change else [])


@pytest.mark.parametrize("change", CLOCKS)
def test_a_sweep_lasts_a_scan_of_its_own_replica(change):
    """Its requests must stay the same."""
    scene = near("blocks.radar.beam_sweep=true", "blocks.gate.latency_s=0.25", duration_s="15")
    changes = {f"blocks.radar.{name}": value for name, value in change.items()}
    scenes = replicas_of(scene, {}, changes, changes)
    if "scan_rate_hz" in change:
        with pytest.raises(NotInLockStep, match="radar asks for something else"):
            same_as_alone(scenes)
    else:
        assert not same_as_alone(scenes).timeline.split


def test_a_replica_that_was_sent_nothing_yet_holds_nothing():
    """Rows of an optional input: -1 stays -1, and no row of another replica slips in."""
    ticks, run = np.array([3, 5, 3, 5], dtype=np.int64), np.array([0, 0, 1, 1])
    message = Message(np.array([2, 4], dtype=np.int64), run=np.array([0, 1]))
    held = {"cue": (message, np.array([0, 0, -1, 1]))}
    wake = Wake(RunTicks(run, ticks), np.full(4, -1), 1, held, {})
    of_first, rows = _wake_of_replica(wake, slice(0, 2), 0).held("cue")
    assert of_first.tick.tolist() == [2] and rows.tolist() == [0, 0]
    of_second, rows = _wake_of_replica(wake, slice(2, 4), 1).held("cue")
    assert of_second.tick.tolist() == [4] and rows.tolist() == [-1, 0]
    last = RunTicks(run[2:3], ticks[2:3])
    nothing = Wake(last, np.full(1, -1), 1, {"cue": (message, np.array([-1]))}, {})
    assert _wake_of_replica(nothing, slice(0, 1), 1).held("cue") is None


def test_what_comes_between_scans_waits_for_the_instance(monkeypatch):
    """Alerting looks every 7 s, in each replica at other times, and fits lines to all it got."""
    monkeypatch.setattr(DaidalusAlerting, "serves_replicas", lambda self: False)
    sets = ["blocks.traffic.intruders[0].east_m=2600", "blocks.traffic.intruders[0].north_m=2000",
            "blocks.alerting.scan_rate_hz=1/7"]  # fmt: skip
    scene = load_scene("configs/avoidance/crossing.toml", duration_s="14", sets=sets)
    offsets = [{"blocks.alerting.offset_s": Fraction(n, 2)} for n in (0, 11)]
    simulation = same_as_alone(replicas_of(scene, *offsets))
    assert len(simulation.runs.going) > 1 and "alerting" in simulation.timeline.split


def test_in_wind_all_flights_are_flown_together():
    """Each beam asks for those of its own replica between scans; noses point into the wind."""
    swept = ["weather.wind_mps=12", "blocks.radar.beam_sweep=true", "record.truth=true"]
    turn = {"kind": "turn", "rate_deg_s": 2.0}
    changes = [{HEADING: 3.0}, {HEADING: -4.0}, {"blocks.traffic.ownship.legs": [turn]}]
    simulation = same_as_alone(replicas_of(near(*swept, duration_s="6"), *changes))
    assert list(simulation.timeline.together) == ["traffic"]


def test_beams_that_ask_through_several_lines_of_sight_run_one_by_one():
    """One traffic of all, seen by each through a line of sight of its own."""
    sets = ["blocks.radar.beam_sweep=true", "blocks.traffic.ownship.roll_deg=15"]
    scene = near(*sets, duration_s="6")
    replicas = [Replica(3, {"blocks.transform.attitude": a}) for a in ("exact", "small_angle")]
    scenes = [replica_scene(scene, one) for one in replicas]
    with pytest.raises(NotInLockStep, match="one line of sight"):
        make_lockstep_simulation(scenes).run()
    for one, ran in zip(scenes, run_replicas(scene, replicas), strict=True):
        alone = tables_of(one)[1]["detections"]["azimuth_rad"].to_pylist()
        assert len(alone) > 3 and ran.tables["detections"]["azimuth_rad"].tolist() == alone


def test_recorded_flights_are_flown_together_where_they_last_as_long(tmp_path):
    """A scene without a duration lasts as long as its file."""
    header = "name time lat lon alt heading\nunitless s deg deg m deg\n"
    for name, last_s, heading_deg in (("one", 9, 40), ("other", 9, 80), ("longer", 10, 80)):
        rows = [
            f"{who} {t} {-41.3 + north - 1e-4 * t} 179.99 {1000 + up} {heading_deg}"
            for who, north, up in (("own", 0.0, 0), ("far", -0.02, 40))
            for t in (0, 4, last_s)
        ]
        (tmp_path / f"{name}.daa").write_text(header + "\n".join(rows), encoding="utf-8")
    scene = load_scene("configs/replay_daa.toml", sets=[f"blocks.traffic.file={tmp_path}/one.daa"])
    changes = [{"blocks.traffic.file": tmp_path / f"{name}.daa"} for name in ("one", "other")]
    simulation = same_as_alone(replicas_of(scene, *changes))
    assert list(simulation.timeline.together) == ["traffic"]
    changes[1] = {"blocks.traffic.file": tmp_path / "longer.daa"}
    with pytest.raises(NotInLockStep, match="another duration"):
        make_lockstep_simulation(replicas_of(scene, *changes)).run()
