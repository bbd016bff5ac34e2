"""Sensors remember from window to window: the last direction, and who was declared when."""

import crooked
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, sensor

from dsa_des.library.scenes import load_scene
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation


def ran(scene: dict, window: int | None):
    sink = MemorySink()
    simulation = Simulation(load_scene(scene), recorder=Recorder([sink]), window=window)
    simulation.run()
    return simulation, sink.tables()["detections"].to_pylist()


@pytest.mark.parametrize("window", [1, 2, 5])
def test_motion_is_from_scan_to_scan_whatever_the_window(window):
    eye = {**SEES_ALL, "scan_rate_hz": 4, "static_weight": 0.0, "dynamic_weight": 1e3}
    scene = chain({"eye": eye}, duration_s=2)
    _, whole = ran(scene, None)
    _, cut = ran(scene, window)
    assert cut == whole
    turned = [row["confidence"] - 1.0 for row in whole]
    assert turned[:2] == [0.0, 0.0] and min(turned[2:]) > 0.1


@pytest.mark.parametrize("published_hz", [4, 1])
@pytest.mark.parametrize("window", [None, 1, 3])
def test_the_first_declaration_stays_the_first(window, published_hz):
    """The third of consecutive detections, at 0.5 s, and none of those after it.

    Whether the traffic is new at each look, or still that of 0 s.
    """
    radar = {**HEARS_ALL, "scan_rate_hz": 4, "declare_m": 3, "declare_n": 3}
    scene = chain({"radar": radar}, duration_s=3)
    scene["blocks"]["traffic"]["update_rate_hz"] = published_hz
    simulation, rows = ran(scene, window)
    found = simulation.components["radar"].report()["declarations"]["radar"]
    for target in crooked.TARGETS:
        (row,) = (r for r in rows if r["target"] == target["name"] and r["time_s"] == 0.5)
        assert found[target["name"]] == {"time_s": 0.5, "range_m": row["true_range_m"]}


@pytest.mark.parametrize("window", [1, 2, 5])
def test_places_are_remembered_as_long_as_the_rule_counts(window):
    """A radar that misses now and then: the scan before the last one counts, too."""
    radar = sensor("radar.swerling", power_w=2.0, false_alarm_probability=1e-4, scan_rate_hz=20,
                   declare_m=2, declare_n=3, declare_by="place")  # fmt: skip
    scene = chain({"radar": radar}, targets=[crooked.ROLLING], duration_s=3)
    _, whole = ran(scene, None)
    _, cut = ran(scene, window)
    assert cut == whole
    seen = {row["scan"]: row["declared"] for row in whole}
    for scan, declared in seen.items():
        assert declared is (scan - 1 in seen or scan - 2 in seen)
    assert any(scan - 1 not in seen and scan - 2 in seen for scan in seen)
