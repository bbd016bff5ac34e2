"""Of several planes and targets each is told by who saw it, and with its own margin."""

import math

import crooked
import numpy as np
import pytest
from wired import HEARS_ALL, SEES_ALL, chain, rows, run, sensor

import dsa_des
from dsa_des.embed import Simulator


def geodetic_rad(flight: dict) -> tuple[tuple, list]:
    lat, lon, alt = crooked.geodetic(crooked.position(flight))
    turned = [math.radians(flight[f"{key}_deg"]) for key in ("yaw", "pitch", "roll")]
    return (math.radians(lat), math.radians(lon), alt), turned


def test_a_host_is_told_each_plane_s_own_margin():
    radar = sensor("radar.range_boundary", range_km=20.0)
    scene = chain({"radar": radar}, fusion={"type": "fusion.pick_best"})
    planes = [{"name": target["name"]} for target in crooked.TARGETS]
    scene["blocks"]["traffic"] = {"type": "traffic.host", "planes": planes}
    simulator = Simulator(dsa_des.load_scene(scene))
    places, turned = zip(*map(geodetic_rad, crooked.TARGETS), strict=True)
    result = simulator.simulate(*geodetic_rad(crooked.OWNSHIP), places, turned, 0.0)
    for target in crooked.TARGETS:
        range_m = float(np.linalg.norm(crooked.ned(target)))
        margin_db = 40.0 * math.log10(20_000.0 / range_m)
        assert result[target["name"]].confidence == {"radar": pytest.approx(margin_db, abs=1e-4)}
        assert result[target["name"]].range_m == pytest.approx(range_m, abs=0.01)


def test_a_track_is_updated_by_who_saw_its_target():
    """The radar looks up and the camera down: each sees one of the two."""
    assert crooked.angles(crooked.body(crooked.ROLLING))[1] < 0.0
    elevation = {
        t["name"]: math.degrees(crooked.angles(crooked.body(t))[1]) for t in crooked.TARGETS
    }
    low, high = sorted(elevation, key=elevation.__getitem__)
    middle = 0.5 * (elevation[low] + elevation[high])
    sensors = {
        "radar": {**HEARS_ALL, "elevation_deg": [middle, 90]},
        "eye": {**SEES_ALL, "elevation_deg": [-90, middle]},
    }
    scene = chain(sensors, fusion={"type": "fusion.pick_best"}, tracker={"type": "tracking.stub"})
    found = {row["target"]: row for row in rows(run(scene), "tracks", time_s=0.0)}
    assert {name: row["updated_by"] for name, row in found.items()} == {high: "radar", low: "eye"}
    assert found[high]["range_m"] is not None and found[low]["range_m"] is None
