"""Who runs the chunks of a study: this process, a pool of processes, or a Dask cluster.

An executor gives results as they come, in any order, and survives workers that die. What a chunk
gives does not depend on who ran it, so neither do the results.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, Protocol

from dsa_des.errors import UsageError
from dsa_des.studies.chunk import Done, failed_chunk, run_chunk
from dsa_des.studies.study import Chunk, Study

#: How often a chunk may lose its worker before its runs are tried one by one.
_PATIENCE = 2
_CONNECT_TIMEOUT_S = 5
_SAFE_PATH = "PYTHONSAFEPATH"


class Executor(Protocol):
    """Something that runs chunks."""

    def run(self, study: Study, chunks: Iterable[Chunk]) -> Iterator[Done]:
        """Run all chunks and give each result when it is there."""

    def close(self) -> None:
        """Stop all workers."""


class Serial:
    """Runs chunks one after the other in this process."""

    def run(self, study: Study, chunks: Iterable[Chunk]) -> Iterator[Done]:
        """Run all chunks in their order."""
        for chunk in chunks:
            yield run_chunk(study, chunk)

    def close(self) -> None:
        """Nothing to do."""


class Local:
    """Runs chunks in a pool of processes on this machine.

    When a worker dies the pool is made anew and what it was at is run again. A chunk that keeps
    losing its worker is run by itself, run by run: those that kill it are recorded as failed.

    Parameters
    ----------
    workers : int
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: ProcessPoolExecutor | None = None

    def run(self, study: Study, chunks: Iterable[Chunk]) -> Iterator[Done]:
        """Run all chunks; two per worker are under way at a time."""
        todo = iter(chunks)
        again: list[Chunk] = []
        losses: dict[str, int] = {}
        running: dict[Future[Done], Chunk] = {}
        while True:
            while len(running) < 2 * self.workers:
                chunk = again.pop() if again else next(todo, None)
                if chunk is None:
                    break
                try:
                    running[self._submit(study, chunk)] = chunk
                except BrokenProcessPool:
                    again.append(chunk)
                    if running:
                        break
                    self._renew()
            if not running:
                return
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = False
            for future in finished:
                chunk = running.pop(future)
                try:
                    yield future.result()
                except BrokenProcessPool:
                    broken = True
                    again.append(chunk)
                    losses[chunk.name] = losses.get(chunk.name, 0) + 1
            if broken:
                again += running.values()
                running.clear()
                self._renew()
                for chunk in [c for c in again if losses.get(c.name, 0) > _PATIENCE]:
                    again.remove(chunk)
                    yield self._alone(study, chunk)

    def _submit(self, study: Study, chunk: Chunk) -> "Future[Done]":
        if self._pool is None:
            self._pool = _new_pool(self.workers)
        with not_from_here():
            return self._pool.submit(run_chunk, study, chunk)

    def _renew(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = None

    def _alone(self, study: Study, chunk: Chunk) -> Done:
        """Run a chunk's runs one by one, each in a worker of its own if need be."""
        parts: list[Done] = []
        pool = _new_pool(1)
        for cell, start, end in chunk.runs:
            for number in range(start, end):
                single = Chunk(chunk.name, ((cell, number, number + 1),))
                try:
                    with not_from_here():
                        future = pool.submit(run_chunk, study, single)
                    parts.append(future.result())
                except BrokenProcessPool:
                    pool.shutdown(wait=False)
                    pool = _new_pool(1)
                    parts.append(failed_chunk(study, single, "the process that ran it died"))
        pool.shutdown()
        return joined(chunk.name, parts)

    def close(self) -> None:
        """Stop all workers."""
        if self._pool is not None:
            processes = list((getattr(self._pool, "_processes", None) or {}).values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            self._pool = None


def joined(name: str, parts: list[Done]) -> Done:
    """Return parts of a chunk as one."""
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.concat_tables([pq.read_table(io.BytesIO(part.content)) for part in parts])
    buffer = io.BytesIO()
    pq.write_table(table.combine_chunks(), buffer, compression="zstd")
    failed = sum(part.failed for part in parts)
    return Done(name, buffer.getvalue(), table.num_rows, failed)


@contextmanager
def not_from_here() -> Iterator[None]:
    """Let processes that are started meanwhile import nothing of the working directory.

    Python puts it first on the module path of a process that it starts with ``-c``.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def _new_pool(workers: int) -> ProcessPoolExecutor:
    # A fork of a process with threads (Arrow has some) may hang; workers start afresh instead.
    methods = multiprocessing.get_all_start_methods()
    method = "forkserver" if "forkserver" in methods else "spawn"
    context = multiprocessing.get_context(method)
    if method == "forkserver":  # what all workers need is imported once
        context.set_forkserver_preload(["dsa_des.studies.executors"])
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)


def _start_worker() -> None:
    """Leave ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()


class Dask:
    """Runs chunks on a Dask cluster that is already there.

    Its workers need this package, and the scene's files under the same names; results travel back
    through the scheduler.

    Parameters
    ----------
    scheduler : str
        Address, for example ``tcp://host:8786``.

    Raises
    ------
    UsageError
        If Dask is not installed or the scheduler does not answer.
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
                f"{_CONNECT_TIMEOUT_S} s ({type(error).__name__})"
            ) from error

    def run(self, study: Study, chunks: Iterable[Chunk]) -> Iterator[Done]:
        """Run all chunks; Dask itself runs again what a dead worker was at."""
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        waiting = iter(chunks)
        names: dict[Any, Chunk] = {}
        running = as_completed(loop=self._client.loop)

        def submit() -> bool:
            chunk = next(waiting, None)
            if chunk is None:
                return False
            future = self._client.submit(run_chunk, study, chunk, pure=False)
            names[future.key] = chunk
            running.add(future)
            return True

        for _ in range(max(8, 4 * len(self._client.scheduler_info(n_workers=-1)["workers"]))):
            if not submit():
                break
        if not names:
            return
        for future in running:
            chunk = names.pop(future.key)
            try:
                done = future.result()
            except KilledWorker:
                done = failed_chunk(study, chunk, "the process that ran it died")
            submit()
            yield done
            if not names:
                return

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._client.close()


def make_executor(kind: str, workers: int, scheduler: str | None) -> Executor:
    """Return the executor that a command line asks for.

    Raises
    ------
    UsageError
        If it cannot be had.
    """
    if kind == "dask":
        if scheduler is None:
            raise UsageError("--executor dask needs --scheduler, for example tcp://localhost:8786")
        return Dask(scheduler)
    if scheduler is not None:
        raise UsageError("--scheduler belongs to --executor dask")
    return Serial() if workers == 1 else Local(workers)


def default_workers() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
