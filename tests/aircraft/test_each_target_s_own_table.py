"""Of several targets each is seen by its own table, and one without a table by its numbers."""

import math

import crooked
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, first_look

NAMES = ("first", "second", "third", "same_as_first")


def targets(**keys_of: dict) -> list[dict]:
    places = (crooked.ROLLING, crooked.DIVING, crooked.ROLLING, crooked.DIVING)
    return [
        {**place, "name": name, "up_m": 100.0 + 50.0 * number, **keys_of[name]}
        for number, (name, place) in enumerate(zip(NAMES, places, strict=True))
    ]


def table(path, column: str, value: float) -> str:
    nodes = [(az, el) for az in range(0, 360, 30) for el in range(-90, 91, 30)]
    lines = [f"az_deg,el_deg,{column}", *(f"{az},{el},{value}" for az, el in nodes)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def test_each_target_has_the_rcs_of_its_own_table(tmp_path):
    one, other = (table(tmp_path / f"{v}.csv", "dbsm", v) for v in (7.0, -4.0))
    keys = ({"rcs_table": one}, {"rcs_table": other}, {"rcs_dbsm": 2.0}, {"rcs_table": one})
    plain = {name: {"rcs_dbsm": 0.0} for name in NAMES}
    scene = chain({"radar": HEARS_ALL}, targets=targets(**dict(zip(NAMES, keys, strict=True))))
    found = first_look(scene, "radar")
    known = first_look(chain({"radar": HEARS_ALL}, targets=targets(**plain)), "radar")
    rcs_dbsm = [found[name]["snr_db"] - known[name]["snr_db"] for name in NAMES]
    assert rcs_dbsm == pytest.approx([7.0, -4.0, 2.0, 7.0])


@pytest.mark.parametrize("band", ["eo", "ir"])
def test_each_target_has_the_silhouette_of_its_own_table(tmp_path, band):
    one, other = (table(tmp_path / f"{v}.csv", "area_m2", v) for v in (12.0, 140.0))
    bodies = {"front_m2": 1.0, "side_m2": 1.0, "horizontal_m2": 1.0}
    if band == "ir":
        bodies["back_m2"] = 1.0
    keys = {
        name: {band: {**bodies, "silhouette_table": path}}
        for name, path in zip(NAMES, (one, other, other, one), strict=True)
    }
    eye = {**SEES_ALL, "type": f"optical.{band}", "silhouette": "aspect_table"}
    found = first_look(chain({"eye": eye}, targets=targets(**keys)), "eye")
    pixel_rad = math.radians(0.01)
    area_m2 = [
        found[name]["pixels"] * (found[name]["true_range_m"] * pixel_rad) ** 2 for name in NAMES
    ]
    assert area_m2 == pytest.approx([12.0, 140.0, 140.0, 12.0], rel=1e-6)
