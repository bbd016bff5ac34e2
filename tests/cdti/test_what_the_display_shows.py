"""What the operator's display shows of a crooked scene is what is there, and whose it is."""

import math
from copy import copy

import crooked
import numpy as np
import pymap3d
import pytest
from displayed import displayed
from test_avoidance_by_bands import CONF
from wired import SEES_ALL, chain

#: The second one conflicts first; the volumes of the alerter that is used are 1500 m wide.
ASIDE = {"name": "aside", "east_m": 3000.0, "north_m": -5900.0, "up_m": 10.0,
         "heading_deg": 290.0, "speed_mps": 95.0, "climb_mps": 3.5}  # fmt: skip
CLOSING = {"name": "closing", "east_m": -2349.0, "north_m": -1855.0, "up_m": 120.0,
           "heading_deg": 35.0, "speed_mps": 60.0, "climb_mps": -2.0, "roll_deg": 30.0}  # fmt: skip
#: Comes near only if the ownship turns to it: no alert, and no part of the area of a loss.
BESIDE = {"name": "beside", "east_m": -3700.0, "north_m": 1700.0, "up_m": -40.0,
          "heading_deg": 217.0, "speed_mps": 40.0, "climb_mps": 3.0}  # fmt: skip
TARGETS = {"aside": ASIDE, "closing": CLOSING, "beside": BESIDE}
ALERTING = ("closing", "aside")
#: A warning comes at a smaller volume than a corrective alert, so at another time.
RULES = (
    CONF.replace("large_alert_2_detector = d", "large_alert_2_detector = e")
    + """\
large_load_core_detection_e = gov.nasa.larcfm.ACCoRD.WCV_TCPA
large_e_WCV_DTHR = 1200 [m]
large_e_WCV_ZTHR = 200 [m]
large_e_WCV_TTHR = 0 [s]
"""
)
RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 12.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.1, "elevation_error_deg": 0.1, "range_error_m": 5.0,
    "mount_azimuth_deg": 10.0, "azimuth_deg": [-110.0, 120.0],
}  # fmt: skip
DURATION_S = 8.2
LATE_S = 1.0


@pytest.fixture(scope="module", params=["tracking.ekf", "tracking.stub"])
def shown(request, tmp_path_factory):
    """The display at the end, what was recorded, and the contact of each target.

    Lines of sight of the stub come a second late, and the display hears of a few scans at once.
    """
    conf = tmp_path_factory.mktemp("conf") / "two.conf"
    conf.write_text(RULES.format(rate=3), encoding="utf-8")
    rules = {"conf": str(conf), "alerter": 2}
    scene = chain(
        {"radar": RADAR, "camera": {**SEES_ALL, "azimuth_deg": [-90.0, 90.0], "offset_s": 0.2}},
        targets=TARGETS.values(), duration_s=DURATION_S, tracker={"type": request.param},
        fusion={"type": "fusion.pass_through"},
    )  # fmt: skip
    ekf = request.param == "tracking.ekf"
    if not ekf:
        scene["blocks"]["fusion"] = {"type": "fusion.pick_best", "latency_s": LATE_S}
    scene["blocks"]["alerting"] = {"type": "alerting.daidalus", "scan_rate_hz": 2, **rules}
    kinds = ["direction", "altitude", "speed"]
    scene["blocks"]["guidance"] = {"type": "guidance.daidalus", "kinds": kinds, **rules}
    scene["wires"] += ["traffic -> alerting", "tracker -> alerting -> guidance"]
    scope, recorded = displayed(scene, window=None if ekf else 4)
    last = [row for row in recorded["alerts"] if row["time_s"] == 8.0]
    contact = {
        row["target"]: 1_000_000 + row["track"] if ekf else list(TARGETS).index(row["target"])
        for row in last
    }
    return scope, recorded, contact


def away(name, seen_s, time_s=DURATION_S):
    """East, north, up from the ownship at a time to where a target was."""
    here = crooked.geodetic(crooked.position(crooked.OWNSHIP, time_s))
    return np.array(pymap3d.ecef2enu(*crooked.position(TARGETS[name], seen_s), *here))


def test_contacts_are_where_their_targets_were_and_fly_as_they_do(shown):
    scope, _, contact = shown
    picture = scope.page_content(DURATION_S)
    own = picture["own"]
    assert own["alt"] == pytest.approx(2400.0 + 3.0 * 8.2, abs=1.0)
    assert (own["speed"], own["climb"]) == pytest.approx((70.0, 3.0), abs=0.2)
    assert own["heading"] == pytest.approx(222.0)
    found = {row[0]: row for row in picture["contacts"]}
    assert set(found) == set(contact.values())
    level = {one["target"]: one["level"] for one in picture["alerts"]}
    for name, target in TARGETS.items():
        _, east, north, up, bearing, age, *flight, shown_level = found[contact[name]]
        place = away(name, DURATION_S - age)
        late_s = LATE_S if contact[name] < 1_000_000 else 0.0
        assert late_s <= age < late_s + 0.5
        assert [east, north, up] == pytest.approx(place, abs=25.0)
        assert bearing == pytest.approx(math.degrees(math.atan2(*place[:2])) % 360.0, abs=2.5)
        heading = math.radians(target["heading_deg"])
        wanted = [target["speed_mps"] * math.sin(heading), target["speed_mps"] * math.cos(heading)]
        assert flight == pytest.approx([*wanted, target["climb_mps"]], abs=12.0)
        assert shown_level == level.pop(contact[name], 0)
    assert not level


def test_alerts_are_those_of_their_targets_the_most_urgent_first(shown):
    scope, recorded, contact = shown
    alerts = scope.page_content(DURATION_S)["alerts"]
    assert [one["target"] for one in alerts] == [contact[name] for name in ALERTING]
    assert alerts[0]["level"] > alerts[1]["level"] > 0
    for name, one in zip(ALERTING, alerts, strict=True):
        rows = [row for row in recorded["alerts"] if row["target"] == name]
        times = [rows[-1][f"time_to_level_{k}_s"] for k in (1, 2)]
        assert abs(times[0] - times[1]) > 1.0
        assert one["to_loss"] == pytest.approx(min(times), abs=0.006)
        assert one["closest"] == pytest.approx(rows[-1]["closest_horizontal_m"], abs=0.06)
        since = 8.0
        while rows and rows[-1]["level"] > 0:
            since = rows.pop()["time_s"]
        assert one["since"] == since <= one["at"] == 8.0
    assert alerts[0]["since"] < 2.0


def test_the_area_of_a_loss_begins_where_a_target_comes_near(shown):
    """Each of its directions flown straight, from where both were when the alerting looked."""
    scope, _, _ = shown
    area = [row for row in scope.page_content(DURATION_S)["area"] if row[1] > 0.0]
    assert len(area) > 20
    for degrees, near, far in area:
        assert near < far
        heading, flown_s = math.radians(degrees), near / 70.0
        moved = near * np.array([math.sin(heading), math.cos(heading)])
        apart = [np.linalg.norm(away(name, 8.0 + flown_s, 8.0)[:2] - moved) for name in ALERTING]
        assert min(abs(distance - 1500.0) for distance in apart) < 250.0


def test_bands_are_shown_in_degrees_and_m_until_they_are_old(shown):
    scope, recorded, _ = shown
    units = {"direction": ("rad", math.degrees), "altitude": ("m", float), "speed": ("mps", float)}
    wanted = {kind: [] for kind in units}
    for row in recorded["bands"]:
        unit, shown_as = units[row["band"]]
        ends = [round(shown_as(row[f"{end}_{unit}"]), 1) for end in ("low", "high")]
        if row["time_s"] == 8.0:
            wanted[row["band"]].append([*ends, row["region"]])
    assert all(wanted.values()) and scope.page_content(DURATION_S)["bands"] == wanted
    assert not any(scope.page_content(8.0 + 1.6)["bands"].values())


def test_what_was_heard_by_an_instant_is_shown_whatever_comes_later(shown):
    scope, _, _ = shown
    received, before = scope.received_so_far(), scope.page_content(DURATION_S)
    late = copy(scope)
    late._contacts, late._alerts, late._bands = None, None, None
    assert late.page_content(DURATION_S)["contacts"] == [] != before["contacts"]
    assert late.page_content(DURATION_S, received) == before


def test_the_display_says_where_a_command_leads_and_of_which_alert_a_contact_is(shown):
    scope, recorded, contact = shown
    own = scope.page_content(DURATION_S)["own"]
    assert scope.commanded_value("turn", -60.0) == pytest.approx(
        (own["heading"] - 60.0) % 360.0, abs=0.06
    )
    assert scope.commanded_value("turn", 150.0) == pytest.approx(
        (own["heading"] + 150.0) % 360.0, abs=0.06
    )
    assert scope.commanded_value("climb", -150.0) == pytest.approx(own["alt"] - 150.0, abs=0.11)
    last = {r["target"]: r["level"] for r in recorded["alerts"] if r["time_s"] == 8.0}
    assert {name: scope.alert_level_of(contact[name]) for name in TARGETS} == last
    assert scope.alert_level_of(77) == 0


def test_where_sensors_look_is_said_from_the_nose(shown):
    radar = next(one for one in shown[0].sensors if one["name"] == "radar")
    assert (radar["kind"], radar["range"], radar["azimuth"]) == ("radar", 12000.0, [-100.0, 130.0])


def test_the_camera_s_picture_is_of_the_chosen_contact(shown):
    scope, recorded, contact = shown
    picture = scope.page_content(DURATION_S)
    for chosen in (*contact.values(), -1):
        name = next((n for n, c in contact.items() if c == chosen), "closing")
        rows = [r for r in recorded["detections"] if r["block"] == "camera" and r["target"] == name]
        found = scope.camera_picture(picture, DURATION_S, chosen)
        if not rows:
            assert found is None
            continue
        assert found["target"] == contact[name]
        assert found["age"] == pytest.approx(DURATION_S - rows[-1]["time_s"], abs=0.006)
        assert found["pixels"] == pytest.approx(rows[-1]["pixels"], abs=0.06)


def test_a_sensor_that_falls_silent_is_said_to_be_out():
    off = {"from_s": 3, "to_s": 6, "set": {"blocks.radar.enabled": False}}
    fast, slow = ({**SEES_ALL, "scan_rate_hz": rate_hz} for rate_hz in (10, 0.25))
    sensors = {"radar": RADAR, "slow": slow, "fast": fast, "aside": {**RADAR, "enabled": False}}
    out = {}

    def look(scope, time_s):
        out[round(time_s, 3)] = scope.page_content(time_s)["out"]

    scene = chain(sensors, targets=TARGETS.values(), duration_s=9, changes=[off])
    displayed(scene, look, window=1)
    said = sorted(time_s for time_s, names in out.items() if names == ["radar"])
    # Its last scan was at 2.5 s: two and a half scans of half a second each are over at 3.75 s.
    assert (said[0], said[-1], len(said)) == (3.8, 5.9, 22)
    assert not any(names for time_s, names in out.items() if time_s not in said)
