"""Ways to run one scene that must give the same bytes, and what differs where they do not."""

import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import random_changes
from dice import Dice
from random_scene import Case

from dsa_des.block.message import Text
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.replicas.lockstep import NotInLockStep, make_lockstep_simulation
from dsa_des.replicas.replicas import Failed, Recorded, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene

#: Table → column → values as plain arrays.
Tables = Mapping[str, Mapping[str, Any]]


class TooLong(BaseException):
    """A run took longer than it may; nothing but the caller may catch it."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `TooLong` in what takes more processor time than this (in the main thread).

    Ten times as long by the clock on the wall is too long as well: a machine may be busy, but not
    that busy.
    """

    def stop(*_: Any) -> None:
        raise TooLong

    limits = {
        (signal.SIGPROF, signal.ITIMER_PROF): seconds,
        (signal.SIGALRM, signal.ITIMER_REAL): 10 * seconds,
    }
    before = {number: signal.signal(number, stop) for number, _ in limits}
    for (_, timer), limit in limits.items():
        signal.setitimer(timer, limit)
    try:
        yield
    finally:
        for number, timer in limits:
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])


def plain(tables: Tables) -> dict[str, dict[str, Any]]:
    """Return tables whose columns are arrays of bits or of text."""
    return {
        table: {name: _bits(values) for name, values in columns.items()}
        for table, columns in tables.items()
    }


def _bits(values: Any) -> Any:
    if isinstance(values, Text):
        names = np.array([*values.names, ""], dtype=object)
        return names[values.codes]  # code -1 is null
    values = np.asarray(values)
    if values.dtype != np.float64:
        return values
    # A null is a null, whatever its bits; all else is compared by them.
    return np.where(np.isnan(values), np.nan, values).view(np.int64)


def recorded(
    scene: Scene, *, longest_ticks: int | None = None, **options: Any
) -> dict[str, dict[str, Any]]:
    """Run a scene and return everything it records, and what its blocks report."""
    sink = ColumnSink()
    simulation = Simulation(scene, recorder=Recorder([sink]), **options)
    if longest_ticks is not None:
        simulation.windows.limit_length(longest_ticks)
    outcome = simulation.run()
    return {**plain(sink.tables()), "(report)": flat(outcome.report)}


def flat(report: Any, path: str = "") -> dict[str, Any]:
    """Return the sections that blocks report as columns of one value each, by dotted name."""
    if not isinstance(report, Mapping):
        return {path: np.array([repr(report)], dtype=object)}
    found: dict[str, Any] = {}
    for key, value in report.items():
        found |= flat(value, f"{path}.{key}" if path else str(key))
    return found


def difference(one: Tables, other: Tables) -> str:
    """Return the first thing in which two recordings differ, or nothing."""
    if one.keys() != other.keys():
        return f"tables {sorted(one.keys() ^ other.keys())}"
    for table, columns in one.items():
        if columns.keys() != other[table].keys():
            return f"{table}: columns {sorted(columns.keys() ^ other[table].keys())}"
        for name, values in columns.items():
            against = other[table][name]
            if len(values) != len(against):
                return f"{table}: {len(values)} rows, {len(against)}"
            unequal = np.flatnonzero(values != against)
            if len(unequal):
                row = int(unequal[0])
                return f"{table}.{name} row {row}: {values[row]!r}, {against[row]!r}"
    return ""


def ways(case: Case, scene: Scene, dice: Dice, folder: Path) -> Iterator[tuple[str, Any]]:
    """Yield ways to run a scene: what it is, and a function that records it."""

    def run(**options: Any) -> Callable[[], Any]:
        return lambda: recorded(scene, **options)

    yield "window=1", run(window=1)
    odd = dice.pick(2, 3, 7, 13)
    yield f"window={odd}", run(window=odd)
    end = Simulation(scene).end_tick
    longest = end // dice.randint(1, 12) + dice.randint(1, 999)  # ends at no scan in particular
    window = dice.pick(None, None, 29)
    yield f"longest={longest}, window={window}", run(longest_ticks=longest, window=window)
    ties, window = dice.randrange(100), dice.pick(None, None, 5)
    yield f"shuffle_ties={ties}, window={window}", run(shuffle_ties=ties, window=window)

    def reordered() -> Any:
        other = case.reordered(dice)
        return recorded(load_scene(other.write(folder, "reordered.toml")))

    yield "blocks and wires in another order", reordered


@dataclass
class Verdict:
    """What came of one scene.

    Parameters
    ----------
    kind : str
        ``"same"``, ``"different"``, ``"stopped"`` or ``"hung"``.
    detail : str
        In which way it was run, and what differed or stopped it.
    """

    kind: str
    detail: str = ""


def judge(case: Case, folder: Path, limit_s: float) -> Verdict:
    """Run a scene in all ways and say whether they gave the same.

    Parameters
    ----------
    case : Case
    folder : Path
        Where to write it.
    limit_s : float
        Longest time for each run, s.
    """
    dice = Dice(case.seed)
    scene, way = case.load(folder), "default"
    try:
        with time_limit(limit_s):
            first = recorded(scene)
        for way, other in ways(case, scene, dice, folder):
            with time_limit(limit_s):
                found = difference(first, other())
            if found:
                return Verdict("different", f"{way}: {found}")
        way = "replicas"
        with time_limit(6 * limit_s):
            found = _replicas_differ(case, scene, dice)
    except TooLong:
        return Verdict("hung", f"{way}: over {limit_s:g} s")
    except Exception as error:
        return Verdict("stopped", f"{way}: {type(error).__name__}: {error}")
    return Verdict("different", found) if found else Verdict("same")


def _replicas_differ(case: Case, scene: Scene, dice: Dice) -> str:
    """Compare replicas run together with the same ones run by themselves."""
    replicas = random_changes.replicas(case.tables, dice)
    case.features |= dice.features
    window, tables, failure = dice.pick(1, 3, 40), None, ""
    try:
        tables = _in_lock_step([replica_scene(scene, one) for one in replicas], window)
        case.features.add("replicas in lock step")
    except NotInLockStep:
        case.features.add("replicas one by one")
        if dice.chance(0.8):
            return ""  # together they run as they do by themselves
    except (SceneError, BlockFailure) as error:
        case.features.add("replica that fails")
        failure = str(error)
    how = f"replicas {[(one.seed, dict(one.changes)) for one in replicas]}"
    apart = [run_replicas(scene, [replica], runs=len(replicas))[0] for replica in replicas]
    for number, (one, other) in enumerate(zip(apart, run_replicas(scene, replicas), strict=True)):
        if found := _outcomes_differ(one, other):
            return f"{how}: number {number}: {found}"
    if failure and not any(isinstance(one, Failed) for one in apart):
        return f"{how}: only together: {failure}"
    if tables is None:
        return ""
    for number, one in enumerate(apart):
        if isinstance(one, Failed):
            return f"{how}: number {number} fails alone, not in lock step: {one.error}"
        part = {
            table: {
                name: values[columns["replica"] == number]
                for name, values in columns.items()
                if name != "replica"
            }
            for table, columns in tables.items()
        }
        if found := difference(plain(one.tables), part):
            return f"{how} in lock step, window={window}: number {number}: {found}"
    return ""


def _in_lock_step(scenes: list[Scene], window: int) -> dict[str, dict[str, Any]]:
    """Return what replicas in lock step record.

    Raises
    ------
    NotInLockStep, SceneError
    """
    sink = ColumnSink()
    make_lockstep_simulation(scenes, recorder=Recorder([sink]), window=window).run()
    return plain(sink.tables())


def _outcomes_differ(one: Recorded | Failed, other: Recorded | Failed) -> str:
    if isinstance(one, Failed) or isinstance(other, Failed):
        return "" if one == other else f"{_error_of(one)}, together {_error_of(other)}"
    if found := difference(plain(one.tables), plain(other.tables)):
        return found
    return difference({"(report)": flat(one.report())}, {"(report)": flat(other.report())})


def _error_of(outcome: Recorded | Failed) -> str:
    return repr(outcome.error) if isinstance(outcome, Failed) else "no failure"


def digest(scene: Path) -> str:
    """Return a fingerprint of everything that a scene records."""
    import hashlib

    found = hashlib.sha256()
    for table, columns in sorted(recorded(load_scene(scene)).items()):
        for name, values in columns.items():
            found.update(f"{table}.{name} {len(values)}".encode())
            text = values.dtype == object
            found.update("\0".join(values).encode() if text else values.tobytes())
    return found.hexdigest()


if __name__ == "__main__":  # the fingerprints of some scenes, for processes of other hash seeds
    for argument in sys.argv[1:]:
        print(digest(Path(argument)))
