"""What a host may say, what it is told, and when sensors scan between its calls."""

import itertools
import math

import numpy as np
import pytest
from click.testing import CliRunner

from components.embedding.planes import FixedPath
from dsa_des.cli import main
from dsa_des.embed import HostDriven, Simulator
from dsa_des.errors import BlockFailure, SceneError, UsageError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

OWN = (0.9, 0.07, 1000.0)
AHEAD = (0.9 + 2e-4, 0.07, 1000.0)  # some 1300 m to the north
LEVEL, HEAD_ON = (0.0, 0.0, 0.0), (math.pi, 0.0, 0.0)


@pytest.fixture
def scene(configs):
    return configs / "first_light.toml"


@pytest.fixture
def simulator(scene):
    simulator = Simulator(scene, sets=["blocks.radar.scan_rate_hz=5"])
    simulator.add_plane("near", rcs_dbsm=10.0)
    return simulator


def test_one_plane_dead_ahead(simulator):
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.05)
    assert result.scans == {"eo": 0}
    near = (0.9 + 5e-5, 0.07, 1000.0)  # the IR camera sees no farther than some 600 m head on
    result = simulator.simulate(OWN, LEVEL, near, HEAD_ON, 0.2)
    assert result.scans == {"radar": 1, "eo": 3, "ir": 0}
    sighting = result["near"]
    assert sighting.detected and set(sighting.sensors) == {"radar", "eo", "ir"}
    azimuth, elevation, range_m = result.detected[0]
    assert abs(azimuth) < 0.01 and abs(elevation) < 0.01
    # Meridian radius of the ellipsoid at this latitude, and 1 km of height: 6,375 km.
    assert range_m == pytest.approx(5e-5 * 6_375_000, abs=76.2 / 2)  # half a step
    assert sighting.polar == tuple(result.detected[0])
    assert sighting.confidence["radar"] > 20  # dB


def test_a_result_prints_in_a_few_lines(simulator):
    for k in range(20):
        simulator.add_plane(f"far{k}")
    far = np.tile((0.9 + 2e-2, 0.07, 1000.0), (20, 1))
    planes = np.vstack([(0.9 + 5e-5, 0.07, 1000.0), far])
    result = simulator.simulate(OWN, LEVEL, planes, np.tile(HEAD_ON, (21, 1)), 0.2)
    lines = repr(result).splitlines()
    assert len(lines) == 10
    assert lines[0].startswith("EncounterResult at 0.2 s, scans: ") and "radar" in lines[0]
    azimuth, _, range_m = result["near"].polar
    assert lines[1].startswith(f"  near: azimuth {math.degrees(azimuth):.2f}°, elevation ")
    assert f"range {range_m:,.1f} m, by " in lines[1] and lines[2] == "  far0: not detected"
    assert lines[-1] == f"  ... {21 + len(result.false_alarms) - 8} more"


@pytest.mark.parametrize("height_m", [0.0, 900.0])
def test_ground_clutter_hides_a_host_s_plane(scene, height_m):
    """Ground at the ellipsoid or above it, where the scene says: for a host as well."""
    beam = ["radar.azimuth_beamwidth_deg=10", "radar.elevation_beamwidth_deg=30",
            "radar.budget='free'", "radar.false_alarm_probability=1e-6"]  # fmt: skip
    own, low = (0.9, 0.07, height_m + 300.0), (0.9 + 2e-4, 0.07, height_m + 30.0)
    for gamma_db, seen in ((-80, True), (-10, False)):
        ground = [f"terrain.height_m={height_m}", f"terrain.clutter_gamma_db={gamma_db}"]
        simulator = Simulator(scene, sets=[f"blocks.{key}" for key in beam] + ground)
        simulator.add_plane("near", rcs_dbsm=20.0)
        result = simulator.simulate(own, LEVEL, low, HEAD_ON, 0.2)
        assert ("radar" in result["near"].sensors) is seen


def test_nothing_due_nothing_seen(simulator):
    simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.2)
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.21)
    assert result.scans == {} and result.messages == {}
    assert not result["near"].detected and result["near"].sensors == ()
    assert np.isnan(result.detected).all() and result.detected.shape == (1, 3)
    with pytest.raises(KeyError):
        result["far"]


def test_a_fixed_step_makes_the_latest_scan_and_counts_the_others(simulator):
    scans, missed = {}, {}
    for step in range(101):  # 0 to 10 s in floats that are no whole ticks
        result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, step * 0.1)
        for sensor, scan in result.scans.items():
            scans.setdefault(sensor, []).append(scan)
        for sensor, count in result.missed.items():
            missed[sensor] = missed.get(sensor, 0) + count
    # 5 Hz from 0 and 2 Hz from 0.1: every scan. 20 Hz from 0.05: one of two.
    assert scans["radar"] == list(range(51))
    assert scans["ir"] == list(range(20))
    assert scans["eo"] == list(range(1, 200, 2))
    assert missed == {"eo": 100}


def test_a_late_scan_keeps_its_number_and_so_its_draws(scene):
    """Called 3 ms after each scan with the same states, the radar decides the same."""
    drawn = []
    for late_s in (0.0, 0.003):
        simulator = Simulator(scene, sets=["blocks.eo.enabled=false", "blocks.ir.enabled=false"])
        simulator.add_plane("faint", rcs_dbsm=-12.0)
        simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0)
        far = (0.9 + 9e-4, 0.07, 1000.0)
        found = [
            simulator.simulate(OWN, LEVEL, far, HEAD_ON, k * 0.2 + late_s)["faint"].detected
            for k in range(1, 60)
        ]
        drawn.append(found)
    assert drawn[0] == drawn[1]
    assert 0 < sum(drawn[0]) < 59


def test_a_host_whose_time_starts_late_owes_no_scans(simulator):
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 1e6 + 0.01)
    assert result.scans == {} and result.missed == {}
    assert simulator.next_scan_s() == pytest.approx(1e6 + 0.05, abs=1e-9)
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 1e6 + 0.05)
    assert result.scans == {"eo": 20_000_000}


def test_an_hour_between_two_calls_takes_no_longer(simulator):
    simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0)
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 3600)
    assert result.scans == {"radar": 18000, "eo": 71999, "ir": 7199}
    assert result.missed == {"radar": 17999, "eo": 71999, "ir": 7199}


def test_next_scan(simulator):
    assert simulator.next_scan_s() == 0.0
    assert simulator.next_scan_s(0) == 0.05
    assert simulator.next_scan_s(0.05) == 0.1
    assert simulator.next_scan_s(59.97) == 60.0
    simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.12)
    assert simulator.next_scan_s() == 0.15


def test_times_are_exact_when_given_exactly(scene):
    sets = ["blocks.eo.scan_rate_hz='30000/1001'", "blocks.eo.offset_s=0"]
    simulator = Simulator(scene, sets=sets)
    simulator.add_plane()
    assert simulator.planes == ("plane_1",)
    simulator.start()
    result = simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, "1001/30000")
    assert result.scans == {"eo": 1}
    assert simulator.next_scan_s() == pytest.approx(2 * 1001 / 30000, abs=1e-12)


def test_planes_of_files_and_of_keys(configs, scene):
    simulator = Simulator(scene)
    simulator.add_plane("fighter", aircraft=configs / "aircraft" / "f_16.toml", contrast=0.5)
    simulator.add_plane("tower", aircraft=configs / "obstacles" / "building.toml")
    areas = {"front_m2": 3.0, "side_m2": 4.0, "horizontal_m2": 5.0}
    simulator.add_plane("made", rcs_dbsm=1.0, swerling=3, eo=areas, ir={**areas, "back_m2": 6.0})
    fighter, tower, made = simulator._planes
    assert (fighter.rcs_dbsm, fighter.eo.horizontal_m2, fighter.contrast) == (6.99, 250.0, 0.5)
    assert (tower.rcs_dbsm, tower.swerling) == (15.0, 0)
    assert (made.swerling, made.eo.side_m2, made.ir.back_m2) == (3, 4.0, 6.0)


def test_fixed_planes_are_not_in_the_hosts_arrays(scene):
    simulator = Simulator(scene)
    simulator.add_plane("tower", position=AHEAD, rcs_dbsm=20.0)
    simulator.add_plane("moved", rcs_dbsm=20.0)
    track = [AHEAD, (0.9 - 2e-4, 0.07, 1000.0)]
    simulator.add_plane("scripted", position=track, times_s=[0.1, 0.2], rcs_dbsm=20.0)
    behind = (0.9 - 1e-4, 0.07, 1000.0)
    result = simulator.simulate(OWN, LEVEL, behind, HEAD_ON, 0)
    assert [sighting.name for sighting in result] == ["tower", "moved", "scripted"]
    assert [sighting.detected for sighting in result] == [True, False, False]
    result = simulator.simulate(OWN, LEVEL, behind, HEAD_ON, 0.15)
    assert result["scripted"].detected and result["tower"].detected
    result = simulator.simulate(OWN, LEVEL, [behind], [HEAD_ON], 0.2)
    assert not result["scripted"].detected
    with pytest.raises(ValueError, match="for each of 2 rows"):
        Simulator(scene).add_plane("bad", position=track)


def test_a_plane_that_is_not_there_is_nan(scene):
    simulator = Simulator(scene)
    for name in ("here", "gone"):
        simulator.add_plane(name, rcs_dbsm=20.0)
    nowhere = (math.nan,) * 3
    for step, there in enumerate((True, False, True)):
        lla = [AHEAD, AHEAD if there else nowhere]
        result = simulator.simulate(OWN, LEVEL, lla, [HEAD_ON, HEAD_ON], 0.1 + step)
        assert result["here"].detected
        assert result["gone"].detected == there


def test_a_scene_without_traffic_will_do(configs, tmp_path):
    text = f"""
extends = "{(configs / "detect_and_sense.toml").as_posix()}"
[blocks.radar]
scan_rate_hz = 1
[blocks.eo]
scan_rate_hz = 1
[blocks.ir]
scan_rate_hz = 1
"""
    path = tmp_path / "sensors.toml"
    path.write_text(text, encoding="utf-8")
    simulator = Simulator(path, seed=7)
    simulator.add_plane("near", rcs_dbsm=20.0)
    assert simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0)["near"].detected
    assert simulator.scene.seed == 7


def test_no_planes_at_all(scene):
    simulator = Simulator(scene)
    result = simulator.simulate(OWN, LEVEL, [], [], 0)
    assert result.scans == {"radar": 0} and len(result) == 0 and result.detected.shape == (0, 3)


def test_a_loaded_scene_is_taken_as_it_is(scene):
    loaded = load_scene(scene)
    assert Simulator(loaded).scene is loaded
    with pytest.raises(UsageError, match="give its file"):
        Simulator(loaded, sets=["seed=2"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((1.6, 0, 0), LEVEL, AHEAD, HEAD_ON, 1), "latitude is 1.6"),
        ((OWN, LEVEL, (52.0, 0, 0), HEAD_ON, 1), "lla_intruder: latitude is 52"),
        ((OWN, (math.nan, 0, 0), AHEAD, HEAD_ON, 1), "att_ownship: yaw is nan"),
        ((OWN, LEVEL, AHEAD, (0, math.inf, 0), 1), "att_intruder: pitch is inf"),
        ((OWN, LEVEL, (0.9, math.nan, 0), HEAD_ON, 1), "longitude is nan"),
        (((math.nan,) * 3, LEVEL, AHEAD, HEAD_ON, 1), "lla_ownship: latitude is nan"),
        ((OWN, LEVEL, [AHEAD, AHEAD], [HEAD_ON] * 2, 1), r"shape \(2, 3\): it must be \(1, 3\)"),
        ((OWN[:2], LEVEL, AHEAD, HEAD_ON, 1), r"lla_ownship has the shape \(2,\)"),
        ((OWN, LEVEL, "here", HEAD_ON, 1), "must hold numbers"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, math.nan), "time_s is nan"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, -1.0), "time_s is -1.0"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, "soon"), "time_s is 'soon'"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, np.ma.masked), "time_s is masked"),
        ((OWN, LEVEL, np.ma.masked_less(AHEAD, 0.5), HEAD_ON, 1), "lla_intruder has masked values"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, 1e12), "time_s is 1000000000000.0"),
        ((OWN, LEVEL, AHEAD, HEAD_ON, 0.1), "must not go back"),
    ],
)
def test_what_cannot_be_used_is_refused_and_leaves_no_trace(simulator, arguments, message):
    simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.2)
    with pytest.raises(ValueError, match=message):
        simulator.simulate(*arguments)
    assert simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.25).scans == {"eo": 4}


def test_planes_are_refused_with_a_reason(simulator, configs):
    with pytest.raises(ValueError, match="a plane of this name"):
        simulator.add_plane("near")
    with pytest.raises(SceneError, match="did you mean 'contrast_ir'"):
        simulator.add_plane("other", contrast_it=1.0)
    with pytest.raises(SceneError) as caught:
        simulator.add_plane("other", swerling=7, contrast=-1.0)
    assert len(caught.value.problems) == 2
    with pytest.raises(SceneError, match=r"f_17\.toml"):
        simulator.add_plane("other", aircraft=configs / "aircraft" / "f_17.toml")
    with pytest.raises(SceneError, match="must be a file"):
        simulator.add_plane("other", aircraft=3)
    simulator.start()
    with pytest.raises(ValueError, match="before the first call"):
        simulator.add_plane("other")
    assert simulator.planes == ("near",)


def test_planes_are_named_or_numbered(scene):
    simulator = Simulator(scene)
    simulator.add_plane("head_on")
    simulator.start(plane_by_plane=True)
    with pytest.raises(ValueError, match="did you mean 'head_on'"):
        simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0, plane="headon")
    with pytest.raises(ValueError, match="from 0 to 0"):
        simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0, plane=1)
    assert simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0, plane=0)[0].name == "head_on"


_OPEN_LOOP = "a host drives an open-loop scene only"


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (["blocks.eo.latency_s=0.1"], "eo.detections -> fusion.detections"),
        (['blocks.eo.processor="cpu"', "processors.cpu.service_s=0.01"], "queue for processor"),
        (
            ['wires[6]={from = "ir", to = "fusion", delay_s = 0.1}'],
            "ir.detections -> fusion.detections",
        ),
    ],
)
def test_scenes_that_need_an_event_queue_are_refused(scene, sets, message):
    with pytest.raises(SceneError, match=message) as caught:
        Simulator(scene, sets=sets)
    assert _OPEN_LOOP in str(caught.value)


def test_a_scene_without_fusion_is_refused(configs, tmp_path):
    base = (configs / "first_light.toml").as_posix()
    path = tmp_path / "alone.toml"
    path.write_text(
        f'extends = "{base}"\nwires = ["traffic -> transform -> gate -> radar"]\n', encoding="utf-8"
    )
    with pytest.raises(SceneError):
        Simulator(path)


def test_a_scene_for_a_host_does_not_run_by_itself(scene):
    loaded = load_scene(scene, swaps=["traffic=traffic.host"], duration_s=1)
    with pytest.raises(SceneError, match=r"drive this scene with dsa_des\.embed\.Simulator"):
        Simulation(loaded).run()


def test_running_it_is_refused_on_the_command_line_and_leaves_nothing(scene, tmp_path):
    out = tmp_path / "out"
    done = CliRunner().invoke(
        main, ["run", str(scene), "--swap", "traffic=traffic.host", "--out", str(out)]
    )
    assert done.exit_code == 2
    assert "blocks.traffic.type: positions come from a host program" in done.stderr
    assert not out.exists()


def test_a_block_that_fails_is_named(scene, monkeypatch):
    simulator = Simulator(scene)
    simulator.add_plane("near")
    simulator.start()

    def fail(wake):
        raise ValueError("no film")

    monkeypatch.setattr(simulator._chains[0].components["eo"], "run", fail)
    simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0)
    with pytest.raises(BlockFailure, match=r"eo .* failed at t = 0\.050 s, scan 0: .*no film"):
        simulator.simulate(OWN, LEVEL, AHEAD, HEAD_ON, 0.05)


def test_the_engine_finds_the_interface_by_its_registered_name():
    import dsa_des.embed.host_driven

    assert dsa_des.embed.Simulator is Simulator
    assert issubclass(HostDriven, object)
    with pytest.raises(AttributeError, match="Simulater"):
        dsa_des.embed.Simulater  # noqa: B018


def test_sensors_that_ask_for_flights_are_refused_when_the_host_sets_up(configs):
    """One report names each key; nothing is left to fail at the first call."""
    sets = ["blocks.radar.beam_sweep=true", "blocks.radar.measures_range_rate=true",
            "blocks.radar.moving_target_filter=single_canceller",
            "blocks.radar.prf_hz=9000"]  # fmt: skip
    with pytest.raises(SceneError) as caught:
        Simulator(configs / "first_light.toml", sets=sets)
    said = [str(problem) for problem in caught.value.problems]
    assert len(said) == 3
    for key, off in (("beam_sweep", "false"), ("measures_range_rate", "false"),
                     ("moving_target_filter", "'none'")):  # fmt: skip
        (line,) = (line for line in said if f"blocks.radar.{key}" in line)
        assert line.endswith(f"set it to {off}")
    Simulator(configs / "first_light.toml", sets=[*sets, "blocks.radar.enabled=false"])


def summed(step):
    """Give instants as a host has them that adds up its steps."""
    time_s = 0.0
    while True:
        yield time_s
        time_s += step


@pytest.mark.parametrize(
    ("times", "hundredths", "calls"),
    [
        (summed(0.01), 1, 80_000),
        (summed(0.05), 5, 80_000),
        ((np.float32(k * 0.1) for k in itertools.count()), 10, 40_000),
    ],
    ids=["0.01 s", "0.05 s", "single precision"],
)
def test_a_host_that_adds_up_its_steps_makes_every_scan_at_its_own_call(
    scene, times, hundredths, calls
):
    """Sums of floats leave the scans by more than half a tick from 709 s (1,152 s) on."""
    rates = {"radar": 1, "eo": 2, "ir": 5}
    simulator = Simulator(scene, sets=[
        *(f"blocks.{name}.scan_rate_hz={rate}" for name, rate in rates.items()),
        *(f"blocks.{name}.offset_s=0" for name in rates),
    ])  # fmt: skip
    simulator.start()
    (chain,) = simulator._chains
    most = 0.0
    for call, time_s in zip(range(calls), times, strict=False):
        at = call * hundredths
        most = max(most, abs(float(time_s) - at / 100))
        made = chain.start_step(chain.tick_of(time_s)).scans
        assert set(made) == {n for n, rate in rates.items() if at % (100 // rate) == 0}, time_s
    assert most > 0.5e-9  # else this shows nothing


def test_a_host_that_adds_up_its_steps_and_calls_now_and_then_makes_scans_at_their_calls(scene):
    """500 steps of 0.01 s from one call to the next: 710 s comes out as 709.9999999994993."""
    simulator = Simulator(scene, sets=[
        *(f"blocks.{name}.scan_rate_hz=0.2" for name in ("radar", "eo", "ir")),
        *(f"blocks.{name}.offset_s=0" for name in ("radar", "eo", "ir")),
    ])  # fmt: skip
    simulator.start()
    (chain,) = simulator._chains
    times = list(itertools.islice(summed(0.01), 75_000))
    assert 710.0 - times[71_000] > 0.5e-9
    for call in range(0, 75_000, 500):
        assert len(chain.start_step(chain.tick_of(times[call])).scans) == 3, times[call]
        assert not chain.start_step(chain.tick_of(times[call + 1])).scans


def test_sightings_are_those_of_a_host_that_counts_its_steps(scene):
    """A million seconds in, sums of steps leave the ticks at once."""
    simulators = [Simulator(scene) for _ in range(2)]
    summed, seen = 1e6, ([], [])
    for call in range(60):
        for found, simulator, time_s in zip(
            seen, simulators, (summed, 1e6 + call / 20), strict=True
        ):
            planes = np.tile((0.9 + 5e-5, 0.07, 1000.0), (len(simulator.planes), 1))
            result = simulator.simulate(OWN, LEVEL, planes, np.tile(HEAD_ON, (len(planes), 1)),
                                        time_s)  # fmt: skip
            found.append((result.time_s, result.scans, result.detected.tolist()))
        summed += 0.05
    assert seen[0] == seen[1]
    assert abs(summed - 1e6 - 3.0) > 0.5e-9


def test_rows_of_a_path_begin_where_their_summed_times_were_meant():
    times = np.cumsum(np.r_[0.0, np.full(80_000, 0.1)])
    assert times[-1] > 8000.0
    places = np.column_stack([0.9 + 1e-9 * np.arange(80_001), np.full((80_001, 2), (0.07, 1000.0))])
    path = FixedPath(places, np.zeros(3), times)
    for row in (1, 100, 70_900, 79_999):
        assert path.at(row / 10)[0] == places[row, 0]
        assert path.at(row / 10 - 1e-4)[0] == places[row - 1, 0]
