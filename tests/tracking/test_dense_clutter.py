"""A hundred targets in dense clutter: the run ends, and what a tracker keeps does not grow."""

import gc
import math
import tracemalloc

import pytest

import dsa_des
from docs.make.track_consistency import NOISY, OWNSHIP, SENSORS, Case, scene_of_case
from dsa_des.running.simulation import Simulation

TARGETS, SECONDS, PER_SCAN = 100, 18, 20.0
#: Up to 2 s late, of a scan each second: some come after the next one.
LATE = {"delay_s": 0.1, "jitter_s": 1.9}


def circling(k):
    """A target that circles near the ownship, which stands all but still."""
    around = 2.0 * math.pi * k / TARGETS
    return {
        "name": f"t{k}", "east_m": 4000.0 * math.sin(around), "north_m": 4000.0 * math.cos(around),
        "up_m": 50.0 + 10.0 * (k % 20), "heading_deg": math.degrees(around) + 90.0,
        "speed_mps": 60.0, "legs": [{"kind": "turn", "rate_deg_s": 2.0}],
    }  # fmt: skip


@pytest.mark.parametrize(
    "tracker", [{"association": "jpda"}, {"late": "rerun", "lag_s": 2}], ids=["jpda", "rerun"]
)
def test_a_hundred_targets_in_dense_clutter_take_no_more_memory_in_the_end(tracker):
    radar = {
        **NOISY, "azimuth_deg": [-180.0, 180.0], "mount_azimuth_deg": 0.0,
        "false_alarm_probability": PER_SCAN / (180 * 5 * 80),
    }  # fmt: skip
    targets = [circling(k) for k in range(TARGETS)]
    ekf = {"type": "tracking.ekf", "false_alarms_per_scan": PER_SCAN, **tracker}
    own = {**OWNSHIP, "speed_mps": 1.0, "climb_mps": 0.0}
    scene = scene_of_case(
        Case("", ekf, sensors={"radar": radar}, wire=LATE if "late" in tracker else {}),
        {"type": "traffic.scripted", "ownship": own, "intruders": targets},
    )
    scene["duration_s"] = SECONDS
    simulation = Simulation(dsa_des.load_scene(scene), window=3)
    block = simulation.components["tracker"]
    run, kept = block.run, []

    def listening(wake):
        found = run(wake)
        gc.collect()
        kept.append((tracemalloc.get_traced_memory()[0], len(block._store),
                     len(block._past or ())))  # fmt: skip
        return found

    block.run = listening
    tracemalloc.start()
    try:
        simulation.run()
    finally:
        tracemalloc.stop()
    assert len(kept) == SECONDS // 3
    half = len(kept) // 2
    memory, tracks, remembered = (list(column) for column in zip(*kept, strict=True))
    assert max(memory[half:]) < 1.1 * max(memory[1:half])
    # All targets, and tentative tracks of three scans' false alarms: those of before are deleted.
    assert min(tracks[1:]) >= TARGETS and max(tracks) < TARGETS + 5 * PER_SCAN
    # Looks of the last two seconds, where late ones have them worked on again.
    assert max(remembered) == (3 if "lag_s" in tracker else 0)


@pytest.mark.parametrize(("kind", "most"), [("tracking.ekf", 4096), ("tracking.stub", 32768)])
def test_what_a_window_holds_does_not_grow_with_the_run(kind, most):
    """All that is made of a window's looks stays: of a tracker some kB, of others far less."""
    radar = {**SENSORS["radar"], "range_km": 30.0, "scan_rate_hz": 2}
    scene = scene_of_case(
        Case("", {"type": kind}, sensors={"one": radar, "two": {**radar, "offset_s": "0.1"}}),
        {"type": "traffic.scripted", "ownship": OWNSHIP, "intruders": [circling(0)]},
    )
    scene["duration_s"] = 3600
    simulation = Simulation(dsa_des.load_scene(scene))
    looks = 4 * simulation.windows.longest_ticks / simulation.ticks_per_s
    assert most // 4 < looks <= most
