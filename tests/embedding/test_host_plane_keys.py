"""Planes that a host moves are to sensors what the scene says of them."""

import math
from typing import Any

import crooked
import pytest
from covering import covers
from wired import SENSORS, chain

import dsa_des
from dsa_des.embed import Simulator
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

AREAS = {"front_m2": 4.0, "side_m2": 0.0, "horizontal_m2": 0.0}
WARM = {**AREAS, "back_m2": 4.0}
BASE: dict[str, Any] = {
    "name": "one", "rcs_dbsm": 2.0, "swerling": 1, "eo": AREAS, "ir": WARM, "contrast": 0.6,
    "contrast_ir": 0.25, "paint_reflectance": 0.4, "engine": "turbofan",
}  # fmt: skip
OWN = crooked.OWNSHIP
CLOCKED = {
    "radar": {**SENSORS["radar.threshold"]},
    "eye": {**SENSORS["optical.eo"]},
    "lit": {**SENSORS["optical.eo"], "background": "ground", "sky": "overcast"},
    "warm": {**SENSORS["optical.ir"]},
    "hot": {**SENSORS["optical.ir"], "plume": True},
}


def pose_of(*flights: dict[str, Any]) -> list[Any]:
    """Place and attitude of each flight, as a host gives them."""
    found: list[Any] = []
    for flight in flights:
        lat, lon, alt = crooked.geodetic(crooked.position(flight))
        turned = [math.radians(flight[f"{key}_deg"]) for key in ("yaw", "pitch", "roll")]
        found += [(math.radians(lat), math.radians(lon), alt), turned]
    return found


def look(craft: dict[str, Any], **sensors) -> dict[str, float]:
    """Confidence of each sensor in one plane, the radar's in dB and the cameras' signature."""
    scene = chain({**CLOCKED, **sensors}, fusion={"type": "fusion.pick_best"})
    scene["blocks"]["traffic"] = {"type": "traffic.host", "planes": [craft]}
    simulator = Simulator(dsa_des.load_scene(scene))
    assert simulator.planes == (craft["name"],)
    result = simulator.simulate(*pose_of(OWN, crooked.DIVING), 0.0)
    return result[craft["name"]].confidence


def changed(**keys: Any) -> dict[str, float]:
    """Factors of each sensor's signature, and what is added to the radar's SNR."""
    before, after = look(BASE), look({**BASE, **keys})
    found = {block: (after[block] - 1.0) / (before[block] - 1.0) for block in before}
    return {**found, "radar": after["radar"] - before["radar"]}


SAME = {"radar": 0.0, "eye": 1.0, "lit": 1.0, "warm": 1.0, "hot": 1.0}


@covers("rcs_dbsm", "eo.front_m2", "ir.front_m2", "ir.back_m2", "contrast", "contrast_ir",
        of=("traffic.host.planes",))  # fmt: skip
@pytest.mark.parametrize(
    ("keys", "factors"),
    [
        ({"rcs_dbsm": 9.0}, {"radar": 7.0}),
        ({"eo": {**AREAS, "front_m2": 12.0}}, {"eye": 3.0, "lit": 3.0}),
        ({"contrast": 0.9}, {"eye": 1.5, "lit": 1.5}),
        ({"contrast_ir": 0.5}, {"warm": 2.0, "hot": 2.0}),
        ({"ir": {**WARM, "front_m2": 8.0, "back_m2": 8.0}}, {"warm": 2.0, "hot": 2.0}),
    ],
)
def test_each_sensor_sees_what_is_meant_for_it(keys, factors):
    # The radar measures 70 dB with some noise.
    found, expected = changed(**keys), {**SAME, **factors}
    assert found.pop("radar") == pytest.approx(expected.pop("radar"), abs=0.03)
    assert found == pytest.approx(expected, abs=1e-9)


@covers("eo.side_m2", "eo.horizontal_m2", "ir.side_m2", "ir.horizontal_m2",
        "ir.front_m2", "ir.back_m2", "engine", "paint_reflectance",
        of=("traffic.host.planes",))  # fmt: skip
def test_bodies_engines_and_paint_by_the_attitude_that_the_host_gives():
    vector = -crooked.aspect(crooked.DIVING)
    nose, wing, floor = vector / math.sqrt(float(vector @ vector))
    side, top = math.hypot(wing, floor), abs(floor)
    for key, share in (("side_m2", side), ("horizontal_m2", top)):
        more = {**AREAS, key: 10.0}
        found = changed(eo=more, ir={**WARM, key: 10.0})
        expected = (4.0 + 10.0 * share) / 4.0
        assert found["eye"] == pytest.approx(expected) == found["warm"]
    back = changed(ir={**WARM, "back_m2": 14.0})["warm"]
    assert back == pytest.approx((4.0 + 10.0 * 0.5 * (1.0 + nose)) / 4.0)
    plume = {"turbofan": 0.25, "turbojet": 1.0}
    grown = changed(engine="turbojet")
    areas = {engine: 4.0 + share * 4.0 * 0.5 * (1.0 + nose) for engine, share in plume.items()}
    assert grown["hot"] == pytest.approx(areas["turbojet"] / areas["turbofan"])
    assert grown["warm"] == 1.0
    painted = changed(paint_reflectance=0.0)
    assert painted["lit"] > 1.0 and painted["eye"] == 1.0


@covers(*(f"laser.{key}" for key in (
            "reflectivity", "area_m2", "wire_diameter_mm", "wire_length_m", "wire_direction_deg",
            "wire_slope_deg")), of=("traffic.host.planes",))  # fmt: skip
def test_a_laser_hits_what_the_scene_says():
    line = crooked.ned(crooked.DIVING)
    range_m = math.sqrt(float(line @ line))

    def strength_db(surface, **keys):
        laser = {**SENSORS["laser.scanning"], **keys}
        return look({**BASE, "laser": surface}, laser=laser).get("laser")

    flat = {"reflectivity": 0.5, "area_m2": 0.3}
    whole_db = strength_db(flat) - 20.0 * math.log10(
        0.5 * 0.3 / (math.pi / 4.0 * (1e-3 * range_m) ** 2)
    )
    for keys in ({"reflectivity": 0.25}, {"area_m2": 0.15}):
        assert strength_db({**flat, **keys}) - strength_db(flat) == pytest.approx(-6.02, abs=0.01)
    wire = {"reflectivity": 0.4, "wire_diameter_mm": 8.0, "wire_length_m": 9.0}
    for direction_deg, slope_deg in ((20.0, 0.0), (120.0, 35.0)):
        turn, rise = math.radians(direction_deg), math.radians(slope_deg)
        along = (math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn), -math.sin(rise))
        cosine = sum(a * b for a, b in zip(along, line, strict=True)) / range_m
        share = math.sqrt(1.0 - cosine**2) * 4.0 * 0.008 / (math.pi * 1e-3 * range_m)
        placed = {**wire, "wire_direction_deg": direction_deg, "wire_slope_deg": slope_deg}
        found_db = strength_db(placed) - whole_db
        assert found_db == pytest.approx(20.0 * math.log10(0.4 * share), abs=0.01)
    many = {"azimuth_shots": 100, "elevation_shots": 50}
    # So few shots that none meets a short wire.
    for length_m, seen in ((1e-4, False), (1e5, True)):
        found = strength_db({**wire, "wire_length_m": length_m}, pattern="scanned", **many)
        assert bool(found and not math.isnan(found)) == seen


@covers("eo.made_for", "ir.made_for", of=("traffic.host.planes",))
def test_areas_that_were_fitted_for_another_silhouette_are_spoken_of():
    fitted = {"eo": {**AREAS, "made_for": "convex_hull"}, "ir": {**WARM, "made_for": "convex_hull"}}
    cameras = {name: CLOCKED[name] for name in ("eye", "warm")}
    for keys, silhouettes, told in (
        (fitted, ("exact", "convex_hull"), {"eye"}), (fitted, ("convex_hull", "exact"), {"warm"}),
        ({"eo": fitted["eo"]}, ("thesis", "thesis"), {"eye"}), ({}, ("exact", "exact"), set()),
    ):  # fmt: skip
        sensors = {
            name: {**camera, "silhouette": silhouette}
            for (name, camera), silhouette in zip(cameras.items(), silhouettes, strict=True)
        }
        scene = chain(sensors, fusion={"type": "fusion.pick_best"})
        scene["blocks"]["traffic"] = {"type": "traffic.host", "planes": [{**BASE, **keys}]}
        said = [line for line in notes_of_scene(Simulation(dsa_des.load_scene(scene)))
                if "'one' were fitted for silhouette 'convex_hull'" in line]  # fmt: skip
        assert {line.split(":")[0].removeprefix("blocks.") for line in said} == told


@covers("rcs_table", "eo.silhouette_table", "ir.silhouette_table", of=("traffic.host.planes",))
def test_tables(tmp_path):
    nodes = [(azimuth, elevation) for azimuth in (0, 90, 180, 270) for elevation in (-90, 90)]
    for name, column, value in (("r", "dbsm", 13), ("e", "area_m2", 8), ("i", "area_m2", 20)):
        lines = [f"az_deg,el_deg,{column}", *(f"{az},{el},{value}" for az, el in nodes)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    file = {name: str(tmp_path / f"{name}.csv") for name in "rei"}
    before = look(BASE)
    after = look(
        {**BASE, "rcs_table": file["r"], "eo": {**AREAS, "silhouette_table": file["e"]},
         "ir": {**WARM, "silhouette_table": file["i"]}},
        eye={**CLOCKED["eye"], "silhouette": "aspect_table"},
        warm={**CLOCKED["warm"], "silhouette": "aspect_table"},
    )  # fmt: skip
    assert after["radar"] - before["radar"] == pytest.approx(11.0, abs=0.03)
    assert (after["eye"] - 1.0) / (before["eye"] - 1.0) == pytest.approx(2.0)
    assert (after["warm"] - 1.0) / (before["warm"] - 1.0) == pytest.approx(5.0)


@covers("swerling", "name", of=("traffic.host.planes",))
def test_a_probabilistic_radar_misses_planes_by_their_own_fluctuation():
    """The mean SNR by the loud radar's, Pd by closed forms, over 400 scans; planes go by name."""
    radar = {key: CLOCKED["radar"][key] for key in CLOCKED["radar"] if key != "threshold_db"}
    snr_db = look(BASE)["radar"] - 250.0
    radar |= {"type": "radar.swerling", "power_w": 100.0 * 10.0 ** (0.1 * (16.0 - snr_db))}
    models = (0, 1, 3)
    planes = [{**BASE, "name": f"swerling {model}", "swerling": model} for model in models]
    scene = chain({"radar": radar}, fusion={"type": "fusion.pick_best"}, duration_s=500)
    scene["blocks"]["traffic"] = {"type": "traffic.host", "planes": planes}
    simulator = Simulator(dsa_des.load_scene(scene))
    own, turned, place, attitude = pose_of(OWN, crooked.DIVING)
    seen = dict.fromkeys((plane["name"] for plane in planes), 0)
    for second in range(400):
        result = simulator.simulate(own, turned, [place] * 3, [attitude] * 3, float(second))
        for name in seen:
            seen[name] += bool(result[name].confidence)
    half = 0.5 * 10.0**1.6
    over = math.log(1e-6)
    threes = math.exp(over / (1.0 + half)) * (1.0 - over * half / (1.0 + half) ** 2)
    for model, pd in zip(models, (1.0, math.exp(over / (1.0 + 2.0 * half)), threes), strict=True):
        spread = 3.0 * math.sqrt(0.25 / 400)
        assert seen[f"swerling {model}"] / 400 == pytest.approx(pd, abs=spread)


def test_a_host_is_told_where_the_planes_are_in_its_own_body_axes():
    """Range of the radar, angles of the cameras, by the states that the host gave."""
    fine = {"azimuth_resolution_deg": 1e-7, "elevation_resolution_deg": 1e-7}
    sensors = {"radar": CLOCKED["radar"], "eye": {**CLOCKED["eye"], **fine}}
    scene = chain(sensors, fusion={"type": "fusion.pick_best"})
    scene["blocks"]["traffic"] = {"type": "traffic.host", "planes": [BASE, {**BASE, "name": "b"}]}
    simulator = Simulator(dsa_des.load_scene(scene))
    own, turned, *others = pose_of(OWN, *crooked.TARGETS)
    places, attitudes = others[::2], others[1::2]
    result = simulator.simulate(own, turned, places, attitudes, 0.0)
    for name, target in zip(("one", "b"), crooked.TARGETS, strict=True):
        vector = crooked.body(target)
        azimuth, elevation = crooked.angles(vector)
        polar = azimuth, elevation, math.sqrt(float(vector @ vector))
        assert result[name].polar == pytest.approx(polar, abs=1e-6)
