"""A reader that keeps what it read reads a file again only when that has changed."""

import os
from pathlib import Path

import pytest

from dsa_des.files.input_files import cache_file_reads


def test_a_file_is_read_again_when_it_changed(tmp_path: Path) -> None:
    reads = []

    @cache_file_reads(2)
    def shouted(path: Path, end: str = "!") -> str:
        reads.append(path.name)
        return path.read_text() + end

    one = tmp_path / "one"
    one.write_text("a")
    assert shouted(one) == shouted(one) == "a!" and len(reads) == 1
    assert shouted(one, "?") == "a?" and len(reads) == 2
    one.write_text("bb")
    assert shouted(one) == "bb!"
    one.write_text("cc")  # as long as before, at another time
    os.utime(one, ns=(1, 1))
    assert shouted(one) == "cc!" and len(reads) == 4
    for name in ("two", "three"):  # the oldest is forgotten
        (tmp_path / name).write_text(name)
        shouted(tmp_path / name)
    assert shouted(one) == "cc!" and reads[4:] == ["two", "three", "one"]


def test_what_is_wrong_is_said_by_the_reader(tmp_path: Path) -> None:
    read = cache_file_reads(2)(Path.read_text)
    with pytest.raises(FileNotFoundError, match="missing"):
        read(tmp_path / "missing")
    with pytest.raises(ValueError, match="null"):
        read(Path("a\0b"))
