"""A copy of the project in which one fault at a time is put, and tests are run."""

import gc
import importlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import types
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest
from definitions import ROOT
from fault import Fault

#: Set where a tool runs from a copy that it made of the tree.
_IN_A_COPY = "DSA_DES_FAULTS_IN_A_COPY"
CAUGHT, SURVIVED, OF_THE_LIST = "caught", "survived", "error of the list"
_PARTS = (
    "dsa_des", "components", "configs", "tests", "docs", "pyproject.toml", "README.md",
    "CHANGELOG.md", "CONTRIBUTING.md",
)  # fmt: skip
# What every run of the tests would load anew; nothing of the project may be among it.
_LOADED_ONCE = (
    "numpy", "scipy.special", "scipy.optimize", "pydantic", "pyarrow.parquet", "simpy", "networkx",
    "rich.console", "rich.table", "click", "mpmath", "pymap3d", "geographiclib.geodesic",
    "hypothesis.strategies", "_hypothesis_pytestplugin", "matplotlib.figure", "scipy.stats",
)  # fmt: skip
# Pytest warns that it can no longer rewrite the assertions of what is loaded already.
_QUIET = ("-W", "ignore::pytest.PytestAssertRewriteWarning", "-q", "--tb=no")
_NO_TESTS = 5  # what pytest ends with where none is left
_TOLD = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


@dataclass(frozen=True)
class Outcome:
    """What became of a fault: how it ended, what noticed it, how long that took, and when."""

    name: str
    result: str
    by: str
    seconds: float
    digest: str
    at: str


class TestRun:
    """Tests that run in a copy, in a process of their own.

    The process is forked from this one, in which the libraries are loaded already: that halves the
    time for a fault.

    Parameters
    ----------
    folder : Path
        Copy of the project.
    tests : iterable of str
        Files or node ids.
    *options : str
        Of pytest.
    limit_s : float
        After this time it is ended.
    plugins : sequence
        Of pytest.
    """

    __test__ = False

    def __init__(
        self,
        folder: Path,
        tests: Iterable[str],
        *options: str,
        limit_s: float = 180.0,
        plugins: Sequence[object] = (),
    ) -> None:
        self._said = folder / ".said"
        self._begun, self._limit_s = time.monotonic(), limit_s
        self._late = False
        arguments = [*options, *_QUIET, "-p", "no:cacheprovider", *tests]
        _load_libraries()
        sys.stdout.flush()
        self._process = os.fork()
        if self._process == 0:
            _run_here(folder, arguments, plugins, self._said)

    @property
    def seconds(self) -> float:
        """Return how long it has been running."""
        return time.monotonic() - self._begun

    def ended(self) -> tuple[int | None, str] | None:
        """Return pytest's exit code, None for out of time, and what it said; None if it runs."""
        process, status = os.waitpid(self._process, os.WNOHANG)
        if process:
            said = self._said.read_text(encoding="utf-8", errors="replace")
            return None if self._late else os.waitstatus_to_exitcode(status), said
        if self.seconds > self._limit_s and not self._late:
            self._late = True
            os.killpg(self._process, signal.SIGKILL)
        return None

    def end(self) -> tuple[int | None, str]:
        """Wait until it has ended."""
        while (ended := self.ended()) is None:
            time.sleep(0.05)
        return ended


def _load_libraries() -> None:
    for name in _LOADED_ONCE:
        importlib.import_module(name)
    gc.freeze()


def _run_here(folder: Path, arguments: list[str], plugins: Sequence[object], said: Path) -> None:
    """Run pytest in this process, a fork, and end it."""
    code = 70
    try:
        os.setsid()
        os.chdir(folder)
        file = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(file, stream)
        os.environ["PYTHONPATH"] = str(folder)
        os.environ.pop("PYTEST_ADDOPTS", None)
        ours = (str(ROOT / "tests"), str(ROOT / "docs"))
        left = [place for place in sys.path if place != str(ROOT) and not place.startswith(ours)]
        sys.path[:] = [str(folder), *left]
        # What this tool has loaded of the tests would stand for what is in the copy.
        for name, module in list(sys.modules.items()):
            if str(getattr(module, "__file__", None) or "").startswith(ours):
                del sys.modules[name]
        sys.argv = ["pytest", *arguments]
        # Processes that tests spawn would load this tool again.
        sys.modules["__main__"] = types.ModuleType("__main__")
        code = int(pytest.main(arguments, plugins=list(plugins)))
        sys.stdout.flush()
    finally:
        os._exit(code)


class FaultyCopy:
    """A copy of the working tree; the tree itself is never touched.

    Parameters
    ----------
    folder : Path
        Empty folder for the copy.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in _PARTS:
            source = ROOT / name
            if source.is_dir():
                left_out = shutil.ignore_patterns("__pycache__", ".*")
                shutil.copytree(source, folder / name, ignore=left_out)
            elif source.exists():
                shutil.copy2(source, folder / name)
        self._touched = 0

    def clean(self, tests: Iterable[str]) -> str:
        """Run tests without a fault; return what they say if they do not pass."""
        run = TestRun(self.folder, sorted(set(tests)), "--maxfail=5", limit_s=1800.0)
        code, said = run.end()
        return "" if code == 0 else said

    def put_in(self, fault: Fault) -> None:
        """Put a fault in.

        Raises
        ------
        ValueError
            If it does not fit the file.
        """
        text = fault.applied()
        path = self.folder / fault.file
        path.write_text(text, encoding="utf-8")
        # Bytecode is kept by time and size: each version of the file gets a time of its own.
        self._touched += 1
        changed_s = (ROOT / fault.file).stat().st_mtime - 10.0 * self._touched
        os.utime(path, (changed_s, changed_s))

    def take_out(self, fault: Fault) -> None:
        """Put the original file back."""
        shutil.copy2(ROOT / fault.file, self.folder / fault.file)


class Trial:
    """A fault in a copy, and its tests that run there, one round after another.

    Parameters
    ----------
    fault : Fault or DrawnFault
    copy : FaultyCopy
    rounds : sequence of callable
        Each starts a round of tests in a folder; the first that notices the fault is the last.
    """

    def __init__(
        self, fault: Fault, copy: FaultyCopy, rounds: Sequence[Callable[[Path], TestRun]] = ()
    ) -> None:
        self.fault, self.copy = fault, copy
        self._wrong, self._run = "", None
        self._left = deque(rounds or [lambda folder: TestRun(folder, fault.tests, "-x")])
        self._seconds = 0.0
        try:
            copy.put_in(fault)
        except ValueError as error:
            self._wrong = str(error)
            return
        self._run = self._left.popleft()(copy.folder)

    def outcome(self) -> Outcome | None:
        """Return what became of the fault, and take it out; None while its tests run."""
        if self._run is None:
            return self._told(OF_THE_LIST, self._wrong)
        ended = self._run.ended()
        if ended is None:
            return None
        self._seconds += self._run.seconds
        result, by = _judged(*ended)
        if result == SURVIVED and self._left:
            self._run = self._left.popleft()(self.copy.folder)
            return None
        self.copy.take_out(self.fault)
        return self._told(result, by)

    def _told(self, result: str, by: str) -> Outcome:
        fault, seconds = self.fault, round(self._seconds, 1)
        return Outcome(fault.name, result, by, seconds, fault.digest, f"{datetime.now(UTC):%F}")


def tried(
    faults: Iterable[Fault],
    copies: Iterable[FaultyCopy],
    rounds: Callable[[Fault], Sequence[Callable[[Path], TestRun]]] = lambda fault: (),
) -> Iterator[tuple[Fault, Outcome]]:
    """Yield each fault and what became of it, as many at once as there are copies."""
    waiting, free, running = deque(faults), deque(copies), []
    while waiting or running:
        while waiting and free:
            fault = waiting.popleft()
            running.append(Trial(fault, free.popleft(), rounds(fault)))
        for trial in list(running):
            outcome = trial.outcome()
            if outcome is not None:
                running.remove(trial)
                free.append(trial.copy)
                yield trial.fault, outcome
        time.sleep(0.02)


def copies_in(folder: Path, count: int) -> list[FaultyCopy]:
    """Make copies; data that lie beside the project lie beside them as well."""
    beside = ROOT.parent / "shared"
    if beside.exists():
        (folder / "shared").symlink_to(beside.resolve())
    places = [folder / str(number) for number in range(count)]
    for place in places:
        place.mkdir()
    return [FaultyCopy(place) for place in places]


def from_a_copy(tool: Callable[[], int]) -> int:
    """Run the tool that was started from a copy of the tree, which may change meanwhile.

    All that the tool reads later, of product, tests or lists, is as it was at its start.
    """
    if _IN_A_COPY in os.environ:
        return tool()
    with tempfile.TemporaryDirectory() as folder:
        (copy,) = copies_in(Path(folder), 1)
        started = copy.folder / Path(sys.argv[0]).resolve().relative_to(ROOT)
        environment = {**os.environ, _IN_A_COPY: "yes"}
        return subprocess.run([sys.executable, started, *sys.argv[1:]], env=environment).returncode


def _judged(code: int | None, said: str) -> tuple[str, str]:
    """Tell what pytest's exit code (None: out of time) means for a fault."""
    if code is None:
        return CAUGHT, "the time limit"
    if code in (0, _NO_TESTS):
        return SURVIVED, ""
    told = _TOLD.search(said)
    if code in (1, 2) and told:
        return CAUGHT, told[1]
    return OF_THE_LIST, f"pytest ended with {code}: {said[-300:]}"
