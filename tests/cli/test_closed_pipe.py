"""Output into a pipe whose reader has gone, as of ``dsa-des ... | head``: a quiet end."""

import os
import re
import subprocess
import sys

import pytest

from tests import warm_process


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
        started = ["-m", "dsa_des", *words]
        if words == ("--help",):
            ended = subprocess.run(
                [sys.executable, *started], stdout=writer, stderr=subprocess.PIPE, text=True,
                cwd=tmp_path, check=False,
            )  # fmt: skip
        else:
            ended = warm_process.run(started, stdout=writer, cwd=tmp_path)
    finally:
        os.close(writer)
    assert ended.returncode == 1
    said = [
        line for line in ended.stderr.splitlines() if not re.match(r"note: |\d+ notes?: ", line)
    ]
    assert said == []
    if words[0] == "run":  # what is done is kept, and whole
        assert (tmp_path / "kept" / "detections.parquet").stat().st_size > 0
        assert not list(tmp_path.glob(".dsa_des-*"))
