"""Executors of a study's chunks: this process, a pool of processes, or a Dask cluster.

A chunk's part is written by the process that ran it (`run_and_write`), and what it came to goes to
whoever asked, as it comes, in any order. A chunk's rows do not depend on its worker, so neither do
the results, and it does no harm if one is written twice. Pieces whose process dies: `attempts.py`.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.shadowed_packages import is_own_entry_point
from dsa_des.errors import UsageError
from dsa_des.results.folder import Parts
from dsa_des.studies.attempts import Attempts, Piece, group_chunks
from dsa_des.studies.chunk import ChunkResult, run_chunks
from dsa_des.studies.study import Chunk, Study

#: How many pieces a worker has at a time: the next one is there when it ends the first.
_AHEAD = 2
_CONNECT_TIMEOUT_S = 5
_SAFE_PATH = "PYTHONSAFEPATH"
#: The folder that we were imported from.
_HOME = str(Path(__file__).parents[2])


class Executor(Protocol):
    """Interface of what runs chunks: in this process, in worker processes or on a cluster."""

    def run(self, study: Study, parts: Parts, chunks: Iterable[Chunk]) -> Iterator[ChunkResult]:
        """Run all chunks, have their parts written, and give what each came to when it is there.

        One that is no whole part, or was cut on the way, comes with its rows and is not written.
        """

    def close(self) -> None:
        """Stop all workers."""


def run_and_write(study: Study, parts: Parts, chunks: Sequence[Chunk]) -> list[ChunkResult]:
    """Run chunks together, write the part files of whole chunks and return all results; only
    unwritten ones keep their bytes.
    """
    parts.check_same_study()
    result = run_chunks(study, chunks)
    for k, chunk in enumerate(chunks):
        if chunk.whole:
            parts.write(result[k].name, result[k].content)
            result[k] = replace(result[k], content=b"")
    return result


class Serial:
    """Runs chunks one after the other in this process."""

    def run(self, study: Study, parts: Parts, chunks: Iterable[Chunk]) -> Iterator[ChunkResult]:
        """Run all chunks in their order."""
        for some in group_chunks(study, list(chunks), 1):
            yield from run_and_write(study, parts, some)

    def close(self) -> None:
        """Nothing to do."""


class Local:
    """Runs chunks in processes on this machine.

    Each process is a pool of its own, so that one that dies takes nothing with it but what it was
    at, and that is known. It is replaced, and `Attempts` says what is run again.
    """

    def __init__(self, workers: int) -> None:
        self._count = workers
        self._workers: list[_Worker] = []

    def run(self, study: Study, parts: Parts, chunks: Iterable[Chunk]) -> Iterator[ChunkResult]:
        """Run all chunks; two pieces per worker are under way at a time."""
        attempts = Attempts(study, group_chunks(study, list(chunks), self._count))
        if not self._workers or any(w.study is not study or len(w) for w in self._workers):
            self.close()
            self._workers = [_Worker(study) for _ in range(self._count)]
        while True:
            for depth in range(1, _AHEAD + 1):  # each worker has something before any has more
                for worker in self._workers:
                    if len(worker) < depth and (piece := attempts.next_piece()) is not None:
                        worker.submit(piece, parts)
            running = [future for worker in self._workers for future in worker.futures()]
            if not running:
                return
            wait(running, return_when=FIRST_COMPLETED)
            for worker in self._workers:
                yield from _results_of_finished_pieces(worker, attempts)

    def close(self) -> None:
        """Stop all workers."""
        for worker in self._workers:
            worker.stop()
        self._workers = []


class _Worker:
    """One worker process and the pieces submitted to it, in order."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self._pool: ProcessPoolExecutor | None = None
        self._given: deque[tuple[Future[list[ChunkResult]], Piece]] = deque()

    def __len__(self) -> int:
        return len(self._given)

    def futures(self) -> list["Future[list[ChunkResult]]"]:
        """Return the futures of all pieces submitted and not yet removed."""
        return [future for future, _ in self._given]

    def submit(self, piece: Piece, parts: Parts) -> None:
        """Submit a piece to the process, to run after those submitted before."""
        try:
            with safe_import_path():
                if self._pool is None:
                    self._pool = _new_pool(self.study)
                future = self._pool.submit(_run_in_worker, parts, piece.chunks)
        except BrokenProcessPool as error:  # it died since we looked
            future = Future()
            future.set_exception(error)
        self._given.append((future, piece))

    def pop_if_done(self) -> "tuple[Future[list[ChunkResult]], Piece] | None":
        """Pop the front future and piece if it is finished or its process died; else None."""
        return self._given.popleft() if self._given and self._given[0][0].done() else None

    def stop_and_take_unfinished(self) -> list[Piece]:
        """Stop a process that died, and return the pieces that it did not finish."""
        left = [piece for _, piece in self._given]
        self._given.clear()
        self.stop()
        return left

    def stop(self) -> None:
        """End the process."""
        if self._pool is not None:
            processes = list((getattr(self._pool, "_processes", None) or {}).values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            self._pool = None


def _results_of_finished_pieces(worker: _Worker, attempts: Attempts) -> Iterator[ChunkResult]:
    while (first := worker.pop_if_done()) is not None:
        future, piece = first
        try:
            done = attempts.accept_results_return_complete(piece, future.result())
        except BrokenProcessPool:
            for other in worker.stop_and_take_unfinished():
                attempts.requeue_piece(other)
            done = attempts.retry_after_crash(piece)
        yield from done


@contextmanager
def safe_import_path() -> Iterator[None]:
    """Inside the block, keep modules in the working or script folder from hiding others.

    Python puts the working directory first on the module path of each process that it starts with
    ``-c``: of workers, of the server that forks them, and of the tracker of what they share. Then
    they get our own path, which begins with the script's folder; its modules are found last.
    """
    before, path = os.environ.get(_SAFE_PATH), list(sys.path)
    os.environ[_SAFE_PATH] = "1"
    sys.path[:] = _script_folder_last(path)
    # Nor do they run the program again that started the study: it may be a script without a guard.
    program = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = program
        sys.path[:] = path
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def _script_folder_last(path: list[str]) -> list[str]:
    """Return a search path without the working directory and with the script's folder last.

    The folder that we were imported from stays, whichever it is.
    """
    if sys.flags.safe_path or path[:1] == [_HOME]:
        return path
    theirs = {"", os.getcwd()} - {_HOME}
    return [index for index in [*path[1:], *path[:1]] if index not in theirs]


def _new_pool(study: Study) -> ProcessPoolExecutor:
    # A fork of a process with threads (Arrow has some) may hang; workers start afresh instead.
    methods = multiprocessing.get_all_start_methods()
    method = "forkserver" if "forkserver" in methods else "spawn"
    context = multiprocessing.get_context(method)
    if method == "forkserver":  # what all workers need is imported once
        context.set_forkserver_preload(["dsa_des.studies.executors", *_own_block_modules(study)])
    return ProcessPoolExecutor(1, mp_context=context, initializer=_start_worker, initargs=(study,))


def _own_block_modules(study: Study) -> list[str]:
    """Return the names of those modules of a study's blocks that belong to this program."""
    ours = {
        point.module.partition(".")[0]
        for point in entry_points_of().values()
        if is_own_entry_point(point)
    }
    modules = {block.cls.__module__ for block in study.scene(0).blocks.values()}
    return sorted(name for name in modules if name.partition(".")[0] in ours)


#: What a worker runs chunks of: sent once, when it starts.
_studied: list[Study] = []


def _start_worker(study: Study) -> None:
    """Prepare a worker process: store its study, ignore ctrl-C, end with the parent process."""
    _studied[:] = [study]
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def exit_with_parent() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=exit_with_parent, daemon=True).start()


def _run_in_worker(parts: Parts, chunks: Sequence[Chunk]) -> list[ChunkResult]:
    try:
        return run_and_write(_studied[0], parts, chunks)
    except KeyboardInterrupt:  # raised by a block: ctrl-C does not come here
        os._exit(1)


_START_DASK = (
    "one is started by `dask scheduler`, which prints its address, and each of its workers by "
    "`dask worker ADDRESS`"
)


class Dask:
    """Runs chunks on a Dask cluster that is already there.

    Its workers need this package, and the scene's files and the study's folder under the same
    names: what goes through the scheduler are chunks, and how many runs each came to.
    """

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client
            from distributed.comm.addressing import get_address_host_port
        except ImportError:
            raise UsageError(
                "--executor dask needs the extra 'dask': pip install 'dsa-des[dask]'"
            ) from None
        try:
            get_address_host_port(scheduler, strict=True)
        except ValueError as error:
            raise UsageError(
                f"--scheduler {scheduler}: must be an address such as tcp://localhost:8786: {error}"
            ) from error
        try:
            self._client: Any = Client(scheduler, timeout=_CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise UsageError(
                f"--scheduler {scheduler}: no Dask scheduler answers there within "
                f"{_CONNECT_TIMEOUT_S} s ({type(error).__name__}); {_START_DASK}"
            ) from error

    def run(self, study: Study, parts: Parts, chunks: Iterable[Chunk]) -> Iterator[ChunkResult]:
        """Run all chunks; Dask itself first runs again what a dead worker was at."""
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        workers = len(self._client.scheduler_info(n_workers=-1)["workers"])
        attempts = Attempts(study, group_chunks(study, list(chunks), max(1, workers)))
        given: dict[Any, Piece] = {}
        running = as_completed(loop=self._client.loop)
        most = max(8, 4 * workers)

        def submit() -> None:
            while len(given) < most and (piece := attempts.next_piece()) is not None:
                future = self._client.submit(run_and_write, study, parts, piece.chunks, pure=False)
                given[future.key] = piece
                running.add(future)

        submit()
        if not given:
            return
        for future in running:
            piece = given.pop(future.key)
            try:
                done = attempts.accept_results_return_complete(piece, future.result())
            except KilledWorker:
                done = attempts.retry_after_crash(piece)
            submit()
            yield from done
            if not given:
                return

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._client.close()


def make_executor(kind: str, workers: int, scheduler: str | None) -> Executor:
    """Return the executor that command-line options choose: serial, local processes or Dask."""
    if kind == "dask":
        if scheduler is None:
            raise UsageError(
                "--executor dask needs --scheduler, for example tcp://localhost:8786; "
                + _START_DASK
            )
        return Dask(scheduler)
    if scheduler is not None:
        raise UsageError("--scheduler belongs to --executor dask")
    if workers > 1 and sys.flags.ignore_environment and not sys.flags.safe_path:
        raise UsageError(
            f"--workers {workers}: python -E has workers import from the working directory; "
            "give python -P as well, or --workers 1"
        )
    return Serial() if workers == 1 else Local(workers)


def usable_processor_count() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
