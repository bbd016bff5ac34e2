"""Every key of a scene has a test that sees its effect, or a reason why not."""

import importlib.util
import os
from pathlib import Path

import pytest
from parameter_keys import every_key

from components.aircraft.aircraft import Aircraft

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "tests.md"
TESTS = [
    path
    for path in sorted((ROOT / "tests").rglob("test_*.py"))
    if "from covering import" in path.read_text(encoding="utf-8")
]

#: Keys whose effect no test sees, with the reason.
UNCOVERED: dict[str, str] = {
    "operator.human.unattended": "it is about a page that is closed: tests/cdti/test_session.py",
    **{
        key: "calibration looks at an aircraft's areas and contrasts only"
        for key in every_key()
        if key.partition(".calibrate.aircraft.")[2].partition(".")[0]
        in ("mode_s", "mode_c", "icao_address", "ads_b")
    },
    "traffic.asterix.heights": "traffic.asterix is traffic.file, whose tests see it",
    # One block has three names.
    **{
        key: "traffic.file is traffic.csv, whose tests see it"
        for key in every_key()
        if key.startswith("traffic.file.")
        and key.split(".")[2] in ("intruder", "aircraft", "equipage_shares", "update_rate_hz")
    },
    **{
        key: "traffic.scripted's ownship: tests/traffic/scenes/test_files_of_any_kind.py flies it"
        for key in every_key()
        if key.startswith("traffic.") and key.split(".")[2] == "own_flight"
    },
    **{
        key: "an ownship is an aircraft as intruders are: tests/platforms compares both"
        for key in every_key()
        if (part := key.partition("ownship.")[2])
        and part.partition(".")[0] in {*Aircraft.model_fields, "name"}
        and key not in ("traffic.scripted.ownship.name", "traffic.random.ownship.name")
    },
    # The camera of pictures is one of these; what its own tests do not see.
    **{
        f"optical.image.{key.removeprefix('optical.eo.')}": "code of optical.eo, whose tests see it"
        for key in every_key()
        if key.startswith("optical.eo.calibrate.")
    },
    **{
        f"optical.image.{key}": "code of optical.eo, whose tests see it"
        for key in (
            "cued_threshold",
            "declare_by",
            "declare_rate_deg_s",
            "declare_speed_m_s",
            "glint_correlation_time_s",
            "glint_share",
            "model",
        )
    },
    **{
        f"optical.image.{key}": "a picture has no signature: nothing is added to it by a rate"
        for key in ("dynamic_weight", "rate")
    },
}


def covered() -> dict[str, set[str]]:
    """Return key → tests that claim to see its effect."""
    found: dict[str, set[str]] = {}
    for path in TESTS:
        spec = importlib.util.spec_from_file_location(f"covered_{path.stem}", path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        for name, test in vars(module).items():
            for key in getattr(test, "covers", ()):
                found.setdefault(key, set()).add(f"{path.name}::{name}")
    return found


def page(claims: dict[str, set[str]]) -> str:
    """Return the page that says for each type and table of a scene which files test its keys."""
    files = {path.name: path.relative_to(ROOT).as_posix() for path in TESTS}
    rows: dict[str, set[str]] = {}
    for key, tests in claims.items():
        owner = key.rpartition(".")[0] or "scene"
        rows.setdefault(owner, set()).update(files[test.partition("::")[0]] for test in tests)
    table = [f"| {owner} | {', '.join(sorted(of))} |" for owner, of in sorted(rows.items())]
    return "\n".join((_HEAD, *table, ""))


_HEAD = """# Which tests see which keys

A test that fails if a key of a scene had no effect, or a wrong one, is marked `@covers("KEY")`:
search the files below for a key. Rows are block types and tables of a scene. Made by
`DSA_DES_PAGES=1 python -m pytest tests/scene/test_every_key_is_covered.py`.

| type or table | files |
|---|---|"""


@pytest.fixture(scope="module")
def claims() -> dict[str, set[str]]:
    return covered()


def test_no_key_is_without_a_test(claims):
    """A new parameter needs a test here that sees its effect, marked with `covers`."""
    assert sorted(every_key() - claims.keys() - UNCOVERED.keys()) == []


def test_no_test_claims_a_key_that_there_is_not(claims):
    """A key that is gone or renamed takes its claim along."""
    known = every_key()
    assert {key: tests for key, tests in claims.items() if key not in known} == {}
    assert sorted(UNCOVERED.keys() - known) == []


def test_what_the_page_of_tests_says_holds(claims):
    """A type of which it does not speak yet is no error: the command on the page makes it anew."""
    if os.environ.get("DSA_DES_PAGES"):
        PAGE.write_text(page(claims), encoding="utf-8")
    now = dict(line.strip("| ").split(" | ") for line in page(claims).splitlines()[8:])
    said = dict(line.strip("| ").split(" | ") for line in PAGE.read_text().splitlines()[8:])
    assert len(said) > 100
    for owner, files in said.items():
        assert set(files.split(", ")) <= set(now[owner].split(", ")), owner


def test_what_is_uncovered_is_not_covered_and_has_its_reason(claims):
    assert sorted(UNCOVERED.keys() & claims.keys()) == []
    assert all(len(reason) > 20 for reason in UNCOVERED.values())


def test_each_claim_stands_where_the_key_is_written(claims):
    """The last part of a claimed key is found in the text of the file that claims it."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in TESTS}
    for key, tests in claims.items():
        last = key.rpartition(".")[2]
        for test in tests:
            text = texts[test.partition("::")[0]]
            found = last in text or last.removesuffix("_m2") in text
            assert found, f"{test} does not name {key}"
