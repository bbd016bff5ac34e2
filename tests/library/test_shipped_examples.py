"""Shipped scenes, studies and cases: found by name, all can be read, and none has notes."""

import pytest

import dsa_des
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation
from dsa_des.scene.examples import examples, find_example
from dsa_des.scene.scene import load_scene
from dsa_des.studies.study_file import read_study


def test_each_is_found_by_its_name_and_scenes_are_whole():
    kinds = {example.kind for example in examples()}
    assert kinds == {"scene", "study", "case"}
    for example in examples():
        assert find_example(example.name, example.kind) == example.path
        if example.kind == "scene":
            assert dsa_des.load_scene(example.name).title == example.title


#: What some of them leave out is said: the thesis draws a fade a scan, and a data sheet has no air.
LEFT_OUT = {
    "fig_4_21": "each scan draws a fade of its own",
    "data_sheet": "gas attenuation",
}


def test_shipped_scenes_are_quiet():
    """They are right, or say that they mean it: no run of another begins with notes."""
    notes = {
        example.name: notes_of_scene(Simulation(load_scene(example.path)))
        for example in examples()
        if example.kind == "scene"
    }
    assert len(notes) > 40
    for name, said in LEFT_OUT.items():
        (note,) = notes.pop(name)
        assert said in note
    assert {name: said for name, said in notes.items() if said} == {}


def test_a_shipped_study_can_be_read():
    path = find_example("radar_scan_rate")
    assert (
        path is not None and read_study(path).title == "Radar scan rate against declaration range"
    )


def test_parts_of_scenes_are_no_examples_but_have_names():
    names = {example.name for example in examples()}
    assert "detect_and_sense" not in names and "first_light" in names
    assert find_example("aircraft/glider") is not None


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../README", "/etc/hosts", "nix", "first_light/", "a\0b"]
)
def test_what_is_no_name_of_an_example(name):
    assert find_example(name) is None or name == "first_light/"


def test_a_stem_that_a_scene_and_a_part_share_means_the_scene():
    path = find_example("oasys", "scene")
    assert path is not None and path.parent.name == "systems"


@pytest.mark.parametrize("conf", ["alerting/do365b.conf", "do365b.conf"])
def test_a_file_beside_scenes_goes_by_its_name(tmp_path, monkeypatch, conf):
    monkeypatch.chdir(tmp_path)
    scene = dsa_des.load_scene("alerting/first_light", sets=[f"blocks.alerting.conf={conf}"])
    found = scene.blocks["alerting"].parameters.conf
    assert found.name == "do365b.conf" and found.is_file()
    (tmp_path / "alerting").mkdir()
    own = tmp_path / conf
    own.write_text(found.read_text())
    again = dsa_des.load_scene("alerting/first_light", sets=[f"blocks.alerting.conf={conf}"])
    assert again.blocks["alerting"].parameters.conf == own
    with pytest.raises(dsa_des.SceneError, match=r"blocks\.alerting\.conf"):
        dsa_des.run(scene.set("blocks.alerting.conf=alerting/do356b.conf"))
