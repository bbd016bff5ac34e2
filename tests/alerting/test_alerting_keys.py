"""Alert levels in scenes: from the truth, from fused rows and from tracks."""

import math
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import crooked
import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window
from wired import HEARS_ALL, chain, rows, run

import dsa_des
from components.alerting.daidalus import DaidalusAlerting
from dsa_des.errors import SceneError

KIND = ("alerting.daidalus",)
#: Two alerters of unequal sizes; the second's volume is larger.
CONF = """\
alerters = small, large
hysteresis_time = 5 [s]
persistence_time = 2.5 [s]
alerting_m = {m}
alerting_n = 3
small_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
small_d_WCV_DTHR = 500 [m]
small_d_WCV_ZTHR = 80 [m]
small_d_WCV_TTHR = 0 [s]
small_alert_1_detector = d
small_alert_1_region = NEAR
small_alert_1_alerting_time = 20 [s]
large_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
large_d_WCV_DTHR = 900 [m]
large_d_WCV_ZTHR = 250 [m]
large_d_WCV_TTHR = 0 [s]
large_alert_1_detector = d
large_alert_1_region = NEAR
large_alert_1_alerting_time = 20 [s]
"""
#: From ahead on the right, 120 m higher: inside the large volume some time, never in the small.
TARGET = {
    "name": "meets", "east_m": -1500.0, "north_m": -1500.0, "up_m": 120.0, "heading_deg": 50.0,
    "speed_mps": 70.0, "climb_mps": crooked.OWNSHIP["climb_mps"],
}  # fmt: skip


def scene(tmp_path: Path, *wires: str, m: int = 0, duration_s: float = 6, **keys: Any) -> Any:
    path = tmp_path / "two.conf"
    path.write_text(CONF.format(m=m), encoding="utf-8")
    radar = {
        **HEARS_ALL, "scan_rate_hz": 4, "azimuth_resolution_deg": 1e-4,
        "elevation_resolution_deg": 1e-4, "range_resolution_m": 1e-3,
    }  # fmt: skip
    found = chain(
        {"radar": radar}, targets=[TARGET], duration_s=duration_s,
        fusion={"type": "fusion.pick_best"}, tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found["blocks"]["alerting"] = {
        "type": "alerting.daidalus", "scan_rate_hz": 2, "conf": str(path), "alerter": 2, **keys,
    }  # fmt: skip
    found["wires"] += ["traffic -> alerting", *wires]
    return found


def alerts(*arguments: Any, **keys: Any) -> list[dict[str, Any]]:
    return rows(run(scene(*arguments, **keys)), "alerts")


def truth(time_s: float) -> np.ndarray:
    """East, north, up of the target and its velocity at a time, by pymap3d."""
    step_s = 0.01
    ahead, behind = (crooked.ned(TARGET, time_s + k * step_s) for k in (1, -1))
    north, east, down = crooked.ned(TARGET, time_s)
    v_north, v_east, v_down = (np.array(ahead) - np.array(behind)) / (2 * step_s)
    return np.array([east, north, -down, v_east, v_north, -v_down])


def entry_s(state: np.ndarray, radius_m: float) -> float:
    """When a flight enters a circle, by the textbook root."""
    s, v = state[:2], state[3:5]
    p, a = s @ v, v @ v
    return float((-p - math.sqrt(p * p - a * (s @ s - radius_m**2))) / a)


@covers("conf", "alerter", of=KIND)
@pytest.mark.parametrize("wires", [(), ("fusion -> alerting",), ("tracker -> alerting",)])
def test_the_times_are_those_of_the_true_flights(tmp_path, wires):
    found = alerts(tmp_path, *wires)
    assert {row["target"] for row in found} == {"meets"}
    assert found[-1]["time_s"] == 5.5
    for row in found:
        wanted = entry_s(truth(row["time_s"]), 900.0)
        assert 1.0 < wanted < 20.0
        # The plane of the projection is up to 0.4 % off, and lines through curves a little.
        assert row["time_to_level_1_s"] == pytest.approx(wanted, rel=0.02)
        assert row["level"] == 1
        assert row["time_to_level_2_s"] is None
        assert row["closest_vertical_m"] == pytest.approx(120.0, abs=3.0)
    small = alerts(tmp_path, *wires, alerter=1)
    assert {(row["level"], row["time_to_level_1_s"]) for row in small} == {(0, None)}


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s", of=KIND)
def test_it_looks_when_its_own_clock_says(tmp_path):
    """At the first scan there is a position of one instant only, and no flight yet."""

    def times(**keys: Any) -> list[float]:
        return [row["time_s"] for row in alerts(tmp_path, duration_s=2, **keys)]

    assert times(scan_rate_hz=2) == [0.5, 1.0, 1.5]
    assert times(scan_rate_hz=2, offset_s=0.1) == pytest.approx([0.1, 0.6, 1.1, 1.6])
    fast = times(scan_rate_hz=2, rate_error_ppm=250_000)
    assert fast == pytest.approx([0.4, 0.8, 1.2, 1.6])
    shaken = np.array(times(scan_rate_hz=50, jitter_s=0.002))
    off = shaken - np.round(shaken * 50) / 50
    assert 0.001 < np.std(off) < 0.003


@covers("hysteresis", of=KIND)
def test_memory_delays_the_first_of_two_of_three(tmp_path):
    """The first level counts at once; after the target vanishes and comes, it is remembered."""
    late = {**TARGET, "name": "later"}
    changed = scene(tmp_path, m=2, duration_s=6)
    without = scene(tmp_path, m=2, duration_s=6, hysteresis=False)
    for one in (changed, without):
        # Turning towards the ownship on the way, so that its level comes while it is known.
        one["blocks"]["traffic"]["intruders"] = [
            {**late, "heading_deg": 230.0, "legs": [
                {"kind": "straight", "duration_s": 2},
                {"kind": "turn", "rate_deg_s": 180, "angle_deg": 180},
                {"kind": "straight"},
            ]},
        ]  # fmt: skip
        one["blocks"]["alerting"]["fit_s"] = 0.6
    begins = [
        min(row["time_s"] for row in rows(run(one), "alerts") if row["level"] == 1)
        for one in (changed, without)
    ]
    assert begins[0] == begins[1] + 0.5


@covers("fit_s", of=KIND)
def test_a_flight_is_forgotten_when_its_positions_are_old(tmp_path):
    def last(fit_s: float) -> float:
        gone = scene(tmp_path, duration_s=6, fit_s=fit_s)
        gone["blocks"]["traffic"]["intruders"] = [{**TARGET, "end_time_s": 2.1}]
        return max(row["time_s"] for row in rows(run(gone), "alerts"))

    assert (last(0.9), last(2.4)) == (2.5, 3.5 + 0.5)


@pytest.mark.parametrize(
    ("keys", "begins_s"),
    [({"scan_rate_hz": "1/4"}, 4.0), ({"scan_rate_hz": 1, "fit_s": 0.1}, 1.0)],
)
def test_the_last_two_poses_count_however_far_apart_they_are(tmp_path, keys, begins_s):
    """Of the truth at its own slow clock it knows no more; it once judged nothing, and said so
    nowhere."""
    alone = scene(tmp_path, duration_s=9, **keys)
    alone["blocks"] = {name: alone["blocks"][name] for name in ("traffic", "alerting")}
    alone["wires"] = ["traffic -> alerting"]
    found = rows(run(alone), "alerts")
    step_s = 1 / float(Fraction(keys["scan_rate_hz"]))
    assert [row["time_s"] for row in found] == np.arange(begins_s, 9, step_s).tolist()
    for row in found:
        state = truth(row["time_s"])
        assert row["level"] == 1
        if (wanted := max(entry_s(state, 900.0), 0.0)) > 0.5:
            assert row["time_to_level_1_s"] == pytest.approx(wanted, rel=0.03)


def test_a_flight_known_from_a_slow_sensor_is_carried_on_until_its_next_look(tmp_path):
    """A radar at 0.25 Hz lets it be known from its second look on; one that is not renewed is
    forgotten after as long as there was between the last two."""

    def times(**target: Any) -> list[float]:
        slow = scene(tmp_path, "fusion -> alerting", duration_s=16, scan_rate_hz=1)
        slow["blocks"]["radar"]["scan_rate_hz"] = "1/4"
        slow["blocks"]["traffic"]["intruders"] = [{**TARGET, **target}]
        loaded = dsa_des.load_scene(slow)
        if not target:
            same_as_alone(replicas_of(loaded, {}, {"blocks.radar.offset_s": 0.7}))
        alerts = same_in_any_window(loaded)["alerts"]
        return list(alerts["time_s"].to_pylist())

    assert times() == [float(t) for t in range(4, 16)]
    assert times(end_time_s=5.0) == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert times(end_time_s=3.0) == []


@pytest.mark.parametrize("wires", [(), ("fusion -> alerting",), ("tracker -> alerting",)])
def test_windows_change_no_byte(tmp_path, monkeypatch, wires):
    """Scan by scan, with messages that come late, the rows are those of a window."""
    late = [{"from": wire.split()[0], "to": "alerting", "delay_s": 0.13} for wire in wires]
    one = scene(tmp_path, *late, m=2)
    at_once = rows(run(one), "alerts")
    monkeypatch.setattr(DaidalusAlerting, "windowed", False)
    assert rows(run(one), "alerts") == at_once
    assert len(at_once) > 8


def test_an_ownship_that_is_known_late_changes_no_byte(tmp_path, monkeypatch):
    """With a shorter memory than the delay, only what has arrived counts, in windows too."""
    one = scene(tmp_path, "fusion -> alerting", m=2, fit_s=0.6)
    one["wires"].remove("traffic -> alerting")
    one["wires"].append({"from": "traffic", "to": "alerting", "delay_s": 0.7, "jitter_s": 0.2})
    at_once = rows(run(one), "alerts")
    monkeypatch.setattr(DaidalusAlerting, "windowed", False)
    assert rows(run(one), "alerts") == at_once
    assert len(at_once) > 4


def test_tracks_and_fused_rows_together_are_refused(tmp_path):
    with pytest.raises(SceneError, match="believes one of them"):
        run(scene(tmp_path, "fusion -> alerting", "tracker -> alerting"))


def test_an_alerter_that_is_not_there(tmp_path):
    with pytest.raises(SceneError, match="alerter is 3: it must be at most 2"):
        run(scene(tmp_path, alerter=3))


def test_a_bad_configuration_is_named(tmp_path):
    bad = scene(tmp_path)
    path = Path(bad["blocks"]["alerting"]["conf"])
    path.write_text(CONF.format(m=0).replace("= 500 [m]", "= 500"), encoding="utf-8")
    with pytest.raises(SceneError, match="small_d_WCV_DTHR has no unit"):
        run(bad)


def test_alerts_are_offered_with_their_levels_and_scan_time():
    parameters = SimpleNamespace(
        read_configuration=lambda: (None, SimpleNamespace(levels=[1, 2, 3])),
        scan_rate_hz=Fraction(5, 2),
    )
    offered = DaidalusAlerting.offer(SimpleNamespace(p=parameters), "alerts")
    assert (offered.levels, offered.period_s) == (3, 0.4)
