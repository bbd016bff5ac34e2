"""The tiers of tests: what the lists name is there and marked, and each command runs its own."""

from pathlib import Path

import pytest

from tests import warm_process

ROOT = Path(__file__).parent.parent.parent
TIERS = ("exhaustive", "slow")
LISTED = {
    tier: [
        line
        for line in (ROOT / "tests" / f"{tier}.txt").read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    ]
    for tier in TIERS
}
TESTS = """def test_fast(): pass
def test_slow(): pass
def test_exhaustive(): pass
"""


def test_what_is_listed_exists() -> None:
    """A name that went would leave its test in the tier below."""
    lines = [line for tier in TIERS for line in LISTED[tier]]
    sources = {file: (ROOT / file).read_text(encoding="utf-8")
               for file in {line.partition("::")[0] for line in lines}}  # fmt: skip
    for line in lines:
        file, _, function = line.partition("::")
        assert not function or f"def {function.rpartition('::')[2]}(" in sources[file], line


@pytest.mark.parametrize("tier", TIERS)
def test_a_list_is_sorted_and_has_no_doubles(tier: str) -> None:
    assert sorted(set(LISTED[tier])) == LISTED[tier]


@pytest.mark.parametrize("tier", TIERS)
def test_what_is_listed_is_marked(tier: str, request: pytest.FixtureRequest) -> None:
    listed = set(LISTED[tier])
    for item in request.session.items:
        file, _, rest = item.nodeid.partition("::")
        if {file, f"{file}::{rest.partition('[')[0]}"} & listed:
            assert item.get_closest_marker(tier) and item.get_closest_marker("slow")


@pytest.mark.parametrize(
    ("words", "run"),
    [
        ([], {"a::fast", "a::slow"}),
        (["-n", "1"], {"a::fast", "a::slow"}),
        (["-m", "not slow"], {"a::fast"}),
        (["-m", "exhaustive"], {"a::exhaustive", "b::fast", "b::slow", "b::exhaustive"}),
        (["-k", "exhaustive"], {"a::exhaustive", "b::fast", "b::slow", "b::exhaustive"}),
        (["tests/test_b.py"], {"b::fast", "b::slow", "b::exhaustive"}),
    ],
)
def test_a_command_runs_its_tier(words: list[str], run: set[str], tmp_path: Path) -> None:
    """Without words all but the exhaustive; what is named by file or expression is run."""
    tests = tmp_path / "tests"
    tests.mkdir()
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\ntestpaths = tests\naddopts = --import-mode=importlib\n"
        "markers =\n slow\n exhaustive\n"
    )
    for name in "ab":
        (tests / f"test_{name}.py").write_text(TESTS)
    (tests / "slow.txt").write_text("tests/test_a.py::test_slow\n")
    (tests / "exhaustive.txt").write_text("tests/test_a.py::test_exhaustive\ntests/test_b.py\n")
    (tests / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text())
    done = warm_process.run(["-m", "pytest", "-v", "-p", "no:cacheprovider", *words], cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    passed = {
        place.replace("tests/test_", "").replace(".py::test_", "::")
        for line in done.stdout.splitlines() if "PASSED" in line
        for place in line.split() if "::" in place
    }  # fmt: skip
    assert passed == run, done.stdout
