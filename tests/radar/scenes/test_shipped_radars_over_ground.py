"""Every radar that is shipped has a beam, and hears the ground below it."""

import math
from pathlib import Path
from typing import Any

import crooked
import pytest
from wired import chain, rows, run

import dsa_des
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

CONFIGS = Path(__file__).parents[3] / "configs"
#: Where a block says that it is a radar; scenes that extend these have the same.
FILES = [
    CONFIGS / "sensors" / "oasys_specification.toml",
    *sorted(
        path for path in CONFIGS.rglob("*.toml") if 'type = "radar.' in path.read_text("utf-8")
    ),
]
OWN = {**crooked.OWNSHIP, "alt_m": 500.0, "climb_mps": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0}


def radars(path: Path) -> dict[str, dict[str, Any]]:
    """The radars that a file holds, with all their parameters."""
    if path.parent.name == "sensors":
        scene = dsa_des.load_scene(chain({"radar": {"extends": str(path)}}))
    else:
        scene = dsa_des.load_scene(path)
    blocks = scene.resolved()["blocks"]
    return {name: block for name, block in blocks.items() if block["type"].startswith("radar.")}


#: A transponder's replies stand for TCAS: they come on a frequency on which nothing else answers.
#: The radar of a site stands on the ground, which is not below it.
RADARS = {
    f"{path.relative_to(CONFIGS)}:{name}": block
    for path in FILES
    for name, block in radars(path).items()
    if name != "tcas" and path.name != "ground_radar.toml"
}


def test_all_of_them_are_looked_at():
    assert {key.partition(":")[0] for key in RADARS} >= {
        "sensors/oasys.toml", "sensors/oasys_specification.toml", "sensors/do365_radar.toml",
        "systems/dut_nlda.toml", "avoidance/airspace.toml", "benchmark/closed_loop_risk.toml",
        "tracking/architectures.toml", "thesis/sec_4_1_1.toml",
    }  # fmt: skip


@pytest.mark.parametrize("name", RADARS)
def test_ground_takes_detections_from_it(name):
    """A target of 20 m2 comes nearer at the ownship's height, 500 m over farmland and a town."""
    radar = {**RADARS[name], "scan_rate_hz": 2, "azimuth_deg": [-180, 180]}
    if "acquisition" in radar:  # one so slow and so far off the nose would be acquired later
        radar["acquisition"] = []
    far_m = min(1000.0 * radar["range_km"], 9000.0) - 10.0
    north_m, east_m = far_m * math.cos(0.7), far_m * math.sin(0.7)
    target = {
        **crooked.DIVING, "east_m": east_m, "north_m": north_m, "up_m": 0.0, "climb_mps": 0.0,
        "heading_deg": math.degrees(0.7) + 180.0, "speed_mps": 50.0, "rcs_dbsm": 13.0,
    }  # fmt: skip

    def seen(**terrain: float) -> int:
        scene = chain({"radar": radar}, ownship=OWN, targets=[target], duration_s=30,
                      **({"terrain": terrain} if terrain else {}))  # fmt: skip
        return len(rows(run(scene)))

    clear = seen()
    farmland, town = (seen(height_m=0.0, clutter_gamma_db=db) for db in (-15.0, -5.0))
    assert clear > farmland >= town
    assert town < 0.6 * clear


@pytest.mark.parametrize("name", RADARS)
def test_its_beam_is_stated_and_fits_its_gain(name):
    radar = RADARS[name]
    assert radar["azimuth_beamwidth_deg"] > 0 and radar["elevation_beamwidth_deg"] > 0
    said = notes_of_scene(Simulation(dsa_des.load_scene(chain({"radar": radar}))))
    assert not [line for line in said if "antenna_gain_db" in line]
