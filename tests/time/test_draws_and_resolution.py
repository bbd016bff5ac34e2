"""What is drawn at an instant does not depend on how finely a scene counts time."""

import pytest

from dsa_des.library.runs import run
from dsa_des.library.scenes import load_scene

SCENE = """
extends = "first_light"
duration_s = 20
wires = [
  "traffic -> transform -> gate",
  "gate -> radar",
  "gate -> eo",
  "gate -> ir",
  {from = "radar", to = "fusion", jitter_s = 0.11, drop_probability = 0.3},
  "fusion -> tracker",
  "ir -> other",
  "eo -> other",
]

[navigation]
attitude_noise_deg = [0.3, 0.2, 0.1]
position_noise_m = [5, 4, 3]

[processors.computer]
service_s = 0.01
service_spread_s = 0.05

[blocks.radar]
processor = "computer"

[blocks.other]
type = "fusion.pick_best"

[blocks.ir]
scan_rate_hz = %s
"""


def recorded(tmp_path, rate):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE % rate)
    scene = load_scene(path)
    found = run(scene)
    names = ("detections", "fused", "tracks", "processing")
    return scene.ticks_per_s, {name: getattr(found, name).to_pylist() for name in names}


@pytest.mark.parametrize("rate", ['"30000/1001"', '"7/3"'])
def test_a_camera_of_an_odd_rate_changes_no_draw_of_the_others(tmp_path, rate):
    coarse, plain = recorded(tmp_path, "2")
    fine, other = recorded(tmp_path, rate)
    assert fine > coarse == 10**9
    for table, ours in (
        ("detections", {"radar"}),
        ("fused", {"fusion"}),
        ("tracks", {"tracker"}),
        ("processing", {"radar"}),
    ):
        rows = [
            [
                {key: value for key, value in row.items() if key != "tick"}
                for row in tables[table]
                if row["block"] in ours
            ]
            for tables in (plain, other)
        ]
        assert len(rows[0]) == len(rows[1]) > 10, table
        for first, second in zip(*rows, strict=True):
            assert first.keys() == second.keys()
            for key, value in first.items():  # drawn times are rounded to ticks
                within = value if not isinstance(value, float) else pytest.approx(value, abs=1e-6)
                assert second[key] == within, (table, key)
