"""The camera that sees pictures: pixels of targets, rendered areas, and flow."""

import functools
import math
import subprocess
import sys

import numpy as np
import pytest
from covering import covers
from same_runs import same_as_alone, same_in_any_window

import components.optical.image as image
from components.optical.flow import find_spot, spot_flow
from components.optical.picture import (
    Pinhole,
    capsule_and_plate_outlines,
    polygon_pixel_shares,
    union_coverage,
)
from components.optical.silhouette import exact_area_of_bodies_union
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "optical/pictures.toml"
QUIET = [
    "blocks.eo.noise_equivalent_contrast=0.01", "blocks.eo.false_alarms_per_frame=0.0001",
    "blocks.eo.false_alarms=false",
]  # fmt: skip

NUMBERS = "scan", "pixels", "snr"
#: Banks at once, in the southern hemisphere.
TURNING = (
    "blocks.traffic.ownship={ lat_deg = -33.9, lon_deg = 18.4, alt_m = 900, heading_deg = 217, "
    'speed_mps = 45, legs = [{ kind = "straight", duration_s = 3 }, '
    '{ kind = "turn", rate_deg_s = 4 }] }'
)
NEAR = (
    "blocks.traffic.intruders=["
    '{ name = "crossing", north_m = -900, east_m = -800, up_m = 60, heading_deg = 130, '
    "speed_mps = 70, eo = { front_m2 = 3, side_m2 = 9, horizontal_m2 = 21 } }, "
    '{ name = "oncoming", north_m = -1700, east_m = -1250, up_m = -90, heading_deg = 40, '
    "speed_mps = 50, eo = { front_m2 = 2, side_m2 = 14, horizontal_m2 = 25 } }]"
)


def detections(configs, *sets, **options):
    sink = MemorySink()
    scene = load_scene(configs / SCENE, sets=[*QUIET, *sets])
    simulation = Simulation(scene, recorder=Recorder([sink]), **options)
    simulation.run()
    table = sink.tables()["detections"]
    return simulation, table.filter([name == "eo" for name in table["block"].to_pylist()])


def rotation(heading, pitch, roll):
    """From NED to body axes, one axis after the other."""
    a, b, c = np.cos([heading, pitch, roll])
    d, e, f = np.sin([heading, pitch, roll])
    about_z = np.array([[a, d, 0], [-d, a, 0], [0, 0, 1]])
    about_y = np.array([[b, 0, -e], [0, 1, 0], [e, 0, b]])
    about_x = np.array([[1, 0, 0], [0, c, f], [0, -f, c]])
    return about_x @ about_y @ about_z


def test_a_pinhole_keeps_lines_straight_and_comes_back():
    """Against homogeneous coordinates: a point x ahead, y right, z down is at (y, z) / x."""
    pinhole = Pinhole(math.radians(80.0), (-0.3, 0.2), 2048, 1000, azimuth_rad=0.4)
    point = rotation(0.4, 0.0, 0.0).T @ np.array([700.0, -310.0, 95.0])
    azimuth = math.atan2(point[1], point[0])
    elevation = math.atan2(-point[2], math.hypot(*point[:2]))
    column, row = pinhole.pixel(azimuth, elevation)
    assert column == pytest.approx(1024.0 * (1.0 - 310.0 / 700.0 / math.tan(math.radians(40.0))))
    share = (math.tan(0.2) + 95.0 / 700.0) / (math.tan(0.2) + math.tan(0.3))
    assert row == pytest.approx(1000.0 * share)
    assert pinhole.direction(column, row) == pytest.approx((azimuth, elevation))
    assert np.isnan(pinhole.pixel(0.4 + 2.0, 0.0)).all()  # behind


def coverage(corners, rows, columns):
    picture = np.zeros((rows, columns))
    ((box, share),) = polygon_pixel_shares(corners[np.newaxis], rows, columns)
    picture[box] = share
    return picture


def test_pixels_are_covered_by_the_exact_share():
    corners = np.array([[-3.2, 2.1], [12.7, 5.5], [9.1, 21.3], [0.0, 9.0]])
    share = coverage(corners, 16, 14)
    fine = (np.arange(40) + 0.5) / 40
    x, y = np.meshgrid(np.arange(14)[:, None] + fine, np.arange(16)[:, None] + fine)
    inside = np.ones(x.shape, dtype=bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0.0
    counted = inside.reshape(16, 40, 14, 40).mean(axis=(1, 3))
    assert np.abs(share - counted).max() < 0.02
    assert share.sum() == pytest.approx(counted.sum(), rel=1e-3)
    assert coverage(corners[::-1], 16, 14) == pytest.approx(share)


def test_rendered_areas_are_those_of_the_silhouette():
    rng = np.random.default_rng(5)
    n = 60
    azimuth, elevation = rng.uniform(0.0, 6.2, n), rng.uniform(-1.0, 1.0, n)
    angles = rng.uniform(-3.0, 3.0, n), rng.uniform(-0.5, 0.5, n), rng.uniform(-1.2, 1.2, n)
    bodies = rng.uniform(1.0, 9.0, n), rng.uniform(6.0, 30.0, n), rng.uniform(8.0, 60.0, n)
    outlines = capsule_and_plate_outlines(azimuth, elevation, np.full(n, 1e5), angles, bodies)
    want = exact_area_of_bodies_union(angles[0] - azimuth, *angles[1:], elevation, *bodies, None)
    for i in range(n):
        line = np.array(
            [
                math.cos(elevation[i]) * math.cos(azimuth[i]),
                math.cos(elevation[i]) * math.sin(azimuth[i]),
                -math.sin(elevation[i]),
            ]
        )
        right = np.array([-math.sin(azimuth[i]), math.cos(azimuth[i]), 0.0])
        axes = np.stack([right, np.cross(line, right)], axis=1)
        drawn = [30.0 + 2.0e5 * outline[i] @ axes for outline in outlines]
        smear = rng.uniform(-3.0, 3.0, 2)
        area_m2 = union_coverage(drawn, 60, 60, smear).sum() / 4.0
        assert area_m2 == pytest.approx(want[i], rel=0.01)


@pytest.fixture(scope="module")
def seen(request):
    configs = request.getfixturevalue("configs")
    sets = [
        "blocks.eo.scan_rate_hz=25",
        "blocks.eo.texture_contrast=0.005",
        "blocks.eo.mount_azimuth_deg=7",
        "blocks.eo.mount_roll_deg=-12",
        "duration_s=6",
    ]
    table = detections(configs, *sets, TURNING, NEAR)[1]
    texts = {"target": np.array(table["target"].to_pylist())}
    numbers = [n for n in table.column_names if n.endswith(("_px", "_rad")) or n in NUMBERS]
    return texts | {n: np.array(table[n].to_pylist(), dtype=float) for n in numbers}


def test_flow_is_that_of_the_target_while_the_platform_turns(seen):
    """Successive looks are a frame apart: the truth is how far the true pixel has moved."""
    assert (seen["pixels"] >= 3).sum() > 100
    farthest = 0.0
    for name in ("crossing", "oncoming"):
        mine = seen["target"] == name
        follows = np.diff(seen["scan"][mine]) == 1
        large = follows & (seen["pixels"][mine][1:] >= 5) & (seen["snr"][mine][1:] > 25)
        off = []
        for axis in ("column", "row"):
            moved = np.diff(seen[f"true_{axis}_px"][mine])
            off.append((seen[f"flow_{axis}_px"][mine][1:] - moved)[large])
            farthest = max(farthest, np.abs(moved[large]).max(initial=0.0))
        off = np.hypot(*off)
        assert off.size > 10 and np.isfinite(off).all()
        assert np.quantile(off, 0.99) < 0.1 and np.abs(np.median(off)) < 0.05
    assert farthest > 20.0
    assert np.isnan(seen["flow_row_px"][seen["pixels"] < 3]).all()


def test_pixels_are_those_of_an_independent_projection(seen):
    """Of the true direction in body axes, turned by the mounting as matrices."""
    body = np.stack([np.cos(seen["true_elevation_rad"]) * np.cos(seen["true_azimuth_rad"]),
                     np.cos(seen["true_elevation_rad"]) * np.sin(seen["true_azimuth_rad"]),
                     -np.sin(seen["true_elevation_rad"])])  # fmt: skip
    x, y, z = rotation(math.radians(7.0), 0.0, math.radians(-12.0)) @ body
    column = 1024.0 * (1.0 + y / x / math.tan(math.radians(40.0)))
    row = 512.0 * (1.0 + z / x / math.tan(math.radians(20.0)))
    assert seen["true_column_px"] == pytest.approx(column, abs=1e-6)
    assert seen["true_row_px"] == pytest.approx(row, abs=1e-6)
    assert np.std(seen["column_px"] - column) < 0.5


@covers(
    "exposure_s", "frame_interval_s", "texture_contrast", "texture_pixels", of=("optical.image",)
)  # fmt: skip
def test_smear_and_fine_clutter_hide_a_target_and_flow_grows_with_time(configs):
    @functools.cache
    def recorded(texture, keys):
        sets = [f"blocks.eo.{key}={value}" for key, value in keys]
        sets.append(f"blocks.eo.texture_contrast={texture}")
        return detections(configs, *sets, "duration_s=6", TURNING, NEAR)[1]

    def median(name, texture=0.0, **keys):
        table = recorded(texture, tuple(keys.items()))
        values = np.array(table[name].to_pylist(), dtype=float)
        turning = np.array(table["time_s"].to_pylist()) > 3.1
        return np.nanmedian(np.abs(values[turning]))

    clear, cluttered = median("snr"), median("snr", texture=0.05)
    assert median("snr", exposure_s=0.04) < 0.95 * clear
    assert cluttered < 0.6 * clear
    assert median("snr", texture=0.05, texture_pixels=60) > 1.2 * cluttered
    flow = median("flow_column_px")
    assert flow > 1.0
    assert median("flow_column_px", frame_interval_s=0.08) == pytest.approx(2.0 * flow, rel=0.1)


def test_a_target_hides_what_is_behind_it(configs, monkeypatch):
    """A large target before a strong texture: in its middle there is itself and noise."""
    middles, sides = [], []

    def kept(picture, *rest):
        spot = find_spot(picture, *rest)
        if spot.pixels > 60:
            row, column = int(spot.y), int(spot.x)
            middles.append(picture[row - 1 : row + 2, column - 1 : column + 2].mean())
            sides.append(picture[:2].std())
        return spot

    monkeypatch.setattr(image, "find_spot", kept)
    near = (
        'blocks.traffic.intruders=[{ name = "near", north_m = -240, east_m = -180, up_m = 20, '
        "heading_deg = 130, speed_mps = 40, eo = { front_m2 = 9, side_m2 = 30, "
        "horizontal_m2 = 21 } }]"
    )
    detections(configs, "blocks.eo.texture_contrast=0.3", "duration_s=2", TURNING, near)
    assert len(middles) > 5 and np.mean(sides) > 0.15
    assert np.std(middles) < 0.03 and np.mean(middles) == pytest.approx(1.0, abs=0.03)


def test_it_is_the_same_in_any_window_and_beside_other_replicas(configs):
    sets = ["duration_s=3", "blocks.eo.texture_contrast=0.05"]
    scenes = [load_scene(configs / SCENE, sets=[*QUIET, *sets], seed=seed) for seed in (9, 4)]
    assert same_in_any_window(scenes[0], (3,))["detections"].num_rows > 10
    same_as_alone(scenes)


def test_what_cannot_be_is_refused(configs):
    for key, value, said in (
        ("azimuth_deg", "[-110, 110]", "a plane picture needs at most 170 deg"),
        ("noise_equivalent_contrast", "0", "a picture has noise"),
        ("errors", '"signal"', "the picture has its own errors"),
        ("silhouette", '"round"', "silhouette"),
        ("exposure_s", "0.5", "at most frame_interval_s"),
    ):
        with pytest.raises(SceneError, match=said):
            scene = load_scene(configs / SCENE, sets=[f"blocks.eo.{key}={value}"])
            Simulation(scene)


def test_without_opencv_one_line_says_how_it_is_had(configs):
    code = (
        "import sys; sys.modules['cv2'] = None\n"
        "from dsa_des.cli import main\n"
        f"main(['run', {str(configs / SCENE)!r}, '--set', 'duration_s=1'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2 and "pip install 'dsa-des[image]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_lies_on_its_side_flows_sideways_and_as_surely():
    """A picture has no axis of its own: with rows for columns x is y, and the error stays."""
    rows, columns = np.mgrid[:32, :32] + 0.5
    noise = 0.02 * np.random.default_rng(3).standard_normal((2, 32, 32))

    def seen(x, y):
        return np.exp(-0.5 * (((columns - x) / 2.6) ** 2 + ((rows - y) / 1.3) ** 2))

    earlier, later = noise + np.stack([seen(14.2, 15.4), seen(16.6, 16.1)])
    everywhere = np.ones((32, 32), dtype=bool)
    spot = find_spot(later, everywhere, 0.8, 0.02)
    found = spot_flow(earlier, later, spot, everywhere, 0.02)
    assert (found.x, found.y) == pytest.approx((2.4, 0.7), abs=0.1)
    turned = find_spot(later.T, everywhere, 0.8, 0.02)
    other = spot_flow(earlier.T, later.T, turned, everywhere, 0.02)
    assert (other.y, other.x) == pytest.approx((found.x, found.y), abs=1e-6)
    assert other.deviation == pytest.approx(found.deviation, rel=1e-6)
