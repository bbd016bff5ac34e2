"""The command for section 4.2.1's comparison, on made-up aircraft."""

import csv
import sys

import numpy as np
import pytest

from components.optical.silhouette import visible_area
from components.thesis.silhouette_comparison import main

AREAS = {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 40.0}


@pytest.fixture
def reference(tmp_path):
    """A table that the exact model made itself, with nodes at every camera position."""
    lines = ["az_deg,el_deg,area_m2"]
    for el in range(-90, 91, 10):
        for az in range(0, 360, 10):
            view = (np.radians(180 + az), 0.0, 0.0, np.radians(-el))
            # An observer off the right wing sees a target that crosses to the right.
            lines.append(f"{az},{el},{float(visible_area(*view, **AREAS))!r}")
    path = tmp_path / "table.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def read(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_tables_and_figure(reference, tmp_path, capsys):
    out = tmp_path / "made" / "here"
    arguments = ["--areas", "4,20,40", "--reference", str(reference), "--out", str(out)]
    assert main([*arguments, "--title", "Made-up"]) == 0
    printed = capsys.readouterr().out
    errors = read(out / "errors.csv")
    assert [(row["model"], row["axis"]) for row in errors] == [
        (model, axis) for model in ("exact", "thesis") for axis in "xyz"
    ]
    # Against itself the exact model has no error; the thesis's has one about y only.
    for row in errors:
        wrong = (row["model"], row["axis"]) == ("thesis", "y")
        assert (float(row["max_error"]) > 1e-6) == wrong
        assert float(row["mean_error"]) <= float(row["max_error"])
    assert float(errors[4]["max_error"]) == pytest.approx(0.25 * 40 / 64, abs=2e-3)
    assert f"{100 * float(errors[4]['mean_error']):.1f} %" in printed
    curves = read(out / "curves.csv")
    assert len(curves) == 2 * 3 * 19
    assert max(float(row["model_share"]) for row in curves) == 1.0
    assert (out / "silhouettes.png").read_bytes().startswith(b"\x89PNG")


def test_aircraft_file_mesh_and_scale(configs, synthetic_aircraft, tmp_path, capsys):
    trimesh = pytest.importorskip("trimesh")
    mesh = tmp_path / "mesh.stl"
    vertices, faces = synthetic_aircraft
    # The file is in millimetres, with x forward, y left and z up.
    trimesh.Trimesh(vertices * [1e3, -1e3, -1e3], faces, process=False).export(mesh)
    out = tmp_path / "out"
    arguments = ["--aircraft", str(configs / "aircraft" / "beech_99.toml"), "--mesh", str(mesh)]
    arguments += ["--mesh-unit-m", "0.001", "--mesh-axes", "flu", "--models", "convex_hull"]
    arguments += ["--step-deg", "90", "--scale", "reference_maximum", "--out", str(out)]
    assert main(arguments) == 0
    assert "mesh" in capsys.readouterr().out
    curves = read(out / "curves.csv")
    assert {(row["model"], row["reference"]) for row in curves} == {("convex_hull", "mesh")}
    assert len(curves) == 9
    # Seen from above: 12 + 30 + 90 m² less their overlap, against some 50 m² of mesh.
    assert float(curves[1]["reference_share"]) == 1.0
    assert 1.5 < float(curves[1]["model_share"]) < 132 / 50


# changed arguments, message
BAD = [
    ({"--areas": "4,20"}, "--areas is '4,20': it must be three numbers"),
    ({"--areas": "4,20,x"}, "must be three numbers"),
    ({"--areas": "4,20,-1"}, "horizontal_m2 is -1: it must be finite and 0 or more"),
    ({"--models": "exact,best"}, "--models has 'best'"),
    ({"--step-deg": "7"}, "step_deg is 7"),
    ({"--reference": None}, "--reference and --mesh are missing"),
    ({"--reference": "none.csv"}, "none.csv"),
    ({"--areas": None, "--aircraft": "sensors/oasys.toml"}, "has no number eo.front_m2"),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_bad_arguments_are_named(changes, message, reference, tmp_path, configs, capsys):
    options = {"--areas": "4,20,40", "--reference": str(reference), "--out": str(tmp_path / "o")}
    options |= changes
    if "--aircraft" in changes:
        options["--aircraft"] = str(configs / changes["--aircraft"])
    arguments = [text for pair in options.items() if pair[1] is not None for text in pair]
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_without_trimesh_it_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    arguments = ["--areas", "4,20,40", "--mesh", "mesh.stl", "--out", str(tmp_path / "o")]
    assert main(arguments) == 2
    assert "pip install 'dsa-des[mesh]'" in capsys.readouterr().err
