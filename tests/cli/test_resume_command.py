"""What a stopped study prints continues it when it is pasted into a shell."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import dsa_des
from dsa_des.cli import main
from dsa_des.results import folder as study_folder
from dsa_des.results.folder import StudyFolder
from tests.studies.conftest import small

__all__ = ["small"]

STUDY = """
scene = "small.toml"
replicas = 4
runs_per_chunk = 1
metrics = ["first_detection"]
set.duration_s = 2
"""
NAMES = [
    "plain",
    "with blank",
    "a$HOME;touch pwned;'b'",
    'quo"te`id`',
    "-dash",
    "new\nline\x1b[31m",
]


def shell(command: str, home: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a shell that finds ``dsa-des``."""
    tool = home / "bin" / "dsa-des"
    tool.parent.mkdir()
    code = "from dsa_des.cli import main; main()"
    tool.write_text(f"#!/bin/sh\nexec '{sys.executable}' -c '{code}' \"$@\"\n")
    tool.chmod(0o755)
    root = str(Path(dsa_des.__file__).parent.parent)
    env = os.environ | {
        "PATH": f"{tool.parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": f"{root}{os.pathsep}{home}",
    }
    return subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, env=env, check=False
    )


def stopping(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let the second part meet an error."""
    write = study_folder.write_file

    def fail(path: Path, content: bytes, **how: bool) -> None:
        if path.stem.endswith("1"):
            raise error
        write(path, content, **how)

    monkeypatch.setattr(study_folder, "write_file", fail)


@pytest.mark.parametrize("name", NAMES)
def test_the_printed_command_continues(
    small: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    Path(f"{name}.toml").write_text(STUDY)
    sets = ["--set", "title=\"$HOME; 'x'\"", "--set", "seed=5"]
    words = ["study", *sets, "--workers", "1", "--out", f"out {name}", "--", f"{name}.toml"]
    with monkeypatch.context() as patch:
        stopping(patch, OSError(28, "No space left on device"))
        stopped = CliRunner().invoke(main, words)
    assert stopped.exit_code == 1
    first, command = stopped.stderr.splitlines()
    assert first == (
        "stopped: results cannot be written: No space left on device; what is finished is kept, "
        "continue with"
    )
    assert command.isprintable() and "--workers 1" in command
    folder = Path(f"out {name}")
    assert len(list(folder.glob("parts/*"))) == 1
    if name != "plain":  # one process is enough to see that a shell takes it
        from shlex import split

        echoed = subprocess.run(
            ["bash", "-c", f"set -- {command}; printf '%s\\0' \"$@\""],
            capture_output=True,
            check=True,
        )
        again = echoed.stdout.decode().split("\0")[1:-1]
        if "$'" not in command:
            assert split(command)[1:] == again
        assert CliRunner().invoke(main, again).exit_code == 0
    else:
        done = shell(command.strip(), small)
        assert done.returncode == 0, done.stderr
    assert len(list(folder.glob("parts/*"))) == 4
    assert StudyFolder(folder).record.seed == 5
    assert not Path("pwned").exists()


@pytest.mark.parametrize(
    "where", ["run_study", "write_and_print_finished_study", "StudyFolder.open"]
)
def test_ctrl_c_is_130_wherever_it_comes(
    small: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    Path("study.toml").write_text(STUDY)

    def interrupt(*words: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"dsa_des.commands.study.{where}", interrupt)
    stopped = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "o"])
    assert stopped.exit_code == 130
    assert ("continue with" in stopped.stderr) == (where != "StudyFolder.open")


def test_ctrl_c_between_parts_is_130(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("study.toml").write_text(STUDY)
    stopping(monkeypatch, KeyboardInterrupt())
    stopped = CliRunner().invoke(main, ["study", "study.toml", "--workers", "1", "--out", "o"])
    assert stopped.exit_code == 130 and "--resume --out o" in stopped.stderr
