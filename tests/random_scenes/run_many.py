"""Run thousands of random scenes: ``python tests/random_scenes/run_many.py --count 3000``.

Every scene is run in all ways of `comparisons.ways`; replicas in lock step and one by one; every
so many scenes also in processes of other hash seeds, and as a study of one and of two workers.
Seeds of scenes that differ, stop or hang are printed, and the scenes are written to a folder. The
exit code is 1 if there are any.
"""

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import studies
from comparisons import TooLong, Verdict, judge, time_limit
from dice import Dice
from random_scene import legal_case

# After so many times the limit a worker does not listen to its own clock: it is ended from outside.
_PATIENCE = 100


def one(
    seed: int, limit_s: float, every: int, changing: float, equipped: float
) -> tuple[Verdict, set[str], list[str]]:
    """Judge the scene of a seed; return also its features and the refusals before it."""
    with tempfile.TemporaryDirectory(prefix="random-scene-") as name:
        folder = Path(name)
        try:
            with time_limit(10 * limit_s):
                case = legal_case(seed, folder, changing, equipped)
        except TooLong:
            return Verdict("hung", "while it is loaded"), set(), []
        except Exception as error:
            return Verdict("stopped", f"loading: {type(error).__name__}: {error}"), set(), []
        verdict = judge(case, folder, limit_s)
        if verdict.kind == "same" and every and seed % every == 0:
            verdict = _outside(case, folder, limit_s)
        return verdict, case.features, case.refused


def _outside(case: Any, folder: Path, limit_s: float) -> Verdict:
    """Judge a scene by processes of their own."""
    try:
        found = studies.hash_seeds_differ([case.write(folder)], 10 * limit_s)
        case.features.add("other hash seeds")
        if not found:
            study = studies.write_study(case, folder, Dice(case.seed))
            found = studies.workers_differ(study, 10 * limit_s)
            case.features.add("study refused" if found == "refused" else "study of 1 and 2 workers")
            found = "" if found == "refused" else found
    except TimeoutExpired as error:
        return Verdict("hung", f"{error.cmd[1:4]} over {error.timeout:g} s")
    return Verdict("different", found) if found else Verdict("same")


def _worker(
    connection: Connection, limit_s: float, every: int, changing: float, equipped: float
) -> None:
    while True:
        seed = connection.recv()
        connection.send(one(seed, limit_s, every, changing, equipped))


class _Worker:
    """A process that judges one scene at a time, and is replaced when it does not come back."""

    def __init__(self, limit_s: float, every: int, changing: float, equipped: float) -> None:
        self._arguments = limit_s, every, changing, equipped
        self.limit_s = _PATIENCE * limit_s
        self.start()

    def start(self) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        self.process = multiprocessing.Process(
            target=_worker, args=(theirs, *self._arguments), daemon=False
        )
        self.process.start()
        theirs.close()
        self.seed: int | None = None

    def give(self, seed: int) -> None:
        self.seed, self.since = seed, time.monotonic()
        self.connection.send(seed)

    def answer(self) -> tuple[Verdict, set[str], list[str]]:
        try:
            return self.connection.recv()
        except EOFError:
            self.process.join()
            code = self.process.exitcode
            self.start()
            return Verdict("stopped", f"the process ended with code {code}"), set(), []

    def overdue(self) -> bool:
        return self.seed is not None and time.monotonic() - self.since > self.limit_s

    def end(self) -> None:
        self.process.kill()
        self.process.join()


def judged(
    seeds: list[int], workers: int, limit_s: float, every: int, changing: float, equipped: float
) -> Iterator[tuple[int, Verdict, set[str], list[str]]]:
    """Yield what came of each seed, as it comes."""
    todo = deque(seeds)
    crew = [_Worker(limit_s, every, changing, equipped) for _ in range(max(1, workers))]
    try:
        while todo or any(worker.seed is not None for worker in crew):
            for worker in crew:
                if worker.seed is None and todo:
                    worker.give(todo.popleft())
            busy = {worker.connection: worker for worker in crew if worker.seed is not None}
            for ready in wait(list(busy), timeout=1.0):
                worker = busy[ready]  # type: ignore[index]
                seed, answer = worker.seed, worker.answer()
                worker.seed = None
                assert seed is not None
                yield seed, *answer
            for worker in crew:
                if worker.overdue() and not worker.connection.poll():
                    seed = worker.seed
                    assert seed is not None
                    worker.end()
                    worker.start()
                    yield seed, Verdict("hung", "had to be killed"), set(), []
    finally:
        for worker in crew:
            worker.end()


def main() -> None:
    """Judge as many scenes as asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="how many scenes [3000]")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first [1]")
    parser.add_argument("--workers", type=int, default=2, help="processes [2]")
    parser.add_argument("--limit", type=float, default=20.0, help="longest run, processor s [20]")
    parser.add_argument("--every", type=int, default=100, help="scenes from one study to the next")
    parser.add_argument("--changing", type=float, default=0.2, help="share that changes [0.2]")
    parser.add_argument("--equipped", type=float, default=1 / 3, help="with more platforms [1/3]")
    parser.add_argument("--out", type=Path, default=Path("random-scenes"), help="for faulty scenes")
    options = parser.parse_args()
    kinds: Counter[str] = Counter()
    features: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    started = time.monotonic()
    seeds = list(range(options.seed, options.seed + options.count))
    for seed, verdict, has, reasons in judged(
        seeds, options.workers, options.limit, options.every, options.changing, options.equipped
    ):
        kinds[verdict.kind] += 1
        features.update(has)
        refused.update(reasons)
        done = sum(kinds.values())
        if done % 250 == 0:
            print(f"{done} of {options.count} done", file=sys.stderr, flush=True)
        if verdict.kind != "same":
            print(f"{seed} {verdict.kind}: {verdict.detail}", flush=True)
            _keep(seed, options.out, options.changing, options.equipped)
    print(f"features of {sum(kinds.values())} scenes:")
    for feature, count in sorted(features.items()):
        print(f"  {count:6} {feature}")
    print("scenes refused before a legal one was drawn, by message:")
    for reason, count in refused.most_common(40):
        print(f"  {count:6} {reason[:150]}")
    total = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    print(f"{sum(kinds.values())} scenes in {time.monotonic() - started:.0f} s: {total}")
    sys.exit(0 if set(kinds) <= {"same"} else 1)


def _keep(seed: int, out: Path, changing: float, equipped: float) -> None:
    """Write a faulty scene, with what it reads, to a folder of its own."""
    folder = out / str(seed)
    try:
        with time_limit(60):
            legal_case(seed, folder, changing, equipped)
    except (TooLong, Exception) as error:
        print(f"  not written: {error}")


if __name__ == "__main__":
    main()
