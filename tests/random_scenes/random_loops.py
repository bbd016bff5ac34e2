"""Random closed loops: tracker, alerting and who acts on it, with delays, jitter and loss."""

from typing import Any

from dice import Dice
from random_blocks import closest_approach_passed

from dsa_des.replicas.changed_scene import Replica


def loop_of(dice: Dice, root: str) -> dict[str, Any]:
    """Return the tables of a scene in which the ownship is steered out of the way.

    Parameters
    ----------
    dice : Dice
    root : str
        Folder of the repository.
    """
    conf = f"{root}/configs/alerting/do365b.conf"
    blocks: dict[str, Any] = {
        "radar": {"scan_rate_hz": dice.pick(1, 2, "7/3"), "offset_s": dice.pick(0, 0.2),
                  "jitter_s": dice.pick(0, 0, 0.03)},
        "eo": {"scan_rate_hz": dice.pick(1, 3), "rate_error_ppm": dice.pick(0, 0, 900)},
        "alerting": {"type": "alerting.daidalus", "scan_rate_hz": dice.pick(1, 2), "conf": conf,
                     "fit_s": dice.pick(3, 8), "offset_s": dice.pick(0, 0.3)},
        "traffic": {
            "type": "traffic.scripted",
            "ownship": {"lat_deg": -38, "lon_deg": 4.4, "alt_m": 1000, "heading_deg": 217,
                        "speed_mps": 50},
            "intruders": [_intruder(dice, f"i{k}") for k in range(dice.pick(1, 1, 2))],
        },
    }  # fmt: skip
    acts = dice.pick("avoidance", "pilot", "turn_away")
    kind = {"avoidance": "avoidance.daidalus", "pilot": "operator.stochastic",
            "turn_away": "avoidance.turn_away"}[acts]  # fmt: skip
    blocks["actor"] = {"type": kind}
    if acts != "turn_away":
        blocks["actor"] |= {"conf": conf, "level": dice.pick(1, 2)}
    if acts == "pilot":
        blocks["actor"] |= {"held_s": 1, "coordination_s": 0, "initial_delay_s": dice.pick(0, 2)}
    else:
        blocks["actor"]["pause_s"] = dice.pick(2, 5)
    if acts != "turn_away" and dice.chance(0.3, "tracks with states"):
        blocks |= {
            "fusion": {"type": "fusion.pass_through"},
            "tracker": {"type": dice.pick("tracking.ekf", "tracking.imm", "tracking.ukf")},
        }
    actor = "tracker" if acts == "turn_away" else "alerting"
    wires: list[Any] = [
        "traffic -> transform -> gate", "gate -> radar", "gate -> eo",
        _wire(dice, "radar", "fusion"), _wire(dice, "eo", "fusion"),
        "fusion -> tracker", "traffic -> alerting", _wire(dice, "tracker", "alerting"),
        f"{actor} -> actor",
        {**_wire(dice, "actor", "traffic"), "delay_s": dice.pick(0.25, 1, 4)},
    ]  # fmt: skip
    dice.features |= {f"loop of {acts}"}
    _what_remembers(dice, blocks)
    if blocks.get("fusion"):
        wires = _more_of_tracks(dice, blocks, wires)
    if dice.chance(0.4, "ends early"):
        blocks["over"] = closest_approach_passed(dice)
        wires.append({"from": "traffic", "to": "over", **dice.pick({}, {}, {"delay_s": 0.3})})
        dice.features |= {f"{name} of ending" for name in wires[-1] if name == "delay_s"}
    if acts == "pilot" and dice.chance(0.5, "pilot that eases its turns"):
        blocks["actor"] |= {
            "chooses": "before_executing", "eases_deg": 8, "goes_beyond": dice.pick(True, False),
            "track_step_deg": dice.pick(0, 5), "execution_delay_s": dice.pick(0, 2),
        }  # fmt: skip
    if acts != "turn_away" and dice.chance(0.3, "filtered alerts"):
        blocks["filter"] = {"type": "alerting.m_of_n", "hold_s": dice.pick(0, 4)}
        wires[wires.index("alerting -> actor")] = "alerting -> filter -> actor"
    return {
        **_sections(dice),
        "extends": f"{root}/configs/detect_and_sense.toml", "duration_s": dice.pick(15, 22),
        "seed": dice.randrange(1000), "wires": wires,
        "blocks": {**blocks, "remove": ["ir"]},
    }  # fmt: skip


def _what_remembers(dice: Dice, blocks: dict[str, Any]) -> None:
    """Let sensors do what rests on earlier looks, or on flights at other instants."""
    radar, eo = blocks["radar"], blocks["eo"]
    if dice.chance(0.3, "sweeping beam"):
        radar["beam_sweep"] = True
    if dice.chance(0.3, "range rate"):
        radar["measures_range_rate"] = True
        radar["range_rate_resolution_m_s"] = 2.5
    if dice.chance(0.3, "declaration"):
        radar |= {"declare_m": 2, "declare_n": 3, "declare_by": dice.pick("place", "target")}
    if dice.chance(0.3, "dynamic signature"):
        eo["dynamic_weight"] = dice.pick(0.5, 20)
    if dice.chance(0.2, "publishing rate"):
        blocks["traffic"]["update_rate_hz"] = dice.pick(2, 5)


def _more_of_tracks(dice: Dice, blocks: dict[str, Any], wires: list[Any]) -> list[Any]:
    """Let each sensor have a tracker of its own, and tracks cue the radar, now and then."""
    if dice.chance(0.4, "distributed trackers"):
        kind = blocks["tracker"]
        blocks |= {
            "fusion_eo": {"type": "fusion.pass_through"}, "radar_tracker": kind, "eo_tracker": kind,
            "tracker": {"type": "fusion.covariance_intersection"},
        }  # fmt: skip
        wires = [
            {**wire, "to": "fusion_eo"} if isinstance(wire, dict) and wire["from"] == "eo" else wire
            for wire in wires
            if wire != "fusion -> tracker"
        ] + ["fusion -> radar_tracker -> tracker", "fusion_eo -> eo_tracker -> tracker"]
    if dice.chance(0.4, "cues"):
        blocks["cues"] = {"type": "tracking.cues", "every_s": dice.pick(0, 1)}
        blocks["radar"]["cued_dwell_factor"] = 4
        back = {"from": "cues", "to": "radar", "delay_s": dice.pick(0.3, 1), "holds": {}}
        wires = [*wires, "tracker -> cues", back]
    return wires


def _sections(dice: Dice) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if dice.chance(0.3, "navigation"):
        found["navigation"] = {"position_noise_m": [5, 5, 10], "attitude_noise_deg": [0.5, 0.1, 0]}
    if dice.chance(0.2, "terrain"):
        found["terrain"] = {"height_m": dice.pick(0, 120), "horizon": True}
    return found


def _intruder(dice: Dice, name: str) -> dict[str, Any]:
    return {
        "name": name, "east_m": dice.pick(-900, -1500), "north_m": dice.pick(-1400, -2000),
        "up_m": dice.pick(0, 40), "heading_deg": dice.pick(37, 80), "speed_mps": 60,
    }  # fmt: skip


def _wire(dice: Dice, source: str, target: str) -> dict[str, Any]:
    wire: dict[str, Any] = {"from": source, "to": target, "holds": "nothing"}
    if dice.chance(0.4):
        wire["delay_s"] = dice.pick(0.1, 0.7)
    if dice.chance(0.3):
        wire["jitter_s"] = dice.pick(0.05, 0.5)
    if dice.chance(0.3):
        wire["drop_probability"] = 0.2
    return wire


def loop_replicas(dice: Dice) -> list[Replica]:
    """Return replicas with other flights, other aircraft and other phases."""
    found = []
    keys = {
        "blocks.traffic.intruders[0].heading_deg": (30, 60, 90), "blocks.radar.offset_s": (0, 0.1),
        "blocks.traffic.ownship.speed_mps": (45, 55), "blocks.eo.offset_s": (0, 0.25),
        "blocks.traffic.intruders[0].rcs_dbsm": (-8, 3, 12),
    }  # fmt: skip
    drawn = [key for key in sorted(keys) if dice.chance(0.6)]
    for _ in range(dice.pick(2, 3, 4)):
        changes = {key: dice.choice(keys[key]) for key in drawn}
        found.append(Replica(dice.randrange(1000), changes))
    return found
