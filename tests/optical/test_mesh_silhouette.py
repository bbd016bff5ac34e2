"""Silhouettes of triangle meshes against shapes with closed formulas."""

import sys

import numpy as np
import pytest

from components.optical.mesh import TriangleMesh, load_mesh
from components.optical.silhouette import visible_area


def as_general(mesh):
    """Send a convex mesh down the path for meshes that are not convex."""
    object.__setattr__(mesh, "is_convex", False)
    return mesh


def test_box_is_exact_from_everywhere(box, directions):
    u = directions(200)
    mesh = TriangleMesh(*box((2.0, 16.0, 0.2), (5.0, -3.0, 1.0)))
    expected = 3.2 * np.abs(u[0]) + 0.4 * np.abs(u[1]) + 32.0 * np.abs(u[2])
    assert mesh.is_convex
    np.testing.assert_allclose(mesh.projected_area(*u), expected, rtol=1e-14)
    scanned = as_general(TriangleMesh(*box((2.0, 16.0, 0.2)))).projected_area(*u)
    np.testing.assert_allclose(scanned, expected, rtol=1e-3)


def test_ellipsoid_by_both_methods(ellipsoid, directions):
    u = directions(60)
    body = ellipsoid((7.0, 1.0, 1.5), rings=48, sides=48)
    mesh = TriangleMesh(*body)
    smooth = np.pi * np.sqrt((1.5 * u[0]) ** 2 + (10.5 * u[1]) ** 2 + (7.0 * u[2]) ** 2)
    assert mesh.is_convex
    exact = mesh.projected_area(*u)
    np.testing.assert_allclose(exact, smooth, rtol=5e-3)  # the facets lie inside the ellipsoid
    scanned = as_general(TriangleMesh(*body)).projected_area(*u)
    np.testing.assert_allclose(scanned, exact, rtol=1e-4)


def test_bodies_that_hide_each_other_count_once(box, joined):
    # Two unit boxes 3 m apart along x: one hides the other from the front, not from the side.
    mesh = TriangleMesh(*joined(box((1, 1, 1)), box((1, 1, 1), (3.0, 0.0, 0.0))))
    assert not mesh.is_convex
    u = np.eye(3)
    assert mesh.projected_area(*u) == pytest.approx([1.0, 2.0, 2.0], rel=1e-12)
    # At 45 degrees in the x-y plane each is sqrt(2) wide and their centres are 3/sqrt(2) apart.
    assert mesh.projected_area(-np.sqrt(0.5), np.sqrt(0.5), 0.0) == pytest.approx(2 * np.sqrt(2.0))
    # At tan = 1/4 off the axis they overlap: centres are 3/sqrt(17) apart, each 5/sqrt(17) wide.
    u = np.array([4.0, 1.0, 0.0]) / np.sqrt(17.0)
    assert mesh.projected_area(*u) == pytest.approx(8.0 / np.sqrt(17.0), rel=1e-12)


def test_nested_and_doubled_shells_count_once(box, joined):
    for inner in (box((1, 1, 1)), box((2, 2, 2))):
        mesh = TriangleMesh(*joined(box((2, 2, 2)), inner))
        assert mesh.projected_area(0.0, 0.0, 1.0) == pytest.approx(4.0, rel=1e-12)


def test_crossing_wing_and_fuselage(synthetic_aircraft):
    mesh = TriangleMesh(*synthetic_aircraft)
    # From behind: a 32-gon of radius 1, a wing of 16 x 0.2 m through it, tail and fin sticking out.
    disc = 16.0 * np.sin(2.0 * np.pi / 32.0)
    behind = mesh.projected_area(1.0, 0.0, 0.0)
    low, high = 0.2, 0.4  # the wing's edges in z; the disc's half width there
    half = 0.5 * (np.sqrt(1 - low**2) + np.sqrt(1 - high**2))
    wing = 16.0 * 0.2 - 2 * half * 0.2
    tail = 6.0 * 0.1 - 2 * np.sqrt(1 - 0.4**2) * 0.1
    fin = 0.1 * 1.4
    assert behind == pytest.approx(disc + wing + tail + fin, rel=2e-3)


def test_finer_scan_lines_converge(synthetic_aircraft, directions):
    u = directions(24)
    coarse, fine, finest = (
        TriangleMesh(*synthetic_aircraft, rows=rows).projected_area(*u) for rows in (128, 512, 4096)
    )
    assert np.abs(coarse - finest).mean() > 2.0 * np.abs(fine - finest).mean()
    assert np.abs(fine / finest - 1.0).max() < 5e-3


def test_table_of_a_mesh_through_the_silhouette_call(synthetic_aircraft):
    mesh = TriangleMesh(*synthetic_aircraft, rows=256)
    table = mesh.build_silhouette_table(15.0)
    heading = np.radians([180.0, 90.0, 0.0, -90.0, 45.0, 180.0])
    elevation = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, -90.0])
    by_mesh = visible_area(heading, 0.0, 0.0, elevation, model="convex_hull", mesh=mesh)
    by_table = visible_area(heading, 0.0, 0.0, elevation, model="aspect_table", table=table)
    # All of these are nodes of the table; seen from either end of a line the scan lines differ.
    np.testing.assert_allclose(by_table, by_mesh, rtol=2e-2)
    with pytest.raises(ValueError, match=r"step_deg is 7\.0"):
        mesh.build_silhouette_table(7.0)


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_files_with_other_axes_and_units(tmp_path, box, suffix):
    trimesh = pytest.importorskip("trimesh")
    # 2000 x 400 x 100 mm along left, up, back in the file.
    vertices, faces = box((2000.0, 400.0, 100.0))
    path = tmp_path / f"box.{suffix}"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    mesh = load_mesh(path, unit_m=0.001, axes="lub")
    assert np.ptp(mesh.vertices_m, axis=0) == pytest.approx([0.1, 2.0, 0.4])
    assert mesh.projected_area(*np.eye(3)) == pytest.approx([0.8, 0.04, 0.2])


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_open_file_is_refused(tmp_path, box, suffix):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = box((1.0, 1.0, 1.0))
    path = tmp_path / f"open.{suffix}"
    trimesh.Trimesh(vertices, faces[1:], process=False).export(path)
    with pytest.raises(ValueError, match=rf"open\.{suffix}: the mesh is not closed: 3 of its 18"):
        load_mesh(path)


def test_missing_library_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match=r"pip install 'dsa-des\[mesh\]'"):
        load_mesh(tmp_path / "any.stl")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"faces": [[0, 1, 2]] * 3}, "faces has shape"),
        ({"faces": [[0, 1, 9]] * 4}, "faces must hold whole vertex numbers from 0 to 7"),
        ({"vertices_m": [[0.0, 0.0]]}, "vertices_m has shape"),
        ({"vertices_m": np.full((8, 3), np.nan)}, "vertices_m is nan"),
        ({"rows": 3}, "rows is 3"),
    ],
)
def test_bad_meshes_are_named(box, change, says):
    vertices, faces = box((1.0, 1.0, 1.0))
    with pytest.raises(ValueError, match=says):
        TriangleMesh(**{"vertices_m": vertices, "faces": faces, **change})


@pytest.mark.parametrize("change", [{"axes": "ffr"}, {"axes": "xyz"}, {"unit_m": 0.0}])
def test_bad_file_options_are_named(tmp_path, change):
    with pytest.raises(ValueError, match=next(iter(change))):
        load_mesh(tmp_path / "any.stl", **change)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("m.obj", b"", "is not a mesh that can be read"),
        ("m.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "do not have three coordinates"),
        ("m.obj", b"v 0 0 0\nf 1 2 9\n", "m.obj"),
        ("m.stl", bytes(range(256)), "is not a mesh that can be read"),
        ("m.zip", b"PK\x03\x04", "is not a mesh that can be read"),
    ],
)
def test_a_broken_mesh_is_named(tmp_path, capfd, name, content, message):
    pytest.importorskip("trimesh")
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message):
        load_mesh(path)
    assert "Traceback" not in capfd.readouterr().err
