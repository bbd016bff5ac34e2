"""A file is written as a whole or not at all, and never through a link."""

import os
from pathlib import Path

import pytest

from dsa_des.errors import UsageError
from dsa_des.files import output_file
from dsa_des.files.output_file import check_file_writable, write_file


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("end", ["precious", "nowhere", "link"])
def test_a_link_is_replaced_and_what_it_points_to_stays(end, tmp_path):
    (tmp_path / "precious").write_text("work")
    (tmp_path / "link").symlink_to(end)
    write_file(tmp_path / "link", b"new")
    assert not (tmp_path / "link").is_symlink()
    assert (tmp_path / "link").read_bytes() == b"new"
    assert (tmp_path / "precious").read_text() == "work"
    assert left_in(tmp_path) == ["link", "precious"]


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("old")

    def fail(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match=r"No space left on device: '.*file'"):
        write_file(tmp_path / "file", b"new")
    assert left_in(tmp_path) == ["file"] and (tmp_path / "file").read_text() == "old"


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("folder", "is a folder"),
        ("to folder", "is a folder"),
        ("pipe", "is a device or a pipe"),
        ("to pipe", "is a device or a pipe"),
        ("no/x", "there is no folder"),
        ("file/x", "there is no folder"),
        ("loop", "Too many levels of symbolic links"),
        ("x" * 300, "File name too long"),
        ("a\0", "NUL"),
    ],
)
def test_what_can_be_no_file_is_refused_beforehand(name, match, tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "to folder").symlink_to("folder")
    (tmp_path / "to pipe").symlink_to("pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "to file").symlink_to("file")
    before = left_in(tmp_path)
    with pytest.raises(UsageError, match=match):
        check_file_writable(tmp_path / name)
    assert left_in(tmp_path) == before
    for good in ("file", "new", "to file"):
        check_file_writable(tmp_path / good)
    assert left_in(tmp_path) == before


def test_names_in_folders_of_the_system_are_refused(tmp_path, monkeypatch):
    # Never with the real ones: a test that fails must not replace what stands there.
    (tmp_path / "dev" / "shm").mkdir(parents=True)
    (tmp_path / "log").write_text("")
    (tmp_path / "dev" / "stdout").symlink_to("../log")  # as when output goes to a file
    (tmp_path / "elsewhere").symlink_to("dev")
    monkeypatch.setattr(output_file, "_SYSTEM", (str(tmp_path / "dev"),))
    monkeypatch.setattr(output_file, "_ORDINARY", (str(tmp_path / "dev" / "shm"),))
    for name in ("dev/stdout", "elsewhere/stdout", "dev/new"):
        with pytest.raises(UsageError, match="is in a folder of the system"):
            check_file_writable(tmp_path / name)
    check_file_writable(tmp_path / "dev" / "shm" / "x")
    assert output_file._SYSTEM and left_in(tmp_path / "dev") == ["shm", "stdout"]


def test_the_real_folders_of_the_system_are_known():
    for name in ("/dev/stdout", "/dev/null", "/proc/self/fd/1", "/dev/fd/1"):
        with pytest.raises(UsageError, match=r"of the system|of a file is needed"):
            check_file_writable(Path(name))  # it looks and writes nothing
