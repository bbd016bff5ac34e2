"""The shipped scenes and studies: listed, copied, and used by their names from any folder."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from components.embedding.simulator import Simulator
from dsa_des.cli import main
from dsa_des.scene.examples import examples
from dsa_des.studies.study_file import read_study

CONFIGS = Path(__file__).parents[2] / "configs"

Call = Callable[..., Result]


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Call the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, list(words))


def test_every_shipped_scene_and_study_has_a_line(call: Call) -> None:
    lines = call("examples").output.splitlines()
    assert {example.path.name for example in examples()} >= {
        path.name for folder in ("studies", "thesis") for path in (CONFIGS / folder).glob("*.toml")
    } - {"one_radar.toml"}  # a part: it has no traffic of its own
    for example in examples():
        (line,) = [line for line in lines if line.split()[0] == example.name]
        assert line.endswith(example.title)
    assert not any(line.split()[0] in ("f_16", "oasys_eo", "building") for line in lines)


def test_a_copy_has_every_file_as_it_was_and_runs(call: Call, tmp_path: Path) -> None:
    copied = call("examples", "--copy", "mine")
    files = {p.relative_to(CONFIGS) for p in CONFIGS.rglob("*") if p.is_file()}
    assert (copied.exit_code, copied.stdout) == (0, f"mine: {len(files)} files\n")
    copies = tmp_path / "mine"
    assert {p.relative_to(copies) for p in copies.rglob("*") if p.is_file()} == files
    assert all((copies / p).read_bytes() == (CONFIGS / p).read_bytes() for p in files)
    assert call("check", "mine/systems/oasys.toml").exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_copy_replaces_nothing(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    assert call("examples", "--copy", "mine").exit_code == 0
    (tmp_path / "mine/first_light.toml").write_text("mine")
    again = call("examples", "--copy", "mine")
    assert again.exit_code == 2
    assert again.output == "error: --copy mine: is not empty; a new folder is needed\n"
    assert (tmp_path / "mine/first_light.toml").read_text() == "mine"
    (tmp_path / "file").touch()
    refused = call("examples", "--copy", "file")
    assert refused.exit_code == 2 and "is a file" in refused.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "mine"]


def test_a_name_runs_as_its_file_does(call: Call, tmp_path: Path) -> None:
    for number, scene in enumerate(("first_light", str(CONFIGS / "first_light.toml"))):
        words = ("--duration", "3", "--quiet", "--no-figures", "--out", str(number))
        done = call("run", scene, *words)
        assert done.exit_code == 0, done.output
    named, filed = (tmp_path / "0", tmp_path / "1")
    for path in named.glob("*.parquet"):
        assert path.read_bytes() == (filed / path.name).read_bytes()
    assert (named / "scene.toml").read_bytes() == (filed / "scene.toml").read_bytes()


@pytest.mark.parametrize("command", ["check", "explain", "graph"])
def test_every_command_takes_names(call: Call, command: str) -> None:
    done = call(command, "systems/oasys")
    assert done.exit_code == 0, done.output


def test_a_study_takes_names_of_studies_and_of_scenes(call: Call, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(
        'scene = "first_light"\nreplicas = 2\nmetrics = ["first_detection"]\nset.duration_s = 1\n'
    )
    assert read_study("mine.toml").scene_path == CONFIGS / "first_light.toml"
    done = call("study", "radar_scan_rate", "--set", "replicas=1", "--set", "set.duration_s=2",
                "--workers", "1", "--quiet")  # fmt: skip
    assert done.exit_code == 0, done.output
    assert (tmp_path / "studies/radar_scan_rate-001").is_dir()


def test_a_comparison_takes_names(call: Call) -> None:
    done = call("compare", "first_light", "--swap", "transform=geometry.nothing")
    assert done.exit_code == 2 and "geometry.nothing" in done.output


def test_a_path_that_exists_wins(call: Call, tmp_path: Path) -> None:
    (tmp_path / "first_light").write_text("wrong")
    done = call("check", "first_light")
    assert done.exit_code == 2 and "first_light" in done.output
    assert call("check", "first_light.toml").exit_code == 0


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("run", "frist_light"), "'first_light'"),
        (("check", "first_ligth.toml"), "'first_light'"),
        (("run", "platforms/ground_rada"), "'ground_radar'"),
        (("study", "radar_scanrate"), "'radar_scan_rate'"),
        (("compare", "frist_light", "--swap", "gate=gate"), "'first_light'"),
        (("evidence", "noncoperative", "--out", "pack"), "'noncooperative'"),
    ],
)
def test_a_misspelt_name_gets_the_nearest(
    call: Call, tmp_path: Path, words: tuple[str, ...], meant: str
) -> None:
    (tmp_path / "first").mkdir()  # a run's folder is no scene that could be meant
    done = call(*words)
    assert done.exit_code == 2
    assert f"did you mean the shipped {meant}?" in done.output


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        (("run",), "scene"),
        (("study",), "study"),
        (("compare", "--swap", "gate=gate"), "scene or study"),
        (("evidence", "--out", "pack"), "case"),
    ],
)
def test_a_name_like_no_other_gets_the_list(call: Call, words: tuple[str, ...], kind: str) -> None:
    done = call(*words, "nonexist")
    assert (done.exit_code, done.output) == (
        2,
        f"error: nonexist: there is no such file, nor a shipped {kind} of that name "
        "(dsa-des examples lists them all)\n",
    )
    # A path is no name.
    assert call(*words, "nonexist.toml").output == "error: nonexist.toml: there is no such file\n"


def test_cases_stand_under_their_command(call: Call) -> None:
    lines = call("examples").output.splitlines()
    heads = [line for line in lines if not line.startswith(" ")]
    assert [head.rpartition("dsa-des ")[2] for head in heads] == [
        "run NAME", "study NAME", "evidence NAME",
    ]  # fmt: skip
    assert lines[lines.index(heads[2]) + 1].split()[0] == "noncooperative"


def test_a_misspelt_file_gets_the_nearest_file(call: Call, tmp_path: Path) -> None:
    (tmp_path / "first_lights.toml").touch()
    assert "did you mean first_lights.toml?" in call("check", "first_lihgts.toml").output


def test_a_host_takes_names(call: Call) -> None:
    simulator = Simulator("first_light")
    simulator.add_plane("intruder", aircraft="f_16")


def test_the_benchmark_and_the_thesis_find_their_scenes_anywhere(call: Call) -> None:
    done = call("reproduce", "fig-4.19", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)
