"""In CI a skipped test is named, and one that ought to run fails the run."""

import os
from pathlib import Path

import pytest

from tests import warm_process

ROOT = Path(__file__).parent.parent.parent
TESTS = """import pytest
def test_that_runs(): pass
def test_without_an_extra(): pytest.skip("{reason}")
"""


@pytest.mark.parametrize(
    ("reason", "ci", "code"),
    [("needs an extra", "true", 1), ("needs an extra", "", 0), ("no raster", "true", 0)],
)
def test_an_unexpected_skip_fails_in_ci(reason, ci, code, tmp_path: Path) -> None:
    (tmp_path / "test_any.py").write_text(TESTS.format(reason=reason))
    (tmp_path / "skips.txt").write_text("# allowed\ntest_any.py | raster\n")
    for tier in ("slow", "exhaustive"):
        (tmp_path / f"{tier}.txt").write_text("")
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text())
    done = warm_process.run(
        ["-m", "pytest", "-q", "-p", "no:cacheprovider", "test_any.py"],
        cwd=tmp_path, env={**os.environ, "CI": ci},
    )  # fmt: skip
    assert done.returncode == code, done.stdout
    named = f"test_any.py::test_without_an_extra: Skipped: {reason}" in done.stdout
    assert named == bool(ci)
    told = f"not allowed by tests/skips.txt: test_any.py::test_without_an_extra: {reason}"
    assert (told in done.stdout) == bool(code)


def test_what_may_be_skipped_is_sorted_and_there() -> None:
    lines = (ROOT / "tests" / "skips.txt").read_text(encoding="utf-8").splitlines()[1:]
    assert lines == sorted(set(lines))
    for line in lines:
        place, _, reason = line.partition(" | ")
        assert (ROOT / place).exists() and reason
