"""Blocks that are wired legally and can do nothing: check, the summary and the study say so."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from same_runs import replicas_of
from wired import SEES_ALL, chain

import dsa_des
from components.display.terminal import print_run_summary
from dsa_des.cli import main
from dsa_des.record.failure_counts import failure_sentences, sum_failure_counts
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation
from dsa_des.terminal.terminal import capture_text
from tests.alerting.conf_text import CONF

TARGETS = [
    {"name": name, "north_m": north, "east_m": 900.0, "heading_deg": 180.0, "speed_mps": 50.0}
    for name, north in (("near", 2000.0), ("far", 9000.0))
]
SCENE = """\
duration_s = 30
wires = ["traffic -> alerting"]
[blocks.traffic]
type = "traffic.scripted"
ownship = {lat_deg = 45, lon_deg = 7, alt_m = 900, speed_mps = 40, heading_deg = 0}
[[blocks.traffic.intruders]]
name = "near"
north_m = 2000
east_m = 0
up_m = 0
speed_mps = 50
heading_deg = 180
[blocks.alerting]
type = "alerting.daidalus"
conf = "two.conf"
scan_rate_hz = "1/20"
"""
STUDY = """\
scene = "scene.toml"
replicas = 5
runs_per_chunk = 2
metrics = ["alert_times"]
"""
NO_VELOCITY = "who is there has no velocity yet and is not judged"
NO_RANGE = "what it hears of has no range and is not judged"


def alone(tmp_path: Path, duration_s: float = 30.0, conf: str = CONF, **keys: Any) -> Any:
    """Return a scene of traffic and an alerting that is told the truth."""
    path = tmp_path / "two.conf"
    path.write_text(conf, encoding="utf-8")
    found = chain({}, targets=TARGETS, duration_s=duration_s)
    found["blocks"] = {"traffic": found["blocks"]["traffic"]}
    found["blocks"]["alerting"] = {
        "type": "alerting.daidalus", "conf": str(path), "scan_rate_hz": 1, **keys,
    }  # fmt: skip
    found["wires"] = ["traffic -> alerting"]
    return found


def failure_counts(scene: Any) -> Mapping[str, Any]:
    loaded = dsa_des.load_scene(scene) if isinstance(scene, dict) else scene
    return Simulation(loaded).run().failure_counts


def notes(scene: Any) -> list[str]:
    return notes_of_scene(Simulation(dsa_des.load_scene(scene)))


def test_who_has_no_velocity_is_counted(tmp_path: Path) -> None:
    """Two targets at each scan; at the first nobody's velocity is known."""
    assert failure_counts(alone(tmp_path)) == {"alerting": {NO_VELOCITY: (2, 60)}}
    assert failure_counts(alone(tmp_path, scan_rate_hz="1/20")) == {
        "alerting": {NO_VELOCITY: (2, 4)}
    }
    once = alone(tmp_path, scan_rate_hz="1/40", offset_s=3)
    assert failure_counts(once) == {"alerting": {NO_VELOCITY: (2, 2)}}
    assert [note for note in notes(once) if "which tells no velocity" in note] == [
        "blocks.alerting: scan_rate_hz is 0.025: in 30 s it scans once, which tells no velocity"
    ]
    assert not any("velocity" in note for note in notes(alone(tmp_path, scan_rate_hz="1/20")))


def test_the_summary_says_it_with_its_share(tmp_path: Path) -> None:
    run = dsa_des.run(alone(tmp_path, scan_rate_hz="1/20"))
    assert run.summary["undone"] == {"alerting": {NO_VELOCITY: (2, 4)}}
    said = f"alerting: {NO_VELOCITY}: 2 of 4 (50 %)"
    assert said in capture_text(lambda console: print_run_summary(console, run.summary))
    assert "undone" not in dsa_des.run(alone(tmp_path)).summary  # 2 of 60 is no news


@pytest.mark.parametrize(
    ("tracker", "source"),
    [("tracking.hold_last", "tracker"), ("tracking.ekf", "tracker"), (None, "fusion")],
)
def test_what_has_no_range_is_counted(tmp_path: Path, tracker: str | None, source: str) -> None:
    """A camera alone tells lines of sight: nothing is ever judged of what it sees."""
    scene = alone(tmp_path)
    eyes = chain(
        {"eo": SEES_ALL}, targets=TARGETS, duration_s=30, fusion={"type": "fusion.pass_through"},
        tracker=None if tracker is None else {"type": tracker},
    )  # fmt: skip
    eyes["blocks"]["alerting"] = scene["blocks"]["alerting"]
    eyes["wires"] += ["traffic -> alerting", f"{source} -> alerting"]
    times, of = failure_counts(eyes)["alerting"][NO_RANGE]
    assert times == of > 30
    # In lock step each run counts, as often as by itself: of a shared block and of a split one.
    for change in ({}, {"blocks.alerting.fit_s": 2.0}):
        scenes = replicas_of(dsa_des.load_scene(eyes), {}, change)
        assert make_lockstep_simulation(scenes).run().failure_counts == sum_failure_counts(
            map(failure_counts, scenes)
        )


def test_a_block_that_nothing_wakes_is_named(tmp_path: Path) -> None:
    """What the traffic sends is longer on its way than the run lasts."""
    late = alone(tmp_path)
    late["wires"] = [{"from": "traffic", "to": "alerting"}]
    late["blocks"]["filter"] = {"type": "alerting.m_of_n"}
    late["wires"].append({"from": "alerting", "to": "filter", "delay_s": 40})
    found = failure_counts(late)["filter"]
    assert found == {"it never ran, for nothing came at alerts": (1, 1)}
    loaded = dsa_des.load_scene(late)
    assert make_lockstep_simulation(replicas_of(loaded, {}, {})).run().failure_counts["filter"] == {
        "it never ran, for nothing came at alerts": (2, 2)
    }


def test_levels_that_never_come_and_memory_that_holds_nothing_are_noted(tmp_path: Path) -> None:
    conf = str(tmp_path / "two.conf")
    scene = alone(tmp_path, scan_rate_hz="1/10")
    scene["blocks"] |= {
        "filter": {"type": "alerting.m_of_n"},
        "bands": {"type": "guidance.daidalus", "conf": conf, "level": 4},
        "pilot": {"type": "operator.stochastic", "conf": conf, "level": 3, "warning_level": 3},
        "turns": {"type": "avoidance.daidalus", "conf": conf, "level": 3},
    }
    scene["wires"] += ["alerting -> filter -> bands", "filter -> turns", "alerting -> pilot"]
    found = "\n".join(notes(scene))
    for said in (
        "blocks.alerting: hysteresis_time is 5 s and scans are 10 s apart: no level is remembered",
        "blocks.filter: forget_s is 5 and the alerts come 10 s apart: every one is new",
        "blocks.bands: level is 4: the alerts it gets have 2 levels, so it does nothing",
        "blocks.pilot: level is 3: the alerts it gets have 2 levels, so it does nothing",
        "blocks.turns: level is 3: the alerts it gets have 2 levels, so it does nothing",
    ):
        assert said in found
    for name in ("bands", "pilot", "turns"):
        scene["blocks"][name]["level"] = 2
    scene["blocks"]["alerting"]["scan_rate_hz"] = 1
    assert not [note for note in notes(scene) if "does nothing" in note or "remembered" in note]


def test_a_configuration_without_regions_is_noted(tmp_path: Path) -> None:
    plain = CONF.replace("_region = NEAR", "_region = NONE")
    plain = plain.replace("1_region = MID", "1_region = NONE")
    scene = alone(tmp_path, conf=plain)
    conf = str(tmp_path / "two.conf")
    scene["blocks"] |= {
        "bands": {"type": "guidance.daidalus", "conf": conf},
        "turns": {"type": "avoidance.daidalus", "conf": conf},
    }
    scene["wires"] += ["alerting -> bands", "alerting -> turns"]
    found = "\n".join(notes(scene))
    assert "blocks.bands: no level of the alerter One_Two has a region: no bands" in found
    assert "(corrective_region) or a worse one: no band is red, so it never steers" in found


def test_a_study_says_it_of_all_its_runs(tmp_path: Path, monkeypatch: Any) -> None:
    """In its parts, so that it is there when the study is shown again."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "two.conf"
    path.write_text(CONF, encoding="utf-8")
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    arguments = ["study", "study.toml", "--workers", "1", "--out", "out", "--no-figures"]
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    said = f"alerting: {NO_VELOCITY}: 5 of 10 (50 %)"
    assert said in result.output
    assert said in CliRunner().invoke(main, ["study", "show", "out"]).output
    CliRunner().invoke(main, ["study", "report", "out", "--no-figures"], catch_exceptions=False)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert f"<li>{said}</li>" in page
    assert "<th scope='col'>note</th>" in page and "<td>few</td>" in page
    parts = sorted((tmp_path / "out" / "parts").glob("*.parquet"))
    assert len(parts) == 3
    assert b"dsa_des.about" in pq.read_schema(parts[0]).metadata


def test_counts_of_runs_add_up() -> None:
    found = sum_failure_counts([{"a": {"x": (1, 4)}}, {"a": {"x": (0, 6), "y": (1, 1)}, "b": {}}])
    assert found == {"a": {"x": (1, 10), "y": (1, 1)}}
    assert failure_sentences(found) == ["a: x: 1 of 10 (10 %)", "a: y: 1 of 1 (100 %)"]
    assert failure_sentences({"a": {"x": (1, 11), "y": (9999, 10000)}}) == [
        "a: y: 9,999 of 10,000 (99.9 %)"
    ]
