"""A fused track is as sure as its surest member, and no report that came too late counts."""

import crooked
import pytest
from test_fused_track_keys import CAMERA, FINE, KIND, NEAR, distributed, of, state
from wired import chain

import dsa_des
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

AWAY = {**crooked.ROLLING, "speed_mps": 150.0, "heading_deg": 250.0}


def test_a_member_that_coasts_does_not_make_its_fused_track_coast():
    """Past 3 km the camera sees no more, and its track takes part for two seconds yet."""
    camera = {**CAMERA, "range_km": 3.0}
    tracker = {**NEAR, "delete_misses": 9}
    options = {"targets": [AWAY], "duration_s": 8, "drop_after_s": 2.0, "tracker": tracker}
    found = distributed({"fast": FINE, "camera": camera}, **options)
    coasts = of(found, "camera_tracks", track_status="coasted")
    last_s = of(found, "camera_tracks", track_status="confirmed")[-1]["time_s"]
    both = [r for r in coasts if r["time_s"] < last_s + 2.0]
    assert len(both) > 2
    for row in both:
        (fused,) = of(found, "fused", time_s=row["time_s"])
        assert (fused["track_status"], fused["contributors"]) == ("confirmed", "fast+camera")
    alone = of(distributed({"camera": camera}, **options), "fused")
    assert {r["track_status"] for r in alone if r["time_s"] > last_s} == {"coasted", "deleted"}


@pytest.mark.parametrize("window", [None, 1])
def test_a_report_that_a_newer_one_overtook_does_not_count(window):
    scene = chain({"fast": {**FINE, "scan_rate_hz": 4}}, targets=(crooked.ROLLING,), duration_s=4)
    scene["blocks"] |= {
        "looks": {"type": "fusion.pass_through"}, "tracks": {"type": "tracking.ekf"},
        "fused": {"type": KIND},
    }  # fmt: skip
    late = {"from": "tracks", "to": "fused", "jitter_s": 1.5}
    scene["wires"] += ["fast -> looks -> tracks", late]
    tables = MemorySink()
    loaded = dsa_des.load_scene(scene)
    Simulation(loaded, recorder=Recorder([tables]), window=window).run()
    found = tables.tables()["state_tracks"].to_pylist()
    made = {r["state_s"]: r for r in of(found, "tracks", track_status="confirmed")}
    fused = of(found, "fused")
    when = [r["state_s"] for r in fused]
    assert when == sorted(set(when))
    # Some are passed over although newer ones have come.
    assert len(fused) < sum(at <= when[-1] for at in made)
    for row in fused:
        assert state(row) == pytest.approx(state(made[row["state_s"]]), abs=1e-6)
        assert row["updated_s"] == made[row["state_s"]]["updated_s"]
