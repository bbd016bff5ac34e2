"""The radar's effects: what calls for them, and what they do to a run."""

import math
from types import SimpleNamespace

import pytest

from components.radar.timing import TimeBudget
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

INTRUDERS = """
[[blocks.traffic.intruders]]
name = "a"
swerling = {swerling}
{table}
east_m = 60
north_m = 4000
up_m = 30
heading_deg = 180
speed_mps = 60
[[blocks.traffic.intruders]]
name = "b"
swerling = 0
east_m = 3000
north_m = 5000
heading_deg = 250
speed_mps = 80
"""
#: A radar of the same range at a threshold that noise crosses less often.
NOISY = (
    "false_alarm_probability = 2e-6\ncalibrate.false_alarm_probability = 2e-6\n"
    "false_alarms = true\n"
)
NARROW = "azimuth_beamwidth_deg = 1\nelevation_beamwidth_deg = 1\n"
NO_BEAM = 'remove = ["azimuth_beamwidth_deg", "elevation_beamwidth_deg"]\n'
#: 220 x 40 cells of one degree.
CELLS = NOISY + NARROW


@pytest.fixture
def scene(configs, tmp_path):
    """Write a scene: keys of the radar, tables beside the blocks, first target's model."""

    def write(radar="", sections="", swerling=1, table="", duration_s=12):
        path = tmp_path / "scene.toml"
        path.write_text(
            f'extends = "{configs / "first_light.toml"}"\nduration_s = {duration_s}\n'
            f"{sections}\n[blocks.radar]\n{radar}\n"
            + INTRUDERS.format(swerling=swerling, table=table),
            encoding="utf-8",
        )
        return path

    return write


def simulate(path, swap=(), **options):
    memory = MemorySink()
    simulation = Simulation(load_scene(path, swaps=swap), recorder=Recorder([memory]), **options)
    simulation.run()
    return simulation, memory.tables()


def plan_of(path, block="radar", **options):
    simulation = Simulation(load_scene(path), **options)
    return {item.effect.name: item for item in simulation.plan if item.block == block}


def radar_rows(tables, table="detections"):
    return [row for row in tables[table].to_pylist() if row["block"] == "radar"]


def same(one, other):
    """Say whether two runs recorded the same, but for the cells that were not looked at."""
    assert one.keys() == other.keys()
    return all(one[name].equals(other[name]) for name in one if name != "scans")


SENTENCES = [
    ({}, "RCS fluctuation: simulated, target 'a' has swerling 1"),
    ({"swerling": 5}, "RCS fluctuation: not simulated, every target has swerling 0 or 5"),
    ({"radar": "swerling = 5"}, "RCS fluctuation: not simulated, swerling is 5"),
    ({"radar": "swerling = 3", "swerling": 0}, "RCS fluctuation: simulated, swerling is 3"),
    ({}, "aspect RCS: not simulated, no target has an rcs_table"),
    ({"table": 'rcs_table = "rcs.csv"'}, "aspect RCS: simulated, target 'a' has an rcs_table"),
    ({}, "blind range: not simulated, minimum_range_m is not given"),
    ({"radar": "minimum_range_m = 300"}, "blind range: simulated, minimum_range_m is 300"),
    ({}, "false alarms: not simulated, false_alarms is false"),
    ({"radar": CELLS}, "false alarms: simulated, false_alarms is true"),
    ({"radar": CELLS + "enabled = false"}, "false alarms: not simulated, enabled is false"),
    ({}, "beam sweep: not simulated, beam_sweep is false"),
    ({"radar": "beam_sweep = true"}, "beam sweep: simulated, beam_sweep is true"),
]


@pytest.fixture
def rcs_file(tmp_path):
    lines = [f"{az},{el},{az / 20}" for el in (-90, 0, 90) for az in (0, 90, 180, 270)]
    flat = [line.rsplit(",", 1)[0] + ",0" if ",0," not in line else line for line in lines]
    (tmp_path / "rcs.csv").write_text("\n".join(["az_deg,el_deg,dbsm", *flat]), encoding="utf-8")


@pytest.mark.parametrize(("changes", "sentence"), SENTENCES)
def test_the_reason_is_in_the_scene(scene, rcs_file, changes, sentence):
    plan = plan_of(scene(**changes))
    assert plan[sentence.split(":")[0]].sentence() == sentence


def test_false_alarms_show_downstream_and_start_no_track(scene):
    _, tables = simulate(scene(CELLS))
    _, without = simulate(scene())
    false = [row for row in radar_rows(tables) if row["target"] is None]
    fused = [row for row in tables["fused"].to_pylist() if row["target"] is None]
    assert false and len(fused) == len(false)
    for one, other in zip(fused, false, strict=True):
        assert one["sensors"] == one["angle_source"] == one["range_source"] == "radar"
        for name in ("tick", "azimuth_rad", "elevation_rad", "range_m", "true_range_m"):
            assert one[name] == other[name]
    rest = [row for row in tables["fused"].to_pylist() if row["target"] is not None]
    assert rest == without["fused"].to_pylist()
    assert tables["tracks"].equals(without["tracks"])


def test_the_summary_counts_false_alarms_apart(scene):
    from components.display.summary import SensorSummary
    from dsa_des.record.sinks import ObserverSink

    observer = SensorSummary(["radar"])
    sink = ObserverSink([observer])
    memory = MemorySink()
    Simulation(load_scene(scene(CELLS)), recorder=Recorder([sink, memory])).run()
    rows = radar_rows(memory.tables())
    found = observer.result()["sensors"]["radar"]
    assert found["false_alarms"] == sum(row["target"] is None for row in rows) > 0
    assert found["detections"] + found["false_alarms"] == len(rows)
    assert found["first_detection"]["target"] in ("a", "b")


BAD = [
    (
        "false_alarms = true",
        r"false_alarm_probability is 0.05: with 13,860,000 .* at most 0.00722",
    ),
    ("false_alarms = true\nrange_resolution_m = 0", "range_resolution_m is 0"),
    (NOISY + NO_BEAM + "azimuth_resolution_deg = 0", "azimuth_resolution_deg is 0"),
    (CELLS + "minimum_range_m = 6000\nrange_km = 5", "range_km is 5: it must be above"),
    ("false_alarm_probability = 1.5", "less than 1"),
    ("cell_false_alarm_probability = 1e-6", "one threshold .* use false_alarm_probability"),
]


@pytest.mark.parametrize(("radar", "message"), BAD)
def test_false_alarms_need_cells_and_a_sane_number(scene, radar, message):
    # The thesis's radar with 8 times its cells, 220 x 40 x 15000/9.525: 693,000 false alarms by
    # scan at Pfa 0.05; 100,000 are allowed, 0.00722 of the cells.
    if radar == "false_alarms = true":
        radar += f"\nrange_resolution_m = 9.525\n{NARROW}"
    with pytest.raises(SceneError, match=message):
        Simulation(load_scene(scene(radar)))


def test_each_target_is_lit_at_its_own_instant(scene):
    """A 220 deg sweep in 0.2 s: azimuth -110 at the scan's start, +110 at its end, as measured."""
    _, tables = simulate(scene("beam_sweep = true\n" + CELLS))
    rows = radar_rows(tables)
    assert {row["target"] for row in rows} == {"a", "b", None}
    for row in rows:
        azimuth = math.degrees(row["azimuth_rad"])
        assert row["illuminated_s"] == pytest.approx(
            row["time_s"] + 0.2 * (azimuth + 110) / 220, abs=1e-12
        )
    # Noise does not know of targets: it is where it was, and the ownship where it was then.
    _, without = simulate(scene(CELLS))

    def noise(found):
        return [
            {key: row[key] for key in row if key != "illuminated_s" and key[:4] != "own_"}
            for row in found if row["target"] is None
        ]  # fmt: skip

    assert noise(rows) == noise(radar_rows(without)) != []


def test_targets_that_are_not_offered(scene, monkeypatch):
    """Traffic that offers nothing may bring anything; a wrong offer is refused, not believed."""
    from components.aircraft.aircraft import Aircraft, Roster
    from components.traffic.source import KnownTraffic, TrafficSource
    from dsa_des.errors import BlockFailure

    path = scene(swerling=0)
    _, offered = simulate(path)
    monkeypatch.setattr(TrafficSource, "offer", lambda self, port: None)
    because = "the targets are not known before the run"
    plan = plan_of(path)
    assert plan["RCS fluctuation"].because == plan["aspect RCS"].because == because
    assert same(offered, simulate(path)[1])
    others = KnownTraffic(Roster.from_pairs([("somebody else", Aircraft())]), None)
    monkeypatch.setattr(TrafficSource, "offer", lambda self, port: others)
    with pytest.raises(BlockFailure, match="not offered"):
        simulate(path)


@pytest.mark.parametrize(("pulses", "more"), [(None, ""), (7, ", pulses in it: 7")])
def test_how_beams_share_a_scan_is_said(pulses, more):
    look = SimpleNamespace(
        beams=SimpleNamespace(azimuth=30, elevation=2), dwell_s=0.0125, pulses=pulses
    )
    said = TimeBudget().verdict(SimpleNamespace(p=SimpleNamespace(look_energy=look)))
    assert said.simulated
    assert said.because == f"budget is 'dwell': 30 x 2 beams of 12.5 ms each{more}"
    free = SimpleNamespace(p=SimpleNamespace(look_energy=None, budget="free"))
    assert TimeBudget().verdict(free).because == "budget is 'free'"
