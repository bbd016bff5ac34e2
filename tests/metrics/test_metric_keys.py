"""What studies measure, against sums by hand over the rows of the same run."""

import math
from itertools import pairwise
from typing import Any

import crooked
import numpy as np
import pytest
from covering import covers
from wired import HEARS_ALL, SEES_ALL, Row, chain, measured, rows, run

SENSORS = {
    "radar": {
        **HEARS_ALL, "scan_rate_hz": 4, "offset_s": 0.05, "azimuth_resolution_deg": 3.0,
        "range_resolution_m": 90.0, "declare_m": 2, "declare_n": 3,
    },
    "eye": {**SEES_ALL, "scan_rate_hz": 2, "elevation_resolution_deg": 2.0},
}  # fmt: skip
#: The nearer target comes late and the farther one leaves early.
TARGETS = [
    {**crooked.ROLLING, "end_time_s": 2.6},
    {**crooked.DIVING, "start_time_s": 0.7},
]
DELAY_S = {"radar": 0.2, "eye": 0.0}


def scene() -> dict[str, Any]:
    found = chain(
        SENSORS, targets=TARGETS, duration_s=4, fusion={"type": "fusion.pick_best"},
        tracker={"type": "tracking.stub"},
    )  # fmt: skip
    found["wires"].remove("radar -> fusion")
    found["wires"].append({"from": "radar", "to": "fusion", "delay_s": DELAY_S["radar"]})
    return found


@pytest.fixture(scope="module")
def recorded() -> Any:
    return run(scene())


def first(found: list[Row]) -> Row:
    """The first row, of one instant the nearest."""
    return min(found, key=lambda row: (row["time_s"], row["true_range_m"]))


@covers("target", "sensors", of=("[metric first_detection]",))
@pytest.mark.parametrize("target", [None, "rolling", "diving"])
def test_first_detections(recorded, target):
    found = measured(scene(), {"metric": "first_detection", "target": target} if target else
                     "first_detection")  # fmt: skip
    for name, table in (("radar", "detections"), ("eye", "detections"), ("fused", "fused")):
        wanted = {} if table == "fused" else {"block": name}
        if target is not None:
            wanted["target"] = target
        row = first(rows(recorded, table, **wanted))
        assert found[f"first_detection_time_s.{name}"] == pytest.approx(row["time_s"])
        assert found[f"first_detection_range_m.{name}"] == pytest.approx(row["true_range_m"])
        assert found[f"detected.{name}"] == 1
    one = measured(scene(), {"metric": "first_detection", "sensors": ["eye"]})
    assert {name.rpartition(".")[2] for name in one} == {"eye"}


def test_of_targets_that_are_seen_at_once_the_nearest_is_the_first():
    both = chain(SENSORS, fusion={"type": "fusion.pick_best"})
    found = measured(both, "first_detection")
    near_m = float(np.linalg.norm(crooked.ned(crooked.DIVING, 0.05)))
    assert found["first_detection_range_m.radar"] == pytest.approx(near_m, abs=0.02)
    near_m = float(np.linalg.norm(crooked.ned(crooked.DIVING)))
    for name in ("eye", "fused"):
        assert found[f"first_detection_range_m.{name}"] == pytest.approx(near_m, abs=0.02)


def test_who_is_never_detected_has_no_first_detection():
    blind = chain({**SENSORS, "eye": {**SENSORS["eye"], "threshold": 1e9}})
    found = measured(blind, {"metric": "first_detection", "sensors": ["radar", "eye"]})
    assert (found["detected.radar"], found["detected.eye"]) == (1, 0)
    assert np.isnan([found[f"first_detection_{what}.eye"] for what in ("time_s", "range_m")]).all()


@covers("target", "sensors", of=("[metric detection_share]",))
def test_shares_of_looks_that_detect():
    """The radar hears the nearer target only, the camera looks at both."""
    limit = {row["target"]: row["snr_db"] for row in rows(run(chain(SENSORS)), block="radar")}
    radar = {**SENSORS["radar"], "threshold_db": 0.5 * (limit["rolling"] + limit["diving"])}
    still = [{**target, "speed_mps": 0.0, "climb_mps": 0.0} for target in crooked.TARGETS]
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    looked = chain({**SENSORS, "radar": radar}, ownship=own, targets=still, duration_s=2)
    found = measured(looked, "detection_share")
    assert found == {"detection_share.radar": 0.5, "detection_share.eye": 1.0}
    one = measured(looked, {"metric": "detection_share", "sensors": ["radar"]})
    assert one == {"detection_share.radar": 0.5}
    with pytest.raises(Exception, match="target"):
        measured(looked, {"metric": "detection_share", "target": "rolling"})


@covers("target", "sensors", "m", "n", of=("[metric declaration]",))
@pytest.mark.parametrize("target", ["rolling", "diving"])
@pytest.mark.parametrize("rule", [None, (3, 4)])
def test_declarations(recorded, target, rule):
    keys = {"target": target} | ({} if rule is None else {"m": rule[0], "n": rule[1]})
    found = measured(scene(), {"metric": "declaration", **keys})
    times = {}
    for name, own in (("radar", 2), ("eye", 1)):
        looks = rows(recorded, block=name, target=target)
        row = looks[(own if rule is None else rule[0]) - 1]
        times[name] = row["time_s"]
        assert found[f"declaration_time_s.{name}"] == pytest.approx(row["time_s"])
        assert found[f"declaration_range_m.{name}"] == pytest.approx(row["true_range_m"])
        delay = row["time_s"] - looks[0]["time_s"]
        assert found[f"declaration_delay_s.{name}"] == pytest.approx(delay)
    assert found["declaration_time_s.any"] == pytest.approx(min(times.values()))
    one = measured(scene(), {"metric": "declaration", "sensors": ["radar"], **keys})
    assert one["declaration_time_s.any"] == pytest.approx(times["radar"])


def test_a_rule_of_m_in_n_needs_them_close_together():
    """Looks that are lost to a slow clock of the traffic's presence: every third scan of four."""
    looks = [0.05 + 0.25 * k for k in range(16)]
    there = [
        {**crooked.ROLLING, "start_time_s": 0.3, "end_time_s": 0.6},
        {**crooked.ROLLING, "name": "other", "start_time_s": 1.0},
    ]
    far = chain({"radar": SENSORS["radar"]}, targets=there, duration_s=4)
    found = measured(far, {"metric": "declaration", "target": "rolling", "m": 2, "n": 2})
    # Scans 1 and 2 see it: at 0.3 and 0.55 s.
    assert found["declaration_time_s.radar"] == pytest.approx(looks[2])
    found = measured(far, {"metric": "declaration", "target": "rolling", "m": 3, "n": 9})
    assert found["declared.radar"] == 0


def two_of_four(tmp_path, **more) -> dict[str, Any]:
    """A target that turns once a second shows a large side to two of four scans."""
    nodes = [(az, el) for az in range(0, 360, 10) for el in (-90, 90)]
    lines = [f"{az},{el},{30 if 5 < az < 175 else -60}" for az, el in nodes]
    path = tmp_path / "rcs.csv"
    path.write_text("\n".join(["az_deg,el_deg,dbsm", *lines]) + "\n", encoding="utf-8")
    turning = {
        "name": "turning", "east_m": -1500.0, "north_m": -1500.0, "up_m": 100.0,
        "heading_deg": 10.0, "speed_mps": 5.0, "pitch_deg": 0.0, "roll_deg": 0.0,
        "rcs_table": str(path), "legs": [{"kind": "turn", "rate_deg_s": 360}],
    }  # fmt: skip
    radar = {**HEARS_ALL, "scan_rate_hz": 4, "threshold_db": 20.0}
    return chain({"radar": radar}, targets=[turning], **{"duration_s": 4, **more})


@pytest.mark.parametrize(("m", "n"), [(3, 4), (3, 5), (2, 2), (4, 5), (5, 8), (5, 9)])
def test_scans_that_miss_count_among_the_n(tmp_path, m, n):
    looked = two_of_four(tmp_path)
    hits = [row["scan"] for row in rows(run(looked))]
    assert {b - a for a, b in pairwise(hits)} == {1, 3}
    expected = next(
        (scan for scan in hits if sum(scan - n < other <= scan for other in hits) >= m), None
    )
    found = measured(looked, {"metric": "declaration", "m": m, "n": n})
    assert found["declared.radar"] == (expected is not None)
    if expected is not None:
        assert found["declaration_time_s.radar"] == pytest.approx(expected / 4)


@covers("target", "sensors", of=("[metric fused_share]",))
@pytest.mark.parametrize("target", [None, "diving"])
def test_shares_of_fused_detections(recorded, target):
    """The radar's delay brings it to the camera's instants: every second of its scans."""
    keys = {} if target is None else {"target": target}
    found = measured(scene(), {"metric": "fused_share", "sensors": ["eye", "radar"], **keys})
    together = {
        (row["target"], round(row["time_s"], 6))
        for row in rows(recorded, "fused", **keys)
        if row["sensors"] == "radar+eye"
    }
    assert len(together) > 4
    for name, other in (("radar", "eye"), ("eye", "radar")):
        looks = rows(recorded, block=name, **keys)
        fused = [
            (row["target"], round(row["time_s"] + DELAY_S[name], 6)) in together for row in looks
        ]
        assert found[f"fused_share.{name}_with_{other}"] == pytest.approx(np.mean(fused))


@covers("target", of=("[metric age_of_information]",))
@pytest.mark.parametrize("target", ["rolling", "diving"])
def test_ages_of_what_the_fusion_holds(recorded, target):
    """The age grows from each arrival to the next; what came from the radar was 0.2 s old."""
    found = measured(scene(), {"metric": "age_of_information", "target": target})
    fused = rows(recorded, "fused", target=target)
    origin, area, ages = -math.inf, 0.0, []
    for row, after in pairwise(fused):
        late = min(DELAY_S[name] for name in row["sensors"].split("+"))
        origin = max(origin, row["time_s"] - late)
        times = np.linspace(row["time_s"], after["time_s"], 20001)
        ages.append(0.5 * (times[1:] + times[:-1]) - origin)
        area += float(np.sum(ages[-1])) * (times[1] - times[0])
    span = fused[-1]["time_s"] - fused[0]["time_s"]
    assert found["age_of_information_mean_s"] == pytest.approx(area / span, rel=1e-5)
    weights = np.concatenate(
        [
            np.full(len(part), (after["time_s"] - row["time_s"]) / len(part))
            for part, (row, after) in zip(ages, pairwise(fused), strict=True)
        ]
    )
    everything = np.concatenate(ages)
    order = np.argsort(everything)
    share = np.cumsum(weights[order]) / span
    p95 = float(everything[order][np.searchsorted(share, 0.95)])
    assert found["age_of_information_p95_s"] == pytest.approx(p95, abs=1e-4)


@covers("target", "break_after_s", of=("[metric track_updates]",))
@pytest.mark.parametrize("target", ["rolling", "diving"])
@pytest.mark.parametrize("break_after_s", [0.22, 1.0])
def test_updates_and_breaks_of_tracks(recorded, target, break_after_s):
    """The one that leaves early is held on, and no longer updated."""
    keys = {"target": target, "break_after_s": break_after_s}
    found = measured(scene(), {"metric": "track_updates", **keys})
    held = rows(recorded, "tracks", target=target)
    told = [(row["measured_s"], row["updated_by"]) for row in held]
    times = [row["time_s"] for row, now, before in zip(held, told, [None, *told], strict=False)
             if now != before]  # fmt: skip
    assert (len(held) > len(times) + 3) is (target == "rolling")
    gaps = np.diff(times)
    assert found["track_update_interval_s"] == pytest.approx(np.mean(gaps))
    broken = np.maximum(gaps - break_after_s, 0.0)
    assert found["track_continuity"] == pytest.approx(1.0 - broken.sum() / gaps.sum())
    assert found["track_breaks"] == np.count_nonzero(broken > 0.0)
    assert bool(broken.any()) is (break_after_s < 1)


def test_most_updates_follow_within_the_percentile(tmp_path):
    """After one scan or three, by turns."""
    plain = {"fusion": {"type": "fusion.pick_best"}, "tracker": {"type": "tracking.stub"}}
    found = measured(two_of_four(tmp_path, duration_s=4.25, **plain), "track_updates")
    assert found["track_update_interval_p95_s"] == pytest.approx(0.75)
    assert 0.4 < found["track_update_interval_s"] < 0.6


@covers("target", of=("[metric position_error]",))
@pytest.mark.parametrize("target", [None, "rolling", "diving"])
def test_errors_of_fused_positions(recorded, target):
    keys = {} if target is None else {"target": target}
    found = measured(scene(), {"metric": "position_error", **keys})
    apart, turned = [], []
    for row in rows(recorded, "fused", **keys):
        seen = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        true = crooked.direction(row["true_azimuth_rad"], row["true_elevation_rad"])
        turned.append(math.atan2(float(np.linalg.norm(np.cross(seen, true))), float(seen @ true)))
        if row["range_m"] is not None:
            off = row["range_m"] * seen - row["true_range_m"] * true
            apart.append(float(np.linalg.norm(off)))
    rms = math.sqrt(float(np.mean(np.square(apart))))
    assert found["fused_position_error_m"] == pytest.approx(rms)
    rms = math.degrees(math.sqrt(float(np.mean(np.square(turned)))))
    assert found["fused_angle_error_deg"] == pytest.approx(rms)
    assert len(apart) > 5


ENCOUNTERS = ("[metric closest_approach]", "[metric well_clear]")


@covers("target", "sensors", "step_s", "m", "n", of=ENCOUNTERS)
@pytest.mark.parametrize("step_s", [0.1, 1.3])
def test_encounters_of_one_target_at_their_steps(recorded, step_s):
    """Distances are taken at the steps and at the samples of the traffic itself."""
    near = [
        {**crooked.ROLLING, "east_m": -620.0, "north_m": -420.0, "up_m": 30.0},
        {**crooked.DIVING, "east_m": -500.0, "north_m": -760.0, "up_m": 20.0, "climb_mps": 3.0},
    ]
    sampled = chain(SENSORS, targets=near, duration_s=6)
    sampled["blocks"]["traffic"]["sample_interval_s"] = 50.0
    for target in near:
        keys = {"target": target["name"], "step_s": step_s, "m": 2, "n": 4, "sensors": ["radar"]}
        found = measured(
            sampled, {"metric": "closest_approach", **keys}, {"metric": "well_clear", **keys}
        )
        times = np.arange(0.0, 6.0 + 1e-9, step_s)
        lines = np.array([crooked.ned(target, t) for t in times])
        slant, level = np.linalg.norm(lines, axis=1), np.hypot(lines[:, 0], lines[:, 1])
        assert found["closest_approach_m"] == pytest.approx(slant.min(), abs=0.02)
        closest_s = times[int(np.argmin(slant))]
        assert found["closest_approach_time_s"] == pytest.approx(closest_s)
        lost = level < 2000 * 0.3048
        lost_s = times[int(np.argmax(lost))] if lost.any() else math.nan
        told = found["well_clear_loss_time_s"]
        assert (math.nan if told is None else told) == pytest.approx(lost_s, nan_ok=True)
        # Two of the radar's scans: at 0.05 and 0.3 s.
        assert found["declaration_to_closest_s.radar"] == pytest.approx(closest_s - 0.3)
        if lost.any():
            assert found["warning_time_s.radar"] == pytest.approx(lost_s - 0.3)
        assert not any(name.endswith(".eye") for name in found)
