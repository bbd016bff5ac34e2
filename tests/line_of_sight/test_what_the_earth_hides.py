"""Horizon, refraction and terrain in scenes, against pymap3d, matrices and textbook ranges."""

import math

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from same_runs import same_as_alone
from wired import chain, first_look, rows, run, sensor

import dsa_des
from dsa_des.errors import SceneError

R = 6371008.8
OWN = {**crooked.OWNSHIP, "alt_m": 100.0, "climb_mps": 0.0}
RADAR = sensor("radar.range_boundary", range_km=400.0)


def far(name, range_m, alt_m, bearing_deg=70.0, **keys):
    """A target at an altitude, so far along a bearing from the ownship."""
    turn = math.radians(bearing_deg)
    ecef = pymap3d.enu2ecef(
        range_m * math.sin(turn), range_m * math.cos(turn), 0.0,
        OWN["lat_deg"], OWN["lon_deg"], OWN["alt_m"],
    )  # fmt: skip
    lat, lon, _ = pymap3d.ecef2geodetic(*ecef)
    return {"name": name, "lat_deg": float(lat), "lon_deg": float(lon), "alt_m": alt_m, **keys}


# Straight: 3.57 (√100 + √300) km = 97.5 km to the limb; 4/3 Earth: 112.6 km.
AT_THE_LIMB = [far("near", 94e3, 300.0), far("between", 105e3, 300.0), far("beyond", 116e3, 300.0)]


@covers("horizon", "refraction", of=("[terrain]",))
@pytest.mark.parametrize("beam_sweep", [False, True])
@pytest.mark.parametrize(
    ("terrain", "seen"),
    [
        ({}, {"near", "between", "beyond"}),
        ({"horizon": True}, {"near"}),
        ({"horizon": True, "refraction": "four_thirds"}, {"near", "between"}),
        # 90 m of ground all around leave 10 and 210 m: 63 km straight, 73 km bent.
        ({"horizon": True, "height_m": 90.0}, set()),
    ],
)
def test_the_limb_hides_what_is_behind_it(terrain, seen, beam_sweep):
    radar = RADAR
    if beam_sweep:  # ground below needs resolution cells
        cell = {f"{key}_resolution_deg": 1.0 for key in ("azimuth", "elevation")}
        radar = sensor("radar.threshold", beam_sweep=True, range_resolution_m=50.0, **cell)
    done = run(chain({"radar": radar}, ownship=OWN, targets=AT_THE_LIMB, terrain=terrain))
    assert {row["target"] for row in rows(done)} == seen
    (scan,) = rows(done, "scans", block="radar")
    assert scan["skipped_hidden"] == 3 - len(seen)
    assert scan["skipped_range"] + scan["skipped_absent"] + scan["skipped_field_of_view"] == 0


@pytest.mark.parametrize("scans", [1, 3])
def test_a_sensor_without_a_gate_does_not_see_through_the_earth(scans):
    scene = chain({"radar": RADAR}, ownship=OWN, targets=AT_THE_LIMB,
                  terrain={"horizon": True}, duration_s=scans)  # fmt: skip
    scene["wires"] = ["traffic -> transform -> radar"]
    del scene["blocks"]["gate"]
    done = run(scene)
    assert {row["target"] for row in rows(done)} == {"near"}
    assert [row["skipped_hidden"] for row in rows(done, "scans")] == [2] * scans


@covers("refraction", of=("[terrain]",))
def test_a_bent_ray_arrives_from_above():
    target = far("high", 60e3, 2000.0)
    found = first_look(
        chain({"radar": RADAR}, ownship=OWN, targets=[target],
              terrain={"refraction": "four_thirds"}), "radar",
    )["high"]  # fmt: skip
    place = (OWN["lat_deg"], OWN["lon_deg"], OWN["alt_m"])
    straight = np.array(
        pymap3d.geodetic2ned(target["lat_deg"], target["lon_deg"], target["alt_m"], *place)
    )
    range_m = float(np.linalg.norm(straight))
    azimuth, elevation = crooked.angles(straight)
    # A ray with a quarter of the Earth's curvature leaves its chord by D/(8R).
    bent = crooked.direction(azimuth, elevation + range_m * math.cos(elevation) / (8 * R))
    p, q = crooked.angles(crooked.attitude(OWN) @ bent)
    assert found["true_azimuth_rad"] == pytest.approx(p, abs=1e-8)
    assert found["true_elevation_rad"] == pytest.approx(q, abs=1e-8)
    assert found["true_range_m"] == pytest.approx(range_m, abs=1e-3)
    unbent = first_look(chain({"radar": RADAR}, ownship=OWN, targets=[target]), "radar")["high"]
    there = crooked.direction(unbent["true_azimuth_rad"], unbent["true_elevation_rad"])
    np.testing.assert_allclose(there, crooked.attitude(OWN) @ straight / range_m, atol=1e-8)


def wall(folder, height_m, name="S42W180.hgt"):
    """Level ground with a crest along the meridian -179.9, every node of the raster 0.02° apart."""
    nodes = np.zeros((51, 51))
    nodes[:, 5] = height_m
    path = folder / name
    path.write_bytes(nodes.astype(">i2").tobytes())
    return str(path)


def behind_the_wall(alt_m, name):
    """East of the crest, at the ownship's latitude."""
    return {"name": name, "lat_deg": OWN["lat_deg"], "lon_deg": -179.8, "alt_m": alt_m}


def line_over_the_crest_m(alt_m):
    """Height of the straight line where it crosses the crest's meridian."""
    here = np.array(pymap3d.geodetic2ecef(OWN["lat_deg"], OWN["lon_deg"], 1000.0))
    there = np.array(pymap3d.geodetic2ecef(OWN["lat_deg"], -179.8, alt_m))
    _, lon, height = pymap3d.ecef2geodetic(
        *(here[:, None] + (there - here)[:, None] * np.linspace(0, 1, 9001))
    )
    return float(np.interp(-179.9, lon, height))


@covers("raster", "raster_offset_m", of=("[terrain]",))
@pytest.mark.parametrize("offset_m", [0.0, -40.0])
def test_a_ridge_hides_what_is_behind_it(offset_m, tmp_path):
    over = line_over_the_crest_m(600.0)
    crest = round(over - offset_m)
    # Heights of targets whose lines pass the crest a few metres below and above it.
    targets = [behind_the_wall(600.0 + 2 * up, f"at {up}") for up in (-6, -2, 2, 6)]
    own = {**OWN, "alt_m": 1000.0}
    terrain = {"raster": wall(tmp_path, crest), "raster_offset_m": offset_m}
    done = run(chain({"radar": RADAR}, ownship=own, targets=targets, terrain=terrain))
    expected = {
        one["name"] for one in targets
        if line_over_the_crest_m(one["alt_m"]) > crest + offset_m
    }  # fmt: skip
    assert expected == {"at 2", "at 6"}
    assert {row["target"] for row in rows(done)} == expected
    assert rows(done, "scans")[0]["skipped_hidden"] == 2
    # Beside another tile it is the same; resolved scenes name both files.
    both = {**terrain, "raster": [terrain["raster"], wall(tmp_path, 0, "S42E179.hgt")]}
    scene = chain({"radar": RADAR}, ownship=own, targets=targets, terrain=both)
    assert {row["target"] for row in rows(run(scene))} == expected
    lower = {**terrain, "raster": wall(tmp_path, crest - 20, "S42W180_low.hgt")}
    free = run(chain({"radar": RADAR}, ownship=own, targets=targets, terrain=lower))
    assert len(rows(free)) == 4


@covers("refraction", of=("[terrain]",))
@pytest.mark.parametrize("horizon", [True, False])
def test_bent_rays_pass_a_ridge_that_straight_ones_do_not(horizon, tmp_path):
    """The air lifts the ray over the crest by a quarter of what the Earth falls away there."""
    crest = round(line_over_the_crest_m(600.0))
    place = OWN["lat_deg"], OWN["lon_deg"], 1000.0
    there = pymap3d.geodetic2ned(OWN["lat_deg"], -179.8, 600.0, *place)
    length_m, share = float(np.linalg.norm(there)), (179.9997 - 179.9) / (179.9997 - 179.8)
    arch_m = 0.25 * length_m**2 * share * (1.0 - share) / (2.0 * R)
    assert 1.0 < arch_m < 2.0
    targets = [behind_the_wall(600.0 + 2 * up, f"at {up}") for up in (-3, -1, 1)]
    own = {**OWN, "alt_m": 1000.0}
    for refraction, lift_m in (("none", 0.0), ("four_thirds", arch_m)):
        terrain = {"raster": wall(tmp_path, crest), "refraction": refraction, "horizon": horizon}
        found = rows(run(chain({"radar": RADAR}, ownship=own, targets=targets, terrain=terrain)))
        expected = {
            one["name"] for one in targets
            if line_over_the_crest_m(one["alt_m"]) + lift_m > crest
        }  # fmt: skip
        assert len(expected) == (1 if refraction == "none" else 2)
        assert {row["target"] for row in found} == expected


def test_a_steep_ray_is_bent_less_over_a_ridge(tmp_path):
    """The arch is that of the ray's level part: 0.6 of what a level ray of its length has."""
    alt_m, share = 15_000.0, (179.9997 - 179.9) / (179.9997 - 179.8)
    there = pymap3d.geodetic2ned(OWN["lat_deg"], -179.8, alt_m, OWN["lat_deg"], OWN["lon_deg"],
                                 1000.0)  # fmt: skip
    length_m, level_m = float(np.linalg.norm(there)), float(np.hypot(*there[:2]))
    flat_m = 0.25 * length_m**2 * share * (1.0 - share) / (2.0 * R)
    bent_m = flat_m * (level_m / length_m) ** 2
    assert flat_m - bent_m > 0.8
    over = line_over_the_crest_m(alt_m)
    crest = round(over)
    own = {**OWN, "alt_m": 1000.0}
    for stands_m, seen in ((0.5 * (flat_m + bent_m), False), (0.75 * bent_m, True)):
        terrain = {"raster": wall(tmp_path, crest), "raster_offset_m": over + stands_m - crest,
                   "refraction": "four_thirds"}  # fmt: skip
        found = rows(run(chain({"radar": RADAR}, ownship=own, terrain=terrain,
                               targets=[behind_the_wall(alt_m, "high")])))  # fmt: skip
        assert bool(found) is seen


def test_the_limb_and_a_ridge_hide_side_by_side(tmp_path):
    own = {**OWN, "alt_m": 1000.0}
    targets = [behind_the_wall(100.0, "behind the ridge"),
               far("behind the limb", 250e3, 300.0, bearing_deg=300.0),
               far("free", 9e3, 1500.0, bearing_deg=300.0)]  # fmt: skip
    seen = {}
    for ridge, limb in ((True, True), (True, False), (False, True)):
        terrain = {"horizon": limb}
        if ridge:
            terrain["raster"] = wall(tmp_path, 900)
        found = rows(run(chain({"radar": RADAR}, ownship=own, targets=targets, terrain=terrain)))
        seen[ridge, limb] = {row["target"] for row in found}
    assert seen[True, True] == {"free"}
    assert seen[True, False] == {"free", "behind the limb"}
    assert seen[False, True] == {"free", "behind the ridge"}


@covers("horizon", of=("[terrain]",))
def test_from_above_there_is_sky_down_to_the_dip_of_the_horizon():
    """From 2400 m the horizon dips by 1.57°: a target 1° below the horizontal is before the sky."""
    targets = [
        far("above the limb", 6e3, OWN["alt_m"] + 2300 - 105.0),
        far("between", 6e3, OWN["alt_m"] + 2300 - 149.0),
        far("below it", 6e3, OWN["alt_m"] + 2300 - 210.0),
    ]
    own = {**OWN, "alt_m": 2400.0}

    def signatures(background, **sections):
        camera = sensor("optical.eo", background=background, sun_elevation_deg=35.0)
        scene = chain({"eo": camera}, ownship=own, targets=targets, **sections)
        return {name: row["confidence"] for name, row in first_look(scene, "eo").items()}

    sky, ground, auto = (signatures(name) for name in ("sky", "ground", "auto"))
    assert auto == ground
    with_horizon = signatures("auto", terrain={"horizon": True})
    assert with_horizon["above the limb"] == sky["above the limb"] != ground["above the limb"]
    assert with_horizon["below it"] == ground["below it"]
    fixed = signatures("ground", terrain={"horizon": True})
    assert fixed == ground
    # At 1.45°: over the sea's limb, below that of bent rays (1.36°) and of a plateau (1.24°).
    assert with_horizon["between"] == sky["between"] != ground["between"]
    for nearer in ({"refraction": "four_thirds"}, {"height_m": 900.0}):
        found = signatures("auto", terrain={"horizon": True, **nearer})["between"]
        assert found == pytest.approx(ground["between"], rel=1e-3)
        assert found != pytest.approx(sky["between"], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "crest", "own", "says"),
    [
        (
            "N10E010.hgt",
            10,
            OWN,
            "covers latitudes 10 to 11, longitudes 10 to 11: the ownship is at",
        ),
        ("S42W180.hgt", 10, {**OWN, "alt_m": -20.0}, "it must fly above the ground"),
    ],
)
def test_rasters_that_do_not_fit_the_flight_are_named(name, crest, own, says, tmp_path):
    scene = chain({"radar": RADAR}, ownship=own, targets=AT_THE_LIMB,
                  terrain={"raster": wall(tmp_path, crest, name)})  # fmt: skip
    with pytest.raises(SceneError, match=says):
        run(scene)


@pytest.mark.parametrize(
    ("terrain", "says"),
    [
        ({"raster": "S42W180.hgt"}, "raster.*1 hole "),
        ({"raster": "nowhere.hgt"}, "raster.*nowhere.hgt"),
        ({"refraction": "air"}, "refraction.*four_thirds"),
        ({"raster_offset_m": 900}, "raster_offset_m.*200"),
    ],
)
def test_bad_values_are_one_clear_error(terrain, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    nodes = np.zeros((3, 3), dtype=">i2")
    nodes[1, 1] = -32768
    (tmp_path / "S42W180.hgt").write_bytes(nodes.tobytes())
    scene = chain({"radar": RADAR}, ownship=OWN, targets=AT_THE_LIMB, terrain=terrain)
    with pytest.raises(SceneError) as caught:
        dsa_des.run(scene)
    assert len(caught.value.problems) == 1
    import re

    assert re.search(says, str(caught.value).replace("\n", " "))


def test_replicas_over_one_raster_run_in_lock_step():
    """Each reads its scene anew; the ground is the same one."""

    def load(seed):
        sets = [f"seed={seed}", "blocks.radar.false_alarm_probability=0.2"]
        return dsa_des.load_scene("configs/terrain/behind_the_ridge.toml", sets=sets, duration_s=4)

    same_as_alone([load(1), load(2)])
