"""What each key of optical.eo does to pictures, in crooked flight."""

import crooked
import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run

AREAS = {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 50.0}
TARGETS = [{**target, "eo": AREAS, "contrast": 0.6, "paint_reflectance": paint}
           for target, paint in zip(crooked.TARGETS, (0.9, 0.05), strict=True)]  # fmt: skip
CAMERA = {
    "type": "optical.image", "scan_rate_hz": 1, "azimuth_deg": [-60, 60],
    "elevation_deg": [-40, 40], "azimuth_pixels": 5000, "elevation_pixels": 4000,
    "threshold": 0.2, "noise_equivalent_contrast": 0.005,
}  # fmt: skip
OF = ("optical.image",)
NAMES = {target["name"] for target in TARGETS}


def recorded(duration_s=1, sections=None, **keys):
    scene = chain({"sensor": {**CAMERA, **keys}}, targets=TARGETS, duration_s=duration_s,
                  **(sections or {}))  # fmt: skip
    return run(scene)


def seen(**keys):
    return {row["target"]: row for row in rows(recorded(**keys), scan=0)}


def strength(**keys):
    """How far each target stands out; nothing where it is not detected."""
    return {name: row["snr"] for name, row in seen(**keys).items()}


@covers("enabled", "range_km", "azimuth_deg", "elevation_deg", of=OF)
def test_reach():
    assert set(seen()) == NAMES and not seen(enabled=False)
    far = {t["name"]: float(np.linalg.norm(crooked.body(t, 0.0))) for t in TARGETS}
    near, other = sorted(far, key=far.__getitem__)
    assert set(seen(range_km=(far[near] + far[other]) / 2000.0)) == {near}
    for target in TARGETS:
        azimuth, elevation = np.degrees(crooked.angles(crooked.body(target, 0.0)))
        assert set(seen(azimuth_deg=[azimuth - 2.0, azimuth + 3.0])) == {target["name"]}
        assert set(seen(elevation_deg=[elevation - 2.0, elevation + 3.0])) == {target["name"]}


@covers("scan_rate_hz", "offset_s", "rate_error_ppm", "jitter_s", of=OF)
def test_clocks():
    def times(**keys):
        return [row["time_s"] for row in rows(recorded(**keys), "scans")]

    np.testing.assert_allclose(times(scan_rate_hz=4, offset_s=0.1), 0.1 + np.arange(4) / 4)
    np.testing.assert_allclose(times(scan_rate_hz=4, rate_error_ppm=250_000), np.arange(5) / 5)
    found = np.array(times(scan_rate_hz=20, jitter_s=0.004))
    assert np.std(found[1:] - np.arange(1, len(found)) / 20) == pytest.approx(0.004, rel=0.5)


@covers("azimuth_pixels", "elevation_pixels", of=OF)
def test_pixels_count_the_frame():
    plain, wide, high = seen(), seen(azimuth_pixels=10_000), seen(elevation_pixels=2000)
    for name, row in plain.items():
        assert wide[name]["true_column_px"] == pytest.approx(2.0 * row["true_column_px"])
        assert wide[name]["true_row_px"] == pytest.approx(row["true_row_px"])
        assert high[name]["true_row_px"] == pytest.approx(0.5 * row["true_row_px"])


@covers("mount_azimuth_deg", "mount_elevation_deg", "mount_roll_deg", "misalignment_deg", of=OF)
@pytest.mark.parametrize(
    "keys",
    [{"mount_azimuth_deg": 5.0}, {"mount_elevation_deg": -4.0}, {"mount_roll_deg": 20.0},
     {"misalignment_deg": [2.0, -1.0, 3.0]}],
)  # fmt: skip
def test_mountings_turn_the_picture(keys):
    """The place in the picture moves; what is reported in body axes only by a misalignment."""
    plain, turned = seen(), seen(**keys)
    for name in set(plain) & set(turned):
        one, other = plain[name], turned[name]
        moved = np.hypot(*(other[f"true_{a}_px"] - one[f"true_{a}_px"] for a in ("column", "row")))
        assert (moved > 20.0) != ("misalignment_deg" in keys)
        away = np.hypot(*(other[f"{a}_rad"] - one[f"{a}_rad"] for a in ("azimuth", "elevation")))
        assert (away > 0.01) == ("misalignment_deg" in keys)
    assert turned


@covers("noise_equivalent_contrast", "blur_pixels", "threshold", "static_weight", of=OF)
def test_noise_blur_and_threshold():
    plain = strength()
    for name, twice in strength(noise_equivalent_contrast=0.01).items():
        assert twice == pytest.approx(0.5 * plain[name], rel=0.1)
    blurred = strength(blur_pixels=1.5)
    assert all(blurred[name] < plain[name] for name in blurred)
    # In signature: the weight of a pixel scales it, and the noise with it.
    confidence = {name: row["confidence"] for name, row in seen().items()}
    for name, row in seen(static_weight=0.9, threshold=0.6).items():
        assert row["confidence"] == pytest.approx(3.0 * confidence[name], rel=1e-6)
    strongest = max(confidence, key=confidence.__getitem__)
    middle = 0.2 + np.mean(list(confidence.values()))
    assert set(seen(threshold=float(middle))) == {strongest}


@covers("background", "sky", "ground_reflectance", "sun_azimuth_deg", "sun_elevation_deg",
        "sun_exclusion_deg", of=OF)  # fmt: skip
def test_daylight():
    def daylight(**keys):
        return strength(background="auto", **keys)

    plain = daylight()
    assert plain != strength()
    for keys in ({"sky": "overcast"}, {"ground_reflectance": 0.6}, {"sun_azimuth_deg": 20.0},
                 {"sun_elevation_deg": 10.0}):  # fmt: skip
        assert daylight(**keys) != plain, keys
    target = crooked.ROLLING
    azimuth, elevation = np.degrees(crooked.angles(crooked.ned(target)))
    sun = {"sun_azimuth_deg": float(azimuth), "sun_elevation_deg": float(elevation) + 3.0}
    lit = daylight(**sun, sun_exclusion_deg=2.9)
    assert set(daylight(**sun, sun_exclusion_deg=3.1)) == set(lit) - {target["name"]}


@covers("errors", "quantised", "biases", "azimuth_error_deg", "azimuth_bias_deg",
        "azimuth_correlation_time_s", "elevation_error_deg", "elevation_bias_deg",
        "elevation_correlation_time_s", "azimuth_resolution_deg", "elevation_resolution_deg",
        of=OF)  # fmt: skip
def test_errors_that_the_scene_adds():
    """Of each angle its own."""
    angles, size = ("azimuth", "elevation"), np.array([[1.0], [0.6]])

    def both(key):
        return {f"{angle}_{key}": float(of[0]) for angle, of in zip(angles, size, strict=True)}

    def off(**keys):
        found = rows(recorded(errors="stated", scan_rate_hz=40, quantised=False, **keys))
        return np.degrees([[row[f"{angle}_rad"] - row[f"true_{angle}_rad"] for row in found
                            if row["target"] == "rolling"] for angle in angles])  # fmt: skip

    plain = off()
    biased = (off(**both("bias_deg"), biases="fixed") - plain) / size
    assert biased == pytest.approx(np.ones(biased.shape), abs=1e-6)
    drawn = (off(**both("bias_deg"), biases="drawn") - plain) / size
    assert np.ptp(drawn, axis=1).max() < 2e-6 and np.abs(drawn[:, 0]).max() < 0.999
    erring = (off(**both("error_deg")) - plain) / size
    assert np.std(erring, axis=1) == pytest.approx([1.0, 1.0], rel=0.35)
    lasting = {f"{angle}_correlation_time_s": 100.0 for angle in angles}
    assert np.std((off(**both("error_deg"), **lasting) - plain) / size, axis=1).max() < 0.3
    steps = both("resolution_deg")
    grid = rows(recorded(errors="grid", **steps))
    fine = rows(recorded(errors="stated", quantised=False, **steps))
    for angle in angles:
        step = np.radians(steps[f"{angle}_resolution_deg"])
        assert all(row[f"{angle}_rad"] / step == pytest.approx(round(row[f"{angle}_rad"] / step))
                   for row in grid)  # fmt: skip
        assert any(abs(row[f"{angle}_rad"] / step - round(row[f"{angle}_rad"] / step)) > 0.01
                   for row in fine)  # fmt: skip


@covers("false_alarms", "false_alarms_per_frame", "marked_false_alarms", of=OF)
def test_false_alarms():
    keys = {"scan_rate_hz": 100, "threshold": None, "range_km": 0.1}
    keys = {name: value for name, value in keys.items() if value is not None}

    def alarms(**more):
        camera = {**CAMERA, **keys, **more}
        camera.pop("threshold")
        found = run(chain({"sensor": camera}, targets=TARGETS, duration_s=2))
        return rows(found), rows(found, target=None)

    _, many = alarms(false_alarms_per_frame=0.3)
    assert len(many) == pytest.approx(60, abs=30)
    assert not alarms(false_alarms_per_frame=0.3, false_alarms=False)[1]
    every, marked = alarms(false_alarms_per_frame=0.3, marked_false_alarms=False)
    assert len(every) == pytest.approx(60, abs=30) and len(marked) < len(every) + 1


@covers("declare_m", "declare_n", of=OF)
def test_declarations():
    found = rows(recorded(duration_s=4, declare_m=3, declare_n=3), target="rolling")
    assert [row["declared"] for row in found[:4]] == [False, False, True, True]


@covers("silhouette", of=OF)
def test_silhouettes_show_in_the_picture():
    hull, thesis = seen(), seen(silhouette="thesis")
    assert any(thesis[name]["snr"] != hull[name]["snr"] for name in hull)


def test_a_near_target_is_reported_where_its_middle_is():
    """From 390 to 60 m, up to 12,000 pixels: off by no more than a hundredth of its size."""
    level = {"lat_deg": -33.9, "lon_deg": 18.4, "alt_m": 900.0, "heading_deg": 217.0,
             "speed_mps": 60.0}  # fmt: skip
    target = {"name": "near", "north_m": -328.0, "east_m": -228.0, "up_m": -10.0, "roll_deg": -30.0,
              "heading_deg": 130.0, "speed_mps": 1.0,
              "eo": {"front_m2": 9.4, "side_m2": 10.3, "horizontal_m2": 33.6}}  # fmt: skip
    camera = {"type": "optical.image", "scan_rate_hz": 5, "azimuth_deg": [-40, 40],
              "elevation_deg": [-20, 20], "azimuth_pixels": 2048,
              "elevation_pixels": 1024}  # fmt: skip
    found = rows(run(chain({"s": camera}, ownship=level, targets=[target], duration_s=5.6)))
    assert len(found) > 25 and found[-1]["pixels"] > 8000
    for row in found:
        off = [row[f"{a}_px"] - row[f"true_{a}_px"] for a in ("column", "row")]
        assert np.hypot(*off) < 0.6 + 0.01 * np.sqrt(row["pixels"])
