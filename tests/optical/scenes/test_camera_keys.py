"""What each key of a camera does to pixels, signature and reports."""

import math

import crooked
import numpy as np
import pytest
from covering import CAMERAS, covers
from wired import SEES_ALL, Row, alone, chain, rows, run, sensor

PIXEL_RAD = math.radians(0.01)
AREAS = {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 50.0}
WARM = {"front_m2": 3.0, "back_m2": 9.0, "side_m2": 8.0, "horizontal_m2": 30.0}
PAINTED = [
    {**target, "eo": AREAS, "ir": WARM, "contrast": 0.6, "contrast_ir": 0.25,
     "paint_reflectance": paint, "engine": engine}
    for target, paint, engine in zip(
        crooked.TARGETS, (0.9, 0.05), ("turbojet", "turbofan"), strict=True)
]  # fmt: skip
CONTRAST = {"optical.eo": 0.6, "optical.ir": 0.25, "optical.projection": 0.6}


def seen(kind: str, targets=PAINTED, **keys) -> dict[str, Row]:
    sections = keys.pop("sections", {})
    scene = chain({"sensor": sensor(kind, **keys)}, targets=targets, **sections)
    return {row["target"]: row for row in rows(run(scene), block="sensor", scan=0)}


def area_m2(row: Row) -> float:
    return row["pixels"] * (row["true_range_m"] * PIXEL_RAD) ** 2


def signature(row: Row, threshold: float = -1.0) -> float:
    return row["confidence"] + threshold


@covers("static_weight", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("weight", [0.3, 1.7])
def test_the_signature_is_weight_times_pixels_times_contrast(kind, weight):
    for row in seen(kind, static_weight=weight).values():
        assert signature(row) == pytest.approx(weight * row["pixels"] * CONTRAST[kind])


@covers("threshold", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_what_reaches_the_threshold_is_detected(kind):
    strength = {name: signature(row) for name, row in seen(kind).items()}
    weak, strong = sorted(strength, key=strength.__getitem__)
    middle = 0.5 * (strength[weak] + strength[strong])
    assert strength[strong] > 1.01 * strength[weak]
    found = seen(kind, threshold=middle)
    assert found.keys() == {strong}
    assert found[strong]["confidence"] == pytest.approx(strength[strong] - middle)
    assert seen(kind, threshold=1.001 * strength[strong]) == {}
    assert seen(kind, threshold=0.999 * strength[weak]).keys() == strength.keys()


@covers("dynamic_weight", "rate", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("rate", ["exact", "thesis"])
def test_motion_in_ned_adds_to_the_signature(kind, rate):
    weight = 3000.0
    keys = {"scan_rate_hz": 2, "rate": rate}
    still = alone(kind, **keys, targets=PAINTED)
    moving = alone(kind, **keys, targets=PAINTED, dynamic_weight=weight)
    for target in PAINTED:
        (before,), (after,) = (
            rows(found, target=target["name"], scan=1) for found in (still, moving)
        )
        now, last = crooked.ned(target, 0.5), crooked.ned(target)
        if rate == "exact":
            turned = math.atan2(float(np.linalg.norm(np.cross(now, last))), float(now @ last))
        else:
            (az, el), (last_az, last_el) = crooked.angles(now), crooked.angles(last)
            turned = math.hypot(az - last_az, el - last_el)
        added = after["confidence"] - before["confidence"]
        assert added == pytest.approx(weight * turned / 0.5, rel=1e-5)


def test_the_two_rates_differ():
    """High up, or the tests of both would be one."""
    now, last = crooked.ned(crooked.DIVING, 0.5), crooked.ned(crooked.DIVING)
    turned = math.atan2(float(np.linalg.norm(np.cross(now, last))), float(now @ last))
    (az, el), (last_az, last_el) = crooked.angles(now), crooked.angles(last)
    assert math.hypot(az - last_az, el - last_el) > 1.005 * turned


def line_of_sight_in_target(target: dict) -> np.ndarray:
    vector = -crooked.aspect(target)
    return vector / np.linalg.norm(vector)


@covers("silhouette", of=("optical.eo", "optical.ir"))
@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir"])
def test_silhouettes_of_one_attitude(kind, tmp_path):
    """Sum of the bodies by hand; their union is less; its tables and meshes agree with it."""
    path = tmp_path / "areas.csv"
    nodes = [(azimuth, elevation) for azimuth in (0, 90, 180, 270) for elevation in (-90, 0, 90)]
    lines = ["az_deg,el_deg,area_m2", *(f"{az},{el},123" for az, el in nodes)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    band = {"optical.eo": "eo", "optical.ir": "ir"}[kind]
    bodies = {**AREAS, "silhouette_table": str(path)}
    if band == "ir":
        bodies["back_m2"] = bodies["front_m2"]  # a mesh has one shape
    targets = [{**target, band: bodies} for target in crooked.TARGETS]
    names = ("exact", "thesis", "convex_hull", "aspect_table", "sampled_table", "mesh")
    areas = {
        name: {key: area_m2(row) for key, row in seen(kind, targets, silhouette=name).items()}
        for name in names
    }
    for target in targets:
        name = target["name"]
        _, wing, floor = line_of_sight_in_target(target)
        exact = 4.0 + 20.0 * math.hypot(wing, floor) + 50.0 * abs(floor)
        assert areas["exact"][name] == pytest.approx(exact, rel=1e-6)
        assert areas["aspect_table"][name] == pytest.approx(123.0, rel=1e-6)
        # The hull of the bodies shows no more than their sum, and more than the largest of them.
        largest = max(20.0 * math.hypot(wing, floor), 50.0 * abs(floor))
        assert largest < areas["convex_hull"][name] < exact
        assert areas["sampled_table"][name] == pytest.approx(areas["convex_hull"][name], rel=0.05)
        assert areas["mesh"][name] == pytest.approx(areas["convex_hull"][name], rel=0.05)
        assert areas["thesis"][name] > 4.0
    assert areas["thesis"] != pytest.approx(areas["exact"], rel=0.02)
    assert areas["mesh"] != pytest.approx(areas["convex_hull"], rel=1e-9)
    assert areas["sampled_table"] != pytest.approx(areas["convex_hull"], rel=1e-9)


@covers("silhouette", of=("optical.projection",))
@covers("band", of=("optical.projection",))
@pytest.mark.parametrize(("band", "of", "contrast"), [("eo", AREAS, 0.6), ("ir", WARM, 0.25)])
def test_a_projection_counts_the_pixels_along_the_fuselage(band, of, contrast):
    """Radius by the front, length by the side, whatever silhouette and attitude."""
    radius = math.sqrt(of["front_m2"] / math.pi)
    length_m = of["side_m2"] / (2.0 * radius) + 2.0 * radius
    for silhouette in ("exact", "thesis", "convex_hull"):
        for row in seen("optical.projection", band=band, silhouette=silhouette).values():
            pixels = length_m / (row["true_range_m"] * PIXEL_RAD)
            assert row["pixels"] == pytest.approx(pixels, rel=1e-9)
            assert signature(row) == pytest.approx(0.3 * pixels * contrast)


@covers("model", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_auto_changes_nothing_and_says_so(kind):
    """No bound is proven for a camera: whatever [accuracy] allows, the silhouette stays."""
    accuracy = {"accuracy": {"angle_deg": 5.0, "range_m": 1000.0}}
    assert seen(kind, model="auto", sections=accuracy) == seen(kind, sections=accuracy)


@covers("false_alarms_per_frame", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_share_of_frames_brings_a_false_alarm_anywhere_in_the_picture(kind):
    view = {"azimuth_deg": [100, -150], "elevation_deg": [-70, -40], "scan_rate_hz": 400}
    found = alone(kind, **view, false_alarms_per_frame=0.3)
    alarms = rows(found, block="sensor", target=None)
    assert len(alarms) == pytest.approx(120, abs=45)
    # Of 400 frames with 0.3 each, exp(-0.3) bring none and 0.037 two or more.
    frames = np.bincount([row["scan"] for row in alarms], minlength=400)
    assert (frames == 0).sum() == pytest.approx(400 * math.exp(-0.3), abs=36)
    assert frames.max() > 1
    azimuth = np.degrees([row["azimuth_rad"] for row in alarms]) % 360.0
    elevation = np.degrees([row["elevation_rad"] for row in alarms])
    assert 100 <= azimuth.min() < 115 and 195 < azimuth.max() <= 210
    assert -70 <= elevation.min() < -66 and -44 < elevation.max() <= -40
    assert not rows(alone(kind, **view), block="sensor", target=None)


@covers("plume", of=("optical.ir",))
@covers("intruders.engine", of=("traffic.scripted",))
def test_an_exhaust_plume_is_seen_from_behind():
    """A share of the back by the engine, times (1 + cos off the nose) / 2."""
    shares = {"propeller": 0.0, "turbofan": 0.25, "turbojet": 1.0}
    for engine, share in shares.items():
        targets = [{**target, "engine": engine} for target in PAINTED]
        without, added = seen("optical.ir", targets), seen("optical.ir", targets, plume=True)
        for target in targets:
            nose = line_of_sight_in_target(target)[0]
            expected = share * WARM["back_m2"] * 0.5 * (1.0 + nose)
            name = target["name"]
            assert area_m2(added[name]) - area_m2(without[name]) == pytest.approx(
                expected, abs=1e-5
            )


def daylight(**keys) -> dict[str, float]:
    """Factor that daylight puts on each target's contrast."""
    plain, lit = seen("optical.eo"), seen("optical.eo", **keys)
    return {name: signature(lit[name]) / signature(plain[name]) for name in plain}


SUN = {"background": "auto", "sun_azimuth_deg": 290.0, "sun_elevation_deg": 35.0}


@covers("background", of=("optical.eo",))
def test_the_background_is_what_lies_behind_in_ned():
    """The climbing target is above the horizon, though below the plane of the wings."""
    assert (
        crooked.angles(crooked.ned(crooked.ROLLING))[1]
        > 0
        > crooked.angles(crooked.body(crooked.ROLLING))[1]
    )
    by = {name: daylight(**{**SUN, "background": name}) for name in ("auto", "sky", "ground")}
    assert by["auto"]["rolling"] == pytest.approx(by["sky"]["rolling"])
    assert by["auto"]["diving"] == pytest.approx(by["ground"]["diving"])
    for name in by["auto"]:
        assert by["sky"][name] != pytest.approx(by["ground"][name], rel=0.02)
    assert daylight(background="none", sun_azimuth_deg=10.0) == {"rolling": 1.0, "diving": 1.0}


@covers("sun_exclusion_deg", "sun_azimuth_deg", "sun_elevation_deg", of=("optical.eo",))
@pytest.mark.parametrize("away_deg", [3.0, -3.0])
def test_the_sun_blinds_within_its_cone_in_ned(away_deg):
    """The sun 3 deg beside or above a target: a cone of 2.9 deg leaves it, one of 3.1 does not."""
    azimuth, elevation = np.degrees(crooked.angles(crooked.ned(crooked.ROLLING)))
    assert elevation > 5.0
    beside = away_deg / math.cos(math.radians(elevation))
    for sun in (
        {"sun_azimuth_deg": azimuth, "sun_elevation_deg": elevation + away_deg},
        {"sun_azimuth_deg": azimuth + beside, "sun_elevation_deg": elevation},
    ):
        keys = {**SUN, **sun}
        assert daylight(**keys, sun_exclusion_deg=2.9)["rolling"] > 0.0
        assert daylight(**keys, sun_exclusion_deg=3.1)["rolling"] == pytest.approx(0.0, abs=1e-12)
        assert daylight(**keys, sun_exclusion_deg=3.1)["diving"] > 0.0


@covers("sky", "ground_reflectance", of=("optical.eo",))
@covers("intruders.paint_reflectance", of=("traffic.scripted",))
def test_skies_grounds_and_paints_give_other_contrasts():
    """Against ground as bright as the paint little is left; a sky without sun shows no side."""
    found = {sky: daylight(**SUN, sky=sky) for sky in ("clear", "partly_cloudy", "overcast")}
    for name in ("rolling", "diving"):
        values = [found[sky][name] for sky in found]
        assert len({round(value, 6) for value in values}) == 3
    grey = {"background": "ground", "sky": "overcast"}
    # Dark paint over dark and over bright ground: the brighter ground, the more contrast, up to 1.
    dark = [daylight(**SUN | grey, ground_reflectance=g)["diving"] for g in (0.1, 0.4, 0.9)]
    bright = [daylight(**SUN | grey, ground_reflectance=g)["rolling"] for g in (0.1, 0.4, 0.9)]
    assert dark[0] < dark[1] < dark[2] <= 1.0
    assert bright[0] > bright[1] > bright[2]


@covers("visibility_km", "fog_water_g_m3", "rain_rate_mm_h", of=("[weather]",))
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize(
    ("weather", "per_m"),
    [
        ({"visibility_km": 4.0}, 3.912 / 4000.0),
        ({"visibility_km": 4.0, "rain_rate_mm_h": 10.0}, 3.912 / 4000.0),
        # Marshall and Palmer's drops, π N0 Λ⁻³ with Λ = 4.1 R^-0.21 per mm.
        ({"rain_rate_mm_h": 10.0}, math.pi * 8000.0 / 4.1**3 * 1e-6 * 10.0**0.63),
        # Gultepe et al.: 1.002 km (LWC N)^-0.6473 with 200 droplets per cm³.
        ({"fog_water_g_m3": 0.02}, 3.912 / (1002.0 * (0.02 * 200.0) ** -0.6473)),
    ],
)
def test_contrast_falls_with_range_by_the_visibility(kind, weather, per_m):
    clear, hazy = seen(kind), seen(kind, sections={"weather": weather})
    for name, row in clear.items():
        left = signature(hazy[name]) / signature(row)
        assert left == pytest.approx(math.exp(-per_m * row["true_range_m"]), rel=1e-6)


@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir"])
def test_a_target_covers_no_more_pixels_than_there_are(kind):
    """Of 7 by 5 pixels over 2 by 1 deg: a picture of 70 by 35 m at 2 km."""
    azimuth, elevation = np.degrees(crooked.angles(crooked.body(crooked.DIVING)))
    view = {
        "azimuth_deg": [azimuth - 1.0, azimuth + 1.0],
        "elevation_deg": [elevation - 0.5, elevation + 0.5],
        "azimuth_pixels": 7,
        "elevation_pixels": 5,
    }
    large = {"front_m2": 1e4, "side_m2": 0.0, "horizontal_m2": 0.0}
    small = {"front_m2": 500.0, "side_m2": 0.0, "horizontal_m2": 0.0}
    range_m = float(np.linalg.norm(crooked.ned(crooked.DIVING)))
    picture_m2 = math.radians(2.0) * math.radians(1.0) * range_m**2
    for bodies, pixels in ((large, 35.0), (small, 35.0 * 500.0 / picture_m2)):
        back = {**bodies, "back_m2": bodies["front_m2"]}
        found = seen(kind, [{**crooked.DIVING, "eo": bodies, "ir": back}], **view)
        assert found["diving"]["pixels"] == pytest.approx(pixels, rel=1e-9)


def test_a_camera_that_sees_all_is_what_these_tests_start_from():
    assert SEES_ALL["azimuth_pixels"] * math.degrees(PIXEL_RAD) == pytest.approx(360.0)
    assert SEES_ALL["elevation_pixels"] * math.degrees(PIXEL_RAD) == pytest.approx(180.0)
