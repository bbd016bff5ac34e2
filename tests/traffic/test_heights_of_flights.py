"""What altitudes of flights are: heights, heights above the sea, or levels of an altimeter."""

import numpy as np
import pytest
from covering import covers
from same_runs import tables_of

import dsa_des

AIR = {"qnh_hpa": 993.25, "temperature_offset_c": 20}
GEOID_M = 47.0


def altimeter_m(height_m):
    """Return by hand what an altimeter reads in that air below 11 km, above that geoid."""
    share = (993.25 / 1013.25) ** 0.190263
    above_sea_m = height_m - GEOID_M
    return 288.15 / 0.0065 * (1 - share) + share * 288.15 / 308.15 * above_sea_m


def flown(traffic, duration_s=20, **more):
    """Return the heights of every aircraft by its name at the scans of a radar that sees nobody."""
    scene = {
        "title": "heights", "duration_s": duration_s, "weather": AIR,
        "terrain": {"geoid_undulation_m": GEOID_M}, "record": {"truth": True},
        "wires": ["traffic -> transform -> gate -> radar"],
        "blocks": {
            "traffic": traffic, "transform": {"type": "geometry.ellipsoid"},
            "gate": {"type": "gate"},
            "radar": {"type": "radar.range_boundary", "scan_rate_hz": 0.25, "range_km": 1,
                      "azimuth_resolution_deg": 1, "elevation_resolution_deg": 1,
                      "range_resolution_m": 10},
        },
        **more,
    }  # fmt: skip
    simulation, tables = tables_of(dsa_des.load_scene(scene))
    heights = {}
    for row in tables["truth"].to_pylist():
        heights.setdefault(row["target"] or "own", []).append(row["alt_m"])
    return simulation, {name: np.array(values) for name, values in heights.items()}


def at(lat_deg, **of):
    return {"lat_deg": lat_deg, "lon_deg": 175.0, "speed_mps": 60, **of}


LEGS = [{"kind": "climb", "climb_mps": 10, "to_alt_m": 1100}, {"kind": "straight"}]
POINTS = [{"kind": "waypoints", "points": [{"lat_deg": -41.2, "lon_deg": 175.0, "alt_m": 1500}]}]
LEVEL = {"heights": "pressure"}


@covers("ownship.heights", "intruders.heights", of=("traffic.scripted",))
def test_levels_of_pilots_are_flown_where_the_air_has_these_pressures():
    crafts = [
        at(-41.3, name="level", alt_m=1000, **LEVEL),
        at(-41.31, name="climbs", alt_m=1000, legs=LEGS, **LEVEL),
        at(-41.2018, name="points", alt_m=1000, legs=POINTS, **LEVEL),
        at(-41.3, name="sea", alt_m=1000, heights="sea_level"),
        {"name": "above", "north_m": 100, "east_m": 0, "up_m": 250, "speed_mps": 60, **LEVEL},
    ]
    own = at(-41.4, alt_m=1000)
    _, heights = flown({"type": "traffic.scripted", "ownship": own, "intruders": crafts})
    assert heights["own"] == pytest.approx(1000, abs=1e-9)
    assert heights["sea"] == pytest.approx(1000 + GEOID_M, abs=1e-9)
    assert heights["above"] == pytest.approx(1250, abs=0.01)
    assert altimeter_m(heights["level"]) == pytest.approx(1000, abs=0.01)
    read = altimeter_m(heights["climbs"])
    assert read[0] == pytest.approx(1000, abs=0.01)
    # 10 m/s of height are 9.3 of the warm air's altimeter.
    assert read[1] == pytest.approx(1000 + 40 * (altimeter_m(1) - altimeter_m(0)), abs=0.01)
    assert read[3:] == pytest.approx(1100, abs=0.01)
    assert altimeter_m(heights["points"])[[0, -1]] == pytest.approx([1000, 1500], abs=0.01)


@covers("ownship.heights", of=("traffic.random",))
def test_random_traffic_is_spread_about_the_ownships_level():
    own = at(-41.3, alt_m=1000, **LEVEL)
    spread = {"intruders": 3, "radius_km": 5, "altitude_spread_m": 0}
    _, heights = flown({"type": "traffic.random", "ownship": own, **spread}, 4)
    for name in heights:
        assert altimeter_m(heights[name]) == pytest.approx(1000, abs=0.01)


@covers("heights", "scripted_ownship.heights", of=("traffic.encounters", "traffic.encounter_model"))
def test_encounters_pass_each_other_by_altitudes_of_the_scene_s_air(tmp_path):
    (tmp_path / "set.toml").write_text(
        "closest_s = 20\nhorizontal_ft = 0\nvertical_ft = 500\nbearing_deg = 70\n"
        "own_speed_kt = 120\nown_heading_deg = 217\nown_altitude_ft = 3000\n"
        "intruder_speed_kt = 140\nat = [-41.3, 179.9997]\n"
    )
    block = {"type": "traffic.encounters", "file": str(tmp_path / "set.toml")}
    _, plain = flown(block)
    _, heights = flown({**block, **LEVEL})
    own = {"lat_deg": -41.3, "lon_deg": 179.99, "alt_m": 1000}
    _, scripted = flown({**block, "scripted_ownship": {**own, **LEVEL}}, 4)
    assert altimeter_m(scripted["own"]) == pytest.approx(1000, abs=0.01)
    for name in plain:
        assert altimeter_m(heights[name]) == pytest.approx(plain[name], abs=0.01)
    # 500 ft of altimeters are 7 % and some QNH more in warm air.
    apart = [np.ptp([one[name][-1] for name in one]) for one in (plain, heights)]
    assert apart[0] == pytest.approx(152.4, abs=0.1) and apart[1] == pytest.approx(163.6, abs=0.2)


@covers("heights", of=("traffic.file",))
def test_heights_that_a_file_has_above_the_sea_are_put_above_the_ellipsoid(tmp_path):
    rows = "".join(
        f"<trkpt lat='{-41.3 + 0.0006 * k}' lon='175'><ele>900</ele>"
        f"<time>2024-06-01T12:00:{k:02d}Z</time></trkpt>" for k in range(21)
    )  # fmt: skip
    track = (
        f"<gpx xmlns='http://www.topografix.com/GPX/1/1'><trk><trkseg>{rows}</trkseg></trk></gpx>"
    )
    (tmp_path / "drone.gpx").write_text(track)
    for header in ("geoaltitude", "alt_msl", "alt"):
        lines = [f"{1717243200 + k},a,-41.2,175.01,{1000 + k}" for k in range(21)]
        (tmp_path / f"{header}.csv").write_text(f"time,id,lat,lon,{header}\n" + "\n".join(lines))

    def of(name, **keys):
        files = {"file": str(tmp_path / name)}
        files |= {} if "own_flight" in keys else {"own_file": str(tmp_path / "drone.gpx")}
        simulation, heights = flown({"type": "traffic.file", **files, **keys})
        said = simulation.components["traffic"]
        return heights, " ".join([*said.content.notes, *said.warnings()])

    for name, from_m in (("geoaltitude.csv", 1000), ("alt_msl.csv", 1000 + GEOID_M)):
        heights, said = of(name)
        assert heights["own"] == pytest.approx(900 + GEOID_M, abs=1e-9)
        assert heights["a"][0] == pytest.approx(from_m, abs=1e-9)
        assert "above sea level, flown +47 m above the ellipsoid" in said
    own = at(-41.3, alt_m=900, heights="sea_level")
    assert of("alt.csv", own_flight=own)[0]["own"] == pytest.approx(900 + GEOID_M, abs=1e-9)
    heights, said = of("alt.csv", heights="sea_level")
    assert heights["a"][0] == pytest.approx(1000 + GEOID_M, abs=1e-9)
    assert heights["own"] == pytest.approx(900 + GEOID_M, abs=1e-9)


def test_a_profile_that_says_nothing_is_refused():
    for weather, message in (
        ({"temperature_profile_c": [[100, 1], [50, 2]]}, "heights must rise"),
        ({"temperature_profile_c": [[0, 1]], "temperature_offset_c": 2}, "give one"),
    ):
        with pytest.raises(dsa_des.SceneError, match=message):
            flown({"type": "traffic.scripted", "ownship": at(0, alt_m=0)}, weather=weather)
