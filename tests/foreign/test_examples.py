"""The programs of docs/foreign.md do what the page says, as blocks of a scene."""

import re
import shutil
import subprocess
from pathlib import Path

import pyarrow as pa
import pytest

import dsa_des

PAGE = (Path(__file__).parents[2] / "docs" / "foreign.md").read_text(encoding="utf-8")


def program(language):
    (found,) = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[:1]
    return found


def turns(command, folder):
    scene = dsa_des.load_scene(
        "configs/benchmark/manoeuvres.toml", swaps=["avoidance=foreign.process"], duration_s=3,
        sets=[f"blocks.avoidance.command={command}", f"blocks.avoidance.folder={str(folder)!r}"],
    )  # fmt: skip
    return dsa_des.run(scene).manoeuvres.select(["time_s", "turn_rad"]).to_pylist()


@pytest.fixture(autouse=True)
def _here(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])


def test_the_one_in_python(tmp_path):
    text = program("python")
    assert 35 <= text.count("\n") <= 45
    (tmp_path / "avoid.py").write_text(text)
    assert turns('["python", "avoid.py"]', tmp_path) == [{"time_s": 0.0, "turn_rad": 1.5708}]


def test_the_one_in_cpp(tmp_path):
    libraries = [*Path(pa.get_library_dirs()[0]).glob("libarrow.so.*")]
    if shutil.which("g++") is None or not libraries or not Path(pa.get_include()).is_dir():
        pytest.skip("needs g++ and the headers that pyarrow brings")
    text = program("cpp")
    assert text.count("\n") <= 40
    (tmp_path / "avoid.cpp").write_text(text)
    subprocess.run(
        ["g++", "-std=c++20", "avoid.cpp", f"-I{pa.get_include()}", str(libraries[0]),
         f"-Wl,-rpath,{libraries[0].parent}", "-o", "avoid"],
        cwd=tmp_path, check=True,
    )  # fmt: skip
    assert turns('["./avoid"]', tmp_path) == [{"time_s": 0.0, "turn_rad": 1.5708}]
