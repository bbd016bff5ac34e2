"""A camera's track says that it has no range, and keeps its number when a radar measures one."""

import crooked
import numpy as np
import pymap3d
import pytest
from wired import chain, rows, run

ERRORS = {"range_km": 20.0, "errors": "stated", "quantised": False}
EYE = {**ERRORS, "type": "optical.range_boundary", "scan_rate_hz": 5,
       "azimuth_error_deg": 0.05, "elevation_error_deg": 0.05}  # fmt: skip
RADAR = {**ERRORS, "type": "radar.range_boundary", "scan_rate_hz": 1, "offset_s": 6,
         "azimuth_error_deg": 0.5, "elevation_error_deg": 0.5, "range_error_m": 15.0}  # fmt: skip


@pytest.mark.parametrize("association", ["gnn", "jpda"])
@pytest.mark.parametrize("kind", ["tracking.ekf", "tracking.ukf", "tracking.imm"])
def test_the_first_range_makes_an_ordinary_track_of_it(kind, association):
    scene = chain(
        {"eye": EYE, "radar": RADAR}, duration_s=8, targets=[crooked.ROLLING],
        fusion={"type": "fusion.pass_through"}, tracker={"type": kind, "association": association},
    )  # fmt: skip
    told = rows(run(scene), "state_tracks")
    assert {row["track"] for row in told} == {1}
    for row in told:
        assert row["has_range"] == (row["time_s"] >= 6.0) == (row["north_m"] is not None)
    (row,) = (row for row in told if row["time_s"] == 7.8)
    origin = row["origin_lat_deg"], row["origin_lon_deg"], row["origin_alt_m"]
    known = pymap3d.ecef2ned(*crooked.position(crooked.ROLLING, row["state_s"]), *origin)
    found = np.array([row["north_m"], row["east_m"], row["down_m"]])
    deviation = np.sqrt([row[f"covariance_{i}{i}_m2"] for i in range(3)])
    assert (np.abs(found - known) < 4.0 * deviation).all()
    assert deviation.max() < 20.0
    line = crooked.ned(crooked.ROLLING, 5.0)
    (row,) = (row for row in told if row["time_s"] == 5.0)
    wanted = np.arctan2(line[1], line[0]) % (2.0 * np.pi)
    assert row["azimuth_rad"] == pytest.approx(
        wanted, abs=4.0 * row["azimuth_variance_rad2"] ** 0.5
    )


@pytest.mark.parametrize("association", ["gnn", "jpda"])
def test_each_track_takes_the_range_that_was_measured_of_it(association):
    """Two at one look; how well it is known along the line of sight is what the radar says."""
    scene = chain(
        {"eye": EYE, "radar": RADAR}, duration_s=6.1, fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.ekf", "association": association},
    )  # fmt: skip
    told = [r for r in rows(run(scene), "state_tracks") if r["time_s"] == 6.0 and r["has_range"]]
    away = [np.array([r[f"{n}_m"] - r[f"own_{n}_m"] for n in ("north", "east", "down")])
            for r in told]  # fmt: skip
    known = sorted(np.linalg.norm(crooked.ned(target, 6.0)) for target in crooked.TARGETS)
    assert sorted(map(np.linalg.norm, away)) == pytest.approx(known, abs=60.0)
    for row, line in zip(told, away, strict=True):
        spread = np.empty((3, 3))
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            spread[i, j] = spread[j, i] = row[f"covariance_{i}{j}_m2"]
        line = line / np.linalg.norm(line)
        assert 12.0 < np.sqrt(line @ spread @ line) < 15.5
