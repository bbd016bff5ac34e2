"""What a study's folder keeps of its first run: the scene written out, its models' errors."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import crooked
import pytest
from click.testing import CliRunner
from wired import chain, sensor

from dsa_des.cli import main
from dsa_des.files.toml_files import to_toml

#: 13 km to the south-west, level with the ownship in its horizontal plane.
FAR: dict[str, Any] = {
    "name": "far", "east_m": -5000.0, "north_m": -12000.0, "up_m": 0.0, "heading_deg": 35.0,
    "speed_mps": 0.0,
}  # fmt: skip
#: Level, so that body axes and the horizon tilt alike.
OWNSHIP = {
    key: value for key, value in crooked.OWNSHIP.items()
    if key not in ("climb_mps", "yaw_deg", "pitch_deg", "roll_deg")
}  # fmt: skip
STUDY = """\
scene = "scene.toml"
replicas = 1
metrics = ["first_detection"]
[axes]
swap.transform = ["geometry.flat_earth", "geometry.ellipsoid"]
blocks.radar.scan_rate_hz = [3, 2]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study's folder whose errors have been measured."""
    home = tmp_path_factory.mktemp("study")
    radar = sensor("radar.range_boundary", azimuth_deg=[-90.0, 90.0])
    scene = chain({"radar": radar}, ownship=OWNSHIP, targets=[FAR])
    (home / "scene.toml").write_text(to_toml(scene), encoding="utf-8")
    (home / "s.toml").write_text(STUDY, encoding="utf-8")
    out = str(home / "out")
    for words in ([str(home / "s.toml"), "--out", out, "--workers", "1", "--quiet"],
                  ["report", out, "--no-figures", "--measure"]):  # fmt: skip
        done = CliRunner().invoke(main, ["study", *words], catch_exceptions=False)
        assert done.exit_code == 0, done.output
    return Path(out)


def test_the_scene_that_is_written_out_is_the_first_cell_s(folder: Path) -> None:
    kept = json.loads((folder / "explained.json").read_text(encoding="utf-8"))
    blocks = tomllib.loads(kept["scene"])["blocks"]
    assert blocks["transform"]["type"] == "geometry.flat_earth"
    assert blocks["radar"]["scan_rate_hz"] == 3


def test_errors_are_measured_with_the_first_cell_s_swaps(folder: Path) -> None:
    """Over a flat Earth nothing sinks below the horizon by half the angle at the centre."""
    rows = json.loads((folder / "errors.json").read_text(encoding="utf-8"))["rows"]
    (found,) = (row for row in rows if (row["block"], row["ladder"], row["quantity"])
                == ("transform", "earth", "elevation"))  # fmt: skip
    assert found["rung"] == "flat_earth"
    assert found["mean"] == pytest.approx(1e3 * math.hypot(5.0, 12.0) / (2 * 6371.0), rel=0.02)
