"""Runs of a chunk differ in ownship, flight, manoeuvres and length; each counts as if alone."""

import math
from typing import Any

import crooked
import pytest
from test_alert_time_metric import CONF, behind
from test_mitigated_metric import RADAR, SIZES
from test_mitigated_metric import scene as closed_loop
from wired import chain, measured

import dsa_des
from components.encounters.ending import ClosestApproachPassed
from dsa_des.block.component import RunEnd
from dsa_des.block.wake import Wake
from dsa_des.files.toml_files import to_toml
from dsa_des.replicas import replicas
from dsa_des.replicas.changed_scene import Replica
from dsa_des.scene.scene import load_scene
from dsa_des.studies.metric import Group, find_metric, needed_columns

OWN, NEAR = "blocks.traffic.ownship.", "blocks.traffic.intruders[0]."
ASIDE_M = 504.0
GRID = {"azimuth_resolution_deg": 0.3, "elevation_resolution_deg": 0.3, "range_resolution_m": 10.0}
RANGE = "blocks.avoidance.range_km"


def groups(tmp_path: Any, scene: Any, changes: Any, *asked: tuple[str, dict[str, Any]]) -> Any:
    """Results of runs measured together, and of each alone, by name."""
    (tmp_path / "scene.toml").write_text(to_toml(scene), encoding="utf-8")
    base = load_scene(tmp_path / "scene.toml")
    kinds = [(find_metric(name), keys) for name, keys in asked]
    metrics = [kind(kind.Parameters(**keys), base) for kind, keys in kinds]
    wanted = needed_columns(metrics)

    def results(some: list[Replica]) -> dict[str, list[Any]]:
        group = Group(base, some, replicas.run_replicas(base, some, wanted=wanted), wanted)
        return {k: list(v) for metric in metrics for k, v in metric.measure(group).items()}

    runs = [Replica(k, change) for k, change in enumerate(changes)]
    return results(runs), [results([one]) for one in runs]


def as_alone(together: Any, each: Any) -> None:
    for name, values in together.items():
        alone = [one[name][0] for one in each]
        if isinstance(values[0], str) or values[0] is None:
            assert values == alone, name
        else:
            assert values == pytest.approx(alone, nan_ok=True, rel=1e-9), name


#: The first turns away in time and keeps clear; the second, elsewhere and slower, turns too late;
#: the third is turned by nobody, and the fourth flies as the second does, but turns sooner.
SLOW = {OWN + "speed_mps": 62.0, OWN + "lat_deg": -41.1, OWN + "heading_deg": 226.0}
CHANGES = (
    {RANGE: 1.3}, {**SLOW, RANGE: 0.5}, {RANGE: 0.01}, {**SLOW, RANGE: 0.7},
)  # fmt: skip


def test_each_ownship_flies_what_it_was_told(tmp_path):
    together, each = groups(
        tmp_path, closed_loop(), CHANGES,
        ("mitigated", SIZES), ("closest_approach", {}), ("well_clear", SIZES),
    )  # fmt: skip
    as_alone(together, each)
    assert len(set(together["closest_approach_m"])) == 4
    assert together["well_clear_lost"] == [0, 1, 1, 1]


def coming_back(**keys: Any) -> Any:
    """Scene of one who overtakes 504 m aside, turns round and comes head-on over the ownship.

    It passes at 10 s, turns from 40 s on a diameter of 504 m, and meets the ownship at 51 s.
    """
    found = closed_loop(**keys)
    flight = behind("back", 400.0, 50.0)
    heading = math.radians(crooked.OWNSHIP["heading_deg"])
    flight["east_m"] += ASIDE_M * math.cos(heading)
    flight["north_m"] -= ASIDE_M * math.sin(heading)
    flight["legs"] = [
        {"kind": "straight", "duration_s": 40},
        {"kind": "turn", "rate_deg_s": -25, "angle_deg": 180},
        {"kind": "straight"},
    ]
    found["blocks"]["traffic"] |= {"intruders": [flight], "sample_interval_s": 100.0}
    return found


def ending(found: Any, after_s: float) -> Any:
    """A scene whose run ends so long after everybody has passed."""
    found["blocks"]["over"] = {"type": "encounters.closest_approach_passed", "after_s": after_s}
    found["wires"].append("traffic -> over")
    return found


@pytest.mark.parametrize(("after_s", "lost"), [(3.0, 1), (300.0, 0)])
def test_what_was_told_but_came_to_nobody_is_not_flown(after_s, lost):
    """Told at once, and 20 s under way; the run ends at 13 s, and the head-on pass is to come."""
    found = measured(
        ending(coming_back(delay_s=20), after_s),
        {"metric": "mitigated", **SIZES, "horizontal_m": 300.0},
    )  # fmt: skip
    assert (found["well_clear_lost_nominal"], found["well_clear_lost_mitigated"]) == (1, lost)


def test_the_class_of_each_is_of_its_own_length(tmp_path):
    """Overtaken by who is not yet back after 20 s, and met head-on in a minute."""
    lengths = ({"duration_s": 20}, {"duration_s": 60}, {"duration_s": 30})
    together, each = groups(tmp_path, coming_back(), lengths, ("risk_ratio", SIZES))
    as_alone(together, each)
    assert together["encounter_geometry"] == ["overtaking", "head-on", "overtaking"]


def test_who_flies_on_after_an_early_end_was_not_lost(tmp_path):
    """Nothing steers here, so alerts are held against the flights as far as the run went."""
    path, missed = tmp_path / "one.conf", []
    path.write_text(CONF, encoding="utf-8")
    for after_s in (3.0, 300.0):
        found = ending(coming_back(), after_s)
        blocks = found["blocks"]
        found["blocks"] = {name: blocks[name] for name in ("traffic", "over")}
        found["blocks"]["alarm"] = {
            "type": "alerting.daidalus",
            "scan_rate_hz": 0.05,
            "conf": str(path),
        }
        found["wires"] = ["traffic -> over", "traffic -> alarm"]
        sizes = {**SIZES, "horizontal_m": 300.0}
        got = measured(found, {"metric": "alert_times", **sizes, "level": 9})
        missed.append(got["alert_missed.alarm"])
    assert missed == [0, 1]


def test_the_first_scan_of_a_late_sensor_is_found_among_many_of_a_fast_one():
    late = {**RADAR, "scan_rate_hz": 1, "offset_s": 6}
    found = chain({"radar": RADAR, "late": late}, targets=[behind("near", 900.0, 50.0)],
                  duration_s=8)  # fmt: skip
    row = dsa_des.study(found, metrics=["first_detection"], replicas=1, workers=1).runs.to_pylist()[
        0
    ]
    assert row["first_detection_time_s.late"] == 6.0
    assert row["first_detection_cut_off.late"] == "at the start"


def test_of_several_at_one_instant_the_nearest_counts():
    """Wherever it stands."""
    metres = (900.0, 1200.0, 600.0, 800.0)
    for turn in range(4):
        order = metres[turn:] + metres[:turn]
        targets = [behind(f"n{k}", each, 50.0) for k, each in enumerate(order)]
        found = measured(chain({"radar": RADAR}, targets=targets, duration_s=2), "first_detection")
        assert found["first_detection_range_m.radar"] == pytest.approx(602.0, abs=1.0)


class EndsAtOnce(ClosestApproachPassed):
    """Ends its run at its first instant."""

    def run(self, wake: Wake) -> RunEnd:
        """End it."""
        return RunEnd(wake.ticks)


def test_a_run_of_no_length_has_no_rates_and_no_traceback():
    found = chain(
        {"radar": {**RADAR, **GRID}},
        targets=[behind("near", 900.0, 50.0)],
        duration_s=8,
        fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.ekf"},
    )
    ending(found, 3.0)["blocks"]["over"]["type"] = f"{__name__}:EndsAtOnce"
    metrics = ["tracking", "closest_approach", "well_clear", "first_detection", "severity"]
    row = dsa_des.study(found, metrics=metrics, replicas=1, workers=1).runs.to_pylist()[0]
    assert row["error"] is None
    assert row["track_false_per_hour"] is None


def test_the_share_of_jittering_clocks_is_not_foretold_of_runs_that_may_end():
    def expected(early: bool) -> Any:
        slow = {**RADAR, "scan_rate_hz": 2}
        sensors = {"radar": {**slow, "jitter_s": 0.01}, "other": slow}
        found = chain(sensors, targets=[behind("near", 900.0, 50.0)], duration_s=8,
                      fusion={"type": "fusion.pick_best", "coincidence_s": 0.02})  # fmt: skip
        if early:
            ending(found, 3.0)
        summary = dsa_des.study(found, metrics=["fused_share"], replicas=1, workers=1).summary
        return [row["expected"] for row in summary.to_pylist()]

    assert all(value > 0.0 for value in expected(False))
    assert expected(True) == [None, None]
