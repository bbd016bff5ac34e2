"""Risk ratios of a study over a set whose encounters differ in weight, family and class."""

import math
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import dsa_des
from dsa_des.studies.ratio import paired_ratio
from tests.encounters.test_closed_loop_risk import SCENE

STUDY = """\
scene = "scene.toml"
replicas = 6
metrics = [{ metric = "risk_ratio", horizontal_m = 300, vertical_m = 90 }]
[draws]
blocks.traffic.encounter = { sequence = [0, 1] }
"""
#: Metres away at the start, course of the intruder less the ownship's, weight, family; from far
#: away there is time to turn, from near there is none.
ENCOUNTERS = [
    (4500.0, 180.0, 5.0, 3), (500.0, 180.0, 2.0, 1), (500.0, 90.0, 3.0, 2), (500.0, 90.0, 4.0, 2),
    (4500.0, 90.0, 6.0, 0), (4500.0, 90.0, 7.0, 5),
]  # fmt: skip


def table() -> pa.Table:
    """The ownship at 50 m/s on 217 degrees; each intruder meets it 20 m higher, the last 400 m."""
    rows, own = [], math.radians(217.0)
    for number, (away_m, turned_deg, weight, family) in enumerate(ENCOUNTERS):
        theirs = own + math.radians(turned_deg)
        closing = [50.0 * f(own) - 60.0 * f(theirs) for f in (math.cos, math.sin)]
        meets_s = away_m / math.hypot(*closing)
        for name, heading, speed, north, east, up in (
            ("own", own, 50.0, 0.0, 0.0, 0.0),
            (
                "other",
                theirs,
                60.0,
                closing[0] * meets_s,
                closing[1] * meets_s,
                400.0 if number == 5 else 20.0,
            ),
        ):
            rows.append({
                "encounter": number, "weight": weight, "aircraft": name, "north_m": north,
                "east_m": east, "altitude_m": 2000.0 + up, "speed_mps": speed,
                "heading_rad": heading % (2 * math.pi), "duration_s": 60.0, "time_s": [0.0],
                "climb_mps": [0.0], "turn_rad_s": [0.0], "acceleration_mps2": [0.0],
                "family": family,
            })  # fmt: skip
    return pa.Table.from_pylist(rows)


def test_weights_families_and_classes_count(tmp_path: Path) -> None:
    pq.write_table(table(), tmp_path / "set.parquet")
    for name, text in (("scene", SCENE), ("study", STUDY)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    dsa_des.study(tmp_path / "study.toml", out=tmp_path / "out", workers=1)
    runs = pq.read_table(tmp_path / "out" / "parts").to_pydict()
    assert runs["encounter_family"] == [3, 1, 2, 2, 0, 5]
    assert runs["nmac_nominal"] == [1] * 5 + [0]
    assert runs["nmac_mitigated"] == [0, 1, 1, 1, 0, 0]
    kinds = ["head-on"] * 2 + ["crossing from the left"] * 4
    assert runs["encounter_geometry"] == kinds
    found = {row["result"]: row for row in pq.read_table(tmp_path / "out" / "ratios.parquet")
             .to_pylist()}  # fmt: skip
    whole = found["nmac_risk_ratio"]
    assert whole["ratio"] == pytest.approx(9 / 20)
    assert (whole["encounters"], whole["clusters"]) == (6, 5)
    assert whole["effective_sample_size"] == pytest.approx(27**2 / (25 + 4 + 49 + 36 + 49))
    # By the paired delta method, with the two of a family added up first.
    error = math.sqrt(sum(x * x for x in (5 * 0.45, 2 * 0.55, 7 * 0.55, 6 * 0.45))) / 20
    assert whole["gamma_error"] == pytest.approx(error)
    by_hand = paired_ratio([1, 1, 1, 1, 0], [0, 1, 1, 0, 0], [5, 2, 7, 6, 7])
    assert (whole["gamma_low"], whole["gamma_high"]) == pytest.approx(by_hand.interval)
    assert found["nmac_risk_ratio.head-on"]["ratio"] == pytest.approx(2 / 7)
    left = found["nmac_risk_ratio.crossing_from_the_left"]
    assert left["ratio"] == pytest.approx(7 / 13)
    assert (left["encounters"], left["clusters"]) == (4, 3)
