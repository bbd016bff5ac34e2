"""The ownship turns out of the bands of guidance, and what its keys change."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run

KIND = ("avoidance.daidalus",)
CONF = """\
alerters = small, large
turn_rate = {rate} [deg/s]
min_horizontal_recovery = 1 [m]
min_vertical_recovery = 1 [m]
small_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
small_d_WCV_DTHR = 500 [m]
small_d_WCV_ZTHR = 80 [m]
small_d_WCV_TTHR = 0 [s]
small_alert_1_detector = d
small_alert_1_region = MID
small_alert_1_alerting_time = 60 [s]
small_alert_2_detector = d
small_alert_2_region = NEAR
small_alert_2_alerting_time = 35 [s]
large_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
large_d_WCV_DTHR = 1500 [m]
large_d_WCV_ZTHR = 250 [m]
large_d_WCV_TTHR = 0 [s]
large_alert_1_detector = d
large_alert_1_region = MID
large_alert_1_alerting_time = 60 [s]
large_alert_2_detector = d
large_alert_2_region = NEAR
large_alert_2_alerting_time = 35 [s]
corrective_region = MID
"""
OWNSHIP = {
    "lat_deg": -41.3, "lon_deg": 174.2, "alt_m": 900, "heading_deg": 217, "speed_mps": 50,
    "climb_mps": 0.5,
}  # fmt: skip


def ahead(forward_m: float, right_m: float) -> dict[str, float]:
    """Offsets east and north of a place ahead and to the right of the ownship."""
    heading = math.radians(OWNSHIP["heading_deg"])
    return {
        "east_m": forward_m * math.sin(heading) + right_m * math.cos(heading),
        "north_m": forward_m * math.cos(heading) - right_m * math.sin(heading),
    }


def scene(tmp_path: Path, rate_deg_s: float = 3, delay_s: float = 1, **keys: Any) -> Any:
    """Head-on, 40 m to the right: the shorter way out is to the left."""
    path = tmp_path / "two.conf"
    path.write_text(CONF.format(rate=rate_deg_s), encoding="utf-8")
    target = {
        "name": "head_on", **ahead(9000.0, 40.0), "up_m": 30.0, "heading_deg": 37.0,
        "speed_mps": 60.0, "climb_mps": 0.5,
    }  # fmt: skip
    found = chain({}, ownship=OWNSHIP, targets=[target], duration_s=100)
    found["blocks"] = {"traffic": found["blocks"]["traffic"]}
    conf = {"conf": str(path)}
    found["blocks"]["alerting"] = {"type": "alerting.daidalus", "scan_rate_hz": 1, **conf}
    found["blocks"]["avoidance"] = {"type": "avoidance.daidalus", **conf, **keys}
    found["wires"] = [
        "traffic -> alerting -> avoidance",
        {"from": "avoidance", "to": "traffic", "delay_s": delay_s, "holds": "nothing"},
    ]
    return found


def turns(found: Any) -> list[tuple[float, float]]:
    """Time and change of heading in degrees of each manoeuvre."""
    return [(row["time_s"], math.degrees(row["turn_rad"])) for row in rows(found, "manoeuvres")]


@covers("conf", "alerter", of=KIND)
def test_the_nearer_edge_of_the_band_is_flown(tmp_path):
    small, large = (turns(run(scene(tmp_path, alerter=k))) for k in (1, 2))
    (small_s, small_deg), (large_s, large_deg) = small[0], large[0]
    assert small_s == large_s
    # By the closing geometry: the miss distance must grow from 40 m to the radius.
    range_m = 9000.0 - 110.0 * small_s
    assert -20.0 < small_deg < -math.degrees(math.asin(500.0 / range_m))
    assert large_deg < 2.0 * small_deg < 0.0


def test_the_turn_keeps_the_ownship_clear(tmp_path):
    found = run(scene(tmp_path, level=1))
    first_s, first_deg = turns(found)[0]
    assert 10.0 < first_s < 30.0 and first_deg < 0.0
    assert max(row["level"] for row in rows(found, "alerts")) == 1
    last = rows(found, "alerts")[-1]
    assert last["level"] == 0 and last["closest_horizontal_m"] > 500.0


@covers("level", of=KIND)
def test_it_waits_for_the_level(tmp_path):
    early, late = (turns(run(scene(tmp_path, level=k)))[0] for k in (1, 2))
    assert early[0] < late[0] - 15.0
    assert abs(early[1]) < abs(late[1])


@covers("beyond_deg", of=KIND)
def test_it_turns_beyond_the_edge(tmp_path):
    to_edge = turns(run(scene(tmp_path, level=1)))[0]
    beyond = turns(run(scene(tmp_path, level=1, beyond_deg=12.5)))[0]
    assert beyond[0] == to_edge[0]
    assert beyond[1] == pytest.approx(to_edge[1] - 12.5)


@covers("pause_s", of=KIND)
def test_it_pauses_between_turns(tmp_path):
    """Turns that come late are not foreseen: what is told again comes on top of them."""
    for pause_s in (4, 9):
        when = [t for t, _ in turns(run(scene(tmp_path, delay_s=10, level=1, pause_s=pause_s)))]
        assert len(when) > 1
        assert min(np.diff(when)) == pause_s


def test_it_turns_as_fast_as_the_configuration_says(tmp_path):
    found = run(scene(tmp_path, rate_deg_s=1.5))
    assert {round(math.degrees(row["rate_rad_s"]), 9) for row in rows(found, "manoeuvres")} == {1.5}


@covers("manoeuvre", "beyond_m", of=KIND)
def test_it_climbs_out_of_the_band_of_altitudes(tmp_path):
    """30 m above us and climbing as we do: the way out is down, by the volume's half height."""
    to_edge, beyond = (
        rows(run(scene(tmp_path, level=1, manoeuvre="climb", beyond_m=m)), "manoeuvres")[0]
        for m in (0.0, 37.0)
    )
    assert to_edge["turn_rad"] == to_edge["rate_rad_s"] == 0.0
    assert to_edge["climb_rate_mps"] == pytest.approx(500 * 0.3048 / 60)
    own_m = 900.0 + 0.5 * to_edge["time_s"]
    # Altitudes are on a grid of 100 ft; the intruder goes on climbing while we go down.
    assert -80.0 < to_edge["climb_m"] < -50.0 + 0.5 * 60
    assert (own_m + to_edge["climb_m"]) / 30.48 == pytest.approx(
        round((own_m + to_edge["climb_m"]) / 30.48), abs=0.4
    )
    assert beyond["time_s"] == to_edge["time_s"]
    assert beyond["climb_m"] == pytest.approx(to_edge["climb_m"] - 37.0)


def across(tmp_path: Path, **keys: Any) -> Any:
    """From the right, 400 m below and climbing to us: at our place after 100 s."""
    found = scene(tmp_path, level=1, **keys)
    heading = math.radians(217 - 90)
    found["blocks"]["traffic"]["intruders"] = [{
        "name": "across", "up_m": 30.0, "heading_deg": 127.0, "speed_mps": 60.0, "climb_mps": 0.5,
        **{k: v - 6000.0 * f(heading) for (k, v), f in zip(
            ahead(5000.0, 0.0).items(), (math.sin, math.cos), strict=True)},
    }]  # fmt: skip
    return found


@covers("manoeuvre", "beyond_mps", of=KIND)
@pytest.mark.parametrize("kind", ["speed", "vertical_speed"])
def test_it_changes_a_speed_out_of_the_band(tmp_path, kind):
    """The change is at least what a straight flight needs that flies so from then on."""
    to_edge, beyond = (
        rows(run(across(tmp_path, manoeuvre=kind, beyond_mps=v)), "manoeuvres")[0]
        for v in (0.0, 3.5)
    )
    name = f"{kind}_mps"
    assert to_edge["turn_rad"] == to_edge["climb_m"] == 0.0
    others = {"speed_mps", "vertical_speed_mps"} - {name}
    assert all(to_edge[other] == 0.0 for other in others)
    change = to_edge[name]
    assert beyond["time_s"] == to_edge["time_s"]
    assert beyond[name] == pytest.approx(change + math.copysign(3.5, change))
    left_s = 100.0 - to_edge["time_s"]
    if kind == "speed":
        # They pass at right angles: what comes late or early by t passes at 60 t sin(angle).
        late_m = abs(change) * left_s * 60.0 / math.hypot(60.0, 50.0 + change)
        assert to_edge["acceleration_mps2"] == 2.0
        assert 500.0 < late_m < 900.0
    else:
        # 30 m above us: 80 m of height apart, while within 500 m.
        assert to_edge["vertical_acceleration_mps2"] == pytest.approx(0.25 * 9.80665)
        assert change < 0.0 and 50.0 < -change * (left_s - 7.0) < 120.0


@pytest.mark.parametrize("kind", ["speed", "vertical_speed"])
def test_speeds_that_are_told_are_flown(tmp_path, kind):
    """By the recorded truth: along the track or upward, faster than before by what was told."""
    loop = across(tmp_path, manoeuvre=kind)
    loop["duration_s"] = 60
    found = run(loop)
    told = rows(found, "manoeuvres")
    assert len(told) == 1
    flown = [row for row in rows(found, "truth") if row["target"] is None]
    first, last = flown[0], flown[-1]

    def speeds(row: dict[str, float]) -> tuple[float, float]:
        level = math.hypot(row["velocity_north_m_s"], row["velocity_east_m_s"])
        return level, -row["velocity_down_m_s"]

    level, climb = 50.0 + told[0]["speed_mps"], 0.5 + told[0]["vertical_speed_mps"]
    assert speeds(first) == pytest.approx((50.0, 0.5), abs=0.01)
    assert speeds(last) == pytest.approx((level, climb), abs=0.02)
