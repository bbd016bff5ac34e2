"""What single keys of a configuration change, against straight flights tried one by one."""

import csv
import io
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from components.alert_configuration.conf_file import read_conf
from components.alerting.alert_tables import alert_table_csv, bands_table_csv
from components.alerting.command import alert
from components.alerting.encounter import read_encounter
from components.alerting.levels import AlertPairs, alert_levels
from components.formats.text_rows import TrafficFileError
from components.guidance.bands import GuidedIntruder, guidance
from components.guidance.situation import State
from components.well_clear.tcas import recovery_cylinder_sizes_m
from tests.alerting.reference_data import reference_text, rows

D_M, Z_M, SOON_S = 700.0, 150.0, 45.0
#: One cylinder, turns at once.
CONF = f"""\
alerters = one
lookahead_time = 90 [s]
turn_rate = 0 [deg/s]
horizontal_accel = 0 [m/s^2]
vertical_accel = 0 [m/s^2]
one_load_core_detection_d = gov.nasa.larcfm.ACCoRD.WCV_TCPA
one_d_WCV_DTHR = {D_M} [m]
one_d_WCV_ZTHR = {Z_M} [m]
one_d_WCV_TTHR = 0 [s]
one_alert_1_detector = d
one_alert_1_region = NEAR
one_alert_1_alerting_time = {SOON_S} [s]
"""
TCAS = """\
alerters = TCAS
lookahead_time = 60 [s]
TCAS_load_core_detection_ta = gov.nasa.larcfm.ACCoRD.TCAS3D
TCAS_alert_1_detector = ta
TCAS_alert_1_region = MID
TCAS_alert_1_alerting_time = 0 [s]
TCAS_load_core_detection_ra = gov.nasa.larcfm.ACCoRD.TCAS3D
TCAS_ra_TCAS3D_RA = true
TCAS_alert_2_detector = ra
TCAS_alert_2_region = NEAR
TCAS_alert_2_alerting_time = 0 [s]
"""
XYZ = """\
NAME sx sy sz trk gs vs time heading airspeed
[none] [m] [m] [m] [deg] [m/s] [m/s] [s] [deg] [m/s]
own 0 0 1500 217 60 1 0 200 55
other -900 -4400 1590 340 45 -1 0 340 45
"""


def conf(tmp_path: Path, text: str):
    path = tmp_path / "one.conf"
    path.write_text(text, encoding="utf-8")
    return read_conf(path)


def velocity(track_deg, speed):
    track = np.radians(track_deg)
    return speed * np.sin(track), speed * np.cos(track)


def meets(relative, until_s, scale=1.0):
    """Whether straight flights, stepped through, come inside the cylinder, or one of its shape."""
    time_s = np.arange(0.0, scale * until_s, 0.02)
    east, north, up = (relative[i] + relative[i + 3] * time_s for i in range(3))
    return bool(((np.hypot(east, north) < scale * D_M) & (np.abs(up) < scale * Z_M)).any())


def spread_states(own, count=120):
    """Where intruders are and how they fly, so that they pass some hundred metres by."""
    random = np.random.default_rng(18)
    theirs = np.stack([*velocity(random.uniform(0, 360, count), 40.0), random.normal(0, 3, count)])
    passed = np.stack([*random.normal(0, 900, (2, count)), random.normal(0, 150, count)])
    before_s = random.uniform(0, 70, count)
    return -passed + (own[:, np.newaxis] - theirs) * before_s, theirs


@pytest.mark.parametrize(
    ("kind", "spread", "unit", "step", "steps"),
    [("hdir", 7, "deg", math.radians(1), 7), ("hs", 20, "m/s", 5 * 1852 / 3600, 8),
     ("vs", 3, "m/s", 100 * 0.3048 / 60, 6)],
)  # fmt: skip
def test_a_spread_alerts_for_values_nearby(tmp_path, kind, spread, unit, step, steps):
    """A level is due where any step within the spread, and the first at it or beyond, conflicts."""
    text = f"{CONF}one_alert_1_spread_{kind} = {spread} [{unit}]\n"
    configuration = conf(tmp_path, text)
    own = np.array([*velocity(217.0, 60.0), 1.5])
    position, theirs = spread_states(own)
    zero = np.zeros(position.shape[1])
    flight = State(zero, zero, zero + 1500.0, *(zero + part for part in own))
    relative = [*-position, *(own[:, np.newaxis] - theirs)]
    pairs = AlertPairs(
        tuple(part[np.newaxis] for part in relative),
        State(*(part[np.newaxis] for part in flight)),
    )
    found = alert_levels(configuration, zero[:1], np.ones((1, len(zero)), bool), pairs)
    wanted = []
    for number in range(len(zero)):
        surely = maybe = False
        for k in range(-steps, steps + 1):
            track, speed, climb = 217.0, 60.0, 1.5
            track += math.degrees(k * step) if kind == "hdir" else 0.0
            speed += k * step if kind == "hs" else 0.0
            climb += k * step if kind == "vs" else 0.0
            mine = np.array([*velocity(track, speed), climb])
            other = [*-position[:, number], *(mine - theirs[:, number])]
            surely |= meets(other, SOON_S, 0.99)
            maybe |= meets(other, SOON_S, 1.01)
        wanted.append(int(surely))
        assert surely <= found.level[0, number] <= maybe
    assert 20 < sum(wanted) < 110
    plain = alert_levels(conf(tmp_path, CONF), zero[:1], np.ones((1, len(zero)), bool), pairs)
    assert 5 < int(plain.level.sum()) < sum(wanted)


def test_wind_shifts_bands_and_not_levels(tmp_path):
    """Headings are tried one by one: through the air at 55 m/s, over ground with the wind."""
    configuration = conf(tmp_path, CONF)
    path = tmp_path / "a.xyz"
    path.write_text(XYZ, encoding="utf-8")
    encounter = read_encounter(path, configuration)
    alerts = alert_levels(configuration, encounter.time_s, encounter.present, encounter.pairs)
    bands = csv.DictReader(io.StringIO(bands_table_csv(configuration, encounter, alerts, 9)))
    red = [b for b in bands if b["kind"] == "hdir" and b["region"] == "NEAR"]
    assert len(red) == 1
    wind = np.subtract(velocity(217.0, 60.0), velocity(200.0, 55.0))
    theirs = velocity(340.0, 45.0)
    hit = []
    for heading in 200.0 + np.arange(-180, 180):
        mine = velocity(heading, 55.0) + wind
        state = [900.0, 4400.0, -90.0, *(mine - theirs), 2.0]
        hit.append(meets(state, 90.0))
    first, last = 20.0 + int(np.argmax(hit)), 379.0 - int(np.argmax(hit[::-1]))
    assert float(red[0]["low"]) == pytest.approx(first - 1, abs=1e-6)
    assert float(red[0]["up"]) == pytest.approx(last + 1, abs=1e-6)
    calm = read_encounter(path, configuration, (0.0, 0.0))
    without = alert_levels(configuration, calm.time_s, calm.present, calm.pairs)
    assert alert_table_csv(configuration, calm, without) == alert_table_csv(
        configuration, encounter, alerts
    )
    shifted = csv.DictReader(io.StringIO(bands_table_csv(configuration, calm, without, 9)))
    moved = [b for b in shifted if b["kind"] == "hdir" and b["region"] == "NEAR"]
    assert abs(float(moved[0]["low"]) - first) > 5.0


def test_wind_can_be_set(tmp_path):
    (tmp_path / "one.conf").write_text(CONF, encoding="utf-8")
    (tmp_path / "a.xyz").write_text(XYZ, encoding="utf-8")
    east, north = np.subtract(velocity(217.0, 60.0), velocity(200.0, 55.0))
    towards, knots = math.degrees(math.atan2(east, north)), math.hypot(east, north) * 3600 / 1852
    for name, extra in (("file", ()), ("set", ("--wind", f"{towards:.9f}", f"{knots:.9f}"))):
        arguments = [
            tmp_path / "a.xyz", "--conf", tmp_path / "one.conf", "--out", tmp_path / f"{name}.csv",
            "--bands", tmp_path / f"{name}_bands.csv", *extra,
        ]  # fmt: skip
        result = CliRunner().invoke(alert, [str(a) for a in arguments], catch_exceptions=False)
        assert result.exit_code == 0, result.stderr
    one, other = ((tmp_path / f"{name}_bands.csv").read_text("utf-8") for name in ("file", "set"))
    assert one == other and one.startswith("time_s,kind,low,up,region\n0.0,hdir,0.0,")


def test_levels_of_tcas(tmp_path):
    configuration = conf(tmp_path, TCAS)
    path = tmp_path / "states.xyz"
    path.write_text(reference_text("alerting/random_states.xyz.gz"), encoding="utf-8")
    encounter = read_encounter(path, configuration)
    alerts = alert_levels(configuration, encounter.time_s, encounter.present, encounter.pairs)
    got = rows(alert_table_csv(configuration, encounter, alerts, 12))
    want = rows(reference_text("alerting/random_states_tcas.csv.gz"))
    assert got[0] == want[0] and len(got) == len(want)
    for one, other in zip(got[2:], want[2:], strict=True):
        assert one[:5] == other[:5]
        for a, b in zip(one[5:], other[5:], strict=False):
            assert a == b or float(a) == pytest.approx(float(b), abs=1e-9)


@pytest.mark.parametrize(("feet", "level"), [(900.0, 1), (1100.0, 2), (5200.0, 2)])
def test_below_1000_feet_tcas_advises_of_no_resolution(tmp_path, feet, level):
    """Head on at 80 m/s from 1,000 m, within both times at any height; levels go by the own one."""
    cell = [np.full((1, 1), part) for part in (0.0, -1000.0, 0.0, 0.0, -80.0, 0.0)]
    relative = (*(-part for part in cell[:3]), *cell[3:])
    own = State(*(np.full((1, 1), part) for part in (0.0, 0.0, feet * 0.3048, 0.0, -40.0, 0.0)))
    found = alert_levels(
        conf(tmp_path, TCAS), np.zeros(1), np.ones((1, 1), bool), AlertPairs(relative, own)
    )
    assert found.level.tolist() == [[level]]


OWN = State(*np.array([0.0, 0.0, 1500.0, *velocity(217.0, 60.0), 1.0]))
CROSSING = State(*np.array([1900.0, -4400.0, 1590.0, *velocity(340.0, 45.0), -1.0]))


def bands(kind, configuration, **values):
    changed = replace(configuration, values={**configuration.values, **values})
    return guidance(kind, changed, OWN, [GuidedIntruder(CROSSING, configuration.alerters[0])])


@pytest.mark.parametrize(("kind", "own"), [("hs", 60.0), ("vs", 1.0), ("alt", 1500.0)])
def test_limits_relative_to_the_own_value(tmp_path, kind, own):
    configuration = conf(tmp_path, CONF)
    below, above = {"hs": (17.0, 23.0), "vs": (4.0, 7.0), "alt": (333.0, 271.0)}[kind]
    limits = {f"below_relative_{kind}": below, f"above_relative_{kind}": above}
    found = bands(kind, configuration, **limits).bands
    assert (found[0].low, found[-1].high) == pytest.approx((own - below, own + above))
    wide = bands(kind, configuration).bands
    assert wide[0].low < own - below and wide[-1].high > own + above


def test_time_to_manoeuvre_is_added_or_not(tmp_path):
    """A slow turn takes 60 s to 180 deg: with the time of the turn, more of the turns conflict."""
    text = CONF.replace("turn_rate = 0", "turn_rate = 3").replace("= 90 [s]", "= 180 [s]")
    configuration = conf(tmp_path, text)
    red = {}
    for counts_from_now in (False, True):
        found = bands("hdir", configuration, bands_add_time_to_maneuver=counts_from_now)
        red[counts_from_now] = sum(b.high - b.low for b in found.bands if b.region == "NEAR")
    assert red[False] > red[True] + math.radians(1) > math.radians(2)


def test_an_older_release_counts_its_horizons_from_now(tmp_path):
    text = CONF.replace("turn_rate = 0", "turn_rate = 3").replace("= 90 [s]", "= 180 [s]")
    older = conf(tmp_path, f"{text}\ndaidalus_version = 2.0.1\n")
    newer = conf(tmp_path, text)
    assert bands("hdir", older).bands == bands("hdir", newer, bands_add_time_to_maneuver=True).bands
    assert bands("hdir", older).bands != bands("hdir", newer).bands


def test_an_older_release_finds_no_recovery_later_than_its_last_early_time(tmp_path):
    """Inside the volume recovery takes some seconds: more than 1 s, and less than 90 s."""
    near = CROSSING._replace(east_m=np.float64(-500.0), north_m=np.float64(-300.0))
    small = "min_horizontal_recovery = 200 [m]\nmin_vertical_recovery = 50 [m]"
    found = {}
    for version in ("2.0.1", "2.0.4"):
        for early_s in (90, 1):
            text = f"{CONF}\none_alert_1_early_alerting_time = {early_s} [s]\n{small}"
            configuration = conf(tmp_path, f"{text}\ndaidalus_version = {version}\n")
            one = guidance("hdir", configuration, OWN, [
                GuidedIntruder(near, configuration.alerters[0])])  # fmt: skip
            found[version, early_s] = one.recovery
    assert found["2.0.4", 1] == found["2.0.4", 90]
    assert found["2.0.1", 90].time_s > 1.0
    assert found["2.0.1", 1].time_s == -math.inf


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("daidalus_version = 2.1", "daidalus_version is '2.1': it must be 2.0.1 or 2.0.4"),
        (
            "daidalus_version = 2.0.1\nbands_add_time_to_maneuver = false",
            "bands_add_time_to_maneuver is false and daidalus_version is 2.0.1",
        ),
    ],
)
def test_releases_that_are_not_known_are_refused(tmp_path, lines, said):
    with pytest.raises(TrafficFileError, match=re.escape(said)):
        conf(tmp_path, f"{CONF}\n{lines}\n")


def test_recovery_sizes_of_zero_are_those_of_tcas(tmp_path):
    """Level 3 at least, and by the ownship's altitude: Table of the Federal Aviation booklet."""
    radius, half = recovery_cylinder_sizes_m(np.array([200.0, 1500.0, 12801.6, 12802.0]))
    assert radius / 0.3048 == pytest.approx([1215.0, 2126.0, 6683.0, 6683.0])
    assert half / 0.3048 == pytest.approx([600.0, 600.0, 700.0, 800.0])
    configuration = conf(tmp_path, CONF)
    near = CROSSING._replace(east_m=np.float64(-500.0), north_m=np.float64(-300.0))
    inside = guidance("hdir", configuration, OWN, [GuidedIntruder(near, configuration.alerters[0])])
    assert inside.recovery is not None
    assert inside.recovery.cylinder_m == pytest.approx((2126 * 0.3048, 600 * 0.3048))
