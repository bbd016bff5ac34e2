"""Random changes of single replicas: drawn parameters of every kind of block."""

from fractions import Fraction
from typing import Any

from dice import Dice

from dsa_des.replicas.changed_scene import Replica

#: Parameter → values, by the beginning of the block's type.
_DRAWS: dict[str, dict[str, tuple[Any, ...]]] = {
    "traffic.scripted": {
        "ownship.heading_deg": (1.5, 200), "ownship.speed_mps": (0, 61.5),
        "ownship.roll_deg": (10,), "intruders[0].east_m": (250, -1500),
        "intruders[0].heading_deg": (10, 190), "intruders[0].rcs_dbsm": (-5, 10),
        "intruders[0].mode_s": (True, False), "intruders[0].ads_b": ({"nacp": 9}, False),
    },
    "traffic.random": {
        "radius_km": (1, 4), "ownship.heading_deg": (33,), "speed_max_mps": (130,),
        "altitude_spread_m": (0, 500), "intruders": (3, 8),
    },
    "traffic.": {"update_rate_hz": (0.3, 2)},
    "geometry.": {"attitude": ("exact", "small_angle"), "model": ("flat_earth", "ellipsoid")},
    "radar.": {
        "range_km": (2, 9), "beam_sweep": (True, False), "range_resolution_m": (0, 50),
        "minimum_range_m": (100,),
    },
    "radar.threshold": {"losses_db": (0, 6), "false_alarm_probability": (0.01,)},
    "radar.swerling": {"swerling": (0, 1, 4), "losses_db": (1,), "detection": ("table",)},
    "optical.": {"range_km": (2, 6)},
    "optical.eo": {"threshold": (0.5, 3), "background": ("auto",), "sun_azimuth_deg": (90,)},
    "optical.ir": {"threshold": (0.5, 3), "false_alarms_per_frame": (0, 0.5)},
    "fusion.pick_best": {"coincidence_s": (0, 0.2)},
    "fusion.gated": {"time_gate_s": (0, 0.3), "angle_gate_deg": (1, 30), "range_gate_m": (100,)},
    "tracking.": {"drop_after_s": (0.5, 4)},
    "avoidance.": {"pause_s": (0, 2), "turn_deg": (10, 45), "range_km": (3,)},
}  # fmt: skip
_SENSOR = {
    "offset_s": (0, 0.25, "1/3"), "jitter_s": (0, 0.02), "rate_error_ppm": (0, 500, -20000),
    "scan_rate_hz": (1, 3, "7/3"), "azimuth_resolution_deg": (0, 2), "enabled": (True, False),
    "mount_azimuth_deg": (0, 30), "misalignment_deg": ([1, 0, 0],), "azimuth_deg": ([-45, 45],),
}  # fmt: skip
_SECTIONS = {
    "navigation.position_bias_m": ([1, 2, 3],), "weather.rain_rate_mm_h": (0, 15),
    "terrain.clutter_gamma_db": (-12,),
}  # fmt: skip


def keys_of(tables: dict[str, Any]) -> dict[str, tuple[Any, ...]]:
    """Return what may be changed in a scene: dotted key → values."""
    found: dict[str, tuple[Any, ...]] = dict(_SECTIONS)
    for name, table in tables["blocks"].items():
        kind = table["type"]
        for beginning, draws in _DRAWS.items():
            if kind.startswith(beginning):
                found |= {f"blocks.{name}.{key}": values for key, values in draws.items()}
        if "scan_rate_hz" in table:
            found |= {f"blocks.{name}.{key}": values for key, values in _SENSOR.items()}
        found[f"blocks.{name}.latency_s"] = (0, 0.15)
        if not table.get("intruders", True):
            for key in [key for key in found if f"{name}.intruders[0]" in key]:
                del found[key]
    return found


#: Ends of keys that may change while a run lasts, beside those of wires and processors.
_MAY_CHANGE = (
    "scan_rate_hz", "offset_s", "jitter_s", "rate_error_ppm", "enabled", "azimuth_deg",
    "azimuth_resolution_deg", "misalignment_deg", "range_km", "range_resolution_m", "losses_db",
    "minimum_range_m", "false_alarm_probability", "threshold", "false_alarms_per_frame",
    "angle_gate_deg", "range_gate_m", "turn_deg", "pause_s", "rain_rate_mm_h", "latency_s",
    "mode_s", "ads_b",
)  # fmt: skip
_OF_WIRES = {"delay_s": (0, 0.2, "1/3"), "jitter_s": (0, 0.1), "drop_probability": (0, 0.5)}


def timed(tables: dict[str, Any], dice: Dice) -> list[dict[str, Any]]:
    """Return what changes in a scene while it runs: one to four keys, once, twice or for a while.

    Parameters
    ----------
    tables : dict
        The scene.
    dice : Dice
        Receives ``changes KEY`` as features.
    """
    keys = {
        key: values
        for key, values in keys_of(tables).items()
        if key.rpartition(".")[2] in _MAY_CHANGE
    }
    for number in range(len(tables["wires"])):
        keys |= {f"wires[{number}].{key}": values for key, values in _OF_WIRES.items()}
    for name in tables.get("processors", {}):
        keys[f"processors.{name}.service_s"] = (0.002, "1/9")
    sensors = [key for key in keys if key.endswith(".enabled")]
    # Sensors most often: of the many wires each is asked for a little.
    weights = [4 if key.startswith(("blocks", "weather")) else 1 for key in sorted(keys)]
    drawn = dict.fromkeys(dice.choices(sorted(keys), weights, k=dice.randint(1, 4)))
    if sensors and dice.chance(0.5):
        drawn[dice.choice(sensors)] = None
    ends = float(Fraction(tables["duration_s"]))
    changes = []
    for key in drawn:
        dice.features.add(f"changes {key.rpartition('.')[2]}")
        first, last = sorted((dice.near(0, ends, 2), dice.near(0, ends, 2)))
        if dice.chance(0.3):
            first = float(int(first))  # where clocks scan
        if first >= ends:
            continue
        values = dice.choice(keys[key]), dice.choice(keys[key])
        if dice.chance(0.5, "changes for a while") and first < last:
            changes.append({"from_s": first, "to_s": last, "set": {key: values[0]}})
            continue
        changes.append({"at_s": first, "set": {key: values[0]}})
        if first < last < ends and dice.chance(0.4, "changes twice"):
            changes.append({"at_s": last, "set": {key: values[1]}})
    return changes


def outages(tables: dict[str, Any], dice: Dice) -> list[dict[str, Any]]:
    """Return what fails in a scene: a block or two, several times in a run, alone or together."""
    ends = float(Fraction(tables["duration_s"]))
    found = []
    for number in range(dice.pick(1, 1, 2)):
        blocks = dice.sample(
            sorted(tables["blocks"]), min(dice.pick(1, 1, 2), len(tables["blocks"]))
        )
        found.append({
            "name": f"bus {number}", "blocks": blocks,
            "mean_between_s": dice.pick(0.2, 0.5) * ends,
            "mean_repair_s": dice.pick(0.05, 0.3) * ends, "restart_s": dice.pick(0, 0.1),
        })  # fmt: skip
        kinds = [tables["blocks"][name]["type"].partition(".")[0] for name in blocks]
        if set(kinds) <= {"radar", "optical"} and dice.chance(0.6):
            if dice.chance(0.6, "frozen outage"):
                found[-1]["mode"] = "frozen"
            else:
                dice.features.add("stuck bit")
                stuck = dice.pick({"azimuth_deg": 11.25}, {"range_m": 256, "azimuth_deg": 90})
                found[-1] |= {"mode": "stuck_bit", "stuck": stuck}
    return found


def pulses(tables: dict[str, Any], dice: Dice) -> None:
    """Let radars with a link budget have pulses, whose echoes fold, and ground that mirrors."""
    for table in tables["blocks"].values():
        if table["type"] not in ("radar.threshold", "radar.swerling") or "prf_hz" in table:
            continue
        dice.features.add("folded ranges")
        table |= {"prf_hz": dice.pick(9e3, 4e4, 2e5), "range_folds": True}
        table.setdefault("range_km", dice.pick(5, 15))
        if dice.chance(0.5, "pulse width"):
            table["pulse_width_s"] = dice.pick(3e-7, 2e-6)
        if dice.chance(0.4, "several PRFs"):
            table["other_prfs_hz"] = dice.pick([1e4, 1.13e4], [1e4, 1.13e4, 1.37e4])
            table.setdefault("range_resolution_m", 30)
            table["prfs_needed"] = dice.pick(1, 2, 3)
    if "height_m" in tables.get("terrain", {}):
        dice.maybe(tables["terrain"], "roughness_m", 0.5, 0, 0.2)
        dice.maybe(tables["terrain"], "facet_slope_deg", 0.5, 5)


def weather_cells(tables: dict[str, Any], dice: Dice) -> None:
    """Let showers and fog banks move near the first ownship, or far away."""
    owns = [t["ownship"] for t in tables["blocks"].values() if isinstance(t.get("ownship"), dict)]
    if not (owns and "lat_deg" in owns[0]):
        return
    dice.features.add("weather cells")
    tables["weather"] = {**tables.get("weather", {}), "cells": [
        {
            "lat_deg": max(-89.0, min(89.0, owns[0]["lat_deg"] + dice.pick(-0.02, 0.0, 0.03, 5))),
            "lon_deg": owns[0]["lon_deg"], "radius_km": dice.pick(0.5, 3),
            **dice.pick({"rain_rate_mm_h": 20}, {"fog_water_g_m3": 0.2}),
            "speed_mps": dice.pick(0, 30), "towards_deg": dice.pick(0, 100),
        }
        for _ in range(dice.pick(1, 2))
    ]}  # fmt: skip


def replicas(tables: dict[str, Any], dice: Dice) -> list[Replica]:
    """Return a few replicas that change the same keys, each to a value of its own.

    Parameters
    ----------
    tables : dict
        The scene.
    dice : Dice
        Receives ``drawn KIND.KEY`` as features.
    """
    keys = keys_of(tables)
    drawn = dice.sample(sorted(keys), dice.choices((0, 1, 2, 4), (2, 5, 3, 1))[0])
    for key in drawn:
        block = tables["blocks"].get(key.split(".")[1], {"type": key.partition(".")[0]})
        dice.features.add(f"drawn {block['type']} {key.rpartition('.')[2]}")
    return [
        Replica(dice.randrange(1000), {key: dice.choice(keys[key]) for key in drawn})
        for _ in range(dice.pick(2, 2, 3, 5))
    ]
