"""From a set of encounters through a closed loop to a risk ratio."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import dsa_des
from components.metrics.risk import risk_ratio
from tests.encounters.test_set_file import call

RECIPE = """\
closest_s = 40
duration_s = 60
horizontal_m = { uniform = [-250, 250] }
vertical_m = 10
bearing_deg = { uniform = [-40, 40] }
own_speed_mps = 50
intruder_speed_mps = 60
count = 8
"""
SCENE = """\
duration_s = 60
wires = [
  "traffic -> transform -> gate -> radar -> fusion -> tracker -> avoidance",
  { from = "avoidance", to = "traffic", delay_s = 1, holds = "nothing" },
]
[blocks]
traffic = { type = "traffic.encounters", file = "set.parquet" }
transform = { type = "geometry.ellipsoid" }
gate = { type = "gate" }
radar = { type = "radar.range_boundary", scan_rate_hz = 1, range_km = 5 }
fusion = { type = "fusion.pick_best" }
tracker = { type = "tracking.stub" }
avoidance = { type = "avoidance.turn_away", range_km = 2, turn_deg = 60 }
"""
STUDY = """\
scene = "scene.toml"
replicas = 8
runs_per_chunk = 8
metrics = ["encounter_weight", "mitigated"]
[axes]
blocks.radar.range_km = [0.3, 5]
[draws]
blocks.traffic.encounter = { sequence = [0, 1] }
"""


def test_a_radar_that_sees_far_leaves_less_risk(tmp_path: Path) -> None:
    for name, text in (("made", RECIPE), ("scene", SCENE), ("study", STUDY)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    made = call("generate", "--made", tmp_path / "made.toml", "--out", tmp_path / "set.parquet")
    assert made.exit_code == 0
    dsa_des.study(tmp_path / "study.toml", out=tmp_path / "out", workers=1)
    found = pq.read_table(tmp_path / "out" / "parts").to_pydict()
    assert found["error"] == [None] * 16
    # Without manoeuvres both ranges meet the same encounters; a short-sighted one comes too late.
    assert found["nmac_nominal"][:8] == found["nmac_nominal"][8:]
    names = ("--nominal", "nmac_nominal", "--mitigated", "nmac_mitigated", "--weight",
             "encounter_weight")  # fmt: skip
    told = json.loads(call("risk", tmp_path / "out", *names, "--by", "radar.range_km",
                           "--json").stdout)  # fmt: skip
    short, far = told["classes"]["0.3"], told["classes"]["5.0"]
    assert far["ratio"] < short["ratio"]
    by_hand = risk_ratio(*(found[name] for name in names[1::2]))
    assert told["ratio"] == pytest.approx(by_hand.ratio)
    done = call("risk", tmp_path / "out", *names, "--by", "radar.range_km,cell")
    assert done.exit_code == 0 and "0.3, 0" in done.stdout


def test_folders_that_are_no_studies(tmp_path: Path) -> None:
    names = ("--nominal", "a", "--mitigated", "b")
    done = call("risk", tmp_path, *names)
    assert done.exit_code == 2 and "is no folder of a study" in done.stderr
