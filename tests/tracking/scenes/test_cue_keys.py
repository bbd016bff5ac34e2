"""Every key of cues reaches what it says: who is cued, where, when, and what a sensor then does."""

import math

import crooked
import numpy as np
import pytest
from covering import CAMERAS, LINK_BUDGETS, covers
from same_runs import replicas_of, same_as_alone, same_in_any_window
from wired import chain, rows, run, sensor

import dsa_des

KIND = "tracking.cues"
TOWARDS_ROLLING = math.degrees(crooked.angles(crooked.body(crooked.ROLLING))[0])
#: Sees only what is about where the rolling aircraft is, and errs as said.
SPOTTER = {
    "type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 20.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.3, "elevation_error_deg": 0.3, "range_error_m": 10.0,
    "azimuth_deg": [TOWARDS_ROLLING - 12.0, TOWARDS_ROLLING + 12.0],
}  # fmt: skip
DELAY_S = 0.25


def cued(kind="radar.threshold", *, cues=None, spotter=None, tracker=None, duration_s=4, wire=True,
         targets=crooked.TARGETS, **keys):  # fmt: skip
    """A scene whose spotter's tracks cue another sensor."""
    scene = chain(
        {"spotter": {**SPOTTER, **(spotter or {})}, "sensor": sensor(kind, **keys)},
        targets=targets, duration_s=duration_s, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf", "confirm_m": 3, "confirm_n": 4, **(tracker or {})},
        record={"looks": True},
    )  # fmt: skip
    scene["wires"].remove("sensor -> fusion")
    scene["blocks"]["cues"] = {"type": KIND, "every_s": 0, **(cues or {})}
    scene["wires"].append("tracker -> cues")
    if wire:
        scene["wires"].append({"from": "cues", "to": "sensor", "delay_s": DELAY_S, "holds": {}})
    return scene


def told(**keys):
    return rows(run(cued(**keys)), "cues")


def test_who_lies_in_a_cone_is_cued_from_when_it_has_come():
    found = rows(run(cued()), block="sensor")
    assert {row["target"] for row in found} == {"rolling", "diving"}
    for row in found:
        assert row["cued"] is (row["target"] == "rolling" and row["time_s"] >= DELAY_S), row
    assert {row["cued"] for row in rows(run(cued(wire=False)), block="sensor")} == {False}


def test_a_false_alarm_in_a_cone_is_cued_as_a_target_would_be():
    """By where it is reported: within 20 deg of the one who is tracked, as far as that is known.

    Every cone has ended by the second scan after it came.
    """
    noise = {"false_alarms": True, "false_alarm_probability": 2e-3, "range_km": 8.0,
             "azimuth_resolution_deg": 4.0, "elevation_resolution_deg": 4.0,
             "range_resolution_m": 400.0, "quantised": False, "errors": "stated",
             "azimuth_error_deg": 0.1, "scan_rate_hz": 4}  # fmt: skip
    wide = {"least_half_angle_deg": 20.0, "most_half_angle_deg": 90.0, "sigmas": 0.001,
            "lasts_s": 0.3}  # fmt: skip
    found = rows(run(cued(cues=wide, duration_s=2, **noise)), block="sensor")
    ahead = {r["time_s"]: crooked.direction(r["true_azimuth_rad"], r["true_elevation_rad"])
             for r in found if r["target"] == "rolling"}  # fmt: skip
    seen = set()
    for row in found:
        line = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        off_deg = math.degrees(math.acos(min(1.0, float(line @ ahead[row["time_s"]]))))
        if row["target"] is None and abs(off_deg - 20.0) > 2.0:
            assert row["cued"] is (off_deg < 20.0 and row["time_s"] % 0.5 == DELAY_S)
            seen.add(row["cued"])
    assert seen == {True, False}


@covers("sigmas", "lasts_s", "acceleration_intensity_m2_s3", "least_half_angle_deg", of=(KIND,))
def test_a_cone_is_that_of_a_computation_by_hand():
    """Half angle: standard deviations across the line of sight at the end of the cone's time."""
    result = run(cued(cues={"sigmas": 2.5, "lasts_s": 1.5, "acceleration_intensity_m2_s3": 9.0,
                            "least_half_angle_deg": 0.01}))  # fmt: skip
    cone, track = rows(result, "cues")[-1], rows(result, "state_tracks")[-1]
    names = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
    spread = np.empty((6, 6))
    for name, value in track.items():
        if name.startswith("covariance_"):
            i, j = int(name[11]), int(name[12])
            spread[i, j] = spread[j, i] = value
    step = np.hstack([np.eye(3), 1.5 * np.eye(3)])
    later = step @ spread @ step.T + 9.0 * 1.5**3 / 3.0 * np.eye(3)
    away = np.array([track[n] - track[f"own_{n}"] for n in names[:3]])
    distance = np.linalg.norm(away)
    across = np.linalg.svd(away[None, :])[2][1:]
    widest = np.linalg.eigvalsh(across @ later @ across.T)[-1]
    assert cone["half_angle_rad"] == pytest.approx(2.5 * math.sqrt(widest) / distance, rel=1e-9)
    assert cone["azimuth_rad"] == pytest.approx(math.atan2(away[1], away[0]) % (2 * math.pi))
    assert cone["until_s"] - cone["state_s"] == pytest.approx(1.5)
    assert [cone[n] for n in names] == [track[n] for n in names]
    wide = told(cues={"least_half_angle_deg": 8.0})
    assert {row["half_angle_rad"] for row in wide[-2:]} == {math.radians(8.0)}


def test_a_cone_follows_its_target_and_ends_in_time():
    """One cue, of a track that knows its velocity: the target moves out of where the cone was."""
    cues = {"least_half_angle_deg": 2.0, "most_half_angle_deg": 170.0, "sigmas": 0.001,
            "tentative": False, "every_s": 100, "lasts_s": 3.2}  # fmt: skip
    precise = {"azimuth_error_deg": 0.02, "elevation_error_deg": 0.02, "range_error_m": 1.0}
    result = run(cued(cues=cues, spotter=precise, duration_s=7))
    assert {row["time_s"] for row in rows(result, "cues")} == {1.0}
    seen = [r for r in rows(result, block="sensor") if r["target"] == "rolling"]
    assert [r["time_s"] for r in seen if r["cued"]] == [2.0, 3.0, 4.0]


@covers("most_half_angle_deg", "tentative", "every_s", of=(KIND,))
def test_which_tracks_cue_and_how_often():
    assert told()[0]["time_s"] == 0.0
    assert min(r["time_s"] for r in told(cues={"tentative": False})) == 1.0
    first = told(cues={"least_half_angle_deg": 0.01, "most_half_angle_deg": 90.0})[0]
    limit = math.degrees(first["half_angle_rad"])
    narrow = {"least_half_angle_deg": 0.01, "most_half_angle_deg": limit * 0.999}
    assert told(cues=narrow)[0]["time_s"] > 0.0
    assert [r["time_s"] for r in told(cues={"every_s": 1.5})] == [0.0, 1.5, 3.0]


def test_cues_are_of_when_the_tracks_come():
    scene = cued(cues={"lasts_s": 1.0})
    scene["wires"].remove("tracker -> cues")
    scene["wires"].append({"from": "tracker", "to": "cues", "delay_s": 0.7})
    found = rows(run(scene), "cues")
    assert found[0]["time_s"] == pytest.approx(0.7)
    assert {round(row["time_s"] - row["state_s"], 9) for row in found} == {0.7}


def looked(target="rolling", **keys):
    """The last look at a target, with what was decided and measured."""
    return [r for r in rows(run(cued(**keys)), "looks", block="sensor") if r["target"] == target][
        -1
    ]


@covers("cued_dwell_factor", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_longer_dwell_adds_up_in_the_snr_of_who_is_cued(kind):
    usual, longer = (looked(kind=kind, cued_dwell_factor=f) for f in (1.0, 5.0))
    assert longer["snr_db"] - usual["snr_db"] == pytest.approx(10 * math.log10(5), abs=1e-9)
    usual, longer = (looked("diving", kind=kind, cued_dwell_factor=f) for f in (1.0, 5.0))
    assert longer == usual


@covers("cued_threshold_db", of=("radar.threshold",))
def test_a_lower_threshold_holds_for_who_is_cued():
    level = looked()["snr_db"]
    other = looked("diving")["snr_db"]
    keys = {"threshold_db": max(level, other) + 10.0}
    assert not looked(**keys)["detected"]
    assert looked(cued_threshold_db=level - 0.01, **keys)["detected"]
    assert not looked(cued_threshold_db=level + 0.01, **keys)["detected"]
    assert not looked("diving", cued_threshold_db=-200.0, **keys)["detected"]


@covers("cued_pulses", "cued_false_alarm_probability", of=("radar.swerling",))
def test_pulses_and_false_alarms_of_who_is_cued():
    """Steady target, Marcum: from 1 to 4 pulses and to another Pfa, by scipy's ncx2."""
    from scipy.stats import chi2, ncx2

    keys = {"kind": "radar.swerling", "false_alarm_probability": 1e-6}
    loud = 10 ** (looked(**keys, power_w=1.0)["snr_db"] / 10)
    keys["power_w"] = 10.0 / loud
    usual = looked(**keys)
    snr = 10 ** (usual["snr_db"] / 10)

    def pd(pulses, pfa):
        threshold = chi2.isf(pfa, 2 * pulses)
        return ncx2.sf(threshold, 2 * pulses, 2 * pulses * snr)

    assert usual["detection_probability"] == pytest.approx(pd(1, 1e-6), rel=1e-6)
    assert 1e-5 < usual["detection_probability"] < 0.9
    more = looked(**keys, cued_pulses=4)
    assert more["detection_probability"] == pytest.approx(pd(4, 1e-6), rel=1e-6)
    lower = looked(**keys, cued_false_alarm_probability=1e-3)
    assert lower["detection_probability"] == pytest.approx(pd(1, 1e-3), rel=1e-6)
    assert looked("diving", **keys, cued_pulses=4) == looked("diving", **keys)


@covers("cued_beam_first", of=LINK_BUDGETS)
@pytest.mark.parametrize("kind", LINK_BUDGETS)
def test_a_beam_visits_cones_first(kind):
    def lit(target, **keys):
        found = rows(run(cued(kind, beam_sweep=True, **keys)), block="sensor", target=target)
        return [r["illuminated_s"] - r["time_s"] for r in found]

    usual, first = lit("rolling"), lit("rolling", cued_beam_first=True)
    assert usual[-1] > 0.1
    assert first[0] == usual[0]
    assert first[1:] == [0.0] * (len(first) - 1)
    # Everything is as it is when the scan begins, as a radar sees it that does not sweep.
    swept, still = (
        [row["true_range_m"] for row in rows(run(cued(kind, **keys)), block="sensor",
                                             target="rolling")]
        for keys in ({"beam_sweep": True, "cued_beam_first": True}, {})
    )  # fmt: skip
    assert swept[0] != still[0] and swept[1:] == still[1:]
    assert lit("diving", cued_beam_first=True) == lit("diving")


@covers("cued_threshold", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_camera_s_threshold_is_lower_for_who_is_cued(kind):
    found = rows(run(cued(kind)), block="sensor", target="rolling")
    level = found[-1]["confidence"] - 1.0  # all is detected at a threshold of -1
    high = {"threshold": 1e9}
    assert not looked(kind=kind, **high)["detected"]
    assert looked(kind=kind, cued_threshold=0.99 * level, **high)["detected"]
    assert not looked(kind=kind, cued_threshold=1.01 * level, **high)["detected"]
    assert not looked("diving", kind=kind, cued_threshold=0.0, **high)["detected"]


def problems(scene):
    with pytest.raises(Exception) as caught:
        dsa_des.load_scene(scene)
    return str(caught.value)


def test_what_cannot_be_is_refused():
    scene = cued()
    scene["wires"][-1] = "cues -> sensor"
    assert "cycle" in problems_of_loop(scene)
    for kind in ("radar.range_boundary", "optical.range_boundary"):
        with pytest.raises(Exception, match="cues cues it, and it takes no cues"):
            run(cued(kind))
    assert "cued_dwell_factor" in problems(cued(cued_dwell_factor=-2.0))
    assert "sigmas" in problems(cued(cues={"sigmas": -1}))
    assert "least_half_angle_deg" in problems(cued(cues={"least_half_angle_deg": 40.0}))
    assert "beam_sweep" in problems(cued(cued_beam_first=True))


def problems_of_loop(scene):
    """A loop needs a way back: the spotter itself is cued."""
    scene = cued("radar.threshold")
    scene["wires"] = [w for w in scene["wires"] if not isinstance(w, dict)]
    scene["wires"] += ["sensor -> fusion", "cues -> sensor"]
    return problems(scene)


@pytest.mark.parametrize("late", ["drop", "one_step"])
def test_a_loop_is_the_same_whatever_its_windows_and_company(late):
    """The sensor that is cued feeds the tracker that cues it.

    Looks of the spotter come late, so that the tracker has to remember those of the other.
    """
    grid = {"azimuth_resolution_deg": 0.5, "elevation_resolution_deg": 0.5,
            "range_resolution_m": 20.0}  # fmt: skip
    scene = cued("radar.swerling", cued_dwell_factor=3.0, power_w=1e3, **grid,
                 spotter={"latency_s": 0.9}, tracker={"late": late})  # fmt: skip
    scene["wires"].append("sensor -> fusion")
    loaded = dsa_des.load_scene(scene)
    same_in_any_window(loaded, (1, 40))
    same_as_alone(replicas_of(loaded, {}, {}))
