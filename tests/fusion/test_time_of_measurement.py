"""Fused rows and tracks know when their measurement was made, however long it was on its way."""

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, measured, rows, run, sensor

from components.fusion.pass_through import PassThrough

STUB = {"type": "tracking.stub"}
LATE = {**HEARS_ALL, "scan_rate_hz": 2, "latency_s": 0.3}
EYE = {**SEES_ALL, "scan_rate_hz": 5, "latency_s": 0.04}


def late_chain(fusion="fusion.pick_best", **sections):
    return chain(
        {"radar": LATE, "eye": EYE}, fusion={"type": fusion}, tracker=STUB, duration_s=3, **sections
    )


@pytest.mark.parametrize("fusion", ["fusion.pick_best", "fusion.gated"])
def test_what_is_true_of_a_late_row_is_of_the_instant_it_was_measured(fusion):
    found = run(late_chain(fusion))
    fused = rows(found, "fused")
    late = {"radar": 0.3, "eye": 0.04}
    sources = {"radar", "eye"} if fusion == "fusion.pick_best" else {"eye"}
    assert {row["angle_source"] for row in fused} == sources
    if fusion == "fusion.gated":  # they belong together by when they were measured
        assert {row["sensors"] for row in fused if row["time_s"] % 0.5 == 0.3} == {"radar+eye"}
    for row in fused:
        waited = late[row["angle_source"]]
        if "+" not in row["sensors"]:
            assert row["time_s"] - row["measured_s"] == pytest.approx(waited, abs=1e-9)
        (flight,) = (t for t in crooked.TARGETS if t["name"] == row["target"])
        there = crooked.ned(flight, row["measured_s"])
        body = crooked.attitude(crooked.OWNSHIP) @ there
        assert row["true_range_m"] == pytest.approx(float(np.linalg.norm(there)), abs=0.05)
        expected = crooked.angles(body)
        assert row["true_azimuth_rad"] == pytest.approx(expected[0], abs=1e-4)
        # Of the instant at which it came it would be another one.
        now = crooked.ned(flight, row["time_s"])
        if waited > 0.1:
            assert abs(float(np.linalg.norm(now)) - row["true_range_m"]) > 1.0


def test_a_track_s_age_is_the_time_since_its_measurement_was_made():
    found = run(late_chain())
    fused, tracks = rows(found, "fused"), rows(found, "tracks")
    assert len(tracks) > 30
    for row in tracks:
        held = [f for f in fused if f["target"] == row["target"] and f["time_s"] <= row["time_s"]]
        assert row["measured_s"] == held[-1]["measured_s"]
        assert row["age_s"] == pytest.approx(row["time_s"] - row["measured_s"], abs=1e-9)
        assert row["age_s"] >= 0.04 - 1e-9


def test_jitter_and_queues_count_in_the_age_of_information():
    """Wires add up to 0.2 s at random: the mean age grows by their mean."""
    scene = chain(
        {"radar": {**HEARS_ALL, "scan_rate_hz": 1}}, duration_s=60, targets=[crooked.ROLLING],
        fusion={"type": "fusion.pick_best"},
    )  # fmt: skip
    ages = {}
    for jitter_s in (0.0, 0.2):
        wires = [w if isinstance(w, dict) or w != "radar -> fusion" else
                 {"from": "radar", "to": "fusion", "jitter_s": jitter_s}
                 for w in scene["wires"]]  # fmt: skip
        found = measured({**scene, "wires": wires}, "age_of_information")
        ages[jitter_s] = found["age_of_information_mean_s"]
    assert ages[0.0] == pytest.approx(0.5, abs=1e-9)
    assert ages[0.2] - ages[0.0] == pytest.approx(0.1, abs=0.03)


def test_a_sweeping_beam_s_measurement_is_made_when_it_passes():
    sweeping = {**HEARS_ALL, "beam_sweep": True}
    found = run(chain({"radar": sweeping}, fusion={"type": "fusion.pick_best"}, tracker=STUB))
    lit = {row["target"]: row["illuminated_s"] for row in rows(found)}
    for table in ("fused", "tracks"):
        for row in rows(found, table):
            assert row["measured_s"] == pytest.approx(lit[row["target"]], abs=1e-9)
    assert all(row["age_s"] == 0.0 for row in rows(found, "tracks"))


def test_updates_are_counted_when_measurements_come_late():
    scene = chain(
        {"radar": {**HEARS_ALL, "scan_rate_hz": 2, "latency_s": 0.3}}, duration_s=5,
        fusion={"type": "fusion.pick_best"}, tracker=STUB,
    )  # fmt: skip
    found = measured(scene, "track_updates")
    assert found["track_update_interval_s"] == pytest.approx(0.5, abs=1e-9)
    assert found["track_breaks"] == 0.0


def test_variances_and_poses_go_through_the_fusion():
    """Angles' variances are of the sensor that gave the angles, the range's of the other one."""
    radar = {**HEARS_ALL, "azimuth_resolution_deg": 6.0, "elevation_resolution_deg": 3.0,
             "range_resolution_m": 60.0}  # fmt: skip
    eye = {**SEES_ALL, "azimuth_resolution_deg": 0.6, "elevation_resolution_deg": 0.3}
    bias = {"attitude_bias_deg": [2.0, -1.0, 3.0]}
    scene = chain(
        {"radar": radar, "eye": eye}, fusion={"type": "fusion.pick_best"}, tracker=STUB,
        navigation=bias,
    )  # fmt: skip
    found = run(scene)
    for row in rows(found, "fused"):
        assert row["azimuth_variance_rad2"] == pytest.approx(np.radians(0.6) ** 2 / 12, rel=0.02)
        assert row["range_variance_m2"] == pytest.approx(300.0)
        assert row["range_rate_m_s"] is None
    for table in ("fused", "tracks"):
        for row in rows(found, table):
            wrong = np.degrees(row["own_roll_rad"]) - crooked.OWNSHIP["roll_deg"]
            assert wrong == pytest.approx(3.0)
    assert "own_roll_rad" not in run(late_chain())["fused"].column_names


def test_windows_and_single_scans_agree_on_late_rows():
    import dsa_des
    from dsa_des.record.recording import Recorder
    from dsa_des.record.sinks import MemorySink
    from dsa_des.running.simulation import Simulation

    scene = late_chain("fusion.gated", navigation={"position_noise_m": [3, 3, 3]})
    scene["blocks"]["sweep"] = sensor("radar.range_boundary", beam_sweep=True)
    scene["wires"] += ["gate -> sweep", "sweep -> fusion"]
    loaded = dsa_des.load_scene(scene)
    tables = []
    for window in (None, 1, 7):
        sink = MemorySink()
        Simulation(loaded, window=window, recorder=Recorder([sink])).run()
        tables.append(sink.tables())
    assert tables[0] == tables[1] == tables[2]


def test_a_sweeping_radar_s_scan_is_told_as_no_look(monkeypatch):
    """It has no one instant; that of a radar that stares is told, scan by scan."""
    told, as_it_is = [], PassThrough.run

    def noted(self, wake):
        fused = as_it_is(self, wake)
        told.extend(fused.sensors[index] for index in fused.looks.sensor)
        return fused

    monkeypatch.setattr(PassThrough, "run", noted)
    sensors = {"sweeps": {**HEARS_ALL, "beam_sweep": True}, "stares": HEARS_ALL}
    run(chain(sensors, duration_s=3, fusion={"type": "fusion.pass_through"}))
    assert told == ["stares"] * 3
