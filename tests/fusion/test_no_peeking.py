"""Who was detected decides nothing in the gated fusion; a believed pose that is wrong does."""

from dataclasses import replace

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, noise_crosses, rows, run

import dsa_des
from components.fusion.gated import Gated

NOT_MEASURED = ("target", "true_azimuth_rad", "true_elevation_rad", "true_range_m")
GRID = {"azimuth_resolution_deg": 3.0, "elevation_resolution_deg": 3.0}
NOISY = {**HEARS_ALL, **GRID, "range_resolution_m": 150, "range_km": 6, "scan_rate_hz": 2,
         **noise_crosses("radar.threshold", 3e-4)}  # fmt: skip
#: Close together, so that gates have to choose, in cells of a coarse grid, so that some are alike.
CLOSE = [
    {**crooked.ROLLING, "name": f"t{i}", "east_m": -2349.0 + 60.0 * i, "up_m": 420.0 + 25.0 * i}
    for i in range(5)
]


def crowd(targets):
    sensors = {"radar": NOISY, "eye": {**SEES_ALL, **GRID, "scan_rate_hz": 5, "latency_s": 0.03},
               "other": {**HEARS_ALL, **GRID, "scan_rate_hz": 3}}  # fmt: skip
    return chain(
        sensors, targets=targets, duration_s=3,
        fusion={"type": "fusion.gated", "angle_gate_deg": 4.0},
    )  # fmt: skip


def fused(scene):
    table = run(scene)["fused"]
    return table.drop(list(NOT_MEASURED)), table


def test_other_names_and_another_order_fuse_the_same_measured_values():
    plain, table = fused(crowd(CLOSE))
    renamed = [{**target, "name": f"z{9 - i}"} for i, target in enumerate(CLOSE)]
    shuffled = [renamed[i] for i in (3, 0, 4, 1, 2)]
    other, relabelled = fused(crowd(shuffled))
    assert len(plain) > 100 and plain == other
    assert set(relabelled["target"].to_pylist()) == {None, *(t["name"] for t in renamed)}
    # False alarms compete: some stand in rows of their own, some are in one with a detection.
    alarms = [row for row in table.to_pylist() if row["target"] is None]
    assert {row["sensors"] for row in alarms} >= {"radar"}


def test_what_is_true_is_not_looked_at(monkeypatch):
    """The same run with every detection's truth and target shuffled on its way into the fusion."""
    plain, _ = fused(crowd(CLOSE))
    run_as_it_is = Gated.run

    def blindfolded(self, wake):
        for new in wake.arrivals("detections"):
            detections, rng = new.message, np.random.default_rng(1)
            count = len(detections.target)
            object.__setattr__(new, "message", replace(
                detections,
                target=rng.integers(-1, 5, count),
                true_azimuth_rad=rng.normal(size=count),
                true_elevation_rad=rng.normal(size=count),
                true_range_m=rng.normal(size=count),
            ))  # fmt: skip
        return run_as_it_is(self, wake)

    monkeypatch.setattr(Gated, "run", blindfolded)
    other, _ = fused(crowd(CLOSE))
    assert plain == other


TURNING = {**crooked.OWNSHIP, "legs": [{"kind": "turn", "radius_m": 800}]}
del TURNING["yaw_deg"]


def in_a_turn(**sections):
    """A radar and, 0.4 s later, a camera, on an ownship that turns by 2 deg in between."""
    ahead = {**crooked.DIVING, "speed_mps": 0.0, "climb_mps": 0.0, "east_m": -2400.0}
    sensors = {"radar": HEARS_ALL, "eye": {**SEES_ALL, "offset_s": 0.4}}
    gates = {"type": "fusion.gated", "time_gate_s": 0.5, "angle_gate_deg": 1.0}
    return chain(sensors, ownship=TURNING, targets=[ahead], fusion=gates, **sections)


def test_association_goes_with_the_turn_of_the_ownship():
    found = run(in_a_turn())
    azimuth = [row["azimuth_rad"] for row in rows(found)]
    assert len(azimuth) == 2 and abs(np.degrees(azimuth[1] - azimuth[0])) > 1.5
    assert [row["sensors"] for row in rows(found, "fused")] == ["radar", "radar+eye"]


@pytest.mark.parametrize(("noise_deg", "together"), [(0.0, True), (20.0, False)])
def test_an_attitude_that_is_believed_wrongly_parts_what_belongs_together(noise_deg, together):
    # Forgotten between the two looks, as noise that lasts errs alike in both.
    noise = {"attitude_noise_deg": [noise_deg, 0.0, 0.0], "attitude_correlation_time_s": 0.01}
    found = run({**in_a_turn(navigation=noise), "seed": 2})
    last = rows(found, "fused")[-1]
    assert last["sensors"] == ("radar+eye" if together else "eye")


def test_explain_says_that_pick_best_goes_by_the_truth():
    from dsa_des.running.simulation import Simulation

    sentences = {}
    for kind in ("fusion.pick_best", "fusion.gated"):
        scene = chain({"radar": HEARS_ALL}, fusion={"type": kind})
        block = Simulation(dsa_des.load_scene(scene)).components["fusion"]
        sentences[kind] = " ".join(block.skipped_work_notes())
    assert "association by truth" in sentences["fusion.pick_best"]
    assert "truth" not in sentences["fusion.gated"]


def test_nothing_is_reported_at_range_0():
    near = {**crooked.ROLLING, "name": "near", "east_m": 20.0, "north_m": 10.0, "up_m": 5.0}
    for resolution_m, reported in ((150.0, 150.0), (0.0, None)):
        radar = {**HEARS_ALL, "range_resolution_m": resolution_m, "minimum_range_m": 1.0}
        found = rows(run(chain({"radar": radar}, targets=[near])))
        assert len(found) == 1 and found[0]["range_m"] > 0.0
        assert reported is None or found[0]["range_m"] == reported
