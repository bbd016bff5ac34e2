"""The scripts of docs/examples run as they stand, and their types hold."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import warm_process

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "docs" / "examples").glob("*.py"))
SAID = {
    "own_tracker": "__main__:SmoothingTracker: ",
    "scene_in_python": "radar.swerling: 204 detections",
    "study_to_dataframe": "declared.radar",
}


def test_there_are_three():
    assert [script.stem for script in SCRIPTS] == sorted(SAID)


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_it_runs_anywhere(script, tmp_path):
    done = warm_process.run([script], cwd=tmp_path, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert SAID[script.stem] in done.stdout
    assert (tmp_path / "plan.png").exists() == (script.stem == "scene_in_python")


USER = """
import dsa_des
scene = dsa_des.load_scene("first_light")
reveal_type(scene.set({"seed": 2}).swap(radar="radar.threshold"))
reveal_type(dsa_des.run(scene))
reveal_type(dsa_des.study(scene, metrics=["first_detection"]))
dsa_des.run(scene, owt="folder")
"""


@pytest.mark.slow
def test_types_hold_for_strict_checkers(tmp_path):
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(USER)
    kept = ROOT / ".mypy_cache" / "examples"  # what it found out of the libraries
    words = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent"]
    words.append(f"--cache-dir={kept}")
    done = subprocess.run(
        [*words, *map(str, SCRIPTS), "user.py"],
        cwd=tmp_path,
        env={**os.environ, "MYPYPATH": str(ROOT), "PYTHONPATH": ""},
        capture_output=True,
        text=True,
        timeout=300,
    )
    lines = done.stdout.splitlines()
    revealed = [line.partition("Revealed type is ")[2] for line in lines if "Revealed" in line]
    assert revealed == [
        '"dsa_des.scene.scene.Scene"',
        '"dsa_des.record.run_folder.Run"',
        '"dsa_des.library.study.StudyResult"',
    ]
    errors = [line for line in lines if ": error:" in line]
    assert len(errors) == 1 and 'Unexpected keyword argument "owt"' in errors[0]


@pytest.mark.slow
def test_the_first_snippet_of_the_page_leaves_nothing_behind(tmp_path):
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    snippet = text.partition("```python\n")[2].partition("```")[0]
    assert "dsa_des.study(" in snippet
    done = warm_process.run(["-c", snippet], cwd=tmp_path, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert "detections" in done.stdout and not list(tmp_path.iterdir())
