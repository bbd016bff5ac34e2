"""The table ``truth``: the ownship and every target at every scan, near or far."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window
from wired import HEARS_ALL, SEES_ALL, chain, rows, run

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

ON = {"truth": True}
SENSORS = {
    "radar": {**HEARS_ALL, "scan_rate_hz": 2, "latency_s": 0.3},
    "eye": {**SEES_ALL, "scan_rate_hz": 3, "offset_s": 0.1, "jitter_s": 0.005},
}
VELOCITY = ("velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s")


def tables(scene, **options):
    sink = MemorySink()
    Simulation(dsa_des.load_scene(scene), recorder=Recorder([sink]), **options).run()
    return sink.tables()


@covers("truth", of=("[record]",))
def test_everybody_is_where_he_is_at_every_scan():
    found = run(chain(SENSORS, duration_s=2, record=ON))
    truth = rows(found, "truth")
    scans = {row["tick"] for row in rows(found, "scans")}
    assert {row["tick"] for row in truth} == scans and len(truth) == 3 * len(scans)
    for row in truth:
        (flight,) = (
            t for t in (*crooked.TARGETS, crooked.OWNSHIP) if t.get("name") == row["target"]
        )
        there = crooked.geodetic(crooked.position(flight, row["time_s"]))
        assert row["lat_deg"] == pytest.approx(there[0], abs=1e-7)
        assert math.remainder(row["lon_deg"] - there[1], 360.0) == pytest.approx(0.0, abs=1e-7)
        assert row["alt_m"] == pytest.approx(there[2], abs=0.01)
        turned = [math.degrees(row[f"{name}_rad"]) for name in ("heading", "pitch", "roll")]
        expected = [flight[f"{name}_deg"] for name in ("yaw", "pitch", "roll")]
        np.testing.assert_allclose(turned, expected, atol=1e-9)
        course, speed = math.radians(flight["heading_deg"]), flight["speed_mps"]
        expected = [speed * math.cos(course), speed * math.sin(course), -flight["climb_mps"]]
        np.testing.assert_allclose([row[name] for name in VELOCITY], expected, atol=0.02)
    assert "truth" not in run(chain(SENSORS, duration_s=2, record={"truth": False})).tables


def test_by_default_the_truth_is_there_where_it_is_small():
    assert "truth" in run(chain(SENSORS, duration_s=2)).tables
    radar = {"radar": {**HEARS_ALL, "scan_rate_hz": 0.1}}
    for duration_s, there in ((200, True), (201, False)):  # three aircraft
        assert ("truth" in tables(chain(radar, duration_s=duration_s))) is there


@pytest.mark.parametrize("alone", [{}, {"processors": {"cpu": {"service_s": 0.001}}}])
def test_replicas_are_counted_together_in_lock_step_and_one_by_one(alone):
    """Three aircraft and 50 s: four replicas have 600 aircraft seconds, five have more."""
    from dsa_des.replicas.changed_scene import Replica
    from dsa_des.replicas.replicas import run_replicas

    radar = {**HEARS_ALL, "scan_rate_hz": 0.1, **({"processor": "cpu"} if alone else {})}
    loaded = dsa_des.load_scene(chain({"radar": radar}, duration_s=50, **alone))
    for count, there in ((4, True), (5, False)):
        found = run_replicas(loaded, [Replica(number) for number in range(count)])
        assert [(run.shared is None) for run in found] == [bool(alone)] * count
        assert [("truth" in run.tables) for run in found] == [there] * count


def test_tables_that_nobody_reads_make_no_truth_and_one_that_is_read_does():
    """Whatever the size of the scene, as a study chooses tables; ``truth = false`` stands."""
    radar = {"radar": {**HEARS_ALL, "scan_rate_hz": 0.1}}
    for duration_s in (20, 300):
        for record, wanted, there in (
            ({}, {"scans": ()}, False), (ON, {"scans": ()}, False),
            ({}, {"truth": ("alt_m",)}, True), ({"truth": False}, {"truth": ("alt_m",)}, False),
        ):  # fmt: skip
            loaded = dsa_des.load_scene(chain(radar, duration_s=duration_s, record=record))
            simulation = Simulation(loaded, recorder=Recorder([], wanted=wanted))
            assert simulation.components["traffic"].says_truth is there


def test_misses_of_late_rows_are_compared_with_the_truth_of_their_instant():
    """A fused row's true range is that between ownship and target at measured_s in the table."""
    import pymap3d

    scene = chain(SENSORS, duration_s=2, fusion={"type": "fusion.pick_best"}, record=ON)
    found = run(scene)
    place = {(round(row["time_s"], 9), row["target"]): row for row in rows(found, "truth")}
    fused = rows(found, "fused")
    assert any(row["time_s"] - row["measured_s"] > 0.2 for row in fused)
    for row in fused:
        when = round(row["measured_s"], 9)
        own, target = (
            pymap3d.geodetic2ecef(*(place[when, who][n] for n in ("lat_deg", "lon_deg", "alt_m")))
            for who in (None, row["target"])
        )
        assert row["true_range_m"] == pytest.approx(math.dist(own, target), abs=1e-5)


def far_scene(**more):
    far = {**crooked.DIVING, "name": "far", "east_m": 90_000.0}
    leaving = {**crooked.ROLLING, "name": "leaving", "end_time_s": 0.7}
    radar = {**HEARS_ALL, "scan_rate_hz": 4, "range_km": 8}
    return chain(
        {"radar": radar}, targets=[crooked.DIVING, far, leaving], duration_s=2, record=ON, **more
    )


def test_targets_that_no_sensor_looks_at_are_there_as_well():
    scene = far_scene()
    culled, whole = tables(scene), tables(scene, simulate_everything=True)
    assert culled["truth"] == whole["truth"]
    assert sum(culled["scans"]["skipped_culled"].to_pylist()) > 0
    names = culled["truth"]["target"].to_pylist()
    assert names.count("far") == names.count("diving") == names.count(None) == 8
    assert names.count("leaving") == 3  # from 0 to 0.5 s


def test_the_truth_does_not_depend_on_the_window():
    same_in_any_window(dsa_des.load_scene(far_scene()), (1, 3))


def test_a_velocity_where_a_flight_begins_or_ends_is_that_of_its_own_side():
    truth = [row for row in rows(run(far_scene()), "truth") if row["target"] == "leaving"]
    speeds = [math.hypot(row[VELOCITY[0]], row[VELOCITY[1]]) for row in truth]
    np.testing.assert_allclose(speeds, crooked.ROLLING["speed_mps"], atol=0.02)


@pytest.mark.parametrize("key", ["blocks.radar.scan_rate_hz", "blocks.traffic.intruders[0].up_m"])
def test_replicas_in_lock_step_have_the_truth_of_each(key):
    """Of shared traffic and of one for each replica."""
    values = (4.0, 5.0) if "radar" in key else (-510.0, -400.0)
    same_as_alone(replicas_of(dsa_des.load_scene(far_scene()), *({key: v} for v in values)))


def test_a_steered_ownship_is_where_it_was_steered():
    """The truth of an ownship in a loop is that of its rows, scan by scan or in windows."""
    scene = dsa_des.load_scene("crossing", duration_s=30, sets=["blocks.alerting.scan_rate_hz=1"])
    found = []
    for window in (None, 1):
        sink = MemorySink()
        Simulation(scene, recorder=Recorder([sink]), window=window).run()
        found.append(sink.tables()["truth"])
    assert found[0] == found[1]
    headings = [r["heading_rad"] for r in found[0].to_pylist() if r["target"] is None]
    assert max(headings) - min(headings) > 0.1
