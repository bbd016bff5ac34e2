"""Metrics over targets that come, leave and are seen in turn: each counts for itself."""

import math

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, measured

import dsa_des

FOOT_M = 0.3048
RADAR = {**HEARS_ALL, "scan_rate_hz": 4, "offset_s": 0.05}


def place(along_m: float, up_m: float = 20.0) -> dict[str, float]:
    """Where the ownship comes by: so far ahead of its start, and somewhat above."""
    track = math.radians(crooked.OWNSHIP["heading_deg"])
    return {
        "east_m": along_m * math.sin(track), "north_m": along_m * math.cos(track), "up_m": up_m,
    }  # fmt: skip


CROSSING = {
    "name": "crossing", "east_m": -900.0, "north_m": -700.0, "up_m": 60.0, "heading_deg": 75.0,
    "speed_mps": 55.0, "climb_mps": 3.0,
}  # fmt: skip
BESIDE = {"name": "beside", "east_m": 500.0, "north_m": -300.0, "up_m": 20.0, "heading_deg": 217.0,
          "speed_mps": 70.0, "climb_mps": 3.0}  # fmt: skip


@pytest.mark.parametrize("targets", [(CROSSING, BESIDE), (BESIDE, CROSSING)])
def test_of_several_targets_the_first_loss_and_the_nearest_count(targets):
    scene = chain({"radar": RADAR}, targets=targets, duration_s=14)
    found = measured(scene, "well_clear", "closest_approach")
    times = np.arange(0.0, 14.0 + 1e-9, 0.1)
    slant, lost_s = {}, {}
    for target in targets:
        apart = np.array([crooked.ned(target, t) for t in times])
        slant[target["name"]] = np.linalg.norm(apart, axis=1)
        level = np.hypot(apart[:, 0], apart[:, 1])
        lost_s[target["name"]] = times[np.argmax(level < 2000 * FOOT_M)]
    assert lost_s["beside"] == 0.0 < lost_s["crossing"]
    assert slant["crossing"].min() < slant["beside"].min() - 100.0
    assert found["well_clear_loss_time_s"] == 0.0
    assert found["closest_approach_m"] == pytest.approx(slant["crossing"].min(), abs=0.05)


def test_a_loss_at_the_start_is_said():
    """Of two runs: one begins within well clear, the other loses it on the way."""
    for target, said in ((BESIDE, "at the start"), (CROSSING, None)):
        scene = chain({"radar": RADAR}, targets=[target], duration_s=14)
        row = dsa_des.study(scene, metrics=["well_clear"], replicas=1, workers=1).runs.to_pylist()
        assert row[0]["well_clear_lost"] == 1
        assert row[0]["well_clear_loss_cut_off"] == said


def test_who_is_not_there_is_not_near():
    """One appears where the ownship has been, one leaves before the ownship comes by."""
    still = {"heading_deg": 37.0, "speed_mps": 5.0, "climb_mps": 0.0}
    late = {"name": "late", **place(140.0), **still, "start_time_s": 6.0}
    early = {"name": "early", **place(1000.0), **still, "end_time_s": 3.0}
    found = measured(
        chain({"radar": RADAR}, targets=[late], duration_s=9), "well_clear", "closest_approach"
    )
    assert found["well_clear_loss_time_s"] == pytest.approx(6.0)
    assert found["closest_approach_time_s"] == pytest.approx(6.0)
    assert found["closest_approach_m"] == pytest.approx(70.0 * 6.0 - 140.0, abs=2.0)
    found = measured(
        chain({"radar": RADAR}, targets=[early], duration_s=16), "well_clear", "closest_approach"
    )
    assert found["well_clear_lost"] == 0
    assert found["closest_approach_time_s"] == pytest.approx(3.0)


def test_detections_of_two_targets_declare_none():
    """Each is there at one scan of the radar, at 0.3 and at 0.55 s."""
    targets = [
        {**crooked.ROLLING, "start_time_s": 0.2, "end_time_s": 0.4},
        {**crooked.DIVING, "start_time_s": 0.5, "end_time_s": 0.6},
    ]
    scene = chain({"radar": RADAR}, targets=targets, duration_s=2)
    found = measured(scene, {"metric": "declaration", "m": 2, "n": 2})
    assert found["declared.radar"] == 0
    assert measured(scene, {"metric": "declaration", "m": 1, "n": 2})["declared.radar"] == 1


def test_tracks_of_two_targets_are_updated_each_by_itself():
    scene = chain(
        {"radar": RADAR}, duration_s=3, fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found = measured(scene, {"metric": "track_updates", "break_after_s": 0.3})
    assert found["track_update_interval_s"] == pytest.approx(0.25)
    assert (found["track_breaks"], found["track_continuity"]) == (0, 1)


def test_expected_shares_reckon_with_offsets_and_delays():
    """The radar at 0.05 + k/4 s and 0.2 s later at the fusion: with each scan of the camera."""
    sensors = {"radar": RADAR, "eye": {**SEES_ALL, "scan_rate_hz": 2}}
    scene = chain(sensors, duration_s=4, fusion={"type": "fusion.pick_best"})
    scene["wires"].remove("radar -> fusion")
    scene["wires"].append({"from": "radar", "to": "fusion", "delay_s": 0.2})
    found = dsa_des.study(scene, metrics=["fused_share"], replicas=1, workers=1).summary
    expected = {row["result"]: row["expected"] for row in found.to_pylist()}
    assert expected == {
        "fused_share.radar_with_eye": 0.5, "fused_share.eye_with_radar": 1.0,
    }  # fmt: skip
