"""Trackers record the same bytes whatever the window, the company and the names of targets."""

import pyarrow as pa
import pytest
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of
from wired import chain, noise_crosses, sensor

import dsa_des
from dsa_des.scene.scene import load_scene

#: Trackers of the same detections. Those of a sweeping radar come early, of cameras late.
TRACKERS = {
    "ekf": {"type": "tracking.ekf"},
    "nearest": {"type": "tracking.ekf", "association": "nearest", "late": "drop"},
    "rerun": {"type": "tracking.ekf", "late": "rerun", "lag_s": 0.4},
    "ukf": {"type": "tracking.ukf"},
    "imm": {"type": "tracking.imm", "models": ["velocity", "turn", "acceleration"]},
    # Detections fall beside the gates of tracks that company would have gone through again.
    "jpda": {"type": "tracking.imm", "association": "jpda"},
}
CLOSE = {"range_km": 5.0, "elevation_deg": [-30, 20]}
GRID = {"azimuth_resolution_deg": 1.0, "elevation_resolution_deg": 1.0, "range_resolution_m": 30.0}
SENSORS = {
    "radar": sensor("radar.swerling", **CLOSE, **GRID, swerling=1, power_w=1e3, scan_rate_hz=4,
                    beam_sweep=True, measures_range_rate=True, range_rate_resolution_m_s=2.0,
                    **noise_crosses("radar.swerling", 1e-6)),
    "eo": sensor("optical.eo", scan_rate_hz=10, latency_s=0.31, azimuth_pixels=3600,
                 elevation_pixels=1800, threshold=1.0, false_alarms_per_frame=0.3),
    "ir": sensor("optical.ir", scan_rate_hz=7, latency_s=0.117, azimuth_pixels=3600,
                 elevation_pixels=1800),
}  # fmt: skip
ALONE = {"radar_tracker": "radar", "eo_tracker": "eo"}
NEARER = [
    "blocks.traffic.intruders.0.north_m=4000", "blocks.traffic.intruders.1.north_m=3500",
    "blocks.traffic.intruders.1.east_m=3000", "blocks.radar.false_alarms=true",
    "blocks.radar.false_alarm_probability=1e-6",
    "blocks.eo.false_alarms_per_frame=0.3",
    "blocks.eo.latency_s=0.13",
]  # fmt: skip


@pytest.fixture(scope="module")
def every_tracker():
    """All of them behind one fusion, and those of two sensors whose tracks are fused again."""
    scene = chain(SENSORS, fusion={"type": "fusion.pass_through"}, duration_s=1.5,
                  navigation={"attitude_noise_deg": [0.3, 0.3, 0.3]})  # fmt: skip
    scene["blocks"] |= TRACKERS
    scene["wires"] += [f"fusion -> {name}" for name in TRACKERS]
    for tracker, of in ALONE.items():
        scene["blocks"][tracker] = {"type": "tracking.ekf"}
        scene["blocks"][f"{of}_looks"] = {"type": "fusion.pass_through"}
        scene["wires"].append(f"{of} -> {of}_looks -> {tracker} -> fused")
    scene["blocks"]["fused"] = {"type": "fusion.covariance_intersection"}
    return dsa_des.load_scene(scene)


def test_windows_change_no_byte(every_tracker):
    found = same_in_any_window(every_tracker)["state_tracks"].to_pylist()
    confirmed = {row["block"] for row in found if row["track_status"] == "confirmed"}
    assert confirmed == {*TRACKERS, *ALONE, "fused"}
    sources = " ".join(row["contributors"] for row in found if row["block"] == "fused")
    assert "radar" in sources and "eo" in sources


def test_company_changes_no_byte(every_tracker):
    same_as_alone(replicas_of(every_tracker, {}, {}), window=40)


def test_boxes_about_gates_change_no_byte(every_tracker, monkeypatch):
    known = tracks_of(every_tracker)
    monkeypatch.setattr("components.tracking.gating._FEW_PAIRS", 0)
    assert tracks_of(every_tracker).equals(known)


def tracks_of(scene):
    return tables_of(scene)[1]["state_tracks"]


def near(*sets, duration_s="4"):
    return load_scene(
        "configs/first_light.toml", swaps=["tracker=tracking.ekf", "fusion=fusion.pass_through"],
        sets=[*NEARER, *sets], duration_s=duration_s,
    )  # fmt: skip


def test_who_is_held_is_held_across_windows():
    """Of three the first and the last fly out of reach: they stay, in whatever windows."""
    flights = [
        {"name": name, "east_m": east_m, "north_m": 3950.0, "up_m": 0.0, "speed_mps": 60.0,
         "heading_deg": heading_deg}
        for name, east_m, heading_deg in (("a", -100, 0), ("b", 0, 180), ("c", 100, 0))
    ]  # fmt: skip
    own = {"lat_deg": 0.0, "lon_deg": 0.0, "alt_m": 500.0, "heading_deg": 0.0, "speed_mps": 1.0}
    scene = chain(
        {"radar": sensor("radar.range_boundary", range_km=4.0, scan_rate_hz=1)}, ownship=own,
        targets=flights, duration_s=5, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.hold_last"},
    )  # fmt: skip
    found = same_in_any_window(dsa_des.load_scene(scene), windows=(1,))["tracks"].to_pylist()
    last_s = max(row["time_s"] for row in found)
    assert [row["target"] for row in found if row["time_s"] == last_s] == ["a", "b", "c"]


def test_tracks_know_nothing_of_the_roster(monkeypatch):
    """Targets are renumbered, and all that is true is replaced, before the tracker sees it."""
    from components.tracking.filters import ExtendedKalman

    scene = near()
    known = tracks_of(scene)
    original = ExtendedKalman.run

    def blind(self, wake):
        fused, rows = wake._held["fused"]
        fused = fused.take(slice(0, len(fused)))
        wake._held = {"fused": (_relabelled(fused), rows)}
        return original(self, wake)

    monkeypatch.setattr(ExtendedKalman, "run", blind)
    assert tracks_of(scene).equals(known)


def _relabelled(fused):
    from copy import copy

    other = copy(fused)
    other.target = -7 - fused.target
    other.roster = None
    for name in ("true_azimuth_rad", "true_elevation_rad", "true_range_m"):
        setattr(other, name, None)
    return other


def test_what_the_old_name_builds_is_the_same_block():
    scenes = [
        load_scene("configs/first_light.toml", swaps=[f"tracker={name}"], duration_s="3")
        for name in ("tracking.stub", "tracking.hold_last")
    ]
    old, new = (tables_of(scene)[1]["tracks"] for scene in scenes)
    assert isinstance(old, pa.Table) and old.equals(new)


@pytest.mark.parametrize(
    "fusion",
    [
        {"type": "fusion.pick_best", "coincidence_s": 0.3},
        {"type": "fusion.gated", "time_gate_s": 0.3},
    ],
)
def test_what_counts_once_does_so_in_any_window_and_company(fusion):
    """Which detections a row was made of before is known from window to window, run by run."""
    scene = chain(SENSORS, fusion=fusion, tracker={"type": "tracking.ekf"}, duration_s=1.5)
    loaded = dsa_des.load_scene(scene)
    assert same_in_any_window(loaded)["state_tracks"].num_rows > 20
    same_as_alone(replicas_of(loaded, {}, {"blocks.radar.offset_s": 0.05}, {}))
