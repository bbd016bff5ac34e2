"""Any number of sensors can feed one fusion: a mask has a bit for each."""

import numpy as np
import pytest

from components.messages.contributors import joined_sensor_names_of_masks, mask_dtype_for_sensors
from dsa_des.block.message import Text

HEAD = """
duration_s = 2
[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52, lon_deg = 4, alt_m = 1000, heading_deg = 0, speed_mps = 50 }
intruders = [
  { name = "near", east_m = 10, north_m = 3000, up_m = 0 },
  { name = "far", east_m = 10, north_m = 8000, up_m = 0 },
]
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.gate]
type = "gate"
[blocks.tracker]
type = "tracking.stub"
"""


@pytest.mark.parametrize("fusion", ["pick_best", "gated"])
@pytest.mark.parametrize("number", [63, 64, 100])
def test_every_sensor_in_reach_is_named(lab, fusion, number):
    """Half of the sensors see as far as the second target; the names say exactly which."""
    names = [f"r{i:03d}" for i in range(number)]
    wires = ["traffic -> transform -> gate", "fusion -> tracker"]
    wires += [f"gate -> {name} -> fusion" for name in names]
    blocks = "".join(
        f'[blocks.{name}]\ntype = "radar.range_boundary"\nscan_rate_hz = 1\n'
        f"range_km = {20 if i % 2 else 5}\n"
        for i, name in enumerate(names)
    )
    path = lab.folder / "scene.toml"
    text = f"wires = {wires}\n{HEAD}[blocks.fusion]\ntype = 'fusion.{fusion}'\n{blocks}"
    path.write_text(text, encoding="utf-8")
    everybody, far = "+".join(names), "+".join(names[1::2])
    for options in ({}, {"window": 1}) if number == 64 else ({},):
        tables = lab.run(path, **options).tables
        for table, column in (("fused", "sensors"), ("tracks", "updated_by")):
            found = [(row["target"], row[column]) for row in tables[table].to_pylist()]
            assert (
                found == [("far", far), ("near", everybody)] * 2
                or found
                == [
                    ("near", everybody),
                    ("far", far),
                ]
                * 2
            )


@pytest.mark.parametrize("sensors", [1, 12, 13, 63, 64, 200])
def test_masks_become_names(sensors):
    names = tuple(f"s{i}" for i in range(sensors))
    last = 1 << (sensors - 1)
    masks = np.array([last, 1, last | 1, 1], dtype=mask_dtype_for_sensors(sensors))
    text = joined_sensor_names_of_masks(masks, names)
    both = names[0] if sensors == 1 else f"{names[0]}+{names[-1]}"
    assert [text.names[code] for code in text.codes] == [names[-1], names[0], both, names[0]]
    ascending = [sum(1 << names.index(n) for n in name.split("+")) for name in text.names]
    assert ascending == sorted(ascending)  # what files hold does not depend on how it is counted
    none = joined_sensor_names_of_masks(np.empty(0, dtype=mask_dtype_for_sensors(sensors)), names)
    assert isinstance(none, Text) and len(none) == 0


def test_false_alarms_of_the_last_sensors_pass(lab):
    names = [f"r{i:03d}" for i in range(66)]
    wires = ["traffic -> transform -> gate", "fusion -> tracker"]
    wires += [f"gate -> {name} -> fusion" for name in [*names, "zulu"]]
    blocks = "".join(
        f'[blocks.{name}]\ntype = "radar.range_boundary"\nscan_rate_hz = 1\nrange_km = 5\n'
        for name in names
    )
    zulu = (
        "[blocks.zulu]\ntype = 'optical.eo'\nscan_rate_hz = 1\nazimuth_pixels = 64\n"
        "elevation_pixels = 64\nazimuth_deg = [-20, 20]\nelevation_deg = [-20, 20]\n"
        "threshold = 1e9\nfalse_alarms_per_frame = 1\n"
    )
    path = lab.folder / "scene.toml"
    text = f"wires = {wires}\n{HEAD}[blocks.fusion]\ntype = 'fusion.pick_best'\n{blocks}{zulu}"
    path.write_text(text, encoding="utf-8")
    rows = lab.run(path).tables["fused"].to_pylist()
    assert [row["sensors"] for row in rows if row["target"] is None] == ["zulu", "zulu"]
