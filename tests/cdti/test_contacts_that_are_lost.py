"""How old a contact is said to be, and how long one stays that nobody sees any more."""

import crooked
import pymap3d
import pytest
from displayed import displayed
from wired import chain

#: Leaves the radar's range at some 2.6 km.
AWAY = {**crooked.ROLLING, "speed_mps": 150.0, "heading_deg": 250.0}
RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 3.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.1, "elevation_error_deg": 0.1, "range_error_m": 5.0,
}  # fmt: skip


def watched(scene):
    """The contacts at the end of each instant, and what was recorded."""
    pictures = {}

    def look(scope, time_s):
        pictures[time_s] = scope.page_content(time_s)["contacts"]

    _, found = displayed(scene, look, window=1)
    return pictures, found


def test_a_track_without_news_grows_old_and_is_gone_when_it_is_deleted():
    tracker = {"type": "tracking.ekf", "delete_after_s": 2.0, "delete_misses": 50}
    scene = chain({"radar": RADAR}, targets=(AWAY,), duration_s=9, tracker=tracker,
                  fusion={"type": "fusion.pass_through"})  # fmt: skip
    pictures, found = watched(scene)
    seen = [r["time_s"] for r in found["detections"]]
    (gone_s,) = [r["time_s"] for r in found["state_tracks"] if r["track_status"] == "deleted"]
    assert seen[-1] + 1.5 < gone_s < 8.0
    for time_s, contacts in pictures.items():
        ages = [row[5] for row in contacts]
        wanted = [] if time_s >= gone_s else [time_s - max(t for t in seen if t <= time_s)]
        assert ages == pytest.approx(wanted, abs=0.006), time_s


def test_lines_that_are_fused_stay_until_they_are_forgotten():
    """Each radar sees one target, and they look in turn."""
    scene = chain(
        {"one": {**RADAR, "range_km": 9.0, "azimuth_deg": [0.0, 90.0], "scan_rate_hz": 1},
         "other": {**RADAR, "range_km": 9.0, "azimuth_deg": [-90.0, 0.0], "offset_s": 0.5,
                   "scan_rate_hz": 1}},
        duration_s=4, fusion={"type": "fusion.pass_through"},
    )  # fmt: skip
    pictures, found = watched(scene)
    seen = {(r["block"], r["target"]) for r in found["detections"]}
    assert seen == {("one", "rolling"), ("other", "diving")}
    for time_s in (1.0, 2.0, 3.0):
        contacts = pictures[time_s]
        ages = {number: age for number, *_, age, _, _, _, _ in contacts}
        assert ages == {0: 0.0, 1: 0.5}
        for number, *place, _, _, _, _, _, _ in contacts:
            target = crooked.TARGETS[number]
            own = crooked.geodetic(crooked.position(crooked.OWNSHIP, time_s))
            there = crooked.position(target, time_s - ages[number])
            assert place == pytest.approx(pymap3d.ecef2enu(*there, *own), abs=25.0)
