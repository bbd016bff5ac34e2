"""An infrared camera's own air, and cameras in the dark, in scenes."""

import math

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, first_look, rows, run, sensor

VISIBLE_UM, MIDDLE_UM = 0.55, {"mwir": 4.0, "lwir": 10.0}


def transmissions(camera, **weather):
    """The share of contrast that is left for each target, from what the camera records."""
    scene = chain({"ir": {**camera, "threshold": -1.0}}, weather=weather)
    a = camera.get("static_weight", 0.3)
    return {
        name: (row["confidence"] - 1.0) / (a * row["pixels"])
        for name, row in first_look(scene, "ir").items()
    }


def path(target):
    own = crooked.geodetic(crooked.position(crooked.OWNSHIP))
    other = crooked.geodetic(crooked.position(target))
    return float(np.linalg.norm(crooked.ned(target))), own[2], other[2]


def clear_air(band, target, density):
    """By sums over 200 pieces of the path and 200 wavelengths."""
    range_m, own, other = path(target)
    h = own + (other - own) * (np.arange(200)[:, None] + 0.5) / 200
    vapour = density * np.exp(-h / 2000)
    if band == "mwir":
        water = float(vapour.mean()) * range_m / 1000
        return 0.65 * 0.827 * (0.26 / water) ** 0.095 + 0.35 * 0.784 * (0.165 / water) ** 0.122
    kelvin = 288.15 - 6.5e-3 * h
    total = (kelvin / 288.15) ** 5.2559
    per_cm = 1e4 / (8 + 4 * (np.arange(200)[None, :] + 0.5) / 200)
    strength = 4.18 + 5578 * np.exp(-7.87e-3 * per_cm)
    strength = strength * np.exp(1800 * (1 / kelvin - 1 / 296))
    e = vapour * kelvin / 216.7 / 1013.25
    depth = (strength * 0.1 * vapour * (e + 0.002 * (total - e))).mean(axis=0)
    return float(np.exp(-depth * range_m / 1e3).mean())


@covers("extinction_band", of=("optical.ir",))
@covers("vapour_density_g_m3", of=("[weather]",))
@pytest.mark.parametrize("band", ["mwir", "lwir"])
@pytest.mark.parametrize("density", [3.0, 20.0])
def test_clear_air_takes_its_share_by_its_humidity(band, density):
    found = transmissions(sensor("optical.ir", extinction_band=band), vapour_density_g_m3=density)
    assert set(found) == {"rolling", "diving"}
    for target in crooked.TARGETS:
        expected = clear_air(band, target, density)
        assert found[target["name"]] == pytest.approx(expected, rel=3e-3)
    visible = transmissions(sensor("optical.ir"), vapour_density_g_m3=density)
    assert visible["rolling"] == pytest.approx(1.0)


@covers("extinction_band", of=("optical.ir",))
@pytest.mark.parametrize("band", ["mwir", "lwir"])
def test_haze_takes_less_than_of_visible_light_and_rain_as_much(band):
    camera = sensor("optical.ir", extinction_band=band)
    range_m = path(crooked.ROLLING)[0]
    dry = transmissions(camera, vapour_density_g_m3=0.0)["rolling"]
    hazy = transmissions(camera, vapour_density_g_m3=0.0, visibility_km=8.0)["rolling"]
    share = (MIDDLE_UM[band] / VISIBLE_UM) ** -1.3
    assert hazy / dry == pytest.approx(math.exp(-3.912 / 8000 * share * range_m), rel=1e-6)
    rain = 3.65e-4 * 10.0**0.63
    wet = transmissions(camera, vapour_density_g_m3=0.0, rain_rate_mm_h=10.0)["rolling"]
    assert wet / dry == pytest.approx(math.exp(-rain * range_m), rel=5e-3)
    # A stated visibility is that of all together: in 2 km of rain there is little haze left.
    both = transmissions(camera, vapour_density_g_m3=0.0, visibility_km=1.8, rain_rate_mm_h=10.0)
    haze = 3.912 / 1800 - rain
    q = 0.16 * 3.912 / haze / 1000 + 0.34
    if 3.912 / haze > 6000:
        q = 1.3
    expected = math.exp(-(rain + haze * (MIDDLE_UM[band] / VISIBLE_UM) ** -q) * range_m)
    assert both["rolling"] / dry == pytest.approx(expected, rel=2e-2)
    thick = transmissions(camera, vapour_density_g_m3=0.0, fog_water_g_m3=0.3)["rolling"]
    light = transmissions(sensor("optical.ir"), fog_water_g_m3=0.3)["rolling"]
    assert thick / dry == pytest.approx(light, rel=1e-6)


@covers("night", of=("[weather]",))
def test_at_night_cameras_for_visible_light_see_nothing():
    cameras = {
        "eo": sensor("optical.eo"),
        "line": sensor("optical.projection"),
        "ir": sensor("optical.ir"),
        "warm_line": sensor("optical.projection", band="ir"),
    }

    def seeing(**weather):
        return {row["block"] for row in rows(run(chain(cameras, weather=weather)))}

    assert seeing() == set(cameras)
    assert seeing(night=True) == {"ir", "warm_line"}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"extinction_band": "swir"}, "extinction_band.*'visible', 'mwir' or 'lwir'"),
        ({"extinction_band": 4}, "extinction_band"),
    ],
)
def test_a_band_that_there_is_not_is_named(changes, says):
    from dsa_des.errors import SceneError

    with pytest.raises(SceneError, match=says) as caught:
        run(chain({"ir": sensor("optical.ir", **changes)}))
    assert len(caught.value.problems) == 1
