"""Runs in Python: the bytes, the errors and the figures of the command line."""

import json
import subprocess
import sys

import pytest
from click.testing import CliRunner

import dsa_des
from dsa_des.cli import main

CHANGES = {"duration_s": 20, "blocks.radar.scan_rate_hz": 2}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """One scene, run by the command line, into a folder from Python, and in memory."""
    home = tmp_path_factory.mktemp("both")
    words = ["run", str(dsa_des.load_scene("first_light").path), "--out", str(home / "cli")]
    words += ["--set", "duration_s=20", "--set", "blocks.radar.scan_rate_hz=2"]
    done = CliRunner().invoke(main, [*words, "--swap", "radar=radar.threshold", "--quiet"])
    assert done.exit_code == 0, done.output
    scene = dsa_des.load_scene("first_light").set(CHANGES).swap(radar="radar.threshold")
    return home, dsa_des.run(scene, out=home / "python"), dsa_des.run(scene)


def test_a_folder_holds_the_bytes_of_the_command_line(both):
    home, _, _ = both
    names = sorted(file.name for file in (home / "cli").iterdir())
    assert names == sorted(file.name for file in (home / "python").iterdir())
    assert "detections.parquet" in names and "plan.png" in names
    for name in names:
        if name != "run.json":
            here, there = (home / folder / name for folder in ("python", "cli"))
            assert here.read_bytes() == there.read_bytes(), name
    infos = [json.loads((home / f / "run.json").read_text()) for f in ("python", "cli")]
    assert all(info.pop("timings") for info in infos)
    assert infos[0] == infos[1]


def test_a_run_in_memory_is_what_a_folder_holds(both):
    _, written, kept = both
    assert kept.path is None and written.path is not None
    assert kept.scene == written.scene
    assert kept.summary == written.summary != {}
    assert list(kept.tables) == list(written.tables)
    for name in kept.tables:
        assert kept[name].to_pylist() == written[name].to_pylist()
    assert kept.detections is kept["detections"]
    assert "detections" in dir(kept)


def test_figures_are_those_of_the_reports(both):
    _, written, kept = both
    assert set(kept.figures) == set(written.figures) == {"plan", "timeline"}
    for name in kept.figures:
        assert kept.figure(name).png == written.figure(name).png
        assert kept.figure(name)._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(dsa_des.UsageError, match="did you mean 'plan'"):
        kept.figure("plans")


def test_a_figure_is_saved(both, tmp_path):
    both[2].figure("plan").save(tmp_path / "mine.png")
    assert (tmp_path / "mine.png").read_bytes() == both[2].figure("plan").png


def test_runs_are_shown_in_at_most_ten_lines(both):
    for run in both[1:]:
        assert len(repr(run).splitlines()) <= 10
        assert "First light" in repr(run) and "detections" in repr(run)
        shown = str(run).splitlines()
        assert shown[: len(repr(run).splitlines())] == repr(run).splitlines()
        assert any(line.split()[:1] == ["radar"] for line in shown) and "\x1b" not in str(run)


def test_nothing_is_printed(short, capfd):
    dsa_des.run(short)
    assert capfd.readouterr() == ("", "")


def test_progress_is_a_callback(short):
    seen: list[float] = []
    dsa_des.run(short, progress=seen.append)
    assert seen[-1] == 10 and seen == sorted(seen)


def test_errors_are_those_of_the_command_line(short, tmp_path, own):
    class Failing(own.OwnRadar):
        def look(self, cells):
            raise ZeroDivisionError("on purpose")

    with pytest.raises(dsa_des.BlockFailure, match="on purpose"):
        dsa_des.run(short.swap(radar=Failing), out=tmp_path / "failed")
    assert not (tmp_path / "failed").exists()
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "letter.txt").write_text("mine")
    with pytest.raises(dsa_des.UsageError, match="taken"):
        dsa_des.run(short, out=tmp_path / "taken")
    with pytest.raises(dsa_des.SceneError, match="no such file"):
        dsa_des.run("nix.toml")


def test_run_is_a_function_and_importing_it_costs_nothing_heavy():
    code = (
        "import sys, dsa_des\n"
        "heavy = {'numpy', 'pyarrow', 'scipy', 'matplotlib', 'pydantic', 'simpy'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
        "assert callable(dsa_des.run)\n"
        "from dsa_des.running.simulation import Simulation\n"
        "assert callable(dsa_des.run) and dsa_des.Simulation is Simulation\n"
        "assert {'Scene', 'run', 'study'} <= set(dir(dsa_des))\n"
        "assert all(hasattr(dsa_des, name) for name in dsa_des.__all__)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)
