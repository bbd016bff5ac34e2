"""Runs that end when the closest approaches are passed: when, and what of them is left."""

import itertools

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, measured, rows, run, sensor

import dsa_des
from components.metrics.encounter import ClosestApproach, WellClear
from components.metrics.risk import Severity
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas import lock_step_size, replicas
from dsa_des.replicas.changed_scene import Replica
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.studies.metric import Group, needed_columns

KIND = ("encounters.closest_approach_passed",)
MEANT_S = 40.0


def scene(targets=crooked.TARGETS, **keys):
    found = chain(
        {"radar": sensor("radar.range_boundary", scan_rate_hz=3)}, targets=targets,
        duration_s=MEANT_S, fusion={"type": "fusion.pick_best"}, tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found["blocks"]["over"] = {"type": KIND[0], **keys}
    found["wires"].append("traffic -> over")
    return found


def looks_s(scan_rate_hz=1.0, offset_s=0.0, rate_error_ppm=0.0):
    """When distances are taken."""
    period_s = 1.0 / (scan_rate_hz * (1.0 + rate_error_ppm * 1e-6))
    return np.arange(offset_s, MEANT_S, period_s)


def expected_s(times_s, after_s=20.0, beyond_m=0.0, targets=crooked.TARGETS, between="ownship"):
    """The rule, look by look and pair by pair."""
    last, since = {}, {}
    for time_s in times_s:
        passed = []
        places = {None: crooked.position(crooked.OWNSHIP, time_s)}
        places |= {of["name"]: crooked.position(of, time_s, crooked.OWNSHIP) for of in targets}
        for name in itertools.combinations(places, 2):
            if None not in name and between != "any two":
                continue
            apart_m = np.linalg.norm(places[name[0]] - places[name[1]])
            if not apart_m > last.get(name, np.inf):
                since[name] = time_s
            last[name] = apart_m
            grown_s = time_s - since[name]
            passed.append(grown_s > 0 and grown_s >= after_s - 1e-9 and apart_m >= beyond_m)
        if all(passed):
            return time_s
    return MEANT_S


@pytest.mark.parametrize("by", ["target", "place"])
@pytest.mark.parametrize("m", [1, 2])
def test_a_declaration_beyond_the_end_is_none(m, by, tmp_path):
    end_s = float(expected_s(looks_s()))
    late = scene()
    # What ends the run lies behind the radar, which has run to the window's end by then.
    late["blocks"]["away"] = {"type": "avoidance.turn_away", "range_km": 0.001}
    late["blocks"]["others"] = late["blocks"]["traffic"]
    late["wires"][-1:] = ["tracker -> away -> others", "others -> over"]
    late["blocks"]["radar"] |= {
        "offset_s": end_s - 1.0, "scan_rate_hz": 0.5, "declare_m": m, "declare_n": m,
        "declare_by": by,
    }  # fmt: skip
    path = tmp_path / "late.toml"
    path.write_text(to_toml(late))
    for window in (None, 1):
        done = Simulation(load_scene(path), window=window).run()
        assert done.duration_s == pytest.approx(end_s)
        first = done.report["declarations"]["radar"]
        assert first.keys() == {"rolling", "diving"}
        assert any(first.values()) == (m == 1)


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "after_s", "beyond_m", of=KIND)
@pytest.mark.parametrize(
    "clock, rule",
    [
        ({}, {}),
        ({}, {"after_s": 0}),
        ({"scan_rate_hz": 4, "offset_s": 0.1}, {"after_s": 1.5}),
        ({"scan_rate_hz": 4, "rate_error_ppm": 3000}, {"after_s": 1.5}),
        ({}, {"after_s": 2, "beyond_m": 1500}),
    ],
)
def test_a_run_ends_when_all_aircraft_have_passed_so_long(clock, rule):
    end_s = expected_s(looks_s(**clock), **rule)
    assert 10.0 < end_s < MEANT_S
    found = run(scene(**clock, **rule))
    assert found.info["duration_s"] == pytest.approx(end_s, abs=1e-9)
    assert found.info["ended_by"] == "over"
    assert found.info["summary"]["targets"].keys() == {"rolling", "diving"}
    # What is recorded is what the whole run records before that instant.
    whole = run({**scene(**clock, after_s=3600)})
    assert whole.info["duration_s"] == MEANT_S
    assert "ended_by" not in whole.info
    for table in ("scans", "detections", "tracks", "truth"):
        before = [row for row in rows(whole, table) if row["time_s"] < end_s - 1e-9]
        assert 0 < len(before) < len(rows(whole, table))
        assert rows(found, table) == before


@covers("jitter_s", of=KIND)
def test_its_looks_may_jitter():
    end_s = run(scene(jitter_s=0.1, after_s=3)).info["duration_s"]
    on_grid_s = expected_s(looks_s(), after_s=3)
    assert end_s != round(end_s)
    assert abs(end_s - on_grid_s) < 1.5


def test_the_last_one_to_pass_decides_and_who_stays_near_holds_the_run():
    alone_s = [run(scene([target], after_s=2)).info["duration_s"] for target in crooked.TARGETS]
    both_s = run(scene(after_s=2)).info["duration_s"]
    assert alone_s[0] != alone_s[1]
    assert both_s == max(alone_s)
    beside = {**crooked.OWNSHIP, "name": "beside", "east_m": 700, "north_m": 0, "up_m": 9}
    for key in ("lat_deg", "lon_deg", "alt_m"):
        del beside[key]
    closing = {**beside, "heading_deg": 217.3}
    assert run(scene([*crooked.TARGETS, closing], after_s=2)).info["duration_s"] == MEANT_S


@covers("between", of=KIND)
def test_between_any_two_a_run_lasts_until_two_behind_the_ownship_have_passed():
    """Both move away from the ownship all the time, and meet after 25 s."""
    level = {**crooked.ROLLING, "up_m": 40.0, "climb_mps": 3.0}
    targets = [
        {**level, "name": "east", "east_m": 600.0, "north_m": 1600.0, "heading_deg": 90.0},
        {**level, "name": "west", "east_m": 3600.0, "north_m": 1650.0, "heading_deg": 270.0},
    ]
    found = []
    for between in ("ownship and others", "any two"):
        end_s = expected_s(looks_s(), after_s=3, targets=targets, between=between)
        keys = {"after_s": 3, "between": between}
        assert run(scene(targets, **keys)).info["duration_s"] == end_s
        found.append(end_s)
    assert found[0] < 10.0 < 25.0 < found[1] < MEANT_S


#: A target that is passed, turns round fast and comes nearer than before, but later.
BACK = {
    **crooked.DIVING, "climb_mps": 0.0, "up_m": -40.0, "heading_deg": 300.0, "speed_mps": 150,
    "legs": [
        {"kind": "straight", "duration_s": 15},
        {"kind": "turn", "rate_deg_s": -25, "angle_deg": 200},
        {"kind": "straight"},
    ],
}  # fmt: skip


def test_metrics_are_of_the_run_as_far_as_it_went():
    back = BACK
    early = scene([back], after_s=2)
    end_s = run(early).info["duration_s"]
    asked = ("closest_approach", {"metric": "well_clear", "horizontal_m": 2000, "vertical_m": 900})
    found, whole = measured(early, *asked), measured(scene([back], after_s=3600), *asked)
    assert found["closest_approach_time_s"] < end_s < whole["closest_approach_time_s"]
    assert found["closest_approach_m"] > whole["closest_approach_m"]
    targets = run(early).info["summary"]["targets"]
    assert targets["diving"]["closest_approach"]["time_s"] < end_s


@pytest.mark.parametrize("targets", [(BACK, crooked.ROLLING), (crooked.ROLLING, BACK)])
def test_the_first_of_several_losses_counts_up_to_the_end(targets):
    """Looked for between samples too; what is lost after the end is not."""

    def loss_s(after_s, horizontal_m=1500, **keys):
        asked = {"metric": "well_clear", "horizontal_m": horizontal_m, "vertical_m": 2000, **keys}
        return measured(scene(targets, after_s=after_s), asked)["well_clear_loss_time_s"]

    back_s, rolling_s = (loss_s(2, target=name) for name in ("diving", "rolling"))
    assert back_s + 5.0 < rolling_s
    assert loss_s(2) == back_s
    assert loss_s(3600, horizontal_m=800) == pytest.approx(25.7, abs=0.01)
    assert np.isnan(loss_s(2, horizontal_m=800))


def test_an_end_is_early_only_if_it_is(tmp_path):
    """Of one who comes nearer all the time: the closest approach is at the end."""
    behind = {**crooked.OWNSHIP, "name": "behind", "east_m": 700, "north_m": 0, "up_m": 9}
    for key in ("lat_deg", "lon_deg", "alt_m"):
        del behind[key]
    found = scene([{**behind, "heading_deg": 217.3}])
    (tmp_path / "scene.toml").write_text(to_toml(found), encoding="utf-8")
    base = load_scene(tmp_path / "scene.toml")
    metric = ClosestApproach(ClosestApproach.Parameters(), base)
    one = [Replica(1, {})]
    ran = replicas.run_replicas(base, one, wanted=needed_columns([metric]))
    told = metric.measure(Group(base, one, ran, needed_columns([metric])))
    assert told["closest_approach_cut_off"].tolist() == ["at the end of the run"]


@pytest.mark.parametrize("rules_s", [(3600.0, 2.0, 5.0, 3600.0, 8.0), (2.0, 3600.0, 3.0)])
def test_metrics_of_runs_that_end_differently(tmp_path, monkeypatch, rules_s):
    """Runs of a chunk share flights, batches and tables; each is measured as if it were alone."""
    monkeypatch.setattr(lock_step_size, "FEW", 0)
    monkeypatch.setattr(lock_step_size.RunSize, "largest_run_count", 2)
    wanted = scene([BACK, crooked.ROLLING])
    (tmp_path / "scene.toml").write_text(to_toml(wanted), encoding="utf-8")
    base = load_scene(tmp_path / "scene.toml")
    limits = {"horizontal_m": 2000, "vertical_m": 900}
    metrics = [
        ClosestApproach(ClosestApproach.Parameters(), base),
        WellClear(WellClear.Parameters(**limits), base),
        Severity(Severity.Parameters(**limits), base),
    ]

    def results(some):
        ran = replicas.run_replicas(base, some, wanted=needed_columns(metrics))
        rules = [one.changes["blocks.over.after_s"] for one in some]
        assert [run.ended_early for run in ran] == [rule < MEANT_S for rule in rules]
        group = Group(base, some, ran, needed_columns(metrics))
        return {k: v for metric in metrics for k, v in metric.measure(group).items()}

    runs = [Replica(k, {"blocks.over.after_s": rule}) for k, rule in enumerate(rules_s)]
    together, each = results(runs), [results([one]) for one in runs]
    for name, values in together.items():
        assert values.tolist() == pytest.approx([one[name][0] for one in each], nan_ok=True), name
    assert len({*together["closest_approach_m"]}) > 1


def test_who_is_gone_has_passed_and_who_is_yet_to_come_has_not(tmp_path):
    """One aircraft closes in until 6 s and is gone; another one comes at 15 s and flies away."""
    lines = ["time_s,id,lat_deg,lon_deg,alt_m", "0,own,-41.3,170,2400", "40,own,-41.3,170,2400"]
    lines += ["0,gone,-41.2,170,2500", "6,gone,-41.25,170,2500"]
    lines += ["15,late,-41.2,170.1,2500", "40,late,-41.2,170.2,2500"]
    (tmp_path / "flights.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = scene(after_s=3)
    path = str(tmp_path / "flights.csv")
    found["blocks"]["traffic"] = {"type": "traffic.csv", "file": path, "ownship": "own"}
    # At 15 s it is there for the first time; from then on it goes, for 3 s and more.
    assert run(found).info["duration_s"] == 18.0
    for window in (1, 5):  # it remembers who has been there
        assert simulated(found, tmp_path, window=window).run().duration_s == 18.0


@pytest.mark.parametrize("window", [None, 1])
def test_nobody_runs_at_the_end(tmp_path, window):
    """A radar whose first scan is at that instant, and hears of it without waiting for anybody."""
    found = scene(after_s=2)
    end_s = run(found).info["duration_s"]
    found["blocks"]["radar"] |= {"offset_s": end_s, "declare_m": 1, "declare_n": 1}
    found["wires"].remove("gate -> radar")
    found["wires"].append({"from": "gate", "to": "radar", "delay_s": 0.1})
    simulation = simulated(found, tmp_path, window=window)
    assert simulation.run().report["declarations"] == {"radar": {}}


def simulated(tables, tmp_path, **options):
    path = tmp_path / "scene.toml"
    path.write_text(to_toml(tables), encoding="utf-8")
    return Simulation(load_scene(path), **options)


@pytest.mark.parametrize("processor", [None, "cpu"])
def test_shared_processors_are_refused_by_name(processor):
    queued = {**scene(), "processors": {"cpu": {"service_s": 0.01}}}
    if processor is not None:
        queued["blocks"]["tracker"]["processor"] = processor
    with pytest.raises(dsa_des.SceneError, match=r"blocks\.over\.type.*shared processors"):
        run(queued)
