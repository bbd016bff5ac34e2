"""What a study names counts by its content: however it is named, a change makes another study."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from dsa_des.studies.study_digest import record_of
from dsa_des.studies.study_file import read_study

CONFIGS = Path(__file__).parents[2] / "configs"
TABLE = "az_deg,el_deg,dbsm\n0,-90,1\n0,90,2\n180,-90,3\n180,90,4\n"
RADAR = "from components.radar.swerling import SwerlingRadar as Radar\n"
CAMERA = "from components.optical.sensors import ElectroOptical as Camera\n"
REPLAYED = """
extends = "own_base.toml"
duration_s = 2
[blocks.traffic]
file = "NAMED"
intruder = { extends = "plane.toml", rcs_table = "table.csv" }
"""
MODULES = """[blocks.radar]
type = "mine_of_a_study:Radar"
[blocks.eo]
type = "./sub/more.py:Camera"
"""
#: Scene, the study's other keys, and files that they name: content, and what is put after it.
CASES = {
    "recorded traffic": (
        REPLAYED, '[draws]\nblocks.traffic.file = { choice = ["drawn.daa", "NAMED"] }\n',
        {
            "traffic.daa": (CONFIGS / "encounters/crossing.daa", "\n"),
            "drawn.daa": (CONFIGS / "encounters/crossing.daa", "\n"),
            "table.csv": (TABLE, "\n"),
            "own_base.toml": ('extends = "replay_daa"\n', "seed = 8\n"),
            "plane.toml": ('extends = "aircraft/general_aviation"\n', "rcs_dbsm = 3\n"),
        },
    ),
    "modules": ('extends = "first_light"\nduration_s = 2\n' + MODULES, "", {
            "mine_of_a_study.py": (RADAR, "x = 1\n"),
            "sub/more.py": (CAMERA, "x = 1\n"),
    }),
    "terrain": (
        'extends = "terrain/behind_the_ridge"\nduration_s = 2\nterrain.raster = ["NAMED"]\n', "",
        {"S42W180.hgt": (CONFIGS / "terrain/S42W180.hgt", "")},
    ),
    "alerting and decisions": (
        'extends = "operator/session"\nduration_s = 2\nblocks.alerting.conf = "well.conf"\n'
        '[blocks.operator]\ntype = "operator.recorded"\ndecisions = "NAMED"\n',
        '[axes]\nblocks.guidance.conf = ["axis.conf"]\n',
        {
            "decisions.csv": (CONFIGS / "operator/recorded.csv", "\n"),
            "well.conf": (CONFIGS / "alerting/do365b.conf", "\n"),
            "axis.conf": (CONFIGS / "alerting/do365b.conf", "\n"),
        },
    ),
}  # fmt: skip


def written(folder, case, name="{file}"):
    """Write a study with all it names and return the first of its files."""
    scene, more, files = CASES[case]
    for file, (content, _) in files.items():
        (folder / file).parent.mkdir(exist_ok=True)
        text = content if isinstance(content, str) else content.read_bytes()
        (folder / file).write_bytes(text.encode() if isinstance(text, str) else text)
    first = next(iter(files))
    named = name.format(file=first, folder=folder)
    (folder / "scene.toml").write_text(scene.replace("NAMED", named))
    keys = 'scene = "scene.toml"\nreplicas = 2\nmetrics = ["first_detection"]\n'
    (folder / "study.toml").write_text(keys + more.replace("NAMED", named))
    return folder / first


def changed(path, more):
    """Change a file's content: of a raster, one height at its edge."""
    content = path.read_bytes()
    path.write_bytes(content + more.encode() if more else content[:-1] + b"\1")


def digest(study="study.toml"):
    return record_of(read_study(study)).study_sha256


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_every_file_that_is_named_counts(here, case):
    written(here, case)
    first = digest()
    assert digest(here / "study.toml") == first
    Path("beside.txt").write_text("named by nobody")
    for name, (_, more) in CASES[case][2].items():
        before = Path(name).read_bytes()
        changed(Path(name), more)
        assert digest() != first, name
        Path(name).write_bytes(before)
        assert digest() == first


@pytest.mark.parametrize(
    "name", ["{file}", "{folder}/{file}", "link.daa", "sub/../{file}", "~/{file}"]
)
def test_a_study_is_not_resumed_on_changed_traffic_whatever_its_path(here, name):
    first = written(here, "recorded traffic", name)
    Path("link.daa").symlink_to(first.name)
    Path("sub").mkdir()
    command = ["study", "study.toml", "--out", "o", "--workers", "1", "--quiet"]
    assert CliRunner().invoke(main, command).exit_code == 0
    shutil.copytree("o", "whole")
    changed(first, "\n")
    again = CliRunner().invoke(main, [*command, "--resume"])
    assert again.exit_code == 2 and "another study" in again.output
    part = next(Path("o/parts").iterdir()).name
    assert Path("o/parts", part).read_bytes() == Path("whole/parts", part).read_bytes()


def test_a_recorded_run_counts_with_all_its_files(here):
    written(here, "alerting and decisions", "before")
    Path("before").mkdir()
    shutil.copy("decisions.csv", "before/decisions.csv")
    Path("before/run.json").write_text("{}")
    tables = Path("before/decisions.parquet")
    import pyarrow.csv
    import pyarrow.parquet as pq

    pq.write_table(pyarrow.csv.read_csv("decisions.csv"), tables)
    first = digest()
    changed(Path("before/run.json"), "\n")
    assert digest() != first
