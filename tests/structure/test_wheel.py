"""What is in the wheel: the packages and the shipped scenes, and nothing else."""

import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest

from dsa_des import __version__

ROOT = Path(__file__).parents[2]
PACKAGES = ("dsa_des", "components")


def backend_is_there() -> bool:
    """Whether the wheel can be built without fetching what builds it."""
    try:
        return bool(version("hatchling"))
    except PackageNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not backend_is_there(), reason="hatchling is not installed")
def test_the_wheel_holds_the_packages_and_the_scenes_and_nothing_else(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-index", "--no-build-isolation",
         "--disable-pip-version-check", "--wheel-dir", str(tmp_path), str(ROOT)],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob(f"dsa_des-{__version__}-*.whl")
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    code = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    configs = ROOT / "configs"
    scenes = {
        f"components/configs/{path.relative_to(configs).as_posix()}"
        for path in configs.rglob("*")
        if path.is_file()
    }
    assert inside == code | scenes
    assert "components/configs/first_light.toml" in inside
    assert not any({"tests", "docs"} & set(name.split("/")) for name in inside)


def test_one_version_stands_in_all_places() -> None:
    """`dsa_des/record/version.py` holds it; the wheel takes it from there."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "dsa_des/record/version.py"
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.+)$", cited, re.MULTILINE)[1] == __version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## ([\w.]+)", changes, re.MULTILINE)[:2] == ["Unreleased", __version__]


def test_the_oldest_python_that_is_named_is_the_one_that_is_needed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [
        tuple(map(int, version.split(".")))
        for line in project["classifiers"]
        if (version := line.rpartition(":: ")[2])[:2] == "3." and version[2:].isdigit()
    ]
    assert project["requires-python"] == ">={}.{}".format(*min(named))
