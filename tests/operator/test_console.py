"""The operator's console in a closed loop: a person's decisions, and their replay byte by byte."""

import math
from copy import deepcopy

import pyarrow.parquet as pq
import pytest
from covering import covers
from test_avoidance_by_bands import scene as by_bands
from wired import rows, run

import dsa_des
from components.messages.decisions import CLIMB, SHOWN, TURN, VERIFIED, OperatorDecision
from components.operator.human import MOST_WAITING, Desk, PendingDecision
from components.operator.recorded import read_decisions
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.replicas.replicas import Replica, replica_scene
from dsa_des.running.simulation import Simulation

HUMAN, RECORDED = "operator.human", "operator.recorded"
BOTH = (HUMAN, RECORDED)
#: When a person acts, s, and what they do.
ACTS = [
    (41.02, OperatorDecision(SHOWN, "head_on", wall_time_s=1.7e9)),
    (43.5, OperatorDecision(VERIFIED, "head_on", wall_time_s=1.7e9 + 2.25)),
    (43.5, OperatorDecision(TURN, "head_on", turn_rad=-0.6, wall_time_s=1.7e9 + 2.5)),
    (60.0, OperatorDecision(CLIMB, "", climb_m=90.0)),
]
TABLE = "time_s,decision,target,turn_rad,climb_m\n43.51,turn,head_on,-0.6,\n60,climb,,,90\n"


class Person(Desk):
    """Acts at given times of the simulation."""

    def __init__(self, acts):
        super().__init__()
        self.acts, self.told = list(acts), []

    def take(self, time_s):
        while self.acts and self.acts[0][0] <= time_s:
            self.submit(PendingDecision(self.acts.pop(0)[1], self.told.append))
        return super().take(time_s)


def scene(tmp_path, kind=RECORDED, truth=False, **keys):
    found = by_bands(tmp_path)
    found["duration_s"] = 62
    found["record"] = {"truth": truth}
    if kind == RECORDED and "decisions" not in keys:
        keys["decisions"] = str(tmp_path / "table.csv")
        (tmp_path / "table.csv").write_text(TABLE)
    found["blocks"]["avoidance"] = {"type": kind, **keys}
    return found


def lived(scene_of_a_person, acts=ACTS, **keywords):
    """Tables of a run with a person at the console, and the person."""
    person, tables = Person(acts), MemorySink()
    loaded = dsa_des.load_scene(scene_of_a_person)
    simulation = Simulation(loaded, recorder=Recorder([tables]), **keywords)
    simulation.components["avoidance"].desk = person
    simulation.run()
    return tables.tables(), person


def test_a_replay_is_what_the_person_did_to_the_last_column(tmp_path):
    there, person = lived(scene(tmp_path, HUMAN, truth=True, scan_rate_hz=4))
    pq.write_table(there["decisions"], tmp_path / "decisions.parquet")
    tables = MemorySink()
    loaded = dsa_des.load_scene(
        scene(tmp_path, truth=True, scan_rate_hz=4, decisions=str(tmp_path))
    )
    Simulation(loaded, recorder=Recorder([tables])).run()
    again = tables.tables()
    assert again.keys() == there.keys()
    assert [name for name in there if not again[name].equals(there[name])] == []
    decided = there["decisions"].to_pylist()
    assert [row["decision"] for row in decided] == ["shown", "verified", "turn", "climb"]
    assert [row["time_s"] for row in decided] == [41.25, 43.5, 43.5, 60.0]
    assert [one.time_s for one in person.told] == [41.25, 43.5, 43.5, 60.0]
    assert decided[2]["wall_time_s"] - decided[0]["wall_time_s"] == 2.5
    assert decided[3]["target"] is None and decided[3]["wall_time_s"] is None
    turned = [row["heading_rad"] for row in there["truth"].to_pylist() if row["target"] is None]
    assert turned[0] == pytest.approx(math.radians(217.0), abs=1e-3)
    assert turned[-1] - turned[0] == pytest.approx(-0.6, abs=2e-3)
    began = next(r["time_s"] for r in there["alerts"].to_pylist() if r["level"] > 0)
    assert [row["alert_s"] for row in decided] == [began, began, began, None]
    assert decided[1]["response_s"] == pytest.approx(43.5 - began, abs=1e-9)
    assert decided[1]["level"] >= 1 and decided[3]["level"] == 0


#: Turns of 3 deg/s last 11.46 s and 5.73 s; climbs of 2.5 m/s 40 s, 8 s and 4 s.
STEERED = [
    (41.0, OperatorDecision(TURN, "head_on", turn_rad=0.6)),
    (42.0, OperatorDecision(CLIMB, climb_m=100.0)),
    (45.0, OperatorDecision(TURN, "head_on", turn_rad=-0.3)),
    (50.0, OperatorDecision(CLIMB, climb_m=-20.0)),
    (50.0, OperatorDecision(SHOWN, "head_on")),
    (51.0, OperatorDecision(TURN, turn_rad=0.1)),
    (58.0, OperatorDecision(CLIMB, climb_m=10.0)),
]


def test_a_command_says_which_one_it_replaces_and_a_turn_and_a_climb_fly_both(tmp_path):
    keys = {"turn_rate_deg_s": 3.0, "vertical_rate_mps": 2.5}
    there, person = lived(scene(tmp_path, HUMAN, truth=True, **keys), STEERED)
    decided = there["decisions"].to_pylist()
    # The third turn comes 0.27 s after the second is flown, the third climb as the second ends.
    assert [row["replaces_s"] for row in decided] == [None, None, 41.0, 42.0, None, None, None]
    told = [(one.time_s, one.replaces_s) for one in person.told]
    assert [one for one in told if not math.isnan(one[1])] == [(45.0, 41.0), (50.0, 42.0)]
    ends = [one.ends_s for one in person.told]
    assert ends[:4] == pytest.approx(
        [41 + math.degrees(0.6) / 3, 82, 45 + math.degrees(0.3) / 3, 58]
    )
    assert math.isnan(ends[4])
    own = {r["time_s"]: r for r in there["truth"].to_pylist() if r["target"] is None}

    def flown(name, since_s, time_s):  # a second later: what the wire to the ownship takes
        return own[time_s + 1.0][name] - own[since_s + 1.0][name]

    # Both at once from 42 s to 45 s; then what was left of the first turn and climb is not flown.
    assert math.degrees(flown("heading_rad", 41.0, 45.0)) == pytest.approx(12.0, abs=0.1)
    assert flown("alt_m", 42.0, 45.0) == pytest.approx(7.5, abs=0.1)
    assert math.degrees(flown("heading_rad", 45.0, 50.0)) == pytest.approx(-15.0, abs=0.1)
    assert flown("alt_m", 42.0, 50.0) == pytest.approx(20.0, abs=0.1)
    assert flown("alt_m", 50.0, 58.0) == pytest.approx(-20.0, abs=0.1)


@covers("turn_rate_deg_s", "vertical_rate_mps", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
def test_it_is_flown_at_the_console_s_rates(tmp_path, kind):
    wanted = scene(tmp_path, kind, turn_rate_deg_s=4.5, vertical_rate_mps=3.25)
    told = (
        rows(run(wanted), "manoeuvres")
        if kind == RECORDED
        else lived(wanted, ACTS[2:])[0]["manoeuvres"].to_pylist()
    )
    assert [row["turn_rad"] for row in told] == [-0.6, 0.0]
    assert math.degrees(told[0]["rate_rad_s"]) == pytest.approx(4.5)
    assert (told[1]["climb_m"], told[1]["climb_rate_mps"]) == (90.0, 3.25)


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(
    ("keys", "time_s"),
    [
        ({}, 43.52),
        ({"scan_rate_hz": 2}, 44.0),
        ({"scan_rate_hz": 2, "offset_s": 0.2}, 43.7),
        # Every scan a thousandth of a period early: the 88th comes at 88/2.002 s.
        ({"scan_rate_hz": 2, "rate_error_ppm": 1000}, 88 / 2.002),
    ],
)
def test_a_decision_comes_at_the_first_scan_not_before_it(tmp_path, kind, keys, time_s):
    wanted = scene(tmp_path, kind, **keys)
    wanted["duration_s"] = 45
    acts = [(43.51, OperatorDecision(TURN, "head_on", turn_rad=-0.6))]
    if kind == RECORDED:
        (told,) = rows(run(wanted), "manoeuvres")
    else:
        (told,) = lived(wanted, acts)[0]["manoeuvres"].to_pylist()
    assert told["time_s"] == pytest.approx(time_s, abs=1e-6)


def test_decisions_of_one_window_are_each_of_their_own_scan(tmp_path):
    """Nothing leads back to the alerts: the whole run is one window."""
    wanted = scene(tmp_path, scan_rate_hz=2, offset_s=0.2)
    (tmp_path / "table.csv").write_text(
        "time_s,decision,turn_rad,climb_m\n3,looked,,\n7.1,turn,0.2,\n7.3,climb,,40\n9.2,turn,-0.1,\n"
    )
    wanted["duration_s"] = 12
    wanted["wires"].pop()
    found = run(wanted)
    assert [row["time_s"] for row in rows(found, "decisions")] == [3.2, 7.2, 7.7, 9.2]
    told = [(row["time_s"], row["turn_rad"], row["climb_m"]) for row in rows(found, "manoeuvres")]
    assert told == [(7.2, 0.2, 0.0), (7.7, 0.0, 40.0), (9.2, -0.1, 0.0)]


@covers("jitter_s", of=BOTH)
@pytest.mark.parametrize("kind", BOTH)
def test_scans_that_jitter_take_decisions_at_other_times(tmp_path, kind):
    wanted = scene(tmp_path, kind, scan_rate_hz=2, jitter_s=0.05)
    wanted["duration_s"] = 45
    if kind == RECORDED:
        (told,) = rows(run(wanted), "manoeuvres")
    else:
        (told,) = lived(wanted, ACTS[2:3])[0]["manoeuvres"].to_pylist()
    assert 0.001 < abs(told["time_s"] - 44.0) < 0.3 or 0.001 < abs(told["time_s"] - 43.5) < 0.3


@covers("decisions", of=(RECORDED,))
def test_another_table_is_another_operator(tmp_path):
    other = tmp_path / "other.csv"
    other.write_text(TABLE.replace("-0.6", "0.4"))
    turns = [
        rows(run(scene(tmp_path, **keys)), "manoeuvres")[0]["turn_rad"]
        for keys in ({}, {"decisions": str(other)})
    ]
    assert turns == [-0.6, 0.4]


@pytest.mark.parametrize(
    ("wrong", "more"), [(4, ""), (5, ""), (6, "and 1 more"), (8, "and 3 more")]
)
def test_five_problems_of_a_table_are_told_and_the_rest_counted(tmp_path, wrong, more):
    path = tmp_path / "table.csv"
    path.write_text("time_s,decision\n" + "1,trun\n" * wrong)
    with pytest.raises(ValueError) as refused:
        read_decisions(path)
    said = str(refused.value).removeprefix(f"{path}: ").split("; ")
    told = [part for part in said if "decision is 'trun'" in part]
    assert [part.partition(":")[0] for part in told] == [
        f"line {number + 2}" for number in range(min(wrong, 5))
    ]
    assert [part for part in said if " more" in part] == [more] * bool(more)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time_s,what\n1,turn\n", "has no column 'decision'"),
        ("time_s,decision\n1,trun\n", "line 2: decision is 'trun'"),
        ("time_s,decision,turn_rad\n1,turn,3.2\n", "line 2: turn_rad is '3.2'"),
        ("time_s,decision,climb_m\n1,climb,nan\n", "line 2: climb_m is 'nan'"),
        ("time_s,decision\n-1,looked\n", "line 2: time_s is '-1'"),
        ("time_s,decision\n5,looked\n4,looked\n", "line 3: time_s is 4: it must not go back"),
    ],
)
def test_what_is_no_table_of_decisions_is_refused(tmp_path, text, says):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(ValueError) as refused:
        read_decisions(path)
    assert says in str(refused.value) and str(path) in str(refused.value)
    missing = deepcopy(scene(tmp_path, decisions=str(tmp_path / "nothing.csv")))
    with pytest.raises(dsa_des.SceneError, match="there is no such file"):
        run(missing)


def test_a_desk_takes_no_more_than_a_person_lays_down():
    desk = Desk()
    decision = PendingDecision(OperatorDecision(SHOWN), print)
    accepted = [desk.submit(decision) for _ in range(MOST_WAITING + 2)]
    assert accepted == [True] * MOST_WAITING + [False] * 2
    assert desk.take(1.5) == [decision] * MOST_WAITING and desk.take(2.5) == []
    assert desk.submit(decision)
    assert len(desk.close()) == 1 and not desk.submit(decision)


def test_without_a_person_nothing_is_decided_and_it_says_so(tmp_path):
    wanted = scene(tmp_path, HUMAN)
    wanted["duration_s"] = 2
    found = run(wanted)
    assert found["decisions"].num_rows == found["manoeuvres"].num_rows == 0
    loaded = dsa_des.load_scene(wanted)
    (said,) = Simulation(loaded).components["avoidance"].warnings()
    assert "nobody is at the console" in said
    late = dsa_des.load_scene(scene(tmp_path) | {"duration_s": 50})
    (said,) = Simulation(late).components["avoidance"].warnings()
    assert said == "decisions: 1 of 2 come after the end"


def test_a_decision_knows_the_alerts_that_have_come_of_its_own_target(tmp_path):
    """Two intruders with alerts of different levels, which come 0.7 s late."""
    table = (
        "time_s,decision,target,turn_rad,climb_m\n43.7,verified,other,,\n43.7,looked,head_on,,\n"
        "46.1,turn,other,0.4,\n46.35,climb,,,-70\n"
    )
    wanted = scene(tmp_path, scan_rate_hz=10)
    (tmp_path / "table.csv").write_text(table)
    wanted["duration_s"] = 47
    first = wanted["blocks"]["traffic"]["intruders"][0]
    far = {k: first[k] * 1.2 for k in ("east_m", "north_m")}
    wanted["blocks"]["traffic"]["intruders"].append({**first, **far, "name": "other"})
    wanted["wires"] = [
        "traffic -> alerting",
        {"from": "alerting", "to": "avoidance", "delay_s": 0.7, "holds": "nothing"},
        {"from": "avoidance", "to": "traffic", "delay_s": 1, "holds": "nothing"},
    ]  # fmt: skip
    found = run(wanted)
    alerts = {}
    for row in rows(found, "alerts"):
        alerts.setdefault(row["target"], []).append((row["time_s"] + 0.7, row["level"]))
    decided = rows(found, "decisions")
    # At 43.7 s the alerts of 43 s have just come.
    for row in decided[:3]:
        there = [one for one in alerts[row["target"]] if one[0] <= row["time_s"] + 1e-9]
        began = min(time_s for time_s, level in there if level > 0)
        assert (row["level"], row["alert_s"]) == (there[-1][1], pytest.approx(began))
    assert decided[0]["level"] < decided[1]["level"]
    told = rows(found, "manoeuvres")
    assert [row["time_s"] for row in told] == [46.1, 46.4]
    assert (told[0]["turn_rad"], told[1]["climb_m"]) == (0.4, -70.0)


@pytest.mark.parametrize(
    ("table", "turned_rad", "climbed_m"),
    [
        ("43.51,turn,,-0.6,\n46,climb,,,30\n", -0.6, 30.0),
        ("43.51,climb,,,30\n46,turn,,-0.6,\n", -0.6, 30.0),
        ("43.51,climb,,,30\n46,climb,,,-20\n", 0.0, -20.0),
    ],
)
def test_a_turn_and_a_climb_are_flown_together(tmp_path, table, turned_rad, climbed_m):
    """Neither ends the other, in any window and in lock step; a second climb replaces one."""
    wanted = scene(tmp_path, truth=True, vertical_rate_mps=4.0, scan_rate_hz=2)
    head = "time_s,decision,target,turn_rad,climb_m\n"
    (tmp_path / "table.csv").write_text(head + table)

    def tables(*scenes, **keywords):
        sink = MemorySink()
        recorder = Recorder([sink])
        if len(scenes) > 1:
            make_lockstep_simulation(list(scenes), recorder=recorder).run()
        else:
            Simulation(scenes[0], recorder=recorder, **keywords).run()
        return sink.tables()

    loaded = dsa_des.load_scene(wanted)
    alone = tables(loaded)
    own = [row for row in alone["truth"].to_pylist() if row["target"] is None]
    turned = math.remainder(own[-1]["heading_rad"] - own[0]["heading_rad"], 2 * math.pi)
    assert turned == pytest.approx(turned_rad, abs=2e-3)
    first_s, second_s = (row["time_s"] + 1.0 for row in alone["manoeuvres"].to_pylist())
    own_mps = (own[1]["alt_m"] - own[0]["alt_m"]) / (own[1]["time_s"] - own[0]["time_s"])
    begun_m = own[0]["alt_m"] + own_mps * (first_s - own[0]["time_s"])
    replaces = [row["replaces_s"] for row in alone["decisions"].to_pylist()]
    assert replaces == [None, 44.0 if turned_rad == 0.0 else None]
    if turned_rad == 0.0:
        begun_m += 4.0 * (second_s - first_s)
    assert own[-1]["alt_m"] - begun_m == pytest.approx(climbed_m, abs=0.1)
    assert all(alone[name].equals(found) for name, found in tables(loaded, window=1).items())
    both = tables(*(replica_scene(loaded, Replica(seed, {})) for seed in (3, 4)))[
        "truth"
    ].to_pylist()
    for replica in (0, 1):
        theirs = [row for row in both if row["replica"] == replica and row["target"] is None]
        for name in ("lat_deg", "lon_deg", "alt_m", "heading_rad"):
            assert [row[name] for row in theirs] == [row[name] for row in own]
