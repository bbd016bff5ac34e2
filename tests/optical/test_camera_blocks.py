"""The camera blocks: their silhouettes, backgrounds and plumes are those of the physics."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from components.aircraft.aircraft import Aircraft, Roster
from components.optical.contrast import Background, contrast_gain
from components.optical.infrared_area import Plume, infrared_area
from components.optical.sensors import (
    ElectroOptical,
    ElectroOpticalParameters,
    Infrared,
    InfraredParameters,
)
from components.optical.silhouette import visible_area
from dsa_des.block.component import Context
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

AREA_TABLE = "az_deg,el_deg,area_m2\n" + "".join(
    f"{az},{el},{20.0 + 0.1 * abs(el) + 15.0 * abs(math.sin(math.radians(az)))}\n"
    for el in range(-90, 91, 30)
    for az in range(0, 360, 30)
)
AREAS = {"front_m2": 12.0, "side_m2": 30.0, "horizontal_m2": 90.0}
CAMERA = {"scan_rate_hz": 2, "azimuth_pixels": 1000, "elevation_pixels": 500}


@pytest.fixture
def area_file(tmp_path):
    path = tmp_path / "areas.csv"
    path.write_text(AREA_TABLE, encoding="utf-8")
    return path


@pytest.fixture
def crafts(area_file):
    """Three aircraft with tables, of other paint and engine each."""
    return [
        Aircraft(
            engine=engine,
            paint_reflectance=paint,
            contrast=paint + 0.5,
            eo={**AREAS, "silhouette_table": area_file},
            ir={**AREAS, "back_m2": 15.0, "silhouette_table": area_file},
        )
        for engine, paint in (("propeller", 0.1), ("turbofan", 0.5), ("turbojet", 0.9))
    ]


def cells_of(crafts, count=60):
    """Cells of the aircraft in turn, in random directions and attitudes."""
    rng = np.random.default_rng(8)
    roster = Roster.of([(f"target {i}", craft) for i, craft in enumerate(crafts)])
    target = np.arange(count) % len(crafts)

    class Some(SimpleNamespace):
        def __len__(self):
            return count

        def of_target(self, column):
            return column[target]

    return Some(
        roster=roster,
        target=target,
        craft=target,
        range_m=rng.uniform(200.0, 9000.0, count),
        azimuth_rad=rng.uniform(0.0, 6.2, count),
        elevation_rad=rng.uniform(-1.2, 1.2, count),
        relative_heading_rad=rng.uniform(-3.1, 3.1, count),
        target_pitch_rad=rng.uniform(-0.4, 0.4, count),
        target_roll_rad=rng.uniform(-0.9, 0.9, count),
    )


def view_of(cells):
    return (
        cells.relative_heading_rad,
        cells.target_pitch_rad,
        cells.target_roll_rad,
        cells.elevation_rad,
    )


def eo(**changes):
    return ElectroOptical("eo", ElectroOpticalParameters(**CAMERA, **changes), Context(Streams(1)))


def ir(**changes):
    return Infrared("ir", InfraredParameters(**CAMERA, **changes), Context(Streams(1)))


@pytest.mark.parametrize("silhouette", ["exact", "thesis", "convex_hull"])
def test_parametric_silhouettes(crafts, silhouette):
    cells = cells_of(crafts)
    seen = eo(silhouette=silhouette).area(cells)
    np.testing.assert_array_equal(seen, visible_area(*view_of(cells), **AREAS, model=silhouette))
    warm = ir(silhouette=silhouette).area(cells)
    expected = infrared_area(*view_of(cells), **AREAS, back_m2=15.0, model=silhouette)
    np.testing.assert_array_equal(warm, expected)


def test_tabulated_silhouettes(crafts):
    cells = cells_of(crafts)
    table = crafts[0].eo.silhouette_table.table
    expected = visible_area(*view_of(cells), model="aspect_table", table=table)
    np.testing.assert_array_equal(eo(silhouette="aspect_table").area(cells), expected)
    np.testing.assert_array_equal(ir(silhouette="aspect_table").area(cells), expected)
    cells = cells_of([crafts[0], Aircraft()])
    message = r"eo\.silhouette_table of target 'target 1' is None: .* needs a table of every target"
    with pytest.raises(ValueError, match=message):
        eo(silhouette="aspect_table").area(cells)
    eo().area(cells)


@pytest.mark.parametrize("silhouette", ["exact", "aspect_table"])
def test_plume_by_engine(crafts, silhouette):
    cells = cells_of(crafts)
    camera = ir(silhouette=silhouette, plume=True)
    extra = Plume().build(camera)(cells)
    for index, engine in enumerate(("propeller", "turbofan", "turbojet")):
        chosen = cells.target == index
        view = [angles[chosen] for angles in view_of(cells)]
        known = {**AREAS, "back_m2": 15.0}
        expected = infrared_area(*view, **known, engine=engine) - infrared_area(*view, **known)
        np.testing.assert_allclose(extra[chosen], expected, rtol=0, atol=1e-12)
        assert (expected.max() > 0.0) == (engine != "propeller")


def test_backgrounds(crafts):
    cells = cells_of(crafts)
    constant = np.array([0.6, 1.0, 1.4])[cells.target]
    np.testing.assert_array_equal(eo().contrast(cells), constant)
    assert not Background().verdict(eo()).simulated
    for background in ("auto", "sky", "ground"):
        camera = eo(
            background=background,
            sky="partly_cloudy",
            sun_azimuth_deg=100,
            sun_elevation_deg=25,
            sun_exclusion_deg=30,
            ground_reflectance=0.4,
        )
        expected = contrast_gain(
            model="daylight",
            contrast=constant,
            azimuth_rad=cells.azimuth_rad,
            elevation_rad=cells.elevation_rad,
            sun_azimuth_rad=math.radians(100),
            sun_elevation_rad=math.radians(25),
            sun_exclusion_rad=math.radians(30),
            paint_reflectance=np.array([0.1, 0.5, 0.9])[cells.target],
            ground_reflectance=0.4,
            sky="partly_cloudy",
            background=background,
        )
        seen = camera.contrast(cells) * Background().build(camera)(cells)
        np.testing.assert_array_equal(seen, expected)
        assert np.any(expected == 0.0) and np.any(expected > 0.0)  # some look into the sun


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


def run(path, window=None):
    memory = MemorySink()
    Simulation(load_scene(path), window=window, recorder=Recorder([memory])).run()
    return memory.tables()


CAMERAS = [
    ('silhouette = "aspect_table"', 'silhouette = "aspect_table"\nplume = true', ""),
    ('background = "auto"\nsun_azimuth_deg = 20', "plume = true", "visibility_km = 12"),
    ('silhouette = "convex_hull"\nbackground = "ground"', 'silhouette = "thesis"', ""),
    ("dynamic_weight = 2", 'silhouette = "convex_hull"\nplume = true', "visibility_km = 5"),
]


@pytest.mark.parametrize(("eo", "ir", "weather"), CAMERAS)
def test_windows_do_not_change_a_bit(scene, eo, ir, weather):
    path = scene(eo, ir, weather)
    path.write_text(path.read_text().replace("duration_s = 20", "duration_s = 8"))
    one, many = run(path, window=1), run(path)
    assert one.keys() == many.keys()
    for name, table in one.items():
        assert table.equals(many[name]), name
    assert {"eo", "ir"} <= set(one["detections"]["block"].to_pylist())


def test_haze_takes_its_share_of_the_daylight_contrast_once(scene):
    """Koschmieder: confidence + threshold is a·Q·P, and P falls by exp(-3.912 R/V)."""

    def signatures(weather):
        path = scene('background = "sky"\nthreshold = -1', "", weather)
        table = run(path)["detections"].to_pylist()
        rows = [row for row in table if row["block"] == "eo"]
        return {
            (row["scan"], row["target"]): (row["confidence"] - 1.0, row["true_range_m"])
            for row in rows
        }

    clear, hazy = signatures(""), signatures("visibility_km = 4")
    assert clear.keys() == hazy.keys() and len(clear) > 100
    for key, (signature, range_m) in clear.items():
        expected = signature * math.exp(-3.912 * range_m / 4e3)
        assert hazy[key][0] == pytest.approx(expected, rel=1e-12, abs=1e-14)


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
