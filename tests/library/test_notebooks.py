"""What a notebook shows of scenes, runs and studies, and figures as values."""

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import dsa_des


@pytest.fixture(scope="module")
def scene() -> dsa_des.Scene:
    return dsa_des.load_scene("first_light", sets=["duration_s=10", "seed=3"])


@pytest.fixture(scope="module")
def run(scene: dsa_des.Scene) -> dsa_des.Run:
    return dsa_des.run(scene)


def test_a_figure_is_matplotlibs_and_is_saved_as_its_name_says(run: dsa_des.Run, tmp_path: Path):
    figure = run.figure("plan")
    assert isinstance(figure, Figure) and figure.axes
    assert figure._repr_png_().startswith(b"\x89PNG")
    for name, begins in (("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.pdf", b"%PDF")):
        for again in ("", "again-"):
            figure.save(tmp_path / f"{again}{name}")
        content = (tmp_path / name).read_bytes()
        assert content.startswith(begins) and content == (tmp_path / f"again-{name}").read_bytes()
    assert ET.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")
    with pytest.raises(dsa_des.UsageError, match=r"figure plan: .*a.jpg: .*\.png, \.svg, \.pdf"):
        figure.save(tmp_path / "a.jpg")


def test_a_figure_of_a_folder_is_its_file(scene: dsa_des.Scene, run: dsa_des.Run, tmp_path: Path):
    figure = dsa_des.run(scene, out=tmp_path / "run").figure("plan")
    assert figure._repr_png_() == run.figure("plan")._repr_png_()
    figure.save(tmp_path / "b.png")
    with pytest.raises(dsa_des.UsageError, match=r"b.svg: a name that ends in .png is needed"):
        figure.save(tmp_path / "b.svg")


def test_scenes_runs_and_studies_show_as_html(scene: dsa_des.Scene, run: dsa_des.Run):
    for name, block in scene.blocks.items():
        assert f"<td>{name}<td>{block.type_name}" in scene._repr_html_()
    html = run._repr_html_()
    assert html.startswith("<pre") and "detections" in html and "Sensors" in html
    assert "&lt;b&gt;" in scene.set("title='<b>'")._repr_html_()
    study = dsa_des.study(
        scene,
        axes={"blocks.radar.scan_rate_hz": [1, 2]},
        metrics=["first_detection"],
        figures=[{"metric": "detected.radar", "axis": "blocks.radar.scan_rate_hz"}],
        replicas=2,
        workers=1,
    )
    assert list(study.figures) == ["figure-01-axis"]
    assert "detected.radar" in study._repr_html_()
    assert all(isinstance(figure, Figure) for figure in study.figures.values())


def test_what_is_shown_is_one_value_and_no_line_by_itself(
    scene: dsa_des.Scene, run: dsa_des.Run, monkeypatch: pytest.MonkeyPatch
):
    study = dsa_des.study(scene, metrics=["first_detection"], replicas=2, workers=1)
    plain = run._repr_html_(), study._repr_html_()
    # Rich shows each line itself where it finds a notebook; IPython is not there to be asked.
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    assert (run._repr_html_(), study._repr_html_()) == plain


def test_a_scene_is_set_by_texts_as_the_command_line_has_them(scene: dsa_des.Scene):
    changed = scene.set("blocks.radar.scan_rate_hz=2", "seed=9")
    assert changed.seed == 9 and changed.blocks["radar"].parameters.scan_rate_hz == 2
    with pytest.raises(dsa_des.SceneError, match=r"scene.set: seed = '3': --set gives it twice"):
        scene.set("seed=2", "seed=3")
    with pytest.raises(dsa_des.SceneError, match="must have the form KEY=VALUE"):
        scene.set("seed")


def test_a_scene_is_set_to_a_table_that_extends_a_file(scene: dsa_des.Scene):
    table = {"extends": "sensors/oasys_specification.toml", "scan_rate_hz": 3}
    changed = scene.set({"blocks.radar": table}).blocks["radar"].parameters
    assert (changed.calibrate.range_km, changed.scan_rate_hz) == (5.6, 3)
    with pytest.raises(dsa_des.SceneError, match=r"sensors/oasis\.toml"):
        scene.set({"blocks.radar": {"extends": "sensors/oasis.toml"}})
