"""Scenes that extend others: other types, removed keys, and items of lists by their names."""

import pytest

import dsa_des
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.scene.scene import load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.studies.study_file import read_study

BASE = """
duration_s = 2
wires = ["traffic -> transform -> radar"]
[blocks.traffic]
type = "traffic.scripted"
[blocks.traffic.ownship]
lat_deg = 0
lon_deg = 0
alt_m = 1000
speed_mps = 70
[[blocks.traffic.intruders]]
name = "head_on"
east_m = 3000
north_m = 1
up_m = 0
speed_mps = 70
[[blocks.traffic.intruders]]
name = "N12.3 [b]"
east_m = 4000
north_m = 1
up_m = 0
speed_mps = 70
[blocks.transform]
type = "geometry.ellipsoid"
[blocks.radar]
type = "radar.swerling"
scan_rate_hz = 5
power_w = 1000
antenna_gain_db = 30
wavelength_m = 0.03
[blocks.radar.calibrate]
rcs_dbsm = 0
range_km = 10
pd = 0.5
"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "base.toml").write_text(BASE)

    def path(text, name="scene.toml", base="base.toml"):
        (tmp_path / name).write_text(f'extends = "{base}"\n{text}')
        return tmp_path / name

    return path


def east_m(scene, place):
    return float(scene.blocks["traffic"].parameters.intruders[place].east_m)


def test_another_type_drops_what_it_lacks_and_says_so(write):
    path = write('[blocks.radar]\ntype = "radar.range_boundary"\nrange_km = 5\n')
    scene = load_scene(path)
    assert set(scene.blocks["radar"].parameters.model_fields_set) == {"scan_rate_hz", "range_km"}
    dropped = {note.split()[0].removeprefix("blocks.radar.") for note in scene.notes}
    assert dropped == {"power_w", "antenna_gain_db", "wavelength_m", "calibrate"}
    assert all("base.toml" in note and "scene.toml" in note for note in scene.notes)


def test_a_typo_of_its_own_is_still_an_error(write):
    path = write('[blocks.radar]\ntype = "radar.range_boundary"\nrange_km = 5\npower_w = 2\n')
    with pytest.raises(SceneError, match=r"scene.toml: blocks.radar.power_w.*unknown parameter"):
        load_scene(path)
    path = write('[blocks.radar]\ntype = "radar.range_boundary"\nrange_km = 5\n')
    with pytest.raises(SceneError, match=r"command line: blocks.radar.power_w.*unknown"):
        load_scene(path, sets=["blocks.radar.power_w=3"])


def test_back_to_the_first_type_nothing_is_lost(write):
    write('[blocks.radar]\ntype = "radar.range_boundary"\nrange_km = 5\n', "middle.toml")
    path = write('[blocks.radar]\ntype = "radar.swerling"\n', base="middle.toml")
    scene = load_scene(path)
    assert scene.blocks["radar"].parameters.calibrate.range_km == 10
    (note,) = scene.notes
    assert "range_km" in note and "is kept" in note


def test_a_block_that_extends_a_sensor_of_another_type(write, tmp_path):
    (tmp_path / "sensor.toml").write_text(BASE.partition("[blocks.radar]\n")[2].partition("[")[0])
    path = write(
        '[blocks.second]\nextends = "sensor.toml"\ntype = "radar.range_boundary"\nrange_km = 9\n'
    )
    scene = load_scene(
        path, sets=['wires=["traffic -> transform -> radar", "transform -> second"]']
    )
    assert scene.blocks["second"].parameters.range_km == 9
    assert len(scene.notes) == 3


def test_notes_reach_standard_error_and_not_when_quiet(write, tmp_path, monkeypatch):
    from click.testing import CliRunner

    monkeypatch.chdir(tmp_path)
    path = str(write('[blocks.radar]\ntype = "radar.range_boundary"\nrange_km = 5\n'))
    checked = CliRunner().invoke(main, ["check", path])
    assert checked.exit_code == 0 and checked.stderr.count("was dropped") == 4
    run = ["run", path, "--no-figures"]
    for command in (run, [*run, "--json"]):
        done = CliRunner().invoke(main, command)
        assert done.exit_code == 0, done.stderr
        assert done.stderr == f"4 notes: dsa-des check {path}\n"
    assert CliRunner().invoke(main, [*run, "--quiet"]).output == ""


@pytest.mark.parametrize(
    "text",
    [
        '[blocks.radar]\nremove = ["calibrate"]\nbandwidth_hz = 1e6\n',
        'remove = ["blocks.radar.calibrate"]\nblocks.radar.bandwidth_hz = 1e6\n',
    ],
)
def test_an_inherited_key_is_removed(write, text):
    with pytest.raises(SceneError, match="exactly one of bandwidth_hz and calibrate"):
        load_scene(write("[blocks.radar]\nbandwidth_hz = 1e6\n"))
    scene = load_scene(write(text))
    assert scene.blocks["radar"].parameters.calibrate is None


def test_what_is_removed_may_be_given_anew(write):
    anew = "[blocks.radar.calibrate]\nrcs_dbsm = 1\nrange_km = 2\npd = 0.9\nswerling = 3\n"
    write('[blocks.radar]\nremove = ["calibrate"]\nbandwidth_hz = 1e6\n', "middle.toml")
    path = write(f'blocks.radar.remove = ["bandwidth_hz"]\n{anew}', base="middle.toml")
    assert load_scene(path).blocks["radar"].parameters.calibrate.range_km == 2


def test_removing_what_is_not_there_is_an_error(write):
    path = write('[blocks.radar]\nremove = ["calibrat"]\n')
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value) == (
        f"{path}: blocks.radar.remove = 'calibrat': nothing of this name is inherited; "
        "did you mean 'calibrate'?"
    )


WIRED = """
wires = ["traffic -> transform -> gate -> radar", "gate -> eye",
         { from = "radar.detections", to = "fusion", delay_s = 0.2 },
         { from = "eye", to = "fusion", drop_probability = 7 },
         "traffic -> transform -> gate -> eye -> fusion -> tracker"]
[blocks]
traffic = { type = "traffic.random" }
transform = { type = "geometry.ellipsoid" }
gate = { type = "gate" }
radar = { type = "radar.range_boundary" }
eye = { type = "optical.range_boundary" }
fusion = { type = "fusion.pick_best" }
tracker = { type = "tracking.stub" }
"""


@pytest.mark.parametrize("text", ['blocks.remove = ["eye"]', 'remove = ["blocks.eye"]'])
def test_the_wires_of_a_block_that_is_left_out_go_with_it(write, tmp_path, text):
    """What is left of a chain stays: by hand, hop by hop. Sources of keys move with their wires."""
    (tmp_path / "base.toml").write_text(WIRED)
    file = read_scene_file(write(text))
    assert "eye" not in file.data["blocks"]
    assert file.data["wires"] == [
        "traffic -> transform -> gate -> radar",
        {"from": "radar.detections", "to": "fusion", "delay_s": 0.2},
        "traffic -> transform -> gate",
        "fusion -> tracker",
    ]
    assert {key for key in file.sources if key[:1] == ("wires",)} == {
        ("wires",), *(("wires", k) for k in range(4)),
        *(("wires", 1, key) for key in ("from", "to", "delay_s")),
    }  # fmt: skip


def test_own_wires_of_a_block_that_is_left_out_are_an_error(write, tmp_path):
    (tmp_path / "base.toml").write_text(WIRED)
    path = write('wires = ["traffic -> transform -> gate -> eye"]\nblocks.remove = ["eye"]')
    with pytest.raises(SceneError, match="the scene has no block 'eye'"):
        load_scene(path)


def test_a_block_that_is_left_out_and_given_anew_keeps_its_wires(write, tmp_path):
    (tmp_path / "base.toml").write_text(WIRED)
    anew = 'blocks.remove = ["eye"]\nblocks.eye = { type = "radar.range_boundary" }'
    assert read_scene_file(write(anew)).data["wires"][1] == "gate -> eye"


def test_a_block_of_the_base_without_a_wire_is_said_once_and_how_to_leave_it_out(write, tmp_path):
    path = write('wires = ["traffic -> transform"]')
    with pytest.raises(SceneError) as refused:
        load_scene(path)
    assert [str(problem) for problem in refused.value.problems] == [
        f"{tmp_path / 'base.toml'}: blocks.radar: input 'targets' (RelativeTargets) is required "
        "and has no wire; the wires of scene.toml take the place of those that it extends: repeat "
        'them there, or leave the block out: blocks.remove = ["radar"]'
    ]
    assert set(load_scene(write('blocks.remove = ["radar"]')).blocks) == {"traffic", "transform"}


def test_items_of_lists_are_removed_and_changed_by_name(write):
    path = write('[blocks.traffic.intruders]\nremove = ["head_on"]\n"N12.3 [b]".east_m = 7\n')
    scene = load_scene(path)
    assert len(scene.blocks["traffic"].parameters.intruders) == 1
    assert east_m(scene, 0) == 7
    path = write("[blocks.traffic.intruders.head_on]\neast_m = -1e400\n")
    with pytest.raises(SceneError, match=r"scene.toml: blocks.traffic.intruders\[0\].east_m"):
        load_scene(path)
    path = write("[blocks.traffic.intruders.head_off]\neast_m = 1\n")
    with pytest.raises(SceneError, match="did you mean 'head_on'"):
        load_scene(path)


@pytest.mark.parametrize(
    ("key", "place"),
    [
        ("intruders.head_on.east_m", 0),
        ('intruders."head_on".east_m', 0),
        ("intruders['head_on'].east_m", 0),
        ("intruders[head_on].east_m", 0),
        ("intruders[0].east_m", 0),
        ("intruders.N12.3 [b].east_m", 1),
        ('intruders["N12.3 [b]"].east_m', 1),
    ],
)
def test_an_item_has_a_name_on_the_command_line(write, key, place):
    scene = load_scene(write(""), sets=[f"blocks.traffic.{key}=123"])
    assert [east_m(scene, 0), east_m(scene, 1)] == ([123, 4000] if place == 0 else [3000, 123])


@pytest.mark.parametrize("item", ["head_on", '"head_on"', "0", "N12.3"])
def test_an_item_has_a_name_in_replicas(write, item):
    scene = load_scene(write(""), sets=["blocks.traffic.intruders[1].name=N12.3"])
    changed = replica_scene(scene, Replica(1, {f"blocks.traffic.intruders.{item}.east_m": 5.0}))
    assert east_m(changed, int(item == "N12.3")) == 5


THIRD = "east_m = 5000\nnorth_m = 1\nup_m = 0\nspeed_mps = 70\n"


@pytest.mark.parametrize("name", ["third", "head_on_2"])
def test_a_table_of_a_new_name_adds_an_item(write, name):
    scene = load_scene(write(f"[blocks.traffic.intruders.{name}]\n{THIRD}"))
    assert [one.name for one in scene.blocks["traffic"].parameters.intruders][2:] == [name]
    assert [east_m(scene, place) for place in range(3)] == [3000, 4000, 5000]
    assert scene.notes == []
    wrong = write(f"[blocks.traffic.intruders.{name}]\n{THIRD}color = 1\n")
    with pytest.raises(SceneError, match=r"scene.toml: blocks.traffic.intruders\[2\].color"):
        load_scene(wrong)


@pytest.mark.parametrize("name", ["third", "head_on_2"])
def test_a_table_set_at_a_new_name_adds_an_item(write, name):
    scene = dsa_des.load_scene(write(""))
    item = {"east_m": 5000, "north_m": 1, "up_m": 0, "speed_mps": 70}
    more = scene.set({f"blocks.traffic.intruders.{name}": item})
    written = f"{{{', '.join(f'{key} = {value}' for key, value in item.items())}}}"
    for changed in (more, scene.set(f"blocks.traffic.intruders.{name}={written}")):
        assert [one.name for one in changed.blocks["traffic"].parameters.intruders][2:] == [name]
        assert [east_m(changed, place) for place in range(3)] == [3000, 4000, 5000]
    with pytest.raises(SceneError, match=r"no item 'head_onn'.* did you mean 'head_on'"):
        scene.set({"blocks.traffic.intruders.head_onn": {"east_m": 1}})


def test_a_table_of_a_name_in_a_list_of_wires_is_refused(write):
    with pytest.raises(SceneError, match=r"wires.*must be a list of wires") as found:
        load_scene(write('[wires.third]\nfrom = "traffic"\n'))
    assert len(found.value.problems) == 1  # and no block is blamed for missing one


def test_nearly_a_known_name_with_a_key_or_two_is_a_slip(write):
    with pytest.raises(SceneError, match=r"no item 'head_onn'.* did you mean 'head_on'"):
        load_scene(write("[blocks.traffic.intruders.head_onn]\neast_m = 1\n"))


def test_a_list_in_the_place_of_another_says_what_is_gone(write):
    item = f'[[blocks.traffic.intruders]]\nname = "third"\n{THIRD}'
    (note,) = load_scene(write(item)).notes
    assert "intruders of" in note and "takes the place of the whole list, head_on, N12.3" in note
    assert load_scene(write(item.replace("third", "head_on"))).notes[0].count("head_on") == 0


def test_unknown_and_ambiguous_names(write):
    with pytest.raises(SceneError, match=r"no item 'head_of'.* did you mean 'head_on'"):
        load_scene(write(""), sets=["blocks.traffic.intruders.head_of.east_m=1"])
    scene = load_scene(write(""))
    with pytest.raises(SceneError, match=r"no item 'head_of'.* did you mean 'head_on'"):
        replica_scene(scene, Replica(1, {"blocks.traffic.intruders.head_of.east_m": 1.0}))
    twice = [
        "blocks.traffic.intruders[1].name=head_on",
        "blocks.traffic.intruders.head_on.east_m=1",
    ]
    with pytest.raises(SceneError, match="2 items of the list are called 'head_on'"):
        load_scene(write(""), sets=twice)


def test_studies_address_items_by_name(write, tmp_path):
    write("")
    study = tmp_path / "study.toml"
    study.write_text(
        'scene = "scene.toml"\nmetrics = ["first_detection"]\nreplicas = 2\n'
        "set.blocks.traffic.intruders.head_on.speed_mps = 80\n"
        "axes.blocks.traffic.intruders.head_on.east_m = [1000, 2000]\n"
        "draws.blocks.traffic.intruders.head_on.north_m = {uniform = [0, 5]}\n"
    )
    read = read_study(study)
    assert [east_m(read.scene(cell), 0) for cell in range(2)] == [1000, 2000]
    drawn = replica_scene(read.scene(0), read.replica(1)).blocks["traffic"].parameters.intruders[0]
    assert 0 < float(drawn.north_m) <= 5
    assert float(drawn.speed_mps) == 80
    with study.open("a") as file:
        file.write('draws."blocks.traffic.intruders[0].east_m" = {uniform = [0, 5]}\n')
    with pytest.raises(SceneError, match="is set by the axis"):
        read_study(study)


def test_a_shipped_scene_is_extended_by_its_name_unless_a_file_has_it(write, tmp_path):
    scene = load_scene(write("duration_s = 3", base="first_light"))
    assert scene.duration_s == 3
    assert {"radar", "traffic", "fusion"} <= scene.blocks.keys()
    (tmp_path / "first_light").write_text(BASE)
    mine = load_scene(write("duration_s = 3", base="first_light"))
    assert [i.name for i in mine.blocks["traffic"].parameters.intruders] == ["head_on", "N12.3 [b]"]


def test_a_part_of_a_scene_is_extended_by_its_place_among_the_shipped_ones(write):
    text = '[blocks.radar]\nextends = "{}"\nscan_rate_hz = 5\n'
    part = read_scene_file(write(text.format("sensors/afrl_eo"))).data["blocks"]["radar"]
    assert part["type"].startswith("optical.") or "azimuth_pixels" in part
    assert part["scan_rate_hz"] == 5
    with pytest.raises(SceneError, match=r"there is no file .*no_such_part"):
        load_scene(write(text.format("sensors/no_such_part")))
    with pytest.raises(SceneError, match="there is no file"):
        load_scene(write(text.format("../first_light")))


def test_a_key_that_means_another_thing_in_another_type_is_named(write):
    """A range is where looks end to one radar and where all is seen to the other; a rate is one."""
    extra = '[blocks.radar]\ntype = "radar.range_boundary"\n'
    (write("").parent / "base.toml").write_text(BASE.replace("power_w", "range_km = 9\npower_w"))
    kept = [note for note in load_scene(write(extra)).notes if "is kept" in note]
    assert len(kept) == 1 and "blocks.radar.range_km of" in kept[0]
    assert "'Farthest range that is looked at' of radar.swerling" in kept[0]
    assert "'Range inside which every target is detected' of radar.range_boundary" in kept[0]
    said = load_scene(write(extra + "range_km = 8\n")).notes
    assert [note for note in said if "is kept" in note] == []
