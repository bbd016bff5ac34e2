"""Small scenes as tables, run in memory, and their recorded rows."""

import math
from collections.abc import Iterable, Mapping
from copy import deepcopy
from typing import Any

import crooked
from scipy.special import gammainccinv

import dsa_des

Row = dict[str, Any]

#: A radar that detects whatever it looks at, so that its SNR is recorded.
HEARS_ALL: dict[str, Any] = {
    "type": "radar.threshold", "scan_rate_hz": 1, "power_w": 100.0, "antenna_gain_db": 30.0,
    "frequency_hz": 35e9, "bandwidth_hz": 1e5, "threshold_db": -250.0,
    "false_alarm_probability": 1e-6,
}  # fmt: skip
#: A camera that detects whatever it looks at, so that its pixels and signature are recorded.
SEES_ALL: dict[str, Any] = {
    "type": "optical.eo", "scan_rate_hz": 1, "azimuth_pixels": 36000, "elevation_pixels": 18000,
    "threshold": -1.0, "noise_equivalent_contrast": 0.0,
}  # fmt: skip


def chain(
    sensors: Mapping[str, Mapping[str, Any]],
    *,
    ownship: Mapping[str, Any] = crooked.OWNSHIP,
    targets: Iterable[Mapping[str, Any]] = crooked.TARGETS,
    duration_s: float = 1,
    fusion: Mapping[str, Any] | None = None,
    tracker: Mapping[str, Any] | None = None,
    **sections: Any,
) -> dict[str, Any]:
    """Return a scene: traffic, transform, gate and some sensors; fusion and tracker if given."""
    wires: list[Any] = ["traffic -> transform -> gate"]
    wires += [f"gate -> {name}" for name in sensors]
    blocks: dict[str, Any] = {
        "traffic": {
            "type": "traffic.scripted", "ownship": dict(ownship), "intruders": [*targets]
        },
        "transform": {"type": "geometry.ellipsoid"},
        "gate": {"type": "gate"},
        **sensors,
    }  # fmt: skip
    if fusion is not None:
        blocks["fusion"] = fusion
        wires += [f"{name} -> fusion" for name in sensors]
    if tracker is not None:
        blocks["tracker"] = tracker
        wires.append("fusion -> tracker")
    scene = {"duration_s": duration_s, "seed": 1, "wires": wires, "blocks": blocks, **sections}
    return deepcopy(scene)


def head_on_loop(
    radar: Mapping[str, Any], wire: Mapping[str, Any], *, north_m: float, **sections: Any
) -> dict[str, Any]:
    """Return a closed loop: an aircraft comes head-on, and one of its tracks makes us turn.

    `wire` says how the one to the avoidance delays or loses them.
    """
    level = {"speed_mps": 50}
    scene = chain(
        {"radar": {
            "type": "radar.range_boundary", "scan_rate_hz": 1, "range_cell_m": 76.2,
            "azimuth_beamwidth_deg": 5.8, "elevation_beamwidth_deg": 5.8, **radar,
        }},
        ownship={"lat_deg": 52, "lon_deg": 4, "alt_m": 1000, **level},
        targets=[{"name": "ahead", "east_m": 0, "north_m": north_m, "up_m": 0, "heading_deg": 180,
                  **level}],
        fusion={"type": "fusion.pick_best"}, tracker={"type": "tracking.stub"}, **sections,
    )  # fmt: skip
    turn = {"type": "avoidance.turn_away", "range_km": 5, "turn_deg": 90, "rate_deg_s": 6}
    scene["blocks"]["avoidance"] = turn
    scene["wires"] += [
        {"from": "tracker", "to": "avoidance", **wire},
        {"from": "avoidance", "to": "traffic", "delay_s": 1, "holds": "nothing"},
    ]
    return scene


def run(scene: Mapping[str, Any]) -> Any:
    """Run a scene in memory and record every look."""
    return dsa_des.run({**scene, "record": {"looks": True, **scene.get("record", {})}})


def rows(run: Any, table: str = "detections", **wanted: Any) -> list[Row]:
    """Return the rows of a run's table whose columns have the wanted values."""
    found = run[table].to_pylist()
    return [row for row in found if all(row[key] == value for key, value in wanted.items())]


def decided(run: Any, **wanted: Any) -> list[Row]:
    """Return detections with the mean SNR, the Pd and the margin that decided.

    Only the truth knows those: a detection's own are of one output, with its noise.
    """
    said = ("snr_db", "detection_probability", "confidence")
    looks = {
        (row["block"], row["scan"], row["target"]): {key: row[key] for key in said}
        for row in rows(run, "looks")
    }
    return [
        {**row, **looks.get((row["block"], row["scan"], row["target"]), {})}
        for row in rows(run, **wanted)
    ]


def first_look(scene: Mapping[str, Any], block: str) -> dict[str, Row]:
    """Return a sensor's detections of its first scan by target, as they were decided."""
    return {row["target"]: row for row in decided(run(scene), block=block, scan=0)}


def measured(scene: Mapping[str, Any], *metrics: Any) -> Row:
    """Return a study's results of one run of a scene, by name."""
    result = dsa_des.study(scene, metrics=list(metrics), replicas=1, workers=1)
    return {row["result"]: row["value"] for row in result.summary.to_pylist()}


#: One of every sensor, which detects every target of the crooked flights at every scan.
SENSORS: dict[str, dict[str, Any]] = {
    "radar.threshold": HEARS_ALL,
    "radar.swerling": {
        **{key: value for key, value in HEARS_ALL.items() if key != "threshold_db"},
        "type": "radar.swerling", "swerling": 0, "power_w": 1e9,
    },
    "radar.range_boundary": {"type": "radar.range_boundary", "scan_rate_hz": 1, "range_km": 20.0},
    "optical.eo": SEES_ALL,
    "optical.ir": {**SEES_ALL, "type": "optical.ir"},
    "optical.projection": {**SEES_ALL, "type": "optical.projection"},
    "optical.range_boundary": {
        "type": "optical.range_boundary", "scan_rate_hz": 1, "range_km": 20.0,
        "azimuth_resolution_deg": 0.0, "elevation_resolution_deg": 0.0,
    },
    "laser.scanning": {
        "type": "laser.scanning", "scan_rate_hz": 1, "range_km": 20.0, "azimuth_shots": 1,
        "elevation_shots": 1, "pattern": "one_shot", "errors": "grid", "quantised": True,
        "divergence_mrad": 1.0, "peak_power_w": 1e9, "pulse_ns": 5.0, "aperture_mm": 50.0,
        "noise_equivalent_power_w": 1e-9,
    },
    "visual.acquisition": {
        "type": "visual.acquisition", "scan_rate_hz": 1, "azimuth_deg": [-180.0, 180.0],
        "elevation_deg": [-90.0, 90.0], "beta_per_sr_s": 1e12, "between_scans": "as_at_scan",
    },
}  # fmt: skip


def sensor(kind: str, **keys: Any) -> dict[str, Any]:
    """Return a table of a sensor that detects everything, with some keys changed; None: without."""
    return {key: value for key, value in {**SENSORS[kind], **keys}.items() if value is not None}


def noise_crosses(kind: str, pfa: float, pulses: int = 1) -> dict[str, Any]:
    """Return the keys of a radar of which noise is reported, with the one threshold that it has."""
    keys = {"false_alarms": True, "false_alarm_probability": pfa}
    if kind != "radar.threshold":
        return keys
    least = float(gammainccinv(pulses, pfa)) / pulses - 1.0
    return {**keys, "threshold_db": 10.0 * math.log10(least)}


def alone(kind: str, *, duration_s: float = 1, targets: Any = crooked.TARGETS, **keys: Any) -> Any:
    """Run a scene with one such sensor, named ``sensor``."""
    return run(chain({"sensor": sensor(kind, **keys)}, duration_s=duration_s, targets=targets))
