"""Where fused rows and tracks put the targets on Earth, and what fuses with what."""

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, SEES_ALL, chain, rows, run, sensor

FINE = {"azimuth_resolution_deg": 1e-6, "elevation_resolution_deg": 1e-6}
COARSE = {"azimuth_resolution_deg": 8.0, "elevation_resolution_deg": 8.0}
BOTH = {
    "radar": {**HEARS_ALL, **COARSE, "scan_rate_hz": 4},
    "eye": {**SEES_ALL, **FINE, "scan_rate_hz": 2, "offset_s": 0.25},
}
TRACKER = {"type": "tracking.stub"}


def place(row: dict, time_s: float) -> np.ndarray:
    """ECEF position of a measured line of sight from the ownship of an instant."""
    import pymap3d

    vector = row["range_m"] * crooked.direction(row["azimuth_rad"], row["elevation_rad"])
    level = crooked.attitude(crooked.OWNSHIP).T @ vector
    own = crooked.geodetic(crooked.position(crooked.OWNSHIP, time_s))
    return np.array(pymap3d.ned2ecef(*level, *own))


@pytest.mark.parametrize("fusion", ["fusion.pick_best", "fusion.gated"])
def test_together_they_put_the_target_where_it_is(fusion):
    """The range of the radar with the angles of the camera; the radar alone is off by its grid."""
    table = {"type": fusion}
    if fusion == "fusion.gated":
        table["angle_gate_deg"] = 12.0
    scene = chain(BOTH, fusion=table, tracker=TRACKER, duration_s=2)
    found = run(scene)
    by_name = {target["name"]: target for target in crooked.TARGETS}
    both = 0
    for row in rows(found, "fused"):
        truth = crooked.position(by_name[row["target"]], row["time_s"])
        off_m = float(np.linalg.norm(place(row, row["time_s"]) - truth))
        if row["sensors"] == "radar+eye":
            assert (row["angle_source"], row["range_source"]) == ("eye", "radar")
            assert off_m < 0.05
            both += 1
        else:
            assert row["sensors"] == row["angle_source"] == row["range_source"] == "radar"
            assert 1.0 < off_m < 400.0
    assert both == 8
    for row in rows(found, "tracks"):
        seen_s = row["time_s"] - row["age_s"]
        truth = crooked.position(by_name[row["target"]], seen_s)
        off_m = float(np.linalg.norm(place(row, seen_s) - truth))
        assert off_m < (0.05 if row["updated_by"] == "radar+eye" else 400.0)


def test_what_passes_through_alone_is_where_its_target_is():
    sensors = {"radar": {**HEARS_ALL, **FINE, "scan_rate_hz": 4}, "eye": {**SEES_ALL, **FINE}}
    found = run(chain(sensors, fusion={"type": "fusion.pass_through"}, duration_s=2))
    by_name = {target["name"]: target for target in crooked.TARGETS}
    count = {"radar": 0, "eye": 0}
    for row in rows(found, "fused"):
        truth = crooked.position(by_name[row["target"]], row["time_s"])
        count[row["sensors"]] += 1
        if row["sensors"] == "radar":
            assert np.linalg.norm(place(row, row["time_s"]) - truth) < 0.05
        else:  # a camera gives the direction alone
            own = place({**row, "range_m": 0.0}, row["time_s"])
            far_m = float(np.linalg.norm(truth - own))
            beside = place({**row, "range_m": far_m}, row["time_s"]) - truth
            assert np.linalg.norm(beside) < 0.05
    assert min(count.values()) >= 4


@pytest.mark.parametrize("fusion", ["fusion.pick_best", "fusion.gated"])
def test_angles_are_of_the_sensor_whose_coarser_step_is_the_finest(fusion):
    """One camera is fine in azimuth only, one in neither; of the radars the finer gives ranges."""
    sensors = {
        "a": {**SEES_ALL, "azimuth_resolution_deg": 0.1, "elevation_resolution_deg": 3.0},
        "b": {**SEES_ALL, "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 2.0},
        "c": sensor("radar.range_boundary", azimuth_resolution_deg=1.0, range_resolution_m=50.0),
        "d": sensor("radar.range_boundary", azimuth_resolution_deg=0.5, range_resolution_m=70.0),
    }
    table = {"type": fusion}
    if fusion == "fusion.gated":
        table["angle_gate_deg"] = 9.0
    scene = chain(sensors, fusion=table)
    found = run(scene)
    fused = rows(found, "fused")
    assert len(fused) == 2
    for row in fused:
        assert (row["angle_source"], row["range_source"]) == ("b", "d")
        (of_b,) = rows(found, block="b", target=row["target"])
        (of_d,) = rows(found, block="d", target=row["target"])
        for column in ("azimuth_rad", "elevation_rad", "true_azimuth_rad", "true_range_m"):
            assert row[column] == of_b[column]
        assert row["range_m"] == of_d["range_m"]
        assert set(row["sensors"].split("+")) == set(sensors)
    # Without cameras the finer radar gives all.
    only = chain({name: sensors[name] for name in "cd"}, fusion=table)
    for row in rows(run(only), "fused"):
        assert (row["angle_source"], row["range_source"]) == ("d", "d")


def test_a_beam_s_instants_are_passed_on_as_they_are():
    """Two sensors saw it at other instants: the true range is that of the angles' sensor."""
    radar = sensor("radar.range_boundary", beam_sweep=True, azimuth_deg=[-90, 70])
    found = run(chain({"radar": radar, "eye": SEES_ALL}, fusion={"type": "fusion.pick_best"}))
    for row in rows(found, "fused"):
        ranges = {
            name: rows(found, block=name, target=row["target"])[0]["true_range_m"]
            for name in ("radar", "eye")
        }
        assert abs(ranges["radar"] - ranges["eye"]) > 1.0
        assert row["true_range_m"] == ranges["eye"]
        assert row["range_m"] == pytest.approx(ranges["radar"])


@covers("coincidence_s", of=("fusion.pick_best",))
@pytest.mark.parametrize(("coincidence_s", "together"), [(0.1, True), (0.09, False), (0, False)])
def test_looks_coincide_within_their_time(coincidence_s, together):
    sensors = {"radar": HEARS_ALL, "eye": {**SEES_ALL, "offset_s": 0.1}}
    fusion = {"type": "fusion.pick_best", "coincidence_s": coincidence_s}
    found = rows(run(chain(sensors, fusion=fusion)), "fused", target="diving")
    assert [(row["time_s"], row["sensors"]) for row in found] == [
        (0.0, "radar"),
        (0.1, "radar+eye" if together else "eye"),
    ]


@covers("time_gate_s", "angle_gate_deg", "range_gate_m", of=("fusion.gated",))
@pytest.mark.parametrize(
    ("gates", "sensors"),
    [
        ({"time_gate_s": 0.3, "angle_gate_deg": 3.0, "range_gate_m": 50.0}, {"far+near"}),
        ({"time_gate_s": 0.2, "angle_gate_deg": 3.0, "range_gate_m": 50.0}, {"far", "near"}),
        ({"time_gate_s": 0.3, "angle_gate_deg": 1.2, "range_gate_m": 50.0}, {"far", "near"}),
        ({"time_gate_s": 0.3, "angle_gate_deg": 3.0, "range_gate_m": 5.0}, {"far", "near"}),
    ],
)
def test_each_gate_parts_what_lies_beyond_it(gates, sensors):
    """Two radars a quarter of a second apart, off by 2 deg in elevation and some 12 m in range.

    It is the target that moves: what the ownship's own way does to the range is known and undone.
    """
    far = sensor("radar.range_boundary", misalignment_deg=[0, 2, 0])
    near = sensor("radar.range_boundary", offset_s=0.25)
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    scene = chain(
        {"far": far, "near": near}, ownship=own, targets=[crooked.ROLLING],
        fusion={"type": "fusion.gated", **gates},
    )  # fmt: skip
    before, after = (np.linalg.norm(crooked.ned(crooked.ROLLING, t, own)) for t in (0.0, 0.25))
    assert 6.0 < abs(before - after) < 49.0
    last = [row for row in rows(run(scene), "fused") if row["time_s"] == 0.25]
    expected = {"far+near"} if sensors == {"far+near"} else {"near"}
    assert {row["sensors"] for row in last} == expected


def test_the_ownship_s_own_way_is_undone_before_gates_are_asked():
    """A quarter of a second of its flight takes it 17 m nearer to who hangs in the air."""
    still = {**crooked.ROLLING, "speed_mps": 0.0, "climb_mps": 0.0}
    radars = {"one": sensor("radar.range_boundary"),
              "two": sensor("radar.range_boundary", offset_s=0.25)}  # fmt: skip
    fusion = {"type": "fusion.gated", "time_gate_s": 0.3, "angle_gate_deg": 0.05,
              "range_gate_m": 2.0}  # fmt: skip
    before, after = (np.linalg.norm(crooked.ned(still, t)) for t in (0.0, 0.25))
    assert abs(before - after) > 10.0
    found = rows(run(chain(radars, targets=[still], fusion=fusion)), "fused", time_s=0.25)
    assert [row["sensors"] for row in found] == ["one+two"]


@covers("drop_after_s", of=("tracking.stub", "tracking.hold_last"))
@pytest.mark.parametrize("kind", ["tracking.stub", "tracking.hold_last"])
def test_a_track_is_dropped_when_it_is_old(kind):
    """The target leaves after half a second; the other one keeps the tracker updated."""
    targets = [{**crooked.ROLLING, "end_time_s": 0.5}, crooked.DIVING]
    ends = {}
    for drop_after_s in (0.5, 1.0):
        tracker = {**TRACKER, "type": kind, "drop_after_s": drop_after_s}
        sensors = {"radar": {**HEARS_ALL, "scan_rate_hz": 8}}
        scene = chain(
            sensors, targets=targets, duration_s=3, tracker=tracker,
            fusion={"type": "fusion.pick_best"},
        )  # fmt: skip
        tracks = rows(run(scene), "tracks")
        ends[drop_after_s] = max(row["time_s"] for row in tracks if row["target"] == "rolling")
        assert max(row["time_s"] for row in tracks) == 2.875
    # Seen at 0.5 s last; held while younger than what is said.
    assert ends == {0.5: 0.875, 1.0: 1.375}
