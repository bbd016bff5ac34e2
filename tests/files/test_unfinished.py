"""What killed processes left is removed; what living ones are at never is."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dsa_des.files import output_file as module
from dsa_des.files.output_file import (
    EARLIER,
    PREFIX,
    remove_abandoned_temporary_files,
    temporary_folder,
)
from dsa_des.files.output_folder import OutputFolder

DYING = """
import os, signal
from pathlib import Path
from dsa_des.files.output_file import temporary_folder
with temporary_folder(Path("{name}")) as folder:
    (folder / "half").write_text("x")
    {more}
    os.kill(os.getpid(), signal.SIGKILL)
"""


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


def killed(place, name="run", more="pass"):
    code = DYING.format(name=name, more=more)
    done = subprocess.run([sys.executable, "-c", code], cwd=place, check=False)
    assert done.returncode == -9
    (found,) = place.glob(f"{PREFIX}*")
    return found


def test_the_next_run_into_the_same_place_removes_what_a_killed_one_left(tmp_path):
    killed(tmp_path)
    with OutputFolder(tmp_path / "other").write_then_rename() as folder:
        assert left_in(tmp_path) == [folder.parent.name]
    assert left_in(tmp_path) == ["other"]


def test_what_a_living_process_is_at_stays(tmp_path):
    with temporary_folder(tmp_path / "run") as folder:
        code = (
            "from dsa_des.files.output_file import *; "
            f"remove_abandoned_temporary_files(Path({str(tmp_path)!r}))"
        )
        subprocess.run([sys.executable, "-c", code], check=True)
        remove_abandoned_temporary_files(tmp_path)  # not even this process takes it for left over
        assert left_in(folder) == ["lock"]
    assert left_in(tmp_path) == []


def test_what_another_machine_is_at_stays(tmp_path, monkeypatch):
    killed(tmp_path)
    monkeypatch.setattr(module, "_host_name", lambda: "somewhere else")
    remove_abandoned_temporary_files(tmp_path)
    assert len(left_in(tmp_path)) == 1
    monkeypatch.undo()
    remove_abandoned_temporary_files(tmp_path)
    assert left_in(tmp_path) == []


def test_nothing_is_removed_where_files_cannot_be_locked(tmp_path, monkeypatch):
    killed(tmp_path)

    def refuse(file, operation):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(module.fcntl, "flock", refuse)
    with temporary_folder(tmp_path / "run"):
        assert len(left_in(tmp_path)) == 2
    assert len(left_in(tmp_path)) == 1


def test_an_earlier_run_is_put_back_if_its_replacement_never_came(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "result").write_text("earlier")
    killed(tmp_path, more=f"Path('run').rename(folder / '{EARLIER}')")
    assert not (tmp_path / "run").exists()
    remove_abandoned_temporary_files(tmp_path)
    assert (tmp_path / "run" / "result").read_text() == "earlier"
    assert left_in(tmp_path) == ["run"]


@pytest.mark.parametrize("content", ["", "{}", "[]", "x", '{"dsa_des": "mine", "host": ""}'])
def test_what_only_looks_like_ours_stays(content, tmp_path):
    folder = tmp_path / f"{PREFIX}abc"
    folder.mkdir()
    (folder / "lock").write_text(content)
    (folder / "work").write_text("years of it")
    (tmp_path / f"{PREFIX}link").symlink_to(folder)
    remove_abandoned_temporary_files(tmp_path)
    assert left_in(folder) == ["lock", "work"]
    (folder / "lock").unlink()
    remove_abandoned_temporary_files(tmp_path)
    assert left_in(folder) == ["work"]


def test_links_in_what_was_left_are_not_followed(tmp_path):
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "work").write_text("")
    folder = killed(tmp_path, more="os.symlink('../precious', folder / 'link')")
    lock = folder / "lock"
    about = json.loads(lock.read_text())
    lock.write_text(json.dumps({**about, "target": "../../escaped"}))
    (folder / EARLIER).mkdir()
    remove_abandoned_temporary_files(tmp_path)
    assert left_in(tmp_path) == ["escaped", "precious"]
    assert left_in(tmp_path / "precious") == ["work"]


def test_folders_whose_maker_was_killed_at_once_and_old_files_go_as_well(tmp_path):
    (tmp_path / f"{PREFIX}1").mkdir()
    (tmp_path / f"{PREFIX}2").mkdir()
    (tmp_path / f"{PREFIX}2" / "lock").write_text("")
    for name, age_s in (("old", 7200), ("new", 60)):
        (tmp_path / f"{PREFIX}{name}").write_text("")
        then = time.time() - age_s
        os.utime(tmp_path / f"{PREFIX}{name}", (then, then))
    remove_abandoned_temporary_files(tmp_path)
    assert left_in(tmp_path) == [f"{PREFIX}new"]


def test_a_maker_whose_folder_is_cleared_away_at_once_makes_another(tmp_path, monkeypatch):
    (tmp_path / "runs").mkdir()
    real, tries = os.open, []

    def robbed(path, *args, **kwargs):
        if str(path).endswith("lock") and len(tries) < 3:
            tries.append(path)
            Path(path).parent.rmdir()
            if len(tries) == 2:
                (tmp_path / "runs").rmdir()  # somebody who failed removes what it made
        return real(path, *args, **kwargs)

    monkeypatch.setattr(os, "open", robbed)
    with temporary_folder(tmp_path / "runs" / "x") as folder:
        assert left_in(folder) == ["lock"]
    assert len(tries) == 3
