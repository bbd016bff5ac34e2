"""Which chunks are run next, and again when their process died.

Consecutive chunks of a cell whose runs share lock steps are run together, as many as a lock step
holds. Those whose process dies are run one by one; a chunk that is alone is run once more, and then
cut in halves until the guilty run is alone. A single run is tried again when nothing else is under
way, so that neither the memory of others nor a kill of all workers is its fault. Only then it has
crashed.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter

import numpy as np

from dsa_des.errors import BlockFailure, SceneError
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.replicas.lock_step_size import RunSize
from dsa_des.replicas.replicas import reason_against_lock_step
from dsa_des.running.loops import longest_delay_cut_edges
from dsa_des.studies.chunk import ChunkResult, crashed_chunk_result, join_chunk_results
from dsa_des.studies.study import Chunk, Study

#: How often a chunk may lose its process before it is cut.
_PATIENCE = 2
#: How often a single run may lose its process before it has crashed.
TRIES = 3


@dataclass(frozen=True)
class Piece:
    """Chunks, or some runs of one, to run in one process, and how often a process died on them."""

    chunks: tuple[Chunk, ...]
    losses: int = 0


class Attempts:
    """The rest of a study: hands out pieces, collects results, retries if a process died."""

    def __init__(self, study: Study, together: Iterable[tuple[Chunk, ...]]) -> None:
        self._study = study
        self._todo = iter(together)
        self._again: list[Piece] = []
        self._alone: deque[Piece] = deque()
        self._running = 0
        self._only = False
        #: Of chunks that were cut: how many runs are missing, and what is there.
        self._missing: dict[str, int] = {}
        self._there: dict[str, list[ChunkResult]] = {}

    def next_piece(self) -> Piece | None:
        """Return the next piece to run; None if none may be started now."""
        piece = None
        if self._only:
            return None
        if self._again:
            piece = self._again.pop()
        elif (chunks := next(self._todo, None)) is not None:
            piece = Piece(chunks)
        elif self._alone and not self._running:
            piece, self._only = self._alone.popleft(), True
        self._running += piece is not None
        return piece

    def requeue_piece(self, piece: Piece) -> None:
        """Put back a piece that was not started, or was lost through no fault of its own."""
        self._note_piece_ended()
        self._again.append(piece)

    def accept_results_return_complete(
        self, piece: Piece, results: Iterable[ChunkResult]
    ) -> list[ChunkResult]:
        """Take in a finished piece's results, and return those of chunks that are now complete."""
        self._note_piece_ended()
        return [whole for one in results if (whole := self._join_if_complete(one)) is not None]

    def retry_after_crash(self, piece: Piece) -> list[ChunkResult]:
        """Put back a piece whose process died, if need be in parts; if it is given up, return its
        chunk's result once complete.
        """
        self._note_piece_ended()
        chunk, losses = piece.chunks[0], piece.losses + 1
        if len(piece.chunks) > 1:
            self._again += [Piece((one,)) for one in reversed(piece.chunks)]
        elif len(chunk) == 1 and losses >= TRIES:
            crashed = self._join_if_complete(crashed_chunk_result(self._study, chunk, TRIES))
            return [] if crashed is None else [crashed]
        elif len(chunk) == 1:
            self._alone.append(Piece((chunk,), losses))
        elif losses < _PATIENCE:
            self._again.append(Piece((chunk,), losses))
        else:
            self._missing.setdefault(chunk.name, len(chunk))
            # A single run begins to count anew; halves were warned.
            for half in split_chunk(chunk):
                self._again.append(Piece((half,), 0 if len(half) == 1 else losses - 1))
        return []

    def _note_piece_ended(self) -> None:
        self._running -= 1
        self._only = False

    def _join_if_complete(self, result: ChunkResult) -> ChunkResult | None:
        name = result.name
        if name not in self._missing:
            return result
        self._there.setdefault(name, []).append(result)
        self._missing[name] -= result.runs
        if self._missing[name]:
            return None
        del self._missing[name]
        return join_chunk_results(name, self._there.pop(name))


def group_chunks(
    study: Study, chunks: Sequence[Chunk], workers: int
) -> Iterator[tuple[Chunk, ...]]:
    """Yield groups of a cell's consecutive chunks to run at once, with equal work per worker."""
    if len(chunks) < 2:
        yield from ((chunk,) for chunk in chunks)
        return
    most = _lock_step_size(study, chunks[0].runs[0][0])
    total = sum(chunk.expected_flown for chunk in chunks)
    per = total / (workers * math.ceil(total / (workers * most))) if most else 0.0
    for cell_goes_on in _consecutive_chunks(chunks):
        flown = np.array([chunk.expected_flown for chunk in cell_goes_on])
        count = math.ceil(flown.sum() / per - 1e-9) if most else len(flown)
        of = ((np.cumsum(flown) - 0.5 * flown) * (count / flown.sum())).astype(int).tolist()
        for _, mine in groupby(zip(of, cell_goes_on, strict=True), key=itemgetter(0)):
            yield tuple(chunk for _, chunk in mine)


def _consecutive_chunks(chunks: Iterable[Chunk]) -> Iterator[list[Chunk]]:
    """Yield lists of consecutive chunks, each beginning in the cell where the one before ends."""
    chain: list[Chunk] = []
    for chunk in chunks:
        if chain and chain[-1].runs[-1][0] != chunk.runs[0][0]:
            yield chain
            chain = []
        chain.append(chunk)
    yield chain


def _lock_step_size(study: Study, cell: int) -> int:
    """Return how many runs of a cell are simulated at once; 0 if that would save nothing.

    A feedback loop goes through as many windows, whatever these hold.
    """
    try:
        scene = study.scene(cell)
        if not longest_delay_cut_edges(scene) or reason_against_lock_step(
            scene, [study.replica(n, cell) for n in (0, 1)]
        ):
            return 0
        return RunSize.estimate(replica_scene(scene, study.replica(0, cell)), {}).largest_run_count
    except (SceneError, BlockFailure):  # its rows say why
        return 0


def split_chunk(chunk: Chunk) -> tuple[Chunk, Chunk]:
    """Return the first and the second half of a chunk's runs."""
    left = len(chunk) // 2
    first: list[tuple[int, int, int]] = []
    second: list[tuple[int, int, int]] = []
    for cell, start, end in chunk.runs:
        cut = min(end, start + left)
        left -= cut - start
        first += [(cell, start, cut)] * (start < cut)
        second += [(cell, cut, end)] * (cut < end)
    pieces = (replace(chunk, runs=tuple(runs), whole=False) for runs in (first, second))
    return next(pieces), next(pieces)
