"""The camera blocks: their silhouettes, backgrounds and plumes are those of the physics."""

import math

import pytest
from wired import chain, sensor

import dsa_des
from components.optical.sensors import (
    ElectroOptical,
    ElectroOpticalParameters,
    Infrared,
    InfraredParameters,
)
from dsa_des.block.component import Context
from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

AREA_TABLE = "az_deg,el_deg,area_m2\n" + "".join(
    f"{az},{el},{20.0 + 0.1 * abs(el) + 15.0 * abs(math.sin(math.radians(az)))}\n"
    for el in range(-90, 91, 30)
    for az in range(0, 360, 30)
)
CAMERA = {"scan_rate_hz": 2, "azimuth_pixels": 1000, "elevation_pixels": 500}


@pytest.fixture
def area_file(tmp_path):
    path = tmp_path / "areas.csv"
    path.write_text(AREA_TABLE, encoding="utf-8")
    return path


def eo(**changes):
    return ElectroOptical("eo", ElectroOpticalParameters(**CAMERA, **changes), Context(Streams(1)))


def ir(**changes):
    return Infrared("ir", InfraredParameters(**CAMERA, **changes), Context(Streams(1)))


@pytest.fixture
def scene(configs, tmp_path, area_file):
    """Write first light with other parameters of its cameras and three turning intruders."""

    def write(eo, ir, weather=""):
        lines = [f'extends = "{configs / "first_light.toml"}"', "duration_s = 20"]
        lines += ["[weather]", weather] if weather else []
        lines += ["[blocks.eo]", eo, "[blocks.ir]", ir]
        areas = 'front_m2 = 12, side_m2 = 30, horizontal_m2 = 90, silhouette_table = "areas.csv"'
        for i, engine in enumerate(("propeller", "turbofan", "turbojet")):
            lines += [
                "[[blocks.traffic.intruders]]",
                f'name = "{engine}"\nengine = "{engine}"\npaint_reflectance = {0.3 * i + 0.2}',
                f"east_m = {600 * i - 300}\nnorth_m = 1500\nup_m = 40",
                f"heading_deg = {160 + 40 * i}\nspeed_mps = 30",
                "legs = [{ kind = 'turn', rate_deg_s = 6 }]",
                f"eo = {{ {areas} }}\nir = {{ back_m2 = 14, {areas} }}",
            ]
        path = tmp_path / "scene.toml"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("eo", "key"),
    [
        ('background = "sun"', "blocks.eo.background"),
        ("sun_elevation_deg = 0", "blocks.eo.sun_elevation_deg"),
        ("ground_reflectance = 0", "blocks.eo.ground_reflectance"),
        ('silhouette = "photo"', "blocks.eo.silhouette"),
    ],
)
def test_bad_parameters_are_problems_of_the_scene(scene, eo, key):
    with pytest.raises(SceneError) as caught:
        load_scene(scene(eo, ""))
    assert [problem.key for problem in caught.value.problems] == [key]


def test_a_silhouette_table_with_a_hole_is_a_problem_of_the_scene(scene, area_file):
    lines = area_file.read_text(encoding="utf-8").splitlines()
    area_file.write_text("\n".join(lines[:20] + lines[21:]), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(scene("", ""))
    assert len(caught.value.problems) == 6
    for problem in caught.value.problems:
        assert problem.key.endswith("silhouette_table") and "hole" in str(problem)


@pytest.mark.parametrize(
    ("band", "silhouette", "said"),
    [
        ("eo", "aspect_table", "eo.silhouette_table of target 'bare' is None"),
        ("ir", "aspect_table", "ir.silhouette_table of target 'bare' is None"),
        ("ir", "mesh", "target 'propeller' has ir.back_m2 14 and ir.front_m2 12"),
        ("eo", "mesh", "eo.side_m2 of target 'bare' is 0"),
    ],
)
def test_targets_that_lack_a_silhouette_are_a_problem_before_the_run(scene, band, silhouette, said):
    wish = f'silhouette = "{silhouette}"'
    path = scene(wish, "") if band == "eo" else scene("", wish)
    bare = (
        '[[blocks.traffic.intruders]]\nname = "bare"\neast_m = 0\nnorth_m = 2000\n'
        "eo = { front_m2 = 12, side_m2 = 0, horizontal_m2 = 90 }\n"
    )
    path.write_text(path.read_text(encoding="utf-8") + bare, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(path))
    (problem,) = caught.value.problems
    assert problem.key == f"blocks.{band}" and said in problem.message


@pytest.mark.parametrize("contrast", ["contrast", "contrast_ir"])
def test_what_has_no_contrast_makes_no_camera_look_farther(contrast):
    """The range of the faintest signature follows from the pixels that the visible one needs."""
    kind = {"contrast": "optical.eo", "contrast_ir": "optical.ir"}[contrast]
    grid = {**CAMERA, "azimuth_pixels": 8000, "azimuth_deg": [-40, 40]}
    grid |= {"elevation_pixels": 2000, "elevation_deg": [-10, 10]}
    camera = sensor(kind, threshold=50.0, static_weight=1.0, **grid)
    shown = {"front_m2": 1.0, "side_m2": 4.0, "horizontal_m2": 3.0}
    huge = {"front_m2": 100.0, "side_m2": 400.0, "horizontal_m2": 500.0}
    shown, huge = ({"eo": of, "ir": {**of, "back_m2": 0.5}} for of in (shown, huge))
    there = {"north_m": 900.0, "east_m": 0.0, "up_m": 0.0}
    small = {"name": "small", **there, contrast: 0.5, **shown}
    hidden = {"name": "hidden", **there, contrast: 0.0, **huge}

    def farthest_m(*targets):
        scene = dsa_des.load_scene(chain({"camera": camera}, targets=targets))
        return Simulation(scene).components["camera"].reach.range_max_m

    # 50 / 0.5 pixels of 0.01 degrees each way; 1 m is the margin.
    expected_m = 1.0 + math.sqrt(8.0 / (50.0 / 0.5)) / math.radians(0.01)
    for targets in ((small,), (small, hidden), (hidden, small)):
        assert farthest_m(*targets) == pytest.approx(expected_m, rel=1e-6)
    assert farthest_m(hidden) == pytest.approx(1.0)
