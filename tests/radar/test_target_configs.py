"""The targets of Tables 2.3 and 4.1 as files a scene can extend; and every config file loads."""

import json
import tomllib
from pathlib import Path

import pytest

from dsa_des.scene.scene import load_scene

CONFIGS = Path(__file__).parents[2] / "configs"
EXTENDED = sorted(CONFIGS.glob("aircraft/*.toml")) + sorted(CONFIGS.glob("obstacles/*.toml"))

# source, file, dBsm, Swerling model, engine
TARGETS = [
    ("Table 2.3", "obstacles/power_line", -20.0, 0, None),
    ("Table 2.3", "obstacles/building", 15.0, 0, None),
    ("Table 2.3", "obstacles/wooden_hill", 20.0, 0, None),
    ("Table 2.3", "aircraft/small_aircraft", 1.76, 1, "propeller"),
    ("Table 2.3", "aircraft/medium_aircraft", 3.01, 1, "turbojet"),
    ("Table 2.3", "aircraft/large_aircraft", 6.99, 1, "turbojet"),
    ("Table 4.1", "aircraft/glider", 1.76, 1, "propeller"),
    ("Table 4.1", "aircraft/stinson", 1.76, 1, "propeller"),
    ("Table 4.1", "aircraft/long_ez", 1.76, 1, "propeller"),
    ("Table 4.1", "aircraft/extra_300", 3.01, 1, "propeller"),
    ("Table 4.1", "aircraft/beech_duchess", 3.01, 1, "propeller"),
    ("Table 4.1", "aircraft/king_air", 6.99, 1, "propeller"),
    ("Table 4.1", "aircraft/fa_18", 6.99, 1, "turbojet"),
]


def scene_with(folder, file):
    """A scene of ours whose one intruder extends a file."""
    path = folder / "scene.toml"
    path.write_text(
        f'extends = "{CONFIGS / "detect_and_sense.toml"}"\n'
        "duration_s = 1\n"
        "[blocks.traffic]\n"
        'type = "traffic.scripted"\n'
        "ownship = { lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000 }\n"
        "[[blocks.traffic.intruders]]\n"
        'name = "target"\n'
        f'extends = "{file}"\n'
        "east_m = 100\n"
        "north_m = 2000\n",
        encoding="utf-8",
    )
    return load_scene(path)


@pytest.mark.parametrize("file", EXTENDED, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_an_intruder_can_extend_every_file(file, tmp_path):
    (target,) = scene_with(tmp_path, file).blocks["traffic"].parameters.intruders
    assert -20.0 <= target.rcs_dbsm <= 20.0
    if file.parent.name == "obstacles":
        assert target.speed_mps == 0.0 and [leg.kind for leg in target.legs] == ["stationary"]
    for line in file.read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith(("#", "extends", "made_for")):
            source = line.partition("  # ")[2]
            assert any(word in source for word in ("Table", "errata", "assumption", "thesis")), line


@pytest.mark.parametrize(("source", "file", "rcs", "swerling", "engine"), TARGETS)
def test_targets_are_those_of_the_tables(source, file, rcs, swerling, engine, tmp_path):
    path = CONFIGS / f"{file}.toml"
    (target,) = scene_with(tmp_path, path).blocks["traffic"].parameters.intruders
    assert (target.rcs_dbsm, target.swerling) == (rcs, swerling)
    if engine is not None:
        assert target.engine == engine
    (line,) = [row for row in path.read_text("utf-8").splitlines() if row.startswith("rcs_dbsm")]
    assert f"  # {source}" in line


@pytest.mark.parametrize("file", sorted(CONFIGS.glob("sensors/*.toml")), ids=lambda file: file.stem)
def test_every_sensor_file_makes_a_block(file, tmp_path):
    kind = {"o": "radar", "d": "radar", "a": "eo", "m": "ir", "w": "laser"}[file.stem[0]]
    path = tmp_path / "scene.toml"
    first_light = CONFIGS / {"laser": "laser/power_line.toml"}.get(kind, "first_light.toml")
    written = tomllib.loads(file.read_text(encoding="utf-8"))
    # What the file takes away of the one that it extends, the scene's own sensor has too.
    taken = written.get("remove", [])
    if str(written.get("type", "")).startswith("surveillance."):
        taken = ["azimuth_resolution_deg", "elevation_resolution_deg"]  # the radar's, not its own
    # Two files are no sensor's: what an aircraft carries, and what the ownship believes of itself.
    tables = {
        "do365_equipage": "blocks.traffic.intruders.head_on",
        "do365_navigation": "navigation",
    }
    table = tables.get(file.stem, f"blocks.{kind}")
    path.write_text(
        f'extends = "{first_light}"\n[{table}]\nextends = "{file}"\nremove = {json.dumps(taken)}\n',
        "utf-8",
    )
    scene = load_scene(path)
    if "type" in written:
        assert scene.blocks[kind].type_name == written["type"]
    for name in set(written) & {"azimuth_pixels", "power_w", "azimuth_resolution_deg"}:
        assert getattr(scene.blocks[kind].parameters, name) == written[name]
