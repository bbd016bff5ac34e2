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
from recorded_files import read_csv
from wired import Row, chain, decided, rows, run, sensor

import dsa_des
from components.encounters.encounter_traffic import MadeTogether
from components.formats.asterix_records import ADS_B, AsterixRecord, encode_records
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
    (folder / "f.ast").write_bytes(encode_records(records))
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
        "components.encounters.encounter_traffic._PAIRS",
        MadeTogether(lambda keys: [(read_set(model.file), number) for model, number in keys]),
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
#: Where every key is tried by itself; the others have to say the same as the first of them.
FULLY = ("traffic.scripted.intruders", "traffic.random.aircraft")
FILES = tuple(name for name in CARRIERS if name not in FULLY)
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


@covers("rcs_dbsm", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_rcs(carrier, tmp_path):
    before, after = changed(carrier, tmp_path, {"rcs_dbsm": 9.5})
    assert after["radar"]["snr_db"] - before["radar"]["snr_db"] == pytest.approx(7.5)
    only(before, after, "radar")


def tables(folder) -> dict[str, str]:
    """Files of an echo of 13 dBsm all around and of areas of 11 and 22 m²."""
    nodes = [(azimuth, elevation) for azimuth in (0, 90, 180, 270) for elevation in (-90, 90)]
    files = {"rcs": "az_deg,el_deg,dbsm\n0,0,13\n180,0,13\n"} | {
        band: "az_deg,el_deg,area_m2\n" + "".join(f"{az},{el},{area}\n" for az, el in nodes)
        for band, area in (("eo", 11.0), ("ir", 22.0))
    }
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    return {name: str(folder / f"{name}.csv") for name in files}


BY_TABLE = {
    "eye": sensor("optical.eo", silhouette="aspect_table"),
    "warm": sensor("optical.ir", silhouette="aspect_table"),
}
# So few shots that a scan meets the wire now and then; all that meet it detect it.
SPARSE = {"pattern": "scanned", "azimuth_shots": 4000, "elevation_shots": 4000,
          "scan_rate_hz": "1/10000"}  # fmt: skip


def hit(carrier: str, folder, laser: dict, table: str = "detections", **keys):
    """The first row of a laser, and the line to its target in NED."""
    scene = chain({"laser": sensor("laser.scanning", **keys)}, record={"truth": True})
    scene["blocks"]["traffic"] = CARRIERS[carrier]({**BASE, "laser": laser}, folder)
    done = run(scene)
    own, other = done["truth"].slice(0, 2).to_pylist()
    places = [other[key] for key in PLACE] + [own[key] for key in PLACE]
    return rows(done, table)[0], np.array(pymap3d.geodetic2ned(*places))


LASER_KEYS = (
    "reflectivity", "area_m2", "wire_diameter_mm", "wire_length_m", "wire_direction_deg",
    "wire_slope_deg",
)  # fmt: skip


@covers(*(f"laser.{key}" for key in LASER_KEYS), of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_what_lasers_hit(carrier, tmp_path):
    """Echoes by hand, of a beam of 1 mrad that lights a disc at the target's range."""

    row, line = hit(carrier, tmp_path, {"reflectivity": 0.5, "area_m2": 0.3})
    range_m = float(np.linalg.norm(line))
    # Of a target that takes all and scatters all; recorded is the amplitude with its noise.
    whole = 1e9 * 0.5 / 1e-9 * (0.025 / range_m) ** 2
    expected = 0.5 * 0.3 / (math.pi * (1e-3 * range_m) ** 2 / 4.0)
    assert 10.0 ** (row["snr_db"] / 20.0) == pytest.approx(whole * expected, rel=1e-5, abs=6.0)
    wire = {"reflectivity": 0.4, "wire_diameter_mm": 8.0, "wire_length_m": 0.05}
    shot_sr = 2.0 * math.pi**2 / 4000**2 * math.cos(row["true_elevation_rad"])
    for direction_deg, slope_deg in ((20.0, 0.0), (120.0, 35.0)):
        turn, rise = math.radians(direction_deg), math.radians(slope_deg)
        along = [math.cos(rise) * math.cos(turn), math.cos(rise) * math.sin(turn), -math.sin(rise)]
        sine = math.sqrt(1.0 - (np.dot(along, line) / range_m) ** 2)
        placed = {**wire, "wire_direction_deg": direction_deg, "wire_slope_deg": slope_deg}
        thin, _ = hit(carrier, tmp_path, placed)
        expected = 0.4 * sine * 4.0 * 0.008 / (math.pi * 1e-3 * range_m)
        assert 10.0 ** (thin["snr_db"] / 20.0) == pytest.approx(whole * expected, rel=1e-5, abs=6.0)
        seen, _ = hit(carrier, tmp_path, placed, "looks", **SPARSE)
        expected = sine * 0.05 / range_m * 1e-3 * math.pi / 4.0 / shot_sr
        assert seen["detection_probability"] == pytest.approx(expected, rel=1e-5)


@covers("rcs_table", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_rcs_table(carrier, tmp_path):
    before, after = changed(carrier, tmp_path, {"rcs_table": tables(tmp_path)["rcs"]})
    assert after["radar"]["snr_db"] - before["radar"]["snr_db"] == pytest.approx(11.0)
    only(before, after, "radar")


@covers("swerling", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
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


@covers("contrast", "contrast_ir", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_contrasts(carrier, tmp_path):
    before, after = changed(carrier, tmp_path, {"contrast": 0.9})
    for block in ("eye", "lit"):
        assert signature(after[block]) / signature(before[block]) == pytest.approx(1.5)
    only(before, after, "eye", "lit")
    before, after = changed(carrier, tmp_path, {"contrast_ir": 0.75})
    for block in ("warm", "hot"):
        assert signature(after[block]) / signature(before[block]) == pytest.approx(3.0)
    only(before, after, "warm", "hot")


@covers("paint_reflectance", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
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


@covers("engine", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
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
        "ir.back_m2", of=FULLY)  # fmt: skip
@pytest.mark.parametrize("carrier", FULLY)
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


@covers("eo.silhouette_table", "ir.silhouette_table", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_silhouette_tables(carrier, tmp_path):
    found = tables(tmp_path)
    craft = {
        **BASE,
        "eo": {**AREAS, "silhouette_table": found["eo"]},
        "ir": {**WARM, "silhouette_table": found["ir"]},
    }
    seen = look(carrier, tmp_path, craft, **BY_TABLE)
    assert area_m2(seen["eye"]) == pytest.approx(11.0)
    assert area_m2(seen["warm"]) == pytest.approx(22.0)


def heard(carrier: str, folder, craft: dict, shares: dict | None = None, **ether) -> dict[str, Row]:
    """The last report of a receiver of ADS-B and of active surveillance, if there is any."""
    exact = {"scan_rate_hz": 1, "position_errors": "none", "compact": False, "reception": "certain"}
    scene = chain({
        "ether": {"type": "surveillance.ads_b", **exact, **ether},
        "asker": {"type": "surveillance.active", "scan_rate_hz": 1, "replies": "certain",
                  "far_every": 1, "elevation_deg": [-90, 90]},
    }, duration_s=2)  # fmt: skip
    scene["blocks"]["traffic"] = CARRIERS[carrier]({**BASE, **craft}, folder)
    if shares is not None:
        scene["blocks"]["traffic"]["equipage_shares"] = shares
    return {row["block"]: row for row in rows(run(scene))}


@covers("mode_s", "mode_c", "icao_address", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_transponders(carrier, tmp_path):
    assert heard(carrier, tmp_path, {}) == {}
    for craft, address in (
        ({"mode_s": True, "icao_address": "4840D6"}, 0x4840D6),
        ({"mode_c": True, "icao_address": "4840D6"}, -1),
    ):
        seen = heard(carrier, tmp_path, craft)
        assert seen.keys() == {"asker"} and seen["asker"]["address"] == address


@covers("ads_b.nic", "ads_b.gva", "ads_b.silent_after_s", of=FULLY)
@covers("ads_b.spoofed_north_m", "ads_b.spoofed_east_m", "ads_b.spoofed_up_m", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_broadcasts(carrier, tmp_path):
    places = ("reported_lat_deg", "reported_lon_deg", "reported_alt_m")

    def said(**ads_b):
        return heard(carrier, tmp_path, {"ads_b": ads_b}).get("ether")

    plain, other = said(), said(nic=5)
    assert (plain["nic"], other["nic"]) == (8, 5)
    assert plain["reported_height_m"] is None
    height_m = said(gva=2)["reported_height_m"]
    assert height_m == pytest.approx(plain["reported_alt_m"], abs=45.0)
    assert said(silent_after_s=0.0) is None
    spoofed = said(spoofed_north_m=700.0, spoofed_east_m=-300.0, spoofed_up_m=120.0)
    moved = pymap3d.geodetic2ned(*(row[key] for row in (spoofed, plain) for key in places))
    assert moved == pytest.approx((700.0, -300.0, -120.0), abs=0.5)


@covers("ads_b.nacp", "ads_b.nacv", "ads_b.latency_s", "ads_b.compensated_s", of=FULLY)
@pytest.mark.parametrize("carrier", FULLY)
def test_quality_of_broadcasts(carrier, tmp_path):
    """Errors are of one draw, in proportion to the radii of the categories."""

    def said(**ads_b):
        craft = {"ads_b": {"nacp": 11, "nacv": 4, **ads_b}}
        return heard(carrier, tmp_path, craft, position_errors="gauss_markov")["ether"]

    finest = said()
    north_m = {
        nacp: 111_111.0 * (said(nacp=nacp)["reported_lat_deg"] - finest["reported_lat_deg"])
        for nacp in (8, 9)
    }
    assert north_m[8] / north_m[9] == pytest.approx((92.6 - 3.0) / (30.0 - 3.0), rel=1e-3)
    # All are at rest: what they say of their velocity is its error.
    coarse = said(nacv=1)
    share = coarse["reported_north_m_s"] / finest["reported_north_m_s"]
    assert share == pytest.approx(10.0 / 0.3, rel=1e-2)
    late, ahead = (said(nacv=1, latency_s=0.3, compensated_s=s) for s in (0.0, 0.3))
    assert late["reported_lat_deg"] != coarse["reported_lat_deg"]
    moved_m = 111_111.0 * (ahead["reported_lat_deg"] - late["reported_lat_deg"])
    assert moved_m == pytest.approx(0.3 * coarse["reported_north_m_s"], rel=0.3)


AREA_KEYS = tuple(f"{band}.{key}" for band, areas in (("eo", AREAS), ("ir", WARM)) for key in areas)
BROADCAST_KEYS = (
    "nic", "nacp", "nacv", "gva", "latency_s", "compensated_s", "silent_after_s",
    "spoofed_north_m", "spoofed_east_m", "spoofed_up_m",
)  # fmt: skip


def told(carrier: str, folder) -> dict[str, float]:
    """What all sensors make of an aircraft whose every key is another one than in `BASE`."""
    dim = {**SENSORS["radar"], "power_w": 10.0}
    other = {
        "rcs_dbsm": 9.5, "swerling": 1, "contrast": 0.9, "contrast_ir": 0.75,
        "paint_reflectance": 0.1, "engine": "turbojet",
        "eo": {"front_m2": 9.0, "side_m2": 13.0, "horizontal_m2": 31.0},
        "ir": {"front_m2": 5.0, "back_m2": 17.0, "side_m2": 12.0, "horizontal_m2": 43.0},
    }  # fmt: skip
    files = tables(folder)
    mapped = {**BASE, "rcs_table": files["rcs"],
              "eo": {**AREAS, "silhouette_table": files["eo"]},
              "ir": {**WARM, "silhouette_table": files["ir"]}}  # fmt: skip
    seen = {
        **look(carrier, folder, other, radar=dim),
        **{
            f"{name} by table": row
            for name, row in look(carrier, folder, mapped, **BY_TABLE).items()
        },
    }
    found = {
        f"{name}: {column}": row[column]
        for name, row in seen.items()
        for column in ("snr_db", "detection_probability", "pixels", "confidence")
        if row[column] is not None
    }
    wire = {"reflectivity": 0.4, "wire_diameter_mm": 8.0, "wire_length_m": 0.05,
            "wire_direction_deg": 120.0, "wire_slope_deg": 35.0}  # fmt: skip
    found["spot"] = hit(carrier, folder, {"reflectivity": 0.5, "area_m2": 0.3})[0]["snr_db"]
    found["wire"] = hit(carrier, folder, wire)[0]["snr_db"]
    found["swept"] = hit(carrier, folder, wire, "looks", **SPARSE)[0]["detection_probability"]
    return found


def transmitted(carrier: str, folder, **name: str) -> dict[str, float]:
    """What its broadcasts and replies come to; places from where it says that it is else."""
    ads_b = {"nic": 5, "nacp": 9, "nacv": 1, "gva": 2, "latency_s": 0.3, "compensated_s": 0.1,
             "spoofed_north_m": 700.0, "spoofed_east_m": -300.0, "spoofed_up_m": 120.0}  # fmt: skip
    places = ("reported_lat_deg", "reported_lon_deg", "reported_alt_m")
    plain, said = (
        heard(carrier, folder, {**name, "ads_b": keys}, position_errors="gauss_markov")["ether"]
        for keys in ({"nacp": 11, "nacv": 4}, ads_b)
    )
    assert heard(carrier, folder, {"ads_b": {"silent_after_s": 0.0}}) == {}
    found = {
        key: said[key]
        for key in ("nic", "reported_north_m_s", "reported_east_m_s", "reported_height_m")
    }
    moved = pymap3d.geodetic2ned(*(row[key] for row in (said, plain) for key in places))
    for craft in ({"mode_s": True, "icao_address": "4840D6"}, {"mode_c": True}):
        found["address " + " ".join(craft)] = heard(carrier, folder, craft)["asker"]["address"]
    return found | dict(zip(("north", "east", "down"), map(float, moved), strict=True))


@pytest.fixture(scope="module")
def scripted_one(tmp_path_factory):
    """What sensors and receivers have of the scripted one, by the name that it is given."""
    folder = tmp_path_factory.mktemp("scripted")
    return told(FULLY[0], folder), {
        name: transmitted(FULLY[0], folder, **({"name": name} if name else {}))
        for name in ("", "ONE")
    }


@covers("rcs_dbsm", "rcs_table", "swerling", "contrast", "contrast_ir", "paint_reflectance",
        "engine", "eo.silhouette_table", "ir.silhouette_table", *AREA_KEYS,
        *(f"laser.{key}" for key in LASER_KEYS), of=FILES)  # fmt: skip
@covers("mode_s", "mode_c", "icao_address", *(f"ads_b.{key}" for key in BROADCAST_KEYS), of=FILES)
@pytest.mark.parametrize("carrier", FILES)
def test_a_file_s_aircraft_is_the_scripted_one(carrier, tmp_path, scripted_one):
    """Places in ASTERIX are rounded to some metres, and errors are drawn by the name."""
    seen, sent = scripted_one
    assert told(carrier, tmp_path) == pytest.approx(seen, rel=5e-3)
    expected = sent["ONE" if "asterix" in carrier else ""]
    assert transmitted(carrier, tmp_path) == pytest.approx(expected, rel=1e-3, abs=0.1)


SHARED = [name for name in CARRIERS if name.endswith(("intruder", "random.aircraft"))]


@covers(*(f"equipage_shares.{key}" for key in ("mode_s", "mode_c", "ads_b")),
        of=tuple(name.rpartition(".")[0] for name in SHARED))  # fmt: skip
@pytest.mark.parametrize("carrier", SHARED)
def test_shares_of_equipage(carrier, tmp_path):
    full = {"mode_s": True, "mode_c": True, "ads_b": {}}
    for shares, blocks in (
        ({}, {"asker", "ether"}), ({"ads_b": 0.0}, {"asker"}),
        ({"mode_s": 0.0, "mode_c": 0.0}, {"ether"}),
    ):  # fmt: skip
        assert heard(carrier, tmp_path, full, shares).keys() == blocks
    assert heard(carrier, tmp_path, full, {"mode_c": 0.0})["asker"]["address"] >= 0
    assert heard(carrier, tmp_path, full, {"mode_s": 0.0})["asker"]["address"] == -1


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
