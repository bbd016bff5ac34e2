"""Which tests execute which line: made by a command, kept in the user's cache, never in the tree.

    python tests/mutation/coverage_map.py [--map FILE] [--workers N] [OF PYTEST ...]

It runs the tests under coverage.py (``pip install coverage``), one context for each test and for
each fixture that several tests share; processes that tests start are followed as well. With words
for pytest (a test, -m "not slow") only these are run, and take the place of what was known of them.
"""

import gzip
import json
import os
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections import defaultdict
from collections.abc import Iterable, Iterator
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "dsa_des_lines.json.gz"
_FOLDER, _CONTEXT = "DSA_DES_LINES", "DSA_DES_CONTEXT"
#: Lines of a process that a test starts; one forked from it begins with none.
_IN_CHILDREN = """
import os
if {context!r} in os.environ:
    import atexit, json
    import coverage
    lines = coverage.Coverage(data_file=None, include={include!r}, config_file=False)
    def anew():
        lines.stop(); lines.erase(); lines.start()
    def tell():
        lines.stop()
        data = lines.get_data()
        found = {{file: data.lines(file) for file in data.measured_files()}}
        place = os.path.join({folder!r}, "{{}}.%d" % os.getpid())
        with open(place.format("part"), "w") as file:
            json.dump([os.environ.get({context!r}, ""), found], file)
        os.replace(place.format("part"), place.format("child"))  # it may be killed meanwhile
    lines.start()
    atexit.register(tell)
    os.register_at_fork(after_in_child=anew)
"""


class Map:
    """Which tests execute a line, and how long each takes.

    Parameters
    ----------
    file : Path
        Where it is kept; without it nothing is known.
    """

    def __init__(self, file: Path) -> None:
        self.seconds: dict[str, float] = {}
        #: Processor time, with that of processes that ended within the test.
        self.cpu_s: dict[str, float] = {}
        self._texts: dict[str, list[str]] = {}
        self._lines: dict[str, dict[str, list[int]]] = {}
        self._tests: list[str] = []
        if file.exists():
            with gzip.open(file, "rt", encoding="utf-8") as stream:
                kept = json.load(stream)
            self.seconds, self._texts = kept["seconds"], kept["texts"]
            self.cpu_s = kept.get("cpu_s", {})
            self._lines, self._tests = kept["lines"], list(self.seconds)

    def executed(self, file: str, text: str) -> dict[int, list[str]]:
        """Return the tests of each line of a file, given its text as it stands now.

        A line that is new since the map was made has none.
        """
        known = self._lines.get(file, {})
        found = {}
        for old, new in self._places(file, text):
            tests = known.get(str(old))
            if tests:
                found[new] = [self._tests[test] for test in tests]
        return found

    def _places(self, file: str, text: str) -> Iterator[tuple[int, int]]:
        """Yield the number that a line had, and the one that it has."""
        before, now = self._texts.get(file, []), text.splitlines()
        if before == now:
            yield from ((line, line) for line in range(1, len(now) + 1))
            return
        for old, new, count in SequenceMatcher(
            a=before, b=now, autojunk=False
        ).get_matching_blocks():
            yield from ((old + k + 1, new + k + 1) for k in range(count))


class Recorder:
    """Pytest's plugin that writes down what is executed in which context."""

    def __init__(self, folder: Path) -> None:
        import coverage  # an extra of this tool alone

        self._folder = folder
        self._coverage = coverage.Coverage(
            data_file=str(folder / f"lines.{os.getpid()}"), include=_include(), config_file=False
        )
        self._coverage.start()
        self._told: dict[str, list] = {}

    def _enter(self, context: str) -> None:
        os.environ[_CONTEXT] = context
        self._coverage.switch_context(context)

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        shared = [
            _name(defined[-1])
            for defined in item._fixtureinfo.name2fixturedefs.values()
            if defined[-1].scope != "function"
        ]
        self._told[item.nodeid] = [0.0, 0.0, "passed", shared]
        self._enter(item.nodeid)
        begun, used = time.monotonic(), _used_s()
        yield
        self._told[item.nodeid][:2] = time.monotonic() - begun, _used_s() - used

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef) -> Iterator[None]:
        before = os.environ.get(_CONTEXT, "")
        if fixturedef.scope != "function":
            self._enter(_name(fixturedef))
        yield
        if fixturedef.scope != "function":
            self._enter(before)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.outcome != "passed" and report.nodeid in self._told:
            self._told[report.nodeid][2] = report.outcome

    def pytest_sessionfinish(self) -> None:
        self._coverage.stop()
        self._coverage.save()
        (self._folder / f"told.{os.getpid()}").write_text(json.dumps(self._told), encoding="utf-8")


def pytest_configure(config: pytest.Config) -> None:
    """Record where it is asked for; with several processes, in each that runs tests."""
    alone = hasattr(config, "workerinput") or not config.getoption("numprocesses", None)
    if _FOLDER in os.environ and alone:
        config.pluginmanager.register(Recorder(Path(os.environ[_FOLDER])))


def _name(fixture: pytest.FixtureDef) -> str:
    return f"fixture {fixture.baseid}::{fixture.argname}"


def _used_s() -> float:
    times = os.times()
    return sum(times[:4])


def _include() -> list[str]:
    return [str(ROOT / part / "*") for part in ("dsa_des", "components")]


def make(file: Path, tests: Iterable[str], workers: int) -> int:
    """Run tests and keep what they execute; return pytest's exit code."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "sitecustomize.py").write_text(
            _IN_CHILDREN.format(context=_CONTEXT, include=_include(), folder=place)
        )
        path = os.pathsep.join([place, str(Path(__file__).parent), str(ROOT)])
        environment = {**os.environ, _FOLDER: place, "PYTHONPATH": path}
        words = ["-m", "pytest", "-p", Path(__file__).stem, "-p", "no:cacheprovider", "--tb=short"]
        if workers > 1:
            words += ["-n", str(workers)]
        done = subprocess.run([sys.executable, *words, *tests], cwd=ROOT, env=environment)
        _keep(file, folder)
    return done.returncode


def _keep(file: Path, folder: Path) -> None:
    """Put what was recorded beside what is known of other tests."""
    told: dict[str, list] = {}
    for part in folder.glob("told.*"):
        told |= json.loads(part.read_text(encoding="utf-8"))
    users = defaultdict(set)
    for test, (_, _, _, shared) in told.items():
        users[test].add(test)
        for fixture in shared:
            users[fixture].add(test)
    found: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    for path, line, context in _recorded(folder):
        found[path][line] |= users[context]
    texts = {path: (ROOT / path).read_text(encoding="utf-8") for path in found}
    known = Map(file)
    seconds = {test: taken for test, taken in known.seconds.items() if test not in told}
    for path in known._texts:
        if (ROOT / path).is_file():
            texts[path] = (ROOT / path).read_text(encoding="utf-8")
            for line, tests in known.executed(path, texts[path]).items():
                found[path][line] |= {test for test in tests if test in seconds}
    seconds |= {test: round(row[0], 4) for test, row in told.items() if row[2] != "failed"}
    number = {test: k for k, test in enumerate(seconds)}
    lines = {
        path: {line: sorted(number[t] for t in tests if t in number) for line, tests in of.items()}
        for path, of in found.items()
    }
    kept = {
        "seconds": seconds,
        "cpu_s": known.cpu_s | {test: round(row[1], 2) for test, row in told.items()},
        "texts": {path: text.splitlines() for path, text in texts.items()},
        "lines": lines,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    with gzip.open(file, "wt", encoding="utf-8", compresslevel=3) as stream:
        json.dump(kept, stream, separators=(",", ":"))


def _recorded(folder: Path) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and context."""
    from coverage import CoverageData

    @cache
    def within(path: str) -> str:
        return Path(path).resolve().relative_to(ROOT).as_posix()

    for part in folder.glob("lines.*"):
        data = CoverageData(str(part))
        data.read()
        for path in data.measured_files():
            for line, contexts in data.contexts_by_lineno(path).items():
                yield from ((within(path), line, context) for context in contexts)
    for part in folder.glob("child.*"):
        context, found = json.loads(part.read_text(encoding="utf-8"))
        for path, lines in found.items():
            yield from ((within(path), line, context) for line in lines)


def main() -> int:
    """Make the map, or renew a part of it."""
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--map", type=Path, default=KEPT, metavar="FILE", help=f"default: {KEPT}")
    parser.add_argument("--workers", type=int, default=1, help="processes that run tests")
    asked, tests = parser.parse_known_args()
    return make(asked.map, tests, asked.workers)


if __name__ == "__main__":
    sys.exit(main())
