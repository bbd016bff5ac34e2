"""Every kind of block that can be wired and do nothing says so: in check, or when it has run."""

import math
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from same_runs import replicas_of
from wired import SEES_ALL, chain

import dsa_des
from components.fusion.pick_best import least_tick_distance_s
from components.guidance.mvp import VoltagePotential
from components.messages.reach import FarthestLook
from components.surveillance.exchange import PositionExchange
from dsa_des.arrays.run_ticks import shared_zero_run_numbers
from dsa_des.block.entry_points import entry_points_of
from dsa_des.record.failure_counts import Tries, sum_failure_counts
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation
from tests.alerting.conf_text import CONF

#: What each type says when it has nothing to work on: "check" before the run, "run" with its share
#: behind it, "refused" where a scene with it does not start. Of each, that it never ran is said.
SAID = {
    "alerting.daidalus": "check run", "alerting.m_of_n": "check", "avoidance.daidalus": "check run",
    "avoidance.horizontal_cas": "refused", "avoidance.mvp": "check run",
    "avoidance.turn_away": "check run", "encounters.closest_approach_passed": "",
    "foreign.fmu": "refused run", "foreign.mavlink": "check run",
    "foreign.process": "run",
    "fusion.covariance_intersection": "run", "fusion.gated": "run", "fusion.pass_through": "",
    "fusion.pick_best": "check run", "gate": "", "geometry.daidalus_sphere": "",
    "geometry.ellipsoid": "", "geometry.flat_earth": "", "geometry.geodesic": "",
    "geometry.local_radii": "", "guidance.daidalus": "check", "laser.scanning": "run",
    "operator.human": "check", "operator.recorded": "check", "operator.stochastic": "check run",
    "optical.eo": "check run", "optical.image": "check run", "optical.ir": "check run",
    "optical.projection": "check run", "optical.range_boundary": "refused",
    "radar.range_boundary": "refused", "radar.swerling": "check run",
    "radar.threshold": "check run", "sensor.recorded": "check refused",
    "surveillance.active": "check", "surveillance.ads_b": "check",
    "surveillance.exchange": "check run", "tracking.cues": "run",
    "tracking.ekf": "check run", "tracking.hold_last": "run", "tracking.imm": "check run",
    "tracking.stonesoup": "run", "tracking.stub": "run", "tracking.ukf": "check run",
    "traffic.asterix": "refused", "traffic.csv": "refused", "traffic.daa_file": "refused",
    "traffic.encounter_model": "", "traffic.encounters": "", "traffic.file": "refused",
    "traffic.host": "refused",
    "traffic.random": "", "traffic.scripted": "", "visual.acquisition": "",
}  # fmt: skip
TARGETS = [
    {"name": name, "north_m": north, "east_m": east, "heading_deg": 180.0, "speed_mps": 50.0}
    for name, north, east in (("near", 2000.0, 300.0), ("far", 5000.0, -900.0))
]
OWN = {"lat_deg": 45.0, "lon_deg": 7.0, "alt_m": 900.0, "heading_deg": 0.0, "speed_mps": 40.0}
EYE = {"type": "optical.range_boundary", "range_km": 20.0, "scan_rate_hz": 1}
RADAR = {"type": "radar.range_boundary", "range_km": 20.0, "scan_rate_hz": 1}
#: What a tracker takes: stated errors.
STATED = {**RADAR, "errors": "stated", "quantised": False, "azimuth_error_deg": 0.5,
          "elevation_error_deg": 0.5, "range_error_m": 20.0}  # fmt: skip
NOT_TOGETHER = "two sensors or more detect, and it never puts two of them together"


def scene(sensors: Any, **more: Any) -> dict[str, Any]:
    return chain(sensors, ownship=OWN, targets=TARGETS, **{"duration_s": 10, **more})


def failure_counts(scene: Any) -> Mapping[str, Any]:
    loaded = dsa_des.load_scene(scene) if isinstance(scene, Mapping) else scene
    return Simulation(loaded).run().failure_counts


def notes(scene: Any) -> list[str]:
    return notes_of_scene(Simulation(dsa_des.load_scene(scene)))


def with_tail(found: dict[str, Any], wires: list[Any], **blocks: Any) -> dict[str, Any]:
    found["blocks"] |= blocks
    found["wires"] += wires
    return found


def steered(found: dict[str, Any], by: str, **keys: Any) -> dict[str, Any]:
    """Return a scene in which the potential steers by what a block says of others."""
    back = {"from": "steers", "to": "traffic", "delay_s": 0.1, "holds": "nothing"}
    steers = {"type": "avoidance.mvp", "speed_mps": 40.0, "most_mps": 40.0, **keys}
    return with_tail(found, [f"{by} -> steers", "traffic -> steers", back], steers=steers)


def test_every_type_of_block_was_looked_at() -> None:
    assert set(SAID) == set(entry_points_of("dsa_des.components"))


@pytest.mark.parametrize("fusion", ["fusion.pick_best", "fusion.gated"])
def test_a_fusion_whose_sensors_never_meet_is_counted_by_runs(fusion: str) -> None:
    """Half a second apart, and gates of nothing and of a tenth of a second."""
    apart = {"eye": {**EYE, "offset_s": 0.5}, "radar": RADAR}
    found = scene(apart, fusion={"type": fusion})
    assert failure_counts(found)["fusion"] == {NOT_TOGETHER: (1, 1)}
    said = [note for note in notes(found) if "never puts" in note]
    assert said == (
        [
            "blocks.fusion: coincidence_s is 0 and no two sensors report less than 0.5 s apart: it "
            "never puts two of them together"
        ]
        if fusion == "fusion.pick_best"
        else []
    )
    once = {"blocks.eye.offset_s": 0}
    together = replicas_of(dsa_des.load_scene(found), {}, once, {})
    assert make_lockstep_simulation(together).run().failure_counts == sum_failure_counts(
        map(failure_counts, together)
    )
    assert failure_counts(together[1])["fusion"] == {NOT_TOGETHER: (0, 1)}
    alone = scene({"radar": RADAR}, fusion={"type": fusion})
    assert "fusion" not in failure_counts(alone) and not any(
        "never" in note for note in notes(alone)
    )


@pytest.mark.parametrize(
    ("one", "other", "apart_s"),
    [((0, 1), ("1/2", 1), "1/2"), ((0, "1/5"), (0, "1/2"), 0),
     (("1/20", "1/5"), (0, "1/2"), "1/20"), ((0, "1/3"), ("1/7", "1/3"), "1/7"),
     (("3/10", 1), (0, "1/2"), "1/5")],
)  # fmt: skip
def test_how_near_two_clocks_come_is_found_among_their_instants(
    one: Any, other: Any, apart_s: Any
) -> None:
    first, second = ([Fraction(x) for x in clock] for clock in (one, other))
    instants = [[clock[0] + k * clock[1] for k in range(60)] for clock in (first, second)]
    by_hand = min(abs(a - b) for a in instants[0] for b in instants[1])
    assert least_tick_distance_s(tuple(first), tuple(second)) == by_hand == Fraction(apart_s)


def test_trackers_whose_tracks_are_of_others_are_counted() -> None:
    """One looks to the left, one to the right: their tracks are of two aircraft."""
    sides = {"left": [-90.0, 0.0], "right": [0.0, 90.0]}
    found = scene({side: {**STATED, "azimuth_deg": field} for side, field in sides.items()})
    for side in sides:
        hands_on, tracks = f"fusion_{side}", f"tracker_{side}"
        blocks = {hands_on: {"type": "fusion.pass_through"}, tracks: {"type": "tracking.ekf"}}
        with_tail(found, [f"{side} -> {hands_on} -> {tracks} -> both"], **blocks)
    found["blocks"]["both"] = {"type": "fusion.covariance_intersection"}
    what = "two trackers or more have tracks, and it never puts two of them together"
    assert failure_counts(found)["both"] == {what: (1, 1)}
    for side in sides:
        found["blocks"][side]["azimuth_deg"] = [-90.0, 90.0]
    assert failure_counts(found)["both"] == {what: (0, 1)}


def test_cones_that_are_too_wide_and_too_old_are_counted() -> None:
    found = scene(
        {"radar": STATED, "eye": SEES_ALL},
        fusion={"type": "fusion.pass_through"}, tracker={"type": "tracking.ekf"},
    )  # fmt: skip
    found["wires"].remove("eye -> fusion")
    late = {"from": "cues", "to": "eye", "delay_s": 0.5, "holds": {}}
    with_tail(found, ["tracker -> cues", late], cues={"type": "tracking.cues", "lasts_s": 0.2})
    old = "the cues that it has are older than their lasts_s"
    times, of = failure_counts(found)["eye"][old]
    assert times == of == 9
    found["blocks"]["cues"] |= {"lasts_s": 2.0}
    assert failure_counts(found)["eye"] == {old: (0, 9)}
    found["blocks"]["cues"] |= {"most_half_angle_deg": 1.0}
    ((what, (times, of)),) = failure_counts(found)["cues"].items()
    assert what == "a track's cone is wider than most_half_angle_deg (1) and cues none"
    assert times == of == 20


@pytest.mark.parametrize("tracker", ["tracking.hold_last", "tracking.ekf"])
def test_an_alerting_that_needs_ranges_says_that_nobody_measures_any(
    tracker: str, tmp_path: Path
) -> None:
    path = tmp_path / "two.conf"
    path.write_text(CONF, encoding="utf-8")
    said = "blocks.alerts: eye measures no range: nothing of what it hears of is judged"
    for name, sensor in (("eye", SEES_ALL), ("radar", STATED)):
        found = scene({name: sensor}, fusion={"type": "fusion.pass_through"},
                      tracker={"type": tracker})  # fmt: skip
        alerts = {"type": "alerting.daidalus", "conf": str(path), "scan_rate_hz": 1}
        with_tail(found, ["traffic -> alerts", "tracker -> alerts"], alerts=alerts)
        assert (said in notes(found)) is (name == "eye")
        # In a closed loop it is told what its optional inputs offer all the same.
        steered(found, "alerts")
        assert (said in notes(found)) is (name == "eye")
        if tracker == "tracking.ekf":  # directions tell ranges in time
            found["blocks"]["tracker"]["passive_range_share"] = 0.3
            assert said not in notes(found)


def test_who_turns_away_by_range_says_that_nobody_measures_any() -> None:
    never = "blocks.turns: without_range is false and eye measures no range: it never turns"
    counted = "a track has no range and is not acted on"
    for name, sensor in (("eye", SEES_ALL), ("radar", RADAR)):
        found = scene({name: sensor}, fusion={"type": "fusion.pass_through"},
                      tracker={"type": "tracking.hold_last"})  # fmt: skip
        with_tail(found, ["tracker -> turns"], turns={"type": "avoidance.turn_away"})
        assert (never in notes(found)) is (name == "eye")
        times, of = failure_counts(found)["turns"][counted]
        assert of == 20 and times == (20 if name == "eye" else 0)
        found["blocks"]["turns"]["without_range"] = True
        assert never not in notes(found) and "turns" not in failure_counts(found)


@pytest.mark.parametrize(
    ("tracker", "what"),
    [
        ("tracking.hold_last", "all that it gets are false alarms, and it holds nothing"),
        ("tracking.ekf", "detections came, and no track was ever confirmed"),
    ],
)
def test_a_tracker_that_never_has_a_track_is_counted(tracker: str, what: str) -> None:
    """Nobody is in reach, and noise comes now and then, never twice at one place."""
    noisy = {
        "type": "radar.swerling", "scan_rate_hz": 1, "power_w": 1.0, "antenna_gain_db": 10.0,
        "frequency_hz": 1e10, "bandwidth_hz": 1e6, "false_alarm_probability": 2e-5,
        "false_alarms": True, "range_km": 1.0, "azimuth_resolution_deg": 5.0,
        "elevation_resolution_deg": 5.0, "range_resolution_m": 50.0,
    }  # fmt: skip
    found = scene({"radar": noisy}, fusion={"type": "fusion.pass_through"},
                  tracker={"type": tracker})  # fmt: skip
    found["blocks"]["traffic"]["intruders"] = TARGETS[1:]
    assert failure_counts(found)["tracker"][what] == (1, 1)
    seen = scene({"radar": STATED}, fusion={"type": "fusion.pass_through"},
                 tracker={"type": tracker})  # fmt: skip
    assert failure_counts(seen)["tracker"][what] == (0, 1)
    runs = replicas_of(dsa_des.load_scene(found), {}, {})
    assert make_lockstep_simulation(runs).run().failure_counts == sum_failure_counts(
        map(failure_counts, runs)
    )


@pytest.mark.parametrize(
    ("kind", "needed"),
    [("surveillance.ads_b", "ads_b"), ("surveillance.active", "mode_s or mode_c")],
)
def test_who_hears_only_what_is_equipped_says_that_nobody_is(kind: str, needed: str) -> None:
    found = scene({"ear": {"type": kind, "scan_rate_hz": 1}})
    said = f"blocks.ear: no target's equipage has {needed}: it hears of nobody"
    assert said in notes(found)
    found["blocks"]["traffic"]["intruders"][0] |= {"ads_b": {}, "mode_s": True}
    assert said not in notes(found)


def test_who_hears_of_nobody_or_of_nobody_s_velocity_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = with_tail(scene({}, duration_s=4), ["traffic -> hears"],
                      hears={"type": "surveillance.exchange", "scan_rate_hz": 1})  # fmt: skip
    steered(found, "hears")
    alone = "blocks.hears: nobody else flies: it hears of nobody"
    still = "no flights are known beside the positions: nobody has a velocity and is heard"
    unmoved = "its own velocity is not known yet and it does not steer"
    assert alone not in notes(found)
    assert failure_counts(found) == {
        "hears": {still: (0, 4)}, "steers": {unmoved: (0, 4)}
    }  # fmt: skip
    run = VoltagePotential.run

    def spoilt(self: VoltagePotential, wake: Any) -> Any:
        """Up to 1 s the own velocity is not known."""
        wake["alerts"].own_motion["east_mps"][wake.time_s <= 1.0] = np.nan
        return run(self, wake)

    with monkeypatch.context() as patched:
        patched.setattr(VoltagePotential, "run", spoilt)
        assert failure_counts(found)["steers"] == {unmoved: (2, 4)}
    with monkeypatch.context() as patched:  # as of a host, or behind an FMU that flies
        patched.setattr(PositionExchange, "request", lambda self, port: FarthestLook(math.inf))
        assert failure_counts(found)["hears"] == {still: (4, 4)}
    slow = "speed_mps is 40 and most_mps is 18: it never flies its own way any faster"
    slow = f"blocks.steers: {slow}"
    assert slow not in notes(found)
    found["blocks"]["steers"]["most_mps"] = 18.0
    assert slow in notes(found)
    found["blocks"]["traffic"]["intruders"] = []
    assert alone in notes(found)


@pytest.mark.parametrize("pilot", ["avoidance.daidalus", "operator.stochastic"])
def test_who_finds_no_way_out_is_counted(pilot: str, tmp_path: Path) -> None:
    """Whoever may not turn, and is asked to turn, has no way out."""
    path = tmp_path / "two.conf"
    stiff = "left_hdir = 0.001 [deg]\nright_hdir = 0.001 [deg]\nrecovery_hdir = false\n"
    path.write_text(stiff + CONF, encoding="utf-8")
    found = scene({}, duration_s=40)
    keys = {} if pilot == "avoidance.daidalus" else {
        "turn_share": 1.0, "deterministic": True, "held_s": 0.0, "initial_delay_s": 0.0,
        "coordination_s": 0.0, "execution_delay_s": 0.0,
    }  # fmt: skip
    with_tail(
        found, ["traffic -> alerts -> pilot"],
        alerts={"type": "alerting.daidalus", "conf": str(path), "scan_rate_hz": 1},
        pilot={"type": pilot, "conf": str(path), "level": 1, **keys},
    )  # fmt: skip
    ((what, (times, of)),) = failure_counts(found)["pilot"].items()
    assert what == "no change leads clear and the ownship is left alone"
    assert 0 < times == of


def test_tries_of_runs_add_up_whatever_comes_when() -> None:
    tries = Tries().add_tries(np.array([0, 2, 2]), np.array([1, 1, 2]), np.array([False] * 3))
    tries = tries.add_tries(np.array([4, 4, 0]), np.array([1, 2, 1]), np.arange(3) == 1)
    # Run 2, of 2 and 4; 0 and 2, of 0, 2 and 4.
    assert tries.failure_counts("x", of_two=True)["x"].tolist() == [
        [0, 0, 1, 0, 0],
        [0, 0, 1, 0, 1],
    ]
    assert tries.failure_counts("x")["x"].tolist() == [[1, 0, 1, 0, 0], [1, 0, 1, 0, 1]]
    assert Tries().failure_counts("x")["x"].shape == (2, 0)
    alone = Tries().add_tries(shared_zero_run_numbers(1), np.array([1]), np.array([True]))
    for _ in range(2):  # a second source comes later, and it is done no more
        alone = alone.add_tries(
            shared_zero_run_numbers(2), np.array([1, 2]), np.zeros(2, dtype=bool)
        )
    assert alone.failure_counts("x", of_two=True)["x"].tolist() == [[0], [1]]
