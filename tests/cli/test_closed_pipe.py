"""Output into a pipe whose reader has gone, as of ``dsa-des ... | head``: a quiet end."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("examples",),
        ("components", "radar.swerling"),
        ("explain", "first_light"),
        ("graph", "first_light"),
        ("run", "first_light", "--set", "duration_s=2", "--out", "kept"),
        ("study", "--metrics"),
    ],
)
def test_a_reader_that_went_away_ends_a_command_quietly(words, tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "dsa_des", *words],
            stdout=writer, stderr=subprocess.PIPE, text=True, cwd=tmp_path, check=False,
        )  # fmt: skip
    finally:
        os.close(writer)
    assert ended.returncode == 1
    said = [line for line in ended.stderr.splitlines() if not line.startswith("note: ")]
    assert said == []
    if words[0] == "run":  # what is done is kept, and whole
        assert (tmp_path / "kept" / "detections.parquet").stat().st_size > 0
        assert not list(tmp_path.glob(".dsa_des-*"))
