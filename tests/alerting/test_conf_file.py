"""Configurations: what is read, and one error that names each thing wrong with a bad one."""

import math

import pytest

from components.alert_configuration.conf_file import read_conf
from components.formats.text_rows import TrafficFileError
from components.well_clear.tcas import TcasAdvisory
from components.well_clear.volume import Volume
from tests.alerting.conf_text import CONF

LINES = CONF.splitlines()


def write(tmp_path, text):
    path = tmp_path / "sizes.conf"
    path.write_text(text, encoding="utf-8")
    return path


def line_of(key):
    return 1 + next(i for i, line in enumerate(LINES) if line.startswith(key))


def test_names_units_and_defaults(tmp_path):
    found = read_conf(write(tmp_path, CONF))
    first, second = found.alerters
    assert (first.name, second.name) == ("One_Two", "One")
    far, near = first.levels
    assert far.volume.horizontal_m == pytest.approx(0.7 * 1852)
    assert far.volume.vertical_m == pytest.approx(500 * 0.3048)
    assert (far.volume.horizontal_time_s, far.volume.vertical_time_s) == (30.0, 3.0)
    assert (far.volume.time_variable, near.volume.time_variable) == (
        "modified_tau",
        "time_to_entry",
    )
    assert near.volume.vertical_m == 120.0
    assert (far.alerting_time_s, far.early_alerting_time_s) == (55.0, 75.0)
    assert near.early_alerting_time_s == 25.0
    assert second.levels[0].alerting_time_s == 30.0
    assert (found["hysteresis_time"], found["alerting_n"]) == (5.0, 4)
    assert found["lookahead_time"] == 180.0
    assert found["turn_rate"] == pytest.approx(math.radians(3))
    assert found["vertical_accel"] == pytest.approx(0.25 * 9.80665)
    assert found["min_vs"] == pytest.approx(-6000 * 0.3048 / 60)
    assert found.first_corrective_level(first) is far


def test_keys_are_read_in_any_case_and_order(tmp_path):
    shuffled = "\n".join(reversed([line.lower() for line in LINES]))
    shuffled = shuffled.replace("gov.nasa.larcfm.accord.wcv_", "gov.nasa.larcfm.ACCoRD.WCV_")
    for name in ("taumod", "tep", "tcpa"):
        shuffled = shuffled.replace(f"WCV_{name}\n", f"WCV_{name.upper()}\n")
    found = read_conf(write(tmp_path, shuffled))
    assert [level.volume for level in found.alerters[0].levels] == [
        level.volume for level in read_conf(write(tmp_path, CONF)).alerters[0].levels
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("hysteresis_time = 5 [s]", "hysteresis_time = 5", "hysteresis_time has no unit"),
        ("hysteresis_time = 5 [s]", "hysteresis_time = 5 [ft]", "has the unit [ft]"),
        ("hysteresis_time", "hysteresis_tim", "did you mean 'hysteresis_time'"),
        ("= 500 [ft]", "= -500 [ft]", "One_Two_far_WCV_ZTHR is -500: it may not be negative"),
        ("= 500 [ft]", "= 0 [ft]", "One_Two_far_WCV_ZTHR is 0: it must be above 0"),
        ("= 500 [ft]", "= nan [ft]", "a finite number is needed"),
        ("= 500 [ft]", "= 5_00 [ft]", "a number is needed"),
        ("= 500 [ft]", "= [ft]", "has no value"),
        ("region = MID\nOne_Two", "region = MDI\nOne_Two", "did you mean 'MID'"),
        ("alerting_m = 2", "alerting_m = 5", "must be at most alerting_n, 4"),
        ("alerting_m = 2", "alerting_m = 2.5", "a whole number is needed"),
        ("WCV_TEP", "WCV_TEPP", "did you mean 'WCV_TEP'"),
        ("alert_2_detector = near", "alert_2_detector = nea", "did you mean 'near'"),
        ("One_far", "One_far", "the alerter 'Three' has no levels"),
        ("alert_2", "alert_3", "has level 3 but no level 2"),
        ("alerters = One_Two, One", "", "there is no key 'alerters'"),
        ("One_d_WCV_TTHR = 12 [s]", "", "'One_d_WCV_TTHR' is missing"),
        ("alerting_n = 4", "alerting_n = 4\nalerting_N = 4", "stands in line 8 already"),
        ("alerting_n = 4", "alerting_n = 4\nconflict_crit = true", "only false is supported"),
        ("alerting_n = 4", "alerting_n = 4\nlookahead_time = 0 [s]", "it must be above 0"),
        ("alerting_n = 4", "alerting_n = 4\nwhat is this", "is not 'key = value [unit]'"),
        ("false", "maybe", "it must be true or false"),
        (
            "One_Two_alert_2_region",
            "One_Two_alert_2_spread_hdir = -3 [deg]\nOne_Two_alert_2_region",
            "One_Two_alert_2_spread_hdir is -3: it may not be negative",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, said):
    text = CONF.replace(old, new)
    if "Three" in said:
        text = text.replace("One_Two, One", "One_Two, One, Three")
    with pytest.raises(TrafficFileError) as error:
        read_conf(write(tmp_path, text))
    assert said in str(error.value)
    assert "sizes.conf" in str(error.value)


def test_everything_wrong_is_said_at_once_with_its_line(tmp_path):
    text = CONF.replace("hysteresis_time = 5 [s]", "hysteresis_time = 5")
    text = text.replace("One_d_WCV_DTHR = 1 [km]", "One_d_WCV_DTHR = one [km]")
    with pytest.raises(TrafficFileError) as error:
        read_conf(write(tmp_path, text))
    assert "2 problems" in str(error.value)
    assert f"line {line_of('hysteresis')}:" in str(error.value)
    assert f"line {line_of('One_d_WCV_DTHR')}:" in str(error.value)
    assert str(error.value).index("hysteresis_time") < str(error.value).index("One_d_WCV_DTHR")


def test_what_is_no_configuration_says_what_one_holds(tmp_path):
    with pytest.raises(TrafficFileError, match="empty: lines key = value"):
        read_conf(write(tmp_path, "# nothing"))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(TrafficFileError, match="there is no such file"):
        read_conf(tmp_path / "none.conf")


def said_of(tmp_path, text):
    with pytest.raises(TrafficFileError) as error:
        read_conf(write(tmp_path, text))
    return error.value.problems


def test_after_one_misspelt_detector_nothing_is_said_of_its_sizes(tmp_path):
    """They were called unknown, each with the name of something else."""
    (problem,) = said_of(
        tmp_path, CONF.replace("alert_2_detector = near", "alert_2_detector = nea")
    )
    assert problem.endswith("One_Two_load_core_detection_nea is missing; did you mean 'near'?")
    key = "One_Two_load_core_detection_near"
    one, other = said_of(tmp_path, CONF.replace(key, "One_Two_load_core_detecton_near"))
    assert one.endswith(f"is unknown; did you mean '{key}'?")
    assert other.endswith(f"One_Two_alert_2_detector is 'near': {key} is missing")


def test_a_detector_that_no_level_names_is_named(tmp_path):
    (problem,) = said_of(
        tmp_path, CONF.replace("alert_2_detector = near", "alert_2_detector = far")
    )
    assert problem.endswith(
        "One_Two_load_core_detection_near: no level of One_Two names this detector"
    )


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ("One_Two_far_WCV_ZTHR", "One_Two_far_WCV_ZTRH", "One_Two_far_WCV_ZTHR"),
        ("One_Two_far_WCV_ZTHR", "One_Tow_far_WCV_ZTHR", "One_Two_far_WCV_ZTHR"),
        (
            "One_Two_alert_1_early_al",
            "One_Two_alert_1_erly_al",
            "One_Two_alert_1_early_alerting_time",
        ),
        ("One_Two, One", "One_Tow, One", "One_Two"),
    ],
)
def test_hints_are_keys_that_are_missing_as_they_are_written(tmp_path, old, new, meant):
    first = said_of(tmp_path, CONF.replace(old, new))[0]
    assert first.endswith(f"did you mean {meant!r}?")


def test_keys_like_no_other_are_named_in_one_line(tmp_path):
    """Fifty keys of another program were twenty problems at a time."""
    (problem,) = said_of(tmp_path, CONF + "".join(f"Geofence{k}Radius = 1\n" for k in range(50)))
    last = CONF.count("\n") + 50
    assert problem.startswith("50 keys are unknown: Geofence0Radius (line ")
    assert problem.endswith(f", Geofence49Radius (line {last})")
    # Nothing is meant that is there already.
    (alone,) = said_of(tmp_path, CONF + "One_Two_far_WCV_TTHH = 1 [s]\n")
    assert alone.endswith("the key 'One_Two_far_WCV_TTHH' is unknown")


def test_a_file_of_release_1_is_called_that(tmp_path):
    text = "left_trk = 180 [deg]\nmin_gs = 10 [knot]\nalert_1_detector = det_1\nwhatever = 3\n"
    (problem,) = said_of(tmp_path, text)
    assert problem.startswith("this is a configuration of DAIDALUS 1 (left_trk, min_gs")


CYLINDER = """\
alerters = CD
CD_load_core_detection_c = gov.nasa.larcfm.ACCoRD.CDCylinder
CD_c_D = 5 [nmi]
CD_c_H = 1000 [ft]
CD_alert_1_detector = c
CD_alert_1_region = NEAR
CD_alert_1_alerting_time = 180 [s]
"""


def test_a_cylinder_is_read(tmp_path):
    (level,) = read_conf(write(tmp_path, CYLINDER)).alerters[0].levels
    assert level.volume == Volume(5 * 1852.0, 1000 * 0.3048)
    assert said_of(tmp_path, CYLINDER.replace("CD_c_H = 1000 [ft]", "CD_c_H = 0 [ft]"))[0].endswith(
        "CD_c_H is 0: it must be above 0"
    )


@pytest.mark.parametrize("misspelt", ["CDCylindr", "Cylinders", "Nonsense"])
def test_after_a_misspelt_class_its_sizes_are_those_of_the_class_that_is_meant(tmp_path, misspelt):
    """Those of another class were said to be missing, and its own unknown."""
    text = CYLINDER.replace("CDCylinder", misspelt)
    (problem,) = said_of(tmp_path, text)
    assert problem.endswith("TCAS3D" if misspelt == "Nonsense" else "did you mean 'CDCylinder'?")
    if misspelt != "Nonsense":
        both = said_of(tmp_path, text.replace("1000 [ft]", "1000 [kn]"))
        assert len(both) == 2 and "CD_c_H has the unit [kn]" in both[1]


TCAS = """\
alerters = TCASII
TCASII_load_core_detection_d = gov.nasa.larcfm.ACCoRD.TCAS3D
TCASII_alert_1_detector = d
TCASII_alert_1_region = NEAR
TCASII_alert_1_alerting_time = 0 [s]
TCASII_d_TCAS_HMDFilter = {filter}
TCASII_d_TCAS_level_2 = 1000 [ft]
TCASII_d_TCAS_level_3 = 2350 [ft]
TCASII_d_TCAS_TAU_2 = {tau} [s]
TCASII_d_TCAS_DMOD_4 = {dmod} [nmi]
TCASII_d_TCAS_ZTHR_8 = {zthr} [ft]
TCASII_d_TCAS_HMD_5 = {hmd} [ft]
"""
TRAFFIC = {"filter": "false", "tau": 20, "dmod": 0.48, "zthr": 1200, "hmd": 77}
RESOLUTION = {"filter": "true", "tau": 0, "dmod": 0.35, "zthr": 800, "hmd": 3342}


def test_tables_of_tcas_that_are_written_out_are_held_against_ours(tmp_path):
    """By the FAA's booklet; a traffic advisory heeds no miss distance."""
    for values, resolution in ((TRAFFIC, False), (RESOLUTION, True)):
        (level,) = read_conf(write(tmp_path, TCAS.format(**values))).alerters[0].levels
        assert level.volume == TcasAdvisory(resolution)
    (problem,) = said_of(tmp_path, TCAS.format(**{**RESOLUTION, "zthr": 850, "hmd": 1}))
    assert problem == (
        "line 2: TCASII_d_TCAS_ZTHR_8 and 1 more are not as in the table of resolution advisories "
        "of TCAS II version 7.1, the only one that is used"
    )
    (problem,) = said_of(tmp_path, TCAS.format(**{**RESOLUTION, "filter": "false"}))
    assert problem.startswith(
        "line 2: TCASII_d_TCAS_HMDFilter is not as in the table of resolution"
    )
    (problem,) = said_of(tmp_path, TCAS.format(**TRAFFIC).replace("TAU_2 = 20 [s]", "TAU_2 = 20"))
    assert problem.startswith("line 9: TCASII_d_TCAS_TAU_2 has no unit")
    (problem,) = said_of(tmp_path, TCAS.format(**TRAFFIC).replace("2350", "2300"))
    assert problem.startswith("line 2: TCASII_d_TCAS_level_3 is not as in the table")


@pytest.mark.parametrize("version", ["2.0.2", '"2.0.3"'])
def test_a_release_between_those_that_are_known_is_taken_for_the_last(tmp_path, version):
    found = read_conf(write(tmp_path, f"{CONF}daidalus_version = {version}\n"))
    (note,) = found.notes()
    assert note.startswith(f"daidalus_version is {version.strip(chr(34))}: the rules of 2.0.4")
