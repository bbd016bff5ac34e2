"""Alert times of an aircraft that overtakes the ownship, by hand from its closing speed."""

import math
from pathlib import Path
from typing import Any

import crooked
import pytest
from covering import covers
from wired import chain, measured

KIND = ("[metric alert_times]",)
CONF = """\
alerters = only
only_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
only_d_WCV_DTHR = 700 [m]
only_d_WCV_ZTHR = 250 [m]
only_d_WCV_TTHR = 0 [s]
only_alert_1_detector = d
only_alert_1_region = MID
only_alert_1_alerting_time = 20 [s]
only_alert_2_detector = d
only_alert_2_region = NEAR
only_alert_2_alerting_time = 12 [s]
"""
#: 1700 m behind on the ownship's course and 40 m/s faster: within 700 m at 25 s.
BEHIND_M, CLOSING_MPS = 1700.0, 40.0
LEVEL_1_S, LEVEL_2_S = 5.0, 13.0


def behind(name: str, metres: float, up_m: float) -> dict[str, Any]:
    heading = math.radians(crooked.OWNSHIP["heading_deg"])
    return {
        "name": name, "east_m": -metres * math.sin(heading), "north_m": -metres * math.cos(heading),
        "up_m": up_m, "heading_deg": crooked.OWNSHIP["heading_deg"],
        "speed_mps": crooked.OWNSHIP["speed_mps"] + CLOSING_MPS,
        "climb_mps": crooked.OWNSHIP["climb_mps"],
    }  # fmt: skip


def found(tmp_path: Path, *targets: dict[str, Any], **keys: Any) -> dict[str, Any]:
    path = tmp_path / "one.conf"
    path.write_text(CONF, encoding="utf-8")
    scene = chain({}, targets=targets or [behind("near", BEHIND_M, 60.0)], duration_s=40)
    scene["blocks"] = {
        "traffic": scene["blocks"]["traffic"],
        "alarm": {"type": "alerting.daidalus", "scan_rate_hz": 4, "conf": str(path)},
    }
    scene["wires"] = ["traffic -> alarm"]
    sizes = {"horizontal_m": 500, "vertical_m": 150, "nmac_horizontal_m": 300}
    metric = {"metric": "alert_times", **sizes, "nmac_vertical_m": 150, **keys}
    measures = measured(scene, metric)
    return {name.removesuffix(".alarm"): value for name, value in measures.items()}


@covers("level", "horizontal_m", "nmac_horizontal_m", of=KIND)
@pytest.mark.parametrize(("level", "first_s"), [(1, LEVEL_1_S), (2, LEVEL_2_S)])
def test_times_from_the_alert_to_what_it_warns_of(tmp_path, level, first_s):
    got = found(tmp_path, level=level)
    assert got["first_alert_time_s"] == pytest.approx(first_s + 0.25, abs=0.3)
    apart_m = math.hypot(BEHIND_M - CLOSING_MPS * got["first_alert_time_s"], 60.0)
    assert got["first_alert_range_m"] == pytest.approx(apart_m, abs=0.5)
    assert got["alert_to_loss_s"] == pytest.approx(30.0 - got["first_alert_time_s"], abs=0.15)
    assert got["alert_to_nmac_s"] == pytest.approx(35.0 - got["first_alert_time_s"], abs=0.15)
    assert (got["alert_missed"], got["alert_nuisance"]) == (0, 0)
    nearer = found(tmp_path, level=level, horizontal_m=400, nmac_horizontal_m=200)
    assert nearer["alert_to_loss_s"] == pytest.approx(got["alert_to_loss_s"] + 2.5, abs=0.15)
    assert nearer["alert_to_nmac_s"] == pytest.approx(got["alert_to_nmac_s"] + 2.5, abs=0.15)


@covers("late_s", of=KIND)
def test_an_alert_shortly_before_the_loss_is_late(tmp_path):
    assert [found(tmp_path, late_s=s)["alert_late"] for s in (16.0, 17.5)] == [0, 1]


@covers("surprise_s", of=KIND)
def test_a_level_soon_after_the_one_below_is_a_surprise(tmp_path):
    """8 s lie between levels 1 and 2."""
    assert [found(tmp_path, surprise_s=s)["alert_surprise"] for s in (7.0, 9.0)] == [0, 1]
    assert found(tmp_path, level=1, surprise_s=9.0)["alert_surprise"] == 0


@covers("vertical_m", "nmac_vertical_m", of=KIND)
def test_an_alert_for_what_passes_above_is_a_nuisance(tmp_path):
    got = found(tmp_path, vertical_m=50, nmac_vertical_m=50)
    assert (got["alert_nuisance"], got["alert_missed"], got["alert_late"]) == (1, 0, 0)
    assert math.isnan(got["alert_to_loss_s"]) and math.isnan(got["alert_to_nmac_s"])
    assert not math.isnan(found(tmp_path, vertical_m=70)["alert_to_loss_s"])
    assert not math.isnan(found(tmp_path, nmac_vertical_m=70)["alert_to_nmac_s"])


def test_a_loss_without_an_alert_is_missed(tmp_path):
    got = found(tmp_path, level=3)
    assert (got["alert_missed"], got["alert_late"], got["alert_nuisance"]) == (1, 1, 0)
    assert math.isnan(got["first_alert_time_s"]) and math.isnan(got["first_alert_range_m"])


@covers("target", of=KIND)
def test_one_target_may_count(tmp_path):
    two = behind("near", BEHIND_M, 60.0), behind("far", BEHIND_M + 400.0, 60.0)
    both, far = found(tmp_path, *two), found(tmp_path, *two, target="far")
    assert far["first_alert_time_s"] == pytest.approx(both["first_alert_time_s"] + 10, abs=0.3)
    assert far["first_alert_range_m"] == pytest.approx(both["first_alert_range_m"], abs=12.0)


@covers("step_s", of=KIND)
def test_distances_are_taken_so_often(tmp_path):
    """Between the tenths of a second at which scripted traffic knows its flights anyway."""
    fine = found(tmp_path, horizontal_m=499, step_s=0.05)
    assert fine["alert_to_loss_s"] + fine["first_alert_time_s"] == pytest.approx(30.05, abs=0.001)


@covers("steered", of=KIND)
def test_flights_may_be_those_as_flown(tmp_path):
    """Told to turn, the ownship is not flown over: then the alert was for nothing."""
    path = tmp_path / "one.conf"
    recovery = "min_horizontal_recovery = 1 [m]\nmin_vertical_recovery = 1 [m]\n"
    path.write_text(f"{CONF}{recovery}corrective_region = MID\n", encoding="utf-8")
    scene = chain({}, targets=[behind("near", BEHIND_M, 60.0)], duration_s=50)
    conf = {"conf": str(path)}
    scene["blocks"] = {
        "traffic": scene["blocks"]["traffic"],
        "alarm": {"type": "alerting.daidalus", "scan_rate_hz": 4, **conf},
        "avoidance": {"type": "avoidance.daidalus", **conf, "level": 1},
    }
    scene["wires"] = [
        "traffic -> alarm -> avoidance",
        {"from": "avoidance", "to": "traffic", "delay_s": 1, "holds": "nothing"},
    ]
    sizes = {"horizontal_m": 120, "vertical_m": 150, "nmac_horizontal_m": 60}
    nuisance = [
        measured(scene, {"metric": "alert_times", **sizes, "level": 1, "steered": steered})[
            "alert_nuisance.alarm"
        ]
        for steered in (False, True)
    ]
    assert nuisance == [0, 1]


@covers("tau_s", of=KIND)
def test_well_clear_may_be_lost_by_time(tmp_path):
    """At 40 m/s: (r² - D²) / (r v) is 6 s at r = 633 m, 26.7 s after the start."""
    got = found(tmp_path, tau_s=6.0)
    range_m = 0.5 * (240.0 + math.sqrt(240.0**2 + 4 * 500.0**2))
    lost_s = (BEHIND_M - range_m) / CLOSING_MPS
    assert got["first_alert_time_s"] + got["alert_to_loss_s"] == pytest.approx(lost_s, abs=0.05)
