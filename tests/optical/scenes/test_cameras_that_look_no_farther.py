"""A camera leaves out what it could never see, and nothing else."""

import crooked
import pytest
from wired import chain, rows, run, sensor

import dsa_des

#: Warm from behind only, or visible only: the other band would say another range.
BODIES = {
    "behind": ({"front_m2": 0.1, "side_m2": 0.0, "horizontal_m2": 0.0},
               {"front_m2": 0.1, "back_m2": 80.0, "side_m2": 0.0, "horizontal_m2": 0.0}),
    "visible": ({"front_m2": 5.0, "side_m2": 40.0, "horizontal_m2": 90.0},
                {"front_m2": 0.1, "back_m2": 0.1, "side_m2": 0.0, "horizontal_m2": 0.0}),
    "warm": ({"front_m2": 0.1, "side_m2": 0.0, "horizontal_m2": 0.0},
             {"front_m2": 5.0, "back_m2": 5.0, "side_m2": 40.0, "horizontal_m2": 90.0}),
}  # fmt: skip


@pytest.mark.parametrize("bodies", list(BODIES))
@pytest.mark.parametrize(
    ("kind", "key"),
    [
        ("optical.eo", "contrast"),
        ("optical.ir", "contrast_ir"),
        ("optical.projection", "contrast"),
    ],
)
def test_what_is_just_detected_is_not_left_out(bodies, kind, key):
    """At a threshold just below its signature a target is seen, with what is culled or without."""
    eo, ir = BODIES[bodies]
    for target in crooked.TARGETS:
        craft = {**target, "eo": eo, "ir": ir, "contrast": 0.3, "contrast_ir": 0.3, key: 0.9}
        everything = run(chain({"camera": sensor(kind)}, targets=[craft]))
        (row,) = rows(everything, scan=0)
        for share, seen in ((0.999, 1), (1.001, 0)):
            camera = sensor(kind, threshold=share * (row["confidence"] - 1.0))
            scene = chain({"camera": camera}, targets=[craft])
            assert len(rows(run(scene), scan=0)) == seen
            whole = dsa_des.run(scene, simulate_everything=True)
            assert whole.detections.equals(run(scene).detections)


ABEAM = {"east_m": 0.0, "north_m": 3000.0, "up_m": 0.0, "heading_deg": 90.0, "speed_mps": 50.0}
LEVEL = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0}


@pytest.mark.parametrize("contrast", [0.4, 2.5])
@pytest.mark.parametrize("weight", [0.1, 0.6])
@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir"])
def test_the_largest_from_its_largest_side_is_still_looked_at(kind, contrast, weight):
    """A long slender target abeam and a small one beside it."""
    long = {"front_m2": 1.0, "side_m2": 90.0, "horizontal_m2": 0.0}
    small = {"front_m2": 0.5, "side_m2": 0.0, "horizontal_m2": 0.0}
    crafts = [
        {**ABEAM, "name": name, "east_m": east_m, "eo": areas, "ir": {**areas, "back_m2": 0.2},
         "contrast": contrast, "contrast_ir": contrast}
        for name, areas, east_m in (("long", long, 0.0), ("small", small, 40.0))
    ]  # fmt: skip

    def seen(threshold: float) -> dict:
        camera = sensor(kind, threshold=threshold, static_weight=weight)
        found = run(chain({"camera": camera}, ownship=LEVEL, targets=crafts))
        return {row["target"]: row for row in rows(found, scan=0)}

    signature = seen(-1.0)["long"]["confidence"] - 1.0
    assert set(seen(0.999 * signature)) == {"long"}
    assert set(seen(1.001 * signature)) == set()


def test_what_is_seen_by_its_plume_or_by_its_table_alone_is_looked_at(tmp_path):
    """Hardly a body: a jet's plume from behind, and a table of a larger silhouette."""
    nodes = [(az, el) for az in range(0, 360, 30) for el in range(-90, 91, 30)]
    lines = ["az_deg,el_deg,area_m2", *(f"{az},{el},400.0" for az, el in nodes)]
    path = tmp_path / "area.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    body = {"front_m2": 0.1, "side_m2": 0.0, "horizontal_m2": 0.0, "silhouette_table": str(path)}
    warm = {**body, "back_m2": 0.1}
    craft = {
        "name": "jet",
        **ABEAM,
        "heading_deg": 0.0,
        "engine": "turbojet",
        "eo": body,
        "ir": warm,
    }
    for kind, keys in (
        ("optical.ir", {"plume": True}),
        ("optical.ir", {"silhouette": "aspect_table"}),
        ("optical.eo", {"silhouette": "aspect_table"}),
    ):
        signatures = []
        for threshold in (-1.0, None):
            if threshold is None:
                threshold = 0.999 * (signatures[0]["confidence"] - 1.0)
            camera = sensor(kind, threshold=threshold, **keys)
            scene = chain({"camera": camera}, ownship=LEVEL, targets=[craft])
            signatures += rows(run(scene), scan=0)
        assert len(signatures) == 2
