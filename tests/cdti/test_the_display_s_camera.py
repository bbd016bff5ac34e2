"""The camera's picture beside the display is of the chosen contact, as it flies now."""

import math
from types import SimpleNamespace

import crooked
import numpy as np
import pytest
from displayed import displayed
from wired import SEES_ALL, chain

from components.cdti.camera import CameraSights
from components.optical.sensors import ElectroOptical

EO = {"front_m2": 6.0, "side_m2": 22.0, "horizontal_m2": 40.0}
IR = {"front_m2": 2.0, "side_m2": 5.0, "back_m2": 2.0, "horizontal_m2": 12.0}
#: High above, its picture is that of the second camera.
ROLLING = {**crooked.ROLLING, "eo": EO, "ir": IR, "contrast": 0.21, "contrast_ir": 0.64}
#: Turns left by 5 deg every second, far to the left of the nose, just over the horizon.
TURNING = {"name": "turning", "east_m": 1500.0, "north_m": -2300.0, "up_m": -38.0,
           "heading_deg": 290.0, "speed_mps": 65.0, "legs": [{"kind": "turn", "rate_deg_s": -5.0}],
           "eo": EO, "ir": IR, "contrast": 0.37, "contrast_ir": 0.88}  # fmt: skip
BELOW = {**crooked.DIVING, "eo": EO, "contrast": 0.55}
TARGETS = {"below": BELOW, "turning": TURNING, "rolling": ROLLING}
RADAR = {
    "type": "radar.range_boundary", "scan_rate_hz": 2, "range_km": 12.0, "errors": "stated",
    "quantised": False, "azimuth_error_deg": 0.1, "elevation_error_deg": 0.1, "range_error_m": 5.0,
}  # fmt: skip
#: The second sees what is to the right of the nose alone, and sees it later.
CAMERAS = {
    "eye": {**SEES_ALL, "offset_s": 0.2},
    "again": {**SEES_ALL, "type": "optical.ir", "offset_s": 0.6, "azimuth_deg": [20.0, 50.0],
              "azimuth_pixels": 4500},
}  # fmt: skip
PIXEL_RAD = {"eye": np.radians([0.01, 0.01]), "again": np.radians([30 / 4500, 0.01])}
DURATION_S = 4.0
#: The last instant at which anybody looks.
LAST_S = 3.6


@pytest.fixture(scope="module", params=["tracking.ekf", "tracking.stub"])
def seen(request):
    """The display at the end, the contact of each target, and the detections by camera."""
    ekf = request.param == "tracking.ekf"
    scene = chain(
        {"radar": RADAR, **CAMERAS}, targets=[{**t, "name": n} for n, t in TARGETS.items()],
        duration_s=DURATION_S, tracker={"type": request.param},
        fusion={"type": "fusion.pass_through" if ekf else "fusion.pick_best"},
    )  # fmt: skip
    scope, recorded = displayed(scene)
    contact = {}
    for number, _, _, _, bearing, *_ in scope.page_content(DURATION_S)["contacts"]:
        off = {n: abs(bearing_deg(t) - bearing) for n, t in TARGETS.items()}
        contact.setdefault(min(off, key=off.get), number)
    assert set(contact) == set(TARGETS)
    found = {(r["block"], r["target"]): r for r in recorded["detections"]}
    return scope, contact, found


def bearing_deg(target):
    return math.degrees(math.atan2(target["east_m"], target["north_m"])) % 360.0


def attitude(name):
    """Of the turning one, that of a coordinated turn for so long."""
    if name != "turning":
        return crooked.attitude(TARGETS[name])
    bank_deg = math.degrees(math.atan(65.0 * math.radians(-5.0) / 9.80665))
    return crooked.rotation(290.0 - 5.0 * LAST_S, 0.0, bank_deg)


def test_the_newest_picture_of_the_chosen_contact_is_shown(seen):
    scope, contact, found = seen
    for name, sensor in (("turning", "eye"), ("rolling", "again"), ("below", "eye")):
        shown = scope.camera_picture(scope.page_content(DURATION_S), DURATION_S, contact[name])
        detected = found[sensor, name]
        assert (shown["target"], shown["sensor"]) == (contact[name], sensor)
        assert shown["age"] == pytest.approx(DURATION_S - detected["time_s"], abs=0.006)
        assert shown["pixels"] == pytest.approx(detected["pixels"], abs=0.06)
        key = "contrast_ir" if sensor == "again" else "contrast"
        assert shown["contrast"] == pytest.approx(TARGETS[name][key], abs=6e-4)
        digits = {"age": 2, "pixels": 1, "contrast": 3, "horizon": 1, "tilt": 2}
        assert all(shown[part] == round(shown[part], count) for part, count in digits.items())


def test_only_a_camera_s_detections_with_their_pixels_are_pictures():
    """What another block says is none, though it says pixels; nor what a camera says without."""
    one = np.ones(1)
    message = SimpleNamespace(
        extras={"pixels": one}, roster=["a"], target=np.array([0]), azimuth_rad=one,
        elevation_rad=one, true_range_m=one, confidence=one, measured_ticks=lambda: one,
    )  # fmt: skip
    sights = CameraSights({"eye": object.__new__(ElectroOptical), "other": object()})
    sights.states = SimpleNamespace(columns=np.array([0]))
    sights.store_detections("other", message, 10)
    assert sights.picture_of_contact(0, None, 1.0, None) is None
    sights.store_detections("eye", SimpleNamespace(**{**vars(message), "extras": {}}), 10)
    assert sights.picture_of_contact(0, None, 1.0, None) is None
    sights.store_detections(
        "eye", SimpleNamespace(**{**vars(message), "target": np.array([-1])}), 10
    )
    assert sights.picture_of_contact(0, None, 1.0, None) is None


@pytest.mark.parametrize(("name", "sensor"), [("turning", "eye"), ("rolling", "again")])
def test_wings_lie_on_the_picture_as_they_are_seen(seen, name, sensor):
    """Corners of the plate, turned from the target's axes into the camera's, as angles."""
    scope, contact, found = seen
    shown = scope.camera_picture(scope.page_content(DURATION_S), DURATION_S, contact[name])
    detected = found[sensor, name]
    middle = detected["azimuth_rad"], detected["elevation_rad"]
    centre = detected["true_range_m"] * crooked.direction(*middle)
    area = (IR if sensor == "again" else EO)["horizontal_m2"]
    span, chord = math.sqrt(3.0 * area), math.sqrt(area / 3.0)
    wanted = []
    for along, across in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        corner = np.array([along * chord / 2, across * span / 2, 0.0])
        turned = crooked.attitude(crooked.OWNSHIP) @ attitude(name).T @ corner
        azimuth, elevation = crooked.angles(centre + turned)
        off = (azimuth - middle[0]) * math.cos(middle[1]), elevation - middle[1]
        wanted.append(off / PIXEL_RAD[sensor])
    wanted = np.array(wanted)
    assert np.abs(wanted).max() > 7.0
    assert np.array(shown["wing"]) == pytest.approx(wanted, abs=0.02 * np.abs(wanted).max())


def test_the_horizon_is_where_it_is_and_stands_askew(seen):
    """Along the line on the picture, lines of sight touch the Earth."""
    scope, contact, found = seen
    picture = scope.page_content(DURATION_S)
    shown = scope.camera_picture(picture, DURATION_S, contact["turning"])
    detected = found["eye", "turning"]
    tilt = math.radians(shown["tilt"])
    assert 1.0 < abs(shown["horizon"]) < 100.0 and abs(shown["tilt"]) > 10.0
    dip = math.acos(6_371_000.0 / (6_371_000.0 + picture["own"]["alt"]))
    for along in (-80.0, 0.0, 80.0):
        right = shown["horizon"] * math.sin(tilt) + along * math.cos(tilt)
        up = shown["horizon"] * math.cos(tilt) - along * math.sin(tilt)
        elevation = detected["elevation_rad"] + up * PIXEL_RAD["eye"][1]
        azimuth = detected["azimuth_rad"] + right * PIXEL_RAD["eye"][0] / math.cos(elevation)
        line = crooked.attitude(crooked.OWNSHIP).T @ crooked.direction(azimuth, elevation)
        assert crooked.angles(line)[1] == pytest.approx(-dip, abs=math.radians(0.02))
    behind = {
        n: scope.camera_picture(picture, DURATION_S, c)["background"] for n, c in contact.items()
    }
    assert behind == {"turning": "sky", "rolling": "sky", "below": "ground"}


def test_an_old_picture_is_of_a_target_and_of_no_track(seen):
    """Who was seen where a track now is may have been anybody."""
    scope, contact, _ = seen
    for name, number in contact.items():
        later = scope.camera_picture(scope.page_content(DURATION_S + 3.0), DURATION_S + 3.0, number)
        assert (later is None) is (number >= 1_000_000), name


def test_a_camera_that_renders_shows_the_patch_that_it_searched():
    pytest.importorskip("cv2", reason="needs the extra image")
    eye = {**SEES_ALL, "type": "optical.image", "azimuth_deg": [-110, -30],
           "elevation_deg": [0, 45], "azimuth_pixels": 4000, "elevation_pixels": 1000,
           "noise_equivalent_contrast": 0.01, "false_alarms_per_frame": 1e-4,
           "false_alarms": False}  # fmt: skip
    scene = chain(
        {"radar": RADAR, "eye": {k: v for k, v in eye.items() if k != "threshold"}},
        targets=[{**TURNING, "contrast": 1.0}], duration_s=1.0, tracker={"type": "tracking.stub"},
        fusion={"type": "fusion.pick_best"},
    )  # fmt: skip
    scope, recorded = displayed(scene)
    picture = scope.page_content(1.0)
    shown = scope.camera_picture(picture, 1.0, picture["contacts"][0][0])
    patch = np.array(shown["patch"])
    assert shown["contrast"] is None
    middle = len(patch) // 2
    assert patch.shape == (2 * middle, 2 * middle) and 16 <= middle <= 24
    # Dark in the middle, where the target is, and bright round it.
    assert patch[middle - 2 : middle + 2, middle - 2 : middle + 2].min() < 40
    assert 110 < np.median(patch[:4]) < 145
    assert recorded["detections"]


def test_what_a_camera_has_seen_is_replaced_and_never_changed():
    """A page's thread may be looking at it; each target's last detection stays beside others'."""
    handed = {}

    def look(scope, time_s):
        for seen in scope._sights._seen.values():
            handed.setdefault(id(seen), (seen, seen.copy()))

    scene = chain(
        {"eye": CAMERAS["eye"]}, targets=[TURNING, BELOW], duration_s=4.5,
        tracker={"type": "tracking.stub"}, fusion={"type": "fusion.pick_best"},
    )  # fmt: skip
    scope, recorded = displayed(scene, look, window=1)
    assert len(handed) >= 3
    for seen, before in handed.values():
        np.testing.assert_array_equal(seen, before)
    last = {row["target"]: row["time_s"] for row in recorded["detections"]}
    assert sorted(last) == ["diving", "turning"]
    assert scope._sights._seen["eye"][:, 0].tolist() == [last["turning"], last["diving"]]
