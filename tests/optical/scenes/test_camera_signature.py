"""What a camera's signature is made of: areas and contrast of its own band, motion in NED."""

import math

import crooked
import numpy as np
import pytest
from wired import SEES_ALL, chain, first_look, rows, run

STATIC_WEIGHT, THRESHOLD = 0.3, -1.0
EYE = {**SEES_ALL, "static_weight": STATIC_WEIGHT, "threshold": THRESHOLD}
WARM = {**EYE, "type": "optical.ir"}
PIXEL_RAD = math.radians(0.01)


def ball(area_m2: float) -> dict:
    """A sphere: of the three bodies only that which looks alike from everywhere."""
    return {"front_m2": area_m2, "side_m2": 0.0, "horizontal_m2": 0.0}


def craft(target: dict, **keys) -> dict:
    bands = {"eo": ball(9.0), "ir": {**ball(4.0), "back_m2": 4.0}}
    return {**target, **bands, **keys}


def pixels(area_m2: float, target: dict, time_s: float = 0.0) -> float:
    return area_m2 / float(np.linalg.norm(crooked.ned(target, time_s)) * PIXEL_RAD) ** 2


def test_each_band_has_its_own_areas_and_contrast():
    targets = [
        craft(crooked.ROLLING, contrast=0.2, contrast_ir=0.7),
        craft(crooked.DIVING, contrast=0.9, contrast_ir=0.05),
    ]
    scene = chain({"eye": EYE, "warm": WARM}, targets=targets)
    for block, area_m2, key in (("eye", 9.0, "contrast"), ("warm", 4.0, "contrast_ir")):
        seen = first_look(scene, block)
        for target in targets:
            row = seen[target["name"]]
            assert row["pixels"] == pytest.approx(pixels(area_m2, target), rel=1e-9)
            signature = row["confidence"] + THRESHOLD
            assert signature == pytest.approx(STATIC_WEIGHT * row["pixels"] * target[key])


def turning(rate_deg_s: float) -> dict:
    """The ownship in a coordinated turn: its axes turn under a target that does not."""
    own = {key: crooked.OWNSHIP[key] for key in crooked.OWNSHIP if not key.endswith("yaw_deg")}
    del own["roll_deg"], own["pitch_deg"]
    return {**own, "climb_mps": 0.0, "legs": [{"kind": "turn", "rate_deg_s": rate_deg_s}]}


def looked(scene: dict, block: str = "eye") -> list[dict]:
    return rows(run(scene), block=block)


def rates(scene: dict, targets, weight: float) -> dict[tuple[str, int], float]:
    """Dynamic signature over its weight, by target and scan."""
    area_m2 = {target["name"]: target["eo"]["front_m2"] for target in targets}
    found = {}
    for row in looked(scene):
        q = area_m2[row["target"]] / (row["true_range_m"] * PIXEL_RAD) ** 2
        moving = row["confidence"] + THRESHOLD - STATIC_WEIGHT * q
        found[row["target"], row["scan"]] = moving / weight
    return found


@pytest.mark.parametrize("rate", ["exact", "thesis"])
def test_the_dynamic_signature_is_motion_in_ned(rate):
    """Around a hovering ownship with a fixed crooked attitude the rates are those of pymap3d."""
    weight = 1e5
    targets = [craft(target) for target in crooked.TARGETS]
    eye = {**EYE, "scan_rate_hz": 2, "dynamic_weight": weight, "rate": rate}
    found = rates(chain({"eye": eye}, targets=targets, duration_s=2), targets, weight)
    for target in targets:
        assert found[target["name"], 0] == pytest.approx(0.0, abs=1e-9)
        for scan in (1, 2, 3):
            now, before = (crooked.ned(target, 0.5 * k) for k in (scan, scan - 1))
            if rate == "exact":
                apart = np.linalg.norm(np.cross(now, before))
                moved = math.atan2(apart, float(now @ before))
            else:
                (az, el), (last_az, last_el) = crooked.angles(now), crooked.angles(before)
                moved = math.hypot(az - last_az, el - last_el)
            assert found[target["name"], scan] == pytest.approx(moved / 0.5, rel=1e-5)


def test_a_turning_ownship_does_not_move_its_targets():
    """Turning at 20 deg/s in place, body angles change by 0.35 rad/s, the line of sight not."""
    weight = 1e5
    still = {"heading_deg": 0.0, "speed_mps": 0.0, "climb_mps": 0.0}
    targets = [craft({**target, **still}) for target in crooked.TARGETS]
    own = {**turning(20.0), "speed_mps": 0.5}
    eye = {**EYE, "scan_rate_hz": 4, "dynamic_weight": weight}
    scene = chain({"eye": eye}, ownship=own, targets=targets, duration_s=2)
    found = rates(scene, targets, weight)
    assert len(found) == 16
    # At 0.5 m/s the nearest, 1.97 km away, moves by 2.6e-4 rad/s at most.
    assert max(found.values()) < 3e-4
    azimuths = [row["true_azimuth_rad"] for row in looked(scene) if row["target"] == "rolling"]
    assert np.ptp(np.unwrap(azimuths)) > 0.4
