"""What all tests share."""

import gc
import os
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest

# Tests share helpers and scenes; importlib mode by itself puts nothing on the path.
sys.path.extend(sorted({str(p.parent) for p in Path(__file__).parent.rglob("*.py")} - {*sys.path}))
# What runs tests in parallel sets the width of its own terminal, which our tables would obey.
os.environ.pop("COLUMNS", None)
# As many workers as processors: threads of linear algebra would spin while others compute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def keep_bytecode_elsewhere() -> None:
    """Keep what Python compiles in a folder of this user's, where the tree is to stay free of it.

    Tests start hundreds of processes, each of which would compile the package anew.
    """
    folder = Path(tempfile.gettempdir()) / f"dsa_des_bytecode_{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.is_symlink() or folder.stat().st_uid != os.getuid():
        return
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(folder)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder)


if sys.dont_write_bytecode and hasattr(os, "getuid"):
    keep_bytecode_elsewhere()

# Only now: pytest rewrites hypothesis too, some hundred files, and keeps what it makes of them.
from hypothesis import HealthCheck, settings  # noqa: E402

# A machine that is busy with something else is no defect of what is tested.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")

ROOT = Path(__file__).parent.parent


def hold_problems_to_sentences() -> None:
    """Let no problem of a scene take a key or a value for its sentence, whoever reports it."""
    from dsa_des.errors import Problem

    made = Problem.__init__

    def checked(self: Problem, source: str, key: str, message: str, *value: Any, **by_name: Any):
        is_sentence = isinstance(message, str) and " " in message
        by_product = sys._getframe(1).f_globals["__name__"].startswith(("dsa_des.", "components."))
        assert not by_product or (is_sentence and isinstance(key, str)), (source, key, message)
        made(self, source, key, message, *value, **by_name)

    Problem.__init__ = checked  # type: ignore[method-assign]


hold_problems_to_sentences()


@pytest.fixture(scope="session")
def configs() -> Path:
    """The folder of the project's scenes."""
    return ROOT / "configs"


@pytest.fixture
def lab(tmp_path):
    """Scenes of small test blocks, with a folder to write in (`lab.lab_in`)."""
    from lab import lab_in

    return lab_in(tmp_path)


@cache
def listed(name: str) -> list[str]:
    """Return the lines of a list beside this file, without its remarks."""
    lines = Path(__file__).with_name(name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


#: The lists of tests that take long, by their marker; what is exhaustive is slow too.
TIERS = {"exhaustive": "exhaustive.txt", "slow": "slow.txt"}


def pytest_configure(config: pytest.Config) -> None:
    """Leave the exhaustive tests out where neither tests nor a tier are named."""
    options = config.option
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if whole and not (options.markexpr or options.keyword):
        options.markexpr = "not exhaustive"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import files of which no test is wanted."""
    wanted = config.getoption("markexpr")
    if not collection_path.is_file() or wanted not in ("not slow", "not exhaustive", "exhaustive"):
        return None
    file = collection_path.relative_to(ROOT).as_posix()
    if wanted == "exhaustive":
        named = {line.partition("::")[0] for line in listed("exhaustive.txt")}
        return (collection_path.name.startswith("test_") and file not in named) or None
    return file in left_out(wanted) or None


@cache
def left_out(wanted: str) -> set[str]:
    """Return what is listed and not of the tier that is wanted."""
    return {*listed("exhaustive.txt"), *(listed("slow.txt") if wanted == "not slow" else ())}


def pytest_pycollect_makeitem(collector: pytest.Module | pytest.Class, name: str) -> list | None:
    """Do not make the cases of tests that are left out: half of all."""
    wanted, named = collector.config.getoption("markexpr"), "::" in " ".join(collector.config.args)
    if named or wanted not in ("not slow", "not exhaustive"):
        return None
    return [] if f"{collector.nodeid}::{name}" in left_out(wanted) else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what tests/slow.txt and tests/exhaustive.txt list."""
    tiers = {tier: set(listed(name)) for tier, name in TIERS.items()}
    for item in items:
        file, _, rest = item.nodeid.partition("::")
        for tier, lines in tiers.items():
            if file in lines or f"{file}::{rest.split('[')[0]}" in lines:
                item.add_marker(tier)
                item.add_marker("slow")


def pytest_collection_finish() -> None:
    """Do not look through what stays anyhow, tests and modules, for garbage at every turn."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each worker one stretch of the tests, of which idle ones take the end.

    What a module's or a session's tests share is made once so, and hardly ever by every worker.
    """
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getvalue("dist") == "load" else None


def unexpected_skips(config: pytest.Config) -> list[str]:
    """Return the skipped tests, with their reasons, that tests/skips.txt does not allow."""
    found = []
    for report in config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", []):
        place, reason = report.nodeid, str(report.longrepr[2]).removeprefix("Skipped: ")
        allowed = (line.partition(" | ")[::2] for line in listed("skips.txt"))
        if not any(place.startswith(where) and text in reason for where, text in allowed):
            found.append(f"{place}: {reason}")
    return found


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where CI is set, fail if a test was skipped that ought to run."""
    here = os.environ.get("CI") == "true" and not hasattr(session.config, "workerinput")
    if here and session.exitstatus == pytest.ExitCode.OK and unexpected_skips(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Where CI is set, name every test that was skipped."""
    if os.environ.get("CI") != "true":
        return
    terminalreporter.section("skipped")
    for report in terminalreporter.stats.get("skipped", []):
        terminalreporter.line(f"{report.nodeid}: {report.longrepr[2]}")
    for line in unexpected_skips(config):
        terminalreporter.line(f"not allowed by tests/skips.txt: {line}", red=True)
