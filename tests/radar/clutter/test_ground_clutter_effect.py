"""Terrain in a scene: where its echo reaches a radar, and what it does to detections there."""

import math

import numpy as np
import pytest
from scipy.special import chndtr, roots_genlaguerre

from components.radar.ground_clutter import ground_clutter_rcs_m2
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
extends = "{base}"
duration_s = 20
{terrain}
[blocks.radar]
{radar}
[blocks.traffic]
ownship = {{ lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, climb_mps = {climb}, \
speed_mps = 50, pitch_deg = 0 }}
[[blocks.traffic.intruders]]
name = "low"
swerling = {swerling}
east_m = 0
north_m = 8500
up_m = -850
heading_deg = 180
speed_mps = 60
[[blocks.traffic.intruders]]
name = "level"
swerling = {swerling}
east_m = 100
north_m = 6000
up_m = 0
heading_deg = 180
speed_mps = 60
"""
GROUND = "[terrain]\nheight_m = 60\nclutter_gamma_db = -20\n"
NARROW = "azimuth_beamwidth_deg = 1\nelevation_beamwidth_deg = 1\n"
NO_BEAM = 'remove = ["azimuth_beamwidth_deg", "elevation_beamwidth_deg"]\n'


@pytest.fixture
def scene(configs, tmp_path):
    def write(terrain=GROUND, radar="", swerling=1, climb=0):
        path = tmp_path / "scene.toml"
        path.write_text(
            SCENE.format(
                base=configs / "first_light.toml",
                terrain=terrain,
                radar=radar if "remove" in radar else NARROW + radar,
                swerling=swerling,
                climb=climb,
            ),
            encoding="utf-8",
        )
        return path

    return write


def simulate(path, swaps=(), **options):
    memory = MemorySink()
    loaded = load_scene(path, swaps=swaps, sets=["record.looks=true"])
    simulation = Simulation(loaded, recorder=Recorder([memory]), **options)
    simulation.run()
    return simulation, memory.tables()


def radar_rows(tables, target):
    rows = [row for row in tables["looks"].to_pylist() if row["detected"]]
    return [row for row in rows if row["block"] == "radar" and row["target"] == target]


@pytest.mark.parametrize("swerling", [0, 1, 3])
def test_pd_is_that_of_an_echo_within_clutter_that_is_constant(scene, swerling):
    """A threshold that rises with the clutter sees the powers of all that much smaller."""
    path = scene(GROUND + 'clutter_mean = "constant"\n', swerling=swerling)
    simulation, tables = simulate(path)
    rows = radar_rows(tables, "low")
    assert len(rows) > 40
    ranges = np.array([row["true_range_m"] for row in rows])
    # The ownship is level, so its body elevation is that of the NED frame.
    elevation = np.array([row["true_elevation_rad"] for row in rows])
    clutter = ground_clutter_rcs_m2(
        ranges,
        elevation,
        940.0,
        gamma_db=-20.0,
        azimuth_beamwidth_rad=math.radians(1),
        elevation_beamwidth_rad=math.radians(1),
        range_resolution_m=76.2,
    )
    cnr = simulation.components["radar"].budget.snr(ranges, clutter)
    assert cnr.max() > 0.3
    snr = 10.0 ** (np.array([row["snr_db"] for row in rows]) / 10.0)
    powers = [snr / (1.0 + cnr), cnr / (1.0 + cnr)]
    expected = averaged_over_the_echoes(*powers, 1.0 / (1.0 + cnr), swerling)
    found = np.array([row["detection_probability"] for row in rows])
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def averaged_over_the_echoes(target, clutter, noise, swerling):
    """Marcum's Q averaged over RCS and phase, for a threshold of the thesis's Pfa."""
    if swerling == 0:
        rcs, weight = np.ones(1), np.ones(1)
    else:
        shape = {1: 1, 3: 2}[swerling]
        node, weight = roots_genlaguerre(90, shape - 1)
        rcs, weight = node / shape, weight / weight.sum()
    phase = (np.arange(200) + 0.5) * math.pi / 200
    found = []
    for s, c, n in zip(target, clutter, noise, strict=True):
        amplitude = np.sqrt(s * rcs)[:, np.newaxis]
        power = amplitude**2 + c + 2.0 * amplitude * math.sqrt(c) * np.cos(phase)
        reached = 1.0 - chndtr(-2.0 * math.log(0.05) / n, 2, 2.0 * power / n)
        found.append(float(weight @ reached.mean(axis=1)))
    return np.array(found)


def test_clutter_is_only_where_the_beam_meets_the_ground(scene):
    """The target at our own altitude is 12 beamwidths and more above the ground."""
    _, ground = simulate(scene())
    _, none = simulate(scene(""))
    assert radar_rows(ground, "level") == radar_rows(none, "level") != []
    assert radar_rows(ground, "low") != radar_rows(none, "low")


def test_clutter_hides_a_low_target_from_a_threshold_radar(scene):
    swaps = ["radar=radar.threshold"]
    first = []
    for terrain in ("", GROUND.replace("-20", "-37"), GROUND.replace("-20", "-5")):
        _, tables = simulate(scene(terrain), swaps)
        seen = [row["true_range_m"] for row in radar_rows(tables, "low")]
        first.append(max(seen, default=0.0))
        assert radar_rows(tables, "level")
    assert first[0] > first[1] > first[2]


def test_the_reason_is_in_the_scene(scene):
    for terrain, sentence in (
        ("", "ground clutter: not simulated, [terrain] height_m is not given"),
        (GROUND, "ground clutter: simulated, [terrain] height_m is 60"),
    ):
        plan = Simulation(load_scene(scene(terrain))).plan
        found = [item.sentence() for item in plan if item.block == "radar"]
        assert sentence in found


BAD = [
    ({"terrain": "[terrain]\nheight_m = 1200"}, r"\[terrain\] height_m is 1200.*1000 m at 0 s"),
    ({"terrain": "[terrain]\nheight_m = 1000"}, r"\[terrain\] height_m is 1000: it must be below"),
    ({"terrain": "[terrain]\nheight_m = 500", "climb": -40}, r"500: .* is at 480 m at 13 s"),
    ({"radar": "range_resolution_m = 0"}, "range_resolution_m is 0: ground clutter"),
    (
        {"radar": NO_BEAM + "elevation_resolution_deg = 0"},
        "elevation_resolution_deg is 0: ground clutter",
    ),
    ({"radar": "pulses = 3\nintegration_gain_db = 0"}, "pulses is 3: ground clutter"),
    ({"terrain": '[terrain]\nclutter_mean = "wavering"'}, "constant"),
    ({"terrain": "[terrain]\nheight_m = 99999"}, "less than or equal to 10000"),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_bad_terrain_is_a_problem_of_the_scene(scene, changes, message):
    with pytest.raises(SceneError, match=message):
        Simulation(load_scene(scene(**changes)))
