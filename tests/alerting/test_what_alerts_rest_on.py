"""What an alerting block tells with its levels: each track's own state, deviations and margins."""

import math

import crooked
import numpy as np
import pytest
from test_alerting_keys import CONF, TARGET, entry_s, truth
from test_alerting_keys import scene as alerting_scene
from test_alerts_of_estimates import PLAIN, scene
from wired import rows, run

from components.alert_configuration.conf_file import read_conf
from components.alerting.believed_tracks import EstimatedFlights
from components.alerting.daidalus import DaidalusAlerting
from components.messages.state_tracks import COVARIANCE
from components.well_clear.detection import Bounds, uncertain_violation_span
from components.well_clear.volume import Volume
from dsa_des.arrays.run_ticks import RunTicks

#: No two scores are alike, and a part of the velocity's counts at the distance of the targets.
SCORES = """\
h_pos_z_score = 1.5
v_pos_z_score = 2.5
h_vel_z_score_min = 0.5
h_vel_z_score_max = 4
h_vel_z_distance = 6 [km]
v_vel_z_score = 3.5
"""
HEEDED = SCORES + PLAIN.replace("WCV_TCPA", "WCV_TAUMOD_SUM")
#: It turns to the right, so that its velocity of some seconds ago is another.
TURNING = {
    key: value for key, value in crooked.OWNSHIP.items()
    if key not in ("climb_mps", "yaw_deg", "pitch_deg", "roll_deg")
} | {"legs": [{"kind": "turn", "rate_deg_s": 4.0}]}  # fmt: skip
#: Farther, lower, and there later than the other.
LATE = {
    **TARGET, "name": "late", "east_m": -2600.0, "north_m": 900.0, "up_m": -260.0,
    "heading_deg": 120.0, "climb_mps": -4.0, "start_time_s": 1.2,
}  # fmt: skip
#: Inside the volume from the side, and soon from above: when depends on its height and its sinking.
SINKING = {**TARGET, "up_m": 290.0, "climb_mps": -2.0}
RADAR = {"azimuth_error_deg": 0.05, "elevation_error_deg": 0.02, "range_error_m": 6.0}


@pytest.fixture
def told(monkeypatch):
    """All messages of alerting blocks."""
    messages, levels = [], DaidalusAlerting._compute_alert_levels

    def kept(self, asked, wake):
        messages.append((asked.tick / wake.ticks_per_s, levels(self, asked, wake)))
        return messages[-1][1]

    monkeypatch.setattr(DaidalusAlerting, "_compute_alert_levels", kept)
    return messages


def two_tracks(tmp_path, conf=HEEDED, **keys):
    found = scene(tmp_path, conf, RADAR, **keys)
    # The far one comes first in the roster, and second among tracks.
    found["blocks"]["traffic"] |= {"ownship": TURNING, "intruders": [LATE, SINKING]}
    return found


def entries(told):
    """Time and all numbers of every entry of the messages."""
    for times, message in told:
        row = np.repeat(np.arange(len(message)), np.diff(message.offsets))
        for place in range(len(message.target)):
            yield times[row[place]], message, row[place], place


def deviations_by_hand(state, ahead_s):
    """Of a recorded state that is carried on straight, by the whole matrix."""
    covariance = np.zeros((6, 6))
    for (i, j), name in COVARIANCE.items():
        covariance[i, j] = covariance[j, i] = state[name]
    on = np.eye(6) + ahead_s * np.eye(6, k=3)
    covariance = on @ covariance @ on.T
    return {
        "position_m": math.sqrt(np.linalg.eigvalsh(covariance[:2, :2]).max()),
        "height_m": math.sqrt(covariance[2, 2]),
        "velocity_mps": math.sqrt(np.linalg.eigvalsh(covariance[3:5, 3:5]).max()),
        "climb_mps": math.sqrt(covariance[5, 5]),
    }


def test_each_track_has_its_own_state_deviations_and_margins(tmp_path, told):
    found = run(two_tracks(tmp_path))
    flown = {(row["time_s"], row["target"]): row for row in rows(found, "truth")}
    tracks = rows(found, "state_tracks")
    seen = set()
    for time_s, message, row, place in entries(told):
        number = int(message.numbers["track"][place])
        state = [one for one in tracks if one["track"] == number and one["time_s"] <= time_s][-1]
        by_hand = deviations_by_hand(state, time_s - state["time_s"])
        wrong = {name: message.deviations[name][place] for name in by_hand}
        assert wrong == pytest.approx(by_hand, rel=1e-6)
        # By the truth: the target is the one that the track is of.
        name = ("late", "meets")[message.target[place]]
        own, other = flown[time_s, None], flown[time_s, name]
        seen.add((number, name))
        relative = {key: message.relative[key][place] for key in message.relative}
        assert relative["up_m"] == pytest.approx(own["alt_m"] - other["alt_m"], abs=12.0)
        assert math.hypot(relative["east_m"], relative["north_m"]) == pytest.approx(
            math.hypot(*crooked_level(own, other)), abs=40.0
        )
        if time_s >= 4.0:
            for axis in ("east", "north"):
                speed = own[f"velocity_{axis}_m_s"] - other[f"velocity_{axis}_m_s"]
                assert relative[f"{axis}_mps"] == pytest.approx(speed, abs=4.5)
                motion = message.own_motion[f"{axis}_mps"][row]
                # The mean of the last quarter of a second; over 3 s it would be 7 m/s off.
                assert motion == pytest.approx(own[f"velocity_{axis}_m_s"], abs=1.0)
        # Margins: scores by their names, and the velocity's by the distance that is left.
        away = max(math.hypot(relative["east_m"], relative["north_m"]) - 1.5 * wrong["position_m"],
                   0.0)  # fmt: skip
        score = 4.0 - 3.5 * min(away / 6000.0, 1.0)
        bounds = Bounds(*np.array([
            [1.5 * wrong["position_m"]], [2.5 * wrong["height_m"]],
            [score * wrong["velocity_mps"]], [3.5 * wrong["climb_mps"]],
        ]))  # fmt: skip
        states = tuple(np.array([value]) for value in relative.values())
        span = uncertain_violation_span(Volume(900.0, 250.0), states, bounds, 0.0, 25.0)
        wanted = float(span.begin_s[0])
        got = message.times["time_to_level_1_s"][place]
        assert (got == pytest.approx(wanted, rel=1e-9)) or (math.isnan(got) and wanted == math.inf)
    assert seen == {(1, "meets"), (2, "late")}


def test_targets_at_one_height_are_told_apart_by_where_they_are(tmp_path):
    """A track is of the target that it is at, not of the first one at its height."""
    one = scene(tmp_path)
    away = {**TARGET, "name": "far", "east_m": -3900.0, "north_m": 300.0, "heading_deg": 120.0}
    far, near = (at_height(target, 2520.0) for target in (away, TARGET))
    one["blocks"]["traffic"]["intruders"] = [far, near]
    found = run(one)
    named = {row["track"]: row["target"] for row in rows(found, "alerts")}
    last = {row["track"]: row for row in rows(found, "state_tracks")}
    assert sorted(named.values()) == ["far", "meets"]
    for number, name in named.items():
        target = far if name == "far" else near
        own = crooked.geodetic(crooked.position(crooked.OWNSHIP, last[number]["state_s"]))
        there = crooked.ned(target, last[number]["state_s"])
        assert np.linalg.norm(estimated_ned(last[number], own) - there) < 50.0


def at_height(target, alt_m):
    """A target that starts where it did, but at a height above the ellipsoid."""
    lat_deg, lon_deg, _ = crooked.geodetic(crooked.position(target))
    kept = {key: value for key, value in target.items() if key not in ("east_m", "north_m", "up_m")}
    return {**kept, "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m}


def estimated_ned(state, own):
    """A recorded estimate from the ownship's place, m."""
    import pymap3d

    frame = [state[f"origin_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
    at = pymap3d.ned2geodetic(*(state[f"{axis}_m"] for axis in ("north", "east", "down")), *frame)
    return np.array(pymap3d.geodetic2ned(*at, *own))


def test_what_a_tracker_only_holds_counts_once(tmp_path, told):
    """One radar sees a target twice a second; another one's rows repeat what is held of it."""
    one = alerting_scene(tmp_path, "tracker -> alerting", duration_s=4, fit_s=2)
    errs = {"errors": "stated", "quantised": False, "azimuth_error_deg": 0.3,
            "elevation_error_deg": 0.2, "range_error_m": 15.0}  # fmt: skip
    radar = one["blocks"]["radar"] = {**one["blocks"]["radar"], **errs, "scan_rate_hz": 2}
    one["blocks"]["often"] = {**radar, "scan_rate_hz": 10, "azimuth_deg": [-10.0, 120.0]}
    one["wires"].append("gate -> often -> fusion")
    one["blocks"]["traffic"]["intruders"].append(crooked.DIVING)
    found = run(one)
    seen = rows(found, block="radar", target="diving")
    assert not rows(found, block="often", target="diving")
    assert len(rows(found, "tracks", target="diving")) > 4 * len(seen)
    time_s = np.array([row["time_s"] for row in seen])
    body = np.array([
        row["range_m"] * crooked.direction(row["azimuth_rad"], row["elevation_rad"]) for row in seen
    ])  # fmt: skip
    north, east, down = crooked.attitude(crooked.OWNSHIP).T @ body.T
    count = 0
    for now_s, message, _, place in entries(told):
        if message.target[place] == 1 and now_s >= 1.5:
            near = (time_s >= now_s - 2.0) & (time_s <= now_s)
            relative = message.relative
            for axis, at in (("east", east), ("north", north), ("up", -down)):
                rate, here = np.polyfit(time_s[near] - now_s, at[near], 1)
                motion = "climb_mps" if axis == "up" else f"{axis}_mps"
                assert relative[f"{axis}_m"][place] == pytest.approx(-here, rel=1e-6)
                assert relative[motion][place] == pytest.approx(-rate, rel=1e-6)
            count += 1
    assert count == 5


def crooked_level(own, other):
    """North and east of a recorded target."""
    import pymap3d

    at, here = ([row["lat_deg"], row["lon_deg"], row["alt_m"]] for row in (other, own))
    return pymap3d.geodetic2ned(*at, *here)[:2]


def test_bands_heed_the_margins_of_tracks(tmp_path):
    """A wide margin makes bands wider, where the detector heeds it."""
    widths = []
    for conf in (HEEDED.replace("_SUM", ""), HEEDED):
        one = two_tracks(tmp_path, conf)
        one["blocks"]["traffic"]["intruders"] = [{**LATE, "up_m": 90.0, "climb_mps": 0.0}]
        one["blocks"]["guidance"] = {
            "type": "guidance.daidalus", "conf": one["blocks"]["alerting"]["conf"], "alerter": 2,
            "level": 0,
        }  # fmt: skip
        one["wires"].append("alerting -> guidance")
        bands = [row for row in rows(run(one), "bands")
                 if row["time_s"] == 5.5 and row["band"] == "direction"]  # fmt: skip
        widths.append(sum(row["high_rad"] - row["low_rad"] for row in bands))
    assert widths[1] > widths[0] + math.radians(3.0) > math.radians(3.0)


def test_a_spread_is_about_the_ownship_s_own_course_in_a_scene(tmp_path):
    """Straight on nobody is met; some degrees to one side of a course of 185 deg there is one."""
    heading = math.radians(185.0)
    target = {
        **TARGET, "heading_deg": 5.0, "speed_mps": 60.0, "climb_mps": 3.0,
        "east_m": 2000.0 * math.sin(heading) + 640.0 * math.cos(heading),
        "north_m": 2000.0 * math.cos(heading) - 640.0 * math.sin(heading), "up_m": 20.0,
    }  # fmt: skip
    own = {**crooked.OWNSHIP, "heading_deg": 185.0}
    levels = []
    for spread in (0, 2, 15):
        path = tmp_path / f"{spread}.conf"
        path.write_text(f"{CONF.format(m=0)}turn_rate = 0 [deg/s]\n"
                        f"small_alert_1_spread_hdir = {spread} [deg]\n")  # fmt: skip
        one = scene(tmp_path)
        one["duration_s"] = 1.5
        one["blocks"] = {
            "traffic": {**one["blocks"]["traffic"], "ownship": own, "intruders": [target]},
            "alerting": {**one["blocks"]["alerting"], "conf": str(path), "alerter": 1},
        }
        one["wires"] = ["traffic -> alerting"]
        levels.append(rows(run(one), "alerts")[-1]["level"])
    assert levels == [0, 0, 1]


TCAS = """\
alerters = one
one_load_core_detection_d = gov.nasa.larcfm.ACCoRD.TCAS3D
one_d_TCAS3D_RA = true
one_alert_1_detector = d
one_alert_1_region = NEAR
one_alert_1_alerting_time = 0 [s]
"""


def test_tables_of_tcas_go_by_the_ownship_s_altitude_in_a_scene(tmp_path):
    """At 7,900 ft tau is 25 s; at 1,500 ft there are no tables of such size: 15 s."""
    path = tmp_path / "tcas.conf"
    path.write_text(TCAS, encoding="utf-8")
    assert read_conf(path).most_levels == 1
    heading = math.radians(217.0)
    target = {
        **TARGET, "heading_deg": 37.0, "speed_mps": 60.0, "climb_mps": 3.0, "up_m": 20.0,
        "east_m": 2700.0 * math.sin(heading), "north_m": 2700.0 * math.cos(heading),
    }  # fmt: skip
    levels = []
    for alt_m in (2400.0, 450.0):
        one = scene(tmp_path)
        one["duration_s"] = 1.5
        own = {**crooked.OWNSHIP, "alt_m": alt_m}
        one["blocks"] = {
            "traffic": {**one["blocks"]["traffic"], "ownship": own, "intruders": [target]},
            "alerting": {**one["blocks"]["alerting"], "conf": str(path), "alerter": 1},
        }
        one["wires"] = ["traffic -> alerting"]
        levels.append(rows(run(one), "alerts")[-1]["level"])
    assert levels == [1, 0]


def test_velocities_of_far_tracks_count_in_their_own_place():
    """Along axes of a frame 60 km away, level flight of 80 m/s would sink by 0.7 m/s."""
    import pymap3d
    from test_alerts_of_estimates import tracks

    own = crooked.OWNSHIP
    place = np.array([*np.radians([own["lat_deg"], own["lon_deg"]]), own["alt_m"]])
    there = pymap3d.ned2geodetic(60e3, 0.0, 0.0, own["lat_deg"], own["lon_deg"], own["alt_m"])
    velocity = pymap3d.enu2uvw(0.0, 80.0, 0.0, there[0], there[1])
    east, north, up = pymap3d.uvw2enu(*velocity, own["lat_deg"], own["lon_deg"])
    flights = EstimatedFlights()
    now = RunTicks.of_run(0, np.array([1]))
    flights.add(now, tracks(4, north_m=60e3, east_m=0.0, down_m=0.0, north_m_s=north,
                            east_m_s=east, down_m_s=-up))  # fmt: skip
    _, _, state, _, _ = flights.states_at(now, np.array([3.0]), place[:, np.newaxis])
    assert abs(up) > 0.7
    assert state[5, 0] == pytest.approx(0.0, abs=1e-6)
    assert state[4, 0] == pytest.approx(80.0, rel=0.01)


def test_each_level_has_the_time_to_its_own_volume(tmp_path):
    """The inner volume is met later than the outer, by the geometry of the straight flights."""
    path = tmp_path / "levels.conf"
    path.write_text(CONF.format(m=0) + """\
large_load_core_detection_inner = gov.nasa.larcfm.ACCoRD.WCV_TCPA
large_inner_WCV_DTHR = 430 [m]
large_inner_WCV_ZTHR = 200 [m]
large_inner_WCV_TTHR = 0 [s]
large_alert_2_detector = inner
large_alert_2_region = NEAR
large_alert_2_alerting_time = 5 [s]
""", encoding="utf-8")  # fmt: skip
    one = alerting_scene(tmp_path)
    one["blocks"]["alerting"]["conf"] = str(path)
    found = [row for row in rows(run(one), "alerts") if row["time_s"] <= 3.0]
    assert len(found) > 3
    for row in found:
        for level, radius_m in ((1, 900.0), (2, 430.0)):
            wanted = entry_s(truth(row["time_s"]), radius_m)
            assert row[f"time_to_level_{level}_s"] == pytest.approx(wanted, rel=0.02)
        assert row["time_to_level_3_s"] is None


def test_sights_that_come_late_are_turned_by_the_pose_of_their_own_instant(tmp_path, told):
    """2 s late, from an ownship that turns by 2 deg/s: by then its pose is 4 deg off."""
    one = alerting_scene(tmp_path, {"from": "fusion", "to": "alerting", "delay_s": 2})
    own = {**TURNING, "legs": [{"kind": "turn", "rate_deg_s": 2.0}]}
    one["blocks"]["traffic"] |= {"ownship": own, "intruders": [TARGET]}
    found = run(one)
    truth_of = {(row["time_s"], row["target"]): row for row in rows(found, "truth")}
    late = [entry for entry in entries(told) if entry[0] >= 4.0]
    assert len(late) == 4
    for time_s, message, _, place in late:
        own_now, other = truth_of[time_s, None], truth_of[time_s, "meets"]
        north, east = crooked_level(own_now, other)
        relative = message.relative["north_m"][place], message.relative["east_m"][place]
        # Carried on straight for 2 s, while the ownship turns on: 70 m/s by some 4 degrees.
        assert relative == pytest.approx((-north, -east), abs=25.0)
        assert math.hypot(north, east) > 800.0


def test_bands_are_of_the_instants_of_their_alerts(tmp_path):
    """Also where the first alerts come long after the first scans, and all scans are one wake."""
    from test_avoidance_by_bands import scene as by_bands

    one = by_bands(tmp_path)
    one["wires"] = ["traffic -> alerting -> guidance"]
    one["blocks"]["guidance"] = {
        "type": "guidance.daidalus", "conf": one["blocks"].pop("avoidance")["conf"],
    }  # fmt: skip
    one["duration_s"] = 40
    found = run(one)
    alerted = [row["time_s"] for row in rows(found, "alerts") if row["level"] >= 1]
    assert alerted[0] > 5.0
    assert sorted({row["time_s"] for row in rows(found, "bands")}) == alerted
