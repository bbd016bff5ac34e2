"""A small scene for studies, and blocks that break on purpose."""

import sys
from pathlib import Path

import pytest

SCENE = """
title = "small"
duration_s = 6
seed = 1
wires = ["traffic -> transform -> gate", "gate -> radar", "gate -> ir", "radar -> fusion",
         "ir -> fusion", "fusion -> tracker"]
[blocks.traffic]
type = "traffic.scripted"
ownship = { lat_deg = 52, lon_deg = 4, alt_m = 1000, speed_mps = 50 }
[[blocks.traffic.intruders]]
name = "one"
east_m = 100
north_m = 5000
up_m = 10
heading_deg = 180
speed_mps = 60
[blocks.transform]
type = "geometry.flat_earth"
[blocks.gate]
type = "gate"
[blocks.radar]
type = "fragile:Fragile"
scan_rate_hz = 5
reach_km = 4.8
[blocks.ir]
type = "fragile:Fragile"
scan_rate_hz = 2
reach_km = 9
[blocks.fusion]
type = "fusion.pick_best"
[blocks.tracker]
type = "tracking.stub"
"""

FRAGILE = '''
import os, signal, time
import numpy as np
from pydantic import Field
from components.sensor import Look, Sensor, SensorParameters


class FragileParameters(SensorParameters):
    reach_km: float = 5.0
    range_resolution_m: float = 0.0
    flaw: str = "none"


class Fragile(Sensor):
    """Detects nine in ten targets inside its reach; may raise, wait or kill its process."""

    Parameters = FragileParameters
    measures_range = True

    def look(self, cells):
        if self.p.flaw == "raise":
            raise RuntimeError("poisoned")
        if self.p.flaw == "leave":
            raise SystemExit(0)
        if self.p.flaw.startswith("die unless ") and not os.path.exists(self.p.flaw[11:]):
            os.kill(os.getpid(), signal.SIGKILL)
        while self.p.flaw.startswith("wait for ") and not os.path.exists(self.p.flaw[9:]):
            time.sleep(0.01)
        if self.p.flaw == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.p.flaw.startswith("die once "):
            try:
                os.close(os.open(self.p.flaw[9:], os.O_CREAT | os.O_EXCL))
            except FileExistsError:
                pass
            else:
                os.kill(os.getpid(), signal.SIGKILL)
        draws = cells.draws(self.stream("detection"))
        return Look((cells.range_m < self.p.reach_km * 1000) & (draws < 0.9),
                    np.zeros(len(cells)))
'''

STUDY = """
title = "small study"
scene = "small.toml"
seed = 3
replicas = 24
runs_per_chunk = 8
metrics = ["first_detection", "fused_share", "well_clear", "track_updates"]
[axes]
blocks.radar.scan_rate_hz = [1, 5]
[draws]
blocks.radar.offset_s = { uniform = [0, 0.2] }
"blocks.traffic.intruders[0].east_m" = { normal = [100, 50] }
[[figures]]
metric = "first_detection_range_m.radar"
"""


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a scene, a study of it and a fragile sensor; it is the working directory."""
    (tmp_path / "small.toml").write_text(SCENE)
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "fragile.py").write_text(FRAGILE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    # An earlier test's module would be taken for this folder's: its path is part of a study.
    monkeypatch.delitem(sys.modules, "fragile", raising=False)
    return tmp_path
