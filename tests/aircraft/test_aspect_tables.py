"""Tables over aspect are read where the sensor truly stands in the target's axes."""

import math

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, decided, first_look, run

import dsa_des

AZIMUTHS, ELEVATIONS = range(0, 360, 10), range(-90, 91, 10)
OTHERS = (
    # Passing below to the left, seen from behind; and far above, nearly inverted.
    {**crooked.ROLLING, "name": "below", "east_m": -300.0, "north_m": 900.0, "up_m": -350.0,
     "heading_deg": 15.0, "yaw_deg": 20.0, "pitch_deg": -6.0, "roll_deg": 61.0},
    {**crooked.DIVING, "name": "above", "east_m": 500.0, "north_m": 350.0, "up_m": 800.0,
     "heading_deg": 120.0, "yaw_deg": 112.0, "pitch_deg": 21.0, "roll_deg": -158.0},
)  # fmt: skip
TARGETS = (*crooked.TARGETS, *OTHERS)


def value(azimuth_deg: float, elevation_deg: float) -> float:
    """Bilinear between the nodes, other right than left and above than below; the seam at 350."""
    saw = azimuth_deg if azimuth_deg <= 350.0 else 35.0 * (360.0 - azimuth_deg)
    return 20.0 + saw / 20.0 + elevation_deg / 6.0


def table(path, name: str) -> str:
    lines = [f"az_deg,el_deg,{name}"]
    lines += [f"{az},{el},{value(az, el)!r}" for el in ELEVATIONS for az in AZIMUTHS]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def expected(target: dict, time_s: float = 0.0) -> float:
    azimuth, elevation = crooked.angles(crooked.aspect(target, time_s))
    return value(math.degrees(azimuth) % 360.0, math.degrees(elevation))


def test_the_four_aspects_lie_apart():
    aspects = np.degrees([crooked.angles(crooked.aspect(target)) for target in TARGETS])
    assert np.min(np.abs(aspects)) > 5.0
    assert all(np.min(column) < 0 < np.max(column) for column in aspects.T)


def test_rcs_by_aspect(tmp_path):
    path = table(tmp_path / "rcs.csv", "dbsm")
    with_table = [{**target, "rcs_table": path} for target in TARGETS]
    plain = [{**target, "rcs_dbsm": 0.0} for target in TARGETS]
    found = first_look(chain({"radar": HEARS_ALL}, targets=with_table), "radar")
    reference = first_look(chain({"radar": HEARS_ALL}, targets=plain), "radar")
    for target in TARGETS:
        name = target["name"]
        rcs_dbsm = found[name]["snr_db"] - reference[name]["snr_db"]
        assert rcs_dbsm == pytest.approx(expected(target), abs=1e-6), name


def test_aspect_rcs_off_is_the_constant_rcs(tmp_path):
    path = table(tmp_path / "rcs.csv", "dbsm")
    targets = [{**target, "rcs_table": path, "rcs_dbsm": 4.0} for target in TARGETS]
    radar = {**HEARS_ALL, "aspect_rcs": False}
    found = first_look(chain({"radar": radar}, targets=targets), "radar")
    plain = [{**target, "rcs_dbsm": 4.0} for target in TARGETS]
    reference = first_look(chain({"radar": HEARS_ALL}, targets=plain), "radar")
    assert {name: row["snr_db"] for name, row in found.items()} == pytest.approx(
        {name: row["snr_db"] for name, row in reference.items()}
    )
    # Simulating everything asks for no table that a key says to leave out.
    scene = chain({"radar": radar}, targets=targets)
    everything = dsa_des.run(scene, simulate_everything=True)["detections"].to_pylist()
    assert everything == dsa_des.run(scene)["detections"].to_pylist()


@pytest.mark.parametrize(("kind", "band"), [("optical.eo", "eo"), ("optical.ir", "ir")])
def test_silhouettes_by_aspect_and_later_too(tmp_path, kind, band):
    path = table(tmp_path / "area.csv", "area_m2")
    areas = {"front_m2": 1.0, "side_m2": 1.0, "horizontal_m2": 1.0, "silhouette_table": path}
    if band == "ir":
        areas["back_m2"] = 1.0
    targets = [{**target, band: areas} for target in TARGETS]
    camera = {**SEES_ALL, "type": kind, "silhouette": "aspect_table", "scan_rate_hz": 2}
    found = run(chain({"eye": camera}, targets=targets))
    for scan in (0, 1):
        seen = {row["target"]: row for row in decided(found, block="eye", scan=scan)}
        for target in TARGETS:
            row = seen[target["name"]]
            area_m2 = row["pixels"] * (row["true_range_m"] * math.radians(0.01)) ** 2
            assert area_m2 == pytest.approx(expected(target, 0.5 * scan), rel=1e-4)


def bodies(target: dict, front: float, back: float, side: float, top: float) -> float:
    """Sum of sphere, cylinder and plane along the line of sight, the sphere's back its own.

    Thesis eq. 9-13 and 20-21 with exact projections: nose is the cosine off the target's nose.
    """
    nose, wing, floor = -crooked.aspect(target) / np.linalg.norm(crooked.aspect(target))
    sphere = 0.5 * (1.0 + nose) * back + 0.5 * (1.0 - nose) * front
    return sphere + side * math.hypot(wing, floor) + top * abs(floor)


@pytest.mark.parametrize(
    ("kind", "band", "front", "back", "side", "top"),
    [
        ("optical.eo", "eo", 7.0, 7.0, 30.0, 90.0),
        ("optical.eo", "eo", 7.0, 7.0, 90.0, 20.0),
        ("optical.ir", "ir", 5.0, 25.0, 11.0, 35.0),
        ("optical.ir", "ir", 25.0, 5.0, 35.0, 11.0),
    ],
)
def test_the_exact_silhouette_is_that_of_the_attitude(kind, band, front, back, side, top):
    areas = {"front_m2": front, "side_m2": side, "horizontal_m2": top}
    if band == "ir":
        areas["back_m2"] = back
    targets = [{**target, band: areas} for target in TARGETS]
    seen = first_look(chain({"eye": {**SEES_ALL, "type": kind}}, targets=targets), "eye")
    for target in TARGETS:
        row = seen[target["name"]]
        area_m2 = row["pixels"] * (row["true_range_m"] * math.radians(0.01)) ** 2
        assert area_m2 == pytest.approx(bodies(target, front, back, side, top), rel=1e-6)
