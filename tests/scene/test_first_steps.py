"""What a new user meets first: slips of the pen at the command line, and what is said of them."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main


def refusal(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 2
    return str(done.stderr)


@pytest.mark.parametrize(
    "scene, given, said",
    [
        ("replay_daa", "file=nofile.daa", ".file: "),
        ("first_light", "ownship.alt_m=1e9", ".ownship.alt_m = 1000000000.0: it must lie"),
        ("first_light", "intruders.crossing.name=head_on", ".intruders[1].name = 'head_on': the"),
        ("first_light", "ownship.pitch_deg=91", ".ownship.pitch_deg = 91: must be less"),
        ("first_light", "ownship.roll_deg=-361", ".ownship.roll_deg = -361: must be greater"),
    ],
)
def test_what_a_block_refuses_is_said_of_its_key_and_where_it_stands(
    tmp_path: Path, scene: str, given: str, said: str
) -> None:
    out = tmp_path / "run"
    text = refusal("run", scene, "--set", f"blocks.traffic.{given}", "--out", out)
    assert text.startswith(f"error: command line: blocks.traffic{said}")
    assert not out.exists()


def test_an_empty_name_is_said_to_be_empty() -> None:
    assert refusal("run", "").startswith("error: '': is empty: the name of a scene is needed")


@pytest.mark.parametrize("name", ["a/b", "a.b", "1a", "a b"])
def test_a_name_that_no_wire_can_hold_is_refused_at_its_block(tmp_path: Path, name: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(f'[blocks."{name}"]\ntype = "traffic.scripted"\nownship = {{}}\n')
    said = f"{scene}: blocks.{name} = {name!r}: is no name of a block: names are letters, digits"
    assert said in refusal("check", scene)


def test_a_misspelt_draw_gets_the_nearest_name(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(
        'scene = "first_light"\nreplicas = 2\n'
        '[draws]\n"blocks.traffic.ownship.alt_m" = {unifrom = [1, 2]}\n'
    )
    assert "{sequence = [first, step]}; did you mean 'uniform'?" in refusal("study", study)


def test_a_folder_of_a_run_without_its_duration_is_no_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    scene = "blocks.traffic.sample_interval_s=1"
    arguments = ["run", "first_light", "--no-figures", "--set", scene, "--out", str(folder)]
    assert CliRunner().invoke(main, [*arguments, "--duration", "1"]).exit_code == 0
    (folder / "run.json").write_text("{}")
    assert refusal("view", folder) == f"error: {folder}: holds no run: run.json has no duration_s\n"
    assert not folder.with_suffix(".html").exists()
