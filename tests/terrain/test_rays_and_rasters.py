"""Rays over the ellipsoid, rasters, and what hides behind them, against brute force by pymap3d."""

import math
import sys
from types import SimpleNamespace

import numpy as np
import pymap3d
import pytest
from scipy.ndimage import map_coordinates
from wired import chain

import dsa_des
from components.flights.bounds import (
    _latitude_and_altitude_bounds,
    check_above_terrain,
    check_over_raster_above_ground,
)
from components.terrain.raster import ElevationRaster, mosaic, read_raster
from components.terrain.rays import (
    geodetic_lat_rad_lon_deg,
    horizon_dip_rad,
    is_behind_limb,
    is_behind_terrain,
    max_ground_above_clear_ray_m,
    rays_between,
    refracted_elevation_rad,
)
from docs.make.synthetic_raster import NAME, main, synthetic_heights_m
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation

R = 6371008.8


def pairs(count, longest_m, seed=1):
    """Random places and others up to a distance from them, by pymap3d."""
    rng = np.random.default_rng(seed)
    own = rng.uniform(-85, 85, count), rng.uniform(-180, 180, count), rng.uniform(10, 9e3, count)
    far, bearing = rng.uniform(100, longest_m, count), rng.uniform(0, 2 * np.pi, count)
    ecef = pymap3d.enu2ecef(far * np.sin(bearing), far * np.cos(bearing), 0.0 * far, *own)
    lat, lon, _ = pymap3d.ecef2geodetic(*ecef)
    return own, (np.asarray(lat), np.asarray(lon), rng.uniform(10, 9e3, count))


def along(own, other, shares):
    """Heights of the chord above the ellipsoid, (pairs, shares), and its places."""
    a, b = (np.array(pymap3d.geodetic2ecef(*p)) for p in (own, other))
    points = a[:, :, None] + (b - a)[:, :, None] * shares
    return pymap3d.ecef2geodetic(*points), np.linalg.norm(b - a, axis=0)


def test_places_by_bowring():
    rng = np.random.default_rng(2)
    lat, lon, alt = (
        rng.uniform(-90, 90, 300),
        rng.uniform(-180, 180, 300),
        rng.uniform(-5e2, 5e4, 300),
    )
    found = geodetic_lat_rad_lon_deg(*map(np.asarray, pymap3d.geodetic2ecef(lat, lon, alt)))
    np.testing.assert_allclose(np.degrees(found[0]), lat, atol=1e-9)
    np.testing.assert_allclose(found[1], lon, atol=1e-9)
    np.testing.assert_allclose(found[2], alt, atol=1e-5)


@pytest.mark.parametrize(("longest_m", "error_m"), [(1e5, 1e-3), (3e5, 0.1)])
def test_the_lowest_point_of_a_straight_ray(longest_m, error_m):
    own, other = pairs(200, longest_m)
    shares = np.linspace(0, 1, 4001)
    heights, _ = along(own, other, shares)
    low = rays_between(own, other).lowest_height_m()
    np.testing.assert_allclose(low, heights[2].min(axis=1), atol=error_m)


def test_the_limb_of_the_ellipsoid_in_closed_form():
    """Stretched along its axis the ellipsoid is a sphere, and lines stay lines."""
    own, other = pairs(400, 6e5, seed=3)
    stretch = np.array([1, 1, 1 / math.sqrt(1 - 0.0066943799901413165)])[:, None]
    a, b = (np.array(pymap3d.geodetic2ecef(*p)) * stretch for p in (own, other))
    share = np.clip(-np.sum(a * (b - a), axis=0) / np.sum((b - a) ** 2, axis=0), 0, 1)
    nearest = np.linalg.norm(a + share * (b - a), axis=0) - 6378137.0
    clear = np.abs(nearest) > 1.0
    assert 50 < np.count_nonzero(nearest < 0) < 350
    assert (is_behind_limb(own, other) == (nearest < 0))[clear].all()


@pytest.mark.parametrize(("refraction", "factor"), [("none", 1.0), ("four_thirds", 4 / 3)])
def test_the_range_to_the_horizon_is_that_of_the_textbook(refraction, factor):
    """d = k R (acos(kR/(kR+h1)) + acos(kR/(kR+h2))), 4.12 (√h1 + √h2) km with k = 4/3."""
    east = np.arange(50e3, 300e3, 50.0)
    own = (0 * east - 35.0, 0 * east + 10.0, 0 * east + 800.0)
    lat, lon, _ = pymap3d.enu2geodetic(east, 0 * east, 0 * east, -35.0, 10.0, 0.0)
    hidden = is_behind_limb(own, (lat, lon, 0 * east + 400.0), refraction=refraction)
    first = int(np.argmax(hidden))
    assert hidden[first:].all() and not hidden[:first].any()
    # Along the parallel the radius of curvature is the prime vertical's.
    radius = factor * 6378137.0 / math.sqrt(1 - 0.00669438 * math.sin(math.radians(35)) ** 2)
    expected = radius * sum(math.acos(radius / (radius + h)) for h in (800.0, 400.0))
    # The rung takes the Earth's mean radius for the bending: 0.1 %.
    assert east[first] == pytest.approx(expected, rel=1.5e-3)
    if factor > 1:
        assert east[first] / 1e3 == pytest.approx(
            4.12 * (math.sqrt(800) + math.sqrt(400)), rel=3e-3
        )


def test_bending_and_dip():
    assert math.degrees(refracted_elevation_rad(0.0, 20e3)) == pytest.approx(0.0225, abs=5e-5)
    assert refracted_elevation_rad(0.3, 2e4, "none") == 0.3
    assert refracted_elevation_rad(math.pi / 2, 1e4) == math.pi / 2
    # The bent ray over the round Earth is the straight one over the Earth of 4/3: h2 there.
    el, range_m = 0.02, 60e3
    rises = math.tan(refracted_elevation_rad(el, range_m)) - math.tan(el)
    assert rises * range_m == pytest.approx(range_m**2 / (8 * R), rel=2e-3)
    assert math.degrees(horizon_dip_rad(1000.0)) == pytest.approx(
        math.degrees(math.acos(R / (R + 1e3)))
    )
    assert horizon_dip_rad(1000.0, "four_thirds") == pytest.approx(
        math.acos(R / (R + 750.0)), rel=1e-4
    )
    assert horizon_dip_rad(-5.0) == 0.0
    with pytest.raises(ValueError, match="refraction is 'air'"):
        refracted_elevation_rad(0.0, 1.0, "air")


def ridges():
    rng = np.random.default_rng(8)
    return ElevationRaster(-42.0, 179.5, 1 / 60, 1 / 60, rng.uniform(0, 2500, (61, 61)), "ridges")


def bilinear(raster, lat, lon):
    """Heights by SciPy, -inf beside the raster."""
    place = [(lat + 42.0) * 60, np.mod(lon - 179.5, 360.0) * 60]
    return map_coordinates(raster.height_m, place, order=1, cval=-np.inf)


def test_heights_between_nodes_across_the_antimeridian():
    raster = ridges()
    rng = np.random.default_rng(5)
    lat, lon = (
        rng.uniform(-42.3, -40.7, 200),
        np.mod(rng.uniform(179.3, 180.7, 200) + 180, 360) - 180,
    )
    found, inside = raster.heights_and_coverage(lat, lon)
    np.testing.assert_allclose(found, bilinear(raster, lat, lon), rtol=1e-9)
    assert 0 < np.count_nonzero(inside) < 200
    corner, on = raster.heights_and_coverage(np.array([-42.0, -41.0]), np.array([-180.5, -179.5]))
    assert on.all()
    assert corner == pytest.approx([raster.height_m[0, 0], raster.height_m[-1, -1]])


@pytest.mark.parametrize("refraction", ["none", "four_thirds"])
def test_rays_through_mountains_by_brute_force(refraction):
    raster = ridges()
    rng = np.random.default_rng(6)
    count = 60
    ends = [
        (rng.uniform(-41.95, -41.05, count), rng.uniform(179.55, 180.45, count) - 360.0,
         rng.uniform(1900, 2900, count)) for _ in range(2)
    ]  # fmt: skip
    shares = np.linspace(0, 1, 2001)[1:-1]
    (lat, lon, height), length = along(*ends, shares)
    if refraction == "four_thirds":
        height = height + (length**2 / (2 * R) / 4)[:, None] * shares * (1 - shares)
    ground = bilinear(raster, lat, lon)
    above = (ground - height).max(axis=1)
    found = is_behind_terrain(*ends, raster, refraction=refraction)
    assert 5 < np.count_nonzero(found) < count - 5
    # Never hidden where nothing stands in it (the brute force's comb misses crests by metres);
    # missed only by less than the bound.
    assert (above[found] > -15.0).all()
    assert (above[~found] < max_ground_above_clear_ray_m(raster)).all()
    # The raster's zero counts, and one by one they are what they are together.
    assert is_behind_terrain(*ends, raster, offset_m=2000.0).all()
    single = [
        is_behind_terrain(
            *([a[i : i + 1] for a in end] for end in ends), raster, refraction=refraction
        )
        for i in range(count)
    ]
    assert (np.concatenate(single) == found).all()


def hgt(folder, heights, name="S42W180.hgt"):
    path = folder / name
    path.write_bytes(np.asarray(heights).astype(">i2").tobytes())
    return path


def test_an_hgt_file_runs_from_north_to_south(tmp_path):
    raster = read_raster(hgt(tmp_path, [[1, 2, 3], [4, 5, 6], [7, 8, 9]], "n45E007.hgt"))
    assert (raster.south_deg, raster.west_deg, raster.lat_step_deg) == (45.0, 7.0, 0.5)
    found, _ = raster.heights_and_coverage(np.array([46.0, 45.0, 45.25]), np.array([7.0, 8.0, 7.5]))
    assert found.tolist() == [1.0, 9.0, 6.5]
    assert read_raster(hgt(tmp_path, np.zeros((2, 2)), "S05W070.hgt")).south_deg == -5.0


def test_tiles_side_by_side_are_one_raster():
    rng = np.random.default_rng(9)
    whole = np.round(rng.uniform(0, 900, (5, 9)))  # rows from the south, across ±180
    tiles = [
        ElevationRaster(-42.0, west, 0.25, 0.25, whole[:, at : at + 5], name)
        for west, at, name in ((-180.0, 4, "east"), (179.0, 0, "west"))
    ]
    for pair in (tiles, tiles[::-1]):
        made = mosaic(pair)
        assert (made.height_m == whole).all() and made.name.endswith("and 1 more")
        lon = np.array([179.125, -179.875, -180.0, 180.0, -179.1])
        found, inside = made.heights_and_coverage(np.full(5, -41.4), lon)
        expected = map_coordinates(whole, [np.full(5, 2.4), (lon - 179) % 360 * 4], order=1)
        assert inside.all() and found == pytest.approx(expected, rel=1e-6)
    assert mosaic(tiles[:1]) is tiles[0]
    corner = ElevationRaster(-41.0, 179.0, 0.25, 0.25, whole[:, :5], "north")
    with pytest.raises(ValueError, match="has 16 holes"):
        mosaic([*tiles, corner])
    with pytest.raises(ValueError, match=r"fine has nodes every 0\.1 by 0\.25"):
        mosaic([tiles[0], ElevationRaster(-42.0, 179.0, 0.1, 0.25, whole[:, :5], "fine")])
    with pytest.raises(ValueError, match="do not fall onto those of east"):
        mosaic([tiles[0], ElevationRaster(-42.1, 179.0, 0.25, 0.25, whole[:, :5], "off")])


@pytest.mark.parametrize("refraction", ["none", "four_thirds"])
def test_a_plain_hides_what_a_sea_of_its_height_hides(refraction):
    """Rays that graze it by metres, over up to 300 km, between nodes a degree apart."""
    plain = ElevationRaster(-42.0, 178.0, 1.0, 1.0, np.full((5, 5), 500.0), "plain")
    rng = np.random.default_rng(11)
    own, other = rng.uniform((-41, 178), (-39, 182), (2, 500, 2)).transpose(0, 2, 1)
    level = [(*place, np.full(500, 500.0)) for place in (own, other)]
    sag = rays_between(*level, refraction).sag_m
    tilt = rng.uniform(-0.4, 0.4, 500) * sag
    lift = 500.0 + sag + rng.uniform(-6.0, 6.0, 500) + tilt**2 / (4.0 * sag)
    ends = (*own, lift - tilt), (*other, lift + tilt)
    low = rays_between(*ends, refraction).lowest_height_m()
    known = np.abs(low - 500.0) > max_ground_above_clear_ray_m(plain) + 0.001
    hidden = is_behind_terrain(*ends, plain, refraction=refraction)
    assert (hidden == is_behind_limb(*ends, surface_m=500.0, refraction=refraction))[known].all()
    assert 100 < hidden.sum() < 400


def test_a_bent_ray_leaves_as_steeply_as_it_is_seen():
    own = np.full(80, -33.0), np.full(80, 18.0), np.full(80, 200.0)
    elevation, range_m = np.linspace(-0.05, 1.5, 80), np.geomspace(2e3, 8e4, 80)
    level = range_m * np.cos(elevation)
    ecef = pymap3d.enu2ecef(0.6 * level, 0.8 * level, range_m * np.sin(elevation), *own)
    other = tuple(map(np.asarray, pymap3d.ecef2geodetic(*ecef)))
    rises = [
        (rays_between(own, other, kind).points_at_shares(np.full(80, 1e-3))[2] - 200.0)
        / (1e-3 * range_m)
        for kind in ("none", "four_thirds")
    ]
    wanted = np.sin(refracted_elevation_rad(elevation, range_m)) - np.sin(elevation)
    np.testing.assert_allclose(rises[1] - rises[0], wanted, rtol=0.03, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "heights", "says"),
    [
        ("S42W180.hgt", [[1, 2], [3, -32768]], r"1 hole .* latitude -42, longitude -179"),
        ("S42W180.hgt", [[1, 2, 3]], "6 bytes: an .hgt file holds as many rows as columns"),
        ("S42W180.hgt", [[1, 2, 3, 4, 5]], "10 bytes: an .hgt file holds as many rows as"),
        ("S42W180.hgt", [[7]], "2 bytes: an .hgt file holds as many rows as columns"),
        ("island.hgt", [[1, 2], [3, 4]], "must say its south-west corner"),
        ("S42W180.png", [[1, 2], [3, 4]], "must be .hgt .SRTM., .tif or .tiff"),
        ("N90W180.hgt", [[1, 2], [3, 4]], "must lie within -90 to 90"),
    ],
)  # fmt: skip
def test_bad_rasters_are_named(name, heights, says, tmp_path):
    with pytest.raises(ValueError, match=says) as caught:
        read_raster(hgt(tmp_path, heights, name))
    assert name in str(caught.value)


def test_a_geotiff_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(ValueError, match=r"pip install 'dsa-des\[geotiff\]'"):
        read_raster(hgt(tmp_path, [[1, 2], [3, 4]], "a.tif"))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.filterwarnings("ignore:Use `@`")  # rasterio's own, of a newer affine
def test_a_geotiff_is_the_same_raster(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    heights = np.arange(12, dtype=np.float32).reshape(3, 4)

    def written(crs="EPSG:4326", missing=None, name="a.tif"):
        # Corner of the first pixel: half a step north and west of the first node.
        grid = from_origin(7.0 - 0.05, 46.0 + 0.1, 0.1, 0.2)
        options = {"height": 3, "width": 4, "count": 1, "dtype": "float32", "crs": crs}
        with rasterio.open(tmp_path / name, "w", transform=grid, nodata=-9999, **options) as file:
            file.write(np.where(heights == missing, -9999, heights).astype(np.float32), 1)
        return tmp_path / name

    raster = read_raster(written())
    assert (raster.south_deg, raster.west_deg) == pytest.approx((45.6, 7.0))
    assert raster.height_m[::-1].tolist() == heights.tolist()
    with pytest.raises(ValueError, match="1 hole "):
        read_raster(written(missing=5, name="holes.tif"))
    with pytest.raises(ValueError, match="must be in longitude and latitude"):
        read_raster(written(crs="EPSG:32633", name="utm.tif"))
    with pytest.raises(ValueError, match="is no GeoTIFF that can be read"):
        read_raster(hgt(tmp_path, [[1, 2], [3, 4]], "text.tif"))


def test_the_shipped_raster_is_what_its_script_makes(tmp_path, configs, capsys):
    assert main([str(tmp_path)]) == 0
    shipped = (configs / "terrain" / NAME).read_bytes()
    assert (tmp_path / NAME).read_bytes() == shipped
    raster = read_raster(configs / "terrain" / NAME)
    assert raster.highest_m == synthetic_heights_m().max() > 1500
    assert main([str(tmp_path / "nowhere")]) == 2


@pytest.mark.filterwarnings("ignore:Use `@`")  # rasterio's own, of a newer affine
@pytest.mark.parametrize("ending", ["hgt", "tif", "side by side"])
def test_a_raster_too_large_is_refused_before_it_is_read(tmp_path, ending):
    """22,000 by 22,000 nodes, in files with nothing on the disk; two tiles 11 degrees apart."""
    import dsa_des
    from dsa_des.errors import SceneError

    nodes, paths = 22_000, [tmp_path / f"S42W180.{ending}"]
    if ending == "hgt":
        with paths[0].open("wb") as file:
            file.truncate(2 * nodes * nodes)
    elif ending == "tif":
        rasterio = pytest.importorskip("rasterio")
        grid = rasterio.transform.from_origin(-180.0, -41.0, 1e-4, 1e-4)
        options = {"driver": "GTiff", "height": nodes, "width": nodes, "count": 1, "crs": 4326,
                   "dtype": "float32", "tiled": True, "sparse_ok": True}  # fmt: skip
        rasterio.open(paths[0], "w", transform=grid, **options).close()
    else:
        paths = [tmp_path / name for name in ("S42W180.hgt", "S31W169.hgt")]
        for path in paths:
            path.write_bytes(bytes(2 * 1201 * 1201))
    raster = str([str(path) for path in paths]).replace("'", '"')
    said = r"terrain.raster = .*S42W180.*by.*nodes: at most 100,000,000 are held; cut it"
    with pytest.raises(SceneError, match=said):
        dsa_des.load_scene("terrain/behind_the_ridge", sets=[f"terrain.raster={raster}"])


def test_a_flight_is_held_against_the_ground_where_it_is_there():
    """Absent for two seconds, then 100 m a second lower, from 0.5 degrees on over the raster."""
    seconds = np.arange(6.0)
    state = SimpleNamespace(
        lat_deg=0.1 + 0.2 * seconds, lon_deg=7.0 + 0.01 * seconds, alt_m=900.0 - 100.0 * seconds,
        present=seconds >= 2.0,
    )  # fmt: skip

    def ground(first_deg):
        return SimpleNamespace(
            name="g.tif",
            bounds_text=lambda: "some",
            heights_and_coverage=lambda lat, _: (0.0 * lat, lat > first_deg),
        )

    def at(times):
        assert times.tolist() == seconds.tolist()
        return state

    check_over_raster_above_ground(at, ground(0.6), 399.0, 5.0)
    with pytest.raises(ValueError, match=r"latitude 0\.5, longitude 7\.02 and never over it"):
        check_over_raster_above_ground(at, ground(9.0), 0.0, 5.0)
    with pytest.raises(ValueError, match=r"is 600 m high under .* at 600 m at 3 s"):
        check_over_raster_above_ground(at, ground(0.6), 600.0, 5.0)
    with pytest.raises(ValueError, match=r"height_m is 700: .* at 700 m at 2 s"):
        check_above_terrain(at, 700.0, 5.0)


def test_an_ownship_that_moves_between_samples_turns_by_the_shortest_radius():
    """A degree at the equator along a meridian is a (1 - e²) radians, 110,574.3 m."""
    state = SimpleNamespace(lat_deg=np.array([10.0, 12.0]), alt_m=np.array([3.0e4, 2.0e4]))
    moves_m = (6378137.0 * (1.0 - 0.00669437999014) + 1.0e4) * math.radians(1.0)
    # It may be that much lower, too: the normal turns a little faster there.
    ratio = moves_m / (6378137.0 * (1.0 - 0.00669437999014) + 2.0e4 - moves_m)
    latitudes, heights, turns = _latitude_and_altitude_bounds(state, moves_m)
    assert turns == pytest.approx(ratio, rel=1e-12)
    assert latitudes == pytest.approx((10.0 - math.degrees(ratio), 12.0 + math.degrees(ratio)))
    assert heights == pytest.approx((2.0e4 - moves_m, 3.0e4 + moves_m))
    near = SimpleNamespace(lat_deg=np.array([-89.5, 89.5]), alt_m=np.zeros(2))
    assert _latitude_and_altitude_bounds(near, moves_m)[0] == (-90.0, 90.0)


def test_a_scene_whose_ownship_flies_into_the_ground_is_refused():
    """Sinking 2 m/s from 900 m: level with 890 m after 5 s."""
    own = {"lat_deg": 45.0, "lon_deg": 7.0, "alt_m": 900, "heading_deg": 0, "speed_mps": 40,
           "climb_mps": -2.0}  # fmt: skip
    eye = {"type": "optical.range_boundary", "range_km": 9.0, "scan_rate_hz": 1}
    for height_m, duration_s in ((889.9, 5), (890.0, 4), (890.0, 5)):
        scene = dsa_des.load_scene(
            chain({"eye": eye}, ownship=own, duration_s=duration_s, terrain={"height_m": height_m})
        )
        if (height_m, duration_s) != (890.0, 5):
            assert Simulation(scene).duration_s == duration_s
            continue
        with pytest.raises(SceneError) as error:
            Simulation(scene)
        assert str(error.value).endswith(
            "[terrain] height_m is 890: it must be below the ownship, which is at 890 m at 5 s"
        )
