"""Random traffic of every type: where aircraft start, what they are, and how they fly."""

import math
from typing import Any

from dice import Dice

PLACES = {
    "equator": (0, 0), "middle latitude": (52, 4.4), "southern hemisphere": (-33.9, 151.2),
    "near the north pole": (89.99, -180), "near the south pole": (-89.999, 4.4),
    "at the pole": (90, 0), "antimeridian": (-17.5, 179.9995), "antimeridian west": (60, -180),
}  # fmt: skip
_AREAS = ((12.0, 30.0, 90.0), (7.0, 20.0, 250.0), (90.0, 250.0, 400.0), (0.0, 0.0, 0.0))


def aircraft(dice: Dice) -> dict[str, Any]:
    """Return what an aircraft is to sensors; table files are written beside the scene."""
    front, side, horizontal = dice.pick(*_AREAS)
    found: dict[str, Any] = {}
    dice.maybe(found, "rcs_dbsm", 0.7, 1.76, 6.99, -10, 20)
    dice.maybe(found, "swerling", 0.5, 0, 1, 2, 3, 4, 5)
    dice.maybe(found, "contrast", 0.3, 0.0, 0.5, 2.0)
    dice.maybe(found, "contrast_ir", 0.3, 0.5, 2.0)
    dice.maybe(found, "engine", 0.3, "propeller", "turbofan", "turbojet")
    dice.maybe(found, "paint_reflectance", 0.2, 0.0, 0.1, 1.0)
    eo = {"front_m2": front, "side_m2": side, "horizontal_m2": horizontal}
    ir = {**eo, "back_m2": 2 * front}
    if dice.chance(0.1, "aspect table of RCS"):
        found["rcs_table"] = "rcs.csv"
    if dice.chance(0.15, "silhouette table"):
        eo["silhouette_table"] = ir["silhouette_table"] = "area.csv"
    if dice.chance(0.5) or "silhouette_table" in eo:
        found["eo"], found["ir"] = eo, ir
    return found


def table_files() -> dict[str, str]:
    """Return the tables that aircraft may name, by file name."""
    rows = [(azimuth, elevation) for azimuth in range(-180, 180, 60) for elevation in (-90, 0, 90)]

    def text(column: str, scale: float) -> str:
        lines = [f"az_deg,el_deg,{column}"]
        for azimuth, elevation in rows:
            lobe = 0.0 if abs(elevation) == 90 else math.cos(math.radians(azimuth))
            lines.append(f"{azimuth},{elevation},{scale * (2 + lobe):.3f}")
        return "\n".join(lines) + "\n"

    return {"rcs.csv": text("dbsm", 3.0), "area.csv": text("area_m2", 8.0)}


def attitude(dice: Dice, flight: dict[str, Any]) -> None:
    """Give a flight an attitude of its own now and then."""
    dice.maybe(flight, "yaw_deg", 0.1, 0, 60, -179.5)
    dice.maybe(flight, "pitch_deg", 0.1, -20, 5, 89)
    dice.maybe(flight, "roll_deg", 0.1, 60, -30, 180)


def legs(dice: Dice, speed_mps: float) -> list[dict[str, Any]]:
    """Return a few legs, each of a kind of its own."""
    found: list[dict[str, Any]] = []
    for _ in range(dice.randint(1, 3)):
        kind = dice.pick("straight", "turn", "turn", "climb", "stationary", "waypoints")
        leg: dict[str, Any] = {"kind": kind}
        if kind == "turn":
            leg["rate_deg_s"] = dice.pick(3, -3, 30, -0.5)
            if dice.chance(0.5):
                leg["angle_deg"] = dice.pick(20, 90, 400)
        if kind == "straight":
            dice.maybe(leg, "heading_deg", 0.5, 0, 90, 275.5)
            dice.maybe(leg, "speed_mps", 0.3, 0, 50, 250)
        if kind == "climb":
            leg["climb_mps"] = dice.pick(5, -3)
        if kind == "waypoints":
            if speed_mps <= 0:
                continue
            leg["points"] = [
                {"east_m": dice.near(-4000, 4000, 0), "north_m": dice.near(-4000, 4000, 0)}
                for _ in range(dice.randint(1, 3))
            ]
        elif "angle_deg" not in leg:
            leg["duration_s"] = dice.pick(0.5, 1, 2.25, 4)
        dice.features.add(f"leg {kind}")
        found.append(leg)
    return found


def ownship(dice: Dice) -> dict[str, Any]:
    """Return an ownship somewhere on Earth."""
    place = dice.pick(*PLACES)
    dice.features.add(place)
    lat, lon = PLACES[place]
    speed = dice.pick(0, 30, 50, 80, 200)
    flight = {
        "lat_deg": lat, "lon_deg": lon, "alt_m": dice.pick(300, 1000, 8000),
        "heading_deg": dice.pick(0, 20, 123, 270), "speed_mps": speed,
    }  # fmt: skip
    dice.maybe(flight, "climb_mps", 0.1, 2, -1)
    attitude(dice, flight)
    if dice.chance(0.25, "ownship with legs"):
        flight["legs"] = legs(dice, speed)
    return flight


def intruder(dice: Dice, number: int) -> dict[str, Any]:
    """Return one scripted intruder, mostly on its way to the ownship."""
    bearing, distance_m = dice.uniform(0, 360), dice.pick(50, 300, 1000, 2500, 5000, 12000)
    speed = dice.pick(0, 40, 60, 110, 300)
    flight = {
        "name": f"i{number}",
        "east_m": round(distance_m * math.sin(math.radians(bearing)), 2),
        "north_m": round(distance_m * math.cos(math.radians(bearing)), 2),
        "up_m": dice.pick(0, 0, 30, -150, 500),
        "heading_deg": round((bearing + 180 + dice.uniform(-30, 30)) % 360, 3),
        "speed_mps": speed,
        **aircraft(dice),
    }
    attitude(dice, flight)
    if dice.chance(0.2, "intruder with legs"):
        flight["legs"] = legs(dice, speed)
    return flight


def csv_rows(dice: Dice, duration_s: float) -> str:
    """Return a CSV file of an ownship and a few aircraft that come and go."""
    lat, lon = PLACES[dice.pick(*PLACES)]
    lines = ["time,id,lat,lon,alt"]
    for number in range(dice.randint(2, 5)):
        start = 0.0 if number < 2 else dice.near(0, duration_s / 2, 1)
        end = duration_s + 1 if number == 0 else dice.near(start + 0.5, duration_s + 1, 1)
        step = dice.pick(0.5, 1.0)
        north, east = dice.uniform(-0.02, 0.02), dice.uniform(-0.02, 0.02)
        for sample in range(int((end - start) / step) + 2):
            t = start + sample * step
            here = max(-90.0, min(90.0, lat - abs(north) + 0.0004 * t * (number - 1)))
            there = (lon + (east + 0.0003 * t) * (number > 0) + 180.0) % 360.0 - 180.0
            lines.append(f"{t:.3f},a{number},{here:.7f},{there:.7f},{1000 + 20 * number}")
    return "\n".join(lines) + "\n"


def traffic(dice: Dice, duration_s: float, files: dict[str, str], shipped: str) -> dict[str, Any]:
    """Return the table of a traffic block; files it reads are added to `files`.

    Parameters
    ----------
    dice : Dice
    duration_s : float, s
    files : dict
        Text by file name.
    shipped : str
        Path of a traffic file of the project.
    """
    kind = dice.pick(*["scripted"] * 5, *["random"] * 4, "csv", "daa_file")
    table: dict[str, Any] = {"type": f"traffic.{kind}"}
    dice.features.add(table["type"])
    if kind == "scripted":
        table["ownship"] = ownship(dice)
        table["intruders"] = [intruder(dice, n) for n in range(dice.pick(0, 1, 2, 3, 6))]
        if not table["intruders"]:
            dice.features.add("no intruders")
    elif kind == "random":
        table |= {"ownship": ownship(dice), "intruders": dice.pick(1, 5, 20, 60),
                  "radius_km": dice.pick(2, 5, 15, 100), "aircraft": aircraft(dice)}  # fmt: skip
        dice.maybe(table, "altitude_spread_m", 0.5, 0, 100, 2000)
        dice.maybe(table, "speed_min_mps", 0.3, 0, 10)
        dice.maybe(table, "speed_max_mps", 0.3, 120, 300)
    elif kind == "csv":
        name = f"traffic{len(files)}.csv"
        files[name] = csv_rows(dice, duration_s)
        table |= {"file": name, "intruder": aircraft(dice)}
        if dice.chance(0.3):
            table["ownship"] = "a1"
    else:
        table |= {"file": shipped, "intruder": aircraft(dice)}
    if dice.chance(0.2, "update_rate_hz"):
        table["update_rate_hz"] = dice.pick(0.1, 1, 7, 20, "30/7")
    return table
