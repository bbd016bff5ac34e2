"""What is wrong with a case is said in a line before anything runs, and nothing is left."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from dsa_des.cli import main
from tests.evidence.small_case import CASE, evidence, write_case

BAD = {
    'unit = "of what is lost without"\n': ("", "requirements[0].unit: is required"),
    'unit = "of the encounters"': ('unit = " "', "requirements[1].unit = ' ': must not be empty"),
    "most = 2\n": ("", "requirements[0]: a requirement has one limit"),
    "most = 2": (
        "most = -2",
        "requirements[0].most = -2.0: no value of well_clear_lost_risk_ratio lies there; allowed:",
    ),
    "least = 0.01\nunit": (
        "least = 10\nunit",
        "requirements[1].least = 10.0: no value of manoeuvred lies there; allowed: between 0 and 1",
    ),
    "share = 1\n": ("share = -0.1\n", "convergence.share = -0.1"),
    "least = 0.01": ("least = 0.01\nmost = 3", "requirements[1]: a requirement has one limit"),
    'result = "manoeuvred"': ('result = "manoeuverd"', "did you mean 'manoeuvred'?"),
    'study = "study.toml"': ('study = "studi.toml"', "did you mean"),
    'avoidance = "a report"\n': ("", "sources.avoidance: is missing: nobody says where"),
    'wires = "a guess"\n': ("", "sources.wires: is missing"),
    'traffic = "us"': ('trafic = "us"', "did you mean 'traffic'?"),
    '[sample]\nmodel = "light aircraft"\n': ("[sample]\n", "sample.model: is required"),
    'also = ["needless_manoeuvre_share"]': ('also = ["needles"]', "also[0] = 'needles'"),
    'key = "blocks.avoidance.range_km"': ('key = "blocks.avoidance.rang"', "no such value"),
    'name = "turns"': ('name = "lost"', "requirements[1].name = 'lost': is given twice"),
    'name = "slow"': ('name = "assessed"', "beside[0].name = 'assessed': is given twice"),
    'of = "estimate"': ('of = "limits"', "did you mean 'limit'?"),
    'title = "A small case"': ('title = "A"\ntitel = "B"', "did you mean 'title'?"),
}


@pytest.mark.parametrize("text", BAD)
def test_a_bad_case(text, tmp_path):
    other, said = BAD[text]
    assert CASE.count(text) == 1
    case = write_case(tmp_path)
    case.write_text(CASE.replace(text, other), encoding="utf-8")
    output, code = evidence(case, "--out", tmp_path / "pack")
    assert code == 2 and said in output, output
    assert output.startswith("error: ") and not (tmp_path / "pack").exists()


def test_bad_calls(tmp_path):
    case = write_case(tmp_path)
    assert (
        "--encounters is 1: it must be 2 or more"
        in evidence(case, "--out", tmp_path / "pack", "--encounters", 1)[0]
    )
    (tmp_path / "full").mkdir()
    Path(tmp_path / "full" / "mine.txt").write_text("kept")
    output, code = evidence(case, "--out", tmp_path / "full")
    assert code == 2 and "is not empty; --resume continues a pack" in output
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["mine.txt"]


def test_a_pack_is_named_after_its_case_and_never_written_over(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = write_case(tmp_path / "here")
    few = case, "--workers", 1, "--encounters", 4
    output, code = evidence(*few, "--resume")
    assert (output, code) == ("error: --resume: there is no packs/case-NNN to continue", 2)
    case.write_text(CASE.replace('unit = "of the encounters"', ""), encoding="utf-8")
    assert evidence(*few)[1] == 2 and not (tmp_path / "packs").exists()
    case.write_text(CASE, encoding="utf-8")
    mine = tmp_path / "packs" / "case-001"
    mine.mkdir(parents=True)
    (mine / "mine.txt").write_text("kept")
    output, _ = evidence(*few)
    assert output.endswith("wrote packs/case-002/evidence.html")
    assert [path.name for path in mine.iterdir()] == ["mine.txt"]
    made = (tmp_path / "packs/case-002/evidence.json").read_bytes()
    # The latest is gone on with: there is nothing left to run.
    output, _ = evidence(*few, "--resume")
    assert output.endswith("wrote packs/case-002/evidence.html")
    assert (tmp_path / "packs/case-002/evidence.json").read_bytes() == made
    assert {path.name for path in (tmp_path / "packs").iterdir()} == {"case-001", "case-002"}


def test_where_no_folder_can_be_made(tmp_path):
    """Linux takes no folder in /proc, and calls it missing."""
    if not Path("/proc/self").exists():
        pytest.skip("there is no /proc")
    case = write_case(tmp_path)
    output, code = evidence(case, "--out", "/proc/x")
    said = "error: --out /proc/x: cannot be written: no folder can be made in /proc"
    assert (output, code) == (said, 2)
    result = CliRunner().invoke(main, ["study", str(tmp_path / "study.toml"), "--out", "/proc/x"])
    assert (" ".join(result.output.split()), result.exit_code) == (said, 2)


@pytest.mark.parametrize(("name", "takes_it"), [("first_light", "run"), ("swerling", "study")])
def test_a_scene_or_a_study_is_no_case(name, takes_it, tmp_path):
    output, code = evidence(name, "--out", tmp_path / "pack")
    assert code == 2 and output.endswith(f"{name}.toml: is no case: dsa-des {takes_it} takes it")
    assert len(output.splitlines()) == 1 and not (tmp_path / "pack").exists()


def test_a_study_of_several_cells_is_no_case(tmp_path):
    case = write_case(tmp_path)
    study = tmp_path / "study.toml"
    study.write_text(study.read_text() + "[axes]\nblocks.radar.range_km = [4, 9]\n")
    output, code = evidence(case, "--out", tmp_path / "pack")
    assert code == 2 and "study = 'study.toml': has 2 cells" in output
