"""What an aircraft is to a sensor, key by key, whichever traffic carries it."""

import math
from typing import Any

import crooked
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pymap3d
import pytest
from covering import covers
from wired import Row, chain, decided, rows, run, sensor

import dsa_des
from components.formats.asterix_records import ADS_B, AsterixRecord, write_records
from components.formats.csv_file import read_csv
from components.formats.set_file import read_set
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

AREAS = {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 50.0}
WARM = {"front_m2": 3.0, "back_m2": 9.0, "side_m2": 8.0, "horizontal_m2": 30.0}
BASE: dict[str, Any] = {
    "rcs_dbsm": 2.0, "swerling": 0, "eo": AREAS, "ir": WARM, "contrast": 0.6, "contrast_ir": 0.25,
    "paint_reflectance": 0.4, "engine": "turbofan",
}  # fmt: skip
OWN = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0, "heading_deg": 217.0}
OTHER = {"name": "one", "east_m": -700.0, "north_m": -1500.0, "up_m": 300.0}
PATH_DEG = 217.0
PLACE = ("lat_deg", "lon_deg", "alt_m")


def samples(path, daa: bool) -> str:
    """The two aircraft at rest at the same place for two seconds."""
    places = {"own": OWN, "one": {**OTHER, "heading_deg": 0.0, "speed_mps": 0.0, "climb_mps": 0.0}}
    still = {"speed_mps": 0.0, "climb_mps": 0.0}
    lines = (
        ["NAME lat lon alt time", "[none] [deg] [deg] [m] [s]"] if daa else ["id,lat,lon,alt,time"]
    )
    for time in (0, 1, 2):
        for name, flight in places.items():
            lat, lon, alt = crooked.geodetic(crooked.position({**flight, **still}, ownship=OWN))
            values = name, repr(lat), repr(lon), repr(alt), str(time)
            lines.append((" " if daa else ",").join(values))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def scripted(craft: dict, folder) -> dict:
    return {"type": "traffic.scripted", "ownship": OWN, "intruders": [{**OTHER, **craft}]}


def random(craft: dict, folder) -> dict:
    return {
        "type": "traffic.random", "ownship": OWN, "intruders": 1, "radius_km": 2.0,
        "speed_min_mps": 0.0, "speed_max_mps": 0.0, "aircraft": craft,
    }  # fmt: skip


def csv_any(craft: dict, folder) -> dict:
    file = samples(folder / "f.csv", False)
    return {"type": "traffic.csv", "file": file, "intruder": craft}


def csv_one(craft: dict, folder) -> dict:
    return {**csv_any({}, folder), "aircraft": {"one": craft}}


def daa_any(craft: dict, folder) -> dict:
    file = samples(folder / "f.daa", True)
    return {"type": "traffic.daa_file", "file": file, "intruder": craft}


def daa_one(craft: dict, folder) -> dict:
    return {**daa_any({}, folder), "aircraft": {"one": craft}}


def asterix_any(craft: dict, folder) -> dict:
    pytest.importorskip("asterix", reason="needs the extra asterix")
    flights = read_csv(samples(folder / "f.csv", False)).aircraft
    records = [
        AsterixRecord(ADS_B, time_s, {
            "number": number, "name": flight.name.upper(), "simulated": 1, "sac": 0, "sic": 0,
            "lat_deg": flight.lat_deg[0], "lon_deg": flight.lon_deg[0], "alt_m": flight.alt_m[0],
        })
        for number, flight in enumerate(flights)
        for time_s in flight.sample_times_s.tolist()
    ]  # fmt: skip
    (folder / "f.ast").write_bytes(write_records(records))
    return {"type": "traffic.asterix", "file": str(folder / "f.ast"), "intruder": craft}


def asterix_one(craft: dict, folder) -> dict:
    return {**asterix_any({}, folder), "aircraft": {"ONE": craft}}


def in_set(craft: dict, folder) -> dict:
    """The two at rest as tracks of a set: north, east and altitude."""
    lat, lon, alt = crooked.geodetic(
        crooked.position({**OTHER, "heading_deg": 0.0, "speed_mps": 0.0, "climb_mps": 0.0},
                         ownship=OWN)
    )  # fmt: skip
    other = pymap3d.geodetic2enu(lat, lon, 0.0, OWN["lat_deg"], OWN["lon_deg"], 0.0)
    columns = {
        "encounter": [0, 0], "weight": [1.0, 1.0], "aircraft": ["own", "one"],
        "time_s": [[0.0, 1.0, 2.0]] * 2, "north_m": [[0.0] * 3, [other[1]] * 3],
        "east_m": [[0.0] * 3, [other[0]] * 3], "altitude_m": [[OWN["alt_m"]] * 3, [alt] * 3],
    }  # fmt: skip
    path = folder / "set.parquet"
    pq.write_table(pa.table(columns), path)
    place = {"lat_deg": OWN["lat_deg"], "lon_deg": OWN["lon_deg"]}
    return {"type": "traffic.encounters", "file": str(path), "intruder": craft, **place}


def in_set_one(craft: dict, folder) -> dict:
    return {**in_set({}, folder), "aircraft": {"one": craft}}


def modelled(craft: dict, folder) -> dict:
    return {**in_set(craft, folder), "type": "traffic.encounter_model"}


def modelled_one(craft: dict, folder) -> dict:
    return {**modelled({}, folder), "aircraft": {"one": craft}}


@pytest.fixture(autouse=True)
def a_model_that_gives_the_two(monkeypatch):
    """What a model makes cannot be put at one place: here it gives what stands in its file."""
    monkeypatch.setattr(
        "components.encounters.encounter_traffic._made", lambda key, _: read_set(key[0])
    )


CARRIERS = {
    "traffic.scripted.intruders": scripted,
    "traffic.random.aircraft": random,
    "traffic.csv.intruder": csv_any,
    "traffic.csv.aircraft": csv_one,
    "traffic.asterix.intruder": asterix_any,
    "traffic.asterix.aircraft": asterix_one,
    "traffic.daa_file.intruder": daa_any,
    "traffic.daa_file.aircraft": daa_one,
    "traffic.encounters.intruder": in_set,
    "traffic.encounters.aircraft": in_set_one,
    "traffic.encounter_model.intruder": modelled,
    "traffic.encounter_model.aircraft": modelled_one,
}
SENSORS = {
    "radar": sensor("radar.swerling"),
    "eye": sensor("optical.eo"),
    "lit": sensor("optical.eo", background="ground", sky="overcast"),
    "warm": sensor("optical.ir"),
    "hot": sensor("optical.ir", plume=True),
}
# Each target its own model; false alarms rare enough for all to be seen.
del SENSORS["radar"]["swerling"]


def look(carrier: str, folder, craft: dict, **sensors) -> dict[str, Row]:
    """First detection of each sensor."""
    scene = chain({**SENSORS, **sensors})
    scene["blocks"]["traffic"] = CARRIERS[carrier](craft, folder)
    return {row["block"]: row for row in decided(run(scene), scan=0)}


def area_m2(row: Row) -> float:
    return row["pixels"] * (row["true_range_m"] * math.radians(0.01)) ** 2


def signature(row: Row) -> float:
    return row["confidence"] - 1.0


def changed(carrier: str, folder, craft: dict) -> tuple[dict[str, Row], dict[str, Row]]:
    return look(carrier, folder, BASE), look(carrier, folder, {**BASE, **craft})


def only(before: dict[str, Row], after: dict[str, Row], *blocks: str) -> None:
    """Check that no other sensor sees a difference."""
    same = before.keys() - set(blocks)
    assert {block: after[block] for block in same} == {block: before[block] for block in same}


@covers("rcs_dbsm", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_rcs(carrier, tmp_path):
    before, after = changed(carrier, tmp_path, {"rcs_dbsm": 9.5})
    assert after["radar"]["snr_db"] - before["radar"]["snr_db"] == pytest.approx(7.5)
    only(before, after, "radar")


LASER_KEYS = (
    "reflectivity", "area_m2", "wire_diameter_mm", "wire_length_m", "wire_direction_deg",
    "wire_slope_deg",
)  # fmt: skip


@covers(*(f"laser.{key}" for key in LASER_KEYS), of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_what_lasers_hit(carrier, tmp_path):
    """Echoes by hand, of a beam of 1 mrad that lights a disc at the target's range."""

    def hit(laser, table="detections", **keys):
        scene = chain({"laser": sensor("laser.scanning", **keys)}, record={"truth": True})
        scene["blocks"]["traffic"] = CARRIERS[carrier]({**BASE, "laser": laser}, tmp_path)
        done = run(scene)
        own, other = done["truth"].slice(0, 2).to_pylist()
        places = [other[key] for key in PLACE] + [own[key] for key in PLACE]
        return rows(done, table)[0], np.array(pymap3d.geodetic2ned(*places))

    row, line = hit({"reflectivity": 0.5, "area_m2": 0.3})
    range_m = float(np.linalg.norm(line))
    # Of a target that takes all and scatters all; recorded is the amplitude with its noise.
    whole = 1e9 * 0.5 / 1e-9 * (0.025 / range_m) ** 2
    expected = 0.5 * 0.3 / (math.pi * (1e-3 * range_m) ** 2 / 4.0)
    assert 10.0 ** (row["snr_db"] / 20.0) == pytest.approx(whole * expected, rel=1e-5, abs=6.0)
    wire = {"reflectivity": 0.4, "wire_diameter_mm": 8.0, "wire_length_m": 0.05}
    # So few shots that a scan meets the wire now and then; all that meet it detect it.
    sparse = {"azimuth_shots": 4000, "elevation_shots": 4000, "scan_rate_hz": "1/10000"}
    shot_sr = 2.0 * math.pi**2 / 4000**2 * math.cos(row["true_elevation_rad"])
    for direction_deg, slope_deg in ((20.0, 0.0), (120.0, 35.0)):
        turn, rise = math.radians(direction_deg), math.radians(slope_deg)
        along = [math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn), -math.sin(rise)]
        sine = math.sqrt(1.0 - (np.dot(along, line) / range_m) ** 2)
        placed = {**wire, "wire_direction_deg": direction_deg, "wire_slope_deg": slope_deg}
        thin, _ = hit(placed)
        expected = 0.4 * sine * 4.0 * 0.008 / (math.pi * 1e-3 * range_m)
        assert 10.0 ** (thin["snr_db"] / 20.0) == pytest.approx(whole * expected, rel=1e-5, abs=6.0)
        seen, _ = hit(placed, "looks", pattern="scanned", **sparse)
        expected = sine * 0.05 / range_m * 1e-3 * math.pi / 4.0 / shot_sr
        assert seen["detection_probability"] == pytest.approx(expected, rel=1e-5)


@covers("rcs_table", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_rcs_table(carrier, tmp_path):
    path = tmp_path / "rcs.csv"
    path.write_text("az_deg,el_deg,dbsm\n0,0,13\n180,0,13\n", encoding="utf-8")
    before, after = changed(carrier, tmp_path, {"rcs_table": str(path)})
    assert after["radar"]["snr_db"] - before["radar"]["snr_db"] == pytest.approx(11.0)
    only(before, after, "radar")


@covers("swerling", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_swerling(carrier, tmp_path):
    """Of a strong echo the miss is V/S for model I and (V/S)² and more for III; none if steady."""
    found = {}
    radar = {**SENSORS["radar"], "power_w": 1e6}
    for model in (0, 1, 3):
        row = look(carrier, tmp_path, {**BASE, "swerling": model}, radar=radar)["radar"]
        snr = 10.0 ** (row["snr_db"] / 10.0)
        threshold = -math.log(1e-6)
        half = 1.0 + 0.5 * snr
        expected = {
            0: 1.0,
            1: math.exp(-threshold / (1.0 + snr)),
            3: math.exp(-threshold / half) * (1.0 + threshold * 0.5 * snr / half**2),
        }[model]
        assert row["detection_probability"] == pytest.approx(expected, rel=1e-9)
        found[model] = expected
    assert found[1] < found[3] < found[0]


@covers("contrast", "contrast_ir", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_contrasts(carrier, tmp_path):
    before, after = changed(carrier, tmp_path, {"contrast": 0.9})
    for block in ("eye", "lit"):
        assert signature(after[block]) / signature(before[block]) == pytest.approx(1.5)
    only(before, after, "eye", "lit")
    before, after = changed(carrier, tmp_path, {"contrast_ir": 0.75})
    for block in ("warm", "hot"):
        assert signature(after[block]) / signature(before[block]) == pytest.approx(3.0)
    only(before, after, "warm", "hot")


@covers("paint_reflectance", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_paint(carrier, tmp_path):
    """Black paint against grass of 0.2 is all contrast, paint like the grass nearly none."""
    found = {}
    for paint in (0.0, 0.2, 0.4):
        seen = look(carrier, tmp_path, {**BASE, "paint_reflectance": paint})
        found[paint] = signature(seen["lit"]) / signature(seen["eye"])
    assert found[0.0] == pytest.approx(1.0)
    assert len(set(found.values())) == 3
    before, after = changed(carrier, tmp_path, {"paint_reflectance": 0.1})
    only(before, after, "lit")


@covers("engine", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_engines(carrier, tmp_path):
    """Plumes are as 0 to 1 to 4 for propeller, turbofan and turbojet."""
    plume = {}
    for engine in ("propeller", "turbofan", "turbojet"):
        seen = look(carrier, tmp_path, {**BASE, "engine": engine})
        plume[engine] = area_m2(seen["hot"]) - area_m2(seen["warm"])
    assert plume["propeller"] == pytest.approx(0.0, abs=1e-6)
    assert plume["turbojet"] == pytest.approx(4.0 * plume["turbofan"])
    assert 0.0 < plume["turbojet"] <= 9.0
    before, after = changed(carrier, tmp_path, {"engine": "turbojet"})
    only(before, after, "hot")


@covers(*(f"{band}.{key}_m2" for band in ("eo", "ir") for key in ("front", "side", "horizontal")),
        "ir.back_m2", of=tuple(CARRIERS))  # fmt: skip
@pytest.mark.parametrize("carrier", list(CARRIERS))
@pytest.mark.parametrize("band", ["eo", "ir"])
def test_areas_of_the_bodies(carrier, band, tmp_path):
    """Each body by itself; the sum of the shares of front and back is one."""
    blocks = ("eye", "lit") if band == "eo" else ("warm", "hot")
    shown = {}
    none = dict.fromkeys(WARM if band == "ir" else AREAS, 0.0)
    before = look(carrier, tmp_path, BASE)
    for key in none:
        after = look(carrier, tmp_path, {**BASE, band: {**none, key: 40.0}})
        shown[key] = area_m2(after[blocks[0]]) / 40.0
        assert 0.0 <= shown[key] <= 1.0 + 1e-9
        only(before, after, *blocks)
    around = shown["front_m2"] + shown.get("back_m2", 0.0)
    assert around == pytest.approx(1.0, rel=1e-9)
    # A level plate and a level cylinder: sine of the elevation, and off the long axis.
    seen = before["eye"]
    if carrier == "traffic.scripted.intruders":
        up = abs(math.sin(seen["true_elevation_rad"]))
        assert shown["horizontal_m2"] == pytest.approx(up, rel=1e-6)
        aspect = crooked.ned({**OTHER, "heading_deg": 0.0, "speed_mps": 0.0, "climb_mps": 0.0},
                             ownship={**OWN, "speed_mps": 0.0, "climb_mps": 0.0})  # fmt: skip
        nose = aspect[0] / np.linalg.norm(aspect)
        assert shown["side_m2"] == pytest.approx(math.sqrt(1.0 - nose**2), rel=1e-6)


@covers("eo.made_for", "ir.made_for", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_areas_that_were_fitted_for_another_silhouette_are_spoken_of(carrier, tmp_path):
    craft = {**BASE, "eo": {**AREAS, "made_for": "convex_hull"}}
    both = {**craft, "ir": {**WARM, "made_for": "convex_hull"}}
    for target, silhouette, told in (
        (craft, "exact", {"eye"}), (both, "thesis", {"eye", "warm"}), (both, "convex_hull", set()),
        (BASE, "exact", set()),
    ):  # fmt: skip
        scene = chain({"eye": sensor("optical.eo", silhouette=silhouette),
                       "warm": sensor("optical.ir", silhouette=silhouette)})  # fmt: skip
        scene["blocks"]["traffic"] = CARRIERS[carrier](target, tmp_path)
        said = [line for line in notes_of_scene(Simulation(dsa_des.load_scene(scene)))
                if "were fitted for silhouette 'convex_hull'" in line]  # fmt: skip
        assert {line.split(":")[0].removeprefix("blocks.") for line in said} == told


@covers("eo.silhouette_table", "ir.silhouette_table", of=tuple(CARRIERS))
@pytest.mark.parametrize("carrier", list(CARRIERS))
def test_silhouette_tables(carrier, tmp_path):
    found = {}
    for name, value in (("eo", 11.0), ("ir", 22.0)):
        nodes = [(azimuth, elevation) for azimuth in (0, 90, 180, 270) for elevation in (-90, 90)]
        lines = ["az_deg,el_deg,area_m2", *(f"{az},{el},{value}" for az, el in nodes)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        found[name] = str(tmp_path / f"{name}.csv")
    craft = {
        **BASE,
        "eo": {**AREAS, "silhouette_table": found["eo"]},
        "ir": {**WARM, "silhouette_table": found["ir"]},
    }
    by_table = {
        "eye": sensor("optical.eo", silhouette="aspect_table"),
        "warm": sensor("optical.ir", silhouette="aspect_table"),
    }
    seen = look(carrier, tmp_path, craft, **by_table)
    assert area_m2(seen["eye"]) == pytest.approx(11.0)
    assert area_m2(seen["warm"]) == pytest.approx(22.0)


@covers("rcs_dbsm", of=("traffic.csv.aircraft", "traffic.daa_file.aircraft"))
@pytest.mark.parametrize("carrier", ["traffic.csv.aircraft", "traffic.daa_file.aircraft"])
def test_a_named_aircraft_goes_before_what_all_are(carrier, tmp_path):
    table = CARRIERS[carrier]({**BASE, "rcs_dbsm": 8.0}, tmp_path)
    scene = chain(SENSORS)
    snr = {}
    for rcs_dbsm in (0.0, 5.0):
        scene["blocks"]["traffic"] = {**table, "intruder": {**BASE, "rcs_dbsm": rcs_dbsm}}
        snr[rcs_dbsm] = decided(run(scene), block="radar")[0]["snr_db"]
    del scene["blocks"]["traffic"]["aircraft"]
    alike = decided(run(scene), block="radar")[0]["snr_db"]
    assert snr[0.0] == snr[5.0] == pytest.approx(alike + 3.0)
