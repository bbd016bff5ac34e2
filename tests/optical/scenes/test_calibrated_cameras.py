"""A camera's Pd is that of Gaussian noise at its threshold, and so are its false alarms."""

import math

import crooked
import numpy as np
import pytest
from covering import CAMERAS, covers
from scipy.stats import norm
from wired import chain, rows, run, sensor

import dsa_des
from dsa_des.errors import SceneError

PIXEL_RAD = math.radians(0.01)
#: A point's picture takes so many pixels, with a blur of half a pixel: 4 pi (1/4 + 1/12).
SPOT = 4.0 * math.pi / 3.0
FRAME = 36000 * 18000 / SPOT
OPEN = {"threshold": None, "noise_equivalent_contrast": None}
AREAS = {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 50.0}
CRAFT = {"eo": AREAS, "ir": {**AREAS, "back_m2": 9.0}, "contrast": 0.6, "contrast_ir": 0.25}
CONTRAST = {"optical.eo": 0.6, "optical.ir": 0.25, "optical.projection": 0.6}
TARGETS = [{**target, **CRAFT} for target in crooked.TARGETS]


def used(kind: str, targets=TARGETS, **keys) -> dict[str, float]:
    scene = chain({"sensor": sensor(kind, **{**OPEN, **keys})}, targets=targets)
    return run(scene).summary["cameras"]["sensor"]


def filtered(pixels, spot: float = SPOT):
    """Pixels of a point that stand out as much: a filter of N pixels lets in the noise of each."""
    return pixels * np.sqrt(spot / (spot + pixels))


def noise_of(contrast: float, weight: float = 0.3, spot: float = SPOT) -> float:
    return weight * contrast * math.sqrt(spot)


@covers("noise_equivalent_contrast", "threshold", "blur_pixels", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_looks_detect_as_often_as_noise_lets_signatures_reach_the_threshold(kind):
    """Two cameras of other thresholds and noise, banked, in the south; 4,000 looks of each."""
    found = rows(run(chain({"s": sensor(kind)}, targets=TARGETS)), scan=0)
    pixels = np.array([row["pixels"] for row in found])
    cameras = {}
    for name, share, noise, blur in (("low", 0.9, 0.3, 0.8), ("high", 1.2, 0.4, 0.5)):
        spot = 4.0 * math.pi * (blur**2 + 1.0 / 12.0)
        middle = math.sqrt(np.prod(0.3 * CONTRAST[kind] * filtered(pixels, spot)))
        cameras[name] = {"threshold": share * middle, "contrast": noise * middle,
                         "blur_pixels": blur}  # fmt: skip
    sensors = {
        name: sensor(kind, scan_rate_hz=1000, threshold=keys["threshold"],
                     noise_equivalent_contrast=keys["contrast"], blur_pixels=keys["blur_pixels"],
                     false_alarms=False)
        for name, keys in cameras.items()
    }  # fmt: skip
    scene = chain(sensors, targets=TARGETS, duration_s=2, record={"looks": True})
    found = run(scene)
    for name, keys in cameras.items():
        looks = rows(found, "looks", block=name)
        spot = 4.0 * math.pi * (keys["blur_pixels"] ** 2 + 1.0 / 12.0)
        deviation = noise_of(keys["contrast"], spot=spot)
        pixels = np.array([row["pixels"] for row in looks])
        signature = 0.3 * CONTRAST[kind] * filtered(pixels, spot)
        pd = norm.cdf((signature - keys["threshold"]) / deviation)
        said = np.array([row["detection_probability"] for row in looks])
        np.testing.assert_allclose(said, pd, rtol=1e-10)
        assert pd.max() - pd.min() > 0.05
        detected = np.array([row["detected"] for row in looks])
        spread = math.sqrt((pd * (1.0 - pd)).sum())
        assert len(pd) == 4000 and abs(detected.sum() - pd.sum()) < 3.3 * spread
        # What is measured follows the one sample that decided: a Gaussian beyond the threshold.
        seen = rows(found, block=name)
        assert len(seen) == detected.sum()
        margin = np.array([row["confidence"] for row in seen])
        share = norm.sf((keys["threshold"] + margin - signature[detected]) / deviation)
        assert (margin >= 0.0).all()
        uniform = share / pd[detected]
        assert abs(uniform.mean() - 0.5) < 3.3 / math.sqrt(12 * len(uniform))
        measured = np.array([row["pixels"] for row in seen])
        assert filtered(measured, spot) == pytest.approx(
            (margin + keys["threshold"]) / 0.3, rel=1e-9
        )


@covers("false_alarms_per_frame", "false_alarms", of=CAMERAS)
@pytest.mark.parametrize("kind", CAMERAS)
def test_any_two_of_threshold_noise_and_false_alarms_say_the_third(kind):
    deviation = noise_of(0.2)
    pair = used(kind, threshold=0.5, noise_equivalent_contrast=0.2)
    assert pair["noise"] == pytest.approx(deviation)
    assert pair["false_alarms_per_frame"] == pytest.approx(FRAME * norm.sf(0.5 / deviation), 1e-6)
    rate = used(kind, noise_equivalent_contrast=0.2, false_alarms_per_frame=0.02)
    assert rate["threshold"] == pytest.approx(deviation * norm.isf(0.02 / FRAME))
    level = used(kind, threshold=0.5, false_alarms_per_frame=0.02)
    assert level["noise"] == pytest.approx(0.5 / norm.isf(0.02 / FRAME))
    # Without a word: threshold 1, and AFRL's 0.01 % of frames.
    silent = used(kind)
    assert silent["threshold"] == 1.0
    assert silent["noise"] == pytest.approx(1.0 / norm.isf(1e-4 / FRAME))
    # Lower thresholds bring more of them; that many are reported where they are asked for.
    keys = {"noise_equivalent_contrast": 0.2, "scan_rate_hz": 500, "static_weight": 0.5}
    deviation = noise_of(0.2, weight=0.5)
    for crossed in (5.2, 5.6):
        camera = sensor(kind, threshold=crossed * deviation, false_alarms=True, **keys)
        alarms = rows(run(chain({"s": camera}, targets=TARGETS)), target=None)
        expected = 500 * FRAME * norm.sf(crossed)
        assert abs(len(alarms) - expected) < 3.3 * math.sqrt(expected)
        camera["false_alarms"] = False
        assert not rows(run(chain({"s": camera}, targets=TARGETS)), target=None)


def abeam(kind: str, aspect_deg: float) -> float:
    """Area of the bodies added, level: from the front to the back, the side by the sine; a line."""
    if kind == "optical.projection":
        radius = math.sqrt(4.0 / math.pi)
        return 20.0 / (2.0 * radius) + 2.0 * radius
    ends = 4.0
    if kind == "optical.ir":
        tail = 0.5 - 0.5 * math.cos(math.radians(aspect_deg))
        ends = 4.0 * (1.0 - tail) + 9.0 * tail
    return ends + 20.0 * abs(math.sin(math.radians(aspect_deg)))


# What a laser hits of it: a surface, or a wire.
HIT = {
    60.0: {"area_m2": 3.0},
    180.0: {"wire_diameter_mm": 9.0, "wire_length_m": 4.0, "wire_direction_deg": 30.0,
            "wire_slope_deg": 5.0},
}  # fmt: skip
CALIBRATE = [f"calibrate.{key}" for key in ("range_km", "pd", "area_m2", "aspect_deg", "contrast",
                                            "visibility_km")]  # fmt: skip
CRAFT_KEYS = [
    "calibrate.aircraft." + key
    for key in (
        "rcs_dbsm", "rcs_table", "swerling", "contrast", "contrast_ir", "paint_reflectance",
        "engine", *(f"{band}.{key}" for band in ("eo", "ir") for key in AREAS), "ir.back_m2",
        "eo.silhouette_table", "ir.silhouette_table", "eo.made_for", "ir.made_for",
        *(f"laser.{key}" for key in ("reflectivity", *HIT[60.0], *HIT[180.0])),
    )
]  # fmt: skip


@covers(*CALIBRATE, *CRAFT_KEYS, of=CAMERAS)
@pytest.mark.parametrize("aspect_deg", [60.0, 180.0])
@pytest.mark.parametrize("kind", CAMERAS)
def test_a_known_range_gives_noise_or_threshold(kind, aspect_deg, tmp_path):
    """Pd 0.9 of an aircraft at 2 km in 5 km of visibility; and as well of the area that shows.

    What a file of an aircraft says for other sensors is taken, and changes nothing.
    """
    path = tmp_path / "area.csv"
    nodes = [(az, el) for az in range(0, 360, 30) for el in range(-90, 91, 30)]
    lines = [f"{az},{el},{33.0 if az < 100 else 44.0}" for az, el in nodes]
    path.write_text("\n".join(["az_deg,el_deg,area_m2", *lines]) + "\n", encoding="utf-8")
    tables = {
        band: {**CRAFT[band], "silhouette_table": str(path), "made_for": "convex_hull"}
        for band in ("eo", "ir")
    }
    other = {**CRAFT, **tables, "rcs_dbsm": 40.0, "swerling": 3, "engine": "turbojet",
             "paint_reflectance": 0.9,
             "laser": {"reflectivity": 0.7, **HIT[aspect_deg]}}  # fmt: skip
    size = abeam(kind, aspect_deg)
    pixels = size / (2000.0 * PIXEL_RAD) ** (1 if kind == "optical.projection" else 2)
    left = math.exp(-3.912 * 2.0 / 5.0)
    known = {"aircraft": other, "aspect_deg": aspect_deg, "range_km": 2.0, "pd": 0.9}
    hazy = {**known, "visibility_km": 5.0}
    signature = 0.3 * filtered(pixels) * CONTRAST[kind] * left
    apart = norm.isf(0.1)
    for keys, noise, threshold in (
        ({"threshold": 0.9 * signature}, 0.1 * signature / apart, 0.9 * signature),
        ({"noise_equivalent_contrast": 0.02}, noise_of(0.02), signature - apart * noise_of(0.02)),
        ({}, signature / (norm.isf(1e-4 / FRAME) + apart), None),
        ({"false_alarms_per_frame": 2.0}, signature / (norm.isf(2.0 / FRAME) + apart), None),
    ):
        found = used(kind, calibrate=hazy, **keys)
        assert found["noise"] == pytest.approx(noise, rel=1e-6)
        assert found["threshold"] == pytest.approx(
            signature - apart * noise if threshold is None else threshold, rel=1e-6
        )
    clear = used(kind, calibrate={**known, "contrast": 0.5}, noise_equivalent_contrast=0.02)
    assert clear["threshold"] == pytest.approx(
        0.3 * filtered(pixels) * 0.5 - apart * noise_of(0.02)
    )
    if kind == "optical.projection":
        return
    shown = {"area_m2": size, "contrast": CONTRAST[kind], **hazy}
    del shown["aircraft"], shown["aspect_deg"]
    assert used(kind, calibrate=shown) == pytest.approx(used(kind, calibrate=hazy), rel=1e-12)
    targets = [{**target, **tables} for target in TARGETS]
    tabulated = used(kind, targets, calibrate=hazy, silhouette="aspect_table")
    area = 33.0 if aspect_deg < 100.0 else 44.0
    assert tabulated["noise"] / used(kind, calibrate=hazy)["noise"] == pytest.approx(
        filtered(pixels * area / size) / filtered(pixels), rel=1e-6
    )


def test_a_calibrated_camera_sees_that_aircraft_there_as_often():
    """The aircraft abeam at 2 km in 5 km of visibility, in the scene: nine looks of ten."""
    craft = {**CRAFT, "name": "beam", "north_m": 2000.0, "east_m": 0.0, "up_m": 0.0,
             "heading_deg": 90.0, "speed_mps": 0.1}  # fmt: skip
    level = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 900.0}
    known = {"aircraft": CRAFT, "aspect_deg": 90, "range_km": 2.0, "visibility_km": 5.0, "pd": 0.9}
    eye = sensor("optical.eo", **OPEN, calibrate=known, scan_rate_hz=500)
    scene = chain({"eye": eye}, ownship=level, targets=[craft], duration_s=8,
                  weather={"visibility_km": 5.0})  # fmt: skip
    assert abs(len(rows(run(scene))) - 3600) < 3.3 * math.sqrt(4000 * 0.9 * 0.1)


@pytest.mark.parametrize("kind", CAMERAS)
def test_who_is_too_faint_is_left_out_to_the_bit(kind):
    """A target just inside and one just outside of what is looked at, at a Pd of about 1e-6."""
    found = {row["target"]: row for row in rows(run(chain({"s": sensor(kind)}, targets=TARGETS)))}
    weakest = min(0.3 * filtered(row["pixels"]) * CONTRAST[kind] for row in found.values())
    for threshold in (1.5 * weakest, 5.0 * weakest):
        camera = sensor(kind, threshold=threshold, noise_equivalent_contrast=None, scan_rate_hz=200)
        scene = chain({"s": camera}, targets=TARGETS, record={"looks": True})
        some, every = run(scene), dsa_des.run(scene, simulate_everything=True)
        assert some.detections.equals(every.detections)
        faint = [row for row in rows(every, "looks") if row["detection_probability"] == 0.0]
        deviation = threshold / norm.isf(1e-4 / FRAME)
        for row in rows(every, "looks"):
            signature = 0.3 * CONTRAST[kind] * filtered(row["pixels"])
            pd = norm.sf((threshold - signature) / deviation)
            assert (row["detection_probability"] == 0.0) == (pd < 1e-6)
            assert not (row["detected"] and pd < 1e-6)
        assert bool(faint) == (threshold > 4.0 * weakest)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"calibrate": {"range_km": 2.0, "pd": 0.9}}, "exactly one of area_m2 and aircraft"),
        ({"calibrate": {"range_km": 2.0, "pd": 0.9, "area_m2": 9.0, "aspect_deg": 9.0}},
         "aspect_deg belongs to an aircraft"),
        ({"calibrate": {"range_km": 200.0, "pd": 0.9, "area_m2": 9.0}, "threshold": 1.0},
         "no noise gives that"),
        ({"calibrate": {"range_km": 200.0, "pd": 0.9, "area_m2": 9.0},
          "noise_equivalent_contrast": 0.3}, "calibrate needs a threshold of -"),
        ({"calibrate": {"range_km": 2.0, "pd": 1e-14, "area_m2": 9.0}}, "calibrate.pd is 1e-14"),
        ({"false_alarms_per_frame": 0.5, "azimuth_pixels": 2, "elevation_pixels": 2},
         "false_alarms_per_frame is 0.5: it must be below 0.5"),
        ({"noise_equivalent_contrast": 0.3, "false_alarms_per_frame": 0.0},
         "false_alarms_per_frame is 0: no threshold is that high"),
        ({"noise_equivalent_contrast": 9.0, "threshold": 1.0}, "false alarms per frame"),
        ({"errors": "signal", "threshold": -1.0}, "noise_equivalent_contrast is not given"),
        ({"noise_equivalent_contrast": 0.0, "calibrate": {"range_km": 2.0, "pd": 0.9,
          "area_m2": 9.0}}, "without noise calibrate has no Pd"),
        ({"extinction_band": "mwir", "calibrate": {"range_km": 2.0, "pd": 0.9, "area_m2": 9.0,
          "visibility_km": 3.0}}, "calibrate.visibility_km is given and extinction_band is 'mwir'"),
    ],
)  # fmt: skip
def test_what_no_camera_can_be_is_one_clear_error(keys, said):
    with pytest.raises(SceneError) as caught:
        used("optical.ir", **keys)
    assert said in str(caught.value)
