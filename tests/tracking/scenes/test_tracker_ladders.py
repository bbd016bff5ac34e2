"""What the ladders of trackers read, against positions by pymap3d and against what is recorded."""

import crooked
import numpy as np
import pymap3d
import pytest
from wired import chain

import dsa_des
from components.track_fusion.covariance_intersection import RULE
from components.tracking.ladder import FILTER, LADDERS, LATENESS
from dsa_des.costs.replay import (
    error_spread_by_quantity,
    errors_against_precise,
    replay_values,
    run_rung,
)

RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 20.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.3, "elevation_error_deg": 0.3, "range_error_m": 9.0,
}  # fmt: skip


def scene(duration_s=4, **keys):
    return chain(
        {"radar": RADAR, "late": {**RADAR, "offset_s": 0.1, "scan_rate_hz": 2, **keys}},
        duration_s=duration_s, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf"},
    )  # fmt: skip


def test_errors_are_distances_from_the_truth():
    loaded = dsa_des.load_scene(scene())
    run = run_rung(loaded, "tracker")
    ticks, values = replay_values(FILTER, run, run)
    recorded = dsa_des.run(loaded)["state_tracks"].to_pylist()
    place = {"rolling": 0, "diving": 1}
    compared = 0
    for name, flight in (("rolling", crooked.ROLLING), ("diving", crooked.DIVING)):
        for tick, position, nees in zip(
            ticks.tolist(), values["position"][:, place[name]], values["nees"][:, place[name]],
            strict=True,
        ):  # fmt: skip
            time_s = tick / loaded.ticks_per_s
            rows = [r for r in recorded if r["time_s"] == time_s
                    and r["track_status"] in ("confirmed", "coasted")]  # fmt: skip
            if not rows:
                assert np.isnan(position)
                continue
            found = []
            for row in rows:
                origin = [row[f"origin_{k}"] for k in ("lat_deg", "lon_deg", "alt_m")]
                true = pymap3d.ecef2ned(*crooked.position(flight, time_s), *origin)
                error = np.array([row[f"{a}_m"] for a in ("north", "east", "down")]) - true
                spread = np.array(
                    [[row[f"covariance_{min(i, j)}{max(i, j)}_m2"] for j in range(3)]
                     for i in range(3)]
                )  # fmt: skip
                found.append((np.linalg.norm(error), error @ np.linalg.solve(spread, error) / 3))
            wanted = min(found)
            assert position == pytest.approx(wanted[0], abs=0.02)
            assert nees == pytest.approx(wanted[1], rel=0.02, abs=1e-3)
            compared += 1
    assert compared > 20


def test_late_looks_that_are_worked_on_are_rows_of_their_own():
    late = scene(latency_s=0.3)
    found = {}
    for mode in ("drop", "rerun"):
        late["blocks"]["tracker"]["late"] = mode
        run = run_rung(dsa_des.load_scene(late), "tracker")
        found[mode] = replay_values(LATENESS, run, run)
    rows = {mode: int((~np.isnan(v["position"])).sum()) for mode, (_, v) in found.items()}
    assert rows["rerun"] > rows["drop"] > 0
    spread = error_spread_by_quantity(LATENESS, found["drop"], found["rerun"])
    assert 0.0 < spread["position"].mean < 30.0
    own, said = errors_against_precise(LATENESS, run, found["rerun"])
    assert own["position"].mean == pytest.approx(np.nanmean(found["rerun"][1]["position"]))
    assert "measured" in said
    assert {ladder.name for ladder in LADDERS} == {"filter", "association", "lateness"}


def test_rules_of_fusion_differ_in_their_spread():
    both = scene()
    both["wires"] = [w for w in both["wires"] if "fusion" not in w]
    del both["blocks"]["fusion"], both["blocks"]["tracker"]
    both["blocks"]["fused"] = {"type": "fusion.covariance_intersection"}
    for name in ("radar", "late"):
        both["blocks"][f"{name}_looks"] = {"type": "fusion.pass_through"}
        both["blocks"][f"{name}_tracks"] = {"type": "tracking.ekf"}
        both["wires"].append(f"{name} -> {name}_looks -> {name}_tracks -> fused")
    found = {}
    for rule in ("independent", "determinant"):
        both["blocks"]["fused"]["rule"] = rule
        loaded = dsa_des.load_scene(both)
        run = run_rung(loaded, "fused")
        found[rule] = replay_values(RULE, run, run)
    ticks, values = found["determinant"]
    told = [r for r in dsa_des.run(loaded)["state_tracks"].to_pylist() if r["block"] == "fused"]
    assert {r["track"] for r in told} == {1, 2}
    for row in told:
        at = np.flatnonzero(ticks == row["tick"])[0], row["track"] - 1
        assert values["position"][at].tolist() == [row[f"{a}_m"] for a in ("north", "east", "down")]
        spread = np.sqrt(sum(row[f"covariance_{i}{i}_m2"] for i in range(3)))
        assert values["spread"][at] == pytest.approx(spread, rel=1e-12)
    assert np.count_nonzero(~np.isnan(values["spread"])) == len(told)
    same = error_spread_by_quantity(RULE, found["determinant"], found["determinant"])
    assert same["position"].maximum == same["spread"].maximum == 0.0
    other = error_spread_by_quantity(RULE, found["independent"], found["determinant"])
    assert other["position"].maximum > 0.1
    ratio = found["independent"][1]["spread"] / found["determinant"][1]["spread"]
    assert np.nanmax(ratio) <= 1.0 + 1e-9 and np.nanmin(ratio) < 0.9
