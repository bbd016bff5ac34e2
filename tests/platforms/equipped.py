"""Scenes in which several aircraft carry a chain of sensor, tracker, alerting and decision."""

from collections.abc import Mapping
from typing import Any

import dsa_des

CONF = "configs/alerting/do365b.conf"

RADAR = {
    "extends": "configs/sensors/oasys.toml",
    "azimuth_deg": [-180, 180],
    "elevation_deg": [-60, 60],
    "acknowledged": ["false_alarm_probability", "gas attenuation", "beam_sweep"],
}
SURE_RADAR = {
    "type": "radar.range_boundary",
    "scan_rate_hz": 1,
    "range_km": 9,
    "azimuth_beamwidth_deg": 2,
    "elevation_beamwidth_deg": 2,
    "range_cell_m": 50,
}
STUB = {"type": "tracking.stub"}
TURN_AWAY = {"type": "avoidance.turn_away", "range_km": 6, "pause_s": 30}
AVOIDANCE = {"type": "avoidance.daidalus", "conf": CONF, "beyond_deg": 10}
PILOT = {"type": "operator.stochastic", "conf": CONF, "turn_share": 1}


def wires_of(suffix: str, decides_by: str = "alerting", delay_s: float = 5) -> list[Any]:
    """Return the wires of a chain from the traffic to its decisions and back."""
    names = ("transform", "gate", "radar", "fusion", "tracker", "alerting")
    chain = " -> ".join(f"{name}{suffix}" for name in names)
    back = {"from": f"decider{suffix}", "to": "traffic", "delay_s": delay_s, "holds": "nothing"}
    by = f"{decides_by}{suffix} -> decider{suffix}"
    return [f"traffic -> {chain}", f"traffic -> alerting{suffix}", by, back]


def blocks_of(
    suffix: str,
    platform: str | None,
    radar: Mapping[str, Any] = SURE_RADAR,
    tracker: Mapping[str, Any] = STUB,
    decider: Mapping[str, Any] = AVOIDANCE,
) -> dict[str, Any]:
    """Return the blocks of a chain, on a platform."""
    on = {} if platform is None else {"platform": platform}
    blocks: dict[str, Any] = {
        "transform": {"type": "geometry.ellipsoid", **on},
        "gate": {"type": "gate"},
        "radar": dict(radar),
        "fusion": {"type": "fusion.pass_through"},
        "tracker": dict(tracker),
        "alerting": {"type": "alerting.daidalus", "conf": CONF, "scan_rate_hz": 1, "fit_s": 8},
        "decider": dict(decider),
    }
    return {f"{name}{suffix}": block for name, block in blocks.items()}


def scene_of(
    ownship: Mapping[str, Any],
    intruders: list[Mapping[str, Any]],
    chains: Mapping[str, str | None],
    *,
    duration_s: float = 120,
    seed: int = 1,
    **how: Any,
) -> dsa_des.Scene:
    """Return a scene with a chain for each suffix, on the platform that goes with it."""
    blocks: dict[str, Any] = {
        "traffic": {
            "type": "traffic.scripted",
            "ownship": dict(ownship),
            "intruders": [dict(one) for one in intruders],
        }
    }
    sections, decides_by = how.pop("sections", {}), how.pop("decides_by", "alerting")
    wires: list[Any] = []
    for suffix, platform in chains.items():
        wires += wires_of(suffix, decides_by)
        blocks |= blocks_of(suffix, platform, **how)
    return dsa_des.load_scene(
        {"title": "t", "duration_s": duration_s, "seed": seed, "wires": wires, "blocks": blocks,
         **sections}
    )  # fmt: skip
