"""The cameras of the thesis's literature: a boundary, a line, and sampled silhouettes."""

import numpy as np
import pytest

from components.aircraft.known_targets import offered_rosters
from components.optical.area_of_cells import capsule_and_plate_mesh, silhouette_table_of_bodies
from components.optical.sensors import fuselage_length_m
from components.optical.silhouette import exact_area_of_bodies_union, visible_area
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = "configs/first_light.toml"
AREAS = (12.0, 30.0, 90.0)


def run(**options):
    sink = MemorySink()
    simulation = Simulation(load_scene(SCENE, **options), recorder=Recorder([sink]))
    simulation.run()
    return simulation, sink.tables()


def seen_by(tables, block):
    detections = tables["detections"].to_pylist()
    return [d for d in detections if d["block"] == block]


def test_a_range_boundary_sees_all_within_3_km_on_a_grid_of_a_tenth_of_a_degree():
    _, tables = run(swaps=["eo=optical.range_boundary"])
    found = seen_by(tables, "eo")
    ranges = [d["true_range_m"] for d in found]
    assert 2990.0 < max(ranges) <= 3000.0
    scans = [s for s in tables["scans"].to_pylist() if s["block"] == "eo"]
    assert sum(s["evaluated"] for s in scans) == len(found)
    steps = np.degrees([d["azimuth_rad"] for d in found]) / 0.1
    assert np.abs(steps - np.rint(steps)).max() < 1e-9


def test_a_line_is_detected_where_its_pixels_reach_the_threshold():
    noiseless = ["blocks.eo.noise_equivalent_contrast=0"]
    simulation, tables = run(swaps=["eo=optical.projection"], sets=noiseless)
    camera = simulation.components["eo"]
    (roster,) = offered_rosters(camera.context)
    craft = dict(zip(roster.names, roster.aircraft, strict=True))
    for d in seen_by(tables, "eo"):
        areas = craft[d["target"]].eo
        length = float(fuselage_length_m(np.array(areas.front_m2), np.array(areas.side_m2)))
        pixels = length / (d["true_range_m"] * camera.pixel_azimuth_rad)
        assert d["pixels"] == pytest.approx(pixels, rel=1e-12)
        assert 0.3 * pixels * craft[d["target"]].contrast >= 1.0 - 1e-9


def test_the_fuselage_is_a_cylinder_with_round_ends():
    front, side = np.array([np.pi, np.pi, 0.0]), np.array([0.0, 8.0, 9.0])
    assert fuselage_length_m(front, side).tolist() == [2.0, 6.0, 3.0]


def random_views(count=400):
    rng = np.random.default_rng(5)
    return (rng.uniform(-np.pi, np.pi, count), rng.uniform(-0.4, 0.4, count),
            rng.uniform(-0.8, 0.8, count), rng.uniform(-1.2, 1.2, count))  # fmt: skip


def union(view, back=None):
    areas = [np.full(len(view[0]), a) for a in AREAS]
    return exact_area_of_bodies_union(
        *view, *areas, None if back is None else np.full(len(view[0]), back)
    )


@pytest.mark.parametrize("back", [None, 24.0])
def test_a_sampled_table_is_the_union_at_its_nodes_and_near_it_between(back):
    view = random_views()
    table = silhouette_table_of_bodies(*AREAS, back)
    by_table = visible_area(*view, model="aspect_table", table=table)
    assert np.abs(by_table - union(view, back)).max() < 0.03 * sum(AREAS)
    nodes = (np.radians(180.0 - np.arange(0.0, 360.0, 30.0)), *np.zeros((2, 12)),
             np.full(12, np.radians(-25.0)))  # fmt: skip
    at_nodes = visible_area(*nodes, model="aspect_table", table=table)
    np.testing.assert_allclose(at_nodes, union(nodes, back), rtol=1e-9)


def test_a_mesh_of_the_bodies_is_the_closed_form_within_its_facets():
    view = random_views(60)
    by_mesh = visible_area(*view, model="convex_hull", mesh=capsule_and_plate_mesh(*AREAS))
    assert np.abs(by_mesh / union(view) - 1.0).max() < 0.03
    with pytest.raises(ValueError, match="has no mesh"):
        capsule_and_plate_mesh(0.0, 30.0, 90.0)
