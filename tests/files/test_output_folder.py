"""A folder of results appears whole or not at all, and only where nothing is lost by it."""

import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from dsa_des.errors import OutputError, UsageError
from dsa_des.files import output_names
from dsa_des.files.output_folder import OutputFolder, make_results_folder
from dsa_des.files.output_names import make_numbered_folder, new_folder_name, user_path
from dsa_des.record.run_folder import write_run_json


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


def fill(folder, text="one"):
    (folder / "scene.toml").write_text(text)
    write_run_json(folder, {"seed": 1})


def write(target, text="one"):
    with OutputFolder(target).write_then_rename() as folder:
        fill(folder, text)


def text_of(folder):
    return (folder / "scene.toml").read_text()


def test_a_folder_takes_its_name_when_it_is_complete(tmp_path):
    target = tmp_path / "new" / "deep" / "run"
    with OutputFolder(target).write_then_rename() as folder:
        assert target not in (folder, *folder.parents) and target.parent in folder.parents
        assert not target.exists()
        fill(folder)
    assert left_in(target.parent) == ["run"]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(target.stat().st_mode) == 0o777 & ~umask


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_nothing_is_left_when_the_block_raises(error, tmp_path):
    with pytest.raises(error), OutputFolder(tmp_path / "a" / "b").write_then_rename() as folder:
        fill(folder)
        raise error
    assert left_in(tmp_path) == []


def test_an_earlier_run_is_replaced_only_by_a_complete_one(tmp_path):
    target = tmp_path / "run"
    write(target, "one")
    with pytest.raises(RuntimeError), OutputFolder(target).write_then_rename():
        raise RuntimeError
    assert text_of(target) == "one"
    write(target, "two")
    assert text_of(target) == "two"
    assert left_in(tmp_path) == ["run"]


def test_an_empty_folder_may_be_used(tmp_path):
    (tmp_path / "run").mkdir()
    write(tmp_path / "run")
    assert text_of(tmp_path / "run") == "one"


@pytest.mark.parametrize("name", ["notes.txt", "sub/", "link", "tracks.parquet"])
def test_a_run_with_something_foreign_in_it_stays(name, tmp_path):
    target = tmp_path / "run"
    write(target)
    if name.endswith("/"):
        (target / name).mkdir()
    elif name == "link":
        (target / name).symlink_to(tmp_path)
    else:
        (target / name).write_text("years of work")
    with pytest.raises(UsageError, match="other than a run: " + name.rstrip("/")):
        write(target, "two")
    assert left_in(target) == sorted(["run.json", "scene.toml", name.rstrip("/")])
    assert text_of(target) == "one"
    assert left_in(tmp_path) == ["run"]


def test_many_foreign_files_are_counted(tmp_path):
    for number in range(9):
        (tmp_path / f"{number}.txt").write_text("")
    with pytest.raises(UsageError, match=r"0\.txt, 1\.txt, 2\.txt and 6 more; choose a new name"):
        OutputFolder(tmp_path).check()


def test_numbers_count_up_past_whatever_has_the_name(tmp_path):
    assert new_folder_name(tmp_path, "scene").name == "scene-001"
    (tmp_path / "scene-001").mkdir()
    (tmp_path / "scene-002").write_text("")
    (tmp_path / "scene-003").symlink_to("nowhere")
    assert new_folder_name(tmp_path, "scene").name == "scene-004"


def test_two_runs_at_once_without_a_name_both_stay(tmp_path):
    first, second = (OutputFolder(tmp_path / "runs", "scene") for _ in range(2))
    with first.write_then_rename() as folder:
        fill(folder, "first")
        with second.write_then_rename() as other:
            fill(other, "second")
    assert first.path != second.path
    assert (text_of(first.path), text_of(second.path)) == ("first", "second")
    assert left_in(tmp_path / "runs") == ["scene-001", "scene-002"]


def test_a_failed_run_takes_no_number(tmp_path):
    with pytest.raises(RuntimeError), OutputFolder(tmp_path / "runs", "scene").write_then_rename():
        raise RuntimeError
    assert left_in(tmp_path) == []


TEN = """
import sys
from pathlib import Path
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import make_numbered_folder
with OutputFolder(Path("runs"), "scene").write_then_rename() as folder:
    (folder / "me").write_text(sys.argv[1])
    print("ready", flush=True)
    sys.stdin.read()
(make_numbered_folder(Path("studies"), "study") / "me").write_text(sys.argv[1])
"""


def test_ten_processes_at_once_get_ten_folders(tmp_path):
    def start(number):
        return subprocess.Popen(
            [sys.executable, "-c", TEN, str(number)],
            cwd=tmp_path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    all_of_them = [start(number) for number in range(10)]
    for process in all_of_them:
        assert process.stdout.readline() == "ready\n"
    for process in all_of_them:
        process.stdin.close()
    for process in all_of_them:
        assert process.wait(30) == 0
        process.stdout.close()
    for home, stem in (("runs", "scene"), ("studies", "study")):
        folders = left_in(tmp_path / home)
        assert folders == [f"{stem}-{number:03d}" for number in range(1, 11)]
        found = {(tmp_path / home / name / "me").read_text() for name in folders}
        assert found == {str(number) for number in range(10)}


def test_a_run_that_appeared_under_the_same_name_meanwhile_stays_and_so_does_ours(tmp_path):
    target = tmp_path / "run"
    ours = OutputFolder(target)
    with (
        pytest.raises(OutputError, match=r"the results are in .*run-001"),
        ours.write_then_rename() as one,
    ):
        fill(one, "ours")
        write(target, "theirs")
    assert text_of(target) == "theirs"
    assert ours.path == tmp_path / "run-001" and text_of(ours.path) == "ours"
    assert left_in(tmp_path) == ["run", "run-001"]


def test_what_somebody_put_into_the_earlier_run_meanwhile_stays(tmp_path):
    target = tmp_path / "run"
    write(target, "earlier")
    with (
        pytest.raises(OutputError, match="run-001"),
        OutputFolder(target).write_then_rename() as folder,
    ):
        fill(folder, "later")
        (target / "notes.txt").write_text("mine")
    assert left_in(target) == ["notes.txt", "run.json", "scene.toml"]
    assert text_of(target) == "earlier" and text_of(tmp_path / "run-001") == "later"


# -- places ----------------------------------------------------------------------------------------


def refused(target, match):
    """A place that is refused before anything is done."""
    with pytest.raises(UsageError, match=match), OutputFolder(target).write_then_rename():
        pytest.fail("the block was entered")


@pytest.mark.parametrize("name", [".", "..", "../..", "./../here", "../here/."])
def test_the_working_directory_and_what_holds_it_are_never_replaced(name, tmp_path, monkeypatch):
    here = tmp_path / "here"
    write(here)
    monkeypatch.chdir(here)
    refused(Path(name), "(is|holds) the working directory; name a folder inside it")
    assert text_of(here) == "one" and left_in(here) == ["run.json", "scene.toml"]
    assert left_in(tmp_path) == ["here"]


def test_home_and_the_root_are_never_replaced(tmp_path, monkeypatch):
    (tmp_path / "users" / "me").mkdir(parents=True)
    monkeypatch.setenv("HOME", str(tmp_path / "users" / "me"))
    refused(user_path("~"), "is your home folder")
    refused(tmp_path / "users", "holds your home folder")
    refused(Path("/"), "working directory")
    assert left_in(tmp_path / "users") == ["me"]
    assert user_path("~/x") == tmp_path / "users" / "me" / "x"


def test_links_are_refused_and_stay(tmp_path):
    write(tmp_path / "real")
    for link, end in (("to", "real"), ("dangling", "nowhere"), ("loop", "loop")):
        (tmp_path / link).symlink_to(end)
        refused(tmp_path / link, "is a symbolic link to")
        assert os.readlink(tmp_path / link) == end
    refused(tmp_path / "loop" / "x", "Too many levels of symbolic links")
    assert text_of(tmp_path / "real") == "one"
    write(tmp_path / "to" / "inside")  # a link above the folder is nobody's loss
    assert text_of(tmp_path / "real" / "inside") == "one"


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("a" * 256, "File name too long"),
        ("new/" + "é" * 128, "File name too long"),
        ("new/" * 1100 + "run", "File name too long"),
        ("file", "is a file"),
        ("file/run", "Not a directory"),
        ("new/../run", "No such file or directory"),
        ("file/deep/run", "Not a directory"),
        ("pipe", "is a file"),
        ("a\0b", "NUL"),
        ("a\udcff", "not UTF-8"),
    ],
)
def test_impossible_names_are_refused(name, match, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    refused(Path(name), match)
    assert left_in(tmp_path) == ["file", "pipe"]


@pytest.mark.parametrize("name", ["x" * 255, "new/deep/", "./there/../other", "-x", "~", "ä b\n"])
def test_odd_names_that_are_possible_work(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    write(Path(name))
    assert text_of(tmp_path / name) == "one"


@pytest.mark.parametrize(
    ("text", "match"),
    [("", "is empty"), ("  ", "is empty"), ("~no such user/x", "no home folder"), ("a\0", "NUL")],
)
def test_texts_that_name_nothing(text, match):
    with pytest.raises(UsageError, match=match):
        user_path(text)


def test_a_mount_point_is_refused(tmp_path, monkeypatch):
    (tmp_path / "on disk").mkdir()
    mounts = tmp_path / "mountinfo"
    escaped = str(tmp_path / "on disk").replace(" ", r"\040")
    mounts.write_text(f"36 35 98:0 /here {escaped} rw,noatime - ext3 /dev/root rw\n\nshort\n")
    monkeypatch.setattr(output_names, "_MOUNTS", mounts)
    refused(tmp_path / "on disk", "is a mount point")
    monkeypatch.setattr(output_names, "_MOUNTS", tmp_path / "none")
    write(tmp_path / "on disk")
    refused(Path("/proc"), "is a mount point")


def test_a_working_directory_that_is_gone_is_one_message(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    refused(Path("run"), "No such file or directory")


@pytest.fixture
def restricted():
    """A folder in which we are an ordinary user, which root is not."""
    place = Path(tempfile.mkdtemp())
    place.chmod(0o777)
    other = os.geteuid() == 0
    if other:
        os.seteuid(65534)
    yield place
    if other:
        os.seteuid(0)
    for folder in place.iterdir():
        folder.chmod(0o777)
    shutil.rmtree(place)


def test_no_permission_is_found_out_before_the_run(restricted):
    for name, mode in (("closed", 0o000), ("read only", 0o555)):
        (restricted / name).mkdir()
        (restricted / name).chmod(mode)
        refused(restricted / name, "Permission denied")
        refused(restricted / name / "run", "Permission denied")
    write(restricted / "mine")
    assert left_in(restricted) == ["closed", "mine", "read only"]


# -- folders that are filled bit by bit ------------------------------------------------------------


def test_a_claimed_folder_is_new(tmp_path):
    (tmp_path / "compare-001").mkdir()
    assert make_numbered_folder(tmp_path, "compare") == tmp_path / "compare-002"
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "x"):
        with pytest.raises(UsageError):
            make_numbered_folder(place, "compare")


def test_a_new_folder_that_nothing_came_into_is_gone_again(tmp_path):
    for out in (None, str(tmp_path / "a" / "b")):
        with (
            pytest.raises(UsageError, match="bad"),
            make_results_folder(out, tmp_path / "studies", "x") as folder,
        ):
            assert left_in(folder) == []
            raise UsageError("bad")
    assert left_in(tmp_path) == []
    with make_results_folder(None, tmp_path / "studies", "x") as folder:
        (folder / "result").write_text("")
    assert left_in(tmp_path / "studies" / "x-001") == ["result"]


@pytest.mark.parametrize("name", ["link", "dangling", "full", "file", "a" * 300])
def test_a_new_folder_must_be_new(name, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("")
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to("empty")
    (tmp_path / "dangling").symlink_to("nowhere")
    before = left_in(tmp_path)
    with pytest.raises(UsageError), make_results_folder(str(tmp_path / name), tmp_path, "x"):
        pytest.fail("the block was entered")
    assert left_in(tmp_path) == before and left_in(tmp_path / "empty") == []
    with make_results_folder(str(tmp_path / "empty"), tmp_path, "x") as folder:
        assert folder == tmp_path / "empty"
    assert (tmp_path / "empty").is_dir()  # it was not ours to remove
