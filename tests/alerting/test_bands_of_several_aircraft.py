"""``dsa-des alert`` with several aircraft: who counts for the bands, how soon, with what margin.

Every heading is tried one by one: straight flights, stepped through, meet a cylinder or not.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from components.alerting.command import alert
from tests.alerting.reference_data import rows

RADIUS_M, HALF_M = 700.0, 150.0
ALERTING_S, EARLY_S, LOOKAHEAD_S = 40.0, 70.0, 90.0
#: One cylinder, whose states' errors count; turns at once.
CONF = f"""\
alerters = one
lookahead_time = {LOOKAHEAD_S} [s]
hysteresis_time = 5 [s]
turn_rate = 0 [deg/s]
v_pos_z_score = 2
one_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TAUMOD_SUM
one_d_WCV_DTHR = {RADIUS_M} [m]
one_d_WCV_ZTHR = {HALF_M} [m]
one_d_WCV_TTHR = 0 [s]
one_d_WCV_TCOA = 0 [s]
one_alert_1_detector = d
one_alert_1_region = NEAR
one_alert_1_alerting_time = {ALERTING_S} [s]
one_alert_1_early_alerting_time = {EARLY_S} [s]
"""
HEADER = """\
NAME sx sy sz trk gs vs time s_ew_std s_ns_std s_en_std sz_std v_ew_std v_ns_std v_en_std vz_std
[none] [m] [m] [m] [deg] [m/s] [m/s] [s] [m] [m] [m] [m] [m/s] [m/s] [m/s] [m/s]
"""
TRACK_DEG, SPEED_MPS, ALT_M, CLIMB_MPS = 217.0, 60.0, 1500.0, 1.0
#: Standard deviations of heights: twice their sum is added to the volume's half height.
OWN_SIGMA_M, OTHER_SIGMA_M = 11.0, 17.0


def velocity(track_deg, speed):
    track = np.radians(track_deg)
    return np.stack([speed * np.sin(track), speed * np.cos(track)])


def meeting(entry_s, track_deg, speed, bearing_deg):
    """Where an aircraft is, east and north, that is 700 m off at a bearing after a time."""
    at_entry = RADIUS_M * velocity(bearing_deg, 1.0)
    return at_entry + (velocity(TRACK_DEG, SPEED_MPS) - velocity(track_deg, speed)) * entry_s


def line(name, time_s, place, up_m, track_deg, speed, climb, sigma_m):
    east, north = place
    return (
        f"{name} {east:.6f} {north:.6f} {ALT_M + up_m} {track_deg} {speed} {climb} {time_s} "
        f"0 0 0 {sigma_m} 0 0 0 0\n"
    )


def encounter(path, *others):
    """Write an encounter: the ownship is at the origin in both rows, `others` are lines."""
    own = [line("own", t, (0.0, 0.0), 0.0, TRACK_DEG, SPEED_MPS, CLIMB_MPS, OWN_SIGMA_M)
           for t in (0, 1)]  # fmt: skip
    path.write_text(HEADER + "".join([*own, *others]), encoding="utf-8")
    return path


def told(tmp_path, path, text):
    """The table of alerts, and the red headings of the last row."""
    (tmp_path / "one.conf").write_text(text, encoding="utf-8")
    names = [path, "--conf", tmp_path / "one.conf", "--out", tmp_path / "alerts.csv",
             "--bands", tmp_path / "bands.csv"]  # fmt: skip
    result = CliRunner().invoke(alert, [str(name) for name in names], catch_exceptions=False)
    assert result.exit_code == 0, result.stderr
    with (tmp_path / "bands.csv").open(encoding="utf-8") as file:
        bands = [row for row in csv.DictReader(file) if row["kind"] == "hdir"]
    red = [(float(row["low"]), float(row["up"])) for row in bands
           if row["region"] == "NEAR" and float(row["time_s"]) == 1.0]  # fmt: skip
    return rows((tmp_path / "alerts.csv").read_text(encoding="utf-8"))[2:], red


def headings_met(place, up_m, track_deg, speed, climb, half_m, until_s):
    """Whether the ownship meets it on each of 360 headings, its own the first."""
    time_s = np.arange(0.0, until_s, 0.1)
    others = velocity(track_deg, speed)[:, np.newaxis]
    up = up_m + (climb - CLIMB_MPS) * time_s
    found = []
    for heading_deg in TRACK_DEG + np.arange(360.0):
        own = velocity(heading_deg, SPEED_MPS)[:, np.newaxis]
        away = np.asarray(place)[:, np.newaxis] + (others - own) * time_s
        found.append(bool(((np.hypot(*away) < RADIUS_M) & (np.abs(up) < half_m)).any()))
    return np.array(found)


def edges(met):
    """The steps around the only stretch of headings that are met, deg."""
    shift = int(np.flatnonzero(~met)[0])
    held = np.flatnonzero(np.roll(met, -shift))
    assert held[-1] - held[0] == len(held) - 1
    return (TRACK_DEG + shift + held[0] - 1) % 360, (TRACK_DEG + shift + held[-1] + 1) % 360


#: Due at first, 190 m above; a second later it would be inside after 60 s, not 40.
SOON, LATER = (meeting(entry, 340.0, 45.0, 190.0) for entry in (36.0, 60.0))
HIGH = [line("high", t, (300.0, -900.0), 6000.0, 80.0, 50.0, 0.0, 0.0) for t in (0, 1)]
GONE = [line("gone", 0, meeting(20.0, 100.0, 40.0, 250.0), 20.0, 100.0, 40.0, 1.0, 0.0)]
CROSSING = [line("crossing", t, place, 190.0, 340.0, 45.0, 0.9, OTHER_SIGMA_M)
            for t, place in ((0, SOON), (1, LATER))]  # fmt: skip


def test_bands_are_of_who_is_there_by_its_own_level_and_its_own_margin(tmp_path: Path) -> None:
    """An alert that is on counts by its early time, so that all of the lookahead is red.

    The aircraft listed first never alerts, the second is there in the first row only.
    """
    path = encounter(tmp_path / "a.xyz", *HIGH, *GONE, *CROSSING)
    alerts, red = told(tmp_path, path, CONF)
    levels = {(row[2], float(row[0])): row[4] for row in alerts}
    assert levels["gone", 0.0] == levels["crossing", 0.0] == levels["crossing", 1.0] == "1"
    half_m = HALF_M + 2.0 * (OWN_SIGMA_M + OTHER_SIGMA_M)
    state = LATER, 190.0, 340.0, 45.0, 0.9
    met = headings_met(*state, half_m, LOOKAHEAD_S)
    assert red == [pytest.approx(edges(met), abs=1e-6)]
    # By the ordinary time or without the margin nothing would be red.
    assert not headings_met(*state, half_m, ALERTING_S).any()
    assert not headings_met(*state, HALF_M, LOOKAHEAD_S).any()


def test_a_level_that_is_on_by_its_spread_stays_by_its_early_time(tmp_path: Path) -> None:
    """Straight on nobody is met; some degrees to the left there is one, later in the second row."""
    spread_deg, half_m = 12, HALF_M + 2.0 * (OWN_SIGMA_M + OTHER_SIGMA_M)
    lines, soonest = [], []
    for t, entry_s in ((0, 28.0), (1, 50.0)):
        place = meeting(entry_s, 340.0, 45.0, 190.0) + 1.6 * RADIUS_M * velocity(127.0, 1.0)
        lines.append(line("aside", t, place, -60.0, 340.0, 45.0, 0.0, OTHER_SIGMA_M))
        within = [
            headings_met(place, -60.0, 340.0, 45.0, 0.0, half_m, until_s)
            for until_s in (ALERTING_S, EARLY_S)
        ]
        assert not within[1][0]
        near = np.r_[-spread_deg : spread_deg + 1]
        soonest.append(tuple(bool(met[near].any()) for met in within))
    assert soonest == [(True, True), (False, True)]
    path = encounter(tmp_path / "a.xyz", *HIGH, *lines)
    text = CONF + f"one_alert_1_spread_hdir = {spread_deg} [deg]\n"
    alerts, _ = told(tmp_path, path, text)
    levels = {(row[2], float(row[0])): row[4] for row in alerts}
    assert (levels["aside", 0.0], levels["aside", 1.0]) == ("1", "1")
    without, _ = told(tmp_path, path, CONF)
    assert {row[4] for row in without} == {"0"}
