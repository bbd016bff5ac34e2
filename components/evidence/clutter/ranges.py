"""Detection ranges of a low intruder over ground, each from the rows of one run."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dsa_des.library.runs import run

#: A radar with a carrier and PRF for Doppler, a gain that is its beam's, and a Pfa as radars have.
RADAR: dict[str, Any] = {
    "type": "radar.swerling", "scan_rate_hz": 20, "power_w": 2.0, "antenna_gain_db": 35.7,
    "frequency_hz": 10e9, "calibrate": {"rcs_dbsm": 3.01, "range_km": 5.0, "pd": 0.5},
    "false_alarm_probability": 1e-6, "reference_pd": 0.5, "azimuth_beamwidth_deg": 2.0,
    "elevation_beamwidth_deg": 4.0, "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0,
    "range_resolution_m": 50.0, "prf_hz": 7000.0, "range_km": 12.0,
}  # fmt: skip
OWN_MPS, HEIGHT_M, BELOW_M, AWAY_M = 50.0, 600.0, 500.0, 9000.0


def scene(
    radar: Mapping[str, Any], gamma_db: float | None, target_mps: float, *, seed: int = 1
) -> dict[str, Any]:
    """Return an encounter head-on: the intruder flies low, the ownship at 50 m/s above it.

    Parameters
    ----------
    radar : mapping
        Keys of the radar that differ from `RADAR`; None leaves one out.
    gamma_db : float or None
        Reflectivity of the ground; none by default.
    target_mps : float
        Towards the ownship.
    """
    table = {key: value for key, value in {**RADAR, **radar}.items() if value is not None}
    own = {
        "lat_deg": 52.0, "lon_deg": 4.4, "alt_m": HEIGHT_M, "heading_deg": 0.0,
        "speed_mps": OWN_MPS,
    }  # fmt: skip
    low = {
        "name": "low", "east_m": 0.0, "north_m": AWAY_M, "up_m": -BELOW_M, "heading_deg": 180.0,
        "speed_mps": target_mps, "rcs_dbsm": 3.01, "swerling": 1,
    }  # fmt: skip
    terrain = {"height_m": 0.0, "clutter_motion_m_s": 0.3}
    if gamma_db is not None:
        terrain["clutter_gamma_db"] = gamma_db
    return {
        "duration_s": round((AWAY_M - 400.0) / (OWN_MPS + target_mps), 1), "seed": seed,
        "wires": ["traffic -> transform -> gate", "gate -> radar"],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": [low]},
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"}, "radar": table,
        },
        **({} if gamma_db is None else {"terrain": terrain}),
    }  # fmt: skip


def half_range_m(
    radar: Mapping[str, Any], gamma_db: float | None, target_mps: float = 60.0
) -> float:
    """Return the farthest range at which one look in two detects the intruder, m; NaN if none."""
    asked = {**scene(radar, gamma_db, target_mps), "record": {"looks": True}}
    rows = run(asked)["looks"].to_pydict()
    range_m = np.array(rows["true_range_m"], dtype=np.float64)
    pd = np.array(rows["detection_probability"], dtype=np.float64)
    good = pd >= 0.5
    return float(range_m[good].max()) if good.any() else math.nan


def detections(radar: Mapping[str, Any], gamma_db: float | None, seeds: int) -> float:
    """Return the mean number of detections of an encounter at 60 m/s."""
    found = [
        run(scene(radar, gamma_db, 60.0, seed=seed))["detections"].num_rows
        for seed in range(1, seeds + 1)
    ]
    return float(np.mean(found))
