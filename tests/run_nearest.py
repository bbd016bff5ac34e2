"""Runs the tests of what a change touches and of what imports it, the nearest and cheapest first.

    python tests/run_nearest.py [--since COMMIT] [--touched FILE ...] [OF PYTEST ...]

The files that a branch changed since it left `main` (or COMMIT), and those not yet committed, are
what is touched, or else the FILEs. First the fast tests run, of the folder of their own room and
of those that import them, then of the rooms above in the import graph, step by step; then the slow
ones in the same order. Exhaustive tests are left out. It stops at the first tier that fails.
`random_faults.py` takes the order of a fault's tests from here.
"""

import re
import subprocess
import sys
import tomllib
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "support"))

import networkx as nx  # noqa: E402
from import_graph import imports, modules  # noqa: E402

#: How near a test file is: of the room itself, of what imports it, or of neither.
OWN, ABOVE, REST = range(3)


@cache
def files_of_tests() -> dict[str, set[str]]:
    """Return the words of each file of tests, names with dots whole, and what it imports."""
    found = {}
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        lines = re.findall(r"^\s*from ([\w.]+) import (\([^)]*\)|.*)$", text, re.MULTILINE)
        full = {f"{module}.{name}" for module, names in lines for name in re.findall(r"\w+", names)}
        found[path.relative_to(ROOT).as_posix()] = full | set(re.findall(r"\w[\w.]*", text))
    return found


def room_of(file: str) -> str:
    """Return the name that a file's room shares with the folder of its tests."""
    first, _, rest = file.removesuffix(".py").partition("/")
    return rest.partition("/")[0] if first in ("dsa_des", "components", "tests") else first


@cache
def registered_names() -> dict[str, str]:
    """Return the module of each name that scenes give to a block, a metric and so on."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        groups = tomllib.load(file)["project"]["entry-points"].values()
    return {name: target.partition(":")[0] for each in groups for name, target in each.items()}


@cache
def steps_above(module: str) -> dict[str, int]:
    """Return after how many imports each module is reached that needs this one."""
    return nx.single_source_shortest_path_length(imports().reverse(copy=False), module)


def order_tests(touched: Iterable[str]) -> dict[str, tuple[int, int]]:
    """Return how near each file of tests is to what is touched, the nearest first.

    Parameters
    ----------
    touched : iterable of str
        Files, as paths from the root of the project; tests and helpers of tests among them.

    Returns
    -------
    dict of str to (int, int)
        OWN, ABOVE or REST, then the number of imports between.
    """
    touched = sorted(touched)
    names = {path.relative_to(ROOT).as_posix(): module for module, path in modules().items()}
    steps: dict[str, int] = {}
    for file in touched:
        for module, count in steps_above(names[file]).items() if file in names else ():
            steps[module] = min(count, steps.get(module, count))
    rooms: dict[str, int] = {}
    for module, count in steps.items():
        room = room_of(module.replace(".", "/"))
        rooms[room] = min(count, rooms.get(room, count))
    own = {room_of(file) for file in touched}
    near = {}
    scenes_name = {name: steps[of] for name, of in registered_names().items() if of in steps}
    # What is no module of the product: a scene, or a helper of tests.
    others = {Path(file).stem for file in touched if file.startswith(("configs/", "tests/"))}
    for test, words in files_of_tests().items():
        counts = [steps[module] for module in words & steps.keys()]
        if room_of(test) in own or 0 in counts or words & others:
            near[test] = OWN, min(counts, default=1)
        else:
            counts += [rooms[room] for room in (room_of(test),) if room in rooms]
            counts += [1 + scenes_name[word] for word in words & scenes_name.keys()]
            near[test] = (ABOVE, min(counts)) if counts else (REST, 0)
    return dict(sorted(near.items(), key=lambda each: (each[1], each[0])))


def touched_files(since: str) -> list[str]:
    """Return what differs from the commit at which a branch left another, and what is new."""
    left = _git("merge-base", since, "HEAD")[0]
    new = _git("ls-files", "--others", "--exclude-standard")
    return sorted({*_git("diff", "--name-only", left), *new})


def _git(*words: str) -> list[str]:
    done = subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout.splitlines()


def main() -> int:
    """Run the fast tests of what is touched and of what is above it, then the slow ones."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--since", default="main", metavar="COMMIT", help="default: main")
    parser.add_argument("--touched", nargs="+", metavar="FILE", help="default: what git says")
    asked, words = parser.parse_known_args()
    if unknown := [file for file in asked.touched or () if not (ROOT / file).is_file()]:
        parser.error(f"no such file of the project: {', '.join(unknown)}")
    touched = asked.touched or touched_files(asked.since)
    tests = [test for test, (nearness, _) in order_tests(touched).items() if nearness < REST]
    print(f"{len(touched)} files touched, {len(tests)} files of tests", flush=True)
    for tier in ("not slow", "slow and not exhaustive") if tests else ():
        command = [sys.executable, "-m", "pytest", "-m", tier, *words, *tests]
        code = subprocess.run(command, cwd=ROOT).returncode
        if code not in (0, 5):  # 5: no test of this tier is among them
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
