"""Scenes in Python: found by name, changed without harm, refused with one error."""

import copy
import tomllib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import dsa_des
from components.radar.threshold_radar import ThresholdRadar
from dsa_des.files.toml_files import to_toml


def test_a_name_a_path_and_a_table_give_the_same_scene(configs, monkeypatch):
    path = configs / "first_light.toml"
    by_path = dsa_des.load_scene(path).resolved()
    assert dsa_des.load_scene("first_light").resolved() == by_path
    monkeypatch.chdir(configs)
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    assert dsa_des.load_scene(table).resolved() == by_path


def test_a_file_of_the_working_directory_comes_before_a_shipped_name(
    tmp_path, monkeypatch, configs
):
    text = to_toml(dsa_des.load_scene(configs / "first_light.toml").resolved())
    (tmp_path / "first_light").write_text(text.replace("First light", "Mine"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert dsa_des.load_scene("first_light").title == "Mine"


def test_changes_leave_the_scene_as_it_was(short):
    before = copy.deepcopy(short.resolved())
    changed = short.set({"blocks.radar.scan_rate_hz": 2}).swap(radar=ThresholdRadar)
    assert short.resolved() == before
    assert changed.resolved()["blocks"]["radar"]["scan_rate_hz"] == 2
    assert changed.blocks["radar"].cls is ThresholdRadar
    assert changed.blocks["radar"].type_name == "radar.threshold"  # a class has its name


def test_changes_are_those_of_the_command_line(configs):
    path = configs / "first_light.toml"
    here = dsa_des.load_scene(path).swap(radar="radar.range_boundary")
    here = here.set({"seed": 7, "duration_s": 9})
    there = dsa_des.load_scene(path, swaps=["radar=radar.range_boundary"], seed=7, duration_s="9")
    assert here.resolved() == there.resolved()
    assert here.dropped == there.dropped != []


def test_a_swap_keeps_what_the_new_type_knows_and_drops_what_it_does_not(short):
    swapped = short.set({"blocks.radar.scan_rate_hz": 3}).swap({"radar": "radar.threshold"})
    assert swapped.resolved()["blocks"]["radar"]["scan_rate_hz"] == 3
    assert all(key.startswith("blocks.radar.") for key in swapped.dropped)


@pytest.mark.parametrize("value", [2, 2.0, "2", Fraction(2), np.float64(2), np.int64(2)])
def test_numbers_of_all_kinds(short, value):
    changed = short.set({"blocks.radar.scan_rate_hz": value})
    assert Fraction(changed.resolved()["blocks"]["radar"]["scan_rate_hz"]) == 2


def test_paths_of_a_table_are_those_of_the_working_directory(configs, tmp_path, monkeypatch):
    (tmp_path / "flight.daa").write_bytes((configs / "encounters/crossing.daa").read_bytes())
    monkeypatch.chdir(tmp_path)
    scene = dsa_des.load_scene("replay_daa").set({"blocks.traffic.file": "flight.daa"})
    assert Path(scene.resolved()["blocks"]["traffic"]["file"]) == tmp_path / "flight.daa"
    traffic = {"file": Path("flight.daa")}
    table = {"extends": str(configs / "replay_daa.toml"), "blocks": {"traffic": traffic}}
    scene = dsa_des.load_scene(table)
    assert Path(scene.resolved()["blocks"]["traffic"]["file"]) == tmp_path / "flight.daa"


def test_classes_that_no_other_process_finds(short, own):
    class Inner(own.OwnRadar):
        pass

    for cls in (own.OwnRadar, Inner):
        scene = short.swap(radar=cls).set({"seed": 3})
        assert scene.blocks["radar"].cls is cls
        assert scene.resolved()["blocks"]["radar"]["type"] == cls.import_path()
    table = {**short.origin[0].data}
    table["blocks"] = {**table["blocks"], "radar": {**table["blocks"]["radar"], "type": Inner}}
    assert dsa_des.load_scene(table).blocks["radar"].cls is Inner


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: s.set({"blocks.radr.scan_rate_hz": 2}), "did you mean 'radar'?"),
        (lambda s: s.set({"blocks.radar.scan_rate_hz": -2}), "scene.set: blocks.radar.scan_rate"),
        (lambda s: s.set({"blocks.radar.scan_rate_hz": None}), "is of the type NoneType"),
        (lambda s: s.set({"swap.radar": "radar.threshold"}), "scene.swap"),
        (lambda s: s.swap(radr="radar.threshold"), "scene.swap: radr = 'radr': the scene has no"),
        (lambda s: s.swap(radar="radar.threshhold"), "did you mean 'radar.threshold'?"),
        (lambda s: s.swap(radar=int), "is not a dsa_des.Component"),
        (lambda s: s.swap(radar=3), "module:Class, or a class"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_error(short, change, said):
    with pytest.raises(dsa_des.SceneError) as error:
        change(short)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("first_lite", "did you mean 'first_light'?"),
        ("nix.toml", "there is no such file"),
        ({}, "scene: blocks: a scene needs at least one block"),
        ({"blocks": {"a": {"type": object()}}}, "scene: blocks.a.type: is of the type object"),
        ({"extends": "nix.toml"}, "scene: extends: "),
        ({1: 2}, "has the key 1"),
        (3, "must be a path"),
    ],
)
def test_what_is_no_scene_is_one_error(source, said):
    with pytest.raises(dsa_des.SceneError) as error:
        dsa_des.load_scene(source)
    assert said in str(error.value)


@pytest.mark.parametrize("name", ["first_light", "ten_thousand", "replay_daa"])
def test_scenes_are_shown_in_at_most_ten_lines(name):
    scene = dsa_des.load_scene(name)
    assert len(repr(scene).splitlines()) <= 10
    assert repr(scene.title) in repr(scene)
    hostile = scene.set({"title": "a\x1b[2J\nb" * 100})
    assert len(repr(hostile).splitlines()) <= 10 and "\x1b" not in repr(hostile)
